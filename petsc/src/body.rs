use std::collections::HashMap;
use std::error::Error as StdError;

use semismooth::InputError;
use semismooth::contact::{ContactError, ReducedOptions};
use semismooth::fem::{ContactRows, ElasticSystem};
use thiserror::Error;

use crate::Part;
use crate::ffi::Int;
use crate::handles::Matrix;
use crate::stiffness::Stiffness;
use crate::world::{Error, World};

type Frame = [[f64; 3]; 3];
/// Memory of Newton's method, of products and of the levels of multigrid, in vectors of displacements.
const OTHER_VECTORS: u64 = 20;

pub(crate) type Boxed = Box<dyn StdError + Send + Sync>;

/// Errors of a [`DistributedBody`].
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BodyError {
    /// A system that was not discretised on the mesh of the part.
    #[error("the system has {found} nodes, the part {expected}: discretise on the mesh of the part")]
    OtherMesh {
        /// Nodes of the part.
        expected: usize,
        /// Nodes of the system.
        found: usize,
    },
    /// Contact rows that couple a node with others, as those between two bodies do.
    #[error(
        "contact rows couple several nodes, as between two bodies; distributed bodies need a rigid foundation and nodal multipliers: \
         use semismooth::contact::ReducedContact on one process"
    )]
    Coupled,
    /// No process has contact nodes.
    #[error("there are no contact nodes")]
    NoContact,
    /// The supports do not exclude all rigid motions.
    #[error("the supports leave rigid motions of the body free")]
    Floating,
    /// More unknowns than `PetscInt` can count.
    #[error("{unknowns} unknowns are more than this PETSc can number: it needs 64-bit indices")]
    TooLarge {
        /// Number of unknowns.
        unknowns: usize,
    },
    /// An inaccurate Schur complement: S times the displacements under contact forces does not reproduce these.
    #[error("the Schur complement from MUMPS gives forces back with an error of {error}")]
    Schur {
        /// Largest error, relative to the largest force.
        error: f64,
    },
    /// The mean stiffness of the contact nodes is not positive.
    #[error("the stiffness of the contact nodes is not positive: {mean} in the mean")]
    NotPositive {
        /// Mean diagonal entry.
        mean: f64,
    },
}

/// An elastic body with contact nodes, distributed over all processes; the counterpart of a
/// [`ReducedBody`](semismooth::contact::ReducedBody) on one process.
///
/// Each process has the rows of the stiffness matrix of the nodes that it owns, in PETSc's format `aij`, and the rigid motions at them.
/// Contact nodes are numbered process by process; [`contacts`](Self::contacts) lists those of this process.
#[derive(Debug)]
pub struct DistributedBody<'w> {
    pub(crate) world: &'w World,
    pub(crate) dim: usize,
    /// Number of the first node with equations of this process.
    pub(crate) first: usize,
    /// Components of the nodes with equations of this process.
    pub(crate) len: usize,
    pub(crate) stiffness: Stiffness<'w>,
    /// Stored entries of the stiffness matrix on this process.
    entries: u64,
    /// Mean stiffness of single contact nodes, over all directions and processes.
    pub(crate) node_stiffness: f64,
    /// The component along ν of each contact node of this process.
    pub(crate) components: Vec<usize>,
    pub(crate) gap: Vec<f64>,
    pub(crate) first_contact: usize,
    num_contacts: usize,
    num_displacements: usize,
    contacts: Vec<usize>,
    /// Numbers of the nodes with equations in the mesh of this part that other processes own.
    others: Vec<Int>,
    /// First component and frame of each contact node, first those that this process owns.
    frames: Vec<(usize, Frame)>,
    /// Component of each free displacement of the part; components at nodes of other processes follow the own ones.
    places: Vec<u32>,
}

impl<'w> DistributedBody<'w> {
    /// A body from the systems of all parts and their contact nodes.
    ///
    /// # Errors
    /// Systems on meshes other than those of the parts, contact between bodies ([`BodyError::Coupled`]), no contact nodes, supports that leave rigid motions, more unknowns than PETSc can
    /// number.
    pub fn new(
        world: &'w World,
        part: &Part,
        system: &ElasticSystem,
        rows: &ContactRows,
    ) -> Result<Self, Error> {
        let (expected, found) = (part.mesh().num_nodes(), system.mesh().num_nodes());
        world.agree(if expected != found {
            Err(BodyError::OtherMesh { expected, found })
        } else if !rows.is_nodal(system) {
            Err(BodyError::Coupled)
        } else {
            Ok(())
        })?;
        world.agree(Self::build(world, part, system, rows))
    }

