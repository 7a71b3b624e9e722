use std::time::Duration;

use crate::InputError;
use crate::input::{any, check_options, fraction};
use crate::options::setters;

/// Options of the enumeration. The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct EnumerationOptions {
    /// Largest number of search nodes (partial selections tried) before the search ends and reports how many selections it covered; it also
    /// ends where the tables on the path to a node take more than 2 GB. Default 1 000 000.
    pub max_nodes: u64,
    /// Time after which the search ends and reports how many selections it covered; checked before each exchange of a linear program and
    /// for each row of a system solved. Default: none.
    pub max_time: Option<Duration>,
    /// Where the search for arms reaches its limits, a local search starts from this number of random selections for either sign of α̇; it
    /// may find arms but never makes the list complete. Default 100.
    pub local_starts: usize,
    /// A point counts as lying in a closed cell when it is no farther from it than this, relative to 1 + ‖x‖₂; not used for solutions of
    /// maps that give exact coefficients. Default 1e-9.
    pub tolerance: f64,
    /// Two points closer than this, relative to 1 + ‖x‖₂, are one; as for `tolerance`. Default 1e-8.
    pub merge_distance: f64,
}

impl Default for EnumerationOptions {
    fn default() -> Self {
        Self {
            max_nodes: 1_000_000,
            max_time: None,
            local_starts: 100,
            tolerance: 1e-9,
            merge_distance: 1e-8,
        }
    }
}

impl EnumerationOptions {
    setters! {
        /// Sets the largest number of search nodes.
        with_max_nodes(max_nodes: u64);
        /// Sets the time after which the search ends.
        with_max_time(max_time: Option<Duration>);
        /// Sets the number of starts of the local search for arms.
        with_local_starts(local_starts: usize);
        /// Sets the distance up to which a point belongs to a cell.
        with_tolerance(tolerance: f64);
        /// Sets the distance up to which points are one.
        with_merge_distance(merge_distance: f64);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`](InputError::Option) names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[
            any("max_nodes", self.max_nodes),
            fraction("tolerance", self.tolerance),
            fraction("merge_distance", self.merge_distance),
        ])
    }
}
