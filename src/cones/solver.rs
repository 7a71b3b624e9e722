use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;

use super::ray::ray;
use super::run::{Run, between};
use super::{ConeError, ConeIteration, ConeOptions, ConeProblem, ConeRay, ConeReport, ConeStatus};
use crate::clock::Deadline;
use crate::complementarity::McpFunction;
use crate::judge::power_below;
use crate::sparse::{Matrix, Pattern, dot, max_abs};

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
    /// A start of the wrong length or not finite, options out of range, a Jacobian entry outside the pattern.
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
        let own = problem;
        let counted = Counted::new(problem.function(), x.len());
        let problem = ConeProblem::new(&counted as &dyn McpFunction, problem.cones().to_vec())?;
        x.iter_mut().for_each(|x| *x /= counted.unknowns);
        let deadline = Deadline::after(self.options.max_time);
        let mut run = Run::new(&problem, &self.options, deadline, &mut observe)?;
        let status = run.all_starts(x)?;
        let mut report = run.report;
        report.status = status;
        x.copy_from_slice(&run.best);
        report.error = run.least;
        let mut room = vec![0.0; x.len()];
        let sought = matches!(report.status, ConeStatus::Stalled | ConeStatus::IterationLimit);
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
            let found = ray(&problem, &self.options, deadline, &mut tell, parts, x)?;
            problem.function().value(x, &mut room);
            report.ray = found.filter(|ray| refutes(ray, &room));
            if report.ray.is_some() {
                report.status = ConeStatus::NoSolution;
            } else if stopped {
                report.status = ConeStatus::Interrupted;
            }
        }
        if let Some(ray) = &mut report.ray {
            ray.direction.iter_mut().for_each(|v| *v *= counted.rows);
            ray.radius *= counted.unknowns;
        }
        report.evaluations = counted.evaluations.get();
        x.iter_mut().for_each(|x| *x *= counted.unknowns);
        report.residual = own.natural_residual(x, &mut room)?;
        Ok(report)
    }
}

/// Whether vᵀF at the best point is what it should be for all x, −1 up to its rounding: at a solution far out it would be 0.
fn refutes(ray: &ConeRay, f: &[f64]) -> bool {
    /// What is left of −1 as long as v proves anything there.
    const HALF: f64 = -0.5;
    ray.radius == f64::INFINITY || dot(&ray.direction, f) <= HALF
}

/// F, counting its evaluations; an affine one in units, powers of two, in which neither its coefficients nor solutions are large or small:
/// a run is the same to the last bit in all units of F and of x that differ by powers of two.
struct Counted<'a> {
    function: &'a dyn McpFunction,
    evaluations: Cell<usize>,
    /// Factors of F and of x.
    rows: f64,
    unknowns: f64,
    point: RefCell<Vec<f64>>,
}

impl<'a> Counted<'a> {
    fn new(function: &'a dyn McpFunction, n: usize) -> Self {
        let mut point = vec![0.0; n];
        let (mut rows, mut unknowns) = (1.0, 1.0);
        if function.is_affine() {
            let mut matrix = Matrix::zeros(function.pattern());
            function.jacobian(&point, &mut matrix);
            let largest = power_below(max_abs(matrix.values()));
            let mut q = vec![0.0; n];
            function.value(&point, &mut q);
            let size = power_below(max_abs(&q)) / largest;
            if size.is_normal() && (largest * size).recip().is_normal() {
                (rows, unknowns) = ((largest * size).recip(), size);
            }
        }
        point.clear();
        Self {
            function,
            evaluations: Cell::new(0),
            rows,
            unknowns,
            point: RefCell::new(point),
        }
    }

    fn at(&self, x: &[f64]) -> std::cell::RefMut<'_, Vec<f64>> {
        let mut point = self.point.borrow_mut();
        point.clear();
        point.extend(x.iter().map(|x| x * self.unknowns));
        point
    }
}

impl McpFunction for Counted<'_> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.evaluations.set(self.evaluations.get() + 1);
        self.function.value(&self.at(x), out);
        out.iter_mut().for_each(|f| *f *= self.rows);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.function.jacobian(&self.at(x), jac);
        let factor = self.rows * self.unknowns;
        jac.values_mut().iter_mut().for_each(|v| *v *= factor);
    }
    fn pattern(&self) -> Pattern {
        self.function.pattern()
    }
    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }
}