    fn build(
        world: &'w World,
        part: &Part,
        system: &ElasticSystem,
        rows: &ContactRows,
    ) -> Result<Self, Boxed> {
        let dim = part.mesh().dim();
        let numbering = Numbering::new(world, part, system, rows)?;
        let nodes = &numbering.nodes;
        let len = dim * nodes.len();
        let mut counted = [0.0; 2];
        let mut contacts = Vec::new();
        let (mut components, mut gap) = (Vec::new(), Vec::new());
        for (node, g) in rows.nodes.iter().zip(&rows.gap) {
            let number = numbering.own(*node);
            let Some(k) = number else { continue };
            contacts.push(*node);
            components.push(dim * k);
            gap.push(*g);
            for dof in (0..dim).filter_map(|d| system.dof(*node, d)) {
                counted[0] += system.stiffness().get(dof, dof);
                counted[1] += 1.0;
            }
        }
        world.add(&mut counted)?;
        let (first_contact, num_contacts) = world.offset(contacts.len())?;
        if num_contacts == 0 {
            return Err(BodyError::NoContact.into());
        }
        let mean = counted[0] / counted[1];
        if mean.is_nan() || mean <= 0.0 || mean.is_infinite() {
            return Err(BodyError::NotPositive { mean }.into());
        }
        let (modes, num_modes) = numbering.rigid_modes(world, part, system)?;
        let own_free = nodes
            .iter()
            .map(|&n| (0..dim).filter(|&d| system.dof(n, d).is_some()).count())
            .sum();
        let (_, num_displacements) = world.offset(own_free)?;
        let Rows {
            mut matrix,
            entries,
            near,
        } = numbering.stiffness(world, part, system, mean)?;
        matrix.set_near_kernel(dim, num_modes, &modes)?;
        drop(modes);
        let stiffness = Stiffness::new(world, matrix, dim * numbering.first, near)?;
        // A dof that is free on this part but prescribed on the owner, whose supports this part does not have, keeps no component.
        let mut places = vec![u32::MAX; system.num_free()];
        for (k, node) in nodes.iter().chain(&numbering.others).enumerate() {
            for d in 0..dim {
                if let Some(dof) = system.dof(*node, d) {
                    places[dof] = (dim * k + d) as u32;
                }
            }
        }
        let all = nodes.iter().chain(&numbering.others).enumerate();
        let frames = all
            .filter_map(|(k, node)| Some((dim * k, *numbering.frames.get(node)?)))
            .collect();
        let others = numbering.others.iter().map(|n| numbering.number[*n]).collect();
        Ok(Self {
            world,
            dim,
            first: numbering.first,
            len,
            stiffness,
            entries,
            node_stiffness: mean,
            components,
            gap,
            first_contact,
            num_contacts,
            num_displacements,
            contacts,
            others,
            frames,
            places,
        })
    }

