//! Complementarity problems over cones, friction in space among them, and methods for them.

use std::rc::Rc;
use std::time::Instant;

use semismooth::complementarity::{AffineFunction, McpFunction};
use semismooth::cones::{Cone, ConeMap, ConeOptions, ConeProblem, ConeSolver, ConeStrategy};
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

/// The methods compared: Newton's method for the natural and the normal map and Fischer–Burmeister functions, smoothing, and `ConeSolver`.
pub(crate) const CONE_METHODS: [(&str, Attempt); 14] = [
    ("natural map, full steps", |p, x| {
        newton(&ConeMap::natural(p)?, x, Damping::Never)
    }),
    ("natural map, line search on trouble", |p, x| {
        newton(&ConeMap::natural(p)?, x, Damping::OnTrouble)
    }),
    ("natural map, line search", |p, x| {
        newton(&ConeMap::natural(p)?, x, Damping::Always)
    }),
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
        let told = newton(&ConeMap::normal(p)?, x, Damping::OnTrouble)?;
        p.project(x)?;
        Ok(told)
    }),
    ("Fischer-Burmeister, full steps", |p, x| {
        newton(&ConeMap::fischer_burmeister(p)?, x, Damping::Never)
    }),
    ("Fischer-Burmeister, line search", |p, x| {
        newton(&ConeMap::fischer_burmeister(p)?, x, Damping::Always)
    }),
    ("Fischer-Burmeister, nonmonotone line search", |p, x| {
        let map = ConeMap::fischer_burmeister(p)?;
        Ok(minimise(&map, x, Direction::Newton, MEMORY))
    }),
    ("Fischer-Burmeister, Levenberg-Marquardt", |p, x| {
        let map = ConeMap::fischer_burmeister(p)?;
        Ok(minimise(&map, x, Direction::Marquardt, 1))
    }),
    ("penalised Fischer-Burmeister, line search", |p, x| {
        newton(&ConeMap::penalised(p, 0.8)?, x, Damping::Always)
    }),
    ("smoothed Fischer-Burmeister, line search", smoothing),
    ("ConeSolver", |p, x| {
        solver(p, x, &ConeOptions::default().strategies)
    }),
];

/// `ConeSolver` with strategies in this order.
pub(crate) fn solver(p: &OverCones, x: &mut [f64], strategies: &[ConeStrategy]) -> Outcome<Told> {
    let options = ConeOptions::default().with_strategies(strategies.to_vec());
    let report = ConeSolver::new(options).solve(p, x)?;
    Ok(Told {
        evaluations: report.evaluations,
        iterations: report.iterations,
        factorisations: report.factorisations,
        ..Told::default()
    })
}

fn newton(map: &dyn Semismooth, x: &mut [f64], damping: Damping) -> Outcome<Told> {
    let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
    newton.solve_semismooth(&map, x).ok();
    Ok(told(newton.report()))
}

/// Few steps for each μ, which falls to rounding, then the function itself.
fn smoothing(p: &OverCones, x: &mut [f64]) -> Outcome<Told> {
    const STEPS: usize = 4;
    let mut room = vec![0.0; x.len()];
    let first = p.natural_residual(x, &mut room)?;
    let mut all = Told::default();
    for k in 1..14 {
        let mu = first * 0.1_f64.powi(k);
        if !(mu > 0.0 && mu.is_finite()) {
            break;
        }
        let options = NewtonOptions::default()
            .with_damping(Damping::Always)
            .with_max_iterations(STEPS);
        let mut newton = Newton::new(options);
        newton.solve_semismooth(&ConeMap::smoothed(p, mu)?, x).ok();
        let told = told(newton.report());
        all.evaluations += told.evaluations;
        all.iterations += told.iterations;
        all.factorisations += told.factorisations;
    }
    let last = newton(&ConeMap::fischer_burmeister(p)?, x, Damping::Always)?;
    Ok(Told {
        evaluations: all.evaluations + last.evaluations,
        iterations: all.iterations + last.iterations,
        factorisations: all.factorisations + last.factorisations,
        ..last
    })
}

