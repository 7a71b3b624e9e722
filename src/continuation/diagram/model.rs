use std::fmt;

use crate::continuation::engine::SINGULAR;
use crate::continuation::{Arm, Certainty, ContinuationError, Point, Termination};
use crate::sparse::norm;
use crate::tolerances::RESULT;

/// The solution set of H(y, α) = 0 connected to given starts, as a graph: vertices where arcs of curves meet or end, edges the
/// arcs between them.
///
/// Every arm of every vertex is followed. A curve that arrives at a known vertex is joined to it; an arc is stored once, from
/// whichever end it is found. [`DiagramCompleteness`] says whether anything was left out.
///
/// ```
/// use semismooth::continuation::{Diagram, DiagramOptions};
/// use semismooth::piecewise::MinMap;
/// // The pitchfork y³ = αy.
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[0] * x[0] * x[0] - x[1] * x[0];
///     b[0] = 1e9;
/// });
/// let options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
/// let diagram = Diagram::explore(&map, &[[0.0, -0.5]], &options)?;
/// assert!(!diagram.completeness().is_limited());
/// assert_eq!(diagram.solutions_at(&map, -0.25)?.count(), Some(1));
/// let three = diagram.solutions_at(&map, 0.25)?;
/// assert_eq!(three.count(), Some(3));
/// assert!(three.points.iter().any(|s| (s.x[0] - 0.5).abs() < 1e-12));
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "super::file::Unchecked")
)]
pub struct Diagram {
    pub(super) vertices: Vec<DiagramVertex>,
    pub(super) edges: Vec<DiagramEdge>,
    pub(super) completeness: DiagramCompleteness,
    #[cfg_attr(feature = "serde", serde(with = "crate::extended::pair"))]
    pub(super) range: (f64, f64),
    pub(super) same_point: f64,
    pub(super) points: usize,
    /// Typical sizes by which the exploration divided the variables; none for no scaling.
    pub(super) sizes: Vec<f64>,
}

impl Diagram {
    /// The vertices, in the order in which they were found.
    #[must_use]
    pub fn vertices(&self) -> &[DiagramVertex] {
        &self.vertices
    }

    /// The edges, in the order in which they were found.
    #[must_use]
    pub fn edges(&self) -> &[DiagramEdge] {
        &self.edges
    }

    /// Whether everything connected to the starts was followed.
    #[must_use]
    pub fn completeness(&self) -> &DiagramCompleteness {
        &self.completeness
    }

    /// The interval of the parameter that was explored.
    #[must_use]
    pub fn parameter_range(&self) -> (f64, f64) {
        self.range
    }

    /// Number of points computed, those of arcs found twice included.
    #[must_use]
    pub fn points_computed(&self) -> usize {
        self.points
    }
}

/// What a vertex is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum VertexKind {
    /// A start on a curve that is no special point.
    Start,
    /// The active selection changes, α keeps its direction.
    PassThrough,
    /// A non-smooth fold.
    Fold,
    /// A vertical segment begins or ends.
    Vertical,
    /// More than two arms meet, several selections being active.
    Branching,
    /// A Jacobian loses rank along the curve.
    BranchPoint,
    /// A single arm: the curve ends.
    End,
    /// No arm: an isolated solution.
    Isolated,
    /// A continuum of two or more dimensions contains the point.
    Continuum,
    /// The curve leaves the range of the parameter.
    Bound,
    /// The curve was not followed further.
    Limit(Termination),
}

impl VertexKind {
    /// The kind in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::PassThrough => "pass-through",
            Self::Fold => "fold",
            Self::Vertical => "vertical segment",
            Self::Branching => "branching",
            Self::BranchPoint => "branch point",
            Self::End => "end",
            Self::Isolated => "isolated",
            Self::Continuum => "continuum",
            Self::Bound => "bound",
            Self::Limit(t) => t.name(),
        }
    }
}

impl fmt::Display for VertexKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An arm at a vertex.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VertexArm {
    /// Selection and direction.
    pub arm: Arm,
    /// The edge that leaves along it; `None` where it was not followed.
    pub edge: Option<usize>,
    /// Whether it leaves the range of the parameter at once.
    pub outside: bool,
}

impl VertexArm {
    pub(super) fn new(arm: Arm) -> Self {
        Self {
            arm,
            edge: None,
            outside: false,
        }
    }
}

