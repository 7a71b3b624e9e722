use std::fmt;

use super::DelassusState;

/// How a solution ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DelassusStatus {
    /// The residual is at most the tolerance.
    Solved,
    /// The limit on factorisations was reached.
    Limit,
    /// Neither a proximal step nor a sweep makes progress any more: the problem may have no solution.
    Stalled,
    /// The observer asked to stop.
    Interrupted,
}

impl DelassusStatus {
    /// The status in a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Limit => "limit",
            Self::Stalled => "stalled",
            Self::Interrupted => "interrupted",
        }
    }
}

impl fmt::Display for DelassusStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What an entry of the history did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DelassusPhase {
    /// Sweeps of nonsmooth Gauss–Seidel.
    Sweeps,
    /// One step of the interior-point iteration.
    Interior,
    /// A proximal step by semismooth Newton.
    Proximal,
}

/// One entry of the history.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct DelassusIteration {
    /// Number of the entry, from 0.
    pub index: usize,
    /// What was done.
    pub phase: DelassusPhase,
    /// Residual after it ([`DelassusProblem::residual`](super::DelassusProblem::residual)).
    pub residual: f64,
    /// Weight of the proximal term, against a mean diagonal of 1, or complementarity r·û a contact of interior points, in scaled
    /// variables; 0 for sweeps.
    pub alpha: f64,
    /// Sweeps or Newton iterations.
    pub work: usize,
    /// Whether the inner problem was solved, or the step was not short.
    pub success: bool,
}

/// Result of [`DelassusSolver::solve`](super::DelassusSolver::solve): the solution or, failing that, the best iterate.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DelassusReport {
    /// How it ended.
    pub status: DelassusStatus,
    /// Reactions, contact by contact (N, T1[, T2]).
    pub r: Vec<f64>,
    /// u = M r + q.
    pub u: Vec<f64>,
    /// The state of each contact.
    pub states: Vec<DelassusState>,
    /// [`DelassusProblem::residual`](super::DelassusProblem::residual) at `r`.
    pub residual: f64,
    /// Newton and interior-point iterations, one factorisation each.
    pub factorisations: usize,
    /// Sweeps of Gauss–Seidel.
    pub sweeps: usize,
    /// What was done, in order.
    pub history: Vec<DelassusIteration>,
}

impl DelassusReport {
    /// Whether the residual is at most the tolerance.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status == DelassusStatus::Solved
    }

    /// Newton iterations and sweeps together.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.factorisations + self.sweeps
    }

    /// Number of contacts in a state.
    #[must_use]
    pub fn count(&self, state: DelassusState) -> usize {
        self.states.iter().filter(|s| **s == state).count()
    }
}
