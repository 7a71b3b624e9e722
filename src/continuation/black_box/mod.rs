//! Curves of maps whose pieces are not known.

mod corner;
mod locate;
mod system;

use std::ops::ControlFlow;

use self::corner::Blocked;
use self::locate::Stretch;
use self::system::{State, System};
use super::event::monitor::{Watch, sign};
use super::start::onto_curve;
use super::{
    Branch, BranchVertex, ContinuationError, ContinuationOptions, Direction, MonitorCrossing, Point,
    PointKind, Termination,
};
use crate::clock::{Clock, Deadline};
use crate::input::check_vector;
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::sparse::{distance, dot, norm};
use crate::tolerances::{CHECKED, SIX_DIGITS, TANGENTIAL};

/// A curve of a map whose kinks are not known: a program of which only values and Jacobians can be had, or a map whose test functions are
/// not to be used. Where there is a kink, the Jacobian may be that of either side.
///
/// Corners are found because the tangent turns there however short the step, and are crossed along the one arm that is found behind them.
/// Points where α turns and zeros of monitors are located. What kind of point a corner is, which pieces meet in it, and whether other
/// curves branch off there or inside pieces is not known, and bends of less than the angle of
/// [`min_cos`](ContinuationOptions::min_cos) are passed like smooth points; what begins and ends within half a step may be passed over:
/// [`max_step`](ContinuationOptions::max_step) says how long steps are. Where the pieces are known, [`Continuation`](super::Continuation)
/// says more. Of the options, those of selections, nodes and local searches have no effect.
///
/// ```
/// use semismooth::continuation::{BlackBoxCurve, ContinuationOptions, Direction};
/// use semismooth::piecewise::MinMap;
/// // min(α − y, α + y) = 0, that is α = |y|: the kink is found without the help of the map.
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let branch = BlackBoxCurve::new(&map, &[1.0, 1.0], Direction::Decreasing, options).follow()?;
/// assert_eq!(branch.to_string(), "1 turning point, pieces not known; bound of the parameter");
/// assert!(branch.turns[0].parameter().abs() < 1e-12);
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
pub struct BlackBoxCurve<'a> {
    map: Box<dyn PiecewiseSmooth + 'a>,
    x: Vec<f64>,
    direction: Direction,
    options: ContinuationOptions,
    monitors: Vec<Watch<'a>>,
    over: Option<Box<dyn Fn() -> bool + 'a>>,
}

impl std::fmt::Debug for BlackBoxCurve<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BlackBoxCurve")
            .field("x", &self.x)
            .field("direction", &self.direction)
            .finish_non_exhaustive()
    }
}

impl<'a> BlackBoxCurve<'a> {
    /// The curve through `x` = (y, α), which is corrected onto it at its α if need be.
    #[must_use]
    pub fn new<P: PiecewiseSmooth + ?Sized>(
        map: &'a P,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
    ) -> Self {
        Self {
            map: Box::new(map),
            x: x.to_vec(),
            direction,
            options,
            monitors: Vec::new(),
            over: None,
        }
    }

    /// Watches a function of x, as [`Continuation::with_monitor`](super::Continuation::with_monitor): its zeros are listed.
    #[must_use]
    pub fn with_monitor(
        mut self,
        name: impl Into<String>,
        function: impl Fn(&[f64]) -> f64 + Send + Sync + 'a,
    ) -> Self {
        self.monitors
            .push(Watch::new(name.into(), Box::new(function), false, 0.0));
        self
    }

    /// [`with_monitor`](Self::with_monitor) that ends the curve at the first zero.
    #[must_use]
    pub fn with_stop(
        mut self,
        name: impl Into<String>,
        function: impl Fn(&[f64]) -> f64 + Send + Sync + 'a,
    ) -> Self {
        self.monitors
            .push(Watch::new(name.into(), Box::new(function), true, 0.0));
        self
    }

    /// The curve ends, [`Interrupted`](Termination::Interrupted), once `over` returns true: it is called before each step.
    #[must_use]
    pub fn until(mut self, over: impl Fn() -> bool + 'a) -> Self {
        self.over = Some(Box::new(over));
        self
    }

