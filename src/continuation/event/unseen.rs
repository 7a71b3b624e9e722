//! What a step may have passed twice, so that both of its ends are on the same side: the least value of a monitor between them decides.

use super::locate::Find;
use super::watch::{Monitor, Unresolved};
use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, State};
use crate::continuation::error::if_solved;
use crate::continuation::point::coincidence::Rounding;
use crate::piecewise::Vanishing;
use crate::sparse::norm;
use crate::tolerances::{HALF_DIGITS, TANGENTIAL};

/// Share of the step over which differences are taken.
pub(super) const DIFFERENCE: f64 = 1.0 / 1024.0;
/// Largest number of points computed to find a least value.
const LIMIT: usize = 40;

/// A monitor and its rate along the curve at a distance along the tangent at `here`.
#[derive(Clone, Copy)]
struct Sample {
    s: f64,
    value: f64,
    rate: f64,
}

/// Where a step ends now.
pub(super) enum Cut {
    /// Where it did.
    Nowhere,
    /// Nearer, at a point beyond an event.
    Beyond,
    /// Nearer, at an event.
    At(Monitor),
}

impl Curve<'_> {
    /// Ends the step where α̇, a test function or a monitor function has the other sign than at both ends, or where a test function touches
    /// zero.
    pub(super) fn cut_unseen(&mut self) -> Result<Result<Cut, Unresolved>, ContinuationError> {
        if self.map.is_piecewise_affine() {
            return Ok(Ok(Cut::Nowhere));
        }
        let mut all = self.falling_facets();
        self.falling_rate(&mut all)?;
        self.falling_monitors(&mut all);
        let mut cut = Cut::Nowhere;
        for (monitor, ends) in all {
            // Only up to the place found for another one.
            if ends[1].s > self.next.s {
                break;
            }
            match self.least(monitor, ends)? {
                Err(unresolved) => return Ok(Err(unresolved)),
                Ok(None) => {}
                Ok(Some(mut state)) => {
                    self.complete_state(&mut state)?;
                    self.next = state;
                    self.find_headings()?;
                    cut = match monitor {
                        Monitor::Facet { index, .. } if self.next.theta[index] == 0.0 => Cut::At(monitor),
                        _ => Cut::Beyond,
                    };
                }
            }
        }
        Ok(Ok(cut))
    }

    /// A point between two samples at which the monitor is negative, if there is one, or at which a test function touches zero within
    /// rounding. Between samples it is taken to be convex, where their rates allow it, and else to be the cubic with their values and
    /// rates: where neither falls below zero there is none.
    fn least(
        &mut self,
        monitor: Monitor,
        ends: [Sample; 2],
    ) -> Result<Result<Option<State>, Unresolved>, ContinuationError> {
        let high = self.next.clone();
        let mut state = high.clone();
        let width = self.width(&high.x, high.s);
        let floor = self.floor(monitor)?;
        let mut touch: Option<(f64, State)> = None;
        // Each with whether it is to be halved: brackets would else shrink from one side only.
        let mut brackets = vec![(ends, false)];
        for _ in 0..LIMIT {
            let Some(([a, b], halve)) = brackets.pop() else {
                break;
            };
            let length = b.s - a.s;
            if (touch.is_none() && !may_fall_below_zero(&a, &b)) || length <= width {
                continue;
            }
            let place = dip([a.value, b.value], [a.rate * length, b.rate * length]);
            let place = place.filter(|_| !halve).map_or(0.5, |p| p.0);
            let s = a.s + length * place;
            let inside = s > a.s + width && s < b.s - width;
            let s = if inside { s } else { a.s + 0.5 * length };
            if !self.find_state(s, &high, &mut state, Find::Tangent)? {
                return Ok(Err(Unresolved::Event));
            }
            let Some(sample) = self.sample(monitor, &state, s)? else {
                return Ok(Ok(None));
            };
            // Where a function touches zero the place of its least value is better known than the value.
            let nearer = touch.as_ref().is_none_or(|t| sample.rate.abs() < t.0);
            if nearer && let Some(state) = self.touching(monitor, &state, sample, floor)? {
                touch = Some((sample.rate.abs(), state));
                let rest = if sample.rate > 0.0 {
                    [a, sample]
                } else {
                    [sample, b]
                };
                brackets = vec![(rest, false)];
                continue;
            }
            if touch.is_some() {
                break;
            }
            if sample.value < -floor {
                return Ok(Ok(Some(state)));
            }
            for part in [[sample, b], [a, sample]] {
                brackets.push((part, part[1].s - part[0].s > 0.5 * length));
            }
        }
        Ok(Ok(touch.map(|t| t.1)))
    }

    /// The state, with a value of 0, where the value is within rounding of 0 although the step does not begin on the facet.
    fn touching(
        &mut self,
        monitor: Monitor,
        state: &State,
        sample: Sample,
        floor: f64,
    ) -> Result<Option<State>, ContinuationError> {
        let Monitor::Facet { index, .. } = monitor else {
            return Ok(None);
        };
        // What is not small beside the values at both ends is not their rounding.
        let most = HALF_DIGITS * self.here.theta[index].abs().max(self.next.theta[index].abs());
        if floor > 0.0 || sample.value.abs() > most {
            return Ok(None);
        }
        let v = Vanishing::new(
            &self.map,
            &self.setup.layout,
            &self.path.selection,
            index,
            &state.x,
        );
        let before = self.here.x.clone();
        match self.rounding_at((&state.x, &state.t), &before)? {
            rounding @ Rounding::Measured { .. } if sample.value.abs() <= rounding.of(&v) => {}
            _ => return Ok(None),
        }
        let mut state = state.clone();
        state.theta[index] = 0.0;
        Ok(Some(state))
    }

    /// How far below zero rounding may put the value of a monitor: a step may begin on the facet, along which the curve runs to first order.
    fn floor(&mut self, monitor: Monitor) -> Result<f64, ContinuationError> {
        let Monitor::Facet { index, .. } = monitor else {
            return Ok(0.0);
        };
        let met = self.vanishing_here(&[]);
        let Some(met) = met.iter().find(|v| v.index == index) else {
            return Ok(0.0);
        };
        Ok(self.rounding_here()?.of(met))
    }

    fn sample(
        &mut self,
        monitor: Monitor,
        state: &State,
        s: f64,
    ) -> Result<Option<Sample>, ContinuationError> {
        let speed = self.speed(state);
        let (value, rate) = match monitor {
            Monitor::Facet { index, facet } => {
                let rate = self.rates_at(state)[index];
                (facet.sign() * state.theta[index], facet.sign() * rate)
            }
            Monitor::User(k) => {
                let d = DIFFERENCE * self.next.s;
                let [back, ahead] = [-d, d].map(|d| self.side_beside(k, &state.x, &state.t, d));
                (self.side_of(k, &state.x), (ahead - back) / (2.0 * d))
            }
            _ => {
                let sign = f64::from(self.here.heading.unwrap_or(0));
                let Some(second) = self.acceleration(state)? else {
                    return Ok(None);
                };
                let rate = state.t.last().copied().filter(|rate| rate.abs() > TANGENTIAL);
                (sign * rate.unwrap_or(0.0), sign * second)
            }
        };
        let rate = rate / speed;
        Ok((value.is_finite() && rate.is_finite()).then_some(Sample { s, value, rate }))
    }

    /// Progress along the tangent at `here` per length of the curve at a state.
    fn speed(&self, state: &State) -> f64 {
        let cos: f64 = self.here.t.iter().zip(&state.t).map(|(a, b)| a * b).sum();
        cos.max(0.1)
    }

    /// α̈ at a state, by a difference of ∇H; `None` next to a singular point.
    fn acceleration(&mut self, state: &State) -> Result<Option<f64>, ContinuationError> {
        let distance = DIFFERENCE * self.next.s;
        let (x, t) = (&state.x, &state.t);
        let at = (self.corrector).linearize_again(&self.map, &self.path.selection, x, Some(t));
        Ok(match if_solved(at)? {
            Some(at) => at.turn_of_entry(&self.map, (x, t), x.len() - 1, distance)?,
            None => None,
        })
    }

    /// α̇ if it is slower inside the step than at its ends, as far as the interpolant of α tells.
    fn falling_rate(&mut self, all: &mut Vec<(Monitor, [Sample; 2])>) -> Result<(), ContinuationError> {
        let heading = self.here.heading.unwrap_or(0);
        // Across a singular point the curve may be another one.
        let regular = self.here.orientation.is_some() && self.here.orientation == self.next.orientation;
        let last = self.here.x.len() - 1;
        // A fold beyond which the step goes on is located first.
        let turned = self.next.heading != Some(heading) && self.next.t[last].abs() > TANGENTIAL;
        // Between a vertex and the known point of the arm that is followed α̇ has the sign that was found with the arm.
        let known = !self.here.probe.is_empty();
        if heading == 0 || turned || !regular || known {
            return Ok(());
        }
        let sign = f64::from(heading);
        let step = self.next.s;
        let [d0, d1] = [self.here.t[last], self.next.t[last] / self.stretch()].map(|d| (sign * d).max(0.0));
        let mean = sign * (self.next.x[last] - self.here.x[last]) / step;
        // The middle coefficient of Bernstein of the interpolant; the curve may be slower by as much again.
        let middle = 3.0 * mean - d0 - d1;
        if 2.0 * middle > d0.max(d1) {
            return Ok(());
        }
        let ends = [self.here.clone(), self.next.clone()];
        let mut samples = Vec::new();
        for state in &ends {
            let s = if samples.is_empty() { 0.0 } else { step };
            samples.extend(self.sample(Monitor::Fold, state, s)?);
        }
        if let [mut a, mut b] = samples[..] {
            (a.value, b.value) = (a.value.max(0.0), b.value.max(0.0));
            if may_fall_below_zero(&a, &b) {
                all.push((Monitor::Fold, [a, b]));
            }
        }
        Ok(())
    }

    /// Facets of the cell which both ends are inside, and which the curve approaches and leaves in between.
    fn falling_facets(&self) -> Vec<(Monitor, [Sample; 2])> {
        let (d0, d1) = (self.departing_rates(), self.rates_at(&self.next));
        let step = self.next.s.max(f64::MIN_POSITIVE);
        let reach = self.setup.options.vanishing_distance * (1.0 + norm(&self.here.x));
        let stretch = self.stretch();
        let mut all = Vec::new();
        for (index, facet) in self.facets().filter(|f| !self.is_grazing(f.0)) {
            let sample = |s: f64, theta: &[f64], rate: f64| Sample {
                s,
                value: facet.sign() * theta[index],
                rate: facet.sign() * rate,
            };
            let ends = [
                sample(0.0, &self.here.theta, d0[index]),
                sample(step, &self.next.theta, d1[index] / stretch),
            ];
            // A step may begin on the facet, to rounding.
            let inside = ends[0].value >= -reach * ends[0].rate.abs() && ends[1].value > 0.0;
            if inside && may_fall_below_zero(&ends[0], &ends[1]) {
                all.push((Monitor::Facet { index, facet }, ends));
            }
        }
        all
    }

    /// Monitor functions that approach zero from both ends.
    fn falling_monitors(&mut self, all: &mut Vec<(Monitor, [Sample; 2])>) {
        let (here, next) = (&self.here, &self.next);
        for k in 0..self.monitors.watches.len() {
            let sample = |state: &State, s: f64, speed: f64| {
                let d = if s == 0.0 { DIFFERENCE } else { -DIFFERENCE } * next.s;
                let at = |d: f64| self.side_beside(k, &state.x, &state.t, d);
                let value = at(0.0);
                // Of second order, towards the inside.
                let rate = (4.0 * at(d) - 3.0 * value - at(2.0 * d)) / (2.0 * d * speed);
                Sample { s, value, rate }
            };
            let ends = [sample(here, 0.0, 1.0), sample(next, next.s, self.stretch())];
            let inside = ends[0].value > 0.0 && ends[1].value > 0.0;
            if inside && may_fall_below_zero(&ends[0], &ends[1]) {
                all.push((Monitor::User(k), ends));
            }
        }
    }
}

