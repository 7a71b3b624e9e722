//! Complementarity problems over cones, friction in space among them, and methods for them.

use std::ops::Range;
use std::rc::Rc;
use std::time::Instant;

use semismooth::complementarity::McpFunction;
use semismooth::cones::{Cone, ConeProblem, ConeSolver};
use semismooth::contact::{DelassusProblem, DelassusSolver};
use semismooth::linear::IncompleteLu;
use semismooth::newton::{Damping, Newton, NewtonKrylov, NewtonKrylovOptions, NewtonOptions};
use semismooth::piecewise::{Assembled, Semismooth};
use semismooth::sparse::{Matrix, Pattern};

use crate::common::{Outcome, Random};
use crate::contenders::{MEMORY, Run, SOLVED, TOLERANCE, Told, told};
use crate::textbook::{Direction, minimise};

pub(crate) type OverCones = ConeProblem<Box<dyn McpFunction>>;

type Attempt = fn(&OverCones, &mut [f64]) -> Outcome<Told>;

/// The contenders: Newton's method for the natural and the normal map, with an element of the B-subdifferential of the projection, and
/// `ConeSolver`.
pub(crate) const CONE_METHODS: [(&str, Attempt); 8] = [
    ("natural map, full steps", |p, x| newton(p, x, Damping::Never)),
    ("natural map, line search on trouble", |p, x| {
        newton(p, x, Damping::OnTrouble)
    }),
    ("natural map, line search", |p, x| newton(p, x, Damping::Always)),
    ("natural map, nonmonotone line search", |p, x| {
        Ok(minimise(&ConeMap::natural(p)?, x, Direction::Newton, MEMORY))
    }),
    ("natural map, Levenberg-Marquardt", |p, x| {
        Ok(minimise(&ConeMap::natural(p)?, x, Direction::Marquardt, 1))
    }),
    ("inexact natural map (GMRES, ILU)", |p, x| {
        let map = ConeMap::natural(p)?;
        let options = NewtonKrylovOptions::default().with_relative_tolerance(TOLERANCE);
        let mut newton = NewtonKrylov::new(options);
        // A failure leaves the best iterate, which is judged.
        newton
            .solve(&mut Assembled::new(&map, IncompleteLu::default()), x)
            .ok();
        Ok(told(newton.report()))
    }),
    ("normal map, line search on trouble", |p, x| {
        let map = ConeMap {
            normal: true,
            ..ConeMap::natural(p)?
        };
        let mut newton = Newton::new(NewtonOptions::default());
        newton.solve_semismooth(&map, x).ok();
        p.project(x)?;
        Ok(told(newton.report()))
    }),
    ("ConeSolver", |p, x| {
        let report = ConeSolver::default().solve(p, x)?;
        Ok(Told {
            // The solver does not tell them apart from its steps.
            evaluations: report.iterations,
            iterations: report.iterations,
            factorisations: report.factorisations,
            ..Told::default()
        })
    }),
];

fn newton(p: &OverCones, x: &mut [f64], damping: Damping) -> Outcome<Told> {
    let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
    newton.solve_semismooth(&ConeMap::natural(p)?, x).ok();
    Ok(told(newton.report()))
}

/// The natural map x − P(x − F(x)), or the normal map F(P(x)) + x − P(x).
struct ConeMap<'a> {
    problem: &'a OverCones,
    normal: bool,
    /// Second-order cones, half-lines and free variables, one by one, and the one of each variable.
    parts: Vec<(Cone, Range<usize>)>,
    part_of: Vec<usize>,
}

impl<'a> ConeMap<'a> {
    fn natural(problem: &'a OverCones) -> Outcome<Self> {
        let (mut parts, mut part_of) = (Vec::new(), Vec::new());
        for cone in problem.cones() {
            let (one, width) = match cone {
                Cone::Nonnegative(_) => (Cone::Nonnegative(1), 1),
                Cone::Free(_) => (Cone::Free(1), 1),
                Cone::SecondOrder(width) => (*cone, *width),
                _ => return Err("derivatives are those of second-order cones".into()),
            };
            for _ in 0..cone.len() / width {
                let first = part_of.len();
                part_of.resize(first + width, parts.len());
                parts.push((one, first..first + width));
            }
        }
        Ok(Self {
            problem,
            normal: false,
            parts,
            part_of,
        })
    }

    fn range(&self, variable: usize) -> Range<usize> {
        self.parts[self.part_of[variable]].1.clone()
    }

    /// F′ at a point.
    fn derivative(&self, x: &[f64]) -> Matrix {
        let mut matrix = Matrix::zeros(self.problem.function().pattern());
        self.problem.function().jacobian(x, &mut matrix);
        matrix
    }
}

