//! Resuming an exploration that was stopped.

use std::ops::ControlFlow;

use super::explore::{Explorer, Observer, Progress};
use super::natural::{natural_observer, scaled_options, scaled_starts};
use super::{Diagram, DiagramCompleteness, DiagramOptions, DiagramVertex, EdgeEnd, Limit, VertexKind};
use crate::InputError;
use crate::continuation::start::slices;
use crate::continuation::{ContinuationError, Termination};
use crate::input::check_options;
use crate::input::check_vector;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Scaled, check_selection};

/// Whether a further run may go beyond this end of a curve.
fn lifted(termination: Termination) -> bool {
    use Termination::{ArclengthLimit, Interrupted, PointLimit, TimeLimit};
    matches!(termination, ArclengthLimit | PointLimit | TimeLimit | Interrupted)
}

impl Diagram {
    /// Resumes a diagram that was stopped by a limit or by its observer (and perhaps written and read since), and adds
    /// what can be reached from `starts`, which may be empty.
    ///
    /// All arms that were not followed are pending. The edge that was being followed when the diagram was stopped is followed again from
    /// its last vertex: a run that is too short for an edge makes no progress. Limits on edges and points include those of earlier
    /// runs. The range of the parameter must be the same.
    ///
    /// # Errors
    /// As [`explore`](Self::explore); diagrams that do not fit the map.
    ///
    /// ```
    /// use semismooth::continuation::{Diagram, DiagramOptions};
    /// use semismooth::piecewise::MinMap;
    /// // The unit circle.
    /// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
    ///     a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
    ///     b[0] = 1e9;
    /// });
    /// let part = Diagram::explore(&map, &[[0.8, 0.6]], &DiagramOptions::default().with_max_points(10))?;
    /// assert!(part.completeness().is_limited());
    /// let none: [[f64; 2]; 0] = [];
    /// let whole = part.resume(&map, &none, &DiagramOptions::default())?;
    /// assert!(!whole.completeness().is_limited());
    /// assert_eq!(whole.isolas().len(), 1);
    /// # Ok::<(), semismooth::continuation::ContinuationError>(())
    /// ```
    pub fn resume<P, S>(
        self,
        map: &P,
        starts: &[S],
        options: &DiagramOptions,
    ) -> Result<Self, ContinuationError>
    where
        P: PiecewiseSmooth + ?Sized,
        S: AsRef<[f64]>,
    {
        self.resume_from(&map, &slices(starts), options, &mut |_| ControlFlow::Continue(()))
    }

