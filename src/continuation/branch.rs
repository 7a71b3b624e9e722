use std::fmt;
use std::ops::ControlFlow;

use super::engine::Curve;
use super::{
    Arm, BranchPoint, Continuation, ContinuationError, ContinuationOptions, Direction, Event,
    MonitorCrossing, Point, Termination, Transition,
};
use crate::linear::LinearSolver;
use crate::piecewise::PiecewiseSmooth;
use crate::words::Count;

/// A part of a solution curve with its events, collected.
///
/// ```
/// use semismooth::continuation::{Branch, ContinuationOptions, Direction};
/// use semismooth::piecewise::MinMap;
/// // min(α − y, α + y) = 0, that is α = |y|, from y = 1 to y = −1: one kink, where α turns.
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let branch = Branch::follow(&map, &[1.0, 1.0], Direction::Decreasing, options)?;
/// assert_eq!(branch.to_string(), "1 transition, 1 fold, 0 branch points; bound of the parameter");
/// assert!(branch.folds()[0].abs() < 1e-12);
/// let end = branch.points.last().expect("the start at least");
/// assert!((end.x[0] + 1.0).abs() < 1e-12 && end.parameter() == 1.0);
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Branch {
    /// Regular points, by arclength.
    pub points: Vec<Point>,
    /// Transition points, by arclength.
    pub transitions: Vec<Transition>,
    /// Smooth folds, by arclength.
    pub smooth_folds: Vec<Point>,
    /// Where the pieces are not known ([`BlackBoxCurve`](super::BlackBoxCurve)): the points at which α turns, smooth folds or corners.
    #[cfg_attr(feature = "serde", serde(default))]
    pub turns: Vec<Point>,
    /// Whether the pieces are not known: there may be transitions and branch points then although none are listed.
    #[cfg_attr(feature = "serde", serde(default))]
    pub is_black_box: bool,
    /// Branch points inside pieces or of grazing curves, by arclength.
    pub branch_points: Vec<BranchPoint>,
    /// Zeros of monitor functions, by arclength.
    #[cfg_attr(feature = "serde", serde(default))]
    pub monitor_crossings: Vec<MonitorCrossing>,
    /// Why the branch ended.
    pub termination: Termination,
    /// Number of factorisations.
    pub factorisations: usize,
    /// Number of factorisations saved by updates (affine pieces).
    pub updates: usize,
    /// Number of correction steps.
    pub corrections: usize,
}

