//! Following every arm of every vertex.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use super::arc::{Arc, kind_of_slots, reversed};
use super::natural::{natural_observer, scaled_options, scaled_starts};
use super::split::Stretch;
use super::{Diagram, DiagramEdge, DiagramOptions, DiagramVertex, EdgeEnd, Limit, VertexArm, VertexKind};
use crate::clock::Clock;
use crate::continuation::engine::Curve;
use crate::continuation::start::{slices, solver};
use crate::continuation::{
    Arm, ContinuationError, Event, MonitorCrossing, Point, PointKind, Strategy, Termination,
};
use crate::newton::MoorePenrose;
use crate::piecewise::{PiecewiseSmooth, Scaled};
use crate::sparse::{distance, norm};

/// Progress of an exploration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Progress<'a> {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of edges.
    pub edges: usize,
    /// Number of arms known and not followed yet, without those of the current curve.
    pub pending: usize,
    /// Number of points computed.
    pub points: usize,
    /// The current event.
    pub event: &'a Event,
}

impl Diagram {
    /// Follows the curves through `starts` in both directions, and all arms found on them.
    ///
    /// Starts are corrected onto the curve at their α. A start on a curve known already splits its edge in two.
    ///
    /// # Complexity
    /// Each curve costs what [`Branch::follow`](crate::continuation::Branch::follow) does. Every point met is compared with all V vertices
    /// known, every start with all P points, so that diagrams of V vertices take O(V² m) and s starts O(s P m) on top, m variables.
    ///
    /// # Errors
    /// Options out of range; starts of the wrong length, outside the range of the parameter or the domain, or from which Newton's
    /// method finds no solution. Later failures are reported by [`completeness`](Self::completeness).
    pub fn explore<P, S>(map: &P, starts: &[S], options: &DiagramOptions) -> Result<Self, ContinuationError>
    where
        P: PiecewiseSmooth + ?Sized,
        S: AsRef<[f64]>,
    {
        Self::explore_from(&map, &slices(starts), options, &mut |_| ControlFlow::Continue(()))
    }

    /// [`explore`](Self::explore), reporting every event to `observe`, which may stop.
    ///
    /// # Errors
    /// As [`explore`](Self::explore).
    pub fn explore_observed<P, S>(
        map: &P,
        starts: &[S],
        options: &DiagramOptions,
        mut observe: impl FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError>
    where
        P: PiecewiseSmooth + ?Sized,
        S: AsRef<[f64]>,
    {
        Self::explore_from(&map, &slices(starts), options, &mut observe)
    }

    fn explore_from(
        map: &dyn PiecewiseSmooth,
        starts: &[&[f64]],
        options: &DiagramOptions,
        observe: Observer<'_>,
    ) -> Result<Self, ContinuationError> {
        options.validate()?;
        let inner = &options.continuation;
        let scaled = Scaled::new(map, &inner.typical_sizes, inner.parameter_range)?;
        let inner = scaled_options(&scaled, options);
        let diagram = Self {
            range: inner.continuation.parameter_range,
            same_point: options.same_point,
            ..Self::default()
        };
        let mut explorer = Explorer::new(&scaled, diagram, inner, natural_observer(&scaled, observe));
        explorer.run(Vec::new(), &scaled_starts(&scaled, starts))?;
        let mut diagram = explorer.diagram;
        diagram.unscale(&scaled);
        Ok(diagram)
    }
}

/// Sees every event of an exploration, and may stop it.
pub(super) type Observer<'o> = &'o mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>;

pub(super) struct Explorer<'m, O> {
    pub(super) map: &'m dyn PiecewiseSmooth,
    pub(super) diagram: Diagram,
    pub(super) options: DiagramOptions,
    pending: VecDeque<EdgeEnd>,
    clock: Clock,
    halted: bool,
    observe: O,
}

/// What a curve that arrives at a vertex finds there.
pub(super) struct Meeting<'e> {
    pub(super) x: &'e [f64],
    pub(super) kind: Option<VertexKind>,
    pub(super) incoming: Arm,
    pub(super) others: &'e [Arm],
    pub(super) followed: Option<usize>,
    pub(super) complete: bool,
}

