use super::assembly::{PRESCRIBED, pattern};
use super::element::{facet_quadrature, map_cell};
use super::mesh::{by_position, cross, norm};
use super::{FemError, Mesh};
use crate::sparse::Matrix;

/// Scalar functions on a mesh with the metric of H¹(Ω), and their traces on a part of the boundary: what the inf-sup constant of a space
/// of multipliers is measured with. The normal displacement on a flat boundary is such a function.
#[derive(Debug, Clone)]
pub struct TraceSpace<'a> {
    mesh: &'a Mesh,
    facets: &'a [Vec<usize>],
    dofs: Vec<usize>,
    gram: Matrix,
}

impl<'a> TraceSpace<'a> {
    /// The finite element functions of the mesh that vanish on the facets of `fixed` (if any), with traces on `facets`.
    ///
    /// # Errors
    /// Groups that do not exist or are empty; nothing free.
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
        let mut gram = Matrix::zeros(pattern(mesh, 1, &dofs, free)?);
        for cell in 0..mesh.num_cells() {
            let kind = mesh.kind(cell);
            let corners = mesh.corners(cell);
            let nodes = mesh.cell(cell);
            for (x, weight) in kind.quadrature() {
                let (value, gradient, det) = map_cell(kind, &corners[..nodes.len()], x);
                for (b, &nb) in nodes.iter().enumerate() {
                    for (a, &na) in nodes.iter().enumerate() {
                        if dofs[na] == PRESCRIBED || dofs[nb] == PRESCRIBED {
                            continue;
                        }
                        let stiff: f64 = (0..mesh.dim()).map(|d| gradient[a][d] * gradient[b][d]).sum();
                        gram.add(dofs[na], dofs[nb], weight * det * (stiff + value[a] * value[b]));
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
    /// Multipliers numbered beyond `count`.
    pub fn pairing(
        &self,
        count: usize,
        evaluate: impl Fn([f64; 3], &mut Vec<(usize, f64)>),
    ) -> Result<Matrix, FemError> {
        let mut entries = Vec::new();
        let mut at_point = Vec::new();
        for nodes in self.facets {
            let rule = facet_quadrature(nodes.len());
            // Triangles are not halved: multipliers on them may jump at edges only.
            let parts: &[f64] = if nodes.len() == 3 { &[0.0] } else { &[-0.5, 0.5] };
            let scale = if nodes.len() == 3 { 1.0 } else { 0.5 };
            let second: &[f64] = if nodes.len() == 4 { parts } else { &[0.0] };
            for &sx in parts {
                for &sy in second {
                    for q in &rule {
                        let shape = match nodes.len() {
                            3 => q.value,
                            2 => {
                                let s = sx + scale * (q.value[1] - q.value[0]);
                                [0.5 * (1.0 - s), 0.5 * (1.0 + s), 0.0, 0.0]
                            }
                            _ => {
                                let s = sx + scale * (q.value[1] + q.value[2] - q.value[0] - q.value[3]);
                                let t = sy + scale * (q.value[2] + q.value[3] - q.value[0] - q.value[1]);
                                [
                                    (1.0 - s) * (1.0 - t),
                                    (1.0 + s) * (1.0 - t),
                                    (1.0 + s) * (1.0 + t),
                                    (1.0 - s) * (1.0 + t),
                                ]
                                .map(|v| 0.25 * v)
                            }
                        };
                        let mut x = [0.0; 3];
                        let mut tangents = [[0.0; 3]; 2];
                        for (a, &node) in nodes.iter().enumerate() {
                            let p = self.mesh.points()[node];
                            for d in 0..3 {
                                x[d] += shape[a] * p[d];
                                tangents[0][d] += q.gradient[a][0] * p[d];
                                tangents[1][d] += q.gradient[a][1] * p[d];
                            }
                        }
                        let measure = match nodes.len() {
                            2 => scale * norm(tangents[0]),
                            3 => norm(cross(tangents[0], tangents[1])),
                            _ => scale * scale * norm(cross(tangents[0], tangents[1])),
                        };
                        at_point.clear();
                        evaluate(x, &mut at_point);
                        for &(k, mu) in &at_point {
                            for (a, &node) in nodes.iter().enumerate() {
                                if self.dofs[node] != PRESCRIBED {
                                    entries.push((k, self.dofs[node], q.weight * measure * mu * shape[a]));
                                }
                            }
                        }
                    }
                }
            }
        }
        Ok(Matrix::from_triplets(count, self.gram.nrows(), &entries)?)
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
            for q in facet_quadrature(nodes.len()) {
                let mut tangents = [[0.0; 3]; 2];
                for (a, &node) in nodes.iter().enumerate() {
                    for d in 0..3 {
                        tangents[0][d] += q.gradient[a][0] * points[node][d];
                        tangents[1][d] += q.gradient[a][1] * points[node][d];
                    }
                }
                let measure = if nodes.len() == 2 {
                    norm(tangents[0])
                } else {
                    norm(cross(tangents[0], tangents[1]))
                };
                for (a, &node) in nodes.iter().enumerate() {
                    if self.dofs[node] != PRESCRIBED {
                        *area.entry(node).or_insert(0.0) += q.weight * measure * q.value[a];
                    }
                }
            }
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
