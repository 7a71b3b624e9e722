//! Monitor functions of the user: their zeros along a curve are located and recorded.

use super::locate::side_factor;
use super::unseen::{DIFFERENCE, dip};
use super::watch::{Monitor, ROUNDING};
use crate::continuation::engine::{Curve, State};
use crate::continuation::{Continuation, ContinuationError, Event, MonitorCrossing, PointKind, Termination};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::norm;

impl<'a, P: PiecewiseSmooth + ?Sized, L> Continuation<'a, P, L> {
    /// Watches a function of x = (y, α): where its sign changes from one point of the curve to the next, the zero is located to
    /// rounding and becomes an [`Event::Monitor`]; so does the point where it reaches zero and stays zero. Two zeros within one step are found
    /// where interpolation tells them; smaller steps find them. Values that are not finite, jumps and poles are no zeros.
    ///
    /// ```
    /// use semismooth::continuation::{Continuation, ContinuationOptions, Direction, Event};
    /// use semismooth::piecewise::MinMap;
    /// // The circle y² + α² = 1, watched for y = α.
    /// let circle = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
    ///     a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
    ///     b[0] = 1e9;
    /// });
    /// let options = ContinuationOptions::default();
    /// let curve = Continuation::new(&circle, &[1.0, 0.0], Direction::Increasing, options)?
    ///     .with_monitor("diagonal", |x| x[0] - x[1]);
    /// let met: Vec<f64> = curve
    ///     .filter_map(|event| match event { Ok(Event::Monitor(m)) => Some(m.point.parameter()), _ => None })
    ///     .collect();
    /// assert_eq!(met.len(), 2);
    /// assert!((met[0] - 0.5_f64.sqrt()).abs() < 1e-12 && (met[1] + 0.5_f64.sqrt()).abs() < 1e-12);
    /// # Ok::<(), semismooth::continuation::ContinuationError>(())
    /// ```
    #[must_use]
    pub fn with_monitor(
        mut self,
        name: impl Into<String>,
        function: impl Fn(&[f64]) -> f64 + Send + Sync + 'a,
    ) -> Self {
        self.curve
            .erased_mut()
            .watch(name.into(), Box::new(function), false);
        self
    }

    /// [`with_monitor`](Self::with_monitor) that ends the curve at the first zero.
    #[must_use]
    pub fn with_stop(
        mut self,
        name: impl Into<String>,
        function: impl Fn(&[f64]) -> f64 + Send + Sync + 'a,
    ) -> Self {
        self.curve
            .erased_mut()
            .watch(name.into(), Box::new(function), true);
        self
    }
}

/// A function of x = (y, α) that threads may share.
pub(in crate::continuation) type Function<'a> = Box<dyn Fn(&[f64]) -> f64 + Send + Sync + 'a>;

/// The functions that are watched.
#[derive(Default)]
pub(in crate::continuation) struct Monitors<'a> {
    pub(in crate::continuation) watches: Vec<Watch<'a>>,
    /// Their signs where a saved run ended.
    pub(in crate::continuation) saved: Vec<f64>,
}

/// A function of x, and the side of its zero set on which the curve runs.
pub(in crate::continuation) struct Watch<'a> {
    pub(in crate::continuation) name: String,
    pub(in crate::continuation) function: Function<'a>,
    pub(in crate::continuation) stops: bool,
    /// Sign of the function before its next zero; 0 as long as it has vanished exactly. Kept apart from
    /// values, which are rounding errors at a zero that has just been passed.
    pub(in crate::continuation) side: f64,
    /// Whether the sign changes within the step at hand without a zero: at a pole or a jump.
    pub(in crate::continuation) jumped: bool,
}

impl<'a> Watch<'a> {
    pub(in crate::continuation) fn new(name: String, function: Function<'a>, stops: bool, side: f64) -> Self {
        Self {
            name,
            function,
            stops,
            side,
            jumped: false,
        }
    }

    pub(in crate::continuation) fn value(&self, x: &[f64]) -> f64 {
        (self.function)(x)
    }
}

/// What happens to a function at a point of the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Zero {
    /// Its sign changes.
    Crossed,
    /// It vanishes and stays zero.
    Entered,
}

/// A function is zero at a point if it is larger than there by at least this factor at a distance that is far larger than rounding: at a
/// jump the factor is about 1, at a pole less.
const CLEAR: f64 = 16.0;
/// Number of halvings by which a place is looked for between a zero at the start of a step and the next one.
pub(super) const INSIDE: i32 = 20;

