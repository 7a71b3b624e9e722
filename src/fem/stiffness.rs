//! Stiffness of cells.

use super::ElasticSystem;
use super::cell_points::Points;
use super::derivatives::Tensor;
use super::element::CellKind;

/// Number of cell shapes whose stiffness is cached.
const SHAPES: usize = 256;

/// The stiffness of the cells of a system, one after another. Cells of the same shape, of which structured meshes have few, are computed
/// once, unless their strains are constant, which makes them cheap.
pub(super) struct Elements<'a> {
    system: &'a ElasticSystem,
    tensors: Vec<Tensor>,
    known: Vec<(Shape, ElementMatrix)>,
    shape: Shape,
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

/// A material, and nodes relative to the first one (in bodies of revolution where they are). Of the cells of one dimension, their number
/// tells the kind; there are none where nothing is known yet.
#[derive(Default, PartialEq)]
struct Shape {
    material: usize,
    nodes: Vec<[f64; 3]>,
}

impl Shape {
    /// Its index in the cache.
    fn place(&self) -> usize {
        let mut hash = self.material as u64;
        for x in self.nodes.as_flattened() {
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
            shape: Shape::default(),
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
        let (kind, shape) = (mesh.kind(cell), &mut self.shape);
        let mean = self.system.mean_dilatation[material] && kind.is_box();
        let (work, tensor, revolved) = (&mut self.work, &self.tensors[material], self.system.is_revolved());
        shape.material = material;
        shape.nodes.clear();
        shape.nodes.extend(mesh.nodes_at(cell));
        if !revolved {
            let origin = shape.nodes[0];
            for node in &mut shape.nodes {
                (0..3).for_each(|d| node[d] -= origin[d]);
            }
        }
        let mut compute = |element: &mut ElementMatrix, nodes: &[[f64; 3]]| {
            work.points.clear();
            work.points.add(kind, nodes.iter().copied(), mean, revolved);
            element.compute(kind, tensor, work);
        };
        // In bodies of revolution shapes recur, but not at the same radius.
        if revolved || kind.has_constant_strain() {
            compute(&mut self.other, &shape.nodes);
            return &self.other;
        }
        if self.known.is_empty() {
            self.known.resize_with(SHAPES, Default::default);
        }
        let (known, element) = &mut self.known[shape.place()];
        if known != shape {
            compute(element, &shape.nodes);
            std::mem::swap(known, shape);
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
                let mut stress = [0.0; 6];
                for (stress, row) in stress.iter_mut().zip(tensor) {
                    *stress = point.volume * sum_of_products(row, strain);
                }
                stress
            };
            work.stresses.clear();
            work.stresses.extend(work.strains.iter().map(stress));
            for (col, stress) in work.stresses.iter().enumerate() {
                let values = &mut self.values[col * self.order..][..=col];
                for (value, strain) in values.iter_mut().zip(&work.strains) {
                    *value += sum_of_products(strain, stress);
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

/// Written out, as iterators are calls where the optimiser does little.
fn sum_of_products(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}