    /// Number of free displacements in all processes. Not collective, like the other numbers.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.num_displacements
    }

    /// Number of free displacements of the part of this process.
    pub(crate) fn num_free(&self) -> usize {
        self.places.len()
    }

    /// Number of contact nodes in all processes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.num_contacts
    }

    /// The contact nodes of this process, as nodes of the mesh of its part; by x, then y, then z.
    #[must_use]
    pub fn contacts(&self) -> &[usize] {
        &self.contacts
    }

    /// Number of the first contact node of this process among those of all processes: laws number nodes in this way.
    #[must_use]
    pub fn first_contact(&self) -> usize {
        self.first_contact
    }

    /// The dimension, 2 or 3.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Estimate of the bytes that a [`DistributedContact`](crate::DistributedContact) with GMRES and GAMG needs on this process in addition
    /// to the body: multigrid during its setup, more on several processes than on one (measured on one and two), and the vectors of GMRES.
    /// Other solvers, chosen by options of PETSc, are not accounted for. Not collective.
    #[must_use]
    pub fn memory(&self, options: &ReducedOptions) -> u64 {
        let matrix = self
            .entries
            .saturating_mul((size_of::<f64>() + size_of::<Int>()) as u64);
        let hierarchy = if self.world.size() == 1 { 1 } else { 2 };
        let vectors = (options.directions as u64).saturating_add(OTHER_VECTORS);
        let vectors = vectors.saturating_mul((size_of::<f64>() * self.len) as u64);
        matrix.saturating_mul(hierarchy).saturating_add(vectors)
    }

    pub(crate) fn check_length(&self, what: &'static str, v: &[f64]) -> Result<(), ContactError> {
        match v.len() == self.num_free() {
            true => Ok(()),
            false => Err(ContactError::Input(InputError::Length {
                what,
                expected: self.num_free(),
                found: v.len(),
            })),
        }
    }

    /// From free displacements (or forces) of the part to the components of this process, at contact nodes in the local frame.
    pub(crate) fn turned(&self, free: &[f64]) -> Vec<f64> {
        let mut own = vec![0.0; self.len];
        for (place, v) in self.places.iter().zip(free) {
            if let Some(own) = own.get_mut(*place as usize) {
                *own = *v;
            }
        }
        for (at, frame) in self.frames.iter().filter(|f| f.0 < self.len) {
            let own = &mut own[*at..at + self.dim];
            let old = padded(own);
            for (v, row) in own.iter_mut().zip(frame) {
                *v = (0..3).map(|d| row[d] * old[d]).sum();
            }
        }
        own
    }

    /// The inverse of [`turned`](Self::turned); values at nodes of other processes are fetched.
    pub(crate) fn free(&self, own: &[f64]) -> Result<Vec<f64>, Error> {
        let fetched = self.world.fetch(self.dim, own, &self.others);
        let mut all = own.to_vec();
        all.extend(self.world.agree(fetched)?);
        for (at, frame) in &self.frames {
            let own = &mut all[*at..at + self.dim];
            let old = padded(own);
            for (d, v) in own.iter_mut().enumerate() {
                *v = (0..3).map(|k| frame[k][d] * old[k]).sum();
            }
        }
        let at = |p: &u32| all.get(*p as usize).copied().unwrap_or(0.0);
        Ok(self.places.iter().map(at).collect())
    }
}

fn padded(v: &[f64]) -> [f64; 3] {
    std::array::from_fn(|d| v.get(d).copied().unwrap_or(0.0))
}

/// The stiffness matrix, its stored entries on this process, and the rows of this process at contact nodes (`true`) and their neighbours
/// (`false`).
struct Rows<'w> {
    matrix: Matrix<'w>,
    entries: u64,
    near: Vec<(Int, bool)>,
}

/// Nodes with equations: those with a free component, process by process.
struct Numbering {
    dim: usize,
    first: usize,
    /// Nodes of the part's mesh, those of this process and those of others.
    nodes: Vec<usize>,
    others: Vec<usize>,
    /// Number of each node of the mesh, −1 if it has no equations.
    number: Vec<Int>,
    /// ν, t₁, t₂ at contact nodes of this process and of others.
    frames: HashMap<usize, Frame>,
}

impl Numbering {
    fn new(world: &World, part: &Part, system: &ElasticSystem, rows: &ContactRows) -> Result<Self, Boxed> {
        /// Entries per node: its number, whether it has a frame, the frame.
        const WIDTH: usize = 11;
        let dim = part.mesh().dim();
        let is_free = |n: &usize| (0..dim).any(|d| system.dof(*n, d).is_some());
        let nodes: Vec<usize> = part.own().iter().copied().filter(is_free).collect();
        let (first, total) = world.offset(nodes.len())?;
        if Int::try_from(dim * total).is_err() {
            let unknowns = dim * total;
            return Err(BodyError::TooLarge { unknowns }.into());
        }
        let mut told = vec![0.0; WIDTH * part.mesh().num_nodes()];
        told.chunks_exact_mut(WIDTH).for_each(|t| t[0] = -1.0);
        for (k, n) in nodes.iter().enumerate() {
            told[WIDTH * n] = (first + k) as f64;
        }
        for (i, n) in rows.nodes.iter().enumerate() {
            told[WIDTH * n + 1] = 1.0;
            let frame = [rows.normals[i], rows.tangents[i][0], rows.tangents[i][1]];
            told[WIDTH * n + 2..WIDTH * (n + 1)].copy_from_slice(frame.as_flattened());
        }
        let own: Vec<f64> = part
            .own()
            .iter()
            .flat_map(|n| told[WIDTH * n..WIDTH * (n + 1)].iter().copied())
            .collect();
        let strangers: Vec<usize> = part.others().collect();
        let asked: Vec<Int> = strangers.iter().map(|n| part.global()[*n]).collect();
        let fetched = world.fetch(WIDTH, &own, &asked)?;
        for (n, values) in strangers.iter().zip(fetched.chunks_exact(WIDTH)) {
            told[WIDTH * n..WIDTH * (n + 1)].copy_from_slice(values);
        }
        let number: Vec<Int> = told.chunks_exact(WIDTH).map(|t| t[0] as Int).collect();
        let mut frames = HashMap::new();
        for (n, t) in told.chunks_exact(WIDTH).enumerate().filter(|t| t.1[1] > 0.0) {
            frames.insert(
                n,
                std::array::from_fn(|a| std::array::from_fn(|b| t[2 + 3 * a + b])),
            );
        }
        Ok(Self {
            dim,
            first,
            others: strangers.into_iter().filter(|n| number[*n] >= 0).collect(),
            nodes,
            number,
            frames,
        })
    }

