//! Location of an event: the zero of its monitor on the curve of the frozen selection.

use super::monitor::INSIDE;
use super::watch::Monitor;
use crate::continuation::engine::{Curve, State};
use crate::continuation::error::{if_converged, if_solved};
use crate::continuation::{ContinuationError, Termination};
use crate::linear::LinearSolver;
use crate::newton::Linearisation;
use crate::piecewise::{PiecewiseSmoothExt, ScaledMap, Selection, Vanishing};
use crate::sparse::{distance, dot, norm};
use crate::tolerances::HALVINGS;

/// Values of test functions up to this fraction of their rounding error count as zero.
const HIDDEN: f64 = 0.0625;
/// Distance from the interpolated guess, relative to the step, beyond which a corrected point lies on another curve.
pub(in crate::continuation) const STRAY: f64 = 0.02;

impl Curve<'_> {
    /// Value of a monitor at a state, > 0 before the event; `start` is its value at `here`.
    fn monitor_value(
        &mut self,
        monitor: Monitor,
        state: &State,
        origin: &Origin,
    ) -> Result<f64, ContinuationError> {
        let last = state.x.len() - 1;
        Ok(match monitor {
            Monitor::Facet { index, facet } => facet.sign() * state.theta[index],
            Monitor::Parameter { value, .. } => origin.sign * (state.x[last] - value),
            Monitor::Fold => origin.sign * state.t[last],
            Monitor::Singular => self.determinant(None, state, origin)?,
            Monitor::Coactive(k) => self.determinant(Some(k), state, origin)?,
            Monitor::User(k) => self.side_on_curve(k, state),
        })
    }

    /// det [∇H^(σ); tᵀ] relative to its absolute value at the start of the step, signed to be positive there; 0 when singular.
    fn determinant(
        &mut self,
        coactive: Option<usize>,
        state: &State,
        origin: &Origin,
    ) -> Result<f64, ContinuationError> {
        Ok(match self.log_determinant(coactive, state)? {
            Some((sign, log)) => sign * origin.sign * (log - origin.log).exp(),
            None => 0.0,
        })
    }

    /// Sign and logarithm of |det [∇H^(σ); tᵀ]|, which itself may be beyond all floating-point numbers; `None` when singular.
    fn log_determinant(
        &mut self,
        coactive: Option<usize>,
        state: &State,
    ) -> Result<Option<(f64, f64)>, ContinuationError> {
        let selection = match coactive {
            Some(k) => self.path.coactive[k].0.clone(),
            None => self.path.selection.clone(),
        };
        let at = (self.corrector).linearize(&self.map, &selection, &state.x, Some(&state.t));
        let Some(at) = if_solved(at)? else {
            return Ok(None);
        };
        let sign = at.orientation(&state.t).filter(|s| *s != 0);
        Ok(sign.map(|s| (f64::from(s), at.log_det().unwrap_or(0.0))))
    }

    fn origin(&mut self, monitor: Monitor) -> Result<Origin, ContinuationError> {
        let last = self.here.x.len() - 1;
        let mut origin = Origin { sign: 1.0, log: 0.0 };
        match monitor {
            Monitor::Facet { .. } | Monitor::User(_) => {}
            Monitor::Parameter { value, .. } => {
                let (before, after) = (self.here.x[last] - value, self.next.x[last] - value);
                // A step may begin at the value.
                origin.sign = if before == 0.0 {
                    -sign_of(after)
                } else {
                    sign_of(before)
                };
            }
            Monitor::Fold => origin.sign = f64::from(self.here.heading.unwrap_or(1)),
            Monitor::Singular => self.determinant_origin(None, &mut origin)?,
            Monitor::Coactive(k) => self.determinant_origin(Some(k), &mut origin)?,
        }
        Ok(origin)
    }

    fn determinant_origin(
        &mut self,
        coactive: Option<usize>,
        origin: &mut Origin,
    ) -> Result<(), ContinuationError> {
        let here = self.here.clone();
        if let Some((sign, log)) = self.log_determinant(coactive, &here)? {
            (origin.sign, origin.log) = (sign, log);
        }
        Ok(())
    }

    /// Moves `next` to the zero of `monitor` between `here` and `next`, by bracketed secants (Anderson–Björck) along the curve of
    /// the frozen selection, each point corrected to rounding in a hyperplane normal to the tangent at `here`. Returns the absolute value
    /// of the monitor there; `None` where points of the curve could not be found.
    pub(in crate::continuation) fn locate(
        &mut self,
        monitor: Monitor,
    ) -> Result<Option<f64>, ContinuationError> {
        // Zeros of these frequent monitors are found without tangents in between.
        let mut misses = match monitor {
            Monitor::Facet { index, .. } => Some(Misses {
                index,
                ..Misses::default()
            }),
            _ => None,
        };
        let origin = self.origin(monitor)?;
        let here = self.here.clone();
        let mut high = self.next.clone();
        let (mut a, mut ga) = (0.0, self.monitor_value(monitor, &here, &origin)?);
        let (mut b, mut gb) = (high.s, self.monitor_value(monitor, &high, &origin)?);
        let mut state = high.clone();
        if let Some(mut s) = self.between_zeros(monitor, ga) {
            // The bracket begins between the zero that the curve has left and the next one.
            let facet = matches!(monitor, Monitor::Facet { .. });
            let mut inside = false;
            // The rate at which a facet is left is known, and so is the place.
            for _ in 0..if facet { 1 } else { INSIDE } {
                if !self.find_state(s, &high, &mut state, Find::by(&mut misses))? {
                    return Ok(None);
                }
                let g = self.monitor_value(monitor, &state, &origin)?;
                if g > 0.0 {
                    (a, ga, inside) = (s, g, true);
                    break;
                }
                s *= 0.5;
            }
            if !inside && (facet || ga <= 0.0) {
                return Ok(None);
            }
        }
        // A facet crossed at once: the event is the start of the step itself, to rounding.
        ga = ga.max(0.0);
        let width = 4.0 * f64::EPSILON * (norm(&here.x) + b);
        let drop = if gb.is_finite() { (ga - gb).abs() } else { ga };
        let slope = drop / (b - a).max(f64::MIN_POSITIVE);
        let mut best: Option<(f64, State)> = None;
        misses.iter_mut().for_each(|m| m.rounding = None);
        for _ in 0..HALVINGS {
            let mut s = if gb < ga {
                a + (b - a) * ga / (ga - gb)
            } else {
                0.5 * (a + b)
            };
            if !(s > a && s < b) {
                s = if ga == 0.0 && a == 0.0 { 0.0 } else { 0.5 * (a + b) };
            }
            if !self.find_state(s, &high, &mut state, Find::by(&mut misses))? {
                return Ok(None);
            }
            let g = self.monitor_value(monitor, &state, &origin)?;
            if g.is_nan() {
                return Ok(None);
            }
            if best.as_ref().is_none_or(|b| g.abs() < b.0) {
                best = Some((g.abs(), state.clone()));
            }
            let noise = misses.as_ref().and_then(|c| c.rounding).unwrap_or(0.0);
            if g.abs() <= (HIDDEN * noise).max(width * slope) || (b - a) <= width {
                break;
            }
            if g > 0.0 {
                gb *= side_factor(g, ga);
                (a, ga) = (s, g);
            } else {
                ga *= side_factor(g, gb);
                (b, gb) = (s, g);
                if misses.is_none() {
                    high = state.clone();
                }
            }
        }
        let Some((value, mut state)) = best else {
            return Ok(None);
        };
        self.complete_state(&mut state)?;
        self.next = state;
        Ok(Some(value))
    }

    /// A place before the event in a step that begins at another zero of its monitor.
    fn between_zeros(&self, monitor: Monitor, start: f64) -> Option<f64> {
        match monitor {
            Monitor::Facet { index, facet } => self.return_to(index, facet).map(|s| 0.5 * s),
            Monitor::Fold => self.fastest().or((start <= 0.0).then_some(0.5 * self.next.s)),
            Monitor::User(_) => (start <= 0.0).then_some(0.5 * self.next.s),
            _ => None,
        }
    }

    /// The value of a monitor function at a state. A function that stays zero has its zero where it vanishes first.
    fn side_on_curve(&self, k: usize, state: &State) -> f64 {
        let value = self.side_of(k, &state.x);
        let width = self.width(&state.x, self.next.s);
        let stays = value == 0.0 && self.side_beside(k, &state.x, &state.t, -width) == 0.0;
        if stays { f64::NEG_INFINITY } else { value }
    }

    /// Cubic interpolation between `here` and `high` at distance `s` along the tangent at `here`.
    pub(in crate::continuation) fn interpolate(&self, s: f64, high: &State, state: &mut State) {
        let u = s / high.s;
        let (h00, h10) = ((1.0 + 2.0 * u) * (1.0 - u) * (1.0 - u), u * (1.0 - u) * (1.0 - u));
        let (h01, h11) = (u * u * (3.0 - 2.0 * u), u * u * (u - 1.0));
        let stretch = dot(&self.here.t, &high.t).max(0.1);
        for i in 0..state.x.len() {
            let (t0, t1) = (self.here.t[i] * high.s, high.t[i] * high.s / stretch);
            state.x[i] = h00 * self.here.x[i] + h10 * t0 + h01 * high.x[i] + h11 * t1;
            state.t[i] = (1.0 - u) * self.here.t[i] + u * high.t[i];
        }
    }

    /// The distance at which the derivative of the cubic interpolant of α, in the direction of α beyond `here`, is largest, if it grows at
    /// first.
    fn fastest(&self) -> Option<f64> {
        let (last, step) = (self.here.x.len() - 1, self.next.s);
        let sign = f64::from(self.here.heading.unwrap_or(0));
        let mean = sign * (self.next.x[last] - self.here.x[last]) / step;
        let (d0, d1) = (
            sign * self.here.t[last],
            sign * self.next.t[last] / self.stretch(),
        );
        let (a, b) = (3.0 * (d0 + d1) - 6.0 * mean, 6.0 * mean - 4.0 * d0 - 2.0 * d1);
        let share = -0.5 * b / a;
        (b > 0.0 && share > 0.0 && share < 1.0).then_some(share * step)
    }

    /// The rate at which the step advances along the tangent at `here`, at its other end.
    pub(super) fn stretch(&self) -> f64 {
        dot(&self.here.t, &self.next.t).max(0.1)
    }

    /// The point of the curve at distance `s` along the tangent at `here`, with what is wanted of it; the
    /// guess interpolates between `here` and `high`.
    pub(super) fn find_state(
        &mut self,
        s: f64,
        high: &State,
        state: &mut State,
        mut find: Find<'_>,
    ) -> Result<bool, ContinuationError> {
        self.interpolate(s, high, state);
        let guess = state.x.clone();
        let (anchor, normal) = (&self.here.x, &self.here.t);
        let (map, selection) = (&self.map, &self.path.selection);
        let State { x, t, .. } = state;
        let corrected = match &mut find {
            Find::Chords(misses) => {
                misses.add(s, high.s, x);
                (self.corrector).correct_by_chords(map, selection, (anchor, normal, s), x)
            }
            _ => (self.corrector).correct_in_plane(map, selection, (anchor, normal, s), x, t),
        };
        let Some((correction, mut at)) = if_converged(corrected)? else {
            return Ok(false);
        };
        if distance(&state.x, &guess) > STRAY * high.s + 1e-9 * (1.0 + norm(&guess)) {
            return Ok(false);
        }
        state.residual_norm = correction.residual_norm;
        state.s = s;
        state.find_tests(map, selection);
        refine_tests(&mut at, (map, selection), normal, &mut self.buffers.rates, state);
        if !matches!(find, Find::Chords(_)) {
            state.orientation = at.orientation(&state.t);
        }
        match find {
            Find::Tangent => {}
            Find::Decline(h) => {
                let (decline, _) = (self.scale.regularity).decline(at, map, &self.scale.rows, state, h)?;
                state.decline = Some(decline);
            }
            Find::Chords(misses) => {
                misses.note(s, &guess, &state.x);
                if misses.rounding.is_none() {
                    let v = Vanishing::new(map, &self.setup.layout, selection, misses.index, &state.x);
                    misses.rounding = at.rounding_of(&v.gradient, &state.x, normal).or(Some(0.0));
                }
            }
        }
        Ok(true)
    }

    /// Tangent, orientation, determinant and residual at the point itself.
    pub(in crate::continuation) fn complete_state(
        &mut self,
        state: &mut State,
    ) -> Result<(), ContinuationError> {
        let (map, arrival) = (&self.map, &self.here.t);
        let at = (self.corrector).linearize(map, &self.path.selection, &state.x, Some(&state.t));
        let at = if_solved(at)?;
        let singular = at.is_none();
        // Next to a branch point the kernel is noise: the tangent at the start of the step is kept.
        match at.filter(|at| dot(at.tangent(), arrival).abs() >= self.setup.options.min_cos) {
            Some(at) => {
                let sign = sign_of(dot(at.tangent(), &state.t));
                for (t, v) in state.t.iter_mut().zip(at.tangent()) {
                    *t = sign * v;
                }
                state.take_signs(Some(&at));
                let (decline, _) =
                    (self.scale.regularity).decline(at, map, &self.scale.rows, state, state.s)?;
                state.decline = Some(decline);
            }
            None => {
                // Where there is no kernel that of the state may be noise.
                if !singular || dot(&state.t, arrival) < self.setup.options.min_cos {
                    state.t.copy_from_slice(arrival);
                }
                state.forget_signs();
            }
        }
        let mut r = vec![0.0; map.num_residuals()];
        map.residual(&self.path.selection, &state.x, &mut r);
        state.residual_norm = norm(&r);
        Ok(())
    }

    /// Orientations of the co-active selections at `here`.
    pub(in crate::continuation) fn refresh_coactive(&mut self) -> Result<(), ContinuationError> {
        if self.path.coactive.is_empty() || self.told.termination == Some(Termination::Interrupted) {
            return Ok(());
        }
        let (x, t) = (self.here.x.clone(), self.here.t.clone());
        for k in 0..self.path.coactive.len() {
            let selection = self.path.coactive[k].0.clone();
            if let Some(sign) = self.orientation_of(&selection, &x, &t)? {
                self.path.coactive[k].1 = Some(sign);
            }
        }
        Ok(())
    }
}