    /// Follows the curve to its end.
    ///
    /// # Errors
    /// Options out of range, maps that are no curves, starts of the wrong length or not finite, or from which Newton's method finds no
    /// solution; [`ContinuationError::UndecidedArms`] where the tangent at the start has no part in the direction.
    pub fn follow(self) -> Result<Branch, ContinuationError> {
        self.follow_observed(|_| ControlFlow::Continue(()))
    }

    /// [`follow`](Self::follow), and `observe` is called with every point and may stop.
    ///
    /// # Errors
    /// As [`follow`](Self::follow).
    pub fn follow_observed(
        self,
        mut observe: impl FnMut(&BranchVertex<'_>) -> ControlFlow<()>,
    ) -> Result<Branch, ContinuationError> {
        let mut walk = Walk::begin(self, &mut observe)?;
        let end = walk.run();
        let mut branch = walk.branch;
        branch.termination = end;
        branch.corrections = walk.system.corrections;
        branch.factorisations = walk.system.factorisations();
        Ok(branch)
    }
}

/// What is at a point.
#[derive(Clone, Copy)]
enum What {
    Turn,
    Monitor(usize),
    Target,
    Bound,
    Closed,
}

struct Walk<'a, 'o> {
    system: System<'a>,
    options: ContinuationOptions,
    monitors: Vec<Watch<'a>>,
    /// The sign of α̇ since its last change.
    side: f64,
    over: Option<Box<dyn Fn() -> bool + 'a>>,
    observe: &'o mut dyn FnMut(&BranchVertex<'_>) -> ControlFlow<()>,
    branch: Branch,
    start: State,
    here: State,
    arclength: f64,
    clock: Clock,
    /// The largest ‖x‖.
    largest: f64,
}

impl<'a, 'o> Walk<'a, 'o> {
    fn begin(
        curve: BlackBoxCurve<'a>,
        observe: &'o mut dyn FnMut(&BranchVertex<'_>) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError> {
        let BlackBoxCurve {
            map,
            x,
            direction,
            options,
            mut monitors,
            over,
        } = curve;
        options.validate()?;
        check_vector("the start", &x, map.num_vars())?;
        if !options.typical_sizes.is_empty() {
            check_vector("typical_sizes", &options.typical_sizes, map.num_vars())?;
        }
        if let Direction::Along(v) = &direction {
            check_vector("the direction", v, map.num_vars())?;
        }
        let mut system = System::new(map, &options)?;
        let x = onto_curve(
            system.map(),
            &super::start::inside(&x, options.parameter_range)?,
            &options,
        )?;
        let here = first(&mut system, &x, &direction)?;
        let size = |v: &[f64]| 1.0 + norm(v);
        monitors.iter_mut().for_each(|m| m.side = sign(m.value(&x)));
        Ok(Self {
            side: rate_sign(&here),
            largest: options.max_growth * size(&x),
            clock: Clock::start(),
            branch: Branch::black_box(),
            start: here.clone(),
            here,
            arclength: 0.0,
            system,
            options,
            monitors,
            over,
            observe,
        })
    }

    /// Number of points so far.
    fn count(&self) -> usize {
        self.branch.points.len() + self.branch.turns.len() + self.branch.monitor_crossings.len()
    }

    fn run(&mut self) -> Termination {
        let deadline = Deadline::of(self.clock, self.options.max_time);
        let (first, mut h) = (self.here.clone(), self.options.step.min(self.options.max_step));
        if self.emit(&first, None, 0.0).is_break() {
            return Termination::Interrupted;
        }
        loop {
            if self.over.as_ref().is_some_and(|over| over()) {
                return Termination::Interrupted;
            }
            if deadline.is_over() {
                return Termination::TimeLimit;
            }
            if self.count() >= self.options.max_points {
                return Termination::PointLimit;
            }
            let left = self.options.max_arclength - self.arclength;
            if left <= 0.0 {
                return Termination::ArclengthLimit;
            }
            let end = match self.stride(&mut h, left) {
                ControlFlow::Continue(()) => None,
                ControlFlow::Break(end) => Some(end),
            };
            if let Some(end) = end {
                return end;
            }
            if norm(&self.system.unscaled(&self.here.z)) > self.largest {
                return Termination::Unbounded;
            }
        }
    }

