use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

use super::cell_points::Points;
use super::elasticity::{Dilatation, Elasticity};
use super::element::Jacobian;
use super::facet::integrate;
use super::material::VOIGT;
use super::nodal::CellsOf;
use super::rigid::check_supports;
use super::springs::{Attached, Coupled};
use super::stiffness::Elements;
use super::{FemError, Material, Mesh, PlaneModel};
use crate::InputError;
use crate::interface::LoadCase;
use crate::sparse::{Matrix, Pattern};
/// No free displacement.
pub(super) use crate::tolerances::NONE as PRESCRIBED;
use crate::tolerances::SAME;

/// The assembled system A u = f of the free displacements of an [`Elasticity`].
///
/// Free displacements are numbered node by node, component by component.
#[derive(Debug, Clone)]
pub struct ElasticSystem {
    pub(super) mesh: Arc<Mesh>,
    /// Number of free displacements.
    pub(super) free: usize,
    stiffness: OnceLock<Matrix>,
    /// Free displacement of each component of each node, or [`PRESCRIBED`].
    pub(super) dofs: Vec<usize>,
    /// The prescribed displacements, 0 at free components, and the forces due to them.
    supports: LoadCase,
    pub(super) plane: PlaneModel,
    /// Whether quadrilaterals and hexahedra of each material have the mean dilatation.
    pub(super) mean_dilatation: Vec<bool>,
    /// Materials, and the index of that of each cell.
    pub(super) materials: Vec<Material>,
    pub(super) material_of: Vec<usize>,
    /// Springs and elastic foundations.
    pub(super) attached: Vec<Attached>,
}

impl Elasticity {
    /// Assembles the stiffness matrix of the free displacements.
    ///
    /// # Errors
    /// Groups that do not exist or are empty, components beyond the dimension, prescribed values that are not finite, no free displacement,
    /// supports that leave rigid motions ([`FemError::Floating`] names them) unless that is [accepted](Elasticity::floating).
    pub fn assemble(&self) -> Result<ElasticSystem, FemError> {
        let system = self.discretize()?;
        system.stiffness.get_or_init(|| system.single_entries());
        Ok(system)
    }

    /// As [`assemble`](Self::assemble), but the stiffness matrix is only assembled on first use: large bodies use it [in
    /// blocks](ElasticSystem::nodal_stiffness).
    ///
    /// # Errors
    /// As [`assemble`](Self::assemble).
    pub fn discretize(&self) -> Result<ElasticSystem, FemError> {
        ElasticSystem::new(self)
    }

