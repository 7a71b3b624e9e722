//! Curves in the plane for tests of single parts.

#[allow(dead_code)]
#[path = "../../tests/maps/plane.rs"]
mod plane;

pub(super) use plane::{Function, Plane};

use super::engine::Curve;
use super::{Continuation, ContinuationOptions, Direction};

impl Plane {
    /// The curve through (y, α), with growing α.
    pub(super) fn curve(&self, y: f64, alpha: f64) -> Continuation<'_, Self> {
        let options = ContinuationOptions::default();
        Continuation::new(self, &[y, alpha], Direction::Increasing, options).unwrap()
    }

    /// The curve through x along a direction.
    pub(super) fn curve_along(&self, x: [f64; 2], direction: [f64; 2]) -> Continuation<'_, Self> {
        let options = ContinuationOptions::default();
        Continuation::new(self, &x, Direction::Along(direction.to_vec()), options).unwrap()
    }
}

impl Curve<'_> {
    /// Makes (y, α) with a unit tangent the end of the current step, as if it had been corrected.
    pub(super) fn step_to(&mut self, x: [f64; 2], t: [f64; 2]) {
        self.next = self.here.clone();
        self.next.x.copy_from_slice(&x);
        self.next.t.copy_from_slice(&t);
        self.next.s = self.here.progress_to(&x);
        self.map.test_functions(&x, &mut self.next.theta);
    }
}
