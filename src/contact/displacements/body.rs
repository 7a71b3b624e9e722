use super::ReducedOptions;
use super::floating::floating_piece;
use crate::InputError;
use crate::contact::{ContactBody, ContactError, LoadPath};
use crate::input::check_vector;
use crate::sparse::{Matrix, NodalBlocks, NodalMatrix, Place, Symmetric};
use crate::tolerances::CHECKED;

/// A large elastic body with contact nodes: the counterpart of [`ContactBody`](crate::contact::ContactBody) for
/// [`ReducedContact`](super::ReducedContact), with its stiffness matrix in nodal blocks.
///
/// The traces must be nodal: those of a contact node are its own displacement along an orthonormal frame ν, t₁[, t₂], as
/// [`ElasticSystem::contact`](crate::fem::ElasticSystem::contact) returns them.
#[derive(Debug, Clone)]
pub struct ReducedBody {
    /// A, with the components of contact nodes along their frames.
    pub(super) stiffness: NodalMatrix,
    /// The node of each contact node, and its frame: rows ν, t₁, t₂.
    pub(super) contacts: Vec<usize>,
    frames: Vec<[[f64; 3]; 3]>,
    /// Directions of the frames that are held, as bits; their components are prescribed.
    held: Vec<u8>,
    pub(super) load: LoadPath,
    pub(super) gap: Vec<f64>,
}

impl ReducedBody {
    /// A body with its normal trace, one tangential trace in the plane or two in space (p × n each), and a load; gap 0. Rows of zeros of
    /// tangential traces belong to components that are prescribed; see [`ContactBody::new`].
    ///
    /// # Errors
    /// Wrong shapes, entries that are not finite, no contact nodes; traces that are not nodal and orthonormal
    /// ([`ContactError::NotNodal`]).
    pub fn new(
        mut stiffness: NodalMatrix,
        normal: &Matrix,
        tangential: &[Matrix],
        mut load: LoadPath,
    ) -> Result<Self, ContactError> {
        let (dim, n, p) = (stiffness.dim(), stiffness.num_unknowns(), normal.nrows());
        if tangential.len() + 1 != dim {
            return Err(ContactError::Tangents {
                law: dim - 1,
                body: tangential.len(),
            });
        }
        if p == 0 {
            return Err(ContactError::Empty {
                what: "there are no contact nodes",
            });
        }
        let mut frames = vec![[[0.0; 3]; 3]; p];
        let mut contacts = vec![usize::MAX; p];
        for (d, trace) in std::iter::once(normal).chain(tangential).enumerate() {
            check_shape(trace, d, p, n)?;
            for (i, k, v) in trace.triplets().filter(|t| t.2 != 0.0) {
                let place = stiffness.places()[k] as usize;
                if contacts[i] != usize::MAX && contacts[i] != place / dim {
                    return Err(ContactError::NotNodal {
                        node: i,
                        what: "the displacements of several nodes",
                    });
                }
                contacts[i] = place / dim;
                frames[i][d][place % dim] += v;
            }
        }
        let mut prescribed = vec![true; dim * stiffness.num_nodes()];
        for place in stiffness.places() {
            prescribed[*place as usize] = false;
        }
        let complete =
            |(&node, frame): (&usize, &mut _)| complete(dim, frame, |k| prescribed[dim * node + k]);
        let held: Vec<u8> = contacts
            .iter()
            .zip(&mut frames)
            .map(|c| if *c.0 == usize::MAX { 0 } else { complete(c) })
            .collect();
        let mut taken = vec![false; stiffness.num_nodes()];
        for (i, (node, frame)) in contacts.iter().zip(&frames).enumerate() {
            if !is_orthonormal(frame, dim) {
                return Err(ContactError::NotNodal {
                    node: i,
                    what: "vectors that are not orthonormal, or of which components are prescribed",
                });
            }
            if std::mem::replace(&mut taken[*node], true) {
                return Err(ContactError::NotNodal {
                    node: i,
                    what: "the displacements of another contact node",
                });
            }
        }
        load.check(n)?;
        let finite = match &stiffness.blocks {
            NodalBlocks::Plane(a) => a.check_finite(),
            NodalBlocks::Space(a) => a.check_finite(),
        };
        if let Err(InputError::Entry { row, col, value }) = finite {
            let unknown = |k: usize| stiffness.places().iter().position(|p| *p as usize == k);
            let (row, col) = (unknown(row).unwrap_or(row), unknown(col).unwrap_or(col));
            return Err(ContactError::Matrix {
                what: "the stiffness matrix A",
                source: InputError::Entry { row, col, value },
            });
        }
        match &mut stiffness.blocks {
            NodalBlocks::Plane(a) => turn(a, &contacts, &frames),
            NodalBlocks::Space(a) => turn(a, &contacts, &frames),
        }
        Ok(Self {
            stiffness,
            contacts,
            frames,
            held,
            load,
            gap: vec![0.0; p],
        })
    }

