use std::time::Duration;

use crate::InputError;
use crate::continuation::DiagramOptions;
use crate::input::{any, check_options, positive};
use crate::options::setters;

/// Options of [`search_solutions`](super::search_solutions).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct SearchOptions {
    /// Number of random starts in each round. Default 100.
    pub starts: usize,
    /// Largest number of starts in each round from selections that differ from that of a known solution at one site; each is
    /// tried once. Default 1000.
    pub neighbours: usize,
    /// Random points are drawn from a box around 0 of this half-width, relative to 1 + the largest entry of the solutions known.
    /// Default 2.
    pub spread: f64,
    /// Number of deflated Newton runs in each round. Default 20.
    pub deflations: usize,
    /// Largest number of rounds; a round without a new solution is the last. Default 4.
    pub rounds: usize,
    /// Curves through the solutions are followed as far as α ± `reach` (1 + |α|); `None` to follow none. Default 1.
    pub reach: Option<f64>,
    /// How curves are followed; the range of the parameter is replaced by that of `reach`. Default: at most 2000 edges and 100 000
    /// points a round.
    pub diagram: DiagramOptions,
    /// The search ends with this number of solutions. Default 10 000.
    pub max_solutions: usize,
    /// Two points closer than this, relative to 1 + ‖x‖₂, are one. Default 1e-7.
    pub merge_distance: f64,
    /// Where the sequence of random numbers begins. Default 1.
    pub seed: u64,
    /// Wall-clock time after which the search ends, between two runs or curves. Default none.
    pub max_time: Option<Duration>,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            starts: 100,
            neighbours: 1000,
            spread: 2.0,
            deflations: 20,
            rounds: 4,
            reach: Some(1.0),
            diagram: DiagramOptions::default()
                .with_max_edges(2000)
                .with_max_points(100_000),
            max_solutions: 10_000,
            merge_distance: 1e-7,
            seed: 1,
            max_time: None,
        }
    }
}

impl SearchOptions {
    setters! {
        /// Sets the number of random starts in each round.
        with_starts(starts: usize);
        /// Sets the largest number of starts from neighbouring selections in each round.
        with_neighbours(neighbours: usize);
        /// Sets the half-width of the box of random points.
        with_spread(spread: f64);
        /// Sets the number of deflated runs in each round.
        with_deflations(deflations: usize);
        /// Sets the largest number of rounds.
        with_rounds(rounds: usize);
        /// Sets how far curves are followed.
        with_reach(reach: Option<f64>);
        /// Sets how curves are followed.
        with_diagram(diagram: DiagramOptions);
        /// Sets the number of solutions at which the search ends.
        with_max_solutions(max_solutions: usize);
        /// Sets the distance within which two points are one.
        with_merge_distance(merge_distance: f64);
        /// Sets where the sequence of random numbers begins.
        with_seed(seed: u64);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        self.diagram.validate()?;
        let merged = self.merge_distance > 0.0 && self.merge_distance < 1e-2;
        check_options(&[
            positive("spread", self.spread),
            positive("reach", self.reach.unwrap_or(1.0)),
            ("merge_distance", self.merge_distance, merged, "in (0, 0.01)"),
            any("max_solutions", self.max_solutions as u64),
        ])
    }
}