/// Friction u = M r + q over second-order cones: with r = (s₀/μ, s₁, …) and û = u + μ‖u_T‖ e_N (G. de Saxcé, Z.-Q. Feng, Math. Comput.
/// Model. 28 (1998)), s and (û_N/μ, u_T) lie in the cone and are orthogonal.
struct DeSaxce {
    problem: Rc<DelassusProblem>,
    /// Scale of F, which brings the diagonal of M near 1.
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
    /// One of `CONE_METHODS`; the one after them is `DelassusSolver`.
    pub(crate) fn run(&self, method: usize) -> Outcome<Run> {
        match (CONE_METHODS.get(method), self) {
            (Some((_, attempt)), _) => self.run_with(attempt),
            (None, Self::Friction(problem)) => friction(problem, || delassus_solver(problem)),
            (None, Self::General(..)) => Err("DelassusSolver solves friction problems alone".into()),
        }
    }

    pub(crate) fn run_with(&self, attempt: &dyn Fn(&OverCones, &mut [f64]) -> Outcome<Told>) -> Outcome<Run> {
        match self {
            Self::General(problem, start) => {
                let mut x = start.clone();
                let begun = Instant::now();
                let told = attempt(problem, &mut x)?;
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
            Self::Friction(problem) => friction(problem, || {
                let n = problem.q().len();
                let largest = (0..n).fold(0.0, |m: f64, i| m.max(problem.matrix().get(i, i)));
                let law = DeSaxce {
                    problem: problem.clone(),
                    scale: 1.0 / largest,
                };
                let cones = vec![Cone::SecondOrder(problem.dimension()); problem.contacts()];
                let over = OverCones::new(Box::new(law), cones)?;
                let mut s = vec![0.0; n];
                let told = attempt(&over, &mut s)?;
                over.project(&mut s)?;
                Ok((told, reactions(problem, &s)))
            }),
        }
    }
}

fn delassus_solver(problem: &DelassusProblem) -> Outcome<(Told, Vec<f64>)> {
    let report = DelassusSolver::default().solve(problem)?;
    let told = Told {
        // A sweep looks at each row of M once.
        evaluations: report.evaluations + report.sweeps,
        iterations: report.iterations(),
        factorisations: report.factorisations,
        ..Told::default()
    };
    Ok((told, report.r))
}

/// A run that ends at reactions.
fn friction(problem: &DelassusProblem, solve: impl Fn() -> Outcome<(Told, Vec<f64>)>) -> Outcome<Run> {
    let begun = Instant::now();
    let (told, r) = solve()?;
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

/// Kinds of problems over second-order cones at random.
pub(crate) const KINDS: [&str; 4] = ["monotone", "skew", "indefinite", "program"];

/// F(x) = M x + q over `count` cones of 3 and 5 variables in turn, with a solution; or the conditions of a linear program over
/// them, whose variables come first, as many as there are in the cones of three.
pub(crate) fn random_over_cones(kind: usize, count: usize, random: &mut Random) -> Outcome<OverCones> {
    let mut cones: Vec<_> = (0..count).map(|k| Cone::SecondOrder(3 + 2 * (k % 2))).collect();
    let mut free = 0;
    if KINDS[kind] == "program" {
        free = 3 * count.div_ceil(2);
        cones.insert(0, Cone::Free(free));
    }
    let n = cones.iter().map(|c| c.len()).sum::<usize>();
    let mut square = || -> Vec<Vec<f64>> {
        let row = |random: &mut Random| (0..n).map(|_| random.symmetric()).collect();
        (0..n).map(|_| row(random)).collect()
    };
    let (g, point) = (square(), square().swap_remove(0));
    let entry = |i: usize, j: usize| match KINDS[kind] {
        "monotone" => {
            let gram: f64 = (0..n).map(|k| g[k][i] * g[k][j]).sum();
            gram / n as f64 + g[i][j] - g[j][i]
        }
        "skew" => g[i][j] - g[j][i],
        "program" => match (i < free, j < free) {
            (true, false) => -g[i][j],
            (false, true) => g[j][i],
            _ => 0.0,
        },
        _ => g[i][j],
    };
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let m = Matrix::from_rows(&rows)?;
    // x = P(z) and y = x − z are complementary.
    let (mut x, mut y) = (point.clone(), vec![0.0; n]);
    let mut first = 0;
    for cone in &cones {
        cone.project(&mut x[first..first + cone.len()]);
        first += cone.len();
    }
    m.mul_vec(&x, &mut y);
    let q = (0..n).map(|i| x[i] - point[i] - y[i]).collect();
    Ok(OverCones::new(Box::new(AffineFunction::new(m, q)?), cones)?)
}
