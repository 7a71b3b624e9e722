//! Queries of a diagram.

use super::identity::told_apart;
use super::split::Stretch;
use super::{Diagram, DiagramVertex, VertexKind};
use crate::continuation::engine::belongs;
use crate::continuation::{ContinuationError, Point};
use crate::input::check_options;
use crate::linear::AutoSolver;
use crate::newton::MoorePenrose;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Scaled, ScaledMap, Selection};
use crate::sparse::{distance, norm};
use crate::tolerances::{HALVINGS, ROUNDING};

/// A solution at a given α.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiagramSolution {
    /// x = (y, α).
    pub x: Vec<f64>,
    /// A selection active there.
    pub selection: Selection,
    /// Sign of det ∇_yH^(σ) of that selection, where it is known.
    pub det_sign: Option<i8>,
    /// The edge on which it lies; the first one at a vertex.
    pub edge: usize,
    /// The local index (degree) of the solution: the sign of the determinant, or where two edges meet the mean of their signs (0: a
    /// fold); `None` where these do not determine it (grazing, branchings, unknown signs).
    pub index: Option<i8>,
}

/// The solutions of a diagram at one α.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SolutionsAt {
    /// Solutions that are no part of a continuum.
    pub points: Vec<DiagramSolution>,
    /// Edges that lie at this α as a whole: vertical segments, each a continuum of solutions.
    pub continua: Vec<usize>,
    /// Solutions from which no curve leaves, as x = (y, α).
    pub isolated: Vec<Vec<f64>>,
}

impl SolutionsAt {
    /// Number of solutions; `None` if there are infinitely many.
    #[must_use]
    pub fn count(&self) -> Option<usize> {
        let finite = self.continua.is_empty();
        finite.then_some(self.points.len() + self.isolated.len())
    }

    /// Sum of the local indices, where all are known. For problems whose solutions are all known this is the degree of the map
    /// (+1 for Coulomb friction with F ≥ 0): evidence that none is missing.
    #[must_use]
    pub fn index_sum(&self) -> Option<i64> {
        if !(self.continua.is_empty() && self.isolated.is_empty()) {
            return None;
        }
        self.points.iter().map(|s| s.index.map(i64::from)).sum()
    }
}

/// A point where α turns.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiagramFold {
    /// x = (y, α).
    pub x: Vec<f64>,
    /// The vertex of a non-smooth fold; `None` for a smooth one.
    pub vertex: Option<usize>,
    /// The edge of a smooth fold; an edge that meets in a non-smooth one.
    pub edge: usize,
}

impl DiagramFold {
    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }
}

/// The sign of the determinant at a point which is neither a fold nor on a facet.
fn regular_sign(point: &Point) -> Option<i8> {
    point.det_sign.filter(|s| *s != 0 && point.grazing.is_empty())
}

impl Diagram {
    /// All solutions of the diagram at `alpha`, corrected to rounding on their selections; vertical segments as continua.
    ///
    /// # Complexity
    /// One pass over all points, a few factorisations for each solution found, and the comparison of each with all others: O(k² m) for k
    /// of them in m variables.
    ///
    /// # Errors
    /// [`InputError::Option`](crate::InputError::Option) for an α outside the explored range; maps that are not those of the diagram.
    pub fn solutions_at<P: PiecewiseSmooth + ?Sized>(
        &self,
        map: &P,
        alpha: f64,
    ) -> Result<SolutionsAt, ContinuationError> {
        self.section_of(&map, alpha)
    }

    fn section_of(&self, map: &dyn PiecewiseSmooth, alpha: f64) -> Result<SolutionsAt, ContinuationError> {
        let (lower, upper) = self.range;
        let inside = alpha >= lower && alpha <= upper;
        check_options(&[(
            "alpha",
            alpha,
            inside,
            "inside the explored range of the parameter",
        )])?;
        if self.sizes.is_empty() {
            return self.sections(map, alpha);
        }
        let scaled = Scaled::with_divisors(map, self.sizes.clone())?;
        let mut diagram = self.clone();
        diagram.scale(&scaled);
        let mut found = diagram.sections(&scaled, alpha / scaled.parameter_size())?;
        found.unscale(&scaled);
        Ok(found)
    }

    fn sections(&self, map: &dyn PiecewiseSmooth, alpha: f64) -> Result<SolutionsAt, ContinuationError> {
        let mut corrector = MoorePenrose::new(map, AutoSolver::default())?;
        self.check(map)?;
        let intervals = self.edges.iter().map(|e| e.interval());
        let (lower, upper) = intervals.fold((alpha, alpha), |(l, u), (a, b)| (l.min(a), u.max(b)));
        let size = (upper - lower).max(alpha.abs());
        // Points of vertical segments are corrected to a tolerance; others are known to rounding, and are solved for where α differs by more.
        let vertical = |a: f64| (a - alpha).abs() <= 1e-10 * size;
        let near = |a: f64| (a - alpha).abs() <= ROUNDING * size;
        let mut found = SolutionsAt::default();
        for (e, edge) in self.edges.iter().enumerate() {
            if edge.is_vertical() {
                if edge.points.iter().all(|p| vertical(p.parameter())) {
                    found.continua.push(e);
                }
                continue;
            }
            for (k, a) in edge.points.iter().enumerate() {
                if near(a.parameter()) {
                    belongs(map, &a.selection, &a.x)?;
                    self.offer(map, &mut found, a.x.clone(), a, e);
                    continue;
                }
                let Some(b) = edge.points.get(k + 1) else {
                    continue;
                };
                let between = (a.parameter() - alpha) * (b.parameter() - alpha) < 0.0;
                if !between || near(b.parameter()) {
                    continue;
                }
                belongs(map, &a.selection, &a.x)?;
                belongs(map, &b.selection, &b.x)?;
                if let Some(x) = onto_parameter(map, &mut corrector, a, b, alpha)? {
                    // Next to a fold the sign is taken from the other end.
                    let at = if regular_sign(a).is_some() { a } else { b };
                    self.offer(map, &mut found, x, at, e);
                }
            }
        }
        let isolated = |v: &&DiagramVertex| v.arms.is_empty() && v.kind == VertexKind::Isolated;
        for vertex in self.vertices.iter().filter(isolated) {
            if vertical(vertex.parameter()) {
                found.isolated.push(vertex.x.clone());
            }
        }
        // Ends of a continuum belong to it.
        let continua = found.continua.clone();
        let normal = along_parameter(map.num_vars());
        let part_of = |s: &DiagramSolution| {
            let ends = continua
                .iter()
                .flat_map(|&e| [self.edges[e].from.vertex, self.edges[e].to.vertex]);
            let reach = self.same_point * (1.0 + norm(&s.x));
            ends.map(|v| &self.vertices[v]).any(|vertex| {
                distance(&vertex.x, &s.x) <= reach && vertex.may_hold(map, (&s.x, &s.selection), &normal)
            })
        };
        found.points.retain(|s| !part_of(s));
        Ok(found)
    }

