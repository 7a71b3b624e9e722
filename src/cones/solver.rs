use std::cell::Cell;
use std::ops::ControlFlow;

use super::central::is_monotone;
use super::equations::{check_memory, owners, parts};
use super::ray::{Search, coefficients, ray, ray_out_of_units};
use super::run::{Run, between};
use super::{ConeIteration, ConeOptions, ConeProblem, ConeRay, ConeReport};
use crate::clock::Deadline;
use crate::complementarity::{AffineFunction, ComplementarityError, InUnits, McpFunction};
use crate::input::check_finite;
use crate::judge::{Sizes, Units};
use crate::run::Status;
use crate::sparse::{Matrix, Pattern, dot, max_abs, norm};

/// Semismooth Newton method for cone problems.
///
/// Full steps of the natural map come first, which converge to a solution nearby quadratically (L. Qi, J. Sun, 1993). Where they do not
/// converge and F is affine and monotone, as in second-order cone programs, interior points follow (scaling of Yu. Nesterov and M. Todd,
/// 1997; corrector of S. Mehrotra, 1992). Elsewhere a smoothing Newton method for the Fischer–Burmeister function of the cones
/// (M. Fukushima, Z.-Q. Luo, P. Tseng, 2002; S. Hayashi, N. Yamashita, M. Fukushima, 2005) brings the iterates near a solution: it
/// converges globally for monotone F with regular systems. Where this fails, interior points for other F, proximal points
/// (R. T. Rockafellar, 1976), for monotone F whose solutions are not unique, and other starts follow ([`ConeOptions::strategies`]); for
/// affine F a certificate is sought.
///
/// Affine problems are solved in units of their own, the same for all units of the problem that differ by one power of two for each cone
/// and one more for F: merits of the history are in these units. Units of F that differ from those of x from cone to cone hide that a
/// problem is monotone; units in which it is are sought.
#[derive(Debug, Clone, Default)]
pub struct ConeSolver {
    options: ConeOptions,
}

impl ConeSolver {
    /// A solver with the given options.
    #[must_use]
    pub fn new(options: ConeOptions) -> Self {
        Self { options }
    }

