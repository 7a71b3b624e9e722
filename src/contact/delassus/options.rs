use std::time::Duration;

use super::DelassusError;
use crate::options::setters;

/// Options of [`DelassusSolver`](super::DelassusSolver). The defaults need no touching.
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
    /// Largest number of sweeps in a row; runs of sweeps that are longer by themselves are cut. Default 10 000.
    pub max_sweeps: usize,
    /// Wall-clock time after which the best iterate is handed out with the status [`Limit`](super::DelassusStatus::Limit); a factorisation begun is
    /// finished. Default none: with a limit runs are no longer the same on every machine.
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
    /// [`DelassusError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), DelassusError> {
        if self.tolerance > 0.0 && self.tolerance < 1.0 {
            Ok(())
        } else {
            Err(DelassusError::Option {
                name: "tolerance",
                value: self.tolerance,
                range: "in (0, 1)",
            })
        }
    }
}
