use std::time::Duration;

use super::ConeError;
use crate::options::setters;

/// Options of [`ConeSolver`](super::ConeSolver).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ConeOptions {
    /// Bound on [`ConeReport::error`](super::ConeReport::error). Default 1e-10.
    pub tolerance: f64,
    /// Largest number of iterations, over all starts and methods. Default 100 000.
    pub max_iterations: usize,
    /// Further starts, should the first one fail. Default 8.
    pub restarts: usize,
    /// Largest wall-clock time. Default none.
    pub max_time: Option<Duration>,
}

impl Default for ConeOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 100_000,
            restarts: 8,
            max_time: None,
        }
    }
}

impl ConeOptions {
    setters! {
        /// Sets the bound on the error.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of iterations.
        with_max_iterations(max_iterations: usize);
        /// Sets the number of further starts.
        with_restarts(restarts: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// A tolerance that is not between 2⁻⁵² and 1.
    pub fn validate(&self) -> Result<(), ConeError> {
        match (f64::EPSILON..1.0).contains(&self.tolerance) {
            true => Ok(()),
            false => Err(ConeError::Option {
                name: "tolerance",
                value: self.tolerance,
                range: "at least 2.3e-16 and less than 1",
            }),
        }
    }
}
