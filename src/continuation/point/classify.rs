//! What a point is, by its arms and the direction of α on each.

use super::Arms;
use crate::continuation::{Arm, VertexKind};

impl Arms {
    /// The kind of the point they leave.
    pub(in crate::continuation) fn kind(&self) -> VertexKind {
        match self.continua.is_empty() {
            true => kind_of(&self.list),
            false => VertexKind::Continuum,
        }
    }
}

/// The kind of a point from which exactly these arms leave.
pub(in crate::continuation) fn kind_of(arms: &[Arm]) -> VertexKind {
    match arms {
        [] => VertexKind::Isolated,
        [_] => VertexKind::End,
        [a, b] => match (a.direction, b.direction) {
            (0, _) | (_, 0) => VertexKind::Vertical,
            (a, b) if a == b => VertexKind::Fold,
            _ => VertexKind::PassThrough,
        },
        _ => VertexKind::Branching,
    }
}
