//! A branch as one list of vertices, events merged with regular points.

use super::black_box::TURN;
use super::{Arm, Branch, BranchPoint, Event, Point, Transition};
use crate::piecewise::Selection;

/// A point of a branch, regular or an event, with the state in which the curve leaves it ([`Branch::vertices`]).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BranchVertex<'a> {
    /// Arclength from the start.
    pub arclength: f64,
    /// x = (y, α).
    pub x: &'a [f64],
    /// The kind of point: "point", the name of a [`TransitionKind`](super::TransitionKind), "smooth fold", "branch point", "turning
    /// point" (on curves whose pieces are not known), or the name of a monitor.
    pub event: &'a str,
    /// Unit tangent on departure; where the curve ends, on arrival.
    pub tangent: &'a [f64],
    /// Unit tangent on arrival, in the direction of travel; at the start that of departure.
    pub tangent_before: &'a [f64],
    /// The selection on departure.
    pub selection: &'a Selection,
    /// Sites in whose cell boundary the curve continues, increasing.
    pub grazing: &'a [usize],
    /// Sign of det ∇_yH^(σ) on departure, where it is known; 0 where that is singular.
    pub det_sign: Option<i8>,
    /// The same on arrival; at transitions it is not known.
    pub sign_before: Option<i8>,
}

impl BranchVertex<'_> {
    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }
}

impl<'a> BranchVertex<'a> {
    pub(super) fn regular(point: &'a Point, event: &'a str) -> Self {
        Self {
            arclength: point.arclength,
            x: &point.x,
            event,
            tangent: &point.tangent,
            tangent_before: &point.tangent,
            selection: &point.selection,
            grazing: &point.grazing,
            det_sign: point.det_sign,
            sign_before: point.det_sign,
        }
    }

    fn leaving_along(mut self, arm: Option<&'a Arm>) -> Self {
        if let Some(arm) = arm {
            self.tangent = &arm.tangent;
            self.selection = &arm.selection;
            self.grazing = &arm.grazing;
        }
        self
    }
}

impl<'a> From<&'a Transition> for BranchVertex<'a> {
    fn from(t: &'a Transition) -> Self {
        let vertex = BranchVertex {
            arclength: t.arclength,
            x: &t.x,
            event: t.kind.name(),
            tangent: &t.tangent_after,
            tangent_before: &t.tangent_before,
            selection: &t.after,
            grazing: &[],
            det_sign: t.det_sign,
            sign_before: None,
        };
        vertex.leaving_along(t.followed.and_then(|k| t.arms.get(k)))
    }
}

impl<'a> From<&'a BranchPoint> for BranchVertex<'a> {
    fn from(b: &'a BranchPoint) -> Self {
        BranchVertex::regular(&b.point, "branch point").leaving_along(b.followed.and_then(|k| b.arms.get(k)))
    }
}

impl<'a> From<&'a Event> for BranchVertex<'a> {
    fn from(event: &'a Event) -> Self {
        match event {
            Event::Point(p) => BranchVertex::regular(p, "point"),
            Event::Transition(t) => t.into(),
            Event::SmoothFold(f) => BranchVertex::regular(f, "smooth fold"),
            Event::BranchPoint(b) => b.into(),
            Event::Monitor(m) => BranchVertex::regular(&m.point, &m.name),
        }
    }
}

impl Branch {
    /// All points of the branch in the order in which they are passed: regular ones and events.
    ///
    /// ```
    /// use semismooth::continuation::{Branch, ContinuationOptions, Direction};
    /// use semismooth::piecewise::MinMap;
    /// // α = |y|
    /// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
    ///     a[0] = x[1] - x[0];
    ///     b[0] = x[1] + x[0];
    /// });
    /// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    /// let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Decreasing, options)?;
    /// let vertices = branch.vertices();
    /// assert!(vertices.windows(2).all(|w| w[0].arclength <= w[1].arclength));
    /// let kink = vertices.iter().find(|v| v.event == "fold").unwrap();
    /// assert!(kink.parameter().abs() < 1e-12);
    /// assert_eq!((vertices[0].event, vertices[0].parameter()), ("point", 0.5));
    /// // From the kink on y falls and α grows.
    /// assert!(kink.tangent[0] < 0.0 && kink.tangent[1] > 0.0);
    /// # Ok::<(), semismooth::continuation::ContinuationError>(())
    /// ```
    #[must_use]
    pub fn vertices(&self) -> Vec<BranchVertex<'_>> {
        let points = self.points.iter().map(|p| BranchVertex::regular(p, "point"));
        let transitions = self.transitions.iter().map(BranchVertex::from);
        let folds = self.smooth_folds.iter();
        let folds = folds.map(|f| BranchVertex::regular(f, "smooth fold"));
        let turns = self.turns.iter().map(|f| BranchVertex::regular(f, TURN));
        let branchings = self.branch_points.iter().map(BranchVertex::from);
        let monitors = self.monitor_crossings.iter();
        let monitors = monitors.map(|m| BranchVertex::regular(&m.point, &m.name));
        let events = transitions
            .chain(folds)
            .chain(turns)
            .chain(branchings)
            .chain(monitors);
        let mut all: Vec<_> = points.chain(events).collect();
        all.sort_by(|a, b| a.arclength.total_cmp(&b.arclength));
        all
    }

    /// [`vertices`](Self::vertices) as a line: (arclength, x).
    #[must_use]
    pub fn polyline(&self) -> Vec<(f64, &[f64])> {
        self.vertices().into_iter().map(|v| (v.arclength, v.x)).collect()
    }
}