impl<'m, O: FnMut(&Progress<'_>) -> ControlFlow<()>> Explorer<'m, O> {
    pub(super) fn new(
        map: &'m dyn PiecewiseSmooth,
        diagram: Diagram,
        mut options: DiagramOptions,
        observe: O,
    ) -> Self {
        options.continuation.strategy = Strategy::Located;
        Self {
            map,
            diagram,
            options,
            pending: VecDeque::new(),
            clock: Clock::start(),
            halted: false,
            observe,
        }
    }

    /// Follows the arms that are pending, then those of the starts.
    pub(super) fn run<S: AsRef<[f64]>>(
        &mut self,
        pending: Vec<EdgeEnd>,
        starts: &[S],
    ) -> Result<(), ContinuationError> {
        self.pending.extend(pending);
        self.follow_pending();
        for start in starts {
            self.start(start.as_ref())?;
            self.follow_pending();
        }
        self.conclude();
        Ok(())
    }

    fn start(&mut self, x: &[f64]) -> Result<(), ContinuationError> {
        let options = self.options.continuation.clone();
        let mut curve = Curve::prepare(self.map, x, options, Box::new(solver()))?;
        let curve = curve.erased_mut();
        let x = curve.here.x.clone();
        let known = match curve.tangent_here()? {
            Some(t) => self.diagram.vertex_at(self.map, (&x, &curve.path.selection), &t),
            None => self.diagram.vertex_near(&x),
        };
        if let Some(v) = known {
            self.diagram.vertices[v].is_start = true;
            return Ok(());
        }
        if self.diagram.split_at(self.map, (&x, &curve.path.selection))? {
            return Ok(());
        }
        let (arms, certainty) = curve.arms_of_start()?;
        let x = curve.here.x.clone();
        let mut kind = arms.kind();
        if let (VertexKind::PassThrough, [a, b]) = (kind, arms.list.as_slice())
            && a.selection == b.selection
        {
            kind = VertexKind::Start;
        }
        if let (VertexKind::Branching, Some(arm)) = (kind, arms.list.first())
            && curve.is_singular_here(&arm.selection)?
        {
            kind = VertexKind::BranchPoint;
        }
        if kind == VertexKind::Isolated && certainty.is_undecided() {
            // That no arm was found does not say that there is none.
            kind = VertexKind::Start;
        }
        let v = self.add_vertex(DiagramVertex {
            x,
            kind,
            is_start: true,
            // The directions of a continuum are not listed as arms.
            complete: arms.complete && arms.continua.is_empty(),
            certainty,
            arms: arms.list.into_iter().map(VertexArm::new).collect(),
        });
        // Both directions of the start come first: later curves must not pass it unnoticed.
        let ends = (0..self.diagram.vertices[v].arms.len()).map(|arm| EdgeEnd { vertex: v, arm });
        self.pending.extend(ends);
        Ok(())
    }

    pub(super) fn add_vertex(&mut self, vertex: DiagramVertex) -> usize {
        let v = self.diagram.vertices.len();
        let followed_up = !matches!(vertex.kind, VertexKind::Limit(_));
        if !vertex.complete && followed_up {
            self.diagram.completeness.add(Limit::Arms { vertex: v });
        }
        self.diagram.vertices.push(vertex);
        v
    }

    fn follow_pending(&mut self) {
        while let Some(end) = self.pending.pop_front() {
            if self.halted {
                continue;
            }
            // An arm that turned out to be none is no longer there.
            let arm = self.diagram.vertices[end.vertex].arms.get(end.arm);
            if arm.is_none_or(|arm| arm.edge.is_some() || arm.outside) {
                continue;
            }
            if self.leaves_range(end) {
                self.diagram.vertices[end.vertex].arms[end.arm].outside = true;
                continue;
            }
            let used = self.diagram.points;
            let late = self
                .options
                .continuation
                .max_time
                .is_some_and(|t| self.clock.elapsed() >= t);
            let limit = if self.diagram.edges.len() >= self.options.max_edges {
                Limit::EdgeLimit
            } else if used >= self.options.max_points {
                Limit::PointLimit
            } else if late {
                Limit::TimeLimit
            } else {
                self.follow(end);
                continue;
            };
            self.halt(limit);
        }
    }

    fn halt(&mut self, limit: Limit) {
        self.diagram.completeness.add(limit);
        self.halted = true;
    }

    /// The length of a curve that lies within a vertex at x.
    fn width(&self, x: &[f64]) -> f64 {
        4.0 * self.options.same_point * (1.0 + norm(x))
    }

    /// Whether an arm at a bound of the parameter points outwards.
    fn leaves_range(&self, end: EdgeEnd) -> bool {
        let vertex = &self.diagram.vertices[end.vertex];
        let (lower, upper) = self.diagram.range;
        let Arm {
            direction, tangent, ..
        } = &vertex.arms[end.arm].arm;
        // The vertex is known to its width only: a bound that the arm meets within it is met at the vertex.
        let rate = tangent.last().map_or(0.0, |rate| rate.abs());
        let within = rate * self.width(&vertex.x);
        let near = |bound: f64| {
            bound.is_finite() && (vertex.parameter() - bound).abs() <= within.max(1e-12 * (1.0 + bound.abs()))
        };
        (near(upper) && *direction > 0) || (near(lower) && *direction < 0)
    }

    /// Follows a curve from a vertex until it ends or reaches a known vertex or edge.
    fn follow(&mut self, end: EdgeEnd) {
        let vertex = &self.diagram.vertices[end.vertex];
        let mut options = self.options.continuation.clone();
        options.max_points = options
            .max_points
            .min(self.options.max_points - self.diagram.points)
            .max(1);
        options.max_time = options.max_time.map(|t| t.saturating_sub(self.clock.elapsed()));
        let arm = vertex.arms[end.arm].arm.clone();
        let singular = vertex.kind == VertexKind::BranchPoint;
        let mut curve = match Curve::along_arm_from(self.map, &vertex.x, &arm, singular, options) {
            Ok(curve) => curve,
            Err(error) => {
                let vertex = end.vertex;
                return self.diagram.completeness.add(Limit::Failed { vertex, error });
            }
        };
        let curve = curve.erased_mut();
        let mut arc = Arc::new(end, curve.point_here(PointKind::Start, 0));
        let mut failure = None;
        while let Some(event) = curve.next_event() {
            let event = match event {
                Ok(event) => event,
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            };
            self.diagram.points += 1;
            let report = Progress {
                vertices: self.diagram.vertices.len(),
                edges: self.diagram.edges.len(),
                pending: self.pending.len(),
                points: self.diagram.points,
                event: &event,
            };
            if (self.observe)(&report).is_break() {
                curve.stop();
                self.halt(Limit::Interrupted);
            }
            let next = match event {
                Event::Point(p) if p.kind == PointKind::Start => continue,
                Event::Point(point) | Event::Monitor(MonitorCrossing { point, .. }) => {
                    arc.push(point);
                    continue;
                }
                Event::SmoothFold(f) => {
                    arc.smooth_folds.push(arc.points.len());
                    arc.push(f);
                    continue;
                }
                Event::Transition(t) => {
                    let Some(point) =
                        arc.last_point(&t.x, &t.tangent_before, t.arclength - arc.base, t.residual_norm)
                    else {
                        return;
                    };
                    let meeting = Meeting {
                        x: &t.x,
                        kind: None,
                        incoming: t.arrival.clone(),
                        others: &t.arms,
                        followed: t.followed,
                        complete: t.complete,
                    };
                    self.meet(&mut arc, point, meeting)
                }
                Event::BranchPoint(b) => {
                    let mut point = b.point.clone();
                    point.arclength -= arc.base;
                    let meeting = Meeting {
                        x: &b.point.x,
                        kind: (b.arms.len() > 1).then_some(VertexKind::BranchPoint),
                        incoming: b.arrival.clone(),
                        others: &b.arms,
                        followed: b.followed,
                        complete: b.complete,
                    };
                    self.meet(&mut arc, point, meeting)
                }
            };
            match next {
                Some(end) if !self.halted => arc = Arc::new(end, curve.point_here(PointKind::Start, 0)),
                _ => return,
            }
        }
        let termination = curve.termination().unwrap_or(Termination::Interrupted);
        self.end(arc, termination, failure);
    }

    /// Ends the current arc at a vertex; gives the arm on which the curve continues, unless its edge is known.
    fn meet(&mut self, arc: &mut Arc, point: Point, meeting: Meeting<'_>) -> Option<EdgeEnd> {
        // Facets that vanish within rounding of each other are met one after the other: one vertex.
        if self.diagram.vertex_near(meeting.x) == Some(arc.from.vertex)
            && point.arclength <= self.width(meeting.x)
        {
            return self.meet_again(arc.from, &meeting);
        }
        let place = (meeting.x, &meeting.incoming.selection);
        let known = self.diagram.vertex_at(self.map, place, &meeting.incoming.tangent);
        let (v, incoming, others) = match known {
            Some(v) => {
                let incoming = self.slot_of_arrival(v, arc, &point, &meeting.incoming);
                let others = meeting.others.iter().map(|a| self.slot(v, a));
                (v, incoming, others.collect::<Vec<usize>>())
            }
            None => {
                let arms = std::iter::once(&meeting.incoming).chain(meeting.others);
                let v = self.add_vertex(DiagramVertex {
                    x: meeting.x.to_vec(),
                    kind: VertexKind::Start,
                    is_start: false,
                    arms: arms.cloned().map(VertexArm::new).collect(),
                    complete: meeting.complete,
                    certainty: self.certainty_of(&meeting),
                });
                (v, 0, (1..=meeting.others.len()).collect())
            }
        };
        let vertex = &mut self.diagram.vertices[v];
        vertex.kind = match meeting.kind {
            Some(kind) => kind,
            None if vertex.kind == VertexKind::BranchPoint => VertexKind::BranchPoint,
            None => kind_of_slots(&vertex.arms),
        };
        arc.points.push(point);
        let to = EdgeEnd {
            vertex: v,
            arm: incoming,
        };
        if !self.close(arc, to) {
            return None;
        }
        let onward = meeting.followed.map(|k| others[k]);
        for &arm in others.iter().filter(|a| Some(**a) != onward) {
            self.pending.push_back(EdgeEnd { vertex: v, arm });
        }
        let end = EdgeEnd {
            vertex: v,
            arm: onward?,
        };
        let full = self.diagram.edges.len() >= self.options.max_edges;
        if full || self.leaves_range(end) {
            self.pending.push_back(end);
            return None;
        }
        let free = self.diagram.vertices[v].arms[end.arm].edge.is_none();
        free.then_some(end)
    }

    /// Puts the arms that leave a further facet at a vertex in the place of the arm that led to this facet; gives the one on which the
    /// curve continues.
    fn meet_again(&mut self, end: EdgeEnd, meeting: &Meeting<'_>) -> Option<EdgeEnd> {
        let v = end.vertex;
        let first = meeting.followed.unwrap_or(0);
        let vertex = &mut self.diagram.vertices[v];
        match meeting.others.get(first) {
            Some(onward) => vertex.arms[end.arm].arm = onward.clone(),
            // No curve leaves along this arm.
            None if end.arm + 1 == vertex.arms.len() => drop(vertex.arms.pop()),
            None => vertex.complete = false,
        }
        vertex.complete &= meeting.complete;
        let incomplete = Limit::Arms { vertex: v };
        if !vertex.complete && !self.diagram.completeness.names(&incomplete) {
            self.diagram.completeness.add(incomplete);
        }
        for (k, other) in meeting.others.iter().enumerate() {
            let arm = if k == first { end.arm } else { self.slot(v, other) };
            if Some(k) != meeting.followed {
                self.pending.push_back(EdgeEnd { vertex: v, arm });
            }
        }
        let vertex = &mut self.diagram.vertices[v];
        if vertex.kind != VertexKind::BranchPoint {
            vertex.kind = meeting.kind.unwrap_or_else(|| kind_of_slots(&vertex.arms));
        }
        meeting.followed.map(|_| end)
    }

    /// Stores an arc as an edge; `false` if it arrives along an arm that has one.
    fn close(&mut self, arc: &mut Arc, to: EdgeEnd) -> bool {
        let singular = |v: usize| self.diagram.vertices[v].kind == VertexKind::BranchPoint;
        let ends = [singular(arc.from.vertex), singular(to.vertex)];
        match arc.points.as_mut_slice() {
            // Nothing is known between them.
            [a, b] if ends.contains(&true) => {
                let sign = sign_between(self.map, a, b);
                (a.det_sign, b.det_sign) = (sign, sign);
            }
            _ => arc.settle_signs(ends),
        }
        let mut edge = DiagramEdge {
            from: arc.from,
            to,
            points: std::mem::take(&mut arc.points),
            smooth_folds: std::mem::take(&mut arc.smooth_folds),
        };
        if to == arc.from {
            let vertex = to.vertex;
            self.diagram.completeness.add(Limit::Contradiction { vertex });
            return false;
        }
        if let Some(known) = self.diagram.link(to).edge {
            return self.replace(known, edge);
        }
        if let (Some(first), Some(last)) = (edge.points.first().cloned(), edge.points.last_mut())
            && last.det_sign.is_none()
        {
            last.det_sign = first.det_sign;
        }
        let e = self.diagram.edges.len();
        self.diagram.link_mut(edge.from).edge = Some(e);
        self.diagram.link_mut(edge.to).edge = Some(e);
        self.diagram.edges.push(edge);
        true
    }

    /// A curve from a new start may arrive along an edge that was abandoned before it reached that start: it replaces this edge.
    fn replace(&mut self, known: usize, edge: DiagramEdge) -> bool {
        let old = &self.diagram.edges[known];
        let far = if old.from == edge.to { old.to } else { old.from };
        let given_up = matches!(self.diagram.vertices[far.vertex].kind, VertexKind::Limit(_));
        let from_start = self.diagram.vertices[edge.from.vertex].kind == VertexKind::Start;
        if given_up && from_start {
            self.diagram.link_mut(far).edge = None;
            self.diagram.link_mut(edge.from).edge = Some(known);
            self.diagram.edges[known] = edge;
        } else {
            let vertex = edge.to.vertex;
            self.diagram.completeness.add(Limit::Contradiction { vertex });
        }
        false
    }

    /// Ends the current curve by its termination: a bound, a limit or a failure.
    fn end(&mut self, mut arc: Arc, termination: Termination, failure: Option<ContinuationError>) {
        let from = arc.from;
        let length = arc.points.last().map_or(0.0, |p| p.arclength);
        let last = arc.points.last().cloned();
        // A bound within the vertex itself.
        let least = match (&last, termination) {
            (Some(p), Termination::ParameterRange) => self.width(&p.x),
            _ => 0.0,
        };
        let near = |p: &Point| self.diagram.vertex_near(&p.x) == Some(from.vertex);
        let left = |p: &Point| arc.points.len() > 1 && (length > least || (length > 0.0 && !near(p)));
        let Some(point) = last.filter(left) else {
            match termination {
                Termination::ParameterRange => self.diagram.link_mut(from).outside = true,
                _ => self.stopped_at(from.vertex, termination, failure),
            }
            return;
        };
        let kind = match termination {
            Termination::ParameterRange => VertexKind::Bound,
            other => VertexKind::Limit(other),
        };
        let known = self
            .diagram
            .vertex_at(self.map, (&point.x, &point.selection), &point.tangent);
        let v = known.unwrap_or_else(|| self.vertex_at_end(&point, kind));
        let arm = self.slot_of_arrival(v, &arc, &point, &reversed(&point));
        self.close(&mut arc, EdgeEnd { vertex: v, arm });
        self.stopped_at(v, termination, failure);
        if known.is_none() {
            let arms = 0..self.diagram.vertices[v].arms.len();
            self.pending.extend(arms.map(|arm| EdgeEnd { vertex: v, arm }));
        }
    }

    fn stopped_at(&mut self, vertex: usize, termination: Termination, failure: Option<ContinuationError>) {
        if let Some(error) = failure {
            return self.diagram.completeness.add(Limit::Failed { vertex, error });
        }
        match termination {
            Termination::ParameterRange | Termination::Closed | Termination::Unbounded => {}
            Termination::End | Termination::Branching => {}
            _ => self
                .diagram
                .completeness
                .add(Limit::Curve { vertex, termination }),
        }
    }
}

