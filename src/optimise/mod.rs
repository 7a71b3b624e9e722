//! Optimisation on top of problems with kinks: f(θ) or f(x(θ), θ) with x(θ) a solution, over a polyhedron of parameters.
//!
//! [`Bundle`] is a proximal bundle method for functions that are locally Lipschitz and semismooth: values and one element of the generalised
//! gradient at each point suffice. Where f is not convex, linearisations count the less the farther away they were taken (subgradient locality
//! measures) and a two-point search along each direction finds a better point or a gradient that the model lacks (K. C. Kiwiel, *Methods of
//! Descent for Nondifferentiable Optimization*, 1985, and Math. Program. 46 (1990); M. M. Mäkelä, P. Neittaanmäki, *Nonsmooth
//! Optimization*, 1992; for problems with equilibrium constraints J. Outrata, M. Kočvara, J. Zowe, 1998). The metric of its
//! quadratic programs learns by BFGS updates where f is smooth; they are solved by [`Lemke`](crate::complementarity::pivoting::Lemke).
//!
//! [`Implicit`] is f(x(θ), θ): it solves a complementarity problem, and takes the element from [`Sensitivity`](crate::sensitivity::Sensitivity),
//! by one adjoint solve. [`minimise`](crate::minimise) is the door to both.
//!
//! The method is local. What it finds is stationary in the sense of Clarke, to the tolerance: whether it is a minimum is not decided, and other
//! starts may lead to better points. Where the problem of x has several solutions, f belongs to the branch that the solver follows from x at the
//! start; [`all_solutions`](crate::enumeration::all_solutions) lists the branches of piecewise-affine problems, each a start of its own.

mod bundle;
mod error;
mod implicit;
mod model;
mod options;
mod report;
mod units;

use std::ops::ControlFlow;
use std::time::Duration;

pub use error::OptimiseError;
pub use implicit::Implicit;
pub use options::BundleOptions;
pub use report::{BundleIteration, BundleReport, BundleStep};

use crate::Cause;
use crate::variational::Polyhedron;

/// A function of parameters θ that is to be minimised.
pub trait Objective {
    /// f(θ); an element of its generalised gradient is written to `gradient`.
    ///
    /// # Errors
    /// Points where f has no value or no gradient: steps to them are shortened, and the report has the last error.
    fn evaluate(&mut self, parameters: &[f64], gradient: &mut [f64]) -> Result<f64, Cause>;

    /// The time left, where the run has a limit: an evaluation that takes longer may end with an error, after
    /// which the run ends with its best point. Default: nothing happens.
    fn limit_time(&mut self, _left: Duration) {}

    /// The point evaluated last is the best so far. Default: nothing happens.
    fn keep(&mut self) {}

    /// The state x(θ) at the point kept last. Default: none.
    fn state(&self) -> &[f64] {
        &[]
    }
}

impl<F: FnMut(&[f64], &mut [f64]) -> Result<f64, Cause>> Objective for F {
    fn evaluate(&mut self, parameters: &[f64], gradient: &mut [f64]) -> Result<f64, Cause> {
        self(parameters, gradient)
    }
}

/// A proximal bundle method for functions with kinks, convex or not, over a polyhedron. The [module](self) says which.
///
/// ```
/// use semismooth::optimise::Bundle;
/// use semismooth::variational::Polyhedron;
/// // |θ₀ − 1| + 2 |θ₁| has its minimum at (1, 0), where it has a kink; here θ₀ ≤ ½.
/// let mut f = |p: &[f64], g: &mut [f64]| {
///     g.copy_from_slice(&[(p[0] - 1.0).signum(), 2.0 * p[1].signum()]);
///     Ok((p[0] - 1.0).abs() + 2.0 * p[1].abs())
/// };
/// let set = Polyhedron::boxed(vec![-3.0; 2], vec![0.5, 3.0])?;
/// let (p, report) = Bundle::default().minimise(&set, &[-2.0, 1.0], &mut f)?;
/// assert!(report.is_solved() && p[0] == 0.5 && p[1].abs() < 1e-8);
/// assert!((report.multipliers.upper[0] - 1.0).abs() < 1e-8);
/// # Ok::<(), semismooth::optimise::OptimiseError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bundle {
    options: BundleOptions,
}

impl Bundle {
    /// A method with the given options.
    #[must_use]
    pub fn new(options: BundleOptions) -> Self {
        Self { options }
    }

    /// Minimises f from a start, which is projected on the set, and returns the best point with the report, solved or not.
    ///
    /// # Errors
    /// A start of the wrong length or not finite, options out of range, an empty set ([`OptimiseError::EmptySet`]), a start where f has no value
    /// or no gradient ([`OptimiseError::Start`]).
    pub fn minimise(
        &self,
        set: &Polyhedron,
        start: &[f64],
        objective: &mut dyn Objective,
    ) -> Result<(Vec<f64>, BundleReport), OptimiseError> {
        self.minimise_observed(set, start, objective, |_| ControlFlow::Continue(()))
    }

    /// [`minimise`](Self::minimise), reporting each iteration to `observe`, which may stop the run.
    ///
    /// # Errors
    /// As [`minimise`](Self::minimise).
    pub fn minimise_observed(
        &self,
        set: &Polyhedron,
        start: &[f64],
        objective: &mut dyn Objective,
        mut observe: impl FnMut(&BundleIteration) -> ControlFlow<()>,
    ) -> Result<(Vec<f64>, BundleReport), OptimiseError> {
        let run = bundle::Run::new(set, &self.options, start, &mut *objective)?;
        let (point, mut report) = run.run(&mut observe)?;
        report.state = objective.state().to_vec();
        Ok((point, report))
    }
}