/// Exponent, d f′/f at the distance d from a zero, of a function that falls towards the zero: halfway between 2, where it only touches
/// zero there, and 3, above which it is at any distance where two more zeros lie beside the first.
const EXPONENT: f64 = 2.5;

/// Whether a function with these values and rates may be negative in between: a convex one where its tangents meet below zero; where the
/// rates are not those of a convex dip, the cubic; and one that rises from a zero at one end as if there were more of them.
fn may_fall_below_zero(a: &Sample, b: &Sample) -> bool {
    let length = b.s - a.s;
    let hidden = |zero: &Sample, other: &Sample, fall: f64| {
        zero.value == 0.0 && other.value > 0.0 && fall * length > EXPONENT * other.value
    };
    if hidden(b, a, -a.rate) || hidden(a, b, b.rate) {
        return true;
    }
    if !(a.rate < 0.0 && b.rate > 0.0) {
        let cubic = dip([a.value, b.value], [a.rate * length, b.rate * length]);
        return cubic.is_some_and(|(_, value)| value < 0.0);
    }
    let place = (b.value - a.value - b.rate * length) / (a.rate - b.rate);
    a.value + a.rate * place.clamp(0.0, length) < 0.0
}

/// Place and value of the minimum inside [0, 1] of the cubic with the given values and slopes at the ends.
pub(super) fn dip(g: [f64; 2], d: [f64; 2]) -> Option<(f64, f64)> {
    let a = 2.0 * g[0] - 2.0 * g[1] + d[0] + d[1];
    let b = -3.0 * g[0] + 3.0 * g[1] - 2.0 * d[0] - d[1];
    // The zero of 3 a u² + 2 b u + d₀ at which it grows, in the form without cancellation.
    let root = (b * b - 3.0 * a * d[0]).sqrt();
    let u = if b > 0.0 {
        -d[0] / (b + root)
    } else {
        (root - b) / (3.0 * a)
    };
    (u > 0.0 && u < 1.0).then(|| (u, ((a * u + b) * u + d[0]) * u + g[0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::Facet;

    /// Along y = 0 from α = 0 to 3, whose ends are inside, (α − 1)² touches zero at 1; lifted it does not, and lowered it has a zero before 1.
    #[test]
    fn facets_are_touched_where_their_functions_are_least() {
        let touched: Function = |_, a| [(a - 1.0).powi(2), 0.0, 2.0 * (a - 1.0)];
        let lifted: Function = |_, a| [(a - 1.0).powi(2) + 1e-12, 0.0, 2.0 * (a - 1.0)];
        let lowered: Function = |_, a| [(a - 1.0).powi(2) - 1e-6, 0.0, 2.0 * (a - 1.0)];
        for (test, place) in [(touched, Some(1.0)), (lifted, None), (lowered, Some(0.999))] {
            let mut map = Plane::within(|y, _| [y, 1.0, 0.0], &[test]);
            map.cells = vec![vec![Facet::positive(0)]];
            let mut run = map.curve(0.0, 0.0);
            let curve = run.curve.erased_mut();
            curve.step_to([0.0, 3.0], [0.0, 1.0]);
            let event = curve.first_event().unwrap().ok().unwrap();
            assert_eq!(event.is_some(), place.is_some(), "{place:?}: {event:?}");
            let found = curve.next.x[1];
            assert!((found - place.unwrap_or(3.0)).abs() < 1e-13, "{place:?}: {found}");
        }
    }

    /// A step that begins on the facet, along which the curve runs to first order, neither touches it there nor crosses it by less than the
    /// rounding of its terms.
    #[test]
    fn facets_are_not_met_again_within_rounding_of_the_start() {
        let test: Function = |y, a| [y - 1.0 + a * a - 1e-9 * a, 1.0, 2.0 * a - 1e-9];
        let mut map = Plane::within(|y, _| [y - 1.0, 1.0, 0.0], &[test]);
        map.cells = vec![vec![Facet::positive(0)]];
        let mut run = map.curve(1.0, 0.0);
        let curve = run.curve.erased_mut();
        curve.step_to([1.0, 1.0], [0.0, 1.0]);
        assert_eq!(curve.first_event().unwrap().ok(), Some(None));
        assert_eq!(curve.next.x[1], 1.0);
    }

    /// The cubic in the form of Bernstein on a grid; the parabola (1 − 2u)², whose least value is at a root of a linear equation.
    #[test]
    fn cubics_have_their_least_values() {
        for k in 0..200 {
            let [a, b, c, d] = [1, 2, 3, 5].map(|m: u32| (f64::from(k * m) * f64::from(m).sqrt()).fract());
            let (g, slope) = ([a, b], [-0.1 - 9.0 * c, 0.1 + 9.0 * d]);
            let control = [g[0], g[0] + slope[0] / 3.0, g[1] - slope[1] / 3.0, g[1]];
            let value = |u: f64| {
                let v = 1.0 - u;
                control[0] * v.powi(3)
                    + 3.0 * u * v * (control[1] * v + control[2] * u)
                    + control[3] * u.powi(3)
            };
            let least = (1..2000)
                .map(|i| value(f64::from(i) / 2000.0))
                .fold(f64::INFINITY, f64::min);
            let found = dip(g, slope).unwrap().1;
            assert!(
                found <= least + 1e-14 && found > least - 1e-5,
                "{k}: {found} {least}"
            );
        }
        assert_eq!(dip([1.0, 1.0], [-4.0, 4.0]), Some((0.5, 0.0)));
        assert!(dip([1.0, 1.0], [4.0, -4.0]).is_none() && dip([0.0, 1.0], [1.0, 1.0]).is_none());
        // u (u − ½) (u − 1) has its least value at ½ + √3/6, its mirror image at ½ − √3/6.
        let [up, down] = [0.5, -0.5].map(|d| dip([0.0, 0.0], [d, d]).unwrap());
        let off = 3.0_f64.sqrt() / 6.0;
        assert!((up.0 - 0.5 - off).abs() < 1e-15 && (down.0 - 0.5 + off).abs() < 1e-15);
        assert!((up.1 + 2.0 * off.powi(3)).abs() < 1e-16 && (up.1 - down.1).abs() < 1e-16);
    }
}
