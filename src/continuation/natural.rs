//! Events in the variables of the map, from the scaled ones in which curves are computed, and options the other way.

use super::{Arm, ContinuationOptions, Event, Point};
use crate::piecewise::{PiecewiseSmoothExt, ScaledMap};

impl dyn ScaledMap + '_ {
    /// Values of α and lengths in z. Limits on step lengths and arclength are scaled with the size of α.
    pub(super) fn scale_options(&self, options: &mut ContinuationOptions) {
        let size = self.parameter_size();
        options.min_step /= size.max(1.0);
        options.max_growth *= size.recip().max(1.0);
        convert_lengths(options, size.recip());
    }

    /// The inverse of [`scale_options`](Self::scale_options); exact, as sizes are powers of two.
    pub(super) fn unscale_options(&self, options: &mut ContinuationOptions) {
        let size = self.parameter_size();
        options.min_step *= size.max(1.0);
        options.max_growth /= size.recip().max(1.0);
        convert_lengths(options, size);
    }

    pub(super) fn unscale_event(&self, event: &mut Event) {
        match event {
            Event::Point(p) => self.unscale_point(p),
            Event::SmoothFold(point) => self.unscale_point(point),
            Event::Monitor(m) => self.unscale_point(&mut m.point),
            Event::BranchPoint(b) => {
                self.unscale_point(&mut b.point);
                self.unscale_arms(&mut b.arms);
                self.unscale_arms(std::slice::from_mut(&mut b.arrival));
            }
            Event::Transition(t) => {
                self.reported_tests(&t.x, &mut t.test_functions);
                self.unscale(&mut t.x);
                self.unscale_direction(&mut t.tangent_before);
                self.unscale_direction(&mut t.tangent_after);
                self.unscale_arms(&mut t.arms);
                self.unscale_arms(std::slice::from_mut(&mut t.arrival));
                t.arclength *= self.parameter_size();
            }
        }
    }

    pub(super) fn unscale_point(&self, point: &mut Point) {
        self.unscale(&mut point.x);
        self.unscale_direction(&mut point.tangent);
        point.arclength *= self.parameter_size();
    }

    pub(super) fn unscale_arms(&self, arms: &mut [Arm]) {
        for arm in arms {
            self.unscale_direction(&mut arm.tangent);
            self.unscale(&mut arm.probe);
        }
    }
}

/// Times a power of two.
fn convert_lengths(options: &mut ContinuationOptions, factor: f64) {
    let (lower, upper) = &mut options.parameter_range;
    let lengths = [
        &mut options.step,
        &mut options.max_step,
        &mut options.max_arclength,
    ];
    for v in lengths
        .into_iter()
        .chain([lower, upper])
        .chain(&mut options.targets)
    {
        *v *= factor;
    }
}