/// An element of the B-subdifferential of the projection on a cone, row by row.
fn projection_element(cone: Cone, z: &[f64]) -> Vec<Vec<f64>> {
    let n = z.len();
    let multiple = |a: f64| -> Vec<Vec<f64>> {
        let row = |i: usize| (0..n).map(|j| if i == j { a } else { 0.0 }).collect();
        (0..n).map(row).collect()
    };
    if matches!(cone, Cone::Free(_)) {
        return multiple(1.0);
    }
    let length = z[1..].iter().map(|v| v * v).sum::<f64>().sqrt();
    if z[0] >= length {
        return multiple(1.0);
    }
    if z[0] <= -length {
        return multiple(0.0);
    }
    let slope = z[0] / length;
    let unit: Vec<f64> = z.iter().map(|v| v / length).collect();
    let mut element = multiple(0.5 * (1.0 + slope));
    element[0][0] = 0.5;
    for i in 1..n {
        element[0][i] = 0.5 * unit[i];
        element[i][0] = 0.5 * unit[i];
        for j in 1..n {
            element[i][j] -= 0.5 * slope * unit[i] * unit[j];
        }
    }
    element
}

impl Semismooth for ConeMap<'_> {
    fn num_vars(&self) -> usize {
        self.part_of.len()
    }

    fn residual(&self, x: &[f64], out: &mut [f64]) {
        let mut projected = x.to_vec();
        if self.normal {
            self.parts
                .iter()
                .for_each(|(c, r)| c.project(&mut projected[r.clone()]));
            self.problem.function().value(&projected, out);
        } else {
            self.problem.function().value(x, out);
            projected.iter_mut().zip(&*out).for_each(|(z, f)| *z -= f);
            self.parts
                .iter()
                .for_each(|(c, r)| c.project(&mut projected[r.clone()]));
            out.fill(0.0);
        }
        out.iter_mut()
            .zip(x)
            .zip(&projected)
            .for_each(|((out, x), p)| *out += x - p);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let mut z = x.to_vec();
        let f = if self.normal {
            let mut projected = x.to_vec();
            self.parts
                .iter()
                .for_each(|(c, r)| c.project(&mut projected[r.clone()]));
            self.derivative(&projected)
        } else {
            let mut f = vec![0.0; x.len()];
            self.problem.function().value(x, &mut f);
            z.iter_mut().zip(&f).for_each(|(z, f)| *z -= f);
            self.derivative(x)
        };
        let elements: Vec<_> = self
            .parts
            .iter()
            .map(|(cone, range)| projection_element(*cone, &z[range.clone()]))
            .collect();
        for ((_, range), element) in self.parts.iter().zip(&elements) {
            for (i, row) in range.clone().zip(element) {
                for (j, v) in range.clone().zip(row) {
                    jac.add(i, j, f64::from(u8::from(i == j)) - v);
                }
            }
        }
        for (i, j, v) in f.triplets() {
            let along = if self.normal { j } else { i };
            let (element, range) = (&elements[self.part_of[along]], self.range(along));
            for (k, other) in range.clone().enumerate() {
                let weight = element[along - range.start][k];
                let (row, column) = if self.normal { (i, other) } else { (other, j) };
                jac.add(row, column, weight * v);
            }
        }
    }

    fn pattern(&self) -> Pattern {
        let n = self.num_vars();
        let f = self.problem.function().pattern();
        let columns = (0..n).flat_map(|j| f.col_ptr()[j]..f.col_ptr()[j + 1]);
        let column_of: Vec<usize> = (0..n)
            .flat_map(|j| std::iter::repeat_n(j, f.col_ptr()[j + 1] - f.col_ptr()[j]))
            .collect();
        let of_f = columns.flat_map(|k| {
            let (i, j) = (f.row_idx()[k], column_of[k]);
            let (rows, columns) = match self.normal {
                true => (i..i + 1, self.range(j)),
                false => (self.range(i), j..j + 1),
            };
            rows.flat_map(move |i| columns.clone().map(move |j| (i, j)))
        });
        let own = (0..n).flat_map(|i| self.range(i).map(move |j| (i, j)));
        Pattern::from_entries(n, n, of_f.chain(own)).unwrap_or_else(|_| Pattern::full(n, n))
    }
}

/// Friction u = M r + q over second-order cones: with r = (s₀/μ, s₁, …) and û = u + μ‖u_T‖ e_N (G. de Saxcé, Z.-Q. Feng, Math. Comput.
/// Model. 28 (1998)), s and (û_N/μ, u_T) lie in the cone and are perpendicular.
struct DeSaxce {
    problem: Rc<DelassusProblem>,
    /// Of F, which puts the diagonal of M near 1.
    scale: f64,
}

/// 1/μ for normal components, 1 for the others.
fn weight(problem: &DelassusProblem, i: usize) -> f64 {
    let width = problem.dimension();
    match i % width {
        0 => 1.0 / problem.friction()[i / width],
        _ => 1.0,
    }
}

fn reactions(problem: &DelassusProblem, s: &[f64]) -> Vec<f64> {
    let weighted = s.iter().enumerate().map(|(i, s)| s * weight(problem, i));
    weighted.collect()
}

impl DeSaxce {
    /// (u_N/μ, u_T) of r(s).
    fn velocities(&self, s: &[f64], out: &mut [f64]) {
        out.copy_from_slice(self.problem.q());
        let matrix = self.problem.matrix().as_ref();
        matrix.mul_add(1.0, &reactions(&self.problem, s), out);
        for (i, u) in out.iter_mut().enumerate() {
            *u *= self.scale * weight(&self.problem, i);
        }
    }
}