    /// One step, or one across a corner.
    fn stride(&mut self, h: &mut f64, left: f64) -> ControlFlow<Termination> {
        let here = self.here.clone();
        let reach = h.min(left);
        if let Some(end) = self.system.step(&here, reach) {
            self.advance(reach, end)?;
            *h = (self.options.growth * *h).min(self.options.max_step);
            return ControlFlow::Continue(());
        }
        // Where the curve is bent half of the step will do.
        if let Some(end) = self.system.step(&here, 0.5 * reach) {
            *h = 0.5 * reach;
            return self.advance(*h, end);
        }
        let crossing = match self.system.cross(&here, reach, self.options.min_step) {
            Ok(crossing) => crossing,
            Err(Blocked::Nowhere) => return ControlFlow::Break(Termination::StepTooSmall),
            Err(Blocked::Several) => return ControlFlow::Break(Termination::Undecided),
        };
        if let Some(before) = crossing.before {
            let length = dot(&here.tangent, &differences(&before.z, &here.z));
            self.advance(length, before)?;
        }
        self.turn_corner(crossing.corner, crossing.behind)?;
        *h = (0.5 * reach).max(self.options.min_step);
        ControlFlow::Continue(())
    }

    /// Moves to the end of a step of length `h`, past what happens on the way.
    fn advance(&mut self, h: f64, end: State) -> ControlFlow<Termination> {
        let here = self.here.clone();
        let whole = Stretch {
            from: &here,
            ends: [(0.0, &here), (h, &end)],
        };
        let mut met: Vec<(f64, What, State)> = Vec::new();
        let rate = |s: &State| s.rate();
        let (before, after) = (self.side, rate_sign(&end));
        if before * after < 0.0
            && let Some((at, state)) =
                self.system
                    .zero(whole, &rate, [before.abs().copysign(before), end.rate()])
        {
            met.push((at, What::Turn, state));
        }
        self.side = if after == 0.0 { before } else { after };
        self.zeros_of_monitors(whole, &mut met);
        self.values_of_parameter(whole, &mut met);
        self.closing(whole, &mut met);
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (at, what, state) in met {
            let ahead = if at > 0.0 { arc(&here, &state) } else { 0.0 };
            self.happen(what, &state, ahead)?;
        }
        self.arrive(end)
    }

    fn zeros_of_monitors(&mut self, whole: Stretch<'_>, met: &mut Vec<(f64, What, State)>) {
        let [(_, here), (_, end)] = whole.ends;
        for k in 0..self.monitors.len() {
            let (system, monitor) = (&mut self.system, &self.monitors[k]);
            let sizes = system.sizes().to_vec();
            let value = |s: &State| {
                let x: Vec<f64> = s.z.iter().zip(&sizes).map(|(z, s)| z * s).collect();
                monitor.value(&x)
            };
            let values = [value(here), value(end)];
            let (before, after) = (monitor.side, sign(values[1]));
            if before * after < 0.0 {
                let found = match sign(values[0]) == before {
                    true => system.root(whole, &value, values),
                    // It has vanished since, there for the first time.
                    false => Some((0.0, here.clone())),
                };
                met.extend(found.map(|(at, state)| (at, What::Monitor(k), state)));
            }
            if after != 0.0 {
                self.monitors[k].side = after;
            }
        }
    }

    /// Targets, and bounds of the range, between turns.
    fn values_of_parameter(&mut self, whole: Stretch<'_>, met: &mut Vec<(f64, What, State)>) {
        let turn = met
            .iter()
            .find(|m| matches!(m.1, What::Turn))
            .map(|m| (m.0, m.2.clone()));
        let mut parts = vec![whole];
        if let Some((at, state)) = &turn {
            let [first, last] = whole.ends;
            let with = |ends| Stretch {
                from: whole.from,
                ends,
            };
            parts = vec![with([first, (*at, state)]), with([(*at, state), last])];
        }
        let (lower, upper) = self.options.parameter_range;
        let targets = self.options.targets.clone();
        let wanted = targets.into_iter().map(|a| (a, What::Target));
        for (alpha, what) in wanted.chain([(lower, What::Bound), (upper, What::Bound)]) {
            for part in &parts {
                let value = |s: &State| s.parameter() - alpha;
                let [(_, a), (_, b)] = part.ends;
                let values = [value(a), value(b)];
                // A point that is on the value already was met before.
                let passed = values[0] * values[1] < 0.0 || (values[1] == 0.0 && values[0] != 0.0);
                if !passed {
                    continue;
                }
                if let Some((at, state)) = self.system.zero(*part, &value, values) {
                    met.push((at, what, self.exactly(state, alpha)));
                }
            }
        }
    }

