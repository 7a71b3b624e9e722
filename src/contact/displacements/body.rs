use super::ReducedOptions;
use super::basis::Basis;
use super::floating::{floating_piece, pieces_of};
use crate::InputError;
use crate::contact::{ContactBody, ContactError, LoadPath};
use crate::input::check_vector;
use crate::sparse::{Matrix, NodalBlocks, NodalMatrix, Place};

/// A large elastic body with contact nodes: the counterpart of [`ContactBody`](crate::contact::ContactBody) for
/// [`ReducedContact`](super::ReducedContact), with its stiffness matrix in nodal blocks.
///
/// Each contact node has traces along an orthonormal frame ν, t₁[, t₂]: its own displacements, as
/// [`ElasticSystem::contact`](crate::fem::ElasticSystem::contact) returns them, or those relative to other nodes, which may belong to
/// several contact nodes, as [`contact_between`](crate::fem::ElasticSystem::contact_between) does for facets of first order.
#[derive(Debug, Clone)]
pub struct ReducedBody {
    /// Tᵀ A T: A with the components of contact nodes along their frames, less those of what they touch.
    pub(super) stiffness: NodalMatrix,
    /// A, where contact nodes are coupled with others.
    uncoupled: Option<Box<NodalMatrix>>,
    pub(super) basis: Basis,
    pub(super) load: LoadPath,
    pub(super) gap: Vec<f64>,
}

impl ReducedBody {
    /// A body with its normal trace, one tangential trace in the plane or two in space (p × n each), and a load; gap 0. Rows of zeros of
    /// tangential traces belong to components that are prescribed; see [`ContactBody::new`].
    ///
    /// # Errors
    /// Wrong shapes, entries that are not finite, no contact nodes; traces that are not orthonormal or in which no node has a share of a
    /// half that no other has ([`ContactError::NotNodal`]).
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
        let traces: Vec<&Matrix> = std::iter::once(normal).chain(tangential).collect();
        for (d, trace) in traces.iter().enumerate() {
            check_shape(trace, d, p, n)?;
        }
        let basis = Basis::new(&stiffness, &traces)?;
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
        let uncoupled = basis.is_coupled().then(|| Box::new(stiffness.clone()));
        basis.transform(&mut stiffness.blocks);
        Ok(Self {
            stiffness,
            uncoupled,
            basis,
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
        self.basis.nodes.len()
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
        for (node, held) in self.basis.nodes.iter().zip(&self.basis.held) {
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
            .basis
            .nodes
            .iter()
            .flat_map(|&c| (0..self.dim()).map(move |d| (c, d)));
        let sum: f64 = all.map(|(c, d)| diagonal(c, d)).sum();
        let mean = sum / (self.dim() * self.num_contacts()) as f64;
        if mean > 0.0 && mean.is_finite() { mean } else { 1.0 }
    }

    /// All components of free displacements, those of contact nodes along their frames, less those of what they touch.
    pub(super) fn turned(&self, free: &[f64]) -> Vec<f64> {
        let mut all = self.spread(free);
        self.basis.local(&mut all);
        all
    }

    /// The inverse of [`turned`](Self::turned).
    pub(super) fn free(&self, all: &[f64]) -> Vec<f64> {
        let mut turned = all.to_vec();
        self.basis.nodal(&mut turned);
        self.gathered(&turned)
    }

    /// Forces on these components from forces on the free displacements.
    pub(super) fn turned_forces(&self, free: &[f64]) -> Vec<f64> {
        let mut all = self.spread(free);
        self.basis.local_forces(&mut all);
        all
    }

    /// The inverse of [`turned_forces`](Self::turned_forces).
    pub(super) fn free_forces(&self, all: &[f64]) -> Vec<f64> {
        let mut turned = all.to_vec();
        self.basis.nodal_forces(&mut turned);
        self.gathered(&turned)
    }

    fn spread(&self, free: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.len()];
        for (place, v) in self.stiffness.places().iter().zip(free) {
            all[*place as usize] = *v;
        }
        all
    }

    fn gathered(&self, all: &[f64]) -> Vec<f64> {
        let places = self.stiffness.places().iter();
        places.map(|p| all[*p as usize]).collect()
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
        for (node, frame) in self.basis.nodes.iter().zip(self.basis.frames()) {
            let old = modes[*node];
            for (row, direction) in modes[*node].iter_mut().zip(frame) {
                *row = std::array::from_fn(|k| (0..F).map(|d| direction[d] * old[d][k]).sum());
            }
        }
        modes
    }

    /// Whether supports hold all parts of the body, as the displacements alone need; the condensed form also has parts that contact holds.
    #[must_use]
    pub fn is_supported(&self) -> bool {
        self.floating_piece().is_none()
    }

    /// Classes of nodes that multigrid gathers apart: where bodies are coupled, the nodes of each and its contact nodes. Rigid motions of
    /// both bodies together leave the variables of contact nodes at rest, those of one body do not.
    pub(super) fn classes(&self) -> Vec<usize> {
        let Some(stiffness) = &self.uncoupled else {
            return Vec::new();
        };
        let mut classes: Vec<usize> = pieces_of(stiffness).iter().map(|piece| 2 * piece).collect();
        self.basis.nodes.iter().for_each(|n| classes[*n] += 1);
        classes
    }

    /// The first piece of the body with zero-energy rigid motions.
    pub(super) fn floating_piece(&self) -> Option<ContactError> {
        match &self.uncoupled {
            Some(stiffness) => floating_piece(stiffness, &[], &[]),
            None => floating_piece(&self.stiffness, &self.basis.nodes, self.basis.frames()),
        }
    }

    /// Upper estimate of the bytes that multigrid and GMRES take in addition to the body, made before they are allocated; checked on
    /// hexahedra and tetrahedra.
    #[must_use]
    pub fn memory(&self, options: &ReducedOptions) -> u64 {
        let (len, dim) = (self.len() as u64, self.dim() as u64);
        let uncoupled = self.uncoupled.as_ref().map_or(0, |a| a.num_blocks());
        let matrix = (self.stiffness.num_blocks() + uncoupled) as u64 * (8 * dim * dim + 4);
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
        let original = match &self.uncoupled {
            Some(stiffness) => stiffness.to_matrix()?,
            None => {
                let mut original = self.stiffness.clone();
                self.basis.transform_back(&mut original.blocks);
                original.to_matrix()?
            }
        };
        let places = self.stiffness.places();
        let trace =
            |d: usize| Matrix::from_triplets(p, n, &self.basis.trace(d, self.stiffness.num_nodes(), places));
        let tangential = (1..dim).map(trace).collect::<Result<_, _>>()?;
        ContactBody::new(original, trace(0)?, tangential, self.load.clone())?
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
