//! A curve followed towards the upper bound of its parameter, also through branchings.

use super::{Arm, Continuation, ContinuationOptions, Direction, Event, Termination};
use crate::piecewise::PiecewiseSmooth;

/// How far the curve was followed.
pub(crate) struct Pursuit {
    /// The last point if the bound was reached, else that with the largest parameter.
    pub(crate) x: Vec<f64>,
    /// Number of events on the way.
    pub(crate) points: usize,
    pub(crate) reached: bool,
    pub(crate) interrupted: bool,
}

/// Follows the curve from x, in the direction of growing parameter, to the upper bound of its range. At a branching the arm is taken on
/// which the parameter grows fastest, `branchings` times at most; `arm_points` gives the largest number of points of an arm from the number
/// of points before it. `see` may stop the run. `None` where the curve or an arm of it cannot be started.
pub(crate) fn pursue(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &ContinuationOptions,
    branchings: usize,
    arm_points: &dyn Fn(usize) -> usize,
    see: &mut dyn FnMut(&Event) -> bool,
) -> Option<Pursuit> {
    let last = x.len() - 1;
    let length = |t: &[f64]| {
        let unit = |j: usize| options.typical_sizes.get(j).copied().unwrap_or(1.0);
        let squares = t.iter().enumerate().map(|(j, t)| (t / unit(j)).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let rate = |a: &Arm| a.tangent[last] / length(&a.tangent);
    let mut curve = Continuation::new(map, x, Direction::Increasing, options.clone()).ok()?;
    let mut best = Pursuit {
        x: x.to_vec(),
        points: 0,
        reached: false,
        interrupted: false,
    };
    for branching in 0.. {
        let mut end = None;
        while let Some(Ok(event)) = curve.next() {
            best.points += 1;
            if event.x()[last] > best.x[last] {
                best.x.copy_from_slice(event.x());
            }
            if see(&event) {
                best.interrupted = true;
                return Some(best);
            }
            end = Some(event);
        }
        match (curve.termination(), end) {
            (Some(Termination::Branching), Some(Event::Transition(t)))
                if branching < branchings && arm_points(best.points) > 0 =>
            {
                let arm = t.arms.iter().max_by(|a, b| rate(a).total_cmp(&rate(b)))?;
                let left = options.clone().with_max_points(arm_points(best.points));
                curve = Continuation::along_arm(map, &t.x, arm, left).ok()?;
            }
            (Some(Termination::ParameterRange), Some(event)) => {
                let (lower, upper) = options.parameter_range;
                if event.x()[last] > 0.5 * (lower + upper) {
                    best.x.copy_from_slice(event.x());
                    best.reached = true;
                }
                return Some(best);
            }
            _ => return Some(best),
        }
    }
    Some(best)
}
