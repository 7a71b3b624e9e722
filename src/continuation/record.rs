use std::fmt;

use crate::piecewise::Selection;
use crate::words::{Count, at_parameter};

/// A point of a solution curve.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Point {
    /// x = (y, α).
    pub x: Vec<f64>,
    /// Unit tangent in the direction of travel.
    pub tangent: Vec<f64>,
    /// The selection followed here.
    pub selection: Selection,
    /// Sites at which the curve runs inside the boundary of a cell (grazing), increasing.
    pub grazing: Vec<usize>,
    /// Arclength from the start.
    pub arclength: f64,
    /// ‖H(x)‖₂.
    pub residual_norm: f64,
    /// Sign of det ∇_yH^(σ), where the solver provides determinants; 0 at folds, and where the curve is vertical: where α̇ does not exceed its
    /// rounding error (on polygons, and on arrival at transitions and branch points, 1e-7).
    pub det_sign: Option<i8>,
    /// Number of corrections spent on it.
    pub corrections: usize,
    /// Why this point was computed.
    pub kind: PointKind,
}

impl Point {
    /// The parameter α, the last entry of x.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }
}

/// Why a point was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PointKind {
    /// The first point.
    Start,
    /// The end of a step.
    Step,
    /// A requested parameter value (or a bound of the parameter range), hit exactly.
    Target,
}

impl fmt::Display for PointKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Start => "start",
            Self::Step => "step",
            Self::Target => "target",
        })
    }
}

/// What kind of point a [`Transition`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum TransitionKind {
    /// The active selection changes, α keeps its direction.
    PassThrough,
    /// A non-smooth fold: the active selection changes and α turns.
    Fold,
    /// The curve enters a vertical segment: α is constant beyond the point.
    VerticalBegin,
    /// The curve leaves a vertical segment.
    VerticalEnd,
    /// More than two arms leave the point.
    Branching,
    /// No arm leaves the point but the one along which the curve arrived.
    End,
    /// No other arm was found, and the search was not complete.
    Undecided,
}

impl TransitionKind {
    /// The kind in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PassThrough => "pass-through",
            Self::Fold => "fold",
            Self::VerticalBegin => "vertical segment begins",
            Self::VerticalEnd => "vertical segment ends",
            Self::Branching => "branching",
            Self::End => "end",
            Self::Undecided => "undecided",
        }
    }
}

impl fmt::Display for TransitionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An arm of the solution set at a point: a selection and a direction along which its curve leaves the point.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Arm {
    /// The selection to freeze.
    pub selection: Selection,
    /// Unit tangent, pointing away from the point.
    pub tangent: Vec<f64>,
    /// Sites in whose cell boundary the arm runs (grazing), increasing.
    pub grazing: Vec<usize>,
    /// Sign of α − α* along the arm, α* the parameter of the point: that of the first order of its expansion in which α moves; 0 where α is
    /// constant along it, a vertical segment.
    pub direction: i8,
    /// Sign of det ∇_yH^(σ) along the arm, where the solver provides determinants; 0 on vertical segments.
    pub det_sign: Option<i8>,
    /// A corrected point of the arm next to the point, where its tangent does not tell it from others; else empty.
    pub(super) probe: Vec<f64>,
    /// The power of the distance with which ∇H becomes regular along the arm, where it is singular at the point: 1 where curves cross, more
    /// where they touch. 0 where that was not found.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) order: f64,
}

impl Arm {
    /// The arm along a tangent that is known to first order.
    pub(super) fn along(
        selection: Selection,
        tangent: Vec<f64>,
        grazing: Vec<usize>,
        det_sign: Option<i8>,
    ) -> Self {
        let rate = tangent.last().copied().unwrap_or(0.0);
        let direction = match det_sign {
            Some(0) => 0,
            _ if rate == 0.0 => 0,
            _ => rate.signum() as i8,
        };
        Self {
            selection,
            tangent,
            grazing,
            direction,
            det_sign,
            probe: Vec::new(),
            order: 0.0,
        }
    }
}

/// A site whose piece changes at a transition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SiteChange {
    /// The site, from 0.
    pub site: usize,
    /// Its piece before.
    pub from: usize,
    /// Its piece after; the same as before at an end, or where the curve is stopped at a branching.
    pub to: usize,
}

