//! Whether a corrected point lies on the same curve, near the prediction: else the step is shortened.

use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, Solver, State};
use crate::continuation::error::if_solved;
use crate::continuation::event::locate::STRAY;
use crate::continuation::event::watch::Monitor;
use crate::linear::LinearSolver;
use crate::newton::{Linearisation, MoorePenrose};
use crate::piecewise::{PiecewiseError, ScaledMap, Selection};
use crate::sparse::{distance, dot, norm};
use crate::spread::golden;

/// Angle to which tangents of arms at singular points are known: they come from difference quotients.
pub(in crate::continuation) const ARMS: f64 = 1e-5;

/// Angle (as a distance of unit vectors) allowed between the chord of a step and the mean of the tangents at its ends.
const CHORD: f64 = 0.05;

/// How a step bends.
pub(super) struct Shape {
    /// Distance of the unit tangents at its ends.
    pub(super) turn: f64,
    /// Distance of its direction from their mean.
    pub(super) deviation: f64,
}

impl Shape {
    /// The shape of a step of length h from `a` whose end `b` agrees with the prediction: the tangents are
    /// close, the chord is close to their mean, and its length to that of the step. `None` for others.
    pub(super) fn of(a: &State, b: &State, h: f64, min_cos: f64) -> Option<Self> {
        let cos = dot(&a.t, &b.t);
        if cos.is_nan() || cos < min_cos {
            return None;
        }
        let chord: Vec<f64> = b.x.iter().zip(&a.x).map(|(x, x0)| x - x0).collect();
        let length = norm(&chord);
        if !(length >= 0.5 * h && length <= 2.0 * h) {
            return None;
        }
        let mean_length = (2.0 + 2.0 * cos).sqrt();
        let deviation = chord
            .iter()
            .zip(a.t.iter().zip(&b.t))
            .map(|(c, (t0, t1))| (c / length - (t0 + t1) / mean_length).powi(2))
            .sum::<f64>()
            .sqrt();
        (deviation <= CHORD).then(|| Self {
            turn: distance(&a.t, &b.t),
            deviation,
        })
    }

    /// Whether the step may have jumped to another curve: it turns much more than the last one, which would
    /// have turned by `bend` over its length, its chord is not that of an arc, or the corrector converged
    /// slowly. Angles up to `noise` are none.
    pub(super) fn is_doubtful(&self, bend: f64, corrections: usize, noise: impl FnOnce() -> f64) -> bool {
        const MORE: f64 = 2.0;
        const SKEW: f64 = 0.1;
        const SLOW: usize = 5;
        let above = |angle: f64, limit: f64| if angle > limit { angle } else { 0.0 };
        let angle = above(self.turn, MORE * bend).max(above(self.deviation, SKEW * self.turn.max(bend)));
        corrections > SLOW || (angle > 0.0 && angle > noise())
    }
}

/// How fast the regularity of ∇H falls, from one step to the next.
pub(in crate::continuation) struct Regularity {
    /// The vector by which it is measured.
    pub(in crate::continuation) probe: Vec<f64>,
    sizes: Vec<f64>,
    behind: Vec<f64>,
}

impl Regularity {
    /// For n residuals.
    pub(in crate::continuation) fn new(n: usize) -> Self {
        Self {
            probe: generic_probe(n),
            sizes: Vec::new(),
            behind: vec![0.0; n + 1],
        }
    }

    /// The rate at which the regularity of ∇H^(σ) falls at a state, the point of the linearisation or next to
    /// it, for steps of length h.
    pub(in crate::continuation) fn decline<'c, L: LinearSolver>(
        &mut self,
        at: Linearisation<'c, L>,
        map: &dyn ScaledMap,
        row_sizes: &[f64],
        state: &State,
        h: f64,
    ) -> Result<(f64, Linearisation<'c, L>), PiecewiseError> {
        const SHARE: f64 = 1e-3;
        const LEAST: f64 = 1e-7;
        let distance = SHARE * h.max(LEAST / SHARE * (1.0 + norm(&state.x)));
        self.sizes.clear();
        self.sizes.extend_from_slice(row_sizes);
        let (here, sizes, behind) = ((&state.x[..], &state.t[..]), &mut self.sizes, &mut self.behind);
        let (rate, at) = at.decline(map, here, distance, sizes, &mut self.probe, behind)?;
        if self.probe.iter().any(|v| !v.is_finite()) {
            self.probe = generic_probe(self.probe.len());
        }
        // Without an estimate no singular point is expected.
        Ok((rate.unwrap_or(0.0), at))
    }
}

