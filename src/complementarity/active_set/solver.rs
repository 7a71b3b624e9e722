use std::ops::ControlFlow;

use super::engine::{Engine, Systems};
use super::{ActiveSetIteration, ActiveSetOptions, ActiveSetReport, AutoReduced, ReducedSolver, Start};
use crate::complementarity::{BoundState, ComplementarityError, Lcp};

/// The primal–dual active-set method (block principal pivoting) for LCPs and box LCPs.
///
/// All components whose signs are wrong are exchanged at once. If that does not reduce their number for a while, only a few with the
/// largest violations are exchanged, starting from the bounds; then all for a longer while, and finally one at a time by the least-index
/// rule until their number is smaller (J. J. Júdice, F. M. Pires, 1994, after K. G. Murty, 1974): for P matrices the method then ends at
/// the solution after finitely many iterations. For M matrices (obstacle problems) block exchanges alone are monotone. Started from the
/// right sets, it takes one factorisation.
///
/// A solver that is used again for problems of the same size with full matrices of at most 64 unknowns allocates nothing.
///
/// ```
/// use semismooth::complementarity::{Lcp, active_set::ActiveSetSolver};
/// use semismooth::run::Status;
/// use semismooth::sparse::Matrix;
/// // Murty's example of exponential length for Lemke's method: 1 on the diagonal, 2 below.
/// let n = 40;
/// let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 } else if i > j { 2.0 } else { 0.0 }).collect()).collect();
/// let lcp = Lcp::new(Matrix::from_rows(&rows)?, vec![-1.0; n])?;
/// let mut z = vec![0.0; n];
/// let report = ActiveSetSolver::default().solve(&lcp, &mut z)?;
/// assert_eq!(report.status, Status::Solved);
/// assert!(report.iterations <= 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ActiveSetSolver<R = AutoReduced> {
    reduced: R,
    engine: Engine,
}

impl<R: ReducedSolver> ActiveSetSolver<R> {
    /// A solver with the given options and linear solver.
    pub fn with_reduced(options: ActiveSetOptions, reduced: R) -> Self {
        Self {
            reduced,
            engine: Engine::new(options),
        }
    }

    /// The sets at the end of the last run.
    #[must_use]
    pub fn states(&self) -> &[BoundState] {
        self.engine.states()
    }

    /// The iterations of the last run.
    #[must_use]
    pub fn history(&self) -> &[ActiveSetIteration] {
        self.engine.history()
    }

    /// Solves the problem from the start in `z`, which is overwritten by the solution or the last iterate.
    ///
    /// # Errors
    /// A start of the wrong length or not finite, options out of range. How the run ended is in the report.
    pub fn solve(&mut self, lcp: &Lcp, z: &mut [f64]) -> Result<ActiveSetReport, ComplementarityError> {
        self.solve_observed(lcp, z, None, |_| ControlFlow::Continue(()))
    }

    /// Solves the problem, with the sets of the first iteration given instead of read off the start in `z`; what is [`BoundState::Lower`]
    /// or [`BoundState::Upper`] without such a bound counts as inactive.
    ///
    /// # Errors
    /// As [`solve`](Self::solve), and sets of the wrong length.
    pub fn solve_from_states(
        &mut self,
        lcp: &Lcp,
        z: &mut [f64],
        sets: &[BoundState],
    ) -> Result<ActiveSetReport, ComplementarityError> {
        self.solve_observed(lcp, z, Some(sets), |_| ControlFlow::Continue(()))
    }

    /// As [`solve`](Self::solve) or [`solve_from_states`](Self::solve_from_states), with an observer of each iteration, which may stop the
    /// run.
    ///
    /// # Errors
    /// As [`solve_from_states`](Self::solve_from_states).
    pub fn solve_observed(
        &mut self,
        lcp: &Lcp,
        z: &mut [f64],
        sets: Option<&[BoundState]>,
        mut observe: impl FnMut(&ActiveSetIteration) -> ControlFlow<()>,
    ) -> Result<ActiveSetReport, ComplementarityError> {
        let systems = &mut Given {
            reduced: &mut self.reduced,
            lcp,
        };
        self.engine.solve(lcp.into(), systems, z, sets, &mut observe)
    }
}

impl Default for ActiveSetSolver<AutoReduced> {
    fn default() -> Self {
        Self::new(ActiveSetOptions::default())
    }
}

impl ActiveSetSolver<AutoReduced> {
    /// A solver with the given options.
    #[must_use]
    pub fn new(options: ActiveSetOptions) -> Self {
        Self::with_reduced(options, AutoReduced::default())
    }
}

/// The systems of a problem, solved by a [`ReducedSolver`].
struct Given<'a, R> {
    reduced: &'a mut R,
    lcp: &'a Lcp,
}

impl<R: ReducedSolver> Systems for Given<'_, R> {
    fn load(&mut self) -> Result<(), ComplementarityError> {
        self.reduced.load(self.lcp.matrix())
    }

    fn select(&mut self, free: &[bool]) -> Result<(), ComplementarityError> {
        self.reduced.select(self.lcp.matrix(), free)
    }

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        self.reduced.solve(r, d, tolerance)
    }

    fn is_direct(&self) -> bool {
        self.reduced.is_direct()
    }

    fn coarse_start(&mut self, options: &ActiveSetOptions) -> Result<Option<Start>, ComplementarityError> {
        self.reduced.coarse_start(self.lcp, options)
    }
}
