use std::sync::Arc;

use super::elasticity::Elasticity;
use super::element::{CellKind, MAX_NODES, map_cell};
use super::facet::integrate;
use super::material::VOIGT;

use super::rigid::check_supports;
use super::{FemError, Material, Mesh, PlaneModel};
use crate::sparse::{Matrix, Pattern};

/// No free displacement.
pub(super) const PRESCRIBED: usize = usize::MAX;

/// The assembled system A u = f of the free displacements of an [`Elasticity`].
///
/// Free displacements are numbered node by node, component by component.
#[derive(Debug, Clone)]
pub struct ElasticSystem {
    mesh: Arc<Mesh>,
    stiffness: Matrix,
    /// Free displacement of each component of each node, or [`PRESCRIBED`].
    dofs: Vec<usize>,
    /// Values of the prescribed components, 0 at free ones.
    prescribed: Vec<f64>,
    /// Forces that the prescribed displacements put on the free ones.
    lift: Vec<f64>,
    plane: PlaneModel,
    /// Materials, and which of them each cell has.
    materials: Vec<Material>,
    material_of: Vec<usize>,
}

impl Elasticity {
    /// Assembles the stiffness matrix of the free displacements.
    ///
    /// # Errors
    /// Groups that do not exist or are empty, components beyond the dimension, prescribed values that are not finite, nothing free,
    /// supports that leave rigid motions ([`FemError::Floating`] names them).
    pub fn assemble(&self) -> Result<ElasticSystem, FemError> {
        ElasticSystem::new(self)
    }
}

impl ElasticSystem {
    fn new(body: &Elasticity) -> Result<Self, FemError> {
        let mesh = &body.mesh;
        let dim = mesh.dim();
        let mut fixed = vec![false; dim * mesh.num_nodes()];
        let mut prescribed = vec![0.0; fixed.len()];
        for support in &body.supports {
            if let Some(component) = support.component
                && component >= dim
            {
                return Err(FemError::Component { component, dim });
            }
            for &node in mesh.facet_group(&support.group)?.iter().flatten() {
                for d in 0..dim {
                    if support.component.is_none_or(|c| c == d) {
                        let at = mesh.points()[node];
                        let value = support.value.as_ref().map_or(0.0, |f| f(at));
                        if !value.is_finite() {
                            return Err(FemError::NotFinite {
                                what: "the prescribed displacement",
                                at,
                                value,
                            });
                        }
                        fixed[dim * node + d] = true;
                        prescribed[dim * node + d] = value;
                    }
                }
            }
        }
        check_supports(mesh, &fixed)?;
        let mut free = 0;
        let dofs: Vec<usize> = fixed
            .iter()
            .map(|&f| {
                if f {
                    PRESCRIBED
                } else {
                    free += 1;
                    free - 1
                }
            })
            .collect();
        if free == 0 {
            return Err(FemError::NothingFree);
        }
        let mut materials = vec![0; mesh.num_cells()];
        for (number, (group, _)) in body.by_group.iter().enumerate() {
            for &cell in mesh.cell_group(group)? {
                materials[cell] = number + 1;
            }
        }
        let mut stiffness = Matrix::zeros(pattern(mesh, dim, &dofs, free)?);
        let mut lift = vec![0.0; free];
        let tensors: Vec<Tensor> = std::iter::once(&body.material)
            .chain(body.by_group.iter().map(|g| &g.1))
            .map(|m| match dim {
                2 => {
                    let c = m.plane(body.plane);
                    Tensor(std::array::from_fn(|i| {
                        std::array::from_fn(|j| if i < 3 && j < 3 { c[i][j] } else { 0.0 })
                    }))
                }
                _ => Tensor(m.solid()),
            })
            .collect();
        let mut element = ElementMatrix::default();
        for cell in 0..mesh.num_cells() {
            element.compute(mesh.kind(cell), &mesh.corners(cell), &tensors[materials[cell]]);
            let nodes = mesh.cell(cell);
            for (b, &nb) in nodes.iter().enumerate() {
                for e in 0..dim {
                    let column = dofs[dim * nb + e];
                    let value = prescribed[dim * nb + e];
                    if column == PRESCRIBED && value == 0.0 {
                        continue;
                    }
                    for (a, &na) in nodes.iter().enumerate() {
                        for d in 0..dim {
                            let row = dofs[dim * na + d];
                            if row == PRESCRIBED {
                                continue;
                            }
                            let k = element.get(dim * a + d, dim * b + e);
                            if column == PRESCRIBED {
                                lift[row] -= k * value;
                            } else {
                                stiffness.add(row, column, k);
                            }
                        }
                    }
                }
            }
        }
        Ok(Self {
            mesh: Arc::clone(mesh),
            stiffness,
            dofs,
            prescribed,
            lift,
            plane: body.plane,
            materials: std::iter::once(&body.material)
                .chain(body.by_group.iter().map(|g| &g.1))
                .cloned()
                .collect(),
            material_of: materials,
        })
    }

