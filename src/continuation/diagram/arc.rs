//! An edge while it is followed, and the kind of a vertex from its arms.

use super::{EdgeEnd, VertexArm, VertexKind};
use crate::continuation::point::kind_of;
use crate::continuation::{Arm, Point, PointKind};

/// An edge that is being followed.
pub(super) struct Arc {
    pub(super) from: EdgeEnd,
    pub(super) base: f64,
    pub(super) points: Vec<Point>,
    pub(super) smooth_folds: Vec<usize>,
}

impl Arc {
    pub(super) fn new(from: EdgeEnd, first: Point) -> Self {
        let mut arc = Self {
            from,
            base: first.arclength,
            points: Vec::new(),
            smooth_folds: Vec::new(),
        };
        arc.push(first);
        arc
    }

    pub(super) fn push(&mut self, mut point: Point) {
        point.arclength -= self.base;
        self.points.push(point);
    }

    /// The point at which the edge ends, for events that record no point.
    pub(super) fn last_point(
        &self,
        x: &[f64],
        tangent: &[f64],
        arclength: f64,
        residual_norm: f64,
    ) -> Option<Point> {
        let last = self.points.last()?;
        let mut point = last.clone();
        point.x = x.to_vec();
        point.tangent = tangent.to_vec();
        point.arclength = arclength;
        point.residual_norm = residual_norm;
        point.kind = PointKind::Step;
        Some(point)
    }

    /// At singular ends the sign of the determinant is that of the interior.
    pub(super) fn settle_signs(&mut self, ends: [bool; 2]) {
        let last = self.points.len() - 1;
        if last < 2 {
            return;
        }
        if ends[0] {
            self.points[0].det_sign = self.points[1].det_sign;
        }
        if ends[1] {
            self.points[last].det_sign = self.points[last - 1].det_sign;
        }
    }
}

/// The arm on which a curve that arrives at a point would leave it again.
pub(super) fn reversed(point: &Point) -> Arm {
    let tangent = point.tangent.iter().map(|t| -t).collect();
    let grazing = point.grazing.clone();
    Arm::along(point.selection.clone(), tangent, grazing, point.det_sign)
}

/// The kind of a vertex with these arms.
pub(super) fn kind_of_slots(slots: &[VertexArm]) -> VertexKind {
    let arms: Vec<Arm> = slots.iter().map(|s| s.arm.clone()).collect();
    kind_of(&arms)
}
