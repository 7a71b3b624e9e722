//! Events inside a step: monitors whose signs differ at its ends, and which of them is reached first.

use std::borrow::Cow;

use super::singular::{LOCATED, ZERO_DETERMINANT};
use super::unseen::Cut;
use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, State};
use crate::continuation::error::if_solved;
use crate::continuation::point::coincidence::SAFETY;
use crate::continuation::point::search::UNEXPLAINED;
use crate::piecewise::{Facet, Selection};
use crate::sparse::{distance, norm};

/// A scalar function along the curve whose changes of sign are events.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::continuation) enum Monitor {
    /// A facet of the current cell of a site: its test function (position among all).
    Facet { index: usize, facet: Facet },
    /// α passes a value; `last` for a bound of its range.
    Parameter { value: f64, last: bool },
    /// α turns: the last component of the tangent.
    Fold,
    /// det [∇H^(σ); tᵀ] of the followed selection.
    Singular,
    /// The same of a co-active selection (its number).
    Coactive(usize),
    /// A monitor function of the user (its number).
    User(usize),
}

/// Why a step is too long: something is known to lie inside it that could not be located on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::continuation) enum Unresolved {
    /// An event.
    Event,
    /// A change of orientation without a branch point: another curve passes nearby.
    Crossing,
}

/// Largest number of successively earlier events located within one step.
const LIMIT: usize = 60;
/// Distance along the curve, relative to 1 + ‖x‖, by which rounding may move a located point.
pub(super) const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Curve<'_> {
    /// Finds the first event between `here` and `next` and moves `next` there. `Ok(None)`: no event; `next` may be nearer than it was,
    /// where the step was cut at a point that its ends do not account for.
    pub(in crate::continuation) fn first_event(
        &mut self,
    ) -> Result<Result<Option<Monitor>, Unresolved>, ContinuationError> {
        self.note_departure();
        self.find_headings()?;
        let mut found = Vec::new();
        let mut compared = false;
        for _ in 0..LIMIT {
            // Beyond an event the curve of the selection has no meaning: earlier events may show only with the event as the end.
            let crossed = if !compared && found.is_empty() {
                None
            } else {
                self.earliest(&found)?
            };
            let Some(monitor) = crossed else {
                if compared {
                    return Ok(Ok(self.first_zero(found.pop())?));
                }
                compared = true;
                match self.cut_unseen()? {
                    Err(unresolved) => return Ok(Err(unresolved)),
                    Ok(Cut::Nowhere) => {}
                    Ok(cut) => {
                        found.clear();
                        found.extend(match cut {
                            Cut::At(monitor) => Some(monitor),
                            _ => None,
                        });
                        compared = false;
                    }
                }
                continue;
            };
            // Where α turns within rounding of a facet, the fold is what happens at the facet.
            let facet = matches!(
                (monitor, found.last()),
                (Monitor::Fold, Some(Monitor::Facet { .. }))
            );
            let facet = facet.then(|| self.next.clone());
            match monitor {
                Monitor::Singular => {
                    if let Err(unresolved) = self.resolve_flip()? {
                        return Ok(Err(unresolved));
                    }
                }
                _ => {
                    let value = self.locate(monitor)?;
                    let zero = |v: f64| !matches!(monitor, Monitor::Coactive(_)) || v <= ZERO_DETERMINANT;
                    if !value.is_some_and(zero) {
                        return Ok(Err(Unresolved::Event));
                    }
                }
            }
            if let Some(facet) = facet
                && distance(&facet.x, &self.next.x) <= self.width(&facet.x, facet.s)
            {
                self.next = facet;
                self.next.heading = self.here.heading;
                continue;
            }
            self.find_headings()?;
            compared = false;
            found.push(monitor);
        }
        Ok(Err(Unresolved::Event))
    }

    /// The monitor violated at `next` whose linear interpolant vanishes first, besides the last of those `located` so far, which is
    /// located there.
    fn earliest(&mut self, located: &[Monitor]) -> Result<Option<Monitor>, ContinuationError> {
        let mut best: Option<(f64, Monitor)> = None;
        let mut offer = |fraction: f64, monitor: Monitor| {
            let clear = Some(&monitor) != located.last() && best.is_none_or(|b| fraction < b.0);
            if clear {
                best = Some((fraction, monitor));
            }
        };
        let size = 1.0 + norm(&self.here.x);
        let reach = self.setup.options.vanishing_distance * size;
        let step = self.next.s.max(f64::MIN_POSITIVE);
        for (index, facet) in self.facets() {
            let (g0, g1) = (
                facet.sign() * self.here.theta[index],
                facet.sign() * self.next.theta[index],
            );
            let slack = match self.path.grazing.iter().find(|v| v.index == index) {
                Some(v) => 100.0 * reach * v.gradient_norm,
                None if located.is_empty() => 0.0,
                // Two facets crossed together must not alternate for ever.
                None if located.contains(&Monitor::Facet { index, facet }) => reach * (g0 - g1).abs() / step,
                None => ROUNDING * size * (g0 - g1).abs() / step,
            };
            // Next to a facet that the curve has just left, rounding may violate it.
            let leaves = g1 < -slack && !(g0 <= 0.0 && g1 >= g0) && !self.is_rounding(index);
            if leaves || (g1.is_nan() && !g0.is_nan()) {
                let fraction = match self.return_to(index, facet) {
                    Some(s) => s / step,
                    None if g0 > 0.0 => g0 / (g0 - g1),
                    None => 0.0,
                };
                offer(fraction, Monitor::Facet { index, facet });
            }
        }
        let last = self.here.x.len() - 1;
        let (a0, a1) = (self.here.x[last], self.next.x[last]);
        let (t0, t1) = (self.here.t[last], self.next.t[last]);
        let (lower, upper) = self.setup.options.parameter_range;
        let vertical = (self.here.heading, self.next.heading) == (Some(0), Some(0));
        let rounding = self.width(&self.here.x, step);
        let touched = self.touched_bound(located)?;
        let targets = self.setup.options.targets.iter().map(|&v| (v, false));
        for (value, is_bound) in targets.chain([(lower, true), (upper, true)]) {
            // Vertical segments on a bound stay on it.
            if is_bound && (touched == Some(value) || (vertical && (a0 - value).abs() <= rounding)) {
                continue;
            }
            let arrived = a1 == value && a0 != value;
            let passed = if is_bound {
                let outwards = if value == upper { 1.0 } else { -1.0 };
                // A curve may start on the bound and go inwards, or touch the bound.
                outwards * (a1 - value) > 0.0
                    || (arrived && self.next.heading.is_some_and(|h| outwards * f64::from(h) > 0.0))
            } else {
                (a0 - value) * (a1 - value) < 0.0 || arrived
            };
            if passed && value.is_finite() {
                let fraction = ((value - a0) / (a1 - a0)).clamp(0.0, 1.0);
                let last = is_bound;
                offer(fraction, Monitor::Parameter { value, last });
            }
        }
        if let (Some(before), Some(after)) = (self.here.heading, self.next.heading)
            && before * after < 0
        {
            offer((t0 / (t0 - t1)).clamp(0.0, 1.0), Monitor::Fold);
        }
        if let (Some(o0), Some(o1)) = (self.here.orientation, self.next.orientation)
            && o0.signum() * o1.signum() < 0
        {
            offer(0.5, Monitor::Singular);
        }
        if !self.path.coactive.is_empty() {
            let (x, t) = (self.next.x.clone(), self.next.t.clone());
            for k in 0..self.path.coactive.len() {
                let (selection, sign) = self.path.coactive[k].clone();
                // Where both are singular at one point, nothing tells the sign there.
                let together = located.last() == Some(&Monitor::Singular);
                if sign.is_some()
                    && self.orientation_of(&selection, &x, &t)? != sign
                    && !(together && self.is_singular_next(&selection)?)
                {
                    offer(0.5, Monitor::Coactive(k));
                }
            }
        }
        Ok(best.map(|b| b.1))
    }

    /// The bound on which `next`, an event where α turns or which the curve meets vertically, or a branch point, lies within rounding of α.
    /// Where α stands still, the place where it reaches the bound would be the same point with half as many digits; so it would be where
    /// ∇H is singular.
    fn touched_bound(&mut self, located: &[Monitor]) -> Result<Option<f64>, ContinuationError> {
        let (lower, upper) = self.setup.options.parameter_range;
        let within = |alpha: f64, error: f64| {
            let near = |bound: &f64| (alpha - bound).abs() <= error;
            [lower, upper].into_iter().find(near)
        };
        match located.last() {
            Some(Monitor::Singular) => {
                let x = &self.next.x;
                return Ok(within(x[x.len() - 1], LOCATED * (1.0 + norm(x))));
            }
            // α stands still there, as far as derivatives tell.
            Some(Monitor::Fold) => {}
            Some(Monitor::Facet { .. }) => {
                let next = std::mem::take(&mut self.next);
                let rate = self.rate_of_parameter(&next);
                self.next = next;
                // The facet is met to rounding along the curve, too, over which α̇ changes as over the step.
                let last = self.here.t.len() - 1;
                let change = (self.next.t[last] - self.here.t[last]) / self.next.s.max(f64::MIN_POSITIVE);
                let moved = change.abs() * self.width(&self.here.x, self.next.s);
                if rate?.is_none_or(|(rate, rounding)| rate.abs() > rounding + moved) {
                    return Ok(None);
                }
            }
            _ => return Ok(None),
        }
        let (x, t) = (&self.next.x, &self.next.t);
        let last = x.len() - 1;
        let mut along = vec![0.0; x.len()];
        along[last] = 1.0;
        let at = (self.corrector).linearize_again(&self.map, &self.path.selection, x, Some(t));
        let Some(rounding) = if_solved(at)?.and_then(|mut at| at.rounding_of(&along, x, t)) else {
            return Ok(None);
        };
        // At a bound of 0 numbers near it have all digits; the range says how many count.
        let range = Some(upper - lower).filter(|width| width.is_finite());
        let error = SAFETY * (rounding + f64::EPSILON * x[last].abs().max(range.unwrap_or(0.0)));
        Ok(within(x[last], error))
    }

    /// Whether a test function in whose zero set the curve runs has changed by rounding alone: its rates at both ends of the step do not
    /// account for its value.
    fn is_rounding(&self, index: usize) -> bool {
        if !self.is_grazing(index) {
            return false;
        }
        let rate = |state: &State| self.rates_at(state)[index].abs();
        let fastest = rate(&self.here).max(rate(&self.next));
        self.next.theta[index].abs() > UNEXPLAINED * self.next.s * fastest
    }

    /// Rates of the test functions along the tangent at `here`.
    pub(super) fn departing_rates(&self) -> Cow<'_, [f64]> {
        if self.buffers.departure.is_of(self) {
            return Cow::Borrowed(&self.buffers.departure.rates);
        }
        Cow::Owned(self.rates_at(&self.here))
    }

    /// Stores these rates, which are needed for every facet crossed inside the step.
    fn note_departure(&mut self) {
        if !self.buffers.departure.is_of(self) && !self.map.is_piecewise_affine() {
            self.buffers.departure = Departure {
                rates: self.departing_rates().into_owned(),
                selection: Some(self.path.selection.clone()),
                x: self.here.x.clone(),
                t: self.here.t.clone(),
            };
        }
    }

    /// Where the parabola through a facet's values at `here` and `next` comes back to zero, if `here` lies on the facet to rounding
    /// and the curve leaves it inwards: then the crossing is not the start of the step, where the linear interpolant has it.
    pub(in crate::continuation) fn return_to(&self, index: usize, facet: Facet) -> Option<f64> {
        let sign = facet.sign();
        let (g0, g1, step) = (
            sign * self.here.theta[index],
            sign * self.next.theta[index],
            self.next.s,
        );
        if self.map.is_piecewise_affine() || g1.is_nan() || g1 >= 0.0 {
            return None;
        }
        let rate = sign * self.departing_rates()[index];
        let reach = self.setup.options.vanishing_distance * (1.0 + norm(&self.here.x));
        (rate > 0.0 && g0.abs() <= reach * rate).then(|| rate * step * step / (rate * step - g1))
    }
}

