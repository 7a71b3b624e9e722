//! Stiffness of cells.

use super::cell_points::{Point, points_of};
use super::element::{CellKind, MAX_NODES, map_cell};
use super::material::VOIGT;
use super::{ElasticSystem, Material, PlaneModel};

/// Number of cell shapes whose stiffness is cached.
const SHAPES: usize = 256;

/// The stiffness of the cells of a system, one after another. Boxes and quadrilaterals of the same shape, of which structured meshes
/// have few, are computed once.
pub(super) struct Elements<'a> {
    system: &'a ElasticSystem,
    tensors: Vec<Tensor>,
    known: Vec<Option<(Shape, ElementMatrix)>>,
    other: ElementMatrix,
}

/// A material, and corners relative to the first one.
#[derive(Clone, Copy, PartialEq)]
struct Shape {
    kind: CellKind,
    material: usize,
    corners: [[f64; 3]; MAX_NODES],
}

impl Shape {
    /// Its index in the cache.
    fn place(&self) -> usize {
        let mut hash = self.material as u64;
        for x in self.corners.as_flattened() {
            hash = (hash.rotate_left(5) ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
        (hash >> 32) as usize % SHAPES
    }
}

impl<'a> Elements<'a> {
    pub(super) fn new(system: &'a ElasticSystem) -> Self {
        Self {
            system,
            tensors: tensors(&system.materials, system.mesh.dim(), system.plane),
            known: Vec::new(),
            other: ElementMatrix::default(),
        }
    }

    pub(super) fn of(&mut self, cell: usize) -> &ElementMatrix {
        let (mesh, material) = (&self.system.mesh, self.system.material_of[cell]);
        let (kind, mut corners) = (mesh.kind(cell), mesh.corners(cell));
        let mean = self.system.mean_dilatation[material] && kind.is_box();
        let solid = self.system.materials[material].solid();
        if self.system.is_revolved() {
            // Shapes recur, but not at the same radius.
            self.other
                .compute_at(kind, &points_of(kind, &corners, mean, true), &solid);
            return &self.other;
        }
        let origin = corners[0];
        for corner in &mut corners[..kind.num_nodes()] {
            (0..3).for_each(|d| corner[d] -= origin[d]);
        }
        let tensor = &self.tensors[material];
        if !kind.is_box() {
            self.other.compute(kind, &corners, tensor);
            return &self.other;
        }
        let compute = |element: &mut ElementMatrix| match mean {
            true => element.compute_at(kind, &points_of(kind, &corners, true, false), &solid),
            false => element.compute(kind, &corners, tensor),
        };
        let shape = Shape {
            kind,
            material,
            corners,
        };
        if self.known.is_empty() {
            self.known.resize_with(SHAPES, || None);
        }
        let (known, element) = self.known[shape.place()].get_or_insert_with(|| {
            let mut element = ElementMatrix::default();
            compute(&mut element);
            (shape, element)
        });
        if *known != shape {
            compute(element);
            *known = shape;
        }
        element
    }
}

/// Stress from strain; in the plane the leading 3 × 3 block, for (11, 22, 12).
struct Tensor([[f64; 6]; 6]);

fn tensors(materials: &[Material], dim: usize, plane: PlaneModel) -> Vec<Tensor> {
    let tensor = |m: &Material| match dim {
        2 => {
            let c = m.plane(plane);
            Tensor(std::array::from_fn(|i| {
                std::array::from_fn(|j| if i < 3 && j < 3 { c[i][j] } else { 0.0 })
            }))
        }
        _ => Tensor(m.solid()),
    };
    materials.iter().map(tensor).collect()
}

/// Stiffness of one cell, column-major.
#[derive(Default)]
pub(super) struct ElementMatrix {
    order: usize,
    values: Vec<f64>,
}

impl ElementMatrix {
    pub(super) fn get(&self, row: usize, col: usize) -> f64 {
        self.values[col * self.order + row]
    }

    fn clear(&mut self, order: usize) {
        self.order = order;
        self.values.clear();
        self.values.resize(order * order, 0.0);
    }

    /// With all six strains: those of bodies of revolution, and of the mean dilatation, where plane bodies are in plane strain with ε₃₃
    /// as the mean makes it.
    fn compute_at(&mut self, kind: CellKind, points: &[Point], solid: &[[f64; 6]; 6]) {
        let dim = kind.dim();
        self.clear(dim * kind.num_nodes());
        for point in points {
            for col in 0..self.order {
                let strain = point.column(col / dim, col % dim);
                let stress = solid.map(|row| point.volume * (0..6).map(|s| row[s] * strain[s]).sum::<f64>());
                for row in 0..=col {
                    let own = point.column(row / dim, row % dim);
                    self.values[col * self.order + row] += (0..6).map(|s| own[s] * stress[s]).sum::<f64>();
                }
            }
        }
        self.mirror();
    }

    /// Copies one triangle to the other, so that the sum is symmetric to the last bit.
    fn mirror(&mut self) {
        for col in 0..self.order {
            for row in 0..col {
                self.values[row * self.order + col] = self.values[col * self.order + row];
            }
        }
    }

    fn compute(&mut self, kind: CellKind, corners: &[[f64; 3]; MAX_NODES], tensor: &Tensor) {
        let (dim, n) = (kind.dim(), kind.num_nodes());
        self.clear(dim * n);
        let mut points = kind.quadrature();
        if kind.is_simplex() {
            let total = points.iter().map(|p| p.1).sum();
            points.truncate(1);
            points[0].1 = total;
        }
        let strains = if dim == 2 { 3 } else { 6 };
        let mut b = [[0.0; 6]; 3 * MAX_NODES];
        let mut cb = [[0.0; 6]; 3 * MAX_NODES];
        for (x, weight) in points {
            let (_, gradient, det) = map_cell(kind, &corners[..n], x);
            for a in 0..n {
                for d in 0..dim {
                    let column = &mut b[dim * a + d];
                    *column = [0.0; 6];
                    if dim == 2 {
                        column[d] = gradient[a][d];
                        column[2] = gradient[a][1 - d];
                    } else {
                        for (s, [i, j]) in VOIGT.into_iter().enumerate() {
                            if i == d {
                                column[s] = gradient[a][j];
                            } else if j == d {
                                column[s] = gradient[a][i];
                            }
                        }
                    }
                }
            }
            let scale = weight * det;
            for col in 0..self.order {
                for s in 0..strains {
                    cb[col][s] = scale * (0..strains).map(|t| tensor.0[s][t] * b[col][t]).sum::<f64>();
                }
            }
            for col in 0..self.order {
                for row in 0..=col {
                    let k: f64 = (0..strains).map(|s| b[row][s] * cb[col][s]).sum();
                    self.values[col * self.order + row] += k;
                }
            }
        }
        self.mirror();
    }
}
