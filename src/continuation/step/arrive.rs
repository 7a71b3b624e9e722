//! The end of a step: at a regular point, at an event, or where the curve closes.

use crate::continuation::engine::Curve;
use crate::continuation::event::watch::{Monitor, VERTICAL};
use crate::continuation::{ContinuationError, Event, PointKind, SmoothFold, Termination};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::{distance, norm};

impl Curve<'_> {
    /// Moves to `next`, where the step ends regularly or at an event.
    pub(in crate::continuation) fn arrive(
        &mut self,
        event: Option<Monitor>,
        corrections: usize,
    ) -> Result<(), ContinuationError> {
        let closed = self.closes()?;
        self.arclength += distance(&self.here.x, &self.next.x);
        std::mem::swap(&mut self.here, &mut self.next);
        self.here.s = 0.0;
        self.forget_facets_left()?;
        self.refresh_sides();
        if closed {
            let point = self.point_here(PointKind::Step, corrections);
            self.emit(Event::Point(point));
            self.termination = Some(Termination::Closed);
            return Ok(());
        }
        if !matches!(event, Some(Monitor::Coactive(_))) {
            self.refresh_coactive()?;
        }
        match event {
            None => {
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(Event::Point(point));
                Ok(())
            }
            Some(Monitor::Facet { index, .. }) => self.pass_transition(index),
            Some(Monitor::Parameter { value, last }) => {
                self.hit_parameter(value)?;
                let point = self.point_here(PointKind::Target, corrections);
                self.emit(Event::Point(point));
                if last {
                    self.termination = Some(Termination::ParameterRange);
                }
                Ok(())
            }
            Some(Monitor::Fold) if self.moves_to_singular_point(&self.selection.clone(), None)? => self.pass_branch_point(None),
            Some(Monitor::Fold) => {
                // Rounding must not put the fold ahead of the point.
                if let Some(rate) = self.here.t.last_mut() {
                    *rate = 0.0;
                }
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(Event::SmoothFold(SmoothFold { point }));
                Ok(())
            }
            Some(Monitor::Singular) => self.pass_branch_point(None),
            Some(Monitor::Coactive(k)) => self.pass_branch_point(Some(k)),
            Some(Monitor::User(k)) => {
                self.pass_monitor(k, corrections);
                Ok(())
            }
        }
    }

    /// Puts α exactly on a requested value.
    fn hit_parameter(&mut self, value: f64) -> Result<(), ContinuationError> {
        let m = self.here.x.len();
        let rate = self.here.t[m - 1];
        if self.map.is_piecewise_affine() && rate.abs() > VERTICAL {
            // The curve is straight: along it to the value.
            let rest = (value - self.here.x[m - 1]) / rate;
            for (x, t) in self.here.x.iter_mut().zip(&self.here.t) {
                *x += rest * t;
            }
            self.here.x[m - 1] = value;
            self.map
                .residual(&self.selection, &self.here.x, &mut self.residual);
            self.here.residual_norm = norm(&self.residual);
            self.map
                .tests_of_selection(&self.selection, &self.here.x, None, &mut self.here.theta);
            return Ok(());
        }
        let mut normal = vec![0.0; m];
        normal[m - 1] = 1.0;
        let anchor = self.here.x.clone();
        let mut x = anchor.clone();
        let mut t = self.here.t.clone();
        let offset = value - anchor[m - 1];
        let corrected = self.corrector.correct_in_plane(
            &self.map,
            &self.selection,
            &anchor,
            &normal,
            offset,
            &mut x,
            &mut t,
        );
        if let Ok(c) = corrected
            && c.converged
        {
            x[m - 1] = value;
            self.here.x = x;
            self.here.residual_norm = c.residual_norm;
            self.map
                .tests_of_selection(&self.selection, &self.here.x, None, &mut self.here.theta);
        }
        Ok(())
    }

    /// Whether the arc from `here` to `next` passes through the start, to which `next` is moved in this case. It does if the point of this
    /// arc in the hyperplane through the start is the start: an arc that passes nearby does not, though the start solves
    /// H^(σ)(x) = 0 for its selection, too.
    fn closes(&mut self) -> Result<bool, ContinuationError> {
        let length = distance(&self.here.x, &self.next.x);
        let reach = 1e-8 * (1.0 + norm(&self.start));
        if self.arclength <= reach || distance(&self.here.x, &self.start) > 1.5 * length {
            return Ok(false);
        }
        let high = self.next.clone();
        let mut abreast = high.clone();
        if distance(&high.x, &self.start) > reach {
            let offset = self.progress_to(&self.start);
            let inside = offset > -reach && offset <= high.s + reach;
            if !inside
                || !self.state_at(offset, &high, &mut abreast)?
                || distance(&abreast.x, &self.start) > reach
            {
                return Ok(false);
            }
            self.complete_state(&mut abreast)?;
        }
        // Where the curve returns beside itself, closer than that, its direction is the opposite one.
        let (selection, start) = (self.selection.clone(), self.start.clone());
        let at_start = self.orientation_of(&selection, &start, &abreast.t)?;
        if let (Some(here), Some(there)) = (abreast.orientation, at_start)
            && here != there
        {
            return Ok(false);
        }
        self.next = abreast;
        Ok(true)
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
