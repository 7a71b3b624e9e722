//! Derivatives of the elastic forces at given displacements: in the constants of materials and in the positions of nodes.

use super::assembly::{ElasticSystem, PRESCRIBED};
use super::cell_points::{Point, Points};
use super::element::MAX_NODES;
use super::material::{KEPT, MaterialConstant, PlaneModel, Tensor};
use super::{ContactRows, FemError};
use crate::input::check_length;
use crate::sparse::Matrix;
use crate::words::named;

named!(
    MaterialConstant,
    "constant of a material",
    [Self::Young, Self::Poisson]
);

impl MaterialConstant {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Young => "young",
            Self::Poisson => "poisson",
        }
    }
}

/// A cell with its displacements, and the strains of its nodal displacements at the points of integration.
struct Cell {
    nodes: usize,
    dim: usize,
    points: Points,
    u: [[f64; 3]; MAX_NODES],
    is_mean: bool,
}

impl Cell {
    /// Σ over the displacements of the strains of a point, which are linear in them.
    fn strain(&self, point: Point<'_>) -> [f64; 6] {
        let mut strain = [0.0; 6];
        for a in 0..self.nodes {
            for d in (0..self.dim).filter(|&d| self.u[a][d] != 0.0) {
                let column = point.column(a, d);
                (strain.iter_mut().zip(column)).for_each(|(s, c)| *s += c * self.u[a][d]);
            }
        }
        strain
    }

    /// The points' changes as node `a` moves along `d`: exact, as are shape functions and weights fixed in the reference cell.
    fn changes(&self, a: usize, d: usize) -> Points {
        let mut changes = self.points.clone();
        for (k, point) in self.points.iter().enumerate() {
            let moved = point.shares[a];
            let turn = if d == 0 { moved.hoop } else { 0.0 };
            let (volume, shares) = changes.get_mut(k);
            *volume *= moved.gradient[d] + turn;
            for share in shares {
                share.gradient = moved.gradient.map(|g| -share.gradient[d] * g);
                share.hoop *= -turn;
                share.mean = [0.0; 3];
            }
        }
        if !self.is_mean {
            return changes;
        }
        let volume: f64 = self.points.iter().map(|p| p.volume).sum();
        let grown: f64 = changes.iter().map(|p| p.volume).sum();
        for b in 0..self.nodes {
            for e in 0..3 {
                let (mut mean, mut moved) = (0.0, 0.0);
                for (p, c) in self.points.iter().zip(changes.iter()) {
                    mean += p.volume * p.dilatation(b, e);
                    moved += c.volume * p.dilatation(b, e) + p.volume * c.dilatation(b, e);
                }
                let moved = (moved - mean * grown / volume) / volume;
                for k in 0..changes.len() {
                    let share = &mut changes.get_mut(k).1[b];
                    share.mean[e] = (moved - share.dilatation(e)) / 3.0;
                }
            }
        }
        changes
    }

    /// Adds the nodal forces of stresses.
    fn add_forces(&self, point: Point<'_>, stress: [f64; 6], forces: &mut [[f64; 3]; MAX_NODES]) {
        for (b, force) in forces.iter_mut().enumerate().take(self.nodes) {
            for (e, f) in force.iter_mut().enumerate().take(self.dim) {
                let column = point.column(b, e);
                *f += column.iter().zip(stress).map(|(c, s)| c * s).sum::<f64>();
            }
        }
    }
}

fn times(tensor: &Tensor, strain: [f64; 6], scale: f64) -> [f64; 6] {
    tensor.map(|row| scale * row.iter().zip(strain).map(|(c, s)| c * s).sum::<f64>())
}

impl ElasticSystem {
    /// The tensor of a plane body or a solid, by the components of strain. In plane stress the strains out of the plane, of which
    /// displacements have none, make no stress either.
    pub(super) fn tensor(&self, material: usize) -> Tensor {
        let material = &self.materials[material];
        match self.mesh.dim() == 2 && self.plane == PlaneModel::Stress {
            true => spread(material.plane(PlaneModel::Stress)),
            false => material.solid(),
        }
    }

