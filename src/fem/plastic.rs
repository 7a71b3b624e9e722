use super::assembly::{PRESCRIBED, pattern};
use super::cell_points::{Point, Points};
use super::springs::Coupled;
use super::{ElasticSystem, Elasticity, FemError, PlaneModel, PlasticResponse, PlasticState, VonMises};
use crate::input::check_vector;
use crate::piecewise::Semismooth;
use crate::sparse::{Matrix, Pattern};

/// A body of [`VonMises`] material at one step of its history: the equilibrium of forces on the free displacements as a semismooth map.
///
/// [`set_load`](Self::set_load) sets the forces of the next step, Newton's method finds the displacements, and [`commit`](Self::commit)
/// updates the history. Plane bodies are in plane strain. In quadrilaterals and hexahedra of first order the volumetric strain is averaged over the
/// cell, so that isochoric plastic flow does not lock (T. J. R. Hughes, Int. J. Numer. Methods Eng. 15 (1980); weighted by volume as in Simo and
/// Hughes (1998), section 4.5); simplices of first order do lock.
///
/// ```
/// use semismooth::fem::{Elasticity, Mesh, PlasticBody, VonMises};
/// use semismooth::newton::Newton;
/// // MPa and mm: a square pulled beyond its yield stress 2 σ_y/√3 in plane strain, then unloaded.
/// let steel = VonMises::new(210e3, 0.3, 250.0)?.with_hardening(0.0, 5e3)?;
/// let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 2])?;
/// let supported = Elasticity::new(mesh, steel.elastic().clone())
///     .fix_component("left", 0)
///     .fix_component("bottom", 1);
/// let mut body = PlasticBody::new(&supported, steel)?;
/// let mut u = vec![0.0; body.system().num_free()];
/// let mut dissipated = 0.0;
/// for stress in [320.0, 0.0] {
///     let load = body.system().traction("right", |_| [stress, 0.0, 0.0])?;
///     body.set_load(&load)?;
///     Newton::default().solve_semismooth(&body, &mut u)?;
///     dissipated += body.commit(&u)?.dissipated;
/// }
/// let stays = u[body.system().dof(8, 0).unwrap()];
/// assert!(stays > 2e-3 && dissipated > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PlasticBody {
    system: ElasticSystem,
    law: VonMises,
    /// Quadrature points of cell c: `first[c]..first[c + 1]`.
    first: Vec<usize>,
    points: Points,
    states: Vec<PlasticState>,
    load: Vec<f64>,
    /// Displacements of the supports, node by node.
    supports: Vec<f64>,
    /// All displacements at the last step, node by node.
    before: Vec<f64>,
    pattern: Pattern,
}

/// Energies of a [`PlasticBody`], per unit of depth in the plane.
///
/// The work of the loads at the end of a step, f · Δu, is the change of the stored energies plus the dissipation and
/// [`increment`](Self::increment), the elastic and hardening energy of the increments, which is the error of the implicit Euler method, of
/// second order in the step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct PlasticEnergies {
    /// Elastic energy, recovered on unloading.
    pub elastic: f64,
    /// Energy stored by hardening.
    pub hardening: f64,
    /// Dissipation in the step, σ_y ∫Δα ≥ 0.
    pub dissipated: f64,
    /// The stored energy, elastic and of hardening, of the increments of the step.
    pub increment: f64,
}

impl PlasticBody {
    /// The virgin body, without load, its supports as prescribed.
    ///
    /// # Errors
    /// As [`Elasticity::assemble`]; materials other than [`VonMises::elastic`]; plane stress and bodies of revolution; springs
    /// and elastic foundations.
    pub fn new(body: &Elasticity, law: VonMises) -> Result<Self, FemError> {
        let system = body.discretize()?;
        if system.materials.iter().any(|m| m != law.elastic()) {
            return Err(FemError::PlasticBody {
                what: "it has a material other than the elastic one of its plastic law",
            });
        }
        if !system.attached.is_empty() {
            return Err(FemError::PlasticBody {
                what: "it has springs or elastic foundations",
            });
        }
        let mesh = system.mesh();
        if mesh.dim() == 2 && system.plane != PlaneModel::Strain {
            return Err(FemError::PlasticBody {
                what: "neither plane stress nor bodies of revolution are supported, plane strain is",
            });
        }
        let mut points = Points::default();
        let mut first = vec![0];
        for cell in 0..mesh.num_cells() {
            let kind = mesh.kind(cell);
            points.add(kind, mesh.nodes_at(cell), kind.is_box(), false);
            first.push(points.len());
        }
        Ok(Self {
            pattern: pattern(Coupled::cells(mesh), mesh.dim(), &system.dofs, system.free)?,
            states: vec![PlasticState::default(); points.len()],
            load: vec![0.0; system.free],
            supports: system.supports().displacements().to_vec(),
            before: vec![0.0; system.dofs.len()],
            first,
            points,
            law,
            system,
        })
    }

    /// Mesh, free displacements and loads.
    #[must_use]
    pub fn system(&self) -> &ElasticSystem {
        &self.system
    }

    /// Sets the forces on the free displacements, say from [`ElasticSystem::traction`].
    ///
    /// # Errors
    /// Wrong lengths, entries that are not finite.
    pub fn set_load(&mut self, forces: &[f64]) -> Result<(), FemError> {
        replace("the load", &mut self.load, forces)
    }

    /// Sets the displacements of the supports, node by node, say those of [`ElasticSystem::motion`]; entries of free components are
    /// ignored.
    ///
    /// # Errors
    /// Wrong lengths, entries that are not finite.
    pub fn set_supports(&mut self, displacements: &[f64]) -> Result<(), FemError> {
        replace(
            "the vector of displacements of the supports",
            &mut self.supports,
            displacements,
        )
    }

