use std::time::Duration;

use crate::InputError;
use crate::input::{any, check_options, positive};
use crate::options::setters;

/// Options of [`Bundle`](super::Bundle).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct BundleOptions {
    /// Where the run ends: each component of the aggregate subgradient is at most this part of its largest value in gradients of the run, that
    /// of the step to the minimum of the model at most this part of |θᵢ| or of the first step (or rounding hides what it would gain), and
    /// also [`value_tolerance`](Self::value_tolerance) is met. Default 1e-6; rounding in the quadratic programs ends runs at about 1e-8.
    pub tolerance: f64,
    /// The aggregate linearisation error is at most this part of what f at points of the run exceeds its least value by, but for rounding
    /// of f. Default 1e-9.
    pub value_tolerance: f64,
    /// Length of the first step, in the unit of θ; where bounds are finite in that of the parameter with the widest ones, to which the steps of
    /// others are in proportion as their widths, up to a factor of √2. Default `None`: a tenth of the largest finite width of the bounds,
    /// without finite ones of the largest |θᵢ| of the start, or of 1 where that is 0.
    pub step: Option<f64>,
    /// Largest number of iterations, a quadratic program each. Default 500.
    pub max_iterations: usize,
    /// Largest wall-clock time, checked before each evaluation and told to
    /// [`Objective::limit_time`](super::Objective::limit_time), which ends long ones. Default none.
    pub max_time: Option<Duration>,
    /// Largest number of gradients that the model of f keeps; more are aggregated. Default 60.
    pub max_bundle: usize,
}

impl Default for BundleOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            value_tolerance: 1e-9,
            step: None,
            max_iterations: 500,
            max_time: None,
            max_bundle: 60,
        }
    }
}

impl BundleOptions {
    setters! {
        /// Sets where the run ends.
        with_tolerance(tolerance: f64);
        /// Sets the largest linearisation error.
        with_value_tolerance(value_tolerance: f64);
        /// Sets the length of the first step.
        with_step(step: Option<f64>);
        /// Sets the largest number of iterations.
        with_max_iterations(max_iterations: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
        /// Sets the largest number of gradients that are kept.
        with_max_bundle(max_bundle: usize);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[
            positive("tolerance", self.tolerance),
            positive("value_tolerance", self.value_tolerance),
            positive("step", self.step.unwrap_or(1.0)),
            any("max_iterations", self.max_iterations as u64),
            (
                "max_bundle",
                self.max_bundle as f64,
                self.max_bundle >= 3,
                "at least 3",
            ),
        ])
    }
}
