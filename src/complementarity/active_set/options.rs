use std::fmt;

use crate::InputError;
use crate::input::{any, check_options, fraction};
use crate::options::setters;
use crate::run::Status;

/// Options of [`ActiveSetSolver`](super::ActiveSetSolver). The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ActiveSetOptions {
    /// Largest number of iterations; default 1000.
    pub max_iterations: usize,
    /// Tolerance on the error of each component relative to the terms of its row ([accuracy](crate::complementarity#accuracy)). Where
    /// reduced systems are solved iteratively the terms are formed with the largest |z| of all unknowns that rows connect with each other,
    /// as the errors of such solves are relative to that size. Default 1e-11.
    pub tolerance: f64,
    /// Number of block exchanges without a decrease of the number of wrong signs after which other exchanges are tried. Default 10.
    pub patience: usize,
}

impl Default for ActiveSetOptions {
    fn default() -> Self {
        Self {
            max_iterations: 1000,
            tolerance: 1e-11,
            patience: 10,
        }
    }
}

impl ActiveSetOptions {
    setters! {
        /// Sets the largest number of iterations.
        with_max_iterations(max_iterations: usize);
        /// Sets the tolerance.
        with_tolerance(tolerance: f64);
        /// Sets the patience with block exchanges.
        with_patience(patience: usize);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[
            any("max_iterations", self.max_iterations as u64),
            fraction("tolerance", self.tolerance),
        ])
    }
}

/// One iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ActiveSetIteration {
    /// Natural residual maxᵢ |zᵢ − mid(lᵢ, uᵢ, zᵢ − wᵢ)| after it.
    pub residual: f64,
    /// Components that moved to or from a bound before it.
    pub changes: usize,
    /// Components between their bounds during it.
    pub inactive: usize,
    /// Iterations of the linear solver; 0 for a direct one.
    pub linear_iterations: usize,
    /// Which of the components with wrong signs were exchanged.
    pub exchange: Exchange,
}

/// Which components are exchanged between two iterations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Exchange {
    /// All whose signs are wrong.
    #[default]
    Block,
    /// Those with the largest violations.
    Largest,
    /// One, by the least-index rule.
    Single,
}

/// Report on a run.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ActiveSetReport {
    /// How it ended: [`Singular`](Status::Singular) if a reduced matrix is (or, for iterative solves, is not positive definite), so that M
    /// is no P matrix; [`Inaccurate`](Status::Inaccurate) if the reduced systems could not be solved accurately enough to go on.
    pub status: Status,
    /// Natural residual of the point returned.
    pub residual: f64,
    /// Iterations: reduced systems solved.
    pub iterations: usize,
    /// Iterations of the linear solver in all; 0 for a direct one.
    pub linear_iterations: usize,
}

impl fmt::Display for ActiveSetReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        crate::words::ended(f, &self.status, self.iterations, self.residual)
    }
}