/// A point where curves meet or end.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiagramVertex {
    /// x = (y, α).
    pub x: Vec<f64>,
    /// What it is.
    pub kind: VertexKind,
    /// Whether it is one of the starts.
    pub is_start: bool,
    /// All arms.
    pub arms: Vec<VertexArm>,
    /// Whether all active selections were examined and none is undecided, within tolerances.
    pub complete: bool,
    /// Whether it is proven that no other arm leaves it.
    pub certainty: Certainty,
}

impl DiagramVertex {
    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }
}

/// One end of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EdgeEnd {
    /// The vertex.
    pub vertex: usize,
    /// The arm of the vertex along which the edge leaves it.
    pub arm: usize,
}

/// An arc of a curve between two vertices, on one selection.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiagramEdge {
    /// Where it begins.
    pub from: EdgeEnd,
    /// Where it ends; the same vertex for a closed curve.
    pub to: EdgeEnd,
    /// Its points from end to end, vertices and smooth folds included; arclengths count from its beginning.
    pub points: Vec<Point>,
    /// Positions in `points` of the smooth folds.
    pub smooth_folds: Vec<usize>,
}

impl DiagramEdge {
    /// Whether the edge returns to the vertex it leaves.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.from.vertex == self.to.vertex
    }

    /// Whether α is constant along it, to rounding: a continuum of solutions at one α.
    #[must_use]
    pub fn is_vertical(&self) -> bool {
        // Wherever unknowns are large, or α is small, α̇ is small; signs of determinants were decided in the units of the exploration.
        let flat = |p: &Point| match p.det_sign {
            Some(sign) => sign == 0,
            None => p.tangent.last().is_some_and(|t| t.abs() <= SINGULAR),
        };
        let (lower, upper) = self.interval();
        let size = self.points.iter().map(|p| norm(&p.x)).fold(0.0, f64::max);
        self.points.iter().all(flat) && upper - lower <= RESULT * size
    }

    /// Signs of det ∇_yH^(σ) along the edge, equal neighbours merged: one sign unless smooth folds are passed. Empty where the linear
    /// solver provides no determinants.
    #[must_use]
    pub fn det_signs(&self) -> Vec<i8> {
        let vertical = self.is_vertical();
        let known = self.points.iter().filter_map(|p| p.det_sign);
        let mut signs: Vec<i8> = known.filter(|s| vertical || *s != 0).collect();
        signs.dedup();
        signs
    }

    /// Least and largest parameter.
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        self.points
            .iter()
            .map(Point::parameter)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), a| {
                (l.min(a), u.max(a))
            })
    }

    /// Its arclength.
    #[must_use]
    pub fn arclength(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.arclength)
    }
}

/// Whether a diagram holds everything connected to its starts.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DiagramCompleteness {
    /// Every arm of every vertex was followed to a vertex, to a bound of the parameter, or to infinity (`max_growth`); no other arm leaves a
    /// vertex, by exact coefficients or enclosed derivatives; and no step has passed a fold, a kink or another curve unseen, by enclosures
    /// along it. This covers what is connected with the starts: closed curves that no start lies on are not covered.
    #[default]
    WithinBounds,
    /// The same, but what a step may have passed unseen is not excluded.
    UpToSteps {
        /// The longest step, in the unit of the parameter.
        step: f64,
    },
    /// Every arm found was followed, and no other was found; that there is none is not proven at every vertex.
    NothingElseFound,
    /// Something was left out.
    Limited(Vec<Limit>),
}

impl DiagramCompleteness {
    /// Whether it is proven that nothing is missing of what is connected with the starts.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        matches!(self, Self::WithinBounds)
    }

    /// Whether something is known to have been left out: a limit was reached, or a point is undecided.
    #[must_use]
    pub fn is_limited(&self) -> bool {
        matches!(self, Self::Limited(_))
    }

    pub(super) fn names(&self, limit: &Limit) -> bool {
        matches!(self, Self::Limited(list) if list.contains(limit))
    }

    pub(super) fn add(&mut self, limit: Limit) {
        match self {
            Self::Limited(list) => list.push(limit),
            _ => *self = Self::Limited(vec![limit]),
        }
    }
}

