//! Curves from α = 0 to α = 1 by the crate's continuation.

use crate::complementarity::solver::engine::Engine;
use crate::continuation::{ContinuationOptions, pursue};
use crate::piecewise::PiecewiseSmooth;
use crate::tolerances::SELECTIONS;

/// Most branchings on a path.
const BRANCHINGS: usize = 7;
/// Limits of a search for arms. Where a start far out lies, up to rounding, on many kinks, longer searches take seconds and find none.
const ARM_NODES: u64 = 1000;
const LOCAL_STARTS: usize = 8;

/// The last point of a path.
pub(super) struct End {
    pub(super) x: Vec<f64>,
    pub(super) reached: bool,
}

impl Engine<'_> {
    fn path_options(&self, size: f64, least: f64) -> ContinuationOptions {
        let left = self
            .options
            .max_time
            .map(|t| t.saturating_sub(self.clock.elapsed()));
        ContinuationOptions::default()
            .with_parameter_range((least, 1.0))
            .with_max_points(self.options.max_path_points)
            .with_max_step(10.0 * (1.0 + size))
            .with_max_nodes(self.options.max_nodes.min(ARM_NODES))
            .with_max_selections(SELECTIONS)
            .with_local_starts(LOCAL_STARTS)
            .with_max_growth(1e8)
            .with_max_time(left)
    }

    /// Follows the curve from (y, 0) towards α = 1, as long as α stays above `least`, also over branchings.
    pub(super) fn follow<P: PiecewiseSmooth>(&mut self, map: &P, y: &[f64], least: f64) -> Option<End> {
        if self.exhausted().is_some() {
            return None;
        }
        let mut x = y.to_vec();
        x.push(0.0);
        let size = y.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let options = self.path_options(size, least);
        let each = options.max_points;
        let end = pursue(&map, &x, &options, BRANCHINGS, &|_| each, &mut |_| {
            self.tell(self.strategy);
            self.report.iterations += 1;
            self.exhausted().is_some()
        })?;
        Some(End {
            x: end.x,
            reached: end.reached,
        })
    }
}