    /// A: symmetric positive definite, one row a free displacement.
    #[must_use]
    pub fn stiffness(&self) -> &Matrix {
        &self.stiffness
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Number of free displacements.
    #[must_use]
    pub fn num_free(&self) -> usize {
        self.stiffness.nrows()
    }

    /// Number of a component of a node's displacement among the free ones; none where it is prescribed.
    #[must_use]
    pub fn dof(&self, node: usize, component: usize) -> Option<usize> {
        let dim = self.mesh.dim();
        if component >= dim {
            return None;
        }
        self.dofs
            .get(dim * node + component)
            .copied()
            .filter(|&d| d != PRESCRIBED)
    }

    /// Forces on the free displacements that stem from prescribed ones: part of any right-hand side (zero if all supports are fixed).
    #[must_use]
    pub fn support_load(&self) -> &[f64] {
        &self.lift
    }

    /// Nodal forces of a volume force (force per volume, or per area of the plane; third component ignored in the plane).
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn body_force(&self, force: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Vec<f64>, FemError> {
        let mut load = vec![0.0; self.num_free()];
        for cell in 0..self.mesh.num_cells() {
            let kind = self.mesh.kind(cell);
            let corners = self.mesh.corners(cell);
            for (x, weight) in kind.quadrature() {
                let (shape, _, det) = map_cell(kind, &corners[..kind.num_nodes()], x);
                let at = interpolate(&corners, &shape[..kind.num_nodes()]);
                let f = self.checked("the volume force", at, force(at))?;
                for (&node, s) in self.mesh.cell(cell).iter().zip(&shape) {
                    self.add(&mut load, node, weight * det * s, f);
                }
            }
        }
        Ok(load)
    }

    /// Nodal forces of a surface traction (force per area, or per length in the plane) on a group of facets.
    ///
    /// # Errors
    /// Groups that do not exist or are empty, values that are not finite.
    pub fn traction(
        &self,
        facets: &str,
        traction: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Result<Vec<f64>, FemError> {
        let mut load = vec![0.0; self.num_free()];
        for nodes in self.mesh.facet_group(facets)? {
            let mut failure = None;
            integrate(self.mesh.points(), nodes, |at, shape, measure| {
                match self.checked("the surface traction", at, traction(at)) {
                    Ok(t) => {
                        for (&node, s) in nodes.iter().zip(shape) {
                            self.add(&mut load, node, measure * s, t);
                        }
                    }
                    Err(e) => failure = Some(e),
                }
            });
            if let Some(e) = failure {
                return Err(e);
            }
        }
        Ok(load)
    }

    /// The value of a prescribed component, 0 at free ones.
    pub(super) fn prescribed_value(&self, node: usize, component: usize) -> f64 {
        self.prescribed[self.mesh.dim() * node + component]
    }

    /// All displacements, node by node, from the free ones.
    ///
    /// # Errors
    /// Wrong length.
    pub fn displacements(&self, free: &[f64]) -> Result<Vec<f64>, FemError> {
        if free.len() != self.num_free() {
            return Err(FemError::Length {
                what: "the vector of free displacements",
                expected: self.num_free(),
                found: free.len(),
            });
        }
        Ok(self
            .dofs
            .iter()
            .zip(&self.prescribed)
            .map(|(&dof, &value)| if dof == PRESCRIBED { value } else { free[dof] })
            .collect())
    }

    /// Stresses (11, 22, 33, 12, 23, 13) at the centre of each cell, from the free displacements.
    ///
    /// # Errors
    /// Wrong length.
    pub fn stresses(&self, free: &[f64]) -> Result<Vec<[f64; 6]>, FemError> {
        let u = self.displacements(free)?;
        let dim = self.mesh.dim();
        let stress = |cell: usize| {
            let kind = self.mesh.kind(cell);
            let nodes = self.mesh.cell(cell);
            let third = if kind.is_simplex() {
                1.0 / (dim + 1) as f64
            } else {
                0.0
            };
            let corners = self.mesh.corners(cell);
            let (_, gradient, _) = map_cell(kind, &corners[..nodes.len()], [third; 3]);
            // h[d][e] = ∂u_d/∂x_e
            let mut h = [[0.0; 3]; 3];
            for (&node, g) in nodes.iter().zip(&gradient) {
                for d in 0..dim {
                    for e in 0..dim {
                        h[d][e] += u[dim * node + d] * g[e];
                    }
                }
            }
            let strain = VOIGT.map(|[i, j]| if i == j { h[i][i] } else { h[i][j] + h[j][i] });
            let material = &self.materials[self.material_of[cell]];
            if dim == 2 && self.plane == PlaneModel::Stress {
                let c = material.plane(PlaneModel::Stress);
                let own = [strain[0], strain[1], strain[3]];
                let s = c.map(|row| row.iter().zip(&own).map(|(c, e)| c * e).sum::<f64>());
                [s[0], s[1], 0.0, s[2], 0.0, 0.0]
            } else {
                material
                    .solid()
                    .map(|row| row.iter().zip(&strain).map(|(c, e)| c * e).sum::<f64>())
            }
        };
        Ok((0..self.mesh.num_cells()).map(stress).collect())
    }

    fn add(&self, load: &mut [f64], node: usize, scale: f64, force: [f64; 3]) {
        let dim = self.mesh.dim();
        for (d, f) in force.iter().enumerate().take(dim) {
            let dof = self.dofs[dim * node + d];
            if dof != PRESCRIBED {
                load[dof] += scale * f;
            }
        }
    }

    fn checked(&self, what: &'static str, at: [f64; 3], value: [f64; 3]) -> Result<[f64; 3], FemError> {
        match value[..self.mesh.dim()].iter().find(|v| !v.is_finite()) {
            Some(&value) => Err(FemError::NotFinite { what, at, value }),
            None => Ok(value),
        }
    }
}

fn interpolate(corners: &[[f64; 3]], shape: &[f64]) -> [f64; 3] {
    let mut at = [0.0; 3];
    for (corner, s) in corners.iter().zip(shape) {
        for d in 0..3 {
            at[d] += s * corner[d];
        }
    }
    at
}

/// Stress from strain; in the plane the leading 3 × 3 block, for (11, 22, 12).
pub(super) struct Tensor(pub(super) [[f64; 6]; 6]);

/// Stiffness of one cell, column-major.
#[derive(Default)]
struct ElementMatrix {
    order: usize,
    values: Vec<f64>,
}

impl ElementMatrix {
    fn get(&self, row: usize, col: usize) -> f64 {
        self.values[col * self.order + row]
    }

    fn compute(&mut self, kind: CellKind, corners: &[[f64; 3]; MAX_NODES], tensor: &Tensor) {
        let (dim, n) = (kind.dim(), kind.num_nodes());
        self.order = dim * n;
        self.values.clear();
        self.values.resize(self.order * self.order, 0.0);
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
        // Mirrored, so that the sum is symmetric to the last bit.
        for col in 0..self.order {
            for row in 0..col {
                self.values[row * self.order + col] = self.values[col * self.order + row];
            }
        }
    }
}

/// The pattern of the free unknowns, `dim` a node: nodes that share a cell.
pub(super) fn pattern(mesh: &Mesh, dim: usize, dofs: &[usize], free: usize) -> Result<Pattern, FemError> {
    let nodes = mesh.num_nodes();
    let mut first = vec![0usize; nodes + 1];
    for cell in 0..mesh.num_cells() {
        for &n in mesh.cell(cell) {
            first[n + 1] += 1;
        }
    }
    for n in 0..nodes {
        first[n + 1] += first[n];
    }
    let mut next = first.clone();
    let mut cells = vec![0usize; first[nodes]];
    for cell in 0..mesh.num_cells() {
        for &n in mesh.cell(cell) {
            cells[next[n]] = cell;
            next[n] += 1;
        }
    }
    let mut col_ptr = Vec::with_capacity(free + 1);
    col_ptr.push(0);
    let mut row_idx = Vec::new();
    let mut neighbours: Vec<usize> = Vec::new();
    for n in 0..nodes {
        neighbours.clear();
        for &cell in &cells[first[n]..first[n + 1]] {
            neighbours.extend_from_slice(mesh.cell(cell));
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        for e in 0..dim {
            if dofs[dim * n + e] == PRESCRIBED {
                continue;
            }
            for &m in &neighbours {
                row_idx.extend(dofs[dim * m..dim * (m + 1)].iter().filter(|&&d| d != PRESCRIBED));
            }
            col_ptr.push(row_idx.len());
        }
    }
    Ok(Pattern::from_csc(free, free, col_ptr, row_idx)?)
}
