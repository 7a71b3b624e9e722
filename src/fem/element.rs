//! Reference elements: nodes, shape functions, quadrature, facets.

use std::sync::OnceLock;

use super::vectors::{cross, dot};
use crate::words::named;

/// Kinds of cells: with linear (simplices) or multilinear (boxes) shape functions, and isoparametric ones of second order.
///
/// Corners are numbered as in Gmsh and VTK: counter-clockwise in the plane; a tetrahedron with its fourth node on the side to which the
/// normal of the first three points; a hexahedron as bottom face counter-clockwise seen from above, then top face, a wedge likewise; a
/// pyramid as bottom face counter-clockwise seen from the apex, then the apex. In cells of second order
/// the other nodes follow as in VTK: the middles of the edges, which may lie beside the chords (of triangles and quadrilaterals in the order
/// of the [facets](Self::facets), from the first corner to the second and on round the cell; of tetrahedra around the first three corners,
/// then up to the fourth; of the others around the bottom, around the top, then upwards), the middles of the faces (of the 27 nodes those at
/// −x, x, −y, y, −z, z of the reference cell), the centre.
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
    /// Six nodes (P2).
    Triangle6,
    /// Eight nodes (serendipity): the middles of the edges.
    Quadrilateral8,
    /// Nine nodes (Q2).
    Quadrilateral9,
    /// Ten nodes (P2).
    Tetrahedron10,
    /// Twenty nodes (serendipity): the middles of the edges.
    Hexahedron20,
    /// Twenty-seven nodes (Q2).
    Hexahedron27,
    /// Six nodes: P1 in the triangle, times linear functions upwards.
    Wedge,
    /// Fifteen nodes (serendipity): the middles of the edges.
    Wedge15,
    /// Five nodes: rational functions (G. Bedrosian, Int. J. Numer. Methods Eng. 35 (1992)), linear on the edges.
    Pyramid,
    /// Thirteen nodes, of the same family: the middles of the edges.
    Pyramid13,
}

named!(CellKind, "kind of cell", Self::ALL);

/// Largest number of nodes of a cell.
pub(super) const MAX_NODES: usize = 27;
/// Largest number of nodes of a facet.
pub(super) const MAX_FACET: usize = 9;

impl CellKind {
    const ALL: [Self; 14] = [
        Self::Triangle,
        Self::Quadrilateral,
        Self::Tetrahedron,
        Self::Hexahedron,
        Self::Triangle6,
        Self::Quadrilateral8,
        Self::Quadrilateral9,
        Self::Tetrahedron10,
        Self::Hexahedron20,
        Self::Hexahedron27,
        Self::Wedge,
        Self::Wedge15,
        Self::Pyramid,
        Self::Pyramid13,
    ];

    pub(super) const fn reference(self) -> Reference {
        let (shape, nodes) = match self {
            Self::Triangle => (Shape::Triangle, 3),
            Self::Triangle6 => (Shape::Triangle, 6),
            Self::Quadrilateral => (Shape::Quadrilateral, 4),
            Self::Quadrilateral8 => (Shape::Quadrilateral, 8),
            Self::Quadrilateral9 => (Shape::Quadrilateral, 9),
            Self::Tetrahedron => (Shape::Tetrahedron, 4),
            Self::Tetrahedron10 => (Shape::Tetrahedron, 10),
            Self::Hexahedron => (Shape::Hexahedron, 8),
            Self::Hexahedron20 => (Shape::Hexahedron, 20),
            Self::Hexahedron27 => (Shape::Hexahedron, 27),
            Self::Wedge => (Shape::Wedge, 6),
            Self::Wedge15 => (Shape::Wedge, 15),
            Self::Pyramid => (Shape::Pyramid, 5),
            Self::Pyramid13 => (Shape::Pyramid, 13),
        };
        Reference { shape, nodes }
    }

    /// 2 or 3.
    #[must_use]
    pub const fn dim(self) -> usize {
        self.reference().dim()
    }

    /// Number of nodes.
    #[must_use]
    pub const fn num_nodes(self) -> usize {
        self.reference().nodes
    }

