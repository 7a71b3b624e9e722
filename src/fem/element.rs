//! Reference elements: shape functions, quadrature, topology.

use crate::words::named;

/// Kinds of cells: with linear (simplices) or multilinear (boxes) shape functions, and a triangle of second order.
///
/// Nodes are numbered as in Gmsh and VTK: counter-clockwise in the plane; a tetrahedron with its fourth node on the side to which the
/// normal of the first three points; a hexahedron as bottom face counter-clockwise seen from above, then top face. The
/// six nodes of a triangle of second order are its corners, then the middles of the edges from the first to the second corner, from the
/// second to the third and back, which may lie beside the chords.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CellKind {
    /// Three nodes (P1).
    Triangle,
    /// Four nodes (Q1).
    Quadrilateral,
    /// Four nodes (P1).
    Tetrahedron,
    /// Eight nodes (Q1).
    Hexahedron,
    /// Six nodes (P2), isoparametric.
    Triangle6,
}

named!(CellKind, "kind of cell", Self::ALL);

/// Largest number of nodes of a cell.
pub(super) const MAX_NODES: usize = 8;

const G: f64 = 0.577_350_269_189_625_8;

impl CellKind {
    const ALL: [Self; 5] = [
        Self::Triangle,
        Self::Quadrilateral,
        Self::Tetrahedron,
        Self::Hexahedron,
        Self::Triangle6,
    ];

    /// 2 or 3.
    #[must_use]
    pub const fn dim(self) -> usize {
        match self {
            Self::Triangle | Self::Quadrilateral | Self::Triangle6 => 2,
            Self::Tetrahedron | Self::Hexahedron => 3,
        }
    }

    /// Number of nodes.
    #[must_use]
    pub const fn num_nodes(self) -> usize {
        match self {
            Self::Triangle => 3,
            Self::Quadrilateral | Self::Tetrahedron => 4,
            Self::Hexahedron => 8,
            Self::Triangle6 => 6,
        }
    }

