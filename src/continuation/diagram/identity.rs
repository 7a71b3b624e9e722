//! Whether points next to each other are one, or lie on different curves.

use super::{Diagram, DiagramVertex};
use crate::continuation::point::coincidence::SAFETY;
use crate::continuation::start::solver;
use crate::newton::MoorePenrose;
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::sparse::{distance, norm};

/// A point on the curve of a selection.
pub(super) type Place<'p> = (&'p [f64], &'p Selection);

/// Whether two points lie on different curves: where these meet the plane through the first point across `normal` they are farther apart
/// than rounding of H and the last corrections explain. `false` where they are not found there, as next to singular points.
pub(super) fn told_apart(map: &dyn PiecewiseSmooth, normal: &[f64], places: [Place<'_>; 2]) -> bool {
    let [first, second] = places;
    let near = distance(first.0, second.0);
    let Ok(mut corrector) = MoorePenrose::new(map, solver()) else {
        return false;
    };
    let (mut points, mut error) = (Vec::new(), 0.0);
    for (x, selection) in places {
        let (mut y, mut t) = (x.to_vec(), normal.to_vec());
        let corrected = corrector.correct_in_plane(map, selection, (first.0, normal, 0.0), &mut y, &mut t);
        match corrected {
            Ok((c, _)) if c.converged && distance(x, &y) <= near => error += 2.0 * c.step_norm,
            _ => return false,
        }
        points.push(y);
    }
    let apart = distance(&points[0], &points[1]);
    if apart <= error {
        return false;
    }
    let direction: Vec<f64> = (points[0].iter().zip(&points[1]))
        .map(|(a, b)| (b - a) / apart)
        .collect();
    for ((_, selection), y) in places.iter().zip(&points) {
        let at = corrector.factorise(&map, selection, y, Some(normal)).ok();
        let Some(rounding) = at.and_then(|mut at| at.rounding_of(&direction, y, normal)) else {
            return false;
        };
        // Corrections are solved for relative to the whole point, not entry by entry.
        error += SAFETY * (rounding + f64::EPSILON * norm(y));
    }
    apart > error
}

impl Diagram {
    /// The vertex nearest to a point of a curve with this normal of a plane across it, if it is within the distance of one vertex and no
    /// vertex of other curves.
    pub(super) fn vertex_at(
        &self,
        map: &dyn PiecewiseSmooth,
        place: Place<'_>,
        normal: &[f64],
    ) -> Option<usize> {
        let reach = self.same_point * (1.0 + norm(place.0));
        let far = |v: &usize| distance(&self.vertices[*v].x, place.0);
        let near = (0..self.vertices.len()).filter(|v| far(v) <= reach);
        let same = near.filter(|&v| self.vertices[v].may_hold(map, place, normal));
        same.min_by(|a, b| far(a).total_cmp(&far(b)))
    }
}

impl DiagramVertex {
    /// Whether the curve of a point next to the vertex may be one of its own.
    pub(super) fn may_hold(&self, map: &dyn PiecewiseSmooth, place: Place<'_>, normal: &[f64]) -> bool {
        let own = |arm: &super::VertexArm| !told_apart(map, normal, [place, (&self.x, &arm.arm.selection)]);
        !self.complete || self.arms.is_empty() || self.arms.iter().any(own)
    }
}
