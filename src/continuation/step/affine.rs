//! Piecewise-affine curves: from kink to kink by a ratio test, without step control or corrector.

use crate::continuation::engine::Curve;
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
        let mut rates = std::mem::take(&mut self.rates);
        rates.resize(self.layout.total(), 0.0);
        self.map
            .tests_of_selection(&self.selection, &self.here.x, Some(&self.here.t), &mut rates);
        let (mut s, ends_by_length) = self.farthest();
        let mut event = None;
        for site in 0..self.layout.num_sites() {
            let first = self.layout.range(site).start;
            for &facet in self.map.cell(site, self.selection.piece(site)) {
                let index = first + facet.test();
                let rate = facet.sign() * rates[index];
                if rate < 0.0 && !self.is_grazing(index) {
                    let ratio = (facet.sign() * self.here.theta[index]).max(0.0) / -rate;
                    if ratio < s {
                        (s, event) = (ratio, Some(Monitor::Facet { index, facet }));
                    }
                }
            }
        }
        self.rates = rates;
        let last = self.here.x.len() - 1;
        let (alpha, rate) = (self.here.x[last], self.here.t[last]);
        let (lower, upper) = self.options.parameter_range;
        let targets = self.options.targets.iter().map(|&v| (v, false));
        for (value, is_bound) in targets.chain([(lower, true), (upper, true)]) {
            let ahead = (value - alpha) / rate;
            let leaves = !is_bound || (value == upper) == (rate > 0.0);
            // A transition next to a bound may lie behind it by rounding.
            let reached = is_bound || ahead > 0.0;
            if leaves && reached && ahead.is_finite() && ahead < s {
                (s, event) = (
                    ahead.max(0.0),
                    Some(Monitor::Parameter {
                        value,
                        last: is_bound,
                    }),
                );
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
        if event.is_none() && self.termination.is_none() {
            self.termination = Some(if ends_by_length {
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
        for i in 0..self.here.x.len() {
            self.next.x[i] = self.here.x[i] + s * self.here.t[i];
        }
        self.next.t.copy_from_slice(&self.here.t);
        self.next.s = s;
        self.next.orientation = self.here.orientation;
        self.next.det_sign = self.here.det_sign;
        self.next.heading = self.here.heading;
        self.settle()?;
        self.map.test_functions(&self.next.x, &mut self.next.theta);
        if let Some(Monitor::Facet { index, .. }) = event {
            let rest = self.next.theta[index] / self.rates[index];
            self.next.s -= rest;
            for (x, t) in self.next.x.iter_mut().zip(&self.next.t) {
                *x -= rest * t;
            }
            for (theta, rate) in self.next.theta.iter_mut().zip(&self.rates) {
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
        for site in 0..self.layout.num_sites() {
            let start = self.layout.range(site).start;
            for &facet in self.map.cell(site, self.selection.piece(site)) {
                let index = start + facet.test();
                let crossing = Monitor::Facet { index, facet };
                let (g0, g1) = (
                    (facet.sign() * self.here.theta[index]).max(0.0),
                    facet.sign() * self.next.theta[index],
                );
                let outward = facet.sign() * self.rates[index] < 0.0;
                if g1 >= 0.0 || !outward || Some(crossing) == event || self.is_grazing(index) {
                    continue;
                }
                let at = s * (g0 / (g0 - g1));
                if at < first.map_or(s - rounding, |f| f.0) {
                    first = Some((at, crossing));
                }
            }
        }
        first
    }

    fn is_grazing(&self, index: usize) -> bool {
        self.grazing.iter().any(|v| v.index == index)
    }

    /// Largest distance along the tangent: to the limit on arclength, or to the bound on ‖x‖; and whether it is the former.
    fn farthest(&self) -> (f64, bool) {
        let room = (self.options.max_arclength - self.arclength).max(0.0);
        let bound = self.options.max_growth * self.size + norm(&self.here.x);
        (room.min(bound), room <= bound)
    }

    /// Removes the rounding errors accumulated along the curve.
    fn settle(&mut self) -> Result<(), ContinuationError> {
        let mut r = std::mem::take(&mut self.residual);
        r.resize(self.map.num_residuals(), 0.0);
        self.map.residual(&self.selection, &self.next.x, &mut r);
        self.next.residual_norm = norm(&r);
        let rounding = f64::EPSILON * self.residual_scale * (1.0 + norm(&self.next.x) / self.size);
        if self.next.residual_norm > ROUNDING * rounding
            && self.corrector.refine(&self.selection, &r, &mut self.next.x)
        {
            self.map.residual(&self.selection, &self.next.x, &mut r);
            self.next.residual_norm = norm(&r);
        }
        self.residual = r;
        if self.next.residual_norm > DRIFT * rounding {
            let anchor = self.next.x.clone();
            let normal = self.next.t.clone();
            let corrected = self.corrector.correct_in_plane(
                &self.map,
                &self.selection,
                (&anchor, &normal, 0.0),
                &mut self.next.x,
                &mut self.next.t,
            );
            // A singular selection (a continuum of solutions) is followed as far as its residual allows.
            if let Some((c, _)) = if_solved(corrected)? {
                self.next.residual_norm = c.residual_norm;
            }
        }
        Ok(())
    }
}