    /// Index of a node of the mesh among the nodes with equations of this process.
    fn own(&self, node: usize) -> Option<usize> {
        let k = usize::try_from(self.number[node]).ok()?.checked_sub(self.first)?;
        (k < self.nodes.len()).then_some(k)
    }

    /// m ← Q m, for rows of `width` numbers.
    fn turn_rows(&self, node: usize, m: &mut [f64], width: usize) {
        let Some(frame) = self.frames.get(&node) else {
            return;
        };
        for c in 0..width {
            let old: [f64; 3] = std::array::from_fn(|d| if d < self.dim { m[d * width + c] } else { 0.0 });
            for r in 0..self.dim {
                m[r * width + c] = (0..3).map(|d| frame[r][d] * old[d]).sum();
            }
        }
    }

    /// The rows of the stiffness matrix of this process; rows of prescribed components have only the entry `diagonal`.
    fn stiffness<'w>(
        &self,
        world: &'w World,
        part: &Part,
        system: &ElasticSystem,
        diagonal: f64,
    ) -> Result<Rows<'w>, Boxed> {
        let dim = self.dim;
        let a = system.stiffness();
        let (starts, indices) = (a.pattern().col_ptr(), a.pattern().row_idx());
        let mut node_of = vec![[0u32; 2]; system.num_free()];
        for node in 0..part.mesh().num_nodes() {
            for d in 0..dim {
                if let Some(dof) = system.dof(node, d) {
                    node_of[dof] = [node as u32, d as u32];
                }
            }
        }
        // A is symmetric: its columns are its rows.
        let neighbours = |node: usize, list: &mut Vec<usize>| {
            list.clear();
            for dof in (0..dim).filter_map(|d| system.dof(node, d)) {
                let column = &indices[starts[dof]..starts[dof + 1]];
                list.extend(column.iter().map(|i| node_of[*i][0] as usize));
            }
            list.sort_unstable_by_key(|n| self.number[*n]);
            list.dedup();
        };
        let mut list = Vec::new();
        let (mut own, mut other, mut near) = (Vec::new(), Vec::new(), Vec::new());
        for &node in &self.nodes {
            neighbours(node, &mut list);
            let is_contact = self.frames.contains_key(&node);
            if is_contact || list.iter().any(|n| self.frames.contains_key(n)) {
                let row = dim as Int * self.number[node];
                near.extend((row..row + dim as Int).map(|row| (row, is_contact)));
            }
            let here = list.iter().filter(|n| self.own(**n).is_some()).count();
            own.push(here as Int);
            other.push((list.len() - here) as Int);
        }
        let mut matrix = Matrix::new(world, dim, &own, &other)?;
        let blocks: u64 = own.iter().chain(&other).map(|k| *k as u64).sum();
        let mut slot = vec![0; part.mesh().num_nodes()];
        let (mut cols, mut values, mut block) = (Vec::new(), Vec::new(), vec![0.0; dim * dim]);
        for &node in &self.nodes {
            neighbours(node, &mut list);
            list.iter().enumerate().for_each(|(k, n)| slot[*n] = k);
            cols.clear();
            cols.extend(list.iter().map(|n| self.number[*n]));
            let width = dim * list.len();
            values.clear();
            values.resize(dim * width, 0.0);
            for d in 0..dim {
                let Some(dof) = system.dof(node, d) else {
                    values[d * width + dim * slot[node] + d] = diagonal;
                    continue;
                };
                for k in starts[dof]..starts[dof + 1] {
                    let [n, e] = node_of[indices[k]].map(|v| v as usize);
                    values[d * width + dim * slot[n] + e] = a.values()[k];
                }
            }
            self.turn_rows(node, &mut values, width);
            for (k, n) in list.iter().enumerate().filter(|n| self.frames.contains_key(n.1)) {
                // B ← B Qᵀ, as Bᵀ ← Q Bᵀ.
                for (r, c) in (0..dim * dim).map(|e| (e / dim, e % dim)) {
                    block[c * dim + r] = values[r * width + dim * k + c];
                }
                self.turn_rows(*n, &mut block, dim);
                for (r, c) in (0..dim * dim).map(|e| (e / dim, e % dim)) {
                    values[r * width + dim * k + c] = block[c * dim + r];
                }
            }
            matrix.add_block_row(self.number[node], &cols, &values)?;
        }
        matrix.assemble()?;
        matrix.set_definite()?;
        Ok(Rows {
            matrix,
            entries: blocks * (dim * dim) as u64,
            near,
        })
    }

    /// Rigid motions at the components of this process, one vector after another, and their number; 0 at prescribed components.
    fn rigid_modes(
        &self,
        world: &World,
        part: &Part,
        system: &ElasticSystem,
    ) -> Result<(Vec<f64>, usize), Boxed> {
        let (dim, points) = (self.dim, part.mesh().points());
        let own = || part.own().iter().map(|n| points[*n]);
        let mut centre = [0.0; 4];
        for p in own() {
            (0..3).for_each(|d| centre[d] += p[d]);
            centre[3] += 1.0;
        }
        world.add(&mut centre)?;
        let relative = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| p[d] - centre[d] / centre[3]) };
        let mut size = [own().flat_map(relative).fold(0.0f64, |m, x| m.max(x.abs()))];
        world.largest(&mut size)?;
        let modes = |node: usize| -> Vec<[f64; 3]> {
            let [x, y, z] = relative(points[node]).map(|x| if size[0] > 0.0 { x / size[0] } else { x });
            let translations = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let rotations = [[-y, x, 0.0], [0.0, -z, y], [z, 0.0, -x]];
            match dim {
                2 => vec![translations[0], translations[1], rotations[0]],
                _ => translations.into_iter().chain(rotations).collect(),
            }
        };
        let count = if dim == 2 { 3 } else { 6 };
        // The Gram matrix of the rigid motions at the prescribed components must be definite.
        let mut gram = [0.0; 36];
        for &node in part.own() {
            let m = modes(node);
            for d in (0..dim).filter(|&d| system.dof(node, d).is_none()) {
                for (i, j) in (0..count * count).map(|e| (e / count, e % count)) {
                    gram[count * i + j] += m[i][d] * m[j][d];
                }
            }
        }
        world.add(&mut gram)?;
        if !is_definite(&mut gram, count) {
            return Err(BodyError::Floating.into());
        }
        let local = dim * self.nodes.len();
        let mut vectors = vec![0.0; count * local];
        for (k, &node) in self.nodes.iter().enumerate() {
            let mut own: Vec<f64> = vec![0.0; dim * count];
            for (i, mode) in modes(node).iter().enumerate() {
                for d in (0..dim).filter(|&d| system.dof(node, d).is_some()) {
                    own[d * count + i] = mode[d];
                }
            }
            self.turn_rows(node, &mut own, count);
            for (d, i) in (0..dim * count).map(|e| (e / count, e % count)) {
                vectors[i * local + dim * k + d] = own[d * count + i];
            }
        }
        Ok((vectors, count))
    }
}

/// Whether m is positive definite, by elimination; m is overwritten.
fn is_definite(m: &mut [f64], n: usize) -> bool {
    let scale = (0..n).map(|i| m[n * i + i]).fold(0.0, f64::max);
    for k in 0..n {
        let pivot = m[n * k + k];
        if pivot.is_nan() || pivot <= 1e-12 * scale {
            return false;
        }
        for i in k + 1..n {
            let factor = m[n * i + k] / pivot;
            for j in k..n {
                m[n * i + j] -= factor * m[n * k + j];
            }
        }
    }
    true
}