impl<'a> Curve<'a> {
    fn watch(&mut self, name: String, function: Function<'a>, stops: bool) {
        // A resumed run has stored the sign: next to a zero just passed the value is rounding noise.
        let side = match self.monitors.saved.get(self.monitors.watches.len()) {
            Some(side) => *side,
            None => sign(self.map.value_at(&self.here.x, &function)),
        };
        self.monitors
            .watches
            .push(Watch::new(name, function, stops, side));
    }

    /// The value of monitor k at x, with the sign that is positive before its next zero; 0 as long as it has vanished.
    pub(super) fn side_of(&self, k: usize, x: &[f64]) -> f64 {
        self.monitors.watches[k].side * self.map.value_at(x, &|x| self.monitors.watches[k].value(x))
    }

    /// The same at the distance s from x along t.
    pub(super) fn side_beside(&self, k: usize, x: &[f64], t: &[f64], s: f64) -> f64 {
        let y: Vec<f64> = x.iter().zip(t).map(|(x, t)| x + s * t).collect();
        self.side_of(k, &y)
    }

    /// Distance along the curve by which rounding may separate two located points that are one.
    pub(super) fn width(&self, x: &[f64], step: f64) -> f64 {
        ROUNDING * (norm(x) + step)
    }

    /// Whether monitor k has a zero at x, where the curve arrives and leaves with the given tangents after a step of the given length.
    fn zero_at(&self, k: usize, x: &[f64], [arrival, departure]: [&[f64]; 2], step: f64) -> Option<Zero> {
        // At events that follow at once the step has no length.
        let step = step.max(self.pace.h);
        let near = self.width(x, step);
        let around = [
            self.side_of(k, x),
            self.side_beside(k, x, arrival, -near),
            self.side_beside(k, x, departure, near),
        ];
        if around.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let rest = around.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        let clear = |v: f64| v.abs() > CLEAR * rest;
        let mut entered = None;
        // Functions with rounding errors of their own are judged farther away.
        let far = (near * step).sqrt();
        for s in [far, (far * step).sqrt()] {
            let before = self.side_beside(k, x, arrival, -s);
            let after = self.side_beside(k, x, departure, s);
            if before > 0.0 && clear(before) && after.is_finite() {
                if after < 0.0 && clear(after) {
                    return Some(Zero::Crossed);
                }
                if clear(after) {
                    return None;
                }
                entered = Some(Zero::Entered);
            }
        }
        entered
    }

    /// The first zero of a monitor function between `here` and `next`, to which `next` is moved; `event`, which is located at `next`, where
    /// there is none before it.
    pub(in crate::continuation) fn first_zero(
        &mut self,
        mut event: Option<Monitor>,
    ) -> Result<Option<Monitor>, ContinuationError> {
        self.monitors.watches.iter_mut().for_each(|w| w.jumped = false);
        // Zeros at the place of the event belong to it.
        let mut met = vec![false; self.monitors.watches.len()];
        while let Some((k, end)) = self.changed_first(&met) {
            let high = self.next.clone();
            met[k] = true;
            if !self.locate_zero(k, end)? {
                self.next = high;
                self.monitors.watches[k].jumped = true;
                continue;
            }
            let State { x, t, s, .. } = &self.next;
            let together = event.is_some() && high.s - s <= self.width(x, high.s);
            let zero = self.zero_at(k, x, [t, t], high.s).is_some();
            if zero && !together {
                met.fill(false);
                met[k] = true;
                event = Some(Monitor::User(k));
                continue;
            }
            self.next = high;
            self.monitors.watches[k].jumped = !together;
        }
        Ok(event)
    }

    /// The monitor that seems to change its sign first before `next`, except those that are `met`, and the share of the step before which
    /// it does.
    fn changed_first(&self, met: &[bool]) -> Option<(usize, f64)> {
        let mut first: Option<(f64, usize, f64)> = None;
        for k in (0..met.len()).filter(|k| !met[*k] && self.monitors.watches[*k].side != 0.0) {
            let (before, after) = (
                self.side_of(k, &self.here.x).max(0.0),
                self.side_of(k, &self.next.x),
            );
            let (end, after) = match after {
                v if v <= 0.0 => (1.0, v),
                _ => match self.dip_on_segment(k, before, after) {
                    Some(found) => found,
                    None => continue,
                },
            };
            let place = end
                * if before > after {
                    before / (before - after)
                } else {
                    0.0
                };
            if first.is_none_or(|f| place < f.0) {
                first = Some((place, k, end));
            }
        }
        first.map(|f| (f.1, f.2))
    }

