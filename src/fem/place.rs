//! Points of facets.

use super::element::Reference;
use super::vectors::{cross, norm};

/// A point of a facet, with its tangents along the reference coordinates.
pub(super) struct Place {
    pub(super) at: [f64; 3],
    tangents: [[f64; 3]; 2],
}

impl Place {
    /// From values and reference gradients of the shape functions there.
    pub(super) fn of(shape: &[f64], gradient: &[[f64; 3]], points: &[[f64; 3]], nodes: &[usize]) -> Self {
        let (mut at, mut tangents) = ([0.0; 3], [[0.0; 3]; 2]);
        for (a, &node) in nodes.iter().enumerate() {
            for d in 0..3 {
                at[d] += shape[a] * points[node][d];
                tangents[0][d] += gradient[a][0] * points[node][d];
                tangents[1][d] += gradient[a][1] * points[node][d];
            }
        }
        Self { at, tangents }
    }

    /// A vector of the length or area per unit of the reference facet; in space it is normal to the facet.
    pub(super) fn area(&self, dim: usize) -> [f64; 3] {
        match dim {
            2 => self.tangents[0],
            _ => cross(self.tangents[0], self.tangents[1]),
        }
    }

    /// Length or area per unit of the reference facet, and the unit normal.
    pub(super) fn measure(&self, dim: usize) -> (f64, [f64; 3]) {
        let area = self.area(dim);
        let normal = match dim {
            2 => [area[1], -area[0], 0.0],
            _ => area,
        };
        let measure = norm(area);
        (measure, normal.map(|n| n / measure))
    }
}

/// ∫ of the normal over a facet in space.
pub(super) fn area_in_space(points: &[[f64; 3]], nodes: &[usize]) -> [f64; 3] {
    let reference = Reference::of_facet(3, nodes.len());
    let mut sum = [0.0; 3];
    for sample in &reference.table().quadrature {
        let area = Place::of(&sample.value, &sample.gradient, points, nodes).area(3);
        (0..3).for_each(|d| sum[d] += sample.weight * area[d]);
    }
    sum
}
