use std::fmt;
use std::time::Duration;

use crate::contact::residuals::StateCounts;
use crate::contact::{ContactResiduals, ContactStrategy};
use crate::run::Status;
use crate::words::Count;

/// The progress of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ReducedProgress {
    /// Share of the load, 1 but for load steps.
    pub load: f64,
    /// Newton steps begun, of failed attempts too.
    pub newton: usize,
    /// GMRES iterations of the step under way.
    pub krylov: usize,
    /// The largest residual before the last Newton step; infinite before the first one.
    pub residual: f64,
}

/// One Newton step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReducedIteration {
    /// Share of the load, 1 but for load steps.
    pub load: f64,
    /// Residuals before the step.
    pub residuals: ContactResiduals,
    /// Numbers of open, sticking and slipping nodes before the step.
    pub states: [usize; 3],
    /// The relative tolerance of the linear system.
    pub forcing: f64,
    /// GMRES iterations.
    pub krylov: usize,
    /// The step length, in (0, 1].
    pub step: f64,
}

/// Wall-clock times by task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReducedTimes {
    /// Changes of the multigrid hierarchy as nodes change state.
    pub select: Duration,
    /// GMRES with its multigrid cycles.
    pub krylov: Duration,
    /// Products, laws of the nodes, and everything else.
    pub rest: Duration,
}

impl ReducedTimes {
    /// The total time.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.select + self.krylov + self.rest
    }
}

/// A solution in the displacements, or the best iterate of a search that failed. Its `Debug` leaves out vectors and history, so that a `main`
/// which returns an error that holds it prints a line.
#[derive(Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReducedReport {
    /// How the search ended.
    pub status: Status,
    /// The free displacements u, as numbered in the stiffness matrix.
    pub displacements: Vec<f64>,
    /// Contact forces λν of all nodes, then λt₁, in space then λt₂: f − A u at the contact nodes. Followed by α they are the x of the
    /// condensed form.
    pub forces: Vec<f64>,
    /// Residuals of the full problem, computed at these displacements.
    pub residuals: ContactResiduals,
    /// Numbers of open, sticking and slipping nodes at these displacements.
    pub states: [usize; 3],
    /// The strategy that led here.
    pub strategy: ContactStrategy,
    /// All Newton steps, of failed attempts too.
    pub iterations: Vec<ReducedIteration>,
    /// Wall-clock times by task.
    pub times: ReducedTimes,
}

impl ReducedReport {
    /// Number of Newton steps.
    #[must_use]
    pub fn newton(&self) -> usize {
        self.iterations.len()
    }

    /// Number of GMRES iterations.
    #[must_use]
    pub fn krylov(&self) -> usize {
        self.iterations.iter().map(|i| i.krylov).sum()
    }
}

/// "12 Newton steps, 90 GMRES iterations (load steps); 1 open, 2 stick, 1 slips; …": in one line.
impl fmt::Display for ReducedReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {} ({}); {}; {}",
            Count(self.newton(), "Newton step", "Newton steps"),
            Count(self.krylov(), "GMRES iteration", "GMRES iterations"),
            self.strategy.name(),
            StateCounts(self.states),
            self.residuals
        )
    }
}

impl fmt::Debug for ReducedReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ReducedReport")
            .field("status", &self.status)
            .field("residuals", &self.residuals)
            .field("states", &self.states)
            .field("strategy", &self.strategy)
            .field("iterations", &self.iterations.len())
            .finish_non_exhaustive()
    }
}