    /// "triangle", "quadrilateral", "tetrahedron", "hexahedron" or "triangle6".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Triangle => "triangle",
            Self::Quadrilateral => "quadrilateral",
            Self::Tetrahedron => "tetrahedron",
            Self::Hexahedron => "hexahedron",
            Self::Triangle6 => "triangle6",
        }
    }

    /// Local nodes of the facets (edges in the plane, faces in space), ordered so that the normal points outwards: corners, then the
    /// middle of an edge of second order.
    #[must_use]
    pub const fn facets(self) -> &'static [&'static [usize]] {
        match self {
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Quadrilateral => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            Self::Triangle6 => &[&[0, 1, 3], &[1, 2, 4], &[2, 0, 5]],
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]],
            Self::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
        }
    }

    /// Quadrature points and weights on the reference cell, exact for the stiffness of an undistorted cell.
    pub(super) fn quadrature(self) -> Vec<([f64; 3], f64)> {
        match self {
            // Degree 4: D. A. Dunavant, Int. J. Numer. Methods Eng. 21 (1985).
            Self::Triangle6 => [
                (0.445_948_490_915_964_9, 0.111_690_794_839_005_7),
                (0.091_576_213_509_770_74, 0.054_975_871_827_660_93),
            ]
            .iter()
            .flat_map(|&(a, w)| {
                [[a, a], [1.0 - 2.0 * a, a], [a, 1.0 - 2.0 * a]].map(|[x, y]| ([x, y, 0.0], w))
            })
            .collect(),
            Self::Triangle => vec![
                ([1.0 / 6.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
                ([2.0 / 3.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
                ([1.0 / 6.0, 2.0 / 3.0, 0.0], 1.0 / 6.0),
            ],
            Self::Quadrilateral => [-G, G]
                .iter()
                .flat_map(|&y| [-G, G].map(|x| ([x, y, 0.0], 1.0)))
                .collect(),
            Self::Tetrahedron => {
                let (a, b) = (0.585_410_196_624_968_5, 0.138_196_601_125_010_5);
                [[b, b, b], [a, b, b], [b, a, b], [b, b, a]]
                    .map(|p| (p, 1.0 / 24.0))
                    .to_vec()
            }
            Self::Hexahedron => {
                let mut points = Vec::with_capacity(8);
                for z in [-G, G] {
                    for y in [-G, G] {
                        points.extend([-G, G].map(|x| ([x, y, z], 1.0)));
                    }
                }
                points
            }
        }
    }

    /// Whether gradients are constant on a cell, so that one quadrature point integrates the stiffness.
    pub(super) const fn is_simplex(self) -> bool {
        matches!(self, Self::Triangle | Self::Tetrahedron)
    }

    /// Quadrilaterals and hexahedra of first order.
    pub(super) const fn is_box(self) -> bool {
        matches!(self, Self::Quadrilateral | Self::Hexahedron)
    }

    /// The centre of the reference cell.
    pub(super) const fn centre(self) -> [f64; 3] {
        match self {
            Self::Triangle | Self::Triangle6 => [1.0 / 3.0; 3],
            Self::Tetrahedron => [0.25; 3],
            Self::Quadrilateral | Self::Hexahedron => [0.0; 3],
        }
    }

    /// Nodes of the reference cell.
    pub(super) const fn corners(self) -> &'static [[f64; 3]] {
        match self {
            Self::Triangle6 => &[
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.5, 0.0, 0.0],
                [0.5, 0.5, 0.0],
                [0.0, 0.5, 0.0],
            ],
            Self::Triangle => &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            Self::Quadrilateral => &[
                [-1.0, -1.0, 0.0],
                [1.0, -1.0, 0.0],
                [1.0, 1.0, 0.0],
                [-1.0, 1.0, 0.0],
            ],
            Self::Tetrahedron => &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Self::Hexahedron => &[
                [-1.0, -1.0, -1.0],
                [1.0, -1.0, -1.0],
                [1.0, 1.0, -1.0],
                [-1.0, 1.0, -1.0],
                [-1.0, -1.0, 1.0],
                [1.0, -1.0, 1.0],
                [1.0, 1.0, 1.0],
                [-1.0, 1.0, 1.0],
            ],
        }
    }

    /// Values and reference gradients of the shape functions.
    pub(super) fn shape(self, x: [f64; 3]) -> ([f64; MAX_NODES], [[f64; 3]; MAX_NODES]) {
        let mut value = [0.0; MAX_NODES];
        let mut gradient = [[0.0; 3]; MAX_NODES];
        if self == Self::Triangle6 {
            // By barycentric coordinates: λ (2 λ − 1) at corners, 4 λ μ at the middles of edges.
            let l = [1.0 - x[0] - x[1], x[0], x[1]];
            let d = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
            for a in 0..3 {
                let b = (a + 1) % 3;
                value[a] = l[a] * (2.0 * l[a] - 1.0);
                value[3 + a] = 4.0 * l[a] * l[b];
                for k in 0..2 {
                    gradient[a][k] = (4.0 * l[a] - 1.0) * d[a][k];
                    gradient[3 + a][k] = 4.0 * (l[a] * d[b][k] + l[b] * d[a][k]);
                }
            }
        } else if self.is_simplex() {
            let dim = self.dim();
            value[0] = 1.0;
            for d in 0..dim {
                value[0] -= x[d];
                value[d + 1] = x[d];
                gradient[0][d] = -1.0;
                gradient[d + 1][d] = 1.0;
            }
        } else {
            let dim = self.dim();
            for (a, corner) in self.corners().iter().enumerate() {
                let factor = |d: usize| 0.5 * (1.0 + corner[d] * x[d]);
                value[a] = (0..dim).map(factor).product();
                for d in 0..dim {
                    gradient[a][d] =
                        0.5 * corner[d] * (0..dim).filter(|&e| e != d).map(factor).product::<f64>();
                }
            }
        }
        (value, gradient)
    }
}

/// Quadrature on a facet of a body of a dimension, with the given number of nodes (in the plane 2, or 3 with the middle of a segment of
/// second order; in space 3: triangle, 4: quadrilateral): shape values at each point, reference gradients, weight.
pub(super) fn facet_quadrature(dim: usize, nodes: usize) -> Vec<FacetPoint> {
    let kind = match (dim, nodes) {
        (2, 3) => {
            let far = 0.6f64.sqrt();
            return [(-far, 5.0 / 9.0), (0.0, 8.0 / 9.0), (far, 5.0 / 9.0)]
                .map(|(s, weight)| FacetPoint { weight, ..segment(s) })
                .to_vec();
        }
        (2, _) => {
            return [-G, G]
                .map(|s| FacetPoint {
                    value: [0.5 * (1.0 - s), 0.5 * (1.0 + s), 0.0, 0.0],
                    gradient: [[-0.5, 0.0], [0.5, 0.0], [0.0; 2], [0.0; 2]],
                    weight: 1.0,
                })
                .to_vec();
        }
        (_, 3) => CellKind::Triangle,
        _ => CellKind::Quadrilateral,
    };
    kind.quadrature()
        .into_iter()
        .map(|(x, weight)| {
            let (v, g) = kind.shape(x);
            FacetPoint {
                value: [v[0], v[1], v[2], v[3]],
                gradient: std::array::from_fn(|a| [g[a][0], g[a][1]]),
                weight,
            }
        })
        .collect()
}

/// A segment of second order at −1 ≤ s ≤ 1: ends, then the middle.
pub(super) fn segment(s: f64) -> FacetPoint {
    FacetPoint {
        value: [0.5 * s * (s - 1.0), 0.5 * s * (s + 1.0), 1.0 - s * s, 0.0],
        gradient: [[s - 0.5, 0.0], [s + 0.5, 0.0], [-2.0 * s, 0.0], [0.0; 2]],
        weight: 0.0,
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct FacetPoint {
    pub(super) value: [f64; 4],
    pub(super) gradient: [[f64; 2]; 4],
    pub(super) weight: f64,
}

/// Geometry of a cell at a reference point: shape values, physical gradients, det of the Jacobian.
pub(super) fn map_cell(
    kind: CellKind,
    corners: &[[f64; 3]],
    x: [f64; 3],
) -> ([f64; MAX_NODES], [[f64; 3]; MAX_NODES], f64) {
    let (value, reference) = kind.shape(x);
    let dim = kind.dim();
    // j[d][e] = ∂x_d/∂ξ_e
    let mut j = [[0.0; 3], [0.0; 3], [0.0, 0.0, 1.0]];
    if dim == 3 {
        j[2] = [0.0; 3];
    }
    for (corner, g) in corners.iter().zip(&reference) {
        for d in 0..dim {
            for e in 0..dim {
                j[d][e] += corner[d] * g[e];
            }
        }
    }
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        j[r1][c1] * j[r2][c2] - j[r1][c2] * j[r2][c1]
    };
    let det: f64 = (0..3).map(|c| j[0][c] * cofactor(0, c)).sum();
    let mut gradient = [[0.0; 3]; MAX_NODES];
    for (a, g) in gradient.iter_mut().enumerate().take(kind.num_nodes()) {
        for d in 0..dim {
            g[d] = (0..dim).map(|e| cofactor(d, e) * reference[a][e]).sum::<f64>() / det;
        }
    }
    (value, gradient, det)
}