/// Test functions that contain terms of H inherit its rounding errors, whatever the units of H: they are
/// extrapolated to the point in the plane across `normal` where H vanishes, below the last bits of x. `rates`
/// is scratch.
fn refine_tests<L: LinearSolver>(
    at: &mut Linearisation<'_, L>,
    (map, selection): (&dyn ScaledMap, &Selection),
    normal: &[f64],
    rates: &mut Vec<f64>,
    state: &mut State,
) {
    rates.resize(state.theta.len(), 0.0);
    let size = 1.0 + norm(&state.x);
    let rest = at.remainder(map, &state.x, normal);
    let Some(rest) = rest.filter(|rest| norm(rest) <= 1e-9 * size) else {
        return;
    };
    map.tests_of_selection(selection, &state.x, Some(rest), rates);
    if rates.iter().all(|r| r.is_finite()) {
        state.theta.iter_mut().zip(rates).for_each(|(t, r)| *t -= *r);
    }
}

/// What is wanted of a point of the curve besides its place and its test functions.
pub(super) enum Find<'f> {
    /// Its tangent and its orientation.
    Tangent,
    /// These, and the decline of regularity for steps of a length.
    Decline(f64),
    /// Nothing: it is found by chord steps, and the tangent of the guess is kept.
    Chords(&'f mut Misses),
}