impl McpFunction for DeSaxce {
    fn num_vars(&self) -> usize {
        self.problem.q().len()
    }

    fn value(&self, s: &[f64], out: &mut [f64]) {
        self.velocities(s, out);
        for u in out.chunks_exact_mut(self.problem.dimension()) {
            u[0] += u[1..].iter().map(|v| v * v).sum::<f64>().sqrt();
        }
    }

    fn jacobian(&self, s: &[f64], jac: &mut Matrix) {
        let width = self.problem.dimension();
        let mut u = vec![0.0; s.len()];
        self.velocities(s, &mut u);
        for (i, j, v) in self.problem.matrix().triplets() {
            let v = self.scale * weight(&self.problem, i) * v * weight(&self.problem, j);
            jac.add(i, j, v);
            let normal = i - i % width;
            let length = u[normal + 1..normal + width]
                .iter()
                .map(|v| v * v)
                .sum::<f64>()
                .sqrt();
            if i > normal && length > 0.0 {
                jac.add(normal, j, u[i] / length * v);
            }
        }
    }

    fn pattern(&self) -> Pattern {
        let (n, width) = (self.num_vars(), self.problem.dimension());
        let entries = self.problem.matrix().triplets();
        let both = entries.flat_map(|(i, j, _)| [(i, j), (i - i % width, j)]);
        Pattern::from_entries(n, n, both).unwrap_or_else(|_| Pattern::full(n, n))
    }
}

/// A problem over cones with a start, or one of friction with none: zero.
pub(crate) enum OnCones {
    General(OverCones, Vec<f64>),
    Friction(Rc<DelassusProblem>),
}

/// `DelassusSolver` is one more for friction.
pub(crate) fn cone_methods(friction: bool) -> Vec<&'static str> {
    let general = CONE_METHODS.iter().map(|m| m.0);
    general.chain(friction.then_some("DelassusSolver")).collect()
}

impl OnCones {
    pub(crate) fn run(&self, method: usize) -> Outcome<Run> {
        match self {
            Self::General(problem, start) => {
                let mut x = start.clone();
                let begun = Instant::now();
                let told = (CONE_METHODS[method].1)(problem, &mut x)?;
                let seconds = begun.elapsed().as_secs_f64();
                problem.project(&mut x)?;
                let mut room = vec![0.0; x.len()];
                let residual = problem.natural_residual(&x, &mut room)?;
                Ok(Run {
                    solved: residual <= SOLVED,
                    residual,
                    first: problem.natural_residual(start, &mut room)?,
                    seconds,
                    ..Run::told(told)
                })
            }
            Self::Friction(problem) => friction(problem, method),
        }
    }
}

fn friction(problem: &Rc<DelassusProblem>, method: usize) -> Outcome<Run> {
    let n = problem.q().len();
    let begun = Instant::now();
    let (told, r) = if let Some((_, run)) = CONE_METHODS.get(method) {
        let largest = (0..n).fold(0.0, |m: f64, i| m.max(problem.matrix().get(i, i)));
        let law = DeSaxce {
            problem: problem.clone(),
            scale: 1.0 / largest,
        };
        let cones = vec![Cone::SecondOrder(problem.dimension()); problem.contacts()];
        let over = OverCones::new(Box::new(law), cones)?;
        let mut s = vec![0.0; n];
        let told = run(&over, &mut s)?;
        over.project(&mut s)?;
        (told, reactions(problem, &s))
    } else {
        let report = DelassusSolver::default().solve(problem)?;
        let told = Told {
            evaluations: report.iterations(),
            iterations: report.iterations(),
            factorisations: report.factorisations,
            ..Told::default()
        };
        (told, report.r)
    };
    let seconds = begun.elapsed().as_secs_f64();
    let residual = problem.residual(&r)?;
    Ok(Run {
        solved: residual <= SOLVED,
        residual,
        seconds,
        ..Run::told(told)
    })
}

/// A body with p contacts in space, its weight and friction at random. M is positive definite, so that there is a solution.
pub(crate) fn random_delassus(p: usize, random: &mut Random) -> Outcome<DelassusProblem> {
    let n = 3 * p;
    let g: Vec<Vec<f64>> = (0..n)
        .map(|_| (0..n).map(|_| random.symmetric()).collect())
        .collect();
    let entry = |i: usize, j: usize| {
        let product: f64 = (0..n).map(|k| g[i][k] * g[j][k]).sum();
        product / n as f64 + if i == j { 0.1 } else { 0.0 }
    };
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    // Pushed together at most contacts.
    let q = (0..n)
        .map(|k| random.symmetric() - if k % 3 == 0 { 0.5 } else { 0.0 })
        .collect();
    let friction = (0..p).map(|_| 0.1 + 0.9 * random.symmetric().abs()).collect();
    Ok(DelassusProblem::new(3, Matrix::from_rows(&rows)?, q, friction)?)
}