    /// [`resume`](Self::resume), reporting every event to `observe`, which may stop.
    ///
    /// # Errors
    /// As [`resume`](Self::resume).
    pub fn resume_observed<P, S>(
        self,
        map: &P,
        starts: &[S],
        options: &DiagramOptions,
        mut observe: impl FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError>
    where
        P: PiecewiseSmooth + ?Sized,
        S: AsRef<[f64]>,
    {
        self.resume_from(&map, &slices(starts), options, &mut observe)
    }

    fn resume_from(
        mut self,
        map: &dyn PiecewiseSmooth,
        starts: &[&[f64]],
        options: &DiagramOptions,
        observe: Observer<'_>,
    ) -> Result<Self, ContinuationError> {
        options.validate()?;
        self.check(map)?;
        let (lower, upper) = options.continuation.parameter_range;
        for (value, own) in [(lower, self.range.0), (upper, self.range.1)] {
            let range = "that of the diagram to be resumed";
            check_options(&[("parameter_range", value, value == own, range)])?;
        }
        let inner = &options.continuation;
        let scaled = Scaled::new(map, &inner.typical_sizes, inner.parameter_range)?;
        self.scale(&scaled);
        let mut again = self.reopen();
        let mut pending = Vec::new();
        for (vertex, v) in self.vertices.iter().enumerate() {
            pending.extend((0..v.arms.len()).map(|arm| EdgeEnd { vertex, arm }));
        }
        // Curves meet each other at events only; those that have none in their middle come first.
        pending.sort_by_key(|end| self.vertices[end.vertex].kind != VertexKind::Start);
        again.extend(scaled_starts(&scaled, starts));
        let inner = scaled_options(&scaled, options);
        let mut explorer = Explorer::new(&scaled, self, inner, natural_observer(&scaled, observe));
        explorer.run(pending, &again)?;
        let mut diagram = explorer.diagram;
        diagram.unscale(&scaled);
        Ok(diagram)
    }

    /// Removes the limits that a further run may raise, with the edges that ended there, and the starts from which nothing was
    /// followed: these are returned.
    fn reopen(&mut self) -> Vec<Vec<f64>> {
        let stopped = |v: &DiagramVertex| matches!(v.kind, VertexKind::Limit(t) if lifted(t));
        let cut: Vec<bool> = (self.edges.iter())
            .map(|e| {
                [e.from, e.to]
                    .iter()
                    .any(|end| stopped(&self.vertices[end.vertex]))
            })
            .collect();
        let mut starts = Vec::new();
        let mut gone = Vec::with_capacity(self.vertices.len());
        for vertex in &mut self.vertices {
            for arm in &mut vertex.arms {
                arm.edge = arm.edge.filter(|e| !cut[*e]);
            }
            let unused = vertex.arms.iter().all(|a| a.edge.is_none() && !a.outside);
            let start = vertex.is_start && unused && !vertex.arms.is_empty();
            if start {
                starts.push(vertex.x.clone());
            }
            gone.push(start || stopped(vertex));
        }
        self.remove(&gone, &cut);
        starts
    }

    /// Removes vertices and edges and everything that refers to them.
    fn remove(&mut self, vertices: &[bool], edges: &[bool]) {
        let renumbered = |gone: &[bool]| -> Vec<usize> {
            let mut next = 0;
            let number = |g: &bool| {
                let number = next;
                next += usize::from(!g);
                number
            };
            gone.iter().map(number).collect()
        };
        let (vertex_of, edge_of) = (renumbered(vertices), renumbered(edges));
        let mut k = 0;
        self.vertices.retain(|_| {
            k += 1;
            !vertices[k - 1]
        });
        k = 0;
        self.edges.retain(|_| {
            k += 1;
            !edges[k - 1]
        });
        for arm in self.vertices.iter_mut().flat_map(|v| &mut v.arms) {
            arm.edge = arm.edge.map(|e| edge_of[e]);
        }
        for edge in &mut self.edges {
            edge.from.vertex = vertex_of[edge.from.vertex];
            edge.to.vertex = vertex_of[edge.to.vertex];
        }
        let limits = match std::mem::take(&mut self.completeness) {
            DiagramCompleteness::Limited(list) => list,
            _ => Vec::new(),
        };
        for limit in limits {
            match limit {
                Limit::Curve { vertex, termination } if !vertices[vertex] && !lifted(termination) => {
                    let vertex = vertex_of[vertex];
                    self.completeness.add(Limit::Curve { vertex, termination });
                }
                Limit::Arms { vertex } if !vertices[vertex] => {
                    let vertex = vertex_of[vertex];
                    self.completeness.add(Limit::Arms { vertex });
                }
                Limit::Solutions { .. } => self.completeness.add(limit),
                // Tried again, and reported again if it fails again.
                _ => {}
            }
        }
    }

    /// Checks that the diagram fits a map: nothing in it is out of range.
    pub(super) fn check(&self, map: &dyn PiecewiseSmooth) -> Result<(), PiecewiseError> {
        let m = map.num_vars();
        let what = "a selection of the diagram";
        for vertex in &self.vertices {
            check_vector("a vertex of the diagram", &vertex.x, m)?;
            for a in &vertex.arms {
                check_vector("an arm of the diagram", &a.arm.tangent, m)?;
                check_selection(what, &a.arm.selection, map)?;
            }
        }
        for p in self.edges.iter().flat_map(|e| &e.points) {
            check_vector("a point of the diagram", &p.x, m)?;
            check_vector("a tangent of the diagram", &p.tangent, m)?;
            check_selection(what, &p.selection, map)?;
        }
        if !self.sizes.is_empty() {
            check_vector("the typical sizes of the diagram", &self.sizes, m)?;
        }
        self.check_structure()
    }

    /// Checks that all vertices, arms and edges referred to exist.
    pub(super) fn check_structure(&self) -> Result<(), PiecewiseError> {
        let index = |what, found: usize, expected: usize| {
            let error = PiecewiseError::Input(InputError::Length {
                what,
                expected,
                found: found.saturating_add(1),
            });
            if found < expected { Ok(()) } else { Err(error) }
        };
        let edges = self.vertices.iter().flat_map(|v| &v.arms).filter_map(|a| a.edge);
        for edge in edges {
            index("the edges of the diagram", edge, self.edges.len())?;
        }
        if let DiagramCompleteness::Limited(limits) = &self.completeness {
            for limit in limits {
                if let Limit::Curve { vertex, .. } | Limit::Arms { vertex } = limit {
                    index("the vertices of the diagram", *vertex, self.vertices.len())?;
                }
            }
        }
        for edge in &self.edges {
            for end in [edge.from, edge.to] {
                index("the vertices of the diagram", end.vertex, self.vertices.len())?;
                index(
                    "the arms of a vertex of the diagram",
                    end.arm,
                    self.vertices[end.vertex].arms.len(),
                )?;
            }
            index("the points of an edge of the diagram", 1, edge.points.len())?;
        }
        Ok(())
    }
}