    /// Number of corners, which are the first nodes.
    #[must_use]
    pub const fn num_corners(self) -> usize {
        self.reference().num_corners()
    }

    /// 1, or 2 where there are nodes beside the corners.
    #[must_use]
    pub const fn order(self) -> usize {
        if self.reference().is_linear() { 1 } else { 2 }
    }

    /// "triangle", "quadrilateral", "tetrahedron", "hexahedron", "wedge", "pyramid", of second order with the number of nodes: "triangle6".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Triangle => "triangle",
            Self::Quadrilateral => "quadrilateral",
            Self::Tetrahedron => "tetrahedron",
            Self::Hexahedron => "hexahedron",
            Self::Triangle6 => "triangle6",
            Self::Quadrilateral8 => "quadrilateral8",
            Self::Quadrilateral9 => "quadrilateral9",
            Self::Tetrahedron10 => "tetrahedron10",
            Self::Hexahedron20 => "hexahedron20",
            Self::Hexahedron27 => "hexahedron27",
            Self::Wedge => "wedge",
            Self::Wedge15 => "wedge15",
            Self::Pyramid => "pyramid",
            Self::Pyramid13 => "pyramid13",
        }
    }

    /// Local nodes of the facets (edges in the plane, faces in space), ordered so that the normal points outwards: corners, then the
    /// middles of the edges from each to the next, then that of the face.
    #[must_use]
    pub const fn facets(self) -> &'static [&'static [usize]] {
        match self {
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Triangle6 => &[&[0, 1, 3], &[1, 2, 4], &[2, 0, 5]],
            Self::Quadrilateral => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            Self::Quadrilateral8 | Self::Quadrilateral9 => &[&[0, 1, 4], &[1, 2, 5], &[2, 3, 6], &[3, 0, 7]],
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]],
            Self::Tetrahedron10 => &[
                &[0, 2, 1, 6, 5, 4],
                &[0, 1, 3, 4, 8, 7],
                &[1, 2, 3, 5, 9, 8],
                &[0, 3, 2, 7, 9, 6],
            ],
            Self::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
            Self::Hexahedron20 => &[
                &[0, 3, 2, 1, 11, 10, 9, 8],
                &[4, 5, 6, 7, 12, 13, 14, 15],
                &[0, 1, 5, 4, 8, 17, 12, 16],
                &[1, 2, 6, 5, 9, 18, 13, 17],
                &[2, 3, 7, 6, 10, 19, 14, 18],
                &[3, 0, 4, 7, 11, 16, 15, 19],
            ],
            Self::Hexahedron27 => &[
                &[0, 3, 2, 1, 11, 10, 9, 8, 24],
                &[4, 5, 6, 7, 12, 13, 14, 15, 25],
                &[0, 1, 5, 4, 8, 17, 12, 16, 22],
                &[1, 2, 6, 5, 9, 18, 13, 17, 21],
                &[2, 3, 7, 6, 10, 19, 14, 18, 23],
                &[3, 0, 4, 7, 11, 16, 15, 19, 20],
            ],
            Self::Wedge => &[
                &[0, 2, 1],
                &[3, 4, 5],
                &[0, 1, 4, 3],
                &[1, 2, 5, 4],
                &[2, 0, 3, 5],
            ],
            Self::Wedge15 => &[
                &[0, 2, 1, 8, 7, 6],
                &[3, 4, 5, 9, 10, 11],
                &[0, 1, 4, 3, 6, 13, 9, 12],
                &[1, 2, 5, 4, 7, 14, 10, 13],
                &[2, 0, 3, 5, 8, 12, 11, 14],
            ],
            Self::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            Self::Pyramid13 => &[
                &[0, 3, 2, 1, 8, 7, 6, 5],
                &[0, 1, 4, 5, 10, 9],
                &[1, 2, 4, 6, 11, 10],
                &[2, 3, 4, 7, 12, 11],
                &[3, 0, 4, 8, 9, 12],
            ],
        }
    }

    /// Whether gradients are constant on a cell, so that one quadrature point integrates the stiffness.
    pub(super) const fn has_constant_strain(self) -> bool {
        matches!(self, Self::Triangle | Self::Tetrahedron)
    }

    /// Quadrilaterals and hexahedra of first order.
    pub(super) const fn is_box(self) -> bool {
        matches!(self, Self::Quadrilateral | Self::Hexahedron)
    }
}

