use super::equations::{Part, check_memory, mixed, owners, parts};
use super::options::MEMORY;
use super::{Cone, ConeProblem};
use crate::complementarity::{ComplementarityError, McpFunction, Scratch};
use crate::input::{check_options, positive};
use crate::piecewise::Semismooth;
use crate::sparse::{Matrix, Pattern};

/// A cone problem as semismooth equations of n unknowns, P the projection on K:
///
/// * [`natural`](Self::natural): x − P(x − F(x)) = 0,
/// * [`normal`](Self::normal): F(P(z)) + z − P(z) = 0, with the solution x = P(z) ([`ConeProblem::project`]) and z = x − F(x)
///   (S. M. Robinson, 1992),
/// * [`fischer_burmeister`](Self::fischer_burmeister): x + F(x) − (x² + F(x)²)^½ = 0 in the Jordan algebra of the cones (M. Fukushima,
///   Z.-Q. Luo, P. Tseng, SIAM J. Optim. 12 (2002)); ½‖Φ‖² is continuously differentiable (J.-S. Chen, P. Tseng, Math. Program. 104
///   (2005)),
/// * [`penalised`](Self::penalised): λ times that map and (1 − λ) x₊ ∘ F(x)₊, with the projections on K: its norm has bounded level sets
///   on more problems, but its square is not differentiable everywhere (S. Pan, J.-S. Chen, S. Kum, Y. Lim, Comput. Optim. Appl. 49 (2011),
///   for second-order cones; S. Kum, Y. Lim, J. Global Optim. 46 (2010), for all symmetric ones; B. Chen, X. Chen, C. Kanzow, Math.
///   Program. 88 (2000), for half-lines),
/// * [`smoothed`](Self::smoothed): x + F(x) − (x² + F(x)² + 2 μ² e)^½ = 0, which is smooth where F is; its zeros lie inside of K with
///   x ∘ F(x) = μ² e, the central path.
///
/// Zeros of the first four give exactly the solutions of the problem. Free variables have the equation F = 0.
///
/// With ∇F Lipschitz continuous all are strongly semismooth, so that Newton's method converges quadratically at solutions with regular
/// elements (X. Chen, D. Sun, J. Sun, Comput. Optim. Appl. 25 (2003), for second-order cones; D. Sun, J. Sun, Math. Oper. Res. 27 (2002)
/// and Math. Program. 103 (2005), for semidefinite ones and the Fischer–Burmeister function).
///
/// [`Semismooth::jacobian`] is an element of the B-subdifferential at every point:
///
/// * of the normal map always: I − V + F′(P(z)) V, V from ∂_B P(z) (J.-S. Pang, D. Sun, J. Sun, Math. Oper. Res. 28 (2003), section 3);
/// * of the Fischer–Burmeister map always: where it has no derivative the limit of its Jacobians at x + t e for t ↓ 0, e the identity of
///   the algebra, as T. De Luca, F. Facchinei and C. Kanzow (1996) take it for half-lines;
/// * of the natural map I − V (I − F′(x)) with V from ∂_B P(x − F(x)): guaranteed where I − F′(x) is regular or P differentiable; else it
///   is one of the elements that Newton's method takes for composed functions (L. Qi, J. Sun, Math. Program. 58 (1993));
/// * of the penalised map that of the Fischer–Burmeister map with elements of ∂_B P at x and at F(x): guaranteed where P is differentiable
///   at both, else as for the natural map.
///
/// ```
/// use semismooth::complementarity::AffineFunction;
/// use semismooth::cones::{Cone, ConeMap, ConeProblem};
/// use semismooth::newton::Newton;
/// use semismooth::sparse::Matrix;
/// // The point of t ≥ ‖v‖ nearest to (0, 3, 4).
/// let f = AffineFunction::new(Matrix::identity(3), vec![0.0, -3.0, -4.0])?;
/// let problem = ConeProblem::new(f, vec![Cone::SecondOrder(3)])?;
/// let (mut x, mut z) = ([1.0, 0.5, 0.0], [1.0, 0.5, 0.0]);
/// Newton::default().solve_semismooth(&ConeMap::fischer_burmeister(&problem)?, &mut x)?;
/// Newton::default().solve_semismooth(&ConeMap::normal(&problem)?, &mut z)?;
/// problem.project(&mut z)?;
/// for (x, exact) in x.iter().chain(&z).zip([2.5, 1.5, 2.0].repeat(2)) {
///     assert!((x - exact).abs() < 1e-9);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ConeMap<'a, F> {
    problem: &'a ConeProblem<F>,
    equations: Equations,
    parts: Vec<Part>,
    /// The part of each row.
    owner: Vec<usize>,
    pattern: Pattern,
    work: Scratch<Work>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Equations {
    Natural,
    Normal,
    FischerBurmeister { mu: f64, lambda: f64 },
}

impl Equations {
    /// The weight of x₊ ∘ F(x)₊.
    fn penalty(self) -> f64 {
        match self {
            Self::FischerBurmeister { lambda, .. } => 1.0 - lambda,
            _ => 0.0,
        }
    }
}