/// The sign of det ∇_yH halfway between neighbouring points of a curve; `None` where it is not known.
fn sign_between(map: &dyn PiecewiseSmooth, a: &Point, b: &Point) -> Option<i8> {
    let mut corrector = MoorePenrose::new(map, solver()).ok()?;
    let (_, t, sign) = Stretch::new(a, b)?.at(map, &mut corrector, 0.5).ok()??;
    let vertical = t.last().is_some_and(|t| t.abs() <= 1e-7);
    sign.map(|s| if vertical { 0 } else { s })
}

impl Diagram {
    /// The vertex at x, if there is one.
    pub(super) fn vertex_near(&self, x: &[f64]) -> Option<usize> {
        let reach = self.same_point * (1.0 + norm(x));
        let far = |v: &usize| distance(&self.vertices[*v].x, x);
        let nearest = (0..self.vertices.len()).min_by(|a, b| far(a).total_cmp(&far(b)))?;
        (far(&nearest) <= reach).then_some(nearest)
    }

    pub(super) fn link(&self, end: EdgeEnd) -> &VertexArm {
        &self.vertices[end.vertex].arms[end.arm]
    }

    pub(super) fn link_mut(&mut self, end: EdgeEnd) -> &mut VertexArm {
        &mut self.vertices[end.vertex].arms[end.arm]
    }
}
