//! Integration over facets of the boundary.

use super::Mesh;
use super::element::{facet_quadrature, segment};
use super::mesh::{cross, norm};

/// Calls `f(point, shape values, weight × measure)` at the quadrature points of a facet.
pub(super) fn integrate(mesh: &Mesh, nodes: &[usize], f: impl FnMut([f64; 3], &[f64], f64)) {
    over_facet(mesh.dim(), mesh.points(), nodes, f);
}

fn over_facet(dim: usize, points: &[[f64; 3]], nodes: &[usize], mut f: impl FnMut([f64; 3], &[f64], f64)) {
    for q in facet_quadrature(dim, nodes.len()) {
        let (at, measure) = geometry(points, nodes, &q.value, &q.gradient);
        f(at, &q.value[..nodes.len()], q.weight * measure);
    }
}

/// The same on each part of a facet that lies nearest to one of its corners in reference coordinates (halves of a segment, quarters
/// of a quadrilateral, thirds of a triangle): `f(corner, point, shape values, weight × measure)`.
pub(super) fn integrate_parts(mesh: &Mesh, nodes: &[usize], f: impl FnMut(usize, [f64; 3], &[f64], f64)) {
    over_parts(mesh.dim(), mesh.points(), nodes, f);
}

fn over_parts(
    dim: usize,
    points: &[[f64; 3]],
    nodes: &[usize],
    mut f: impl FnMut(usize, [f64; 3], &[f64], f64),
) {
    let rule = facet_quadrature(dim, nodes.len());
    let k = nodes.len();
    if dim == 2 && k == 3 {
        for (corner, shift) in [(0, -0.5), (1, 0.5)] {
            for (q, s) in rule.iter().zip([-0.6f64.sqrt(), 0.0, 0.6f64.sqrt()]) {
                let here = segment(shift + 0.5 * s);
                let (at, measure) = geometry(points, nodes, &here.value, &here.gradient);
                f(corner, at, &here.value[..3], 0.5 * q.weight * measure);
            }
        }
        return;
    }
    if k == 3 {
        // Corner, middle of an edge, centroid: six triangles of a sixth of the area.
        for corner in 0..3 {
            for other in [(corner + 1) % 3, (corner + 2) % 3] {
                for q in &rule {
                    let mut shape = [0.0; 4];
                    for a in 0..3 {
                        shape[a] = q.value[2] / 3.0;
                    }
                    shape[corner] += q.value[0] + 0.5 * q.value[1];
                    shape[other] += 0.5 * q.value[1];
                    let (at, measure) = geometry(points, nodes, &shape, &q.gradient);
                    f(corner, at, &shape[..3], q.weight * measure / 6.0);
                }
            }
        }
        return;
    }
    // Each part is the facet shrunk by half towards its corner: the shape functions at a point of it follow by averaging.
    for corner in 0..k {
        for q in &rule {
            let mut shape = [0.0; 4];
            let sign = |a: usize| match k {
                2 => [2.0 * a as f64 - 1.0, 0.0],
                _ => [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][a],
            };
            let mut x = [0.0; 2];
            for a in 0..k {
                for d in 0..2 {
                    x[d] += q.value[a] * sign(a)[d];
                }
            }
            let x: [f64; 2] = std::array::from_fn(|d| 0.5 * (x[d] + sign(corner)[d]));
            let mut gradient = [[0.0; 2]; 4];
            for a in 0..k {
                let s = sign(a);
                if k == 2 {
                    shape[a] = 0.5 * (1.0 + s[0] * x[0]);
                    gradient[a][0] = 0.5 * s[0];
                } else {
                    shape[a] = 0.25 * (1.0 + s[0] * x[0]) * (1.0 + s[1] * x[1]);
                    gradient[a] = [
                        0.25 * s[0] * (1.0 + s[1] * x[1]),
                        0.25 * s[1] * (1.0 + s[0] * x[0]),
                    ];
                }
            }
            let (at, measure) = geometry(points, nodes, &shape, &gradient);
            f(corner, at, &shape[..k], q.weight * measure / k as f64);
        }
    }
}

/// Point and measure (length or area per unit of the reference facet).
fn geometry(
    points: &[[f64; 3]],
    nodes: &[usize],
    shape: &[f64; 4],
    gradient: &[[f64; 2]; 4],
) -> ([f64; 3], f64) {
    let (mut at, mut tangents) = ([0.0; 3], [[0.0; 3]; 2]);
    for (a, &node) in nodes.iter().enumerate() {
        for d in 0..3 {
            at[d] += shape[a] * points[node][d];
            tangents[0][d] += gradient[a][0] * points[node][d];
            tangents[1][d] += gradient[a][1] * points[node][d];
        }
    }
    // Segments have no second tangent.
    let measure = if gradient.iter().all(|g| g[1] == 0.0) {
        norm(tangents[0])
    } else {
        norm(cross(tangents[0], tangents[1]))
    };
    (at, measure)
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
            // Near the middle of the first two.
            [1.03, 0.03, 0.2],
        ];
        for (dim, nodes) in [
            (2, vec![0, 1]),
            (2, vec![0, 1, 4]),
            (3, vec![0, 1, 2]),
            (3, vec![0, 1, 2, 3]),
        ] {
            let (mut whole, mut parts) = ([0.0; 4], [0.0; 4]);
            let mut size = [0.0; 4];
            over_facet(dim, &points, &nodes, |x, shape, w| {
                assert!((shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                for d in 0..3 {
                    whole[d] += w * x[d];
                }
                whole[3] += w;
            });
            over_parts(dim, &points, &nodes, |corner, x, shape, w| {
                assert!((shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                assert!(dim == 2 && nodes.len() == 3 || shape.iter().all(|s| shape[corner] >= *s));
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