    /// Sets the initial gap of each contact node: u_ν ≤ gap.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_gap(mut self, gap: Vec<f64>) -> Result<Self, ContactError> {
        check_vector("the gap", &gap, self.num_contacts())?;
        self.gap = gap;
        Ok(self)
    }

    /// Number n of displacements.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.stiffness.num_unknowns()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.contacts.len()
    }

    /// 2 or 3.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.stiffness.dim()
    }

    /// The load.
    #[must_use]
    pub fn load(&self) -> &LoadPath {
        &self.load
    }

    /// Displacements of the supports at α, in the order of the first load case that has supports; empty where none has.
    #[must_use]
    pub fn support_displacements(&self, alpha: f64) -> Vec<f64> {
        self.load.support_state(&[alpha]).displacements().to_vec()
    }

    /// The initial gaps.
    #[must_use]
    pub fn gap(&self) -> &[f64] {
        &self.gap
    }

    /// Components of all nodes.
    pub(super) fn len(&self) -> usize {
        self.dim() * self.stiffness.num_nodes()
    }

    /// The components of nodes that are prescribed, as bits.
    pub(super) fn fixed(&self) -> Vec<u8> {
        let dim = self.dim();
        let mut fixed = vec![(1u8 << dim) - 1; self.stiffness.num_nodes()];
        for place in self.stiffness.places() {
            fixed[*place as usize / dim] &= !(1 << (*place as usize % dim));
        }
        for (node, held) in self.contacts.iter().zip(&self.held) {
            fixed[*node] = *held;
        }
        fixed
    }

    /// Mean stiffness of single contact nodes, over all directions.
    pub(super) fn node_stiffness(&self) -> f64 {
        let diagonal = |node: usize, d: usize| match &self.stiffness.blocks {
            NodalBlocks::Plane(a) => a.diagonal(node)[d][d],
            NodalBlocks::Space(a) => a.diagonal(node)[d][d],
        };
        let all = self
            .contacts
            .iter()
            .flat_map(|&c| (0..self.dim()).map(move |d| (c, d)));
        let sum: f64 = all.map(|(c, d)| diagonal(c, d)).sum();
        let mean = sum / (self.dim() * self.num_contacts()) as f64;
        if mean > 0.0 && mean.is_finite() { mean } else { 1.0 }
    }

    /// From free displacements (or forces) to all components, those of contact nodes along their frames.
    pub(super) fn turned(&self, free: &[f64]) -> Vec<f64> {
        let dim = self.dim();
        let mut all = vec![0.0; self.len()];
        for (place, v) in self.stiffness.places().iter().zip(free) {
            all[*place as usize] = *v;
        }
        for (node, frame) in self.contacts.iter().zip(&self.frames) {
            let own = &mut all[dim * node..dim * (node + 1)];
            let old: [f64; 3] = std::array::from_fn(|d| own.get(d).copied().unwrap_or(0.0));
            for (v, row) in own.iter_mut().zip(frame) {
                *v = (0..dim).map(|d| row[d] * old[d]).sum();
            }
        }
        all
    }

    /// The inverse of the above.
    pub(super) fn free(&self, all: &[f64]) -> Vec<f64> {
        let dim = self.dim();
        let mut turned = all.to_vec();
        for (node, frame) in self.contacts.iter().zip(&self.frames) {
            let own = &mut turned[dim * node..dim * (node + 1)];
            let old: [f64; 3] = std::array::from_fn(|d| own.get(d).copied().unwrap_or(0.0));
            for (d, v) in own.iter_mut().enumerate() {
                *v = (0..dim).map(|k| frame[k][d] * old[k]).sum();
            }
        }
        let places = self.stiffness.places().iter();
        places.map(|p| turned[*p as usize]).collect()
    }

    /// Rigid motions of the whole body at its nodes, by component; `which` numbers them as [`Place::motions`] does.
    pub(super) fn rigid_modes<const F: usize, const K: usize>(
        &self,
        which: [usize; K],
    ) -> Vec<[[f64; K]; F]> {
        let points = self.stiffness.points();
        let places = Place::of(points, &vec![0; points.len()]);
        let place = places.first().copied().unwrap_or_default();
        let at = |p: &[f64; 3]| {
            let motions = place.motions(*p);
            std::array::from_fn(|d| which.map(|k| motions[k][d]))
        };
        let mut modes: Vec<[[f64; K]; F]> = points.iter().map(at).collect();
        for (node, frame) in self.contacts.iter().zip(&self.frames) {
            let old = modes[*node];
            for (row, direction) in modes[*node].iter_mut().zip(frame) {
                *row = std::array::from_fn(|k| (0..F).map(|d| direction[d] * old[d][k]).sum());
            }
        }
        modes
    }

    /// The first piece of the body with zero-energy rigid motions.
    pub(super) fn floating_piece(&self) -> Option<ContactError> {
        floating_piece(&self.stiffness, &self.contacts, &self.frames)
    }

    /// Upper estimate of the bytes that multigrid and GMRES take in addition to the body, made before they are allocated; checked on
    /// hexahedra and tetrahedra.
    #[must_use]
    pub fn memory(&self, options: &ReducedOptions) -> u64 {
        let (len, dim) = (self.len() as u64, self.dim() as u64);
        let matrix = self.stiffness.num_blocks() as u64 * (8 * dim * dim + 4);
        let vectors = 8 * len * (options.directions as u64).saturating_mul(2).saturating_add(24);
        matrix.saturating_add(vectors)
    }

    /// Bytes that [`to_contact_body`](Self::to_contact_body) takes.
    pub(super) fn memory_by_columns(&self) -> u64 {
        let dim = self.dim() as u64;
        // Entries of both triangles with their row indices, and the copy of the blocks from which they are read.
        self.stiffness.num_blocks() as u64 * (40 * dim * dim + 12)
    }

    /// The same body as a [`ContactBody`](crate::contact::ContactBody), which is factored as a whole.
    ///
    /// # Errors
    /// As [`ContactBody::new`].
    pub fn to_contact_body(&self) -> Result<ContactBody, ContactError> {
        let (dim, n, p) = (self.dim(), self.num_displacements(), self.num_contacts());
        let mut original = self.stiffness.clone();
        let back: Vec<_> = self.frames.iter().map(transposed).collect();
        match &mut original.blocks {
            NodalBlocks::Plane(a) => turn(a, &self.contacts, &back),
            NodalBlocks::Space(a) => turn(a, &self.contacts, &back),
        }
        let mut unknown = vec![usize::MAX; self.len()];
        for (k, place) in self.stiffness.places().iter().enumerate() {
            unknown[*place as usize] = k;
        }
        let trace = |d: usize| {
            let mut entries = Vec::new();
            for (i, (node, frame)) in self.contacts.iter().zip(&self.frames).enumerate() {
                let moves = |k: &usize| frame[d][*k] != 0.0 && unknown[dim * node + k] != usize::MAX;
                for k in (0..dim).filter(moves) {
                    entries.push((i, unknown[dim * node + k], frame[d][k]));
                }
            }
            Matrix::from_triplets(p, n, &entries)
        };
        let tangential = (1..dim).map(trace).collect::<Result<_, _>>()?;
        ContactBody::new(original.to_matrix()?, trace(0)?, tangential, self.load.clone())?
            .with_gap(self.gap.clone())?
            .with_nodes(self.stiffness.points().to_vec(), &self.stiffness.unknowns())
    }
}

