//! Diagrams as the page draws them.

use semismooth::continuation::{Diagram, DiagramBranch, DiagramEdge, VertexKind};
use semismooth::piecewise::Selection;
use serde::Serialize;

/// A diagram: vertices, the curves between them, and what is known of its completeness.
#[derive(Debug, Serialize)]
pub(crate) struct Drawing {
    vertices: Vec<Vertex>,
    edges: Vec<Edge>,
    /// Lists of edges.
    branches: Vec<Branch>,
    /// Parameters of all folds.
    folds: Vec<f64>,
    isolas: usize,
    points: usize,
    complete: bool,
    /// What is known of the completeness, in the words of the library.
    completeness: String,
}

#[derive(Debug, Serialize)]
struct Vertex {
    kind: &'static str,
    /// Its number in the labels T1, T2, …: vertices at which the solution changes, in the order in which the branches meet them.
    #[serde(skip_serializing_if = "Option::is_none")]
    number: Option<usize>,
    x: Vec<f64>,
    /// The pieces on each arm, in the order in which the branch is followed.
    arms: Vec<Vec<String>>,
    /// For friction problems: θ¹, θ², θ³ of each node.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    theta: Vec<[f64; 3]>,
}

#[derive(Debug, Serialize)]
struct Edge {
    from: usize,
    to: usize,
    /// The piece of each site.
    pieces: Vec<String>,
    vertical: bool,
    /// x of each point.
    points: Vec<Vec<f64>>,
    /// The unit tangent at each point, along the edge.
    tangents: Vec<Vec<f64>>,
    /// The sign of the determinant at each point, where it is known.
    det: Vec<Option<i8>>,
    /// Positions of smooth folds.
    folds: Vec<usize>,
}

#[derive(Debug, Serialize)]
struct Branch {
    edges: Vec<usize>,
    closed: bool,
}

/// The labels of a problem in its diagrams.
pub(crate) trait Words {
    /// The piece of each site of a selection; at the sites in `grazing` the curve runs inside a facet, between two pieces.
    fn pieces(&self, selection: &Selection, grazing: &[usize]) -> Vec<String>;

    /// The test functions at x, for problems that list them.
    fn theta(&self, x: &[f64]) -> Vec<[f64; 3]>;
}

impl Drawing {
    pub(crate) fn new(diagram: &Diagram, words: &impl Words) -> Self {
        let mut drawing = Self {
            vertices: (diagram.vertices().iter())
                .map(|v| Vertex {
                    kind: v.kind.name(),
                    number: None,
                    x: v.x.clone(),
                    arms: (v.arms.iter())
                        .map(|a| words.pieces(&a.arm.selection, &a.arm.grazing))
                        .collect(),
                    theta: Vec::new(),
                })
                .collect(),
            edges: diagram.edges().iter().map(|e| edge(e, words)).collect(),
            branches: Vec::new(),
            folds: diagram.folds().iter().map(|f| f.parameter()).collect(),
            isolas: diagram.isolas().len(),
            points: diagram.points_computed(),
            complete: diagram.completeness().is_complete(),
            completeness: diagram.completeness().to_string(),
        };
        let mut next = 1;
        for branch in diagram.branches() {
            let walk = walk(diagram, &branch);
            let ends = walk.iter().map(|&(e, back)| ends(&diagram.edges()[e], back));
            for (from, to) in ends {
                for end in [from, to] {
                    let (vertex, arms) = (
                        &mut drawing.vertices[end.vertex],
                        &diagram.vertices()[end.vertex].arms,
                    );
                    if vertex.number.is_some() || !is_event(diagram.vertices()[end.vertex].kind) {
                        continue;
                    }
                    vertex.number = Some(next);
                    next += 1;
                    vertex.theta = words.theta(&vertex.x);
                    // The arm of arrival comes first.
                    if end == to && arms.len() > 1 {
                        vertex.arms.swap(0, end.arm);
                    }
                }
            }
            drawing.branches.push(Branch {
                edges: walk.iter().map(|e| e.0).collect(),
                closed: branch.closed,
            });
        }
        drawing
    }
}

fn edge(edge: &DiagramEdge, words: &impl Words) -> Edge {
    let middle = edge.points.get(edge.points.len() / 2);
    Edge {
        from: edge.from.vertex,
        to: edge.to.vertex,
        pieces: middle.map_or_else(Vec::new, |p| words.pieces(&p.selection, &p.grazing)),
        vertical: edge.is_vertical(),
        points: edge.points.iter().map(|p| p.x.clone()).collect(),
        tangents: edge.points.iter().map(|p| p.tangent.clone()).collect(),
        det: edge.points.iter().map(|p| p.det_sign).collect(),
        folds: edge.smooth_folds.clone(),
    }
}

fn is_event(kind: VertexKind) -> bool {
    use VertexKind::{Bound, Isolated, Limit, Start};
    !matches!(kind, Start | Bound | Isolated | Limit(_))
}

fn ends(
    edge: &DiagramEdge,
    back: bool,
) -> (
    semismooth::continuation::EdgeEnd,
    semismooth::continuation::EdgeEnd,
) {
    match back {
        false => (edge.from, edge.to),
        true => (edge.to, edge.from),
    }
}

/// The edges of a branch, each with whether it is traversed backwards. As in the talk, a branch begins at the end with a positive
/// determinant, or else at the larger α.
fn walk(diagram: &Diagram, branch: &DiagramBranch) -> Vec<(usize, bool)> {
    let end = |&(e, back): &(usize, bool), last: bool| {
        let points = &diagram.edges()[e].points;
        let point = if back == last {
            points.first()
        } else {
            points.last()
        };
        point.map_or((0, f64::NAN), |p| (p.det_sign.unwrap_or(0), p.parameter()))
    };
    let mut walk = branch.edges.clone();
    if let (Some(first), Some(last), false) = (branch.edges.first(), branch.edges.last(), branch.closed) {
        let (first, last) = (end(first, false), end(last, true));
        if last.0 > first.0 || (last.0 == first.0 && last.1 > first.1) {
            walk.reverse();
            walk.iter_mut().for_each(|e| e.1 = !e.1);
        }
    }
    walk
}