/// A vector that is unlikely to be orthogonal to a given one.
fn generic_probe(n: usize) -> Vec<f64> {
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    (0..n).map(|k| sign(k) * (0.5 + 0.5 * golden(k + 1))).collect()
}

/// Angle below which tangents next to a regular point, or at a singular one, cannot be distinguished from
/// that of a linearisation with this estimate of its condition.
pub(super) fn tangent_noise(regular: bool, rcond: Option<f64>) -> f64 {
    let known = if regular { 1e-9 } else { ARMS };
    known + 100.0 * f64::EPSILON / rcond.unwrap_or(1.0).max(f64::EPSILON)
}

/// Turns t into the tangent at x; `None` next to a singular point, where t is kept.
fn sharpen<'c, 'a>(
    corrector: &'c mut MoorePenrose<Solver<'a>>,
    map: &dyn ScaledMap,
    selection: &Selection,
    x: &[f64],
    t: &mut [f64],
) -> Result<Option<Linearisation<'c, Solver<'a>>>, PiecewiseError> {
    let at = if_solved(corrector.linearize(map, selection, x, Some(t)))?;
    if let Some(at) = &at {
        let sign = dot(at.tangent(), t).signum();
        t.iter_mut().zip(at.tangent()).for_each(|(t, v)| *t = sign * v);
    }
    Ok(at)
}

impl<'a> Curve<'a> {
    /// Whether an undetected singular point lies between `here` and `next`, where the step ends at the event. It does if the regularity of
    /// ∇H, extrapolated linearly from one of the ends, falls to zero in between: the step has jumped to a curve that crosses, or has
    /// passed two crossings. If the step ends at a singular point, that must be the first one.
    pub(super) fn passes_unseen(&mut self, event: Option<Monitor>) -> bool {
        if self.here.decline.is_none() && self.next.s > 0.0 {
            // The contribution of the singular point at the start of the step is known.
            let known = self.here.order.max(1.0) / self.next.s;
            self.next.decline = self.next.decline.map(|d| d + known);
        }
        let ahead = self.here.decline.map_or(0.0, |d| d * self.next.s);
        if event == Some(Monitor::Singular) {
            // Each one before it adds at least as much to the rate.
            return ahead > 2.0;
        }
        let behind = self.next.decline.map_or(0.0, |d| -d * self.next.s);
        self.next.orientation.is_some() && ahead.max(behind) > 1.0
    }

    /// Recomputes the tangents at both ends, which are those of the previous iterates, and how fast the regularity of ∇H falls along them:
    /// next to curves that cross at a small angle a tangent that is off by as much leads to the other curve. `false` next to singular points.
    pub(super) fn refine_declines(&mut self) -> Result<bool, ContinuationError> {
        let h = self.next.s;
        for state in [&mut self.here, &mut self.next] {
            if state.decline.is_none() {
                continue;
            }
            let at_fold = state.t.last() == Some(&0.0);
            let (map, selection) = (&self.map, &self.path.selection);
            let Some(at) = sharpen(&mut self.corrector, map, selection, &state.x, &mut state.t)? else {
                return Ok(false);
            };
            if at_fold && let Some(rate) = state.t.last_mut() {
                *rate = 0.0;
            }
            let (decline, _) = (self.scale.regularity).decline(at, map, &self.scale.rows, state, h)?;
            state.decline = Some(decline);
        }
        Ok(true)
    }

    /// Recomputes the tangents at both ends, which are those of the previous iterates, and returns their
    /// distance, with the noise of the latter. That at a singular point, where kernels are noise, is kept.
    pub(super) fn sharpen_tangents(&mut self) -> Result<(f64, f64), ContinuationError> {
        let regular = self.here.decline.is_some();
        if regular {
            let State { x, t, .. } = &mut self.here;
            let at_fold = t.last() == Some(&0.0);
            sharpen(&mut self.corrector, &self.map, &self.path.selection, x, t)?;
            if at_fold && let Some(rate) = t.last_mut() {
                *rate = 0.0;
            }
        }
        let rcond = self.sharpen_next()?.map_or(Some(0.0), |mut at| at.rcond());
        let turn = distance(&self.here.t, &self.next.t);
        Ok((turn, tangent_noise(regular, rcond)))
    }