impl Branch {
    /// Follows a curve to its end.
    ///
    /// # Complexity
    /// A step takes one to [`max_corrections`](ContinuationOptions::max_corrections) factorisations of ∇H with n residuals, two or three as
    /// a rule: O(n³) dense, less by the fill-in if sparse. Where all pieces are affine a transition replaces the rows of the site that
    /// changes, O(n²). A branch point inside a piece takes about ten more factorisations. Where p sites with k pieces each switch at
    /// once there are up to kᵖ selections to try; see [`arms_at`](super::arms_at).
    ///
    /// # Errors
    /// As [`Continuation::new`] and its iteration.
    ///
    /// ```
    /// use semismooth::continuation::{Branch, ContinuationOptions, Direction};
    /// use semismooth::piecewise::MinMap;
    /// // The smooth fold y² + α = 0.
    /// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
    ///     a[0] = x[0] * x[0] + x[1];
    ///     b[0] = 1e9;
    /// });
    /// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    /// let branch = Branch::follow(&map, &[1.0, -1.0], Direction::Increasing, options)?;
    /// assert_eq!(branch.smooth_folds.len(), 1);
    /// assert!(branch.smooth_folds[0].parameter().abs() < 1e-10);
    /// # Ok::<(), semismooth::continuation::ContinuationError>(())
    /// ```
    pub fn follow<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
    ) -> Result<Self, ContinuationError> {
        Self::collect(Continuation::new(map, x, direction, options)?, |_| {
            ControlFlow::Continue(())
        })
    }

    /// Follows an arm to its end.
    ///
    /// # Errors
    /// As [`Continuation::along_arm`] and its iteration.
    pub fn follow_arm<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        x: &[f64],
        arm: &Arm,
        options: ContinuationOptions,
    ) -> Result<Self, ContinuationError> {
        Self::collect(Continuation::along_arm(map, x, arm, options)?, |_| {
            ControlFlow::Continue(())
        })
    }

    /// Collects the remaining events of a continuation; `observe` is called with every event and may stop.
    ///
    /// # Errors
    /// As the iteration.
    pub fn collect<P: PiecewiseSmooth + ?Sized, L: LinearSolver>(
        mut curve: Continuation<'_, P, L>,
        mut observe: impl FnMut(&Event) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError> {
        Self::gathered(curve.curve.erased_mut(), &mut observe)
    }

    fn gathered(
        curve: &mut Curve<'_>,
        observe: &mut dyn FnMut(&Event) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError> {
        let mut branch = Self::empty(false);
        // Events found in the same step as one at which the observer stops are kept without being passed to it.
        let mut stopped = false;
        while let Some(event) = curve.next_event() {
            let event = event?;
            if !stopped && observe(&event).is_break() {
                stopped = true;
                curve.stop();
            }
            match event {
                Event::Point(p) => branch.points.push(p),
                Event::Transition(t) => branch.transitions.push(t),
                Event::SmoothFold(f) => branch.smooth_folds.push(f),
                Event::BranchPoint(b) => branch.branch_points.push(b),
                Event::Monitor(m) => branch.monitor_crossings.push(m),
            }
        }
        branch.termination = curve.termination().unwrap_or(Termination::Interrupted);
        branch.factorisations = curve.factorisations();
        branch.updates = curve.updates();
        branch.corrections = curve.corrections();
        Ok(branch)
    }

    fn empty(is_black_box: bool) -> Self {
        Self {
            points: Vec::new(),
            transitions: Vec::new(),
            smooth_folds: Vec::new(),
            turns: Vec::new(),
            is_black_box,
            branch_points: Vec::new(),
            monitor_crossings: Vec::new(),
            termination: Termination::Interrupted,
            factorisations: 0,
            updates: 0,
            corrections: 0,
        }
    }

    /// A branch whose pieces are not known, before its first point.
    pub(super) fn black_box() -> Self {
        Self::empty(true)
    }

    /// Arclength of the branch.
    #[must_use]
    pub fn arclength(&self) -> f64 {
        let ends = [
            self.points.last().map(|p| p.arclength),
            self.transitions.last().map(|t| t.arclength),
        ];
        ends.into_iter().flatten().fold(0.0, f64::max)
    }

    /// Parameters of all folds, smooth or not, by arclength.
    #[must_use]
    pub fn folds(&self) -> Vec<f64> {
        let kinks = self
            .transitions
            .iter()
            .filter(|t| t.is_fold())
            .map(|t| (t.arclength, t.parameter()));
        let smooth = self.smooth_folds.iter().chain(&self.turns);
        let smooth = smooth.map(|f| (f.arclength, f.parameter()));
        let mut all: Vec<_> = kinks.chain(smooth).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.into_iter().map(|f| f.1).collect()
    }
}

/// "36 transitions, 2 folds, 0 branch points; bound of the parameter": in one line.
impl fmt::Display for Branch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_black_box {
            let turns = Count(self.turns.len(), "turning point", "turning points");
            return write!(f, "{turns}, pieces not known; {}", self.termination);
        }
        write!(
            f,
            "{}, {}, {}; {}",
            Count(self.transitions.len(), "transition", "transitions"),
            Count(self.folds().len(), "fold", "folds"),
            Count(self.branch_points.len(), "branch point", "branch points"),
            self.termination
        )
    }
}
