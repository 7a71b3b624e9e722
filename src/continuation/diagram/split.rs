//! Points inside known edges.

use super::identity::{Place, told_apart};
use super::{Diagram, DiagramEdge, DiagramVertex, EdgeEnd, VertexArm, VertexKind};
use crate::continuation::error::if_converged;
use crate::continuation::{Certainty, ContinuationError, Point, PointKind};
use crate::linear::AutoSolver;
use crate::newton::MoorePenrose;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth};
use crate::sparse::{distance, dot, norm};

/// A point of a curve, its tangent and the sign of det ∇_yH there.
type Placed = (Vec<f64>, Vec<f64>, Option<i8>);

/// The arc between neighbouring points of an edge, on their selection.
pub(super) struct Stretch<'e> {
    pub(super) a: &'e Point,
    pub(super) b: &'e Point,
    chord: Vec<f64>,
    length: f64,
}

impl<'e> Stretch<'e> {
    /// `None` where the points coincide.
    pub(super) fn new(a: &'e Point, b: &'e Point) -> Option<Self> {
        let length = distance(&a.x, &b.x);
        let chord = a.x.iter().zip(&b.x).map(|(a, b)| (b - a) / length).collect();
        (length > 0.0).then_some(Self { a, b, chord, length })
    }

    /// Whether x lies in the ball whose diameter is the chord, slightly enlarged: arcs of a step bend far less than that.
    fn surrounds(&self, x: &[f64]) -> bool {
        let centre: Vec<f64> = self
            .a
            .x
            .iter()
            .zip(&self.b.x)
            .map(|(a, b)| 0.5 * (a + b))
            .collect();
        distance(&centre, x) <= 0.51 * self.length
    }

    /// Position of x along the chord, 0 at a and 1 at b.
    fn fraction(&self, x: &[f64]) -> f64 {
        let offset: Vec<f64> = x.iter().zip(&self.a.x).map(|(x, a)| x - a).collect();
        dot(&offset, &self.chord) / self.length
    }

    /// The point of the curve over the chord at fraction u, with its tangent: corrected to rounding from the cubic through both ends.
    pub(super) fn at(
        &self,
        map: &dyn PiecewiseSmooth,
        corrector: &mut MoorePenrose<AutoSolver>,
        u: f64,
    ) -> Result<Option<Placed>, PiecewiseError> {
        let (h00, h10) = ((1.0 + 2.0 * u) * (1.0 - u) * (1.0 - u), u * (1.0 - u) * (1.0 - u));
        let (h01, h11) = (u * u * (3.0 - 2.0 * u), u * u * (u - 1.0));
        let (a, b) = (self.a, self.b);
        let mut x: Vec<f64> = (0..a.x.len())
            .map(|i| {
                let slopes = h10 * a.tangent[i] + h11 * b.tangent[i];
                h00 * a.x[i] + h01 * b.x[i] + slopes * self.length
            })
            .collect();
        let guess = x.clone();
        let mut t = self.chord.clone();
        let selection = &a.selection;
        let s = u * self.length;
        let corrected = corrector.correct_in_plane(map, selection, (&a.x, &self.chord, s), &mut x, &mut t);
        let sign = if_converged(corrected)?.map(|(_, at)| at.det_sign());
        let sign = sign.filter(|_| distance(&x, &guess) <= 0.1 * self.length);
        Ok(sign.map(|sign| (x, t, sign)))
    }
}

impl Diagram {
    /// Splits the edge through x by a vertex there; `false` if no edge passes x.
    pub(super) fn split_at(
        &mut self,
        map: &dyn PiecewiseSmooth,
        place: Place<'_>,
    ) -> Result<bool, ContinuationError> {
        let x = place.0;
        let mut corrector = MoorePenrose::new(map, AutoSolver::default())?;
        let reach = self.same_point * (1.0 + norm(x));
        for e in 0..self.edges.len() {
            let points = &self.edges[e].points;
            for k in 1..points.len() {
                let Some(stretch) = Stretch::new(&points[k - 1], &points[k]) else {
                    continue;
                };
                if !stretch.surrounds(x) {
                    continue;
                }
                let u = stretch.fraction(x);
                if let Some((y, t, _)) = stretch.at(map, &mut corrector, u)?
                    && distance(&y, x) <= reach
                    && !told_apart(map, &t, [place, (&y, &points[k - 1].selection)])
                {
                    self.cut(e, k, x, t);
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    fn cut(&mut self, e: usize, k: usize, x: &[f64], tangent: Vec<f64>) {
        let vertex = self.vertices.len();
        let second = self.edges.len();
        let edge = &mut self.edges[e];
        let (before, after) = (&edge.points[k - 1], &edge.points[k]);
        // At a smooth fold the sign is 0; that of the neighbouring point is taken.
        let near = if edge.smooth_folds.contains(&(k - 1)) {
            after
        } else {
            before
        };
        let point = Point {
            x: x.to_vec(),
            tangent,
            arclength: before.arclength + distance(x, &before.x),
            det_sign: near.det_sign,
            kind: PointKind::Start,
            corrections: 0,
            ..before.clone()
        };
        let onward = VertexArm {
            arm: super::arc::reversed(&Point {
                tangent: point.tangent.iter().map(|t| -t).collect(),
                ..point.clone()
            }),
            edge: Some(second),
            outside: false,
        };
        let backward = VertexArm {
            arm: super::arc::reversed(&point),
            edge: Some(e),
            outside: false,
        };
        let base = point.arclength;
        let mut tail = edge.points.split_off(k);
        tail.insert(0, point.clone());
        tail.iter_mut().for_each(|p| p.arclength -= base);
        edge.points.push(point);
        let (folds, later): (Vec<usize>, Vec<usize>) = edge.smooth_folds.iter().partition(|&&f| f < k);
        edge.smooth_folds = folds;
        let end = edge.to;
        edge.to = EdgeEnd { vertex, arm: 0 };
        self.edges.push(DiagramEdge {
            from: EdgeEnd { vertex, arm: 1 },
            to: end,
            points: tail,
            smooth_folds: later.into_iter().map(|f| f + 1 - k).collect(),
        });
        self.vertices.push(DiagramVertex {
            x: x.to_vec(),
            kind: VertexKind::Start,
            is_start: true,
            arms: vec![backward, onward],
            complete: true,
            certainty: Certainty::Estimated,
        });
        self.link_mut(end).edge = Some(second);
    }
}