    /// The point near a state at which the parameter has the value.
    fn exactly(&mut self, state: State, alpha: f64) -> State {
        let mut q = state.z.clone();
        let (last, mut row) = (q.len() - 1, vec![0.0; q.len()]);
        (q[last], row[last]) = (alpha, 1.0);
        let moved = (state.parameter() - alpha).abs();
        let found = self.system.correct(&q, &row, moved.max(SIX_DIGITS));
        match found {
            Some(found) => {
                let forward = dot(&found.tangent, &state.tangent) > 0.0;
                let mut found = found.turned(forward);
                found.z[last] = alpha;
                found
            }
            None => state,
        }
    }

    /// Whether the start is met again.
    fn closing(&mut self, whole: Stretch<'_>, met: &mut Vec<(f64, What, State)>) {
        let start = self.start.clone();
        let value = |s: &State| dot(&start.tangent, &differences(&s.z, &start.z));
        let [(_, a), (h, b)] = whole.ends;
        let values = [value(a), value(b)];
        let far = distance(&a.z, &start.z) > 2.0 * h;
        if self.arclength == 0.0 || far || values[0] >= 0.0 || values[1] < 0.0 {
            return;
        }
        if let Some((at, state)) = self.system.zero(whole, &value, values)
            && distance(&state.z, &start.z) <= SIX_DIGITS * (1.0 + norm(&start.z))
            && dot(&state.tangent, &start.tangent) >= self.system.min_cos
        {
            met.push((at, What::Closed, state));
        }
    }

    /// Passes a corner, of no length but for rounding.
    fn turn_corner(&mut self, corner: Option<State>, behind: State) -> ControlFlow<Termination> {
        let here = self.here.clone();
        let (before, after) = (self.side, rate_sign(&behind));
        let turns = before * after < 0.0;
        self.side = if after == 0.0 { before } else { after };
        // Without a corner on the curve, whichever end is nearer.
        let nearest = |value: &dyn Fn(&State) -> f64| {
            let states = corner.iter().chain([&here, &behind]);
            states.min_by(|a, b| value(a).total_cmp(&value(b))).cloned()
        };
        if turns && let Some(state) = nearest(&|s| -before * s.parameter()) {
            self.happen(What::Turn, &state, arc(&here, &state))?;
        } else if let Some(state) = &corner {
            self.emit_at(state, None, arc(&here, state))
                .map_break(|()| Termination::Interrupted)?;
        }
        for k in 0..self.monitors.len() {
            let value = |s: &State| self.monitors[k].value(&self.system.unscaled(&s.z));
            let side = sign(value(&behind));
            if self.monitors[k].side * side < 0.0
                && let Some(state) = nearest(&|s| value(s).abs())
            {
                self.happen(What::Monitor(k), &state, arc(&here, &state))?;
            }
            if side != 0.0 {
                self.monitors[k].side = side;
            }
        }
        let (lower, upper) = self.options.parameter_range;
        let between = |alpha: f64, ends: [f64; 2]| (ends[0] - alpha) * (ends[1] - alpha) < 0.0;
        let ends = [here.parameter(), behind.parameter()];
        for alpha in self.options.targets.clone() {
            if between(alpha, ends) {
                let state = self.exactly(behind.clone(), alpha);
                self.happen(What::Target, &state, arc(&here, &state))?;
            }
        }
        for alpha in [lower, upper] {
            if between(alpha, ends) {
                let state = self.exactly(behind.clone(), alpha);
                self.happen(What::Bound, &state, arc(&here, &state))?;
            }
        }
        self.arrive(behind)
    }

    fn arrive(&mut self, end: State) -> ControlFlow<Termination> {
        let length = arc(&self.here, &end);
        self.arclength += length;
        self.here = end.clone();
        self.emit(&end, None, self.arclength)
            .map_break(|()| Termination::Interrupted)
    }