/// Shapes of cells and their facets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Segment,
    Triangle,
    Quadrilateral,
    Tetrahedron,
    Hexahedron,
    Wedge,
    Pyramid,
}

impl Shape {
    const COUNT: usize = Self::Pyramid as usize + 1;
}

/// A reference cell or facet: simplices with corners at the origin and the unit vectors, boxes (−1, 1)ᵈ, wedges as triangle × (−1, 1),
/// pyramids as (−1, 1)² at height 0 with the apex at height 1. Nodes of second order follow the
/// corners, those of the faces the middles of edges, so that each shape has one table of nodes, and elements the first ones of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reference {
    pub(super) shape: Shape,
    pub(super) nodes: usize,
}

const SEGMENT: [[f64; 3]; 3] = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]];
const TRIANGLE: [[f64; 3]; 6] = [
    [0.0; 3],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
];
const QUADRILATERAL: [[f64; 3]; 9] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0; 3],
];
const TETRAHEDRON: [[f64; 3]; 10] = [
    [0.0; 3],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
    [0.0, 0.0, 0.5],
    [0.5, 0.0, 0.5],
    [0.0, 0.5, 0.5],
];
const HEXAHEDRON: [[f64; 3]; 27] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    [0.0; 3],
];
const WEDGE: [[f64; 3]; 15] = [
    [0.0, 0.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [0.5, 0.0, -1.0],
    [0.5, 0.5, -1.0],
    [0.0, 0.5, -1.0],
    [0.5, 0.0, 1.0],
    [0.5, 0.5, 1.0],
    [0.0, 0.5, 1.0],
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
];
const PYRAMID: [[f64; 3]; 13] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
    [-0.5, -0.5, 0.5],
    [0.5, -0.5, 0.5],
    [0.5, 0.5, 0.5],
    [-0.5, 0.5, 0.5],
];

/// Points and weights on (−1, 1).
const GAUSS_2: [(f64, f64); 2] = [(-0.577_350_269_189_625_8, 1.0), (0.577_350_269_189_625_8, 1.0)];
const GAUSS_3: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

impl Reference {
    /// That of a facet of a body of a dimension, by the number of its nodes.
    pub(super) const fn of_facet(dim: usize, nodes: usize) -> Self {
        let shape = match (dim, nodes) {
            (2, _) => Shape::Segment,
            (_, 3 | 6) => Shape::Triangle,
            _ => Shape::Quadrilateral,
        };
        Self { shape, nodes }
    }

    pub(super) const fn dim(self) -> usize {
        match self.shape {
            Shape::Segment => 1,
            Shape::Triangle | Shape::Quadrilateral => 2,
            Shape::Tetrahedron | Shape::Hexahedron | Shape::Wedge | Shape::Pyramid => 3,
        }
    }

    pub(super) const fn num_corners(self) -> usize {
        match self.shape {
            Shape::Segment => 2,
            Shape::Triangle => 3,
            Shape::Quadrilateral | Shape::Tetrahedron => 4,
            Shape::Hexahedron => 8,
            Shape::Wedge => 6,
            Shape::Pyramid => 5,
        }
    }

    pub(super) const fn is_linear(self) -> bool {
        self.nodes == self.num_corners()
    }

    pub(super) const fn is_simplex(self) -> bool {
        matches!(self.shape, Shape::Triangle | Shape::Tetrahedron)
    }