/// A transition point: the active selection changes here.
///
/// ```
/// use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
/// use semismooth::piecewise::MinMap;
/// // α = min(y, 2 y − 1): 2 y − 1 below y = 1, y above.
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[0] - x[1];
///     b[0] = 2.0 * x[0] - 1.0 - x[1];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
/// let branch = Branch::follow(&map, &[0.5, 0.0], Direction::Increasing, options)?;
/// let kink = &branch.transitions[0];
/// assert_eq!(kink.kind, TransitionKind::PassThrough);
/// assert!((kink.x[0] - 1.0).abs() < 1e-12 && (kink.parameter() - 1.0).abs() < 1e-12);
/// assert_eq!((kink.before.piece(0), kink.after.piece(0)), (1, 0));
/// // The slope dy/dα doubles.
/// let slope = |tangent: &[f64]| tangent[0] / tangent[1];
/// assert!((slope(&kink.tangent_before) - 0.5).abs() < 1e-12);
/// assert!((slope(&kink.tangent_after) - 1.0).abs() < 1e-12);
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Transition {
    /// x = (y, α), located to rounding.
    pub x: Vec<f64>,
    /// Unit tangent on arrival.
    pub tangent_before: Vec<f64>,
    /// Unit tangent on departure; that of arrival where the curve ends or stops.
    pub tangent_after: Vec<f64>,
    /// Selection on arrival.
    pub before: Selection,
    /// Selection on departure.
    pub after: Selection,
    /// The sites that have a vanishing test function, with their pieces; those whose piece changes come first.
    pub sites: Vec<SiteChange>,
    /// All test functions of all sites at x, in the order of the map.
    pub test_functions: Vec<f64>,
    /// Positions of the vanishing ones.
    pub vanishing: Vec<usize>,
    /// The kind of transition.
    pub kind: TransitionKind,
    /// All arms that leave x, but the one on which the curve arrived. The curve continues along `followed`.
    pub arms: Vec<Arm>,
    /// The arm along which the curve arrived, as it leaves the point.
    pub arrival: Arm,
    /// Index in `arms` of the arm that is followed, if any.
    pub followed: Option<usize>,
    /// Whether all active selections were examined and none is undecided, within tolerances: no limit was reached.
    /// [`all_arms`](crate::enumeration::all_arms) proves the list complete, or gives the reason why it cannot.
    pub complete: bool,
    /// Sign of det ∇_yH^(σ) on departure, where an arm is followed and the solver provides determinants; 0 on vertical segments.
    pub det_sign: Option<i8>,
    /// ‖H(x)‖₂.
    pub residual_norm: f64,
    /// Arclength from the start.
    pub arclength: f64,
}

impl Transition {
    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }

    /// Whether α turns here.
    #[must_use]
    pub fn is_fold(&self) -> bool {
        self.kind == TransitionKind::Fold
    }
}

/// "fold at parameter 2.5, site 3: piece 0 to 1": in one line.
impl fmt::Display for Transition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        at_parameter(f, &self.kind, self.parameter())?;
        for change in self.sites.iter().filter(|c| c.from != c.to) {
            write!(
                f,
                ", site {}: piece {} to {}",
                change.site, change.from, change.to
            )?;
        }
        Ok(())
    }
}

/// A point where the Jacobian of a selection loses rank along the curve, so that further arms may leave.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BranchPoint {
    /// The point on the curve.
    pub point: Point,
    /// The selection whose Jacobian is singular (the followed one, or one co-active on a grazing curve).
    pub singular: Selection,
    /// All arms that leave, but the one on which the curve arrived.
    pub arms: Vec<Arm>,
    /// The arm along which the curve arrived, as it leaves the point.
    pub arrival: Arm,
    /// Index in `arms` of the arm that is followed, if any.
    pub followed: Option<usize>,
    /// Whether all active selections were examined and their branching equations decided, within tolerances.
    pub complete: bool,
}

/// A zero of a monitor function on the curve ([`with_monitor`](super::Continuation::with_monitor)).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MonitorCrossing {
    /// Number of the function, in the order in which they were added.
    pub monitor: usize,
    /// Its name.
    pub name: String,
    /// The point.
    pub point: Point,
}

