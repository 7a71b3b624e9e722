//! Curves from α = 0 to α = 1 by the crate's continuation.

use crate::complementarity::solver::engine::Engine;
use crate::continuation::{Continuation, ContinuationOptions, Direction, Event, Termination};
use crate::piecewise::PiecewiseSmooth;

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
            .with_max_nodes(self.options.max_nodes.min(20_000))
            .with_max_growth(1e8)
            .with_max_time(left)
    }

    /// Follows the curve from (y, 0) towards α = 1, as long as α stays above `least`, also over branchings.
    pub(super) fn follow<P: PiecewiseSmooth>(&mut self, map: &P, y: &[f64], least: f64) -> Option<End> {
        let n = self.n();
        let mut x = y.to_vec();
        x.push(0.0);
        let size = y.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let options = self.path_options(size, least);
        let mut curve = Continuation::new(map, &x, Direction::Increasing, options.clone()).ok()?;
        let mut nearest = End {
            x: x.clone(),
            reached: false,
        };
        for _ in 0..8 {
            let mut last = None;
            for event in curve.by_ref() {
                let Ok(event) = event else { break };
                let p = event.x();
                if p[n] > nearest.x[n] {
                    nearest.x.copy_from_slice(p);
                }
                self.report.iterations += 1;
                if self.exhausted().is_some() {
                    return Some(nearest);
                }
                last = Some(event);
            }
            match (curve.termination(), last) {
                (Some(Termination::ParameterRange), Some(event)) if event.x()[n] > 0.5 => {
                    nearest.x.copy_from_slice(event.x());
                    nearest.reached = true;
                    break;
                }
                (Some(Termination::Branching), Some(Event::Transition(t))) => {
                    let rate = |a: &crate::continuation::Arm| a.tangent[n];
                    let arm = t.arms.iter().max_by(|a, b| rate(a).total_cmp(&rate(b)))?;
                    curve = Continuation::along_arm(map, &t.x, arm, options.clone()).ok()?;
                }
                _ => break,
            }
        }
        Some(nearest)
    }
}
