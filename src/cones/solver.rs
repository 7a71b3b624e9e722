use std::cell::Cell;
use std::ops::ControlFlow;

use super::equations::check_memory;
use super::ray::{Search, ray};
use super::run::{Run, between};
use super::{ConeError, ConeIteration, ConeOptions, ConeProblem, ConeRay, ConeReport};
use crate::clock::Deadline;
use crate::complementarity::{AffineFunction, McpFunction};
use crate::run::Status;
use crate::sparse::{Matrix, Pattern, dot, norm};

/// Semismooth Newton method for cone problems.
///
/// Full steps of the natural map come first, which converge to a solution nearby quadratically (L. Qi, J. Sun, 1993). Where they do not
/// converge and F is affine and monotone, as in second-order cone programs, interior points follow (scaling of Yu. Nesterov and M. Todd,
/// 1997; corrector of S. Mehrotra, 1992). Elsewhere a smoothing Newton method for the Fischer–Burmeister function of the cones
/// (M. Fukushima, Z.-Q. Luo, P. Tseng, 2002; S. Hayashi, N. Yamashita, M. Fukushima, 2005) brings the iterates near a solution: it
/// converges globally for monotone F with regular systems. Where this fails, interior points for other F, proximal points
/// (R. T. Rockafellar, 1976), for monotone F whose solutions are not unique, and other starts follow ([`ConeOptions::strategies`]); for
/// affine F a certificate is sought.
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
    ) -> Result<ConeReport, ConeError> {
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
    ) -> Result<ConeReport, ConeError> {
        self.options.validate()?;
        problem.check("the start", x.len())?;
        if let Some(index) = x.iter().position(|v| !v.is_finite()) {
            let value = x[index];
            return Err(ConeError::NotFinite { index, value });
        }
        check_memory(problem, self.options.max_memory)?;
        let counted = Counted::new(problem.function());
        let problem = ConeProblem::new(&counted as &dyn McpFunction, problem.cones().to_vec())?;
        let deadline = Deadline::after(self.options.max_time);
        let mut run = Run::new(&problem, &self.options, deadline, &mut observe)?;
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
            let found = ray(&problem, &mut search, parts, x)?;
            problem.function().value(x, &mut room);
            report.ray = match found {
                Some(ray) if refutes(&ray, &room) && !ends_at_solution(&ray, &problem)? => Some(ray),
                _ => None,
            };
            if report.ray.is_some() {
                report.status = Status::NoSolution;
            } else if stopped {
                report.status = Status::Interrupted;
            }
        }
        report.evaluations = counted.evaluations.get();
        Ok(report)
    }
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
fn ends_at_solution(ray: &ConeRay, problem: &ConeProblem<&dyn McpFunction>) -> Result<bool, ConeError> {
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
