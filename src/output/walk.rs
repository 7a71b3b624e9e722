//! A branch as one list of vertices, events merged with regular points.

use crate::continuation::{Arm, Branch, BranchPoint, Event, Point, Transition};
use crate::piecewise::Selection;

/// A vertex of a branch, with the state in which the curve leaves it.
pub(super) struct Vertex<'a> {
    pub(super) arclength: f64,
    pub(super) x: &'a [f64],
    pub(super) event: &'a str,
    pub(super) selection: &'a Selection,
    pub(super) grazing: &'a [usize],
    /// Signs of det ∇_yH on arrival and on departure, where known.
    pub(super) det_signs: [Option<i8>; 2],
}

impl<'a> Vertex<'a> {
    fn regular(point: &'a Point, event: &'a str) -> Self {
        Self {
            arclength: point.arclength,
            x: &point.x,
            event,
            selection: &point.selection,
            grazing: &point.grazing,
            det_signs: [point.det_sign; 2],
        }
    }

    fn leaving_along(mut self, arm: Option<&'a Arm>) -> Self {
        if let Some(arm) = arm {
            self.selection = &arm.selection;
            self.grazing = &arm.grazing;
        }
        self
    }
}

impl<'a> From<&'a Transition> for Vertex<'a> {
    fn from(t: &'a Transition) -> Self {
        let vertex = Vertex {
            arclength: t.arclength,
            x: &t.x,
            event: t.kind.name(),
            selection: &t.after,
            grazing: &[],
            det_signs: [None, t.det_sign],
        };
        vertex.leaving_along(t.followed.and_then(|k| t.arms.get(k)))
    }
}

impl<'a> From<&'a BranchPoint> for Vertex<'a> {
    fn from(b: &'a BranchPoint) -> Self {
        Vertex::regular(&b.point, "branch point").leaving_along(b.followed.and_then(|k| b.arms.get(k)))
    }
}

impl<'a> From<&'a Event> for Vertex<'a> {
    fn from(event: &'a Event) -> Self {
        match event {
            Event::Point(p) => Vertex::regular(p, "point"),
            Event::Transition(t) => t.into(),
            Event::SmoothFold(f) => Vertex::regular(&f.point, "smooth fold"),
            Event::BranchPoint(b) => b.into(),
            Event::Monitor(m) => Vertex::regular(&m.point, &m.name),
        }
    }
}

/// All vertices by arclength.
pub(super) fn vertices(branch: &Branch) -> Vec<Vertex<'_>> {
    let points = branch.points.iter().map(|p| Vertex::regular(p, "point"));
    let transitions = branch.transitions.iter().map(Vertex::from);
    let folds = branch
        .smooth_folds
        .iter()
        .map(|f| Vertex::regular(&f.point, "smooth fold"));
    let branchings = branch.branch_points.iter().map(Vertex::from);
    let monitors = branch.monitor_crossings.iter();
    let monitors = monitors.map(|m| Vertex::regular(&m.point, &m.name));
    let events = transitions.chain(folds).chain(branchings).chain(monitors);
    let mut all: Vec<_> = points.chain(events).collect();
    all.sort_by(|a, b| a.arclength.total_cmp(&b.arclength));
    all
}