    fn with_displacements(&self, cell: usize, displacements: &[f64]) -> Cell {
        let (dim, kind) = (self.mesh.dim(), self.mesh.kind(cell));
        let is_mean = self.mean_dilatation[self.material_of[cell]] && kind.is_box();
        let mut u = [[0.0; 3]; MAX_NODES];
        for (own, node) in u.iter_mut().zip(self.mesh.cell(cell)) {
            own[..dim].copy_from_slice(&displacements[dim * node..dim * (node + 1)]);
        }
        Cell {
            nodes: kind.num_nodes(),
            dim,
            points: Points::of(kind, self.mesh.nodes_at(cell), is_mean, self.is_revolved()),
            u,
            is_mean,
        }
    }

    fn check_displacements(&self, displacements: &[f64]) -> Result<(), FemError> {
        check_length(
            "the vector of displacements, one for each component of each node,",
            displacements.len(),
            self.dofs.len(),
        )?;
        let dim = self.mesh.dim();
        match displacements.iter().position(|u| !u.is_finite()) {
            Some(k) => Err(FemError::NotFinite {
                what: "the displacement",
                at: self.mesh.points()[k / dim],
                value: displacements[k],
            }),
            None => Ok(()),
        }
    }

    /// The derivative of the elastic forces A u on the free displacements in a constant of an isotropic material, in all cells or in those
    /// of a group, at given displacements of all nodes ([`displacements`](Self::displacements)): ∂A u, less the change of the forces that
    /// stem from supports. The discretisation is that of this system: [`Dilatation::Automatic`](super::Dilatation::Automatic) does not
    /// change with Poisson's ratio.
    ///
    /// ```
    /// use semismooth::fem::{Elasticity, Material, MaterialConstant, Mesh};
    /// // One square, fixed below: forces are proportional to E.
    /// let mesh = Mesh::rectangle([0.0; 2], [1.0, 1.0], [1, 1])?;
    /// let system = Elasticity::new(mesh, Material::isotropic(2.0, 0.3)?).fix("bottom").assemble()?;
    /// let u = system.displacements(&[0.1, 0.2, 0.0, -0.1], &[])?;
    /// let slope = system.forces_by_material(&u, MaterialConstant::Young, None)?;
    /// let mut forces = vec![0.0; 4];
    /// system.stiffness().mul_vec(&[0.1, 0.2, 0.0, -0.1], &mut forces);
    /// assert!(slope.iter().zip(&forces).all(|(s, f)| (2.0 * s - f).abs() < 1e-15));
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    ///
    /// # Errors
    /// A wrong length, values that are not finite, groups that do not exist or are empty, materials that are not isotropic.
    pub fn forces_by_material(
        &self,
        displacements: &[f64],
        constant: MaterialConstant,
        cells: Option<&str>,
    ) -> Result<Vec<f64>, FemError> {
        self.check_displacements(displacements)?;
        let is_stress = self.mesh.dim() == 2 && self.plane == PlaneModel::Stress;
        let all: Vec<usize>;
        let cells = match cells {
            Some(group) => self.mesh.cell_group(group)?,
            None => {
                all = (0..self.mesh.num_cells()).collect();
                &all
            }
        };
        let mut known: Vec<Option<Tensor>> = vec![None; self.materials.len()];
        let mut forces = vec![0.0; self.num_free()];
        for &cell in cells {
            let material = self.material_of[cell];
            let tensor = match known[material] {
                Some(tensor) => tensor,
                None => {
                    let found = self.materials[material].derivative(constant, is_stress)?;
                    *known[material].insert(found)
                }
            };
            let own = self.with_displacements(cell, displacements);
            let mut nodal = [[0.0; 3]; MAX_NODES];
            for point in own.points.iter() {
                let stress = times(&tensor, own.strain(point), point.volume);
                own.add_forces(point, stress, &mut nodal);
            }
            for (&node, force) in self.mesh.cell(cell).iter().zip(nodal) {
                self.add(&mut forces, node, 1.0, force);
            }
        }
        Ok(forces)
    }

