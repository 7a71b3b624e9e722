//! The end of a step: at a regular point, at an event, or where the curve closes.

use crate::continuation::engine::{Curve, State, term_size};
use crate::continuation::error::if_converged;
use crate::continuation::event::locate::STRAY;
use crate::continuation::event::watch::Monitor;
use crate::continuation::point::coincidence::SAFETY;
use crate::continuation::{ContinuationError, Event, PointKind, Termination};
use crate::sparse::{Matrix, distance, norm};
use crate::tolerances::{RESULT, TANGENTIAL};

/// Share of a step by which rounding may put its end before a start that it reaches.
const SLACK: f64 = 1e-3;

impl Curve<'_> {
    /// Moves to `next`, where the step ends regularly or at an event.
    pub(in crate::continuation) fn arrive(
        &mut self,
        event: Option<Monitor>,
        corrections: usize,
    ) -> Result<(), ContinuationError> {
        let closed = self.closes()?;
        let step = distance(&self.here.x, &self.next.x);
        self.pace.arclength += step;
        std::mem::swap(&mut self.here, &mut self.next);
        self.here.s = 0.0;
        self.here.probe.clear();
        self.here.order = 0.0;
        self.forget_facets_left()?;
        self.refresh_sides();
        let arrival = (!self.monitors.watches.is_empty()).then(|| self.here.t.clone());
        // An event beyond the start is none of a curve that closes there.
        let located = match event {
            Some(Monitor::User(k)) if !closed => Some(k),
            _ => None,
        };
        if closed {
            let point = self.point_here(PointKind::Step, corrections);
            self.emit(Event::Point(point));
            self.told.termination = Some(Termination::Closed);
        } else {
            if !matches!(event, Some(Monitor::Coactive(_))) {
                self.refresh_coactive()?;
            }
            self.pass(event, corrections)?;
        }
        if let Some(arrival) = arrival
            && (closed || event.is_some())
        {
            self.pass_monitors(located, (&arrival, step), corrections);
        }
        Ok(())
    }

    /// What happens at `here`.
    fn pass(&mut self, event: Option<Monitor>, corrections: usize) -> Result<(), ContinuationError> {
        if let (Some(Monitor::Facet { .. } | Monitor::Fold | Monitor::Singular), Some(alpha)) =
            (event, self.here.x.last_mut())
        {
            // A bound that is touched there lies beyond by rounding at most.
            let (lower, upper) = self.setup.options.parameter_range;
            *alpha = alpha.max(lower).min(upper);
        }
        match event {
            None => {
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(Event::Point(point));
            }
            Some(Monitor::Facet { index, .. }) => {
                self.here.heading = None;
                self.pass_transition(index)?;
            }
            Some(Monitor::Parameter { value, last }) => {
                self.hit_parameter(value)?;
                let point = self.point_here(PointKind::Target, corrections);
                self.emit(Event::Point(point));
                if last {
                    self.told.termination = Some(Termination::ParameterRange);
                }
            }
            Some(Monitor::Fold) if self.moves_to_singular_point(&self.path.selection.clone(), None)? => {
                self.here.heading = None;
                self.pass_branch_point(None)?;
            }
            Some(Monitor::Fold) if self.facet_left_here().is_some() => {
                let index = self.facet_left_here().unwrap_or_default();
                self.here.heading = None;
                self.pass_transition(index)?;
            }
            Some(Monitor::Fold) => {
                // Rounding must not put the fold ahead of the point.
                if let Some(rate) = self.here.t.last_mut() {
                    *rate = 0.0;
                }
                self.here.heading = self.next.heading.map(|before| -before);
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(Event::SmoothFold(point));
            }
            Some(Monitor::Singular) => {
                self.here.heading = None;
                self.pass_branch_point(None)?;
            }
            Some(Monitor::Coactive(k)) => {
                self.here.heading = None;
                self.pass_branch_point(Some(k))?;
            }
            // Recorded with the other monitors.
            Some(Monitor::User(_)) => {}
        }
        Ok(())
    }

    /// Puts α exactly on a requested value.
    fn hit_parameter(&mut self, value: f64) -> Result<(), ContinuationError> {
        let m = self.here.x.len();
        let rate = self.here.t[m - 1];
        if self.map.is_piecewise_affine() && rate.abs() > TANGENTIAL {
            // The curve is straight: along it to the value.
            let rest = (value - self.here.x[m - 1]) / rate;
            for (x, t) in self.here.x.iter_mut().zip(&self.here.t) {
                *x += rest * t;
            }
            self.here.x[m - 1] = value;
            self.map
                .residual(&self.path.selection, &self.here.x, &mut self.buffers.residual);
            self.here.residual_norm = norm(&self.buffers.residual);
            self.here.find_tests(&self.map, &self.path.selection);
            return Ok(());
        }
        let mut normal = vec![0.0; m];
        normal[m - 1] = 1.0;
        let anchor = self.here.x.clone();
        let mut x = anchor.clone();
        let mut t = self.here.t.clone();
        let offset = value - anchor[m - 1];
        let (map, plane) = (&self.map, (&anchor[..], &normal[..], offset));
        let corrected = (self.corrector).correct_in_plane(map, &self.path.selection, plane, &mut x, &mut t);
        if let Ok((c, _)) = corrected
            && c.converged
        {
            x[m - 1] = value;
            self.here.x = x;
            self.here.residual_norm = c.residual_norm;
            self.here.find_tests(&self.map, &self.path.selection);
        }
        Ok(())
    }

    /// Whether the arc from `here` to `next` passes through the start, to which `next` is moved in this case. It does if, in a plane across
    /// both, the point of the arc and that of the curve through the start are one, as far as rounding lets them be known.
    fn closes(&mut self) -> Result<bool, ContinuationError> {
        let length = distance(&self.here.x, &self.next.x);
        // An event located at the start may lie before it.
        let slack =
            (self.setup.options.vanishing_distance * (1.0 + norm(&self.setup.start))).min(SLACK * length);
        let offset = self.here.progress_to(&self.setup.start);
        if self.pace.arclength <= slack || !(offset > 0.0 && offset <= self.next.s + slack) {
            return Ok(false);
        }
        let high = self.next.clone();
        let mut abreast = high.clone();
        self.interpolate(offset, &high, &mut abreast);
        if distance(&abreast.x, &self.setup.start) > STRAY * high.s {
            return Ok(false);
        }
        let (selection, start) = (self.path.selection.clone(), self.setup.start.clone());
        if !self.is_one(&mut abreast, &start)? {
            return Ok(false);
        }
        abreast.s = offset;
        abreast.find_tests(&self.map, &selection);
        self.complete_state(&mut abreast)?;
        // Where the curve returns beside itself, closer than that, its direction is the opposite one.
        let at_start = self.orientation_of(&selection, &start, &abreast.t)?;
        if let (Some(here), Some(there)) = (abreast.orientation, at_start)
            && here != there
        {
            return Ok(false);
        }
        self.next = abreast;
        Ok(true)
    }

    /// Whether the curve of the selection through `state`, which is corrected, and that through `other` are one where they meet the plane
    /// across them: the distance is explained by rounding errors of H, or by the last steps of the corrector.
    fn is_one(&mut self, state: &mut State, other: &[f64]) -> Result<bool, ContinuationError> {
        let length = norm(&state.t);
        let normal: Vec<f64> = state.t.iter().map(|t| t / length).collect();
        let (map, selection) = (&self.map, &self.path.selection);
        let (mut there, mut t) = (other.to_vec(), normal.clone());
        let first =
            (self.corrector).correct_in_plane(map, selection, (other, &normal, 0.0), &mut state.x, &mut t);
        let Some((first, _)) = if_converged(first)? else {
            return Ok(false);
        };
        let second =
            (self.corrector).correct_in_plane(map, selection, (other, &normal, 0.0), &mut there, &mut t);
        let Some((second, mut at)) = if_converged(second)? else {
            return Ok(false);
        };
        let steps = first.step_norm + second.step_norm;
        // The other point has to lie on the curve of the selection itself, too: to rounding, or as far as starts are corrected, which next to
        // a fold may be many times as far.
        let on_curve = {
            let (mut r, mut jac) = (vec![0.0; map.num_residuals()], Matrix::zeros(map.pattern()));
            map.residual(selection, other, &mut r);
            map.jacobian(selection, other, &mut jac);
            norm(&r) <= RESULT * term_size(&jac, other, 0.0, other)
        };
        let pairs = [(&state.x[..], &there[..]), (&there, other)];
        let open = if on_curve { 1 } else { 2 };
        Ok(pairs.into_iter().take(open).all(|(a, b)| {
            let gap: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            let size = norm(&gap);
            if size <= 2.0 * steps {
                return true;
            }
            let direction: Vec<f64> = gap.iter().map(|g| g / size).collect();
            let bits: f64 = direction.iter().zip(other).map(|(d, x)| (d * x).abs()).sum();
            let rounding = at.rounding_of(&direction, other, &normal);
            rounding.is_some_and(|r| size <= SAFETY * (r + f64::EPSILON * bits))
        }))
    }
}

#[cfg(test)]
mod tests {
    use crate::continuation::testing::Plane;

    /// On y = α, or y = α³, the point at a requested value comes with its own test functions.
    #[test]
    fn test_functions_are_those_of_the_target() {
        for affine in [true, false] {
            let map = Plane {
                affine,
                ..Plane::within(
                    if affine {
                        |y, a| [y - a, 1.0, -1.0]
                    } else {
                        |y, a| [y - a * a * a, 1.0, -3.0 * a * a]
                    },
                    &[|y, _| [3.0 - y, -1.0, 0.0]],
                )
            };
            let start: f64 = 0.99;
            let mut run = map.curve(if affine { start } else { start.powi(3) }, start);
            let curve = run.curve.erased_mut();
            curve.hit_parameter(1.0).unwrap();
            assert_eq!(curve.here.x[1], 1.0);
            assert!((curve.here.x[0] - 1.0).abs() < 1e-15);
            assert!((curve.here.theta[0] - 2.0).abs() < 1e-15, "{affine}");
        }
    }
}
