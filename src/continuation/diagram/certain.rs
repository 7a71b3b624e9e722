//! How far it is proven that a diagram is all of what is connected with its starts.

use std::ops::ControlFlow;

use super::explore::{Explorer, Meeting, Progress};
use super::{DiagramCompleteness, DiagramVertex, VertexArm, VertexKind};
use crate::continuation::point::{Arms, kind_of};
use crate::continuation::start::prepared_on;
use crate::continuation::{Arm, Certainty, ContinuationError, Point, PointDoubt};
use crate::newton::step_enclosure;
use crate::sparse::distance;

/// Variables up to which steps are proven to pass nothing unseen: each proof takes a few hundred times a product with a matrix of this size.
const ENCLOSED: usize = 16;

impl<O: FnMut(&Progress<'_>) -> ControlFlow<()>> Explorer<'_, O> {
    /// A vertex where a curve ends. At a bound of the parameter more may happen than that the curve leaves the range: then all arms of the
    /// point belong to it.
    pub(super) fn vertex_at_end(&mut self, point: &Point, kind: VertexKind) -> usize {
        let mut vertex = DiagramVertex {
            x: point.x.clone(),
            kind,
            is_start: false,
            arms: Vec::new(),
            complete: kind == VertexKind::Bound,
            certainty: match kind {
                VertexKind::Bound => Certainty::Estimated,
                _ => Certainty::Undecided(PointDoubt::NotSearched),
            },
        };
        if kind == VertexKind::Bound
            && let Ok((x, arms, certainty)) = self.arms_at_bound(&point.x)
        {
            vertex.certainty = certainty;
            let found = kind_of(&arms.list);
            vertex.complete = arms.complete;
            vertex.x = x;
            if found != VertexKind::PassThrough {
                vertex.kind = found;
                vertex.arms = arms.list.into_iter().map(VertexArm::new).collect();
            }
        }
        self.add_vertex(vertex)
    }

    fn arms_at_bound(&self, x: &[f64]) -> Result<(Vec<f64>, Arms, Certainty), ContinuationError> {
        let mut curve = prepared_on(self.map, x, self.options.continuation.clone())?;
        let curve = curve.erased_mut();
        let (arms, certainty) = curve.arms_of_start()?;
        Ok((curve.here.x.clone(), arms, certainty))
    }

    /// How certain it is that no other arms leave a point that a curve has met.
    pub(super) fn certainty_of(&self, meeting: &Meeting<'_>) -> Certainty {
        if !meeting.complete {
            return Certainty::Undecided(PointDoubt::Budget);
        }
        let arms: Vec<Arm> = std::iter::once(&meeting.incoming)
            .chain(meeting.others)
            .cloned()
            .collect();
        let curve = prepared_on(self.map, meeting.x, self.options.continuation.clone());
        let found = curve.and_then(|mut curve| curve.erased_mut().certainty_of(&arms));
        found.unwrap_or(Certainty::Estimated)
    }

    /// Says how far what was found is proven to be all, if nothing was left out.
    pub(super) fn conclude(&mut self) {
        if self.diagram.completeness.is_limited() {
            return;
        }
        let edges = || self.diagram.edges.iter().flat_map(|e| e.points.windows(2));
        self.diagram.completeness = if !self.diagram.vertices.iter().all(|v| v.certainty.is_proven()) {
            DiagramCompleteness::NothingElseFound
        } else if edges().all(|w| self.passes_nothing(&w[0], &w[1])) {
            DiagramCompleteness::WithinBounds
        } else {
            let step = edges().map(|w| distance(&w[0].x, &w[1].x)).fold(0.0, f64::max);
            DiagramCompleteness::UpToSteps { step }
        };
    }

    /// Whether a step is proven to pass nothing unseen. On affine pieces it ends at the first facet.
    fn passes_nothing(&self, a: &Point, b: &Point) -> bool {
        let enclosed = || {
            let found = step_enclosure(self.map, &a.selection, &a.x, &b.x);
            found.is_some_and(|e| e.regular && e.facets_told_by_ends && (e.rate.is_some() || a.x == b.x))
        };
        self.map.is_piecewise_affine() || (a.x.len() <= ENCLOSED && enclosed())
    }
}
