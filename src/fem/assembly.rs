use std::sync::{Arc, OnceLock};

use super::elasticity::Elasticity;
use super::element::{CellKind, MAX_NODES, map_cell};
use super::facet::integrate;
use super::material::VOIGT;

use super::rigid::check_supports;
use super::{FemError, Material, Mesh, PlaneModel};
use crate::interface::LoadCase;
use crate::sparse::{Blocks, Matrix, NodalBlocks, NodalMatrix, Pattern};

/// No free displacement.
pub(super) const PRESCRIBED: usize = usize::MAX;

/// The assembled system A u = f of the free displacements of an [`Elasticity`].
///
/// Free displacements are numbered node by node, component by component.
#[derive(Debug, Clone)]
pub struct ElasticSystem {
    mesh: Arc<Mesh>,
    /// Number of free displacements.
    free: usize,
    stiffness: OnceLock<Matrix>,
    /// Free displacement of each component of each node, or [`PRESCRIBED`].
    dofs: Vec<usize>,
    /// The prescribed displacements, 0 at free components, and the forces that go with them.
    supports: LoadCase,
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
        let system = self.discretize()?;
        system.stiffness.get_or_init(|| system.single_entries());
        Ok(system)
    }

    /// As [`assemble`](Self::assemble), but the stiffness matrix is left for when it is asked for: large bodies take it
    /// [in blocks](ElasticSystem::nodal_stiffness).
    ///
    /// # Errors
    /// As [`assemble`](Self::assemble).
    pub fn discretize(&self) -> Result<ElasticSystem, FemError> {
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
        let all: Vec<Material> = std::iter::once(&body.material)
            .chain(body.by_group.iter().map(|g| &g.1))
            .cloned()
            .collect();
        let mut system = Self {
            mesh: Arc::clone(mesh),
            free,
            stiffness: OnceLock::new(),
            dofs,
            supports: LoadCase::default(),
            plane: body.plane,
            materials: all,
            material_of: materials,
        };
        system.supports = system.case_of(prescribed)?;
        Ok(system)
    }

    /// Calls `add` with the nodes and the stiffness of each cell.
    fn for_cells(&self, mut add: impl FnMut(&[usize], &ElementMatrix)) {
        let tensors = tensors(&self.materials, self.mesh.dim(), self.plane);
        let mut element = ElementMatrix::default();
        for cell in 0..self.mesh.num_cells() {
            let tensor = &tensors[self.material_of[cell]];
            element.compute(self.mesh.kind(cell), &self.mesh.corners(cell), tensor);
            add(self.mesh.cell(cell), &element);
        }
    }

    fn single_entries(&self) -> Matrix {
        let dim = self.mesh.dim();
        let pattern = match pattern(&self.mesh, dim, &self.dofs, self.free) {
            Ok(pattern) => pattern,
            Err(_) => unreachable!("rows of free displacements increase"),
        };
        let mut stiffness = Matrix::zeros(pattern);
        self.for_cells(|nodes, element| {
            for (b, &nb) in nodes.iter().enumerate() {
                for e in 0..dim {
                    let column = self.dofs[dim * nb + e];
                    if column == PRESCRIBED {
                        continue;
                    }
                    for (a, &na) in nodes.iter().enumerate() {
                        for d in 0..dim {
                            let row = self.dofs[dim * na + d];
                            if row != PRESCRIBED {
                                stiffness.add(row, column, element.get(dim * a + d, dim * b + e));
                            }
                        }
                    }
                }
            }
        });
        stiffness
    }

    /// A in blocks of nodes, with their positions: half the memory of single entries, for
    /// [`ReducedContact`](crate::contact::ReducedContact). Assembled at each call.
    ///
    /// # Errors
    /// [`FemError::TooLarge`] where the blocks do not fit into memory.
    ///
    /// ```
    /// use semismooth::fem::{Elasticity, Material, Mesh};
    /// let mesh = Mesh::block([0.0; 3], [1.0; 3], [3, 3, 3])?;
    /// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix("left").discretize()?;
    /// let nodal = system.nodal_stiffness()?;
    /// assert_eq!((nodal.num_nodes(), nodal.num_unknowns()), (48, 144));
    /// assert_eq!(nodal.to_matrix()?, *system.stiffness());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn nodal_stiffness(&self) -> Result<NodalMatrix, FemError> {
        let dim = self.mesh.dim();
        let free = |n: usize| (0..dim).any(|d| self.dofs[dim * n + d] != PRESCRIBED);
        let mut number = vec![u32::MAX; self.mesh.num_nodes()];
        let mut points = Vec::new();
        for n in (0..number.len()).filter(|&n| free(n)) {
            number[n] = points.len() as u32;
            points.push(self.mesh.points()[n]);
        }
        let mut places = Vec::with_capacity(self.free);
        for (k, _) in self.dofs.iter().enumerate().filter(|d| *d.1 != PRESCRIBED) {
            places.push(dim as u32 * number[k / dim] + (k % dim) as u32);
        }
        let blocks = match dim {
            2 => NodalBlocks::Plane(self.in_blocks(&number, points.len())?),
            _ => NodalBlocks::Space(self.in_blocks(&number, points.len())?),
        };
        Ok(NodalMatrix::from_parts(blocks, points, places))
    }

    fn in_blocks<const B: usize>(&self, number: &[u32], nodes: usize) -> Result<Blocks<B, B>, FemError> {
        let mut blocks = Blocks::<B, B>::new(nodes);
        blocks.start.reserve_exact(nodes);
        for_neighbours(&self.mesh, |n, neighbours| {
            if number[n] != u32::MAX {
                let known = neighbours.iter().map(|&m| number[m]);
                blocks.col.extend(known.filter(|m| *m != u32::MAX));
                blocks.start.push(blocks.col.len());
            }
        });
        let count = blocks.col.len();
        if nodes >= u32::MAX as usize / 6 || blocks.value.try_reserve_exact(count).is_err() {
            return Err(FemError::TooLarge {
                cells: vec![self.mesh.num_cells()],
            });
        }
        blocks.value.resize(count, [[0.0; B]; B]);
        let fixed: Vec<u8> = (0..number.len())
            .map(|n| {
                (0..B)
                    .filter(|d| self.dofs[B * n + d] == PRESCRIBED)
                    .fold(0, |m, d| m | 1 << d)
            })
            .collect();
        self.for_cells(|cell, element| {
            for (a, &na) in cell.iter().enumerate().filter(|n| number[*n.1] != u32::MAX) {
                for (b, &nb) in cell.iter().enumerate().filter(|n| number[*n.1] != u32::MAX) {
                    let Some(slot) = blocks.slot(number[na] as usize, number[nb] as usize) else {
                        continue;
                    };
                    let block = &mut blocks.value[slot];
                    for d in (0..B).filter(|d| fixed[na] >> d & 1 == 0) {
                        for e in (0..B).filter(|e| fixed[nb] >> e & 1 == 0) {
                            block[d][e] += element.get(B * a + d, B * b + e);
                        }
                    }
                }
            }
        });
        Ok(blocks)
    }

    /// The load case of displacements of the supports, one entry a component of a node, 0 at free ones.
    fn case_of(&self, prescribed: Vec<f64>) -> Result<LoadCase, FemError> {
        let mut forces = vec![0.0; self.num_free()];
        let mut reactions = vec![0.0; prescribed.len()];
        self.for_elements(&prescribed, |row, force| match self.dofs[row] {
            PRESCRIBED => reactions[row] += force,
            free => forces[free] -= force,
        });
        Ok(LoadCase::of_supports(prescribed, forces, reactions)?)
    }

    /// Calls `add` with each component of each node of the cells that displacements move, and the force that they make there.
    fn for_elements(&self, displacements: &[f64], mut add: impl FnMut(usize, f64)) {
        let dim = self.mesh.dim();
        let tensors = tensors(&self.materials, dim, self.plane);
        let mut element = ElementMatrix::default();
        for cell in 0..self.mesh.num_cells() {
            let components = || {
                let nodes = self.mesh.cell(cell).iter();
                nodes.flat_map(|n| (0..dim).map(move |d| dim * n + d))
            };
            if components().all(|k| displacements[k] == 0.0) {
                continue;
            }
            let tensor = &tensors[self.material_of[cell]];
            element.compute(self.mesh.kind(cell), &self.mesh.corners(cell), tensor);
            for (i, row) in components().enumerate() {
                let force = |(j, k): (usize, usize)| element.get(i, j) * displacements[k];
                add(row, components().enumerate().map(force).sum());
            }
        }
    }

    /// A: symmetric positive definite, one row a free displacement.
    #[must_use]
    pub fn stiffness(&self) -> &Matrix {
        self.stiffness.get_or_init(|| self.single_entries())
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Number of free displacements.
    #[must_use]
    pub fn num_free(&self) -> usize {
        self.free
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

    /// The load case of the supports as prescribed: part of any load (its [forces](LoadCase::forces) are 0 if all supports are fixed).
    #[must_use]
    pub fn supports(&self) -> &LoadCase {
        &self.supports
    }

    /// The load case of supports that move: `value(x)` is u_component on a group of facets where that component is prescribed, all other
    /// supports rest. With an amplitude in a [`LoadPath`](crate::interface::LoadPath) this is displacement control.
    ///
    /// # Errors
    /// Groups that do not exist or are empty, components beyond the dimension or not prescribed on the group
    /// ([`FemError::NotPrescribed`]), values that are not finite.
    pub fn motion(
        &self,
        facets: &str,
        component: usize,
        value: impl Fn([f64; 3]) -> f64,
    ) -> Result<LoadCase, FemError> {
        let dim = self.mesh.dim();
        if component >= dim {
            return Err(FemError::Component { component, dim });
        }
        let mut moved = vec![0.0; self.dofs.len()];
        for &node in self.mesh.facet_group(facets)?.iter().flatten() {
            let (at, k) = (self.mesh.points()[node], dim * node + component);
            if self.dofs[k] != PRESCRIBED {
                return Err(FemError::NotPrescribed { node, at, component });
            }
            moved[k] = value(at);
            if !moved[k].is_finite() {
                return Err(FemError::NotFinite {
                    what: "the motion of the support",
                    at,
                    value: moved[k],
                });
            }
        }
        self.case_of(moved)
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
        self.supports.displacements()[self.mesh.dim() * node + component]
    }

    /// All displacements, node by node, from the free ones and those of the supports (node by node, too:
    /// [`LoadCase::displacements`], or [`support_displacements`](crate::contact::Contact::support_displacements) of a contact problem).
    /// None are needed (`&[]`) where all supports are fixed.
    ///
    /// # Errors
    /// Wrong lengths.
    pub fn displacements(&self, free: &[f64], supports: &[f64]) -> Result<Vec<f64>, FemError> {
        let wrong = |what, expected, found| {
            Err(FemError::Length {
                what,
                expected,
                found,
            })
        };
        if free.len() != self.num_free() {
            return wrong("the vector of free displacements", self.num_free(), free.len());
        }
        let fixed = || self.supports.displacements().iter().all(|v| *v == 0.0);
        if supports.len() != self.dofs.len() && !(supports.is_empty() && fixed()) {
            return wrong(
                "the vector of displacements of the supports",
                self.dofs.len(),
                supports.len(),
            );
        }
        let value = |(k, &dof): (usize, &usize)| match dof {
            PRESCRIBED => supports.get(k).copied().unwrap_or(0.0),
            dof => free[dof],
        };
        Ok(self.dofs.iter().enumerate().map(value).collect())
    }

    /// The forces that hold the supports, node by node, 0 at free components; loads that act on the supports themselves come on top.
    ///
    /// # Errors
    /// As [`displacements`](Self::displacements).
    pub fn reactions(&self, free: &[f64], supports: &[f64]) -> Result<Vec<f64>, FemError> {
        let u = self.displacements(free, supports)?;
        let mut forces = vec![0.0; u.len()];
        self.for_elements(&u, |row, force| {
            if self.dofs[row] == PRESCRIBED {
                forces[row] += force;
            }
        });
        Ok(forces)
    }

    /// Stresses (11, 22, 33, 12, 23, 13) at the centre of each cell, from the displacements.
    ///
    /// # Errors
    /// As [`displacements`](Self::displacements).
    pub fn stresses(&self, free: &[f64], supports: &[f64]) -> Result<Vec<[f64; 6]>, FemError> {
        let u = self.displacements(free, supports)?;
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
    let mut col_ptr = Vec::with_capacity(free + 1);
    col_ptr.push(0);
    let mut row_idx = Vec::new();
    for_neighbours(mesh, |n, neighbours| {
        for e in 0..dim {
            if dofs[dim * n + e] == PRESCRIBED {
                continue;
            }
            for &m in neighbours {
                row_idx.extend(dofs[dim * m..dim * (m + 1)].iter().filter(|&&d| d != PRESCRIBED));
            }
            col_ptr.push(row_idx.len());
        }
    });
    Ok(Pattern::from_csc(free, free, col_ptr, row_idx)?)
}

/// Calls `see` with each node and, in order, all nodes that share a cell with it, itself among them.
fn for_neighbours(mesh: &Mesh, mut see: impl FnMut(usize, &[usize])) {
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
    let mut neighbours: Vec<usize> = Vec::new();
    for n in 0..nodes {
        neighbours.clear();
        for &cell in &cells[first[n]..first[n + 1]] {
            neighbours.extend_from_slice(mesh.cell(cell));
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        see(n, &neighbours);
    }
}
