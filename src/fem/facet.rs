//! Integration over facets of the boundary.

use super::Mesh;
use super::element::{MAX_FACET, Reference, Sample};
use super::place::Place;
use super::vectors::norm;

/// Calls `f(point, shape values, weight × measure)` at the quadrature points of a facet.
pub(super) fn integrate(mesh: &Mesh, nodes: &[usize], f: impl FnMut([f64; 3], &[f64], f64)) {
    over_facet(mesh.dim(), mesh.points(), nodes, f);
}

/// The same with the unit normal: `f(point, shape values, weight × measure, normal)`.
pub(super) fn integrate_with_normals(
    mesh: &Mesh,
    nodes: &[usize],
    mut f: impl FnMut([f64; 3], &[f64], f64, [f64; 3]),
) {
    let (dim, reference) = (mesh.dim(), Reference::of_facet(mesh.dim(), nodes.len()));
    for sample in &reference.table().quadrature {
        let here = Place::of(&sample.value, &sample.gradient, mesh.points(), nodes);
        let (measure, normal) = here.measure(dim);
        f(here.at, &sample.value, sample.weight * measure, normal);
    }
}

fn over_facet(dim: usize, points: &[[f64; 3]], nodes: &[usize], mut f: impl FnMut([f64; 3], &[f64], f64)) {
    let reference = Reference::of_facet(dim, nodes.len());
    for sample in &reference.table().quadrature {
        let here = Place::of(&sample.value, &sample.gradient, points, nodes);
        f(here.at, &sample.value, sample.weight * norm(here.area(dim)));
    }
}

/// The same on each part of a facet that lies nearest to one of its corners in reference coordinates (halves of a segment, quarters
/// of a quadrilateral, thirds of a triangle): `f(corner, point, shape values, weight × measure, unit normal)`.
pub(super) fn integrate_parts(
    mesh: &Mesh,
    nodes: &[usize],
    f: impl FnMut(usize, [f64; 3], &[f64], f64, [f64; 3]),
) {
    over_parts(mesh.dim(), mesh.points(), nodes, f);
}

fn over_parts(
    dim: usize,
    points: &[[f64; 3]],
    nodes: &[usize],
    mut f: impl FnMut(usize, [f64; 3], &[f64], f64, [f64; 3]),
) {
    let reference = Reference::of_facet(dim, nodes.len());
    let (rule, corners) = (&reference.table().quadrature, reference.linear().points());
    let k = corners.len();
    let mut add = |corner: usize, x: [f64; 3], weight: f64| {
        let (mut shape, mut gradient) = ([0.0; MAX_FACET], [[0.0; 3]; MAX_FACET]);
        reference.functions(x, &mut shape, &mut gradient);
        let here = Place::of(&shape, &gradient, points, nodes);
        let (measure, normal) = here.measure(dim);
        f(corner, here.at, &shape[..nodes.len()], weight * measure, normal);
    };
    for corner in 0..k {
        if reference.is_simplex() {
            // Corner, middle of an edge, centroid: six triangles of a sixth of the area.
            for other in [(corner + 1) % 3, (corner + 2) % 3] {
                for Sample { at: x, weight, .. } in rule {
                    let mut l = [x[1] / 3.0; 3];
                    l[corner] += 1.0 - x[0] - x[1] + 0.5 * x[0];
                    l[other] += 0.5 * x[0];
                    add(corner, [l[1], l[2], 0.0], weight / 6.0);
                }
            }
        } else {
            // The facet shrunk by half towards its corner.
            for Sample { at: x, weight, .. } in rule {
                let x = std::array::from_fn(|d| 0.5 * (x[d] + corners[corner][d]));
                add(corner, x, weight / k as f64);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The parts of a facet have its measure in sum, and each has its share of the measure and of the first moments.
    #[test]
    fn parts_make_up_the_facet() {
        let points = [
            [0.0, 0.0, 0.3],
            [2.0, 0.1, 0.1],
            [1.7, 1.5, 0.0],
            [-0.2, 1.1, 0.4],
            // Near the middles of the edges of the quadrilateral, and of its centre.
            [1.03, 0.03, 0.2],
            [1.8, 0.8, 0.0],
            [0.75, 1.2, 0.2],
            [-0.1, 0.6, 0.33],
            [0.8, 0.65, 0.21],
            // Of the triangle.
            [0.85, 0.77, 0.14],
        ];
        for (dim, nodes) in [
            (2, vec![0, 1]),
            (2, vec![0, 1, 4]),
            (3, vec![0, 1, 2]),
            (3, vec![0, 1, 2, 3]),
            (3, vec![0, 1, 2, 4, 5, 9]),
            (3, vec![0, 1, 2, 3, 4, 5, 6, 7]),
            (3, vec![0, 1, 2, 3, 4, 5, 6, 7, 8]),
        ] {
            let corners = Reference::of_facet(dim, nodes.len()).num_corners();
            let (mut whole, mut parts) = ([0.0; 4], [0.0; 4]);
            let mut size = [0.0; 4];
            over_facet(dim, &points, &nodes, |x, shape, w| {
                assert!((shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                for d in 0..3 {
                    whole[d] += w * x[d];
                }
                whole[3] += w;
            });
            over_parts(dim, &points, &nodes, |corner, x, shape, w, _| {
                assert!((shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                assert!(nodes.len() > corners || shape.iter().all(|s| shape[corner] >= *s));
                for d in 0..3 {
                    parts[d] += w * x[d];
                }
                parts[3] += w;
                size[corner] += w;
            });
            // The area element of a skew quadrilateral or a bent segment is not a polynomial.
            let straight = nodes.len() == dim;
            let tolerance = if straight { 1e-14 } else { 1e-2 };
            for d in 0..4 {
                assert!(
                    (whole[d] - parts[d]).abs() <= tolerance * whole[3],
                    "{whole:?} {parts:?}"
                );
            }
            if straight {
                let share = whole[3] / nodes.len() as f64;
                assert!(size[..nodes.len()].iter().all(|s| (s - share).abs() < 1e-14));
            }
        }
    }
}
