//! Piecewise-affine curves: from kink to kink by a ratio test, without step control or corrector.

use crate::continuation::engine::{Curve, State};
use crate::continuation::error::if_solved;
use crate::continuation::event::watch::Monitor;
use crate::continuation::{ContinuationError, Termination};
use crate::piecewise::PiecewiseSmoothExt;
use crate::sparse::norm;

/// Residual, in rounding errors of its terms, above which a step of refinement is made.
const ROUNDING: f64 = 1.0;
/// The same, above which the point reached is corrected.
const DRIFT: f64 = 64.0;
/// Largest number of facets tried for the one that is crossed first.
const REORDERED: usize = 8;

impl Curve<'_> {
    /// Goes along the tangent to the first facet, parameter value or limit. Both curve and test functions are affine, so the
    /// ratio test is exact.
    pub(in crate::continuation) fn step_affine(&mut self) -> Result<(), ContinuationError> {
        let mut rates = std::mem::take(&mut self.buffers.rates);
        rates.resize(self.setup.layout.total(), 0.0);
        self.map
            .tests_of_selection(&self.path.selection, &self.here.x, Some(&self.here.t), &mut rates);
        let (mut s, ends_by_length) = self.farthest();
        let mut event = None;
        for (index, facet) in self.facets().filter(|f| !self.is_grazing(f.0)) {
            let rate = facet.sign() * rates[index];
            if rate < 0.0 {
                let ratio = (facet.sign() * self.here.theta[index]).max(0.0) / -rate;
                if ratio < s {
                    (s, event) = (ratio, Some(Monitor::Facet { index, facet }));
                }
            }
        }
        self.buffers.rates = rates;
        let last = self.here.x.len() - 1;
        let (alpha, rate) = (self.here.x[last], self.here.t[last]);
        let (lower, upper) = self.setup.options.parameter_range;
        let targets = self.setup.options.targets.iter().map(|&v| (v, false));
        for (value, is_bound) in targets.chain([(lower, true), (upper, true)]) {
            let ahead = (value - alpha) / rate;
            let leaves = !is_bound || (value == upper) == (rate > 0.0);
            // A transition next to a bound may lie behind it by rounding.
            let reached = is_bound || ahead > 0.0;
            if leaves && reached && ahead.is_finite() && ahead < s {
                let last = is_bound;
                (s, event) = (ahead.max(0.0), Some(Monitor::Parameter { value, last }));
            }
        }
        self.go(s, event)?;
        // Rates may be difference quotients, too inaccurate for the order of close facets; values at both ends are accurate.
        for _ in 0..REORDERED {
            let Some((sooner, crossing)) = self.crossed_before(event) else {
                break;
            };
            event = Some(crossing);
            self.go(sooner, event)?;
        }
        event = self.first_zero(event)?;
        self.arrive(event, 0)?;
        if event.is_none() && self.told.termination.is_none() {
            self.told.termination = Some(if ends_by_length {
                Termination::ArclengthLimit
            } else {
                Termination::Unbounded
            });
        }
        Ok(())
    }

    /// Moves `next` to the distance s along the tangent, and from there onto the facet of the event.
    pub(in crate::continuation) fn go(
        &mut self,
        s: f64,
        event: Option<Monitor>,
    ) -> Result<(), ContinuationError> {
        self.next.predict(&self.here, s);
        self.next.s = s;
        self.next.orientation = self.here.orientation;
        self.next.det_sign = self.here.det_sign;
        self.next.heading = self.here.heading;
        self.settle()?;
        self.map.test_functions(&self.next.x, &mut self.next.theta);
        if let Some(Monitor::Facet { index, .. }) = event {
            let rest = self.next.theta[index] / self.buffers.rates[index];
            self.next.s -= rest;
            for (x, t) in self.next.x.iter_mut().zip(&self.next.t) {
                *x -= rest * t;
            }
            for (theta, rate) in self.next.theta.iter_mut().zip(&self.buffers.rates) {
                *theta -= rest * rate;
            }
        }
        Ok(())
    }

    /// The facet crossed first before `next`, beyond rounding, and where.
    fn crossed_before(&self, event: Option<Monitor>) -> Option<(f64, Monitor)> {
        let s = self.next.s;
        let rounding = 16.0 * f64::EPSILON * (norm(&self.here.x) + s);
        let mut first: Option<(f64, Monitor)> = None;
        for (index, facet) in self.facets() {
            let crossing = Monitor::Facet { index, facet };
            let (g0, g1) = (
                (facet.sign() * self.here.theta[index]).max(0.0),
                facet.sign() * self.next.theta[index],
            );
            let outward = facet.sign() * self.buffers.rates[index] < 0.0;
            if g1 >= 0.0 || !outward || Some(crossing) == event || self.is_grazing(index) {
                continue;
            }
            let at = s * (g0 / (g0 - g1));
            if at < first.map_or(s - rounding, |f| f.0) {
                first = Some((at, crossing));
            }
        }
        first
    }

    /// Largest distance along the tangent: to the limit on arclength, or to the bound on ‖x‖; and whether it is the former.
    fn farthest(&self) -> (f64, bool) {
        let room = (self.setup.options.max_arclength - self.pace.arclength).max(0.0);
        let bound = self.setup.options.max_growth * self.setup.size + norm(&self.here.x);
        (room.min(bound), room <= bound)
    }

    /// Removes the rounding errors accumulated along the curve.
    fn settle(&mut self) -> Result<(), ContinuationError> {
        let mut r = std::mem::take(&mut self.buffers.residual);
        r.resize(self.map.num_residuals(), 0.0);
        self.map.residual(&self.path.selection, &self.next.x, &mut r);
        self.next.residual_norm = norm(&r);
        let rounding = f64::EPSILON * self.scale.terms * (1.0 + norm(&self.next.x) / self.setup.size);
        if self.next.residual_norm > ROUNDING * rounding
            && self.corrector.refine(&self.path.selection, &r, &mut self.next.x)
        {
            self.map.residual(&self.path.selection, &self.next.x, &mut r);
            self.next.residual_norm = norm(&r);
        }
        self.buffers.residual = r;
        if self.next.residual_norm > DRIFT * rounding {
            let anchor = self.next.x.clone();
            let normal = self.next.t.clone();
            let (plane, State { x, t, .. }) = ((&anchor[..], &normal[..], 0.0), &mut self.next);
            let corrected = (self.corrector).correct_in_plane(&self.map, &self.path.selection, plane, x, t);
            // A singular selection (a continuum of solutions) is followed as far as its residual allows.
            if let Some((c, _)) = if_solved(corrected)? {
                self.next.residual_norm = c.residual_norm;
            }
        }
        Ok(())
    }
}