/// Buffers of a Jacobian.
#[derive(Clone)]
struct Work {
    point: Vec<f64>,
    y: Vec<f64>,
    /// F′ e.
    rate: Vec<f64>,
    slope: Matrix,
    by_x: Vec<f64>,
    by_y: Vec<f64>,
    /// The derivative of a projection, of the penalised map.
    projected: Vec<f64>,
    room: Vec<f64>,
}

impl<'a, F: McpFunction> ConeMap<'a, F> {
    /// x − P(x − F(x)).
    ///
    /// # Errors
    /// A pattern that is too large, more memory than 4 GiB.
    pub fn natural(problem: &'a ConeProblem<F>) -> Result<Self, ComplementarityError> {
        Self::new(problem, Equations::Natural)
    }

    /// F(P(z)) + z − P(z).
    ///
    /// # Errors
    /// A pattern that is too large, more memory than 4 GiB.
    pub fn normal(problem: &'a ConeProblem<F>) -> Result<Self, ComplementarityError> {
        Self::new(problem, Equations::Normal)
    }

    /// x + F(x) − (x² + F(x)²)^½.
    ///
    /// # Errors
    /// A pattern that is too large, more memory than 4 GiB.
    pub fn fischer_burmeister(problem: &'a ConeProblem<F>) -> Result<Self, ComplementarityError> {
        Self::new(problem, Equations::FischerBurmeister { mu: 0.0, lambda: 1.0 })
    }

    /// λ (x + F(x) − (x² + F(x)²)^½) + (1 − λ) x₊ ∘ F(x)₊, λ in (0, 1].
    ///
    /// # Errors
    /// λ out of range; a pattern that is too large, more memory than 4 GiB.
    pub fn penalised(problem: &'a ConeProblem<F>, lambda: f64) -> Result<Self, ComplementarityError> {
        check_options(&[("lambda", lambda, lambda > 0.0 && lambda <= 1.0, "in (0, 1]")])?;
        Self::new(problem, Equations::FischerBurmeister { mu: 0.0, lambda })
    }

    /// x + F(x) − (x² + F(x)² + 2 μ² e)^½, μ > 0.
    ///
    /// # Errors
    /// μ out of range; a pattern that is too large, more memory than 4 GiB.
    pub fn smoothed(problem: &'a ConeProblem<F>, mu: f64) -> Result<Self, ComplementarityError> {
        check_options(&[positive("mu", mu)])?;
        Self::new(problem, Equations::FischerBurmeister { mu, lambda: 1.0 })
    }

    fn new(problem: &'a ConeProblem<F>, equations: Equations) -> Result<Self, ComplementarityError> {
        check_memory(problem, MEMORY)?;
        let n = problem.len();
        let (parts, entries, widest) = parts(problem);
        let slope = Matrix::zeros(problem.function().pattern());
        // A block of the projection stands to the right of ∇F in the normal map, to the left in the others.
        let pattern = match equations {
            Equations::Normal => {
                let transposed = mixed(&parts, slope.pattern()).into_iter().map(|(i, j)| (j, i));
                Pattern::from_entries(n, n, transposed)?
            }
            _ => Pattern::from_entries(n, n, mixed(&parts, slope.transpose().pattern()))?,
        };
        Ok(Self {
            problem,
            equations,
            owner: owners(&parts),
            parts,
            pattern,
            work: Scratch::new(Work {
                point: vec![0.0; n],
                y: vec![0.0; n],
                rate: vec![0.0; n],
                slope,
                by_x: vec![0.0; widest],
                by_y: vec![0.0; entries],
                projected: vec![0.0; if equations.penalty() > 0.0 { widest } else { 0 }],
                room: vec![0.0; 3 * n],
            }),
        })
    }
}