    /// Solves from the start `x`, which is overwritten by the solution or the best point.
    ///
    /// # Errors
    /// A start of the wrong length or not finite, options out of range, a Jacobian entry outside the pattern,
    /// a problem that takes more memory than [`ConeOptions::max_memory`].
    pub fn solve<F: McpFunction>(
        &self,
        problem: &ConeProblem<F>,
        x: &mut [f64],
    ) -> Result<ConeReport, ComplementarityError> {
        self.solve_observed(problem, x, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting every iterate to `observe`, which may stop the run. It is also called, with merit and μ NaN, for
    /// perturbed starts at which F is not finite, and during the search for a proof that there is no solution; these are not in the history.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_observed<F: McpFunction>(
        &self,
        problem: &ConeProblem<F>,
        x: &mut [f64],
        mut observe: impl FnMut(&ConeIteration) -> ControlFlow<()>,
    ) -> Result<ConeReport, ComplementarityError> {
        self.options.validate()?;
        problem.check("the start", x.len())?;
        check_finite("the start", x)?;
        check_memory(problem, self.options.max_memory)?;
        let counted = Counted::new(problem.function());
        let problem = ConeProblem::new(&counted as &dyn McpFunction, problem.cones().to_vec())?;
        let mut report = match problem.function().is_affine() {
            true => self.solve_affine(&problem, x, &mut observe)?,
            false => self.run(&problem, x, &mut observe)?,
        };
        report.evaluations = counted.evaluations.get();
        Ok(report)
    }

    /// An affine problem is solved in units of its own.
    fn solve_affine(
        &self,
        problem: &ConeProblem<&dyn McpFunction>,
        x: &mut [f64],
        observe: &mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    ) -> Result<ConeReport, ComplementarityError> {
        let (matrix, q) = coefficients(problem, x);
        let Some((rows, columns)) = units(problem, &matrix, &q)? else {
            return self.run(problem, x, observe);
        };
        let function = InUnits::new(*problem.function(), &rows, &columns, Vec::new());
        let scaled = ConeProblem::new(&function as &dyn McpFunction, problem.cones().to_vec())?;
        x.iter_mut().zip(&columns).for_each(|(x, unit)| *x /= unit);
        let mut report = self.run(&scaled, x, observe)?;
        x.iter_mut().zip(&columns).for_each(|(x, unit)| *x *= unit);
        report.residual = problem.natural_residual(x, &mut vec![0.0; x.len()])?;
        report.ray = match report.ray.take() {
            Some(ray) => ray_out_of_units(problem, (&matrix, &q), ray, (&rows, &columns))?,
            None => None,
        };
        if report.status == Status::NoSolution && report.ray.is_none() {
            report.status = Status::Stalled;
        }
        Ok(report)
    }

    fn run(
        &self,
        problem: &ConeProblem<&dyn McpFunction>,
        x: &mut [f64],
        observe: &mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    ) -> Result<ConeReport, ComplementarityError> {
        let deadline = Deadline::after(self.options.max_time);
        let mut run = Run::new(problem, &self.options, deadline, observe)?;
        let status = run.all_starts(x)?;
        let mut report = run.report;
        report.status = status;
        x.copy_from_slice(&run.best);
        report.error = run.least;
        let mut room = vec![0.0; x.len()];
        report.residual = problem.natural_residual(x, &mut room)?;
        let sought = matches!(report.status, Status::Stalled | Status::IterationLimit);
        if sought && problem.function().is_affine() {
            let mut stopped = false;
            let mut tell = |_: &ConeIteration| {
                stopped = stopped || (run.observe)(&between(run.attempt)).is_break();
                match stopped {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            let parts = (&run.parts[..], &run.block[..]);
            let mut search = Search {
                options: &self.options,
                deadline,
                observe: &mut tell,
                inner_only: false,
            };
            let found = ray(problem, &mut search, parts, x)?;
            problem.function().value(x, &mut room);
            report.ray = match found {
                Some(ray) if refutes(&ray, &room) && !ends_at_solution(&ray, problem)? => Some(ray),
                _ => None,
            };
            if report.ray.is_some() {
                report.status = Status::NoSolution;
            } else if stopped {
                report.status = Status::Interrupted;
            }
        }
        Ok(report)
    }
}

/// Factors of F and of x, component by component.
type Factors = (Vec<f64>, Vec<f64>);

/// Most parts of a problem for which monotone units are sought among those that differ by a factor of two at one or two parts: at most 73 of
/// them (`units::cone_problems`).
const FEW: usize = 6;

/// Factors of F and of x, powers of two and the same within a cone that is no product; `None` where the problem is solved as it is.
fn units(
    problem: &ConeProblem<&dyn McpFunction>,
    matrix: &Matrix,
    q: &[f64],
) -> Result<Option<Factors>, ComplementarityError> {
    let parts = parts(problem).0;
    let owner = owners(&parts);
    let mut found = Units::default();
    let mut factors = |keep_ratios: bool| {
        let other = found.find(&Sizes {
            owner: Some(&owner),
            blocks: parts.len(),
            matrix,
            constant: &|k| max_abs(&q[parts[k].range.clone()]),
            bound: &|_| 0.0,
            keep_ratios,
        });
        let powers =
            |exponents: &[i64]| -> Vec<f64> { owner.iter().map(|&k| (exponents[k] as f64).exp2()).collect() };
        other.then(|| (powers(&found.rows), powers(&found.unknowns)))
    };
    // Interior points need a monotone problem: what is one stays one, and of others one in other units is sought nearby.
    if is_monotone(matrix)? {
        return Ok(factors(true));
    }
    let Some((rows, columns)) = factors(false) else {
        return Ok(None);
    };
    let monotone = |rows: &[f64]| {
        let mut scaled = matrix.clone();
        scaled.scale(rows, &columns);
        is_monotone(&scaled)
    };
    if monotone(&rows)? {
        return Ok(Some((rows, columns)));
    }
    let few = if parts.len() <= FEW { parts.len() } else { 0 };
    let moves: Vec<(usize, f64)> = (0..few).flat_map(|k| [(k, 2.0), (k, 0.5)]).collect();
    let multiply = |rows: &mut [f64], (k, factor): (usize, f64)| {
        rows[parts[k].range.clone()].iter_mut().for_each(|r| *r *= factor);
    };
    let pairs = (0..moves.len()).flat_map(|b| (0..=b).map(move |a| (a, b)));
    for (a, b) in (0..moves.len())
        .map(|a| (a, a))
        .chain(pairs.filter(|p| p.0 != p.1))
    {
        let mut near = rows.clone();
        multiply(&mut near, moves[a]);
        if a != b {
            multiply(&mut near, moves[b]);
        }
        if monotone(&near)? {
            return Ok(Some((near, columns)));
        }
    }
    Ok(Some((rows, columns)))
}

/// Part of the constant that counts as near 0 beside it.
const HALF: f64 = 0.5;

/// Whether vᵀF at the best point is what it should be for all x, −1 up to its rounding: at a solution far out it would be 0.
fn refutes(ray: &ConeRay, f: &[f64]) -> bool {
    ray.radius == f64::INFINITY || dot(&ray.direction, f) <= -HALF
}

/// Whether there seems to be a solution where v begins to prove nothing. The nearest point of K with vᵀF(x) = 0 is x = y/‖y‖² with the
/// projection y of Mᵀv. Where y is rounding, F is anything there; where M is nearly singular in earnest, F(x) is nearly in K* and orthogonal
/// to x, in the cones that v is about.
fn ends_at_solution(
    ray: &ConeRay,
    problem: &ConeProblem<&dyn McpFunction>,
) -> Result<bool, ComplementarityError> {
    if ray.radius == f64::INFINITY {
        return Ok(false);
    }
    let (n, function) = (ray.direction.len(), problem.function());
    let (mut x, mut f, mut q) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut matrix = Matrix::zeros(function.pattern());
    function.value(&x, &mut q);
    function.jacobian(&x, &mut matrix);
    matrix.as_ref().mul_transpose_add(1.0, &ray.direction, &mut x);
    problem.project(&mut x)?;
    let size = norm(&x);
    if size == 0.0 {
        return Ok(false);
    }
    x.iter_mut().for_each(|x| *x = *x / size / size);
    function.value(&x, &mut f);
    for (_, range) in problem.blocks() {
        let is_zero = |v: &[f64]| v[range.clone()].iter().all(|v| *v == 0.0);
        if is_zero(&x) && is_zero(&ray.direction) {
            f[range.clone()].fill(0.0);
            q[range].fill(0.0);
        }
    }
    // In units in which x is 1.
    let product = (dot(&x, &f) * size).abs();
    f.iter_mut().for_each(|f| *f = -*f);
    problem.project(&mut f)?;
    Ok(norm(&f).max(product) <= HALF * norm(&q))
}

/// F, counting its evaluations.
struct Counted<'a> {
    function: &'a dyn McpFunction,
    evaluations: Cell<usize>,
}

impl<'a> Counted<'a> {
    fn new(function: &'a dyn McpFunction) -> Self {
        Self {
            function,
            evaluations: Cell::new(0),
        }
    }
}

impl McpFunction for Counted<'_> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }
    fn num_values(&self) -> usize {
        self.function.num_values()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.evaluations.set(self.evaluations.get() + 1);
        self.function.value(x, out);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.function.jacobian(x, jac);
    }
    fn pattern(&self) -> Pattern {
        self.function.pattern()
    }
    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }
    fn coefficients(&self) -> Option<(&AffineFunction, Option<f64>)> {
        self.function.coefficients()
    }
}