    fn has_mean_dilatation(&self, material: &Material) -> bool {
        let compressed = self.mesh.dim() == 3 || self.plane != PlaneModel::Stress;
        match self.dilatation {
            Dilatation::Automatic => compressed && material.locks(),
            Dilatation::Mean => compressed,
            Dilatation::Pointwise => false,
        }
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
            for node in mesh.supported(&support.group)? {
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
        let revolved = dim == 2 && body.plane == PlaneModel::Axisymmetric;
        if revolved {
            fix_axis(mesh, &mut fixed, &prescribed)?;
        }
        let attached = body.attachments(|at| if revolved { TAU * at[0] } else { 1.0 })?;
        if !mesh.is_part() && !body.floats {
            check_supports(mesh, &fixed, &attached, revolved)?;
        }
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
        if free == 0 && !mesh.is_part() {
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
        if let (true, Some(value)) = (revolved, all.iter().find_map(Material::twisting)) {
            return Err(FemError::Material {
                what: "a constant between strains in the plane and out of it",
                value,
                rule: "it must be 0 in a body of revolution, which would twist: model it in space",
            });
        }
        let mut system = Self {
            mesh: Arc::clone(mesh),
            free,
            stiffness: OnceLock::new(),
            dofs,
            supports: LoadCase::default(),
            plane: body.plane,
            mean_dilatation: all.iter().map(|m| body.has_mean_dilatation(m)).collect(),
            materials: all,
            material_of: materials,
            attached,
        };
        system.supports = system.case_of(prescribed)?;
        Ok(system)
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

    /// Cells, springs and foundations.
    pub(super) fn coupled(&self) -> Coupled<'_> {
        Coupled {
            mesh: &self.mesh,
            attached: &self.attached,
        }
    }

    /// Calls `add` with each component of the nodes of all cells with non-zero displacements, and the nodal force that the cell contributes
    /// there.
    fn for_elements(&self, displacements: &[f64], mut add: impl FnMut(usize, f64)) {
        let dim = self.mesh.dim();
        let mut elements = Elements::new(self);
        for cell in 0..self.coupled().len() {
            let components = || {
                let nodes = self.coupled().nodes(cell).iter();
                nodes.flat_map(|n| (0..dim).map(move |d| dim * n + d))
            };
            if components().all(|k| displacements[k] == 0.0) {
                continue;
            }
            let element = elements.of(cell);
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

    /// The load case of supports that move: `value(x)` is u_component on a group of facets or nodes where that component is prescribed, all other
    /// supports are at rest. With an amplitude in a [`LoadPath`](crate::interface::LoadPath) this is displacement control.
    ///
    /// # Errors
    /// Groups that do not exist or are empty, components beyond the dimension or not prescribed on the group
    /// ([`FemError::NotPrescribed`]), values that are not finite.
    pub fn motion(
        &self,
        group: &str,
        component: usize,
        value: impl Fn([f64; 3]) -> f64,
    ) -> Result<LoadCase, FemError> {
        let dim = self.mesh.dim();
        if component >= dim {
            return Err(FemError::Component { component, dim });
        }
        let mut moved = vec![0.0; self.dofs.len()];
        let axis = (self.is_revolved() && component == 0).then(|| axis(&self.mesh));
        for node in self.mesh.supported(group)? {
            let (at, k) = (self.mesh.points()[node], dim * node + component);
            if self.dofs[k] != PRESCRIBED {
                return Err(FemError::NotPrescribed { node, at, component });
            }
            moved[k] = value(at);
            if axis.is_some_and(|axis| at[0] <= axis) && moved[k] != 0.0 {
                return Err(FemError::OnAxis {
                    node,
                    value: moved[k],
                });
            }
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

    /// Nodal forces of a volume force (force per volume, or per area of the plane; third component ignored in the plane). In a body of
    /// revolution forces on nodes are those on the whole rings.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn body_force(&self, force: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Vec<f64>, FemError> {
        let mut load = vec![0.0; self.num_free()];
        for cell in 0..self.mesh.num_cells() {
            let kind = self.mesh.kind(cell);
            let nodes = || self.mesh.nodes_at(cell);
            for sample in &kind.reference().table().quadrature {
                let map = Jacobian::of(kind.dim(), nodes(), &sample.gradient);
                let at = interpolate(nodes(), &sample.value);
                let weight = sample.weight * self.round(at);
                let f = self.checked("the volume force", at, force(at))?;
                for (&node, s) in self.mesh.cell(cell).iter().zip(&sample.value) {
                    self.add(&mut load, node, weight * map.det * s, f);
                }
            }
        }
        Ok(load)
    }

    /// Nodal forces of a surface traction (force per area, or per length in the plane) on a group of facets; of the whole rings in a body
    /// of revolution.
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
            integrate(&self.mesh, nodes, |at, shape, measure| {
                let measure = measure * self.round(at);
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

    /// Nodal forces of a force at each node of a group of nodes (of the whole ring in a body of revolution).
    ///
    /// # Errors
    /// Groups that do not exist or are empty, values that are not finite.
    pub fn nodal_force(
        &self,
        nodes: &str,
        force: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Result<Vec<f64>, FemError> {
        let mut load = vec![0.0; self.num_free()];
        for &node in self.mesh.node_group(nodes)? {
            let at = self.mesh.points()[node];
            self.add(
                &mut load,
                node,
                1.0,
                self.checked("the nodal force", at, force(at))?,
            );
        }
        Ok(load)
    }

    /// Whether the body is one of revolution about x = 0.
    pub(super) fn is_revolved(&self) -> bool {
        self.mesh.dim() == 2 && self.plane == PlaneModel::Axisymmetric
    }

    /// The length of the ring through a point of a body of revolution, by which measures in the plane are multiplied; elsewhere 1.
    pub(super) fn round(&self, at: [f64; 3]) -> f64 {
        if self.is_revolved() { TAU * at[0] } else { 1.0 }
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
            Err(FemError::Input(InputError::Length {
                what,
                expected,
                found,
            }))
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

    /// The reaction forces at the supports, node by node, 0 at free components; loads applied directly to the supports are not included.
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

    /// Stresses (11, 22, 33, 12, 23, 13) at the centre of each cell, from the displacements; in a body of revolution 11 is along the radius,
    /// 22 along the axis, 33 around it.
    ///
    /// # Errors
    /// As [`displacements`](Self::displacements).
    pub fn stresses(&self, free: &[f64], supports: &[f64]) -> Result<Vec<[f64; 6]>, FemError> {
        let u = self.displacements(free, supports)?;
        let dim = self.mesh.dim();
        let stress = |cell: usize| {
            let kind = self.mesh.kind(cell);
            let nodes = self.mesh.cell(cell);
            let places = || self.mesh.nodes_at(cell);
            let centre = &kind.reference().table().centre;
            let map = Jacobian::of(dim, places(), &centre.gradient);
            // h[d][e] = ∂u_d/∂x_e
            let mut h = [[0.0; 3]; 3];
            for (&node, g) in nodes.iter().zip(&centre.gradient) {
                let g = map.gradient(*g);
                for d in 0..dim {
                    for e in 0..dim {
                        h[d][e] += u[dim * node + d] * g[e];
                    }
                }
            }
            if self.is_revolved() {
                let radius = interpolate(places(), &centre.value)[0];
                let along = nodes.iter().zip(&centre.value).map(|(n, s)| s * u[dim * n]);
                h[2][2] = along.sum::<f64>() / radius;
            }
            let mut strain = VOIGT.map(|[i, j]| if i == j { h[i][i] } else { h[i][j] + h[j][i] });
            if self.mean_dilatation[self.material_of[cell]] && kind.is_box() {
                let (mut dilatation, mut volume) = (0.0, 0.0);
                for point in Points::of(kind, places(), false, self.is_revolved()).iter() {
                    volume += point.volume;
                    for (a, &node) in nodes.iter().enumerate() {
                        let own = (0..dim).map(|d| u[dim * node + d] * point.dilatation(a, d));
                        dilatation += point.volume * own.sum::<f64>();
                    }
                }
                let change = dilatation / volume - (h[0][0] + h[1][1] + h[2][2]);
                strain[..3].iter_mut().for_each(|s| *s += change / 3.0);
            }
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

    pub(super) fn add(&self, load: &mut [f64], node: usize, scale: f64, force: [f64; 3]) {
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

/// Radius up to which nodes are on the axis.
fn axis(mesh: &Mesh) -> f64 {
    SAME * mesh.points().iter().map(|p| p[0].abs()).fold(0.0, f64::max)
}

/// Fixes the radial displacement of the nodes on the axis of a body of revolution.
fn fix_axis(mesh: &Mesh, fixed: &mut [bool], prescribed: &[f64]) -> Result<(), FemError> {
    let axis = axis(mesh);
    for (node, at) in mesh.points().iter().enumerate() {
        if at[0] < -axis {
            return Err(FemError::Radius { node, at: *at });
        }
        if at[0] <= axis {
            if prescribed[2 * node] != 0.0 {
                return Err(FemError::OnAxis {
                    node,
                    value: prescribed[2 * node],
                });
            }
            fixed[2 * node] = true;
        }
    }
    Ok(())
}

fn interpolate(nodes: impl Iterator<Item = [f64; 3]>, shape: &[f64]) -> [f64; 3] {
    let mut at = [0.0; 3];
    for (node, s) in nodes.zip(shape) {
        for d in 0..3 {
            at[d] += s * node[d];
        }
    }
    at
}

/// The pattern of the free unknowns, `dim` a node: nodes that share a cell.
pub(super) fn pattern(
    all: Coupled<'_>,
    dim: usize,
    dofs: &[usize],
    free: usize,
) -> Result<Pattern, FemError> {
    let mut col_ptr = Vec::with_capacity(free + 1);
    col_ptr.push(0);
    let mut row_idx = Vec::new();
    for_neighbours(all, |n, neighbours| {
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

/// Calls `see` with each node and, in increasing order, all nodes that share a cell with it, including itself.
fn for_neighbours(all: Coupled<'_>, mut see: impl FnMut(usize, &[usize])) {
    let cells = CellsOf::new(all);
    let mut neighbours: Vec<usize> = Vec::new();
    for n in 0..all.mesh.num_nodes() {
        neighbours.clear();
        for &cell in cells.of(n) {
            neighbours.extend_from_slice(all.nodes(cell as usize));
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        see(n, &neighbours);
    }
}
