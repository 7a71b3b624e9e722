//! Monitor functions of the user: their zeros along a curve are located and recorded.

use super::locate::side_factor;
use super::watch::Monitor;
use crate::continuation::engine::{Curve, Function, Watch};
use crate::continuation::{Continuation, Event, MonitorCrossing, PointKind, Termination};
use crate::piecewise::PiecewiseSmooth;

impl<'a, P: PiecewiseSmooth + ?Sized, L> Continuation<'a, P, L> {
    /// Watches a function of x = (y, α): where its sign changes from one point of the curve to the next, the zero is located to
    /// rounding and becomes an [`Event::Monitor`]. Two zeros within one step may be missed; smaller steps find them. Values that
    /// are not finite are no change of sign.
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

impl<'a> Curve<'a> {
    fn watch(&mut self, name: String, function: Function<'a>, stops: bool) {
        // A resumed run has stored the sign: next to a zero just passed the value is rounding noise.
        let side = match self.saved_sides.get(self.watches.len()) {
            Some(side) => *side,
            None => sign(self.map.at(&self.here.x, &function)),
        };
        self.watches.push(Watch {
            name,
            function,
            stops,
            side,
        });
    }

    /// The values of monitor k at `here` and at x, with the sign that is positive before the zero, if its sign has changed in between.
    pub(in crate::continuation) fn crossing(&self, k: usize, x: &[f64]) -> Option<(f64, f64)> {
        let watch = &self.watches[k];
        let at = |x| watch.side * self.map.at(x, |x| watch.value(x));
        let after = at(x);
        (after < 0.0).then(|| (at(&self.here.x).max(0.0), after))
    }

    /// The first zero of a monitor function on the segment of length `s` along the tangent.
    pub(in crate::continuation) fn first_crossing(&mut self, s: f64) -> Option<(f64, Monitor)> {
        let mut first: Option<(f64, Monitor)> = None;
        for k in 0..self.watches.len() {
            let end = first.map_or(s, |f| f.0);
            let x = &mut self.next.x;
            let watch = &self.watches[k];
            let mut at = |s: f64| {
                for ((x, x0), t) in x.iter_mut().zip(&self.here.x).zip(&self.here.t) {
                    *x = x0 + s * t;
                }
                watch.side * self.map.at(x, |x| watch.value(x))
            };
            let ends = (at(0.0).max(0.0), at(end));
            if ends.1 < 0.0 {
                first = Some((zero(end, ends, at), Monitor::User(k)));
            }
        }
        first
    }

    /// Records a zero at `here`.
    pub(in crate::continuation) fn pass_monitor(&mut self, k: usize, corrections: usize) {
        let point = self.point_here(PointKind::Step, corrections);
        let watch = &mut self.watches[k];
        watch.side = -watch.side;
        let crossing = MonitorCrossing {
            monitor: k,
            name: watch.name.clone(),
            point,
        };
        if watch.stops {
            self.termination = Some(Termination::Monitor);
        }
        self.emit(Event::Monitor(crossing));
    }

    /// Stores the signs of functions that vanished exactly so far.
    pub(in crate::continuation) fn refresh_sides(&mut self) {
        for watch in self.watches.iter_mut().filter(|w| w.side == 0.0) {
            watch.side = sign(self.map.at(&self.here.x, &watch.function));
        }
    }
}

fn sign(v: f64) -> f64 {
    if v > 0.0 {
        1.0
    } else if v < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// A zero of g in [0, b] for values ga ≥ 0 > gb at the ends: bracketed secants (Anderson–Björck), bisection where they converge slowly.
fn zero(end: f64, (mut ga, mut gb): (f64, f64), mut g: impl FnMut(f64) -> f64) -> f64 {
    const LIMIT: usize = 200;
    let (mut a, mut b) = (0.0, end);
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