impl fmt::Display for DiagramCompleteness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WithinBounds => {
                f.write_str("complete within the bounds, for what is connected to the starts")
            }
            Self::UpToSteps { step } => write!(
                f,
                "complete within the bounds up to steps of {step:.2}, for what is connected to the starts"
            ),
            Self::NothingElseFound => f.write_str("nothing else was found within the bounds"),
            Self::Limited(list) => {
                f.write_str("incomplete: ")?;
                for (k, limit) in list.iter().enumerate() {
                    let separator = if k > 0 { "; " } else { "" };
                    write!(f, "{separator}{limit}")?;
                }
                Ok(())
            }
        }
    }
}

/// Why a diagram is incomplete.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Limit {
    /// The limit on edges was reached; some arms were not followed.
    EdgeLimit,
    /// The limit on the number of points in all was reached; some arms were not followed.
    PointLimit,
    /// The limit on time was reached; some arms were not followed.
    TimeLimit,
    /// The observer stopped the exploration.
    Interrupted,
    /// The curve that ends (or could not begin) at a vertex was not followed further.
    Curve {
        /// The vertex.
        vertex: usize,
        /// Why.
        termination: Termination,
    },
    /// Not all solutions at a parameter are known to be found.
    Solutions {
        /// The parameter.
        parameter: f64,
    },
    /// The arms of a vertex could not all be determined.
    Arms {
        /// The vertex.
        vertex: usize,
    },
    /// A curve arrived at a vertex along an arm that belongs to another edge; it was dropped.
    Contradiction {
        /// The vertex.
        vertex: usize,
    },
    /// Following an arm of a vertex failed.
    Failed {
        /// The vertex.
        vertex: usize,
        /// Why.
        #[cfg_attr(feature = "serde", serde(with = "crate::continuation::recorded"))]
        error: ContinuationError,
    },
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EdgeLimit => f.write_str("edge limit"),
            Self::PointLimit => f.write_str("point limit"),
            Self::TimeLimit => f.write_str("time limit"),
            Self::Interrupted => f.write_str("interrupted"),
            Self::Curve { vertex, termination } => write!(f, "{termination} at vertex {vertex}"),
            Self::Solutions { parameter } => write!(f, "solutions at parameter {parameter} not all known"),
            Self::Arms { vertex } => write!(f, "arms of vertex {vertex} undecided"),
            Self::Contradiction { vertex } => {
                write!(
                    f,
                    "a curve arrived at vertex {vertex} along the arm of another edge"
                )
            }
            Self::Failed { vertex, error } => write!(f, "from vertex {vertex}: {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::PointKind;
    use crate::piecewise::Selection;

    /// From (0, 0) to (y, slope · y).
    fn edge(y: f64, slope: f64, sign: Option<i8>) -> DiagramEdge {
        let point = |share: f64| Point {
            x: vec![share * y, share * slope * y],
            tangent: vec![1.0 / 1f64.hypot(slope), slope / 1f64.hypot(slope)],
            selection: Selection::uniform(1, 0),
            grazing: Vec::new(),
            arclength: share * y,
            residual_norm: 0.0,
            det_sign: sign,
            corrections: 0,
            kind: PointKind::Step,
        };
        DiagramEdge {
            from: EdgeEnd { vertex: 0, arm: 0 },
            to: EdgeEnd { vertex: 1, arm: 0 },
            points: [0.0, 0.5, 1.0].map(point).to_vec(),
            smooth_folds: Vec::new(),
        }
    }

    /// Neither is an edge vertical because it is short, nor because its unknowns are large or α is small.
    #[test]
    fn vertical_is_where_the_parameter_stands_still() {
        for sign in [None, Some(0)] {
            assert!(edge(1.0, 0.0, sign).is_vertical() && edge(1e6, 0.0, sign).is_vertical());
            assert!(edge(1e-9, 0.0, sign).is_vertical());
            assert!(!edge(1e6, 1e-8, sign).is_vertical() && !edge(1.0, 1e-9, sign).is_vertical());
            assert!(!edge(1e9, 1e-9, sign).is_vertical() && !edge(1e-9, 1e-9, sign).is_vertical());
        }
        assert!(!edge(1e-5, 1e-5, None).is_vertical() && !edge(1.0, 1.0, None).is_vertical());
        // In the units of the exploration α moves.
        assert!(!edge(1e9, 1e-18, Some(1)).is_vertical());
    }
}
