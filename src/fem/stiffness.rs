//! Stiffness of the cells of a system.

use super::ElasticSystem;
use super::element_matrix::{ElementMatrix, Work};
use super::material::Tensor;

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
