//! Stiffness of cells.

use super::ElasticSystem;
use super::cell_points::Points;
use super::derivatives::Tensor;
use super::element::{CellKind, MAX_NODES};

/// Number of cell shapes whose stiffness is cached.
const SHAPES: usize = 256;

/// The stiffness of the cells of a system, one after another. Cells of the same shape, of which structured meshes have few, are computed
/// once, unless their strains are constant, which makes them cheap.
pub(super) struct Elements<'a> {
    system: &'a ElasticSystem,
    tensors: Vec<Tensor>,
    known: Vec<Option<(Shape, ElementMatrix)>>,
    other: ElementMatrix,
    work: Work,
}

/// Room for the points of a cell, and strains and stresses of unit displacements at one of them.
#[derive(Default)]
struct Work {
    points: Points,
    strains: Vec<[f64; 6]>,
    stresses: Vec<[f64; 6]>,
}

/// A material, and nodes relative to the first one.
#[derive(Clone, Copy)]
struct Shape {
    kind: CellKind,
    material: usize,
    nodes: [[f64; 3]; MAX_NODES],
}

impl PartialEq for Shape {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind && self.material == other.material && self.nodes() == other.nodes()
    }
}

impl Shape {
    fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes[..self.kind.num_nodes()]
    }

    /// Its index in the cache.
    fn place(&self) -> usize {
        let mut hash = self.material as u64;
        for x in self.nodes().as_flattened() {
            hash = (hash.rotate_left(5) ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
        (hash >> 32) as usize % SHAPES
    }
}

impl<'a> Elements<'a> {
    pub(super) fn new(system: &'a ElasticSystem) -> Self {
        Self {
            system,
            tensors: (0..system.materials.len()).map(|m| system.tensor(m)).collect(),
            known: Vec::new(),
            other: ElementMatrix::default(),
            work: Work::default(),
        }
    }

    /// That of a cell or, numbered after these, of what is attached.
    pub(super) fn of(&mut self, cell: usize) -> &ElementMatrix {
        if let Some(k) = cell.checked_sub(self.system.mesh.num_cells()) {
            return &self.system.attached[k].matrix;
        }
        let (mesh, material) = (&self.system.mesh, self.system.material_of[cell]);
        let (kind, mut nodes) = (mesh.kind(cell), mesh.nodes_at(cell));
        let mean = self.system.mean_dilatation[material] && kind.is_box();
        let (work, tensor, revolved) = (&mut self.work, &self.tensors[material], self.system.is_revolved());
        if !revolved {
            let origin = nodes[0];
            for node in &mut nodes[..kind.num_nodes()] {
                (0..3).for_each(|d| node[d] -= origin[d]);
            }
        }
        let mut compute = |element: &mut ElementMatrix| {
            work.points.clear();
            work.points.add(kind, &nodes, mean, revolved);
            element.compute(kind, tensor, work);
        };
        // In bodies of revolution shapes recur, but not at the same radius.
        if revolved || kind.has_constant_strain() {
            compute(&mut self.other);
            return &self.other;
        }
        let shape = Shape {
            kind,
            material,
            nodes,
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

/// Stiffness of one cell, column-major.
#[derive(Debug, Clone, Default)]
pub(super) struct ElementMatrix {
    order: usize,
    values: Vec<f64>,
}

impl ElementMatrix {
    pub(super) fn zeros(order: usize) -> Self {
        Self {
            order,
            values: vec![0.0; order * order],
        }
    }

    pub(super) fn add(&mut self, row: usize, col: usize, value: f64) {
        self.values[col * self.order + row] += value;
    }

    pub(super) fn get(&self, row: usize, col: usize) -> f64 {
        self.values[col * self.order + row]
    }

    /// From the points of `work`.
    fn compute(&mut self, kind: CellKind, tensor: &Tensor, work: &mut Work) {
        let dim = kind.dim();
        self.order = dim * kind.num_nodes();
        self.values.clear();
        self.values.resize(self.order * self.order, 0.0);
        for point in work.points.iter() {
            work.strains.clear();
            for share in point.shares {
                work.strains.extend((0..dim).map(|d| share.column(d)));
            }
            let stress = |strain: &[f64; 6]| {
                tensor.map(|row| point.volume * (0..6).map(|s| row[s] * strain[s]).sum::<f64>())
            };
            work.stresses.clear();
            work.stresses.extend(work.strains.iter().map(stress));
            for (col, stress) in work.stresses.iter().enumerate() {
                let values = &mut self.values[col * self.order..][..=col];
                for (value, strain) in values.iter_mut().zip(&work.strains) {
                    *value += (0..6).map(|s| strain[s] * stress[s]).sum::<f64>();
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
}
