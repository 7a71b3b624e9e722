//! Whether a corrected point lies on the same curve, near the prediction: else the step is shortened.

use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, State, generic_probe};
use crate::continuation::event::locate::STRAY;
use crate::continuation::event::watch::Monitor;
use crate::piecewise::PiecewiseError;
use crate::sparse::{distance, dot, norm};

/// Angle (as a distance of unit vectors) allowed between the chord of a step and the mean of the tangents at its ends.
const CHORD: f64 = 0.05;

/// How a step bends.
pub(super) struct Shape {
    /// Distance of the unit tangents at its ends.
    pub(super) turn: f64,
    /// Distance of its direction from their mean.
    pub(super) deviation: f64,
}

impl Curve<'_> {
    /// The shape of a step whose `next` agrees with the prediction: the tangents are close, the chord is close to their mean, and its
    /// length to that of the step. `None` for others.
    pub(super) fn shape(&self, h: f64) -> Option<Shape> {
        let (a, b) = (&self.here, &self.next);
        let cos = dot(&a.t, &b.t);
        if cos.is_nan() || cos < self.options.min_cos {
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
        (deviation <= CHORD).then(|| Shape {
            turn: distance(&a.t, &b.t),
            deviation,
        })
    }

    /// Sets the rate at which the regularity of ∇H falls at a state next to the point of the last factors, for steps of length h.
    pub(in crate::continuation) fn find_decline(
        &mut self,
        state: &mut State,
        h: f64,
    ) -> Result<(), ContinuationError> {
        const SHARE: f64 = 1e-3;
        const LEAST: f64 = 1e-7;
        let distance = SHARE * h.max(LEAST / SHARE * (1.0 + norm(&state.x)));
        let mut sizes = std::mem::take(&mut self.sizes);
        sizes.clone_from(&self.row_sizes);
        let decline = self.corrector.decline(
            &self.map,
            &self.selection,
            (&state.x, &state.t),
            distance,
            &mut sizes,
            &mut self.probe,
            &mut self.behind,
        );
        self.sizes = sizes;
        // Without an estimate no singular point is expected.
        state.decline = Some(decline?.unwrap_or(0.0));
        if self.probe.iter().any(|v| !v.is_finite()) {
            self.probe = generic_probe(self.probe.len());
        }
        Ok(())
    }

    /// Whether an undetected singular point lies between `here` and `next`, where the step ends at the event. It does if the regularity of
    /// ∇H, extrapolated linearly from one of the ends, falls to zero in between: the step has jumped to a curve that crosses, or has
    /// passed two crossings. If the step ends at a singular point, that must be the first one.
    pub(super) fn passes_unseen(&mut self, event: Option<Monitor>) -> bool {
        if self.here.decline.is_none() && self.next.s > 0.0 {
            // The contribution of the singular point at the start of the step is known.
            let known = 1.0 / self.next.s;
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

    /// Angle below which tangents cannot be distinguished. Those of arms at singular points come from difference quotients.
    fn tangent_noise(&mut self) -> f64 {
        self.tangent_noise_at(self.here.decline.is_some())
    }

    /// The same next to a regular point, or at a singular one.
    pub(in crate::continuation) fn tangent_noise_at(&mut self, regular: bool) -> f64 {
        let known = if regular { 1e-9 } else { 1e-5 };
        let rcond = self.corrector.rcond().unwrap_or(1.0);
        known + 100.0 * f64::EPSILON / rcond.max(f64::EPSILON)
    }

    /// Whether the step may have jumped to another curve: it turns much more than the last one, its chord is not that of an arc, or the
    /// corrector converged slowly.
    pub(super) fn is_doubtful(&mut self, shape: &Shape, h: f64, corrections: usize) -> bool {
        const MORE: f64 = 2.0;
        const SKEW: f64 = 0.1;
        const SLOW: usize = 5;
        let bend = self.curvature * h;
        let above = |angle: f64, limit: f64| if angle > limit { angle } else { 0.0 };
        let angle = above(shape.turn, MORE * bend).max(above(shape.deviation, SKEW * shape.turn.max(bend)));
        corrections > SLOW || (angle > 0.0 && angle > self.tangent_noise())
    }

    /// Recomputes the tangents at both ends, which are those of the previous iterates, and returns their distance. That at a singular
    /// point, where kernels are noise, is kept.
    pub(super) fn sharpen_tangents(&mut self) -> Result<f64, ContinuationError> {
        if self.here.decline.is_some() {
            let (x, mut t) = (self.here.x.clone(), std::mem::take(&mut self.here.t));
            let at_fold = t.last() == Some(&0.0);
            let made = self.sharpen(&x, &mut t);
            if at_fold && let Some(rate) = t.last_mut() {
                *rate = 0.0;
            }
            self.here.t = t;
            made?;
        }
        self.sharpen_next()?;
        Ok(distance(&self.here.t, &self.next.t))
    }

    /// Recomputes the tangent at `next`, and the sign of det ∇_yH with it.
    pub(super) fn sharpen_next(&mut self) -> Result<(), ContinuationError> {
        let (x, mut t) = (self.next.x.clone(), std::mem::take(&mut self.next.t));
        let made = self.sharpen(&x, &mut t);
        self.next.t = t;
        if made? {
            self.next.det_sign = self.corrector.det_sign();
        }
        Ok(())
    }

    /// Recomputes the tangent t at x; `false` next to a singular point, where the given tangent is kept.
    fn sharpen(&mut self, x: &[f64], t: &mut [f64]) -> Result<bool, ContinuationError> {
        match (self.corrector).linearize(&self.map, &self.selection, x, Some(t)) {
            Ok(tangent) => {
                let sign = dot(tangent, t).signum();
                t.iter_mut().zip(tangent).for_each(|(t, v)| *t = sign * v);
                Ok(true)
            }
            Err(PiecewiseError::Linear(_)) => Ok(false),
            Err(e) => Err(e.into()),
        }
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
        let corrected = self.corrector.correct(
            &self.map,
            &mut self.selection,
            |_, _| {},
            &mut middle.x,
            &mut middle.t,
            free,
            1,
        );
        let stray = match corrected {
            Ok(c) => c.step_norm,
            Err(PiecewiseError::Linear(_)) => return Ok(false),
            Err(e) => return Err(e.into()),
        };
        let turns = match (self.corrector.orientation(&middle.t), self.here.orientation) {
            (Some(middle), Some(here)) => middle != here,
            _ => false,
        };
        let near = stray <= STRAY * shape.turn * high.s + 1e-12 * (1.0 + norm(&high.x));
        let tilt = distance(&middle.t, &mean);
        Ok(!turns && near && tilt <= TILT * shape.turn + self.tangent_noise())
    }
}

#[cfg(test)]
mod tests {
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
            curve.shape(0.1).is_some()
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
        let shape = curve.shape(0.1).unwrap();
        assert!(!curve.is_doubtful(&shape, 0.1, 5));
        assert!(curve.is_doubtful(&shape, 0.1, 6));
    }

    /// The point halfway lies on the line, but its orientation is that of another curve.
    #[test]
    fn orientation_halfway_is_that_of_the_start() {
        let map = line();
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        curve.step_to([0.0, 0.1], [0.0, 1.0]);
        let shape = curve.shape(0.1).unwrap();
        let own = curve.here.orientation.unwrap();
        assert!(curve.holds_halfway(&shape).unwrap());
        curve.here.orientation = Some(-own);
        assert!(!curve.holds_halfway(&shape).unwrap());
    }
}