/// An item of the iterator.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Event {
    /// A regular point.
    Point(Point),
    /// A transition point.
    Transition(Transition),
    /// A point inside a piece where the parameter turns (∇_yH^(σ) singular, quadratic tangency).
    SmoothFold(Point),
    /// A branch point inside a piece or of a grazing curve.
    BranchPoint(BranchPoint),
    /// A zero of a monitor function.
    Monitor(MonitorCrossing),
}

impl Event {
    /// x = (y, α) of the event.
    #[must_use]
    pub fn x(&self) -> &[f64] {
        match self {
            Self::Point(p) => &p.x,
            Self::Transition(t) => &t.x,
            Self::SmoothFold(p) => &p.x,
            Self::BranchPoint(b) => &b.point.x,
            Self::Monitor(m) => &m.point.x,
        }
    }

    /// Arclength from the start.
    #[must_use]
    pub fn arclength(&self) -> f64 {
        match self {
            Self::Point(p) => p.arclength,
            Self::Transition(t) => t.arclength,
            Self::SmoothFold(p) => p.arclength,
            Self::BranchPoint(b) => b.point.arclength,
            Self::Monitor(m) => m.point.arclength,
        }
    }

    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x().last().copied().unwrap_or(f64::NAN)
    }
}

/// "step at parameter 0.5": in one line.
impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        at_parameter(f, &self.kind, self.parameter())
    }
}

/// "branch point at parameter 0.5, 3 arms leave": in one line; "at least" where the list of arms is not known to be complete.
impl fmt::Display for BranchPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        at_parameter(f, &"branch point", self.point.parameter())?;
        let least = if self.complete { "" } else { "at least " };
        write!(
            f,
            ", {least}{}",
            Count(self.arms.len(), "arm leaves", "arms leave")
        )
    }
}

/// "zero of energy at parameter 0.5": in one line.
impl fmt::Display for MonitorCrossing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        at_parameter(f, &format_args!("zero of {}", self.name), self.point.parameter())
    }
}

/// The event in one line.
impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Point(point) => point.fmt(f),
            Self::Transition(transition) => transition.fmt(f),
            Self::SmoothFold(point) => at_parameter(f, &"smooth fold", point.parameter()),
            Self::BranchPoint(point) => point.fmt(f),
            Self::Monitor(crossing) => crossing.fmt(f),
        }
    }
}

/// Why a curve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Termination {
    /// α reached a bound of its range.
    ParameterRange,
    /// No arm continues the curve from the last transition.
    End,
    /// No arm that continues the curve from the last transition was found, and the search was not complete.
    Undecided,
    /// Several arms leave the last point and none goes straight on; start again along one of them.
    Branching,
    /// The curve closed: the start was met again.
    Closed,
    /// The limit on points.
    PointLimit,
    /// The limit on arclength.
    ArclengthLimit,
    /// The limit on ‖x‖: the curve tends to infinity (a pole).
    Unbounded,
    /// The limit on time.
    TimeLimit,
    /// No step of at least the smallest length was accepted.
    StepTooSmall,
    /// The orientation changes within the smallest step, and no branch point accurate to rounding explains it: two curves cross or pass
    /// each other there; which of the two is not decided. Or ∇H becomes singular without a change of the orientation, and the point was
    /// not located: where curves touch or more than two meet in more than 60 unknowns, or where rounding hides it. Neither a branch point
    /// nor the end of the curve.
    UnresolvedCrossing,
    /// A monitor function that ends the curve vanished.
    Monitor,
    /// The user stopped.
    Interrupted,
}

impl Termination {
    /// The reason in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ParameterRange => "bound of the parameter",
            Self::End => "end of the branch",
            Self::Undecided => "arms undecided",
            Self::Branching => "branching",
            Self::Closed => "closed curve",
            Self::PointLimit => "point limit",
            Self::ArclengthLimit => "arclength limit",
            Self::Unbounded => "tends to infinity",
            Self::TimeLimit => "time limit",
            Self::StepTooSmall => "step too small",
            Self::UnresolvedCrossing => "crossing not resolved",
            Self::Monitor => "zero of a monitor",
            Self::Interrupted => "interrupted",
        }
    }
}

impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