impl<'f> Find<'f> {
    fn by(misses: &'f mut Option<Misses>) -> Self {
        misses.as_mut().map_or(Self::Tangent, Self::Chords)
    }
}

/// The error of the cubic interpolation at the last two points found on the curve. At the next point it is predicted by the polynomial
/// through both errors that vanishes at the ends, so that points close together cost only a few corrections.
#[derive(Default)]
pub(super) struct Misses {
    index: usize,
    /// Effect of rounding errors of H on the test function with this index, as a mean over their signs: its
    /// zero is not determined more accurately.
    rounding: Option<f64>,
    last: Option<(f64, Vec<f64>)>,
    before: Option<(f64, Vec<f64>)>,
}

impl Misses {
    /// Adds the predicted interpolation error at s to x; `end` is the length of the step.
    fn add(&self, s: f64, end: f64, x: &mut [f64]) {
        const FARTHEST: f64 = 2.0;
        let Some((s0, last)) = &self.last else { return };
        let bubble = |at: f64| at * (end - at);
        let alone = bubble(s) / bubble(*s0);
        let mut add = |weight: f64, miss: &[f64]| {
            x.iter_mut().zip(miss).for_each(|(x, m)| *x += weight * m);
        };
        if let Some((s1, before)) = &self.before {
            let away = (s - s0) / (s0 - s1);
            let weights = (alone * (1.0 + away), bubble(s) / bubble(*s1) * -away);
            // Not by far extrapolation, where rounding grows.
            if weights.0.abs() <= FARTHEST && weights.1.abs() <= FARTHEST {
                add(weights.0, last);
                add(weights.1, before);
                return;
            }
        }
        if alone.abs() <= FARTHEST {
            add(alone, last);
        }
    }

