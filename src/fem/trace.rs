use super::assembly::{PRESCRIBED, pattern};
use super::element::Jacobian;
use super::facet::{integrate, integrate_parts};
use super::springs::Coupled;
use super::vectors::by_position;
use super::{FemError, Mesh};
use crate::sparse::Matrix;

/// Scalar functions on a mesh with the metric of H¹(Ω), and their traces on a part of the boundary: the reference for the inf-sup constant
/// of a space of multipliers. The normal displacement on a flat boundary is such a function.
#[derive(Debug, Clone)]
pub struct TraceSpace<'a> {
    mesh: &'a Mesh,
    facets: &'a [Vec<usize>],
    dofs: Vec<usize>,
    gram: Matrix,
}

impl<'a> TraceSpace<'a> {
    /// The finite element functions of the mesh that vanish on the facets of `fixed` (if any), with their traces on `facets`.
    ///
    /// # Errors
    /// Groups that do not exist or are empty; no free node.
    pub fn new(mesh: &'a Mesh, facets: &str, fixed: Option<&str>) -> Result<Self, FemError> {
        let mut dofs = vec![0; mesh.num_nodes()];
        if let Some(fixed) = fixed {
            for &node in mesh.facet_group(fixed)?.iter().flatten() {
                dofs[node] = PRESCRIBED;
            }
        }
        let mut free = 0;
        for dof in dofs.iter_mut().filter(|d| **d != PRESCRIBED) {
            *dof = free;
            free += 1;
        }
        if free == 0 {
            return Err(FemError::NothingFree);
        }
        let mut gram = Matrix::zeros(pattern(Coupled::cells(mesh), 1, &dofs, free)?);
        for cell in 0..mesh.num_cells() {
            let kind = mesh.kind(cell);
            let nodes = mesh.cell(cell);
            let mut gradient = Vec::with_capacity(nodes.len());
            for sample in &kind.reference().table().quadrature {
                let map = Jacobian::of(kind.dim(), mesh.nodes_at(cell), &sample.gradient);
                gradient.clear();
                gradient.extend(sample.gradient.iter().map(|g| map.gradient(*g)));
                let (value, volume) = (&sample.value, sample.weight * map.det);
                for (b, &nb) in nodes.iter().enumerate() {
                    for (a, &na) in nodes.iter().enumerate() {
                        if dofs[na] == PRESCRIBED || dofs[nb] == PRESCRIBED {
                            continue;
                        }
                        let stiff: f64 = (0..mesh.dim()).map(|d| gradient[a][d] * gradient[b][d]).sum();
                        gram.add(dofs[na], dofs[nb], volume * (stiff + value[a] * value[b]));
                    }
                }
            }
        }
        Ok(Self {
            facets: mesh.facet_group(facets)?,
            mesh,
            dofs,
            gram,
        })
    }

    /// The Gram matrix of the H¹ inner product, one row a free node.
    #[must_use]
    pub fn gram(&self) -> &Matrix {
        &self.gram
    }

    /// The pairing ∫ μ_k v over the facets of `count` multipliers with the functions, `count` × n. `evaluate(x, out)` appends
    /// (k, μ_k(x)) for the multipliers that do not vanish at x; they may jump at nodes and in the middle of facets.
    ///
    /// # Errors
    /// Multipliers numbered beyond `count`, values that are not finite.
    pub fn pairing(
        &self,
        count: usize,
        evaluate: impl Fn([f64; 3], &mut Vec<(usize, f64)>),
    ) -> Result<Matrix, FemError> {
        let mut entries = Vec::new();
        let mut at_point = Vec::new();
        for nodes in self.facets {
            integrate_parts(self.mesh, nodes, |_, x, shape, measure, _| {
                at_point.clear();
                evaluate(x, &mut at_point);
                for &(k, mu) in &at_point {
                    for (&node, s) in nodes.iter().zip(shape) {
                        if self.dofs[node] != PRESCRIBED {
                            entries.push((k, self.dofs[node], measure * mu * s));
                        }
                    }
                }
            });
        }
        let pairing = Matrix::from_triplets(count, self.gram.nrows(), &entries)?;
        pairing.check_finite()?;
        Ok(pairing)
    }

    /// The lumped pairing of nodal multipliers: row k is the area of free node k of the facets at that node. Nodes are ordered as in
    /// [`ContactRows`](super::ContactRows), by x, then y, then z.
    ///
    /// # Errors
    /// None in practice; the pattern is checked again.
    pub fn lumped_pairing(&self) -> Result<Matrix, FemError> {
        let mut area = std::collections::BTreeMap::new();
        let points = self.mesh.points();
        for nodes in self.facets {
            integrate(self.mesh, nodes, |_, shape, measure| {
                for (&node, s) in nodes.iter().zip(shape) {
                    if self.dofs[node] != PRESCRIBED {
                        *area.entry(node).or_insert(0.0) += measure * s;
                    }
                }
            });
        }
        let mut nodes: Vec<(usize, f64)> = area.into_iter().collect();
        nodes.sort_by(|a, b| by_position(points[a.0], points[b.0]));
        let entries: Vec<_> = nodes
            .iter()
            .enumerate()
            .map(|(k, &(node, area))| (k, self.dofs[node], area))
            .collect();
        Ok(Matrix::from_triplets(nodes.len(), self.gram.nrows(), &entries)?)
    }
}