    /// The states at the quadrature points of a cell.
    ///
    /// # Panics
    /// For cells that do not exist.
    #[must_use]
    pub fn states(&self, cell: usize) -> &[PlasticState] {
        &self.states[self.first[cell]..self.first[cell + 1]]
    }

    /// Ends the step at the free displacements `x`: updates the history and returns the energies.
    ///
    /// # Errors
    /// Wrong lengths, entries that are not finite.
    pub fn commit(&mut self, x: &[f64]) -> Result<PlasticEnergies, FemError> {
        check_vector("the vector of free displacements", x, self.load.len())?;
        let now = self.system.displacements(x, &self.supports)?;
        let moved: Vec<f64> = now.iter().zip(&self.before).map(|(a, b)| a - b).collect();
        let mut sum = PlasticEnergies::default();
        for cell in 0..self.system.mesh.num_cells() {
            for k in self.first[cell]..self.first[cell + 1] {
                let (point, before) = (self.points.get(k), self.states[k]);
                let at = |u: &[f64]| self.strain(cell, point, |component| u[component]);
                let strain = at(&now);
                let state = self.law.respond(&strain, &before).state;
                let step = PlasticState {
                    strain: std::array::from_fn(|a| state.strain[a] - before.strain[a]),
                    accumulated: state.accumulated - before.accumulated,
                };
                let [elastic, hardening] = self.law.energies(&strain, &state);
                sum.elastic += point.volume * elastic;
                sum.hardening += point.volume * hardening;
                sum.dissipated += point.volume * self.law.yield_stress() * step.accumulated;
                sum.increment += point.volume * self.law.energies(&at(&moved), &step).iter().sum::<f64>();
                self.states[k] = state;
            }
        }
        self.before = now;
        Ok(sum)
    }

    /// Mean stresses of each cell (11, 22, 33, 12, 23, 13) at the free displacements `x`.
    ///
    /// # Errors
    /// Wrong lengths, entries that are not finite.
    pub fn stresses(&self, x: &[f64]) -> Result<Vec<[f64; 6]>, FemError> {
        check_vector("the vector of free displacements", x, self.load.len())?;
        let mean = |cell: usize| {
            let (mut sum, mut volume) = ([0.0; 6], 0.0);
            self.for_points(cell, x, |point, answer| {
                (0..6).for_each(|a| sum[a] += point.volume * answer.stress[a]);
                volume += point.volume;
            });
            sum.map(|s| s / volume)
        };
        Ok((0..self.system.mesh.num_cells()).map(mean).collect())
    }

    /// The strain at a point under displacements by component of a node.
    fn strain(&self, cell: usize, point: Point<'_>, u: impl Fn(usize) -> f64) -> [f64; 6] {
        let mesh = &self.system.mesh;
        let dim = mesh.dim();
        let mut strain = [0.0; 6];
        for (a, node) in mesh.cell(cell).iter().enumerate() {
            for d in 0..dim {
                let value = u(dim * node + d);
                let column = point.column(a, d);
                (0..6).for_each(|s| strain[s] += column[s] * value);
            }
        }
        strain
    }

    /// Calls `see` with each quadrature point of a cell and its material response at the free displacements `x`.
    fn for_points(&self, cell: usize, x: &[f64], mut see: impl FnMut(Point<'_>, PlasticResponse)) {
        for k in self.first[cell]..self.first[cell + 1] {
            let value = |component: usize| match self.system.dofs[component] {
                PRESCRIBED => self.supports[component],
                free => x[free],
            };
            let strain = self.strain(cell, self.points.get(k), value);
            see(self.points.get(k), self.law.respond(&strain, &self.states[k]));
        }
    }

    /// The free displacements of a cell: node of the cell, component, number.
    fn free_of(&self, cell: usize) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let dim = self.system.mesh.dim();
        let nodes = self.system.mesh.cell(cell).iter().enumerate();
        nodes
            .flat_map(move |(a, node)| (0..dim).map(move |d| (a, d, self.system.dofs[dim * node + d])))
            .filter(|(_, _, dof)| *dof != PRESCRIBED)
    }
}

impl Semismooth for PlasticBody {
    fn num_vars(&self) -> usize {
        self.load.len()
    }

    fn residual(&self, x: &[f64], out: &mut [f64]) {
        for (out, load) in out.iter_mut().zip(&self.load) {
            *out = -load;
        }
        for cell in 0..self.system.mesh.num_cells() {
            self.for_points(cell, x, |point, answer| {
                for (a, d, row) in self.free_of(cell) {
                    let column = point.column(a, d);
                    let density: f64 = (0..6).map(|s| column[s] * answer.stress[s]).sum();
                    out[row] += point.volume * density;
                }
            });
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        for cell in 0..self.system.mesh.num_cells() {
            self.for_points(cell, x, |point, answer| {
                for (b, e, col) in self.free_of(cell) {
                    let strain = point.column(b, e);
                    let stress = answer
                        .tangent
                        .map(|row| point.volume * (0..6).map(|s| row[s] * strain[s]).sum::<f64>());
                    for (a, d, row) in self.free_of(cell) {
                        let column = point.column(a, d);
                        jac.add(row, col, (0..6).map(|s| column[s] * stress[s]).sum());
                    }
                }
            });
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
}

fn replace(what: &'static str, old: &mut [f64], new: &[f64]) -> Result<(), FemError> {
    check_vector(what, new, old.len())?;
    old.copy_from_slice(new);
    Ok(())
}