impl<F: McpFunction> Semismooth for ConeMap<'_, F> {
    fn num_vars(&self) -> usize {
        self.owner.len()
    }

    fn residual(&self, x: &[f64], out: &mut [f64]) {
        let (function, work) = (self.problem.function(), &mut *self.work.lock());
        match self.equations {
            Equations::Natural => self.problem.natural_map(x, out),
            Equations::Normal => {
                work.point.copy_from_slice(x);
                for part in &self.parts {
                    part.cone.project(&mut work.point[part.range.clone()]);
                }
                function.value(&work.point, out);
                let apart = x.iter().zip(&work.point).map(|(z, p)| z - p);
                out.iter_mut().zip(apart).for_each(|(o, d)| *o += d);
            }
            Equations::FischerBurmeister { mu, .. } => {
                function.value(x, &mut work.y);
                for part in &self.parts {
                    let range = part.range.clone();
                    let (x, y) = (&x[range.clone()], &work.y[range.clone()]);
                    part.cone.smoothed(mu, x, y, &mut out[range.clone()]);
                    self.add_penalty(part, [x, y], &mut out[range], &mut work.room);
                }
            }
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let (function, work) = (self.problem.function(), &mut *self.work.lock());
        work.point.copy_from_slice(x);
        if self.equations == Equations::Normal {
            for part in &self.parts {
                part.cone.project(&mut work.point[part.range.clone()]);
            }
        } else {
            function.value(x, &mut work.y);
        }
        work.slope.clear();
        function.jacobian(&work.point, &mut work.slope);
        if let Some((row, _)) = work.slope.stray() {
            // An entry outside the pattern of F is passed on as one outside the pattern of the map.
            jac.add(row, usize::MAX, f64::NAN);
        }
        if matches!(self.equations, Equations::FischerBurmeister { .. }) {
            let unit = &mut work.point;
            for part in &self.parts {
                part.cone.unit(&mut unit[part.range.clone()]);
            }
            work.slope.mul_vec(unit, &mut work.rate);
        }
        for part in &self.parts {
            self.block(part, x, work);
            let (n, first) = (part.range.len(), part.range.start);
            for (k, v) in work.by_x[..n * n].iter().enumerate() {
                jac.add(first + k / n, first + k % n, *v);
            }
        }
        for (row, column, v) in work.slope.triplets() {
            let mixes_columns = self.equations == Equations::Normal;
            let part = &self.parts[self.owner[if mixes_columns { column } else { row }]];
            let (n, first) = (part.range.len(), part.range.start);
            for k in 0..n {
                if mixes_columns {
                    let factor = work.by_y[part.at + (column - first) * n + k];
                    jac.add(row, first + k, v * factor);
                } else {
                    let factor = work.by_y[part.at + k * n + (row - first)];
                    jac.add(first + k, column, factor * v);
                }
            }
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
}

impl<F> ConeMap<'_, F> {
    /// The blocks of one part: one that is added, and one that is multiplied with ∇F.
    fn block(&self, part: &Part, x: &[f64], work: &mut Work) {
        let (n, range) = (part.range.len(), part.range.clone());
        let (by_x, by_y) = (&mut work.by_x[..n * n], &mut work.by_y[part.at..part.at + n * n]);
        let (x, y) = (&x[range.clone()], &work.y[range.clone()]);
        if let Equations::FischerBurmeister { mu, .. } = self.equations {
            let (rate, room) = (&work.rate[range], &mut work.room[..]);
            part.cone
                .smoothed_derivatives(mu, [x, y], Some(rate), [by_x, by_y], &mut room[..3 * n]);
            return self.add_penalty_slopes(part, [x, y], [by_x, by_y], &mut work.projected, room);
        }
        let z = &mut work.room[..n];
        z.copy_from_slice(x);
        if self.equations == Equations::Natural {
            z.iter_mut().zip(y).for_each(|(z, y)| *z -= y);
        }
        part.cone.projection_derivative(z, by_y);
        for k in 0..n * n {
            by_x[k] = f64::from(u8::from(k % (n + 1) == 0)) - by_y[k];
        }
    }

    /// λ times the Fischer–Burmeister function in `out`, and the penalty.
    fn add_penalty(&self, part: &Part, xy: [&[f64]; 2], out: &mut [f64], room: &mut [f64]) {
        let penalty = self.equations.penalty();
        if penalty == 0.0 || matches!(part.cone, Cone::Free(_)) {
            return;
        }
        let n = out.len();
        let (positive, product) = room[..3 * n].split_at_mut(2 * n);
        for (p, z) in positive.chunks_exact_mut(n).zip(xy) {
            p.copy_from_slice(z);
            part.cone.project(p);
        }
        part.cone.product(&positive[..n], &positive[n..], product);
        for (out, p) in out.iter_mut().zip(product) {
            *out = (1.0 - penalty) * *out + penalty * *p;
        }
    }

    /// The same for its derivatives by x and by y: y₊ ∘ V and x₊ ∘ W, V and W those of the projections.
    fn add_penalty_slopes(
        &self,
        part: &Part,
        xy: [&[f64]; 2],
        by: [&mut [f64]; 2],
        projected: &mut [f64],
        room: &mut [f64],
    ) {
        let penalty = self.equations.penalty();
        if penalty == 0.0 || matches!(part.cone, Cone::Free(_)) {
            return;
        }
        let n = part.range.len();
        let projected = &mut projected[..n * n];
        let (positive, rest) = room[..3 * n].split_at_mut(n);
        let (column, product) = rest.split_at_mut(n);
        let [x, y] = xy;
        for (by, (z, other)) in by.into_iter().zip([(x, y), (y, x)]) {
            positive.copy_from_slice(other);
            part.cone.project(positive);
            part.cone.projection_derivative(z, projected);
            for j in 0..n {
                (0..n).for_each(|i| column[i] = projected[i * n + j]);
                part.cone.product(positive, column, product);
                for (i, p) in product.iter().enumerate() {
                    let by = &mut by[i * n + j];
                    *by = (1.0 - penalty) * *by + penalty * p;
                }
            }
        }
    }
}