    /// Its nodes.
    pub(super) fn points(self) -> &'static [[f64; 3]] {
        let all: &[[f64; 3]] = match self.shape {
            Shape::Segment => &SEGMENT,
            Shape::Triangle => &TRIANGLE,
            Shape::Quadrilateral => &QUADRILATERAL,
            Shape::Tetrahedron => &TETRAHEDRON,
            Shape::Hexahedron => &HEXAHEDRON,
            Shape::Wedge => &WEDGE,
            Shape::Pyramid => &PYRAMID,
        };
        &all[..self.nodes]
    }

    /// The same with its corners alone.
    pub(super) const fn linear(self) -> Self {
        Self {
            nodes: self.num_corners(),
            ..self
        }
    }

    /// The corners around a node: itself, the ends of an edge, the corners of a face or of the cell.
    pub(super) fn around(self, node: usize) -> impl Iterator<Item = usize> {
        let shares = self.linear().sample(self.points()[node], 0.0).value;
        (0..self.num_corners()).filter(move |&k| shares[k] > 0.0)
    }

    const fn centre(self) -> [f64; 3] {
        match self.shape {
            Shape::Triangle => [1.0 / 3.0; 3],
            Shape::Tetrahedron => [0.25; 3],
            Shape::Wedge => [1.0 / 3.0, 1.0 / 3.0, 0.0],
            Shape::Pyramid => [0.0, 0.0, 0.25],
            _ => [0.0; 3],
        }
    }

    /// Quadrature points and weights.
    fn quadrature(self) -> Vec<([f64; 3], f64)> {
        match self.shape {
            Shape::Triangle if self.is_linear() => vec![
                ([1.0 / 6.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
                ([2.0 / 3.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
                ([1.0 / 6.0, 2.0 / 3.0, 0.0], 1.0 / 6.0),
            ],
            // Degree 4: D. A. Dunavant, Int. J. Numer. Methods Eng. 21 (1985).
            Shape::Triangle => [
                (0.445_948_490_915_964_9, 0.111_690_794_839_005_7),
                (0.091_576_213_509_770_74, 0.054_975_871_827_660_93),
            ]
            .iter()
            .flat_map(|&(a, w)| {
                [[a, a], [1.0 - 2.0 * a, a], [a, 1.0 - 2.0 * a]].map(|[x, y]| ([x, y, 0.0], w))
            })
            .collect(),
            Shape::Tetrahedron if self.is_linear() => {
                let (a, b) = (0.585_410_196_624_968_5, 0.138_196_601_125_010_5);
                [[b, b, b], [a, b, b], [b, a, b], [b, b, a]]
                    .map(|p| (p, 1.0 / 24.0))
                    .to_vec()
            }
            // Degree 5: N. J. Walkington, Quadrature on simplices of arbitrary dimension (2000).
            Shape::Tetrahedron => {
                let corners = [
                    (0.310_885_919_263_300_6, 0.018_781_320_953_002_64),
                    (0.092_735_250_310_891_23, 0.012_248_840_519_393_658),
                ];
                let (e, edge) = (0.045_503_704_125_649_65, 0.007_091_003_462_846_911);
                let near = corners.iter().flat_map(|&(a, w)| {
                    let b = 1.0 - 3.0 * a;
                    [[a, a, a], [b, a, a], [a, b, a], [a, a, b]].map(|p| (p, w))
                });
                let f = 0.5 - e;
                let middles = [[e, e, f], [e, f, e], [f, e, e], [f, f, e], [f, e, f], [e, f, f]];
                near.chain(middles.map(|p| (p, edge))).collect()
            }
            Shape::Wedge => {
                let nodes = if self.is_linear() { 3 } else { 6 };
                let triangle = Self {
                    shape: Shape::Triangle,
                    nodes,
                };
                let upwards = self.gauss().iter();
                let layer = |&(z, w): &(f64, f64)| {
                    triangle
                        .quadrature()
                        .into_iter()
                        .map(move |([x, y, _], own)| ([x, y, z], own * w))
                };
                upwards.flat_map(layer).collect()
            }
            // Of the cube whose upper side is collapsed: shape functions are polynomials there.
            Shape::Pyramid => {
                let nodes = if self.is_linear() { 8 } else { 20 };
                let cube = Self {
                    shape: Shape::Hexahedron,
                    nodes,
                };
                let collapsed = |([x, y, z], w): ([f64; 3], f64)| {
                    let width = 0.5 * (1.0 - z);
                    ([x * width, y * width, 1.0 - width], 0.5 * w * width * width)
                };
                cube.quadrature().into_iter().map(collapsed).collect()
            }
            _ => {
                let rule = self.gauss();
                let mut points = vec![([0.0; 3], 1.0)];
                // The first coordinate runs fastest.
                for d in (0..self.dim()).rev() {
                    points = points
                        .into_iter()
                        .flat_map(|(at, weight)| {
                            rule.iter().map(move |&(x, w)| {
                                let mut at: [f64; 3] = at;
                                at[d] = x;
                                (at, weight * w)
                            })
                        })
                        .collect();
                }
                points
            }
        }
    }

    const fn gauss(self) -> &'static [(f64, f64)] {
        if self.is_linear() { &GAUSS_2 } else { &GAUSS_3 }
    }

    /// What is known of its shape functions, computed on first use.
    pub(super) fn table(self) -> &'static Table {
        static TABLES: [[OnceLock<Box<Table>>; MAX_NODES + 1]; Shape::COUNT] =
            [const { [const { OnceLock::new() }; MAX_NODES + 1] }; Shape::COUNT];
        TABLES[self.shape as usize][self.nodes].get_or_init(|| {
            let quadrature = self.quadrature();
            let measure = quadrature.iter().map(|p| p.1).sum();
            Box::new(Table {
                quadrature: quadrature.into_iter().map(|(x, w)| self.sample(x, w)).collect(),
                centre: self.sample(self.centre(), measure),
                nodes: self.points().iter().map(|x| self.sample(*x, 0.0)).collect(),
            })
        })
    }

    /// Its shape functions at a point.
    pub(super) fn sample(self, at: [f64; 3], weight: f64) -> Sample {
        let (mut value, mut gradient) = (vec![0.0; self.nodes], vec![[0.0; 3]; self.nodes]);
        self.functions(at, &mut value, &mut gradient);
        Sample {
            at,
            weight,
            value,
            gradient,
        }
    }
}

/// What is known of the shape functions of a reference cell or facet before its nodes are: computed once, for all cells.
#[derive(Debug)]
pub(super) struct Table {
    /// The quadrature, exact for the stiffness of an undistorted cell.
    pub(super) quadrature: Vec<Sample>,
    /// The centre, with the sum of the weights: enough where gradients are constant.
    pub(super) centre: Sample,
    /// The nodes, which have no weight.
    pub(super) nodes: Vec<Sample>,
}

/// Values and reference gradients of the shape functions at a point of a reference cell or facet, with a weight.
#[derive(Debug)]
pub(super) struct Sample {
    pub(super) at: [f64; 3],
    pub(super) weight: f64,
    pub(super) value: Vec<f64>,
    pub(super) gradient: Vec<[f64; 3]>,
}

/// The map from a reference cell at one of its points.
pub(super) struct Jacobian {
    cofactors: [[f64; 3]; 3],
    pub(super) det: f64,
}

impl Jacobian {
    /// From the nodes of a cell and the reference gradients of their shape functions.
    pub(super) fn of(dim: usize, nodes: impl Iterator<Item = [f64; 3]>, gradients: &[[f64; 3]]) -> Self {
        // j[d][e] = ∂x_d/∂ξ_e
        let mut j = [[0.0; 3], [0.0; 3], [0.0, 0.0, 1.0]];
        if dim == 3 {
            j[2] = [0.0; 3];
        }
        for (node, g) in nodes.zip(gradients) {
            for d in 0..dim {
                for e in 0..dim {
                    j[d][e] += node[d] * g[e];
                }
            }
        }
        let cofactors = [cross(j[1], j[2]), cross(j[2], j[0]), cross(j[0], j[1])];
        let det = dot(j[0], cofactors[0]);
        Self { cofactors, det }
    }

    /// The gradient of a function from that in reference coordinates.
    pub(super) fn gradient(&self, reference: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.cofactors;
        [
            dot(x, reference) / self.det,
            dot(y, reference) / self.det,
            dot(z, reference) / self.det,
        ]
    }
}
