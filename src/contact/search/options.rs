use std::time::Duration;

use crate::InputError;
use crate::input::{any, check_options};
use crate::newton::NewtonOptions;
use crate::options::setters;

/// Options of the search for a solution at fixed α
/// ([`CondensedContact::solve_observed`](crate::contact::CondensedContact::solve_observed)). The defaults suit most problems.
///
/// ```
/// use semismooth::contact::ContactOptions;
/// let quick = ContactOptions::default().with_max_increments(0).with_max_paths(0);
/// assert!(quick.validate().is_ok());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ContactOptions {
    /// Options of each run of Newton's method: at most 13 runs before the body is lowered, three after each lowering, and one for each
    /// increment.
    pub newton: NewtonOptions,
    /// Largest number of increments in which the body is lowered; 0 skips this strategy. Default 1000.
    pub max_increments: usize,
    /// Largest number of paths along which the body is lowered; the nodes touch in another order on each. Default 6.
    pub max_paths: usize,
    /// Largest number of points of a path; all paths are tried with 250 points before one is followed further. Default 16 000; problems of
    /// more than 630 unknowns are given fewer, the number falling with n³ to 300.
    pub max_points: usize,
    /// Largest number of branchings of a path at which an arm is chosen. Default 16.
    pub max_branchings: usize,
    /// Largest number of partial selections tried at a degenerate point of a path. Default 20 000.
    pub max_nodes: u64,
    /// Wall-clock time after which the search ends as if the observer had stopped it; checked between iterations. Default none: with a
    /// limit results depend on the machine.
    pub max_time: Option<Duration>,
}

impl Default for ContactOptions {
    fn default() -> Self {
        Self {
            newton: NewtonOptions::default(),
            max_increments: 1000,
            max_paths: 6,
            max_points: 16_000,
            max_branchings: 16,
            max_nodes: 20_000,
            max_time: None,
        }
    }
}

impl ContactOptions {
    setters! {
        /// Sets the options of Newton's method.
        with_newton(newton: NewtonOptions);
        /// Sets the largest number of increments.
        with_max_increments(max_increments: usize);
        /// Sets the largest number of paths.
        with_max_paths(max_paths: usize);
        /// Sets the largest number of points of a path.
        with_max_points(max_points: usize);
        /// Sets the largest number of branchings of a path.
        with_max_branchings(max_branchings: usize);
        /// Sets the largest number of partial selections tried at a point of a path.
        with_max_nodes(max_nodes: u64);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        self.newton.validate()?;
        check_options(&[
            any("max_points", self.max_points as u64),
            any("max_nodes", self.max_nodes),
        ])
    }
}
