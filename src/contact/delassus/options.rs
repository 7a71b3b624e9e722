use crate::InputError;
use crate::input::{check_options, fraction};
use std::time::Duration;

use crate::options::setters;

/// Options of [`DelassusSolver`](super::DelassusSolver). The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct DelassusOptions {
    /// Residual ([`DelassusProblem::residual`](super::DelassusProblem::residual)) of a solution, in (0, 1). Default 1e-12.
    pub tolerance: f64,
    /// Largest number of factorisations. Default 6000.
    pub max_factorisations: usize,
    /// Largest number of consecutive sweeps; longer runs of sweeps are cut to it. Default 10 000.
    pub max_sweeps: usize,
    /// Wall-clock time after which the best iterate is returned with the status [`TimeLimit`](crate::run::Status::TimeLimit); a factorisation
    /// under way is finished. Default none: with a limit results depend on the machine.
    pub max_time: Option<Duration>,
}

impl Default for DelassusOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-12,
            max_factorisations: 6000,
            max_sweeps: 10_000,
            max_time: None,
        }
    }
}

impl DelassusOptions {
    setters! {
        /// Sets the residual of a solution.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of factorisations.
        with_max_factorisations(max_factorisations: usize);
        /// Sets the largest number of sweeps in a row.
        with_max_sweeps(max_sweeps: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[fraction("tolerance", self.tolerance)])
    }
}