    /// Recomputes the tangent at `next`, and the sign of det ∇_yH with it, unless it is singular.
    pub(super) fn sharpen_next(
        &mut self,
    ) -> Result<Option<Linearisation<'_, Solver<'a>>>, ContinuationError> {
        let State { x, t, det_sign, .. } = &mut self.next;
        let at = sharpen(&mut self.corrector, &self.map, &self.path.selection, x, t)?;
        if let Some(at) = &at {
            *det_sign = at.det_sign();
        }
        Ok(at)
    }

    /// Whether the curve between `here` and `next` is the interpolant of its ends, tested by one correction halfway. It is not where the
    /// step has jumped to another curve, across a crossing or beside it.
    pub(super) fn holds_halfway(&mut self, shape: &Shape) -> Result<bool, ContinuationError> {
        const TILT: f64 = 0.2;
        let high = self.next.clone();
        let mut middle = high.clone();
        self.interpolate(0.5 * high.s, &high, &mut middle);
        let length = norm(&middle.t);
        middle.t.iter_mut().for_each(|t| *t /= length);
        let mean = middle.t.clone();
        let free = (f64::INFINITY, f64::INFINITY);
        let (map, selection) = (&self.map, &mut self.path.selection);
        let (x, t) = (&mut middle.x, &mut middle.t);
        let corrected = (self.corrector).correct(map, selection, |_, _| {}, x, t, free, 1);
        let Some((correction, mut at)) = if_solved(corrected)? else {
            return Ok(false);
        };
        let turns = match (at.orientation(&middle.t), self.here.orientation) {
            (Some(middle), Some(here)) => middle != here,
            _ => false,
        };
        let near = correction.step_norm <= STRAY * shape.turn * high.s + 1e-12 * (1.0 + norm(&high.x));
        let tilt = distance(&middle.t, &mean);
        let mut noise = || tangent_noise(self.here.decline.is_some(), at.rcond());
        Ok(!turns && near && tilt <= TILT * shape.turn + noise())
    }
}

#[cfg(test)]
mod tests {
    use super::Shape;
    use crate::continuation::testing::Plane;

    fn line() -> Plane {
        Plane::within(|y, _| [y, 1.0, 0.0], &[])
    }

    /// A step from the origin along (0, 1) with the same tangent at its end: the end decides.
    #[test]
    fn steps_are_as_long_as_predicted_and_end_ahead() {
        let map = line();
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        let mut accepts = |y: f64, alpha: f64| {
            curve.step_to([y, alpha], [0.0, 1.0]);
            Shape::of(&curve.here, &curve.next, 0.1, curve.setup.options.min_cos).is_some()
        };
        assert!(accepts(0.0, 0.1) && accepts(0.0, 0.051) && accepts(0.0, 0.199));
        assert!(!accepts(0.0, 0.049) && !accepts(0.0, 0.201));
        // Distance of unit vectors: 0.05.
        assert!(accepts(0.0048, 0.1) && !accepts(0.0052, 0.1) && !accepts(0.05, 0.1));
    }

    #[test]
    fn many_corrections_are_a_doubt() {
        let map = line();
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        curve.step_to([0.0, 0.1], [0.0, 1.0]);
        let shape = Shape::of(&curve.here, &curve.next, 0.1, curve.setup.options.min_cos).unwrap();
        assert!(!shape.is_doubtful(0.0, 5, || 0.0));
        assert!(shape.is_doubtful(0.0, 6, || 0.0));
    }

    /// The point halfway lies on the line, but its orientation is that of another curve.
    #[test]
    fn orientation_halfway_is_that_of_the_start() {
        let map = line();
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        curve.step_to([0.0, 0.1], [0.0, 1.0]);
        let shape = Shape::of(&curve.here, &curve.next, 0.1, curve.setup.options.min_cos).unwrap();
        let own = curve.here.orientation.unwrap();
        assert!(curve.holds_halfway(&shape).unwrap());
        curve.here.orientation = Some(-own);
        assert!(!curve.holds_halfway(&shape).unwrap());
    }
}