    /// A place on a straight step where a monitor that is positive at both ends is not, if its cubic interpolant leads there.
    fn dip_on_segment(&self, k: usize, before: f64, after: f64) -> Option<(f64, f64)> {
        let (here, step) = (&self.here, self.next.s);
        if !self.map.is_piecewise_affine() || step <= 0.0 || !(before > 0.0 && after > 0.0) {
            return None;
        }
        let at = |u: f64| self.side_beside(k, &here.x, &here.t, u * step);
        let slope =
            |u: f64, d: f64, value: f64| (4.0 * at(u + d) - 3.0 * value - at(u + 2.0 * d)) / (2.0 * d);
        let slopes = [slope(0.0, DIFFERENCE, before), slope(1.0, -DIFFERENCE, after)];
        let lowest = dip([before, after], slopes).map(|d| d.0);
        let places = [lowest.unwrap_or(0.5), 0.5];
        places.into_iter().map(|u| (u, at(u))).find(|p| p.1 <= 0.0)
    }

    /// Moves `next` to a zero of monitor k before the given share of the step.
    fn locate_zero(&mut self, k: usize, end: f64) -> Result<bool, ContinuationError> {
        if !self.map.is_piecewise_affine() {
            return Ok(self.locate(Monitor::User(k))?.is_some());
        }
        let State { x, t, .. } = &self.here;
        let b = end * self.next.s;
        let width = self.width(x, b);
        let at = |s: f64| match self.side_beside(k, x, t, s) {
            // A function that stays zero has its zero where it vanishes first.
            0.0 if self.side_beside(k, x, t, s - width) == 0.0 => -f64::MIN_POSITIVE,
            value => value,
        };
        let (mut a, mut ga) = (0.0, at(0.0));
        if ga <= 0.0 {
            // The start may be another zero.
            let inside = (1..INSIDE).map(|i| b * 0.5_f64.powi(i)).find(|s| at(*s) > 0.0);
            (a, ga) = inside.map_or((0.0, 0.0), |s| (s, at(s)));
        }
        let found = zero((a, b), (ga, at(b)), at);
        self.go(found, None)?;
        Ok(true)
    }

    /// Records the monitors with a zero at `here`, where the curve arrived along a tangent, after a step of the given length; one of them may
    /// have been located.
    pub(in crate::continuation) fn pass_monitors(
        &mut self,
        located: Option<usize>,
        (arrival, step): (&[f64], f64),
        corrections: usize,
    ) {
        for k in 0..self.monitors.watches.len() {
            let State { x, t, .. } = &self.here;
            let found = self.zero_at(k, x, [arrival, t], step);
            let zero = found.or_else(|| (located == Some(k)).then_some(Zero::Crossed));
            let point = self.point_here(PointKind::Step, corrections);
            let watch = &mut self.monitors.watches[k];
            let Some(zero) = zero.filter(|_| watch.side != 0.0) else {
                continue;
            };
            watch.side = match zero {
                Zero::Crossed => -watch.side,
                Zero::Entered => 0.0,
            };
            let crossing = MonitorCrossing {
                monitor: k,
                name: watch.name.clone(),
                point,
            };
            if watch.stops {
                self.told.termination.get_or_insert(Termination::Monitor);
            }
            self.emit(Event::Monitor(crossing));
        }
    }

    /// Stores the signs of functions that vanished so far, or jumped within the step.
    pub(in crate::continuation) fn refresh_sides(&mut self) {
        for watch in &mut self.monitors.watches {
            if watch.side == 0.0 || watch.jumped {
                let now = sign(self.map.value_at(&self.here.x, &watch.function));
                watch.side = if now == 0.0 { watch.side } else { now };
                watch.jumped = false;
            }
        }
    }
}

pub(in crate::continuation) fn sign(v: f64) -> f64 {
    if v > 0.0 {
        1.0
    } else if v < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// A zero of g in [a, b] for values ga ≥ 0 ≥ gb at the ends: bracketed secants (Anderson–Björck), bisection where they converge slowly.
fn zero((mut a, mut b): (f64, f64), (mut ga, mut gb): (f64, f64), mut g: impl FnMut(f64) -> f64) -> f64 {
    const LIMIT: usize = 200;
    for step in 0..LIMIT {
        if b - a <= 2.0 * f64::EPSILON * b || ga == 0.0 {
            break;
        }
        let secant = a + (b - a) * ga / (ga - gb);
        let middle = 0.5 * (a + b);
        let s = if step % 3 == 2 || !(secant > a && secant < b) {
            middle
        } else {
            secant
        };
        if !(s > a && s < b) {
            break;
        }
        let value = g(s);
        if value == 0.0 {
            return s;
        }
        if value > 0.0 {
            gb *= side_factor(value, ga);
            (a, ga) = (s, value);
        } else {
            ga *= side_factor(value, gb);
            (b, gb) = (s, value);
        }
    }
    if ga <= -gb { a } else { b }
}