    fn note(&mut self, s: f64, interpolated: &[f64], x: &[f64]) {
        let miss = x.iter().zip(interpolated).map(|(x, g)| x - g).collect();
        self.before = self.last.replace((s, miss));
    }
}

/// Normalisation of a monitor: positive at the start of the step.
struct Origin {
    sign: f64,
    log: f64,
}

fn sign_of(v: f64) -> f64 {
    if v < 0.0 { -1.0 } else { 1.0 }
}

/// Anderson–Björck's factor for the value at the end of the bracket that stays.
pub(in crate::continuation) fn side_factor(new: f64, replaced: f64) -> f64 {
    let m = 1.0 - new / replaced;
    if m > 0.0 { m } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::{Misses, ScaledMap, refine_tests};
    use crate::continuation::testing::Plane;

    /// From two points an error s (L − s) (a + b s) is known everywhere, from one of them with b = 0.
    #[test]
    fn misses_that_are_cubic_are_told_exactly() {
        let miss = |s: f64, b: f64| s * (2.0 - s) * (0.3 + b * s);
        for (points, b) in [
            (vec![0.4], 0.0),
            (vec![0.4, 1.1], -0.7),
            (vec![1.9, 1.2, 0.8], 0.2),
        ] {
            let mut misses = Misses::default();
            let mut none = [5.0];
            misses.add(0.7, 2.0, &mut none);
            assert_eq!(none, [5.0]);
            for s in points {
                misses.note(s, &[1.0], &[1.0 + miss(s, b)]);
            }
            for s in [0.7, 0.95, 1.0] {
                let mut x = [0.0];
                misses.add(s, 2.0, &mut x);
                assert!((x[0] - miss(s, b)).abs() < 1e-14, "{s} {b}: {x:?}");
            }
        }
    }

    /// H = y − α within a test function, in units a million times larger: the distance of x from the curve, in its last digits, is no
    /// distance from the facet.
    #[test]
    fn test_functions_do_not_contain_the_residual() {
        let map = Plane::within(
            |y, a| [y - a, 1.0, -1.0],
            &[|y, a| [1e6 * (y - a) + a, 1e6, 1.0 - 1e6]],
        );
        let mut run = map.curve(0.5, 0.5);
        let curve = run.curve.erased_mut();
        for off in [1e-12, -3e-11, 1e-15] {
            let mut state = curve.here.clone();
            state.x[0] += off;
            curve.map.test_functions(&state.x, &mut state.theta);
            assert!((state.theta[0] - 0.5).abs() >= 0.9e6 * off.abs());
            let at = (curve.corrector).linearize(&curve.map, &curve.path.selection, &state.x, None);
            let of: (&dyn ScaledMap, _) = (&curve.map, &curve.path.selection);
            refine_tests(
                &mut at.unwrap(),
                of,
                &curve.here.t,
                &mut curve.buffers.rates,
                &mut state,
            );
            // The nearest point of the curve has α = (y + α)/2.
            assert!(
                (state.theta[0] - 0.5 - 0.5 * off).abs() < 1e-9 * (1e6 * off.abs()) + 1e-15,
                "{off:e}"
            );
        }
    }
}
