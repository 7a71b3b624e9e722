//! Diagrams as read from files: refused where a vertex, arm or edge is out of range, so that queries cannot fail.

use super::{Diagram, DiagramCompleteness, DiagramEdge, DiagramVertex};
use crate::piecewise::PiecewiseError;

/// The fields of a [`Diagram`].
#[derive(serde::Deserialize)]
#[serde(rename = "Diagram")]
pub(super) struct Unchecked {
    vertices: Vec<DiagramVertex>,
    edges: Vec<DiagramEdge>,
    completeness: DiagramCompleteness,
    #[serde(with = "crate::extended::pair")]
    range: (f64, f64),
    same_point: f64,
    points: usize,
    #[serde(default)]
    sizes: Vec<f64>,
}

impl TryFrom<Unchecked> for Diagram {
    type Error = PiecewiseError;

    fn try_from(read: Unchecked) -> Result<Self, PiecewiseError> {
        let diagram = Self {
            vertices: read.vertices,
            edges: read.edges,
            completeness: read.completeness,
            range: read.range,
            same_point: read.same_point,
            points: read.points,
            sizes: read.sizes,
        };
        diagram.check_structure()?;
        Ok(diagram)
    }
}