    /// Notes what is at a point which is that far from here.
    fn happen(&mut self, what: What, state: &State, ahead: f64) -> ControlFlow<Termination> {
        let told = self.emit_at(state, Some(what), ahead);
        match what {
            What::Bound => ControlFlow::Break(Termination::ParameterRange),
            What::Closed => ControlFlow::Break(Termination::Closed),
            What::Monitor(k) if self.monitors[k].stops => ControlFlow::Break(Termination::Monitor),
            _ => told.map_break(|()| Termination::Interrupted),
        }
    }

    fn emit_at(&mut self, state: &State, what: Option<What>, ahead: f64) -> ControlFlow<()> {
        self.emit(state, what, self.arclength + ahead)
    }

    fn emit(&mut self, state: &State, what: Option<What>, arclength: f64) -> ControlFlow<()> {
        let mut tangent = self.system.unscaled(&state.tangent);
        let length = norm(&tangent);
        tangent.iter_mut().for_each(|t| *t /= length);
        let point = Point {
            x: self.system.unscaled(&state.z),
            tangent,
            selection: Selection::uniform(0, 0),
            grazing: Vec::new(),
            arclength,
            residual_norm: state.residual,
            det_sign: None,
            corrections: state.corrections,
            kind: match what {
                _ if self.count() == 0 => PointKind::Start,
                Some(What::Target | What::Bound) => PointKind::Target,
                _ => PointKind::Step,
            },
        };
        let name = match what {
            Some(What::Turn) => TURN,
            Some(What::Monitor(k)) => &self.monitors[k].name,
            _ => "point",
        };
        let told = (self.observe)(&BranchVertex::regular(&point, name));
        match what {
            Some(What::Turn) => self.branch.turns.push(point),
            Some(What::Monitor(monitor)) => self.branch.monitor_crossings.push(MonitorCrossing {
                monitor,
                name: self.monitors[monitor].name.clone(),
                point,
            }),
            _ => self.branch.points.push(point),
        }
        told
    }
}

/// What a point is called at which α turns, at a kink or not.
pub(super) const TURN: &str = "turning point";

/// The first point with its tangent.
fn first(system: &mut System<'_>, x: &[f64], direction: &Direction) -> Result<State, ContinuationError> {
    let z = system.scaled(x);
    let undecided = |wanted, reason: &str| ContinuationError::UndecidedArms {
        wanted,
        found: 0,
        kernel: 0,
        variables: Vec::new(),
        reason: reason.to_owned(),
    };
    let (row, wanted) = match direction {
        Direction::Increasing => (unit(z.len(), 1.0), "increasing parameter"),
        Direction::Decreasing => (unit(z.len(), -1.0), "decreasing parameter"),
        Direction::Along(v) => (system.scaled(v), "a positive component along the given vector"),
    };
    let Some(tangent) = system.kernel(&z, &row) else {
        return Err(undecided(
            wanted,
            "the Jacobian at the start is singular or not finite; start elsewhere",
        ));
    };
    let part = dot(&tangent, &row) / norm(&row);
    if part.abs() <= CHECKED || part.is_nan() {
        return Err(undecided(
            wanted,
            "the tangent of the Jacobian at the start has no part in this direction; give a direction as a vector, or start elsewhere",
        ));
    }
    let residual = system.error(&z, &row, 1.0).map_or(0.0, |found| found.0);
    let state = State {
        z,
        tangent,
        residual,
        corrections: 0,
    };
    Ok(state.turned(part > 0.0))
}

fn unit(m: usize, sign: f64) -> Vec<f64> {
    let mut row = vec![0.0; m];
    row[m - 1] = sign;
    row
}

fn differences(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// The length of an arc that turns evenly between two points: longer than its chord c by c φ²/24 with the angle φ between the tangents.
fn arc(a: &State, b: &State) -> f64 {
    let turned = distance(&a.tangent, &b.tangent).powi(2);
    let bent = if turned < 1.0 { turned / 24.0 } else { 0.0 };
    distance(&a.z, &b.z) * (1.0 + bent)
}

/// The sign of α̇; 0 where the curve is vertical to rounding.
fn rate_sign(state: &State) -> f64 {
    match state.rate().abs() > TANGENTIAL {
        true => sign(state.rate()),
        false => 0.0,
    }
}