    /// Adds a solution, unless it is known: on edges that meet in a vertex.
    fn offer(
        &self,
        map: &dyn PiecewiseSmooth,
        found: &mut SolutionsAt,
        x: Vec<f64>,
        at: &Point,
        edge: usize,
    ) {
        let normal = along_parameter(x.len());
        let reach = self.same_point * (1.0 + norm(&x));
        let sign = regular_sign(at);
        let same = |s: &DiagramSolution| {
            let places = [(&x[..], &at.selection), (&s.x[..], &s.selection)];
            distance(&s.x, &x) <= reach && !told_apart(map, &normal, places)
        };
        if let Some(k) = found.points.iter().position(same) {
            let known = &mut found.points[k];
            let vertex = self.vertex_near(&x).map(|v| self.vertices[v].arms.len());
            known.index = match (known.index, sign) {
                (Some(a), Some(b)) if vertex == Some(2) => Some((a.signum() + b.signum()) / 2),
                _ => None,
            };
            return;
        }
        found.points.push(DiagramSolution {
            x,
            selection: at.selection.clone(),
            det_sign: at.det_sign,
            edge,
            index: sign,
        });
    }

    /// All folds, smooth or not, by α.
    #[must_use]
    pub fn folds(&self) -> Vec<DiagramFold> {
        let mut folds = Vec::new();
        for (v, vertex) in self.vertices.iter().enumerate() {
            let edge = vertex.arms.iter().find_map(|a| a.edge);
            if let (VertexKind::Fold, Some(edge)) = (vertex.kind, edge) {
                folds.push(DiagramFold {
                    x: vertex.x.clone(),
                    vertex: Some(v),
                    edge,
                });
            }
        }
        for (e, edge) in self.edges.iter().enumerate() {
            for point in edge.smooth_folds.iter().filter_map(|&k| edge.points.get(k)) {
                folds.push(DiagramFold {
                    x: point.x.clone(),
                    vertex: None,
                    edge: e,
                });
            }
        }
        folds.sort_by(|a, b| a.parameter().total_cmp(&b.parameter()));
        folds
    }
}

/// The unit vector of α among m variables.
fn along_parameter(m: usize) -> Vec<f64> {
    (1..=m).map(|j| if j == m { 1.0 } else { 0.0 }).collect()
}

/// The point at `alpha` between two neighbouring points, by bisected secants along the chord, then exactly onto α.
fn onto_parameter(
    map: &dyn PiecewiseSmooth,
    corrector: &mut MoorePenrose<AutoSolver>,
    a: &Point,
    b: &Point,
    alpha: f64,
) -> Result<Option<Vec<f64>>, PiecewiseError> {
    let Some(stretch) = Stretch::new(a, b) else {
        return Ok(None);
    };
    let last = a.x.len() - 1;
    let (mut low, mut high) = ((0.0, a.x[last] - alpha), (1.0, b.x[last] - alpha));
    let mut best = None;
    for round in 0..HALVINGS {
        let secant = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
        let middle = 0.5 * (low.0 + high.0);
        // Every third point is the midpoint: secants may keep one end fixed.
        let u = if round % 3 == 2 { middle } else { secant };
        let Some((x, ..)) = stretch.at(map, corrector, u)? else {
            break;
        };
        let g = x[last] - alpha;
        best = Some(x);
        if g.abs() <= 4.0 * f64::EPSILON * (1.0 + alpha.abs()) {
            break;
        }
        if g * low.1 > 0.0 {
            low = (u, g);
        } else {
            high = (u, g);
        }
    }
    let Some(x) = best else {
        return Ok(None);
    };
    let normal = along_parameter(last + 1);
    let (mut y, mut t) = (x.clone(), normal.clone());
    let offset = alpha - x[last];
    match corrector.correct_in_plane(map, &a.selection, (&x, &normal, offset), &mut y, &mut t) {
        Ok((c, _)) if c.converged && distance(&x, &y) <= 1e-6 * (1.0 + norm(&x)) => {
            y[last] = alpha;
            Ok(Some(y))
        }
        // Next to a fold the plane of constant α is tangent to the curve: the bracket cannot be improved.
        Ok(_) | Err(PiecewiseError::Linear(_)) => Ok(Some(x)),
        Err(e) => Err(e),
    }
}