/// The shape and the entries of a trace: normal, tangential, second tangential.
fn check_shape(trace: &Matrix, which: usize, rows: usize, cols: usize) -> Result<(), ContactError> {
    const NAMES: [&str; 3] = [
        "the normal trace",
        "the tangential trace",
        "the second tangential trace",
    ];
    let what = NAMES[which.min(2)];
    if trace.nrows() != rows || trace.ncols() != cols {
        return Err(ContactError::Input(InputError::Shape {
            what,
            rows,
            cols,
            found_rows: trace.nrows(),
            found_cols: trace.ncols(),
        }));
    }
    trace
        .check_finite()
        .map_err(|source| ContactError::Matrix { what, source })
}

fn transposed(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

fn is_orthonormal(frame: &[[f64; 3]; 3], dim: usize) -> bool {
    (0..dim * dim).all(|e| {
        let (i, j) = (e / dim, e % dim);
        let product: f64 = (0..dim).map(|d| frame[i][d] * frame[j][d]).sum();
        (product - f64::from(u8::from(i == j))).abs() <= CHECKED
    })
}

/// Completes a frame whose tangents of zeros are held: by directions along which only prescribed components move. Returns these as
/// bits. Frames that cannot be completed so are left as they are.
fn complete(dim: usize, frame: &mut [[f64; 3]; 3], prescribed: impl Fn(usize) -> bool) -> u8 {
    let empty = |row: &[f64; 3]| row.iter().all(|v| *v == 0.0);
    let mut held = 0;
    for d in (1..dim).filter(|&d| empty(&frame[d])).collect::<Vec<_>>() {
        let mut row = [0.0; 3];
        // The first prescribed component orthogonal to the other directions.
        let Some(k) = (0..dim).find(|&k| prescribed(k) && frame.iter().all(|f| f[k].abs() <= CHECKED)) else {
            continue;
        };
        row[k] = 1.0;
        frame[d] = row;
        held |= 1 << d;
    }
    held
}

/// A ← Q A Qᵀ with Q the frames at the given nodes.
fn turn<const B: usize>(a: &mut Symmetric<B>, nodes: &[usize], frames: &[[[f64; 3]; 3]]) {
    for (&node, frame) in nodes.iter().zip(frames) {
        let places: Vec<_> = a.places(node).collect();
        for (other, k) in places {
            let block = &mut a.values_mut()[k];
            let old = *block;
            if other <= node {
                *block = std::array::from_fn(|r| {
                    std::array::from_fn(|c| (0..B).map(|d| frame[r][d] * old[d][c]).sum())
                });
            }
            let old = *block;
            if other >= node {
                *block = std::array::from_fn(|r| {
                    std::array::from_fn(|c| (0..B).map(|d| old[r][d] * frame[c][d]).sum())
                });
            }
        }
    }
}
