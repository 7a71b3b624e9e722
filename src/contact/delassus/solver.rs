use std::ops::ControlFlow;

use super::report::{DelassusIteration, DelassusReport};
use super::run::Run;
use super::{DelassusOptions, DelassusProblem};
use crate::contact::ContactError;

/// Solver of [`DelassusProblem`]s.
///
/// In turn, until the residual of every contact is met: nonsmooth Gauss–Seidel with exact one-contact solutions; in small problems where
/// states no longer change, one linear system, unless a contact slips in space; a few semismooth Newton iterations (P. Alart, A. Curnier
/// 1991) on proximal problems M + αI, q − α r_k, which end most runs; an interior-point method for the law with De Saxcé's term, which
/// copes with the many near-degenerate contacts of stacks and packings and with a singular M; Newton again, with α driven to 0, for the
/// last digits; below 1500 unknowns the central path of interior points by arclength, through its folds; and Newton from more sweeps. Runs
/// are deterministic. A large sparse M is factored by Cholesky with GMRES for De Saxcé's term, so that memory is that of its factor; a
/// small or mostly full one by LU.
///
/// Where M is singular, or friction is large, solutions need not be unique: one is found. Where there is none, the best iterate
/// is returned; an iterate whose residual is small only because reactions grow without bound does not count as a solution.
///
/// M is taken to be semidefinite up to rounding. Errors that make its symmetric part indefinite by ε (entries known to a few digits only,
/// say) may leave a problem without a solution: runs then stall at a residual of about ε against M. Stalling does not show that there is no
/// solution.
///
/// ```
/// use semismooth::contact::{DelassusOptions, DelassusProblem, DelassusSolver};
/// use semismooth::sparse::Matrix;
/// // A unit mass on the ground, μ = 0.3, with the free velocities −1 and 0.5: friction takes 0.3 of the latter and leaves 0.2.
/// let problem = DelassusProblem::new(2, Matrix::identity(2), vec![-1.0, 0.5], vec![0.3])?;
/// let mut solver = DelassusSolver::new(DelassusOptions::default());
/// let report = solver.solve(&problem)?;
/// assert!(report.is_solved() && report.states[0].is_slip());
/// assert!((report.r[0] - 1.0).abs() < 1e-12 && (report.r[1] + 0.3).abs() < 1e-12);
/// let velocity = problem.velocities(&report.r)?;
/// assert!(velocity[0].abs() < 1e-12 && (velocity[1] - 0.2).abs() < 1e-12);
/// # Ok::<(), semismooth::contact::ContactError>(())
/// ```
///
/// # Complexity
/// A sweep is linear in the entries of M. A Newton iteration, a step of interior points or of the path takes one factorisation, or a few,
/// of at most n = D·(number of contacts) unknowns: O(n³) and 8 n² bytes where M is small (n ≤ 200) or mostly full, otherwise the time and
/// memory of a sparse factorisation with its fill-in.
#[derive(Debug, Clone, Default)]
pub struct DelassusSolver {
    options: DelassusOptions,
}

impl DelassusSolver {
    /// A solver with the given options, which are checked when it solves.
    #[must_use]
    pub fn new(options: DelassusOptions) -> Self {
        Self { options }
    }

    /// Solves from r = 0.
    ///
    /// # Complexity
    /// Each step of Newton's or the interior-point method factors a matrix of order n, the number of forces: O(n³) operations where M is
    /// dense. A sweep of the local method is linear in the entries of M.
    ///
    /// # Errors
    /// [`InputError::Option`](crate::InputError::Option) names an option out of range. A failed run is not an error: see the status of the report.
    pub fn solve(&self, problem: &DelassusProblem) -> Result<DelassusReport, ContactError> {
        self.solve_observed(problem, None, |_| ControlFlow::Continue(()))
    }

    /// Solves from the reactions `start` (from 0 without them); `observe` is called with every entry of the history and may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve), and [`InputError::Length`](crate::InputError::Length) and [`InputError::NotFinite`](crate::InputError::NotFinite) for the start.
    pub fn solve_observed(
        &self,
        problem: &DelassusProblem,
        start: Option<&[f64]>,
        mut observe: impl FnMut(&DelassusIteration) -> ControlFlow<()>,
    ) -> Result<DelassusReport, ContactError> {
        self.options.validate()?;
        if let Some(start) = start {
            problem.velocities(start)?;
        }
        match problem.dimension() {
            2 => Run::<2>::new(problem, &self.options, start, &mut observe).report(),
            _ => Run::<3>::new(problem, &self.options, start, &mut observe).report(),
        }
    }
}
