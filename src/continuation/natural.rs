//! Events in the variables of the map, from the scaled ones in which curves are computed.

use super::{Arm, Event, Point};
use crate::piecewise::{PiecewiseSmooth, Scaled};

impl<P: PiecewiseSmooth + ?Sized> Scaled<'_, P> {
    pub(super) fn unscale_event(&self, event: &mut Event) {
        match event {
            Event::Point(p) => self.unscale_point(p),
            Event::SmoothFold(f) => self.unscale_point(&mut f.point),
            Event::Monitor(m) => self.unscale_point(&mut m.point),
            Event::BranchPoint(b) => {
                self.unscale_point(&mut b.point);
                self.unscale_arms(&mut b.arms);
            }
            Event::Transition(t) => {
                self.unscale(&mut t.x);
                self.unscale_direction(&mut t.tangent_before);
                self.unscale_direction(&mut t.tangent_after);
                self.unscale_arms(&mut t.arms);
            }
        }
    }

    pub(super) fn unscale_point(&self, point: &mut Point) {
        self.unscale(&mut point.x);
        self.unscale_direction(&mut point.tangent);
    }

    pub(super) fn unscale_arms(&self, arms: &mut [Arm]) {
        for arm in arms {
            self.unscale_direction(&mut arm.tangent);
        }
    }
}