    /// The derivative of the elastic forces on the free displacements in the positions of all nodes, at given displacements of all nodes:
    /// one row a free displacement, one column a component of the position of a node (d + dim · node). Nodal loads are not
    /// changed. Elements are differentiated as they are integrated, so that this is the derivative of the discrete forces. With a velocity
    /// of all nodes for each parameter of a shape, its product with these is what the parameter does; models of half a body move within
    /// their symmetry.
    ///
    /// # Errors
    /// A wrong length, values that are not finite; bodies on elastic foundations.
    pub fn forces_by_position(&self, displacements: &[f64]) -> Result<Matrix, FemError> {
        self.check_displacements(displacements)?;
        if self.attached.iter().any(|a| a.is_area) {
            return Err(FemError::FoundationMoves);
        }
        let (dim, mesh) = (self.mesh.dim(), &self.mesh);
        let mut entries = Vec::new();
        for cell in 0..mesh.num_cells() {
            let tensor = self.tensor(self.material_of[cell]);
            let own = self.with_displacements(cell, displacements);
            let strains: Vec<[f64; 6]> = own.points.iter().map(|p| own.strain(p)).collect();
            for (a, &moved) in mesh.cell(cell).iter().enumerate() {
                for d in 0..dim {
                    let mut nodal = [[0.0; 3]; MAX_NODES];
                    let changes = own.changes(a, d);
                    for ((point, change), strain) in own.points.iter().zip(changes.iter()).zip(&strains) {
                        own.add_forces(change, times(&tensor, *strain, point.volume), &mut nodal);
                        let mut stress = times(&tensor, *strain, change.volume);
                        let other = times(&tensor, own.strain(change), point.volume);
                        stress.iter_mut().zip(other).for_each(|(s, o)| *s += o);
                        own.add_forces(point, stress, &mut nodal);
                    }
                    for (&node, force) in mesh.cell(cell).iter().zip(nodal) {
                        for (e, f) in force.iter().enumerate().take(dim) {
                            let row = self.dofs[dim * node + e];
                            if row != PRESCRIBED {
                                entries.push((row, dim * moved + d, *f));
                            }
                        }
                    }
                }
            }
        }
        let columns = dim * mesh.num_nodes();
        Ok(Matrix::from_triplets(self.num_free(), columns, &entries)?)
    }
}

fn spread(plane: [[f64; 3]; 3]) -> Tensor {
    let mut tensor = [[0.0; 6]; 6];
    for (i, row) in KEPT.into_iter().zip(plane) {
        KEPT.into_iter().zip(row).for_each(|(j, c)| tensor[i][j] = c);
    }
    tensor
}

impl ContactRows {
    /// The derivative of B u − gap in the positions of all nodes, for contact with a foundation whose normals are the same everywhere, as
    /// those of [planes](super::Foundation::plane): then B does not change, and the gap of a contact node at x changes by `gradient(x)`,
    /// the gradient of the foundation's gap (of a plane its unit normal). One row a trace (normal ones first), one column a component of
    /// the position of a node (d + dim · node).
    ///
    /// # Errors
    /// Rows that are not those of single nodes, as between two bodies; gradients that are not finite.
    pub fn traces_by_position(
        &self,
        system: &ElasticSystem,
        gradient: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Result<Matrix, FemError> {
        let (dim, p) = (system.mesh().dim(), self.nodes.len());
        if !self.is_nodal(system) {
            return Err(FemError::Frame {
                node: 0,
                what: "rows between two bodies, or of facets of second order, change with positions in more than their gaps, which is not differentiated".into(),
            });
        }
        let mut entries = Vec::new();
        for (i, (&node, &at)) in self.nodes.iter().zip(&self.points).enumerate() {
            for (d, g) in gradient(at).into_iter().enumerate().take(dim) {
                if !g.is_finite() {
                    return Err(FemError::NotFinite {
                        what: "the gradient of the gap",
                        at,
                        value: g,
                    });
                }
                entries.push((i, dim * node + d, -g));
            }
        }
        Ok(Matrix::from_triplets(
            dim * p,
            dim * system.mesh().num_nodes(),
            &entries,
        )?)
    }
}