/// Rates of the test functions of a selection at a point, along a direction.
#[derive(Default)]
pub(in crate::continuation) struct Departure {
    rates: Vec<f64>,
    selection: Option<Selection>,
    x: Vec<f64>,
    t: Vec<f64>,
}

impl Departure {
    fn is_of(&self, curve: &Curve<'_>) -> bool {
        self.selection.as_ref() == Some(&curve.path.selection)
            && self.x == curve.here.x
            && self.t == curve.here.t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::testing::Plane;

    const FACETS: [Monitor; 2] = [
        Monitor::Facet {
            index: 0,
            facet: Facet::positive(0),
        },
        Monitor::Facet {
            index: 1,
            facet: Facet::positive(1),
        },
    ];

    /// Which facet a step of length 1 along y = 0 crosses, where the first test function has these values at its ends.
    fn left(values: [f64; 2], located: &[Monitor]) -> Option<Monitor> {
        let map = Plane::within(
            |y, _| [y, 1.0, 0.0],
            &[|_, a| [5.0 - a, 0.0, -1.0], |_, a| [9.0 - a, 0.0, -1.0]],
        );
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        curve.step_to([0.0, 1.0], [0.0, 1.0]);
        (curve.here.theta[0], curve.next.theta[0]) = (values[0], values[1]);
        curve.earliest(located).unwrap()
    }

    #[test]
    fn facets_are_left_across_and_not_behind() {
        let [first, second] = FACETS;
        assert_eq!(left([1.0, 1e-300], &[]), None);
        assert_eq!(left([1.0, -1e-300], &[]), Some(first));
        // Just left, and violated by rounding: the curve moves away from it, or back across it.
        assert_eq!(left([-2e-18, -1e-18], &[]), None);
        assert_eq!(left([-1e-18, -2e-18], &[]), Some(first));
        // Before another one that is located already: by more than rounding of x (here 16 ε), at a slope of 1.
        assert_eq!(left([1.0, -1e-15], &[second]), None);
        assert_eq!(left([1.0, -1e-12], &[second]), Some(first));
        // Where both are, they are one place up to the distance at which test functions vanish (1e-9).
        assert_eq!(left([1.0, -1e-12], &[first, second]), None);
        assert_eq!(left([1.0, -1e-6], &[first, second]), Some(first));
        assert_eq!(left([1.0, -1e-6], &[second, first]), None);
    }

    /// α (2 − α) leaves its facet inwards at 0 and comes back at 2; at 2 it leaves outwards. The parabola is its own interpolant.
    #[test]
    fn a_facet_left_inwards_is_met_again() {
        let mut map = Plane::within(
            |y, _| [y, 1.0, 0.0],
            &[
                |_, a| [a * (2.0 - a), 0.0, 2.0 - 2.0 * a],
                |_, a| [-a * a, 0.0, -2.0 * a],
            ],
        );
        map.cells = vec![vec![Facet::positive(0)]];
        let mut run = map.curve(0.0, 1.0);
        let curve = run.curve.erased_mut();
        for (start, end, back) in [
            (0.0, 3.0, Some(2.0)),
            (0.0, 1.0, None),
            (2.0, 3.0, None),
            (1.0, 3.0, None),
        ] {
            curve.here.x[1] = start;
            curve.here.theta[0] = start * (2.0 - start);
            curve.step_to([0.0, end], [0.0, 1.0]);
            let found = curve.return_to(0, Facet::positive(0));
            match (found, back) {
                (Some(s), Some(exact)) => assert!(f64::abs(s - exact) < 1e-14, "{s}"),
                other => assert_eq!(other, (None, None), "{start} {end}"),
            }
        }
        // −α² is left at once, though not across.
        (curve.here.x[1], curve.here.theta[1]) = (0.0, 0.0);
        curve.step_to([0.0, 1.0], [0.0, 1.0]);
        assert_eq!(curve.return_to(1, Facet::positive(1)), None);
    }

    /// Test functions that fall from 1 to −4⁹⁻ᵏ at α = 1 − k/20, k = 1, …, 9: the one that falls deepest, and last, seems to vanish first. Each
    /// location reveals the one before it, down to α = 11/20.
    #[test]
    fn facets_behind_one_another_are_all_looked_for() {
        fn falls<const K: i32>(_: f64, alpha: f64) -> [f64; 3] {
            let depth = 1.0 + 4.0_f64.powi(9 - K);
            let ramp = (200.0 * (alpha - 1.0 + 0.05 * f64::from(K))).tanh();
            let rate = -100.0 * depth * (1.0 - ramp * ramp);
            [1.0 - 0.5 * depth * (1.0 + ramp), 0.0, rate]
        }
        let map = Plane::within(
            |y, _| [y, 1.0, 0.0],
            &[
                falls::<1>, falls::<2>, falls::<3>, falls::<4>, falls::<5>, falls::<6>, falls::<7>,
                falls::<8>, falls::<9>,
            ],
        );
        let mut run = map.curve(0.0, 0.1);
        let curve = run.curve.erased_mut();
        curve.step_to([0.0, 1.0], [0.0, 1.0]);
        let first = curve.first_event().unwrap();
        assert!(matches!(first, Ok(Some(Monitor::Facet { index: 8, .. }))));
        assert!((curve.next.x[1] - 0.55).abs() < 1e-9, "{:?}", curve.next.x);
    }
}
