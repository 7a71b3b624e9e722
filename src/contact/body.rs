use std::sync::Arc;

use super::displacements::floating_piece;
use super::zero_energy::{free_motion, largest, random_start};
use super::{ContactError, check_multipliers};
use crate::InputError;
use crate::clock::Until;
use crate::input::{check_length, check_vector};
use crate::interface::{LoadPath, Operator};
use crate::linear::{Cholesky, Condensation, LinearError, LinearSolver};
use crate::sparse::{Matrix, NodalMatrix, check_nodes, pieces};

/// Number of dense matrices of the size of C that a search for a solution allocates: Jacobians with the indices of their entries, and
/// factors. Measured on hexahedra: a twelfth more than this estimate with 110 contact nodes, less with 240 and 504.
const JACOBIANS: u64 = 6;

/// A discrete elastic body with contact nodes, without a law of friction: A u = f(α) − Bνᵀ λν − Σ Btᵀ λt, u_ν = Bν u ≤ gap.
///
/// One tangential trace in the plane, two in space; n displacements u, p contact nodes, forces λ in the units of f. Matrices for instance
/// from [`fem`](crate::fem).
///
/// ```
/// use semismooth::contact::{ContactBody, CondensedContact, Frictionless, LoadPath};
/// use semismooth::sparse::Matrix;
/// // A spring of stiffness 2 with one node in the plane, 0.1 above the ground, pressed by α: it touches from α = 0.2 on.
/// let a = Matrix::from_rows(&[[2.0, 0.0], [0.0, 2.0]])?;
/// let (normal, tangential) = (Matrix::from_rows(&[[1.0, 0.0]])?, Matrix::from_rows(&[[0.0, 1.0]])?);
/// let load = LoadPath::affine(vec![0.0, 0.0], vec![1.0, 0.0]);
/// let body = ContactBody::new(a, normal, vec![tangential], load)?.with_gap(vec![0.1])?;
/// let problem = CondensedContact::new(body, Frictionless::plane())?;
/// assert_eq!(problem.solve(0.1, None)?[0], 0.0);
/// assert!((problem.solve(1.0, None)?[0] - 0.8).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ContactBody {
    /// A, B = (Bν; Bt₁; Bt₂) and the load.
    pub(super) operator: Arc<Operator>,
    pub(super) gap: Vec<f64>,
    /// Positions of the nodes, where known.
    pub(super) nodes: Option<Arc<Nodes>>,
    /// That of the body itself, where `operator` is that of the body on [anchors](Self::anchored).
    pub(super) floating: Option<Arc<Operator>>,
}

/// Positions of nodes, and the node and component of each displacement.
#[derive(Debug)]
pub(super) struct Nodes {
    pub(super) points: Vec<[f64; 3]>,
    pub(super) displacements: Vec<[usize; 2]>,
}

impl ContactBody {
    /// A body with its normal trace, one or two tangential traces (p × n each), and a load; gap 0.
    ///
    /// A row of zeros in a tangential trace means that this component is held, as on a plane of symmetry: there is no slip along it, and
    /// the multiplier is 0 (on a plane of symmetry it is; at a support, its force is part of the reaction). Friction along the other
    /// tangent, if any, obeys the law as if the first one were absent. What is found then are solutions with that symmetry.
    ///
    /// # Errors
    /// Empty problems, wrong shapes, entries that are not finite; multipliers that do no work in any displacement
    /// ([`ContactError::InvisibleMultiplier`]).
    pub fn new(
        a: Matrix,
        normal: Matrix,
        tangential: Vec<Matrix>,
        load: LoadPath,
    ) -> Result<Self, ContactError> {
        if tangential.is_empty() || tangential.len() > 2 {
            return Err(ContactError::Tangents {
                law: 1,
                body: tangential.len(),
            });
        }
        let mut traces = vec![normal];
        traces.extend(tangential);
        check_matrices(&a, &traces.iter().collect::<Vec<_>>())?;
        check_visible(&traces[0])?;
        let (n, p) = (a.nrows(), traces[0].nrows());
        let mut entries = Vec::new();
        for (block, trace) in traces.iter().enumerate() {
            entries.extend(trace.triplets().map(|(i, j, v)| (block * p + i, j, v)));
        }
        let stacked = Matrix::from_triplets(p * traces.len(), n, &entries)?;
        let mut body = Self {
            operator: Arc::new(Operator::new(a, &stacked, load)?),
            gap: vec![0.0; p],
            nodes: None,
            floating: None,
        };
        body.hold();
        Ok(body)
    }

    /// Gives each held tangent a spring of its own, of the stiffness of a contact node. Its force λt and its displacement −λt/k are in
    /// opposite directions, and friction acts along the slip or prevents it: both vanish in every solution of every law, which is then
    /// determined, as it would not be with v_t = 0 alone.
    fn hold(&mut self) {
        let b_t = &self.operator.b_t;
        let empty: Vec<bool> = (0..b_t.ncols()).map(|k| is_zero_column(b_t, k)).collect();
        if !empty.contains(&true) {
            return;
        }
        let spring = 1.0 / self.node_stiffness();
        let of = |held: &bool| if *held { spring } else { 0.0 };
        Arc::make_mut(&mut self.operator).yielding = empty.iter().map(of).collect();
    }

    /// Sets springs between the contact nodes and what they touch, in series with the law, by their compliances (length per force, ≥ 0, 0 is
    /// rigid), one a node: normal compliance, u_ν − gap = c_ν λν in contact, and elastic slip, u_t = c_t λt + what slips (c_t along both
    /// tangents in space). Penetrations and slips of [solutions](super::ContactSolution) are those of the law, without the springs; their
    /// energy is part of what is stored. Held tangents stay held.
    ///
    /// ```
    /// use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
    /// use semismooth::sparse::Matrix;
    /// // A node of stiffness 2, pressed by 3 onto a layer of stiffness 4: it sinks in by 3 / (2 + 4).
    /// let traces = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]));
    /// let [normal, tangential] = traces;
    /// let load = LoadPath::constant(vec![3.0, 0.0]);
    /// let a = Matrix::from_rows(&[[2.0, 0.0], [0.0, 2.0]])?;
    /// let body = ContactBody::new(a, normal?, vec![tangential?], load)?.with_compliance(&[0.25], &[0.0])?;
    /// let problem = CondensedContact::new(body, PlanarCoulomb::new(FrictionCoefficient::constant(0.3)?))?;
    /// let x = problem.solve(0.0, None)?;
    /// assert!((x[0] - 2.0).abs() < 1e-12 && (problem.displacements(&x)?[0] - 0.5).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Wrong lengths, values that are negative or not finite.
    pub fn with_compliance(mut self, normal: &[f64], tangential: &[f64]) -> Result<Self, ContactError> {
        self = self.released();
        let p = self.num_contacts();
        for (what, list) in [
            ("the normal compliance", normal),
            ("the tangential compliance", tangential),
        ] {
            check_vector(what, list, p)?;
            if let Some(node) = list.iter().position(|c| *c < 0.0) {
                return Err(ContactError::Invalid {
                    what: format!("{what} of node {node} is {}; it must not be negative", list[node]),
                });
            }
        }
        let mut springs = normal.to_vec();
        (0..self.num_tangents()).for_each(|_| springs.extend_from_slice(tangential));
        for (k, spring) in springs.iter_mut().enumerate() {
            if is_zero_column(&self.operator.b_t, k) {
                *spring = self.operator.yielding.get(k).copied().unwrap_or(0.0);
            }
        }
        Arc::make_mut(&mut self.operator).yielding = springs;
        Ok(self)
    }

    /// Number of contact nodes with a tangent that is held; see [`new`](Self::new).
    #[must_use]
    pub fn num_held(&self) -> usize {
        let p = self.num_contacts();
        let held =
            |i: &usize| (1..=self.num_tangents()).any(|d| is_zero_column(&self.operator.b_t, d * p + i));
        (0..p).filter(held).count()
    }

    /// Sets the positions of the nodes, and the node and component (from 0) of each displacement, for error messages that name positions
    /// and rigid motions. Nothing else depends on it.
    ///
    /// # Errors
    /// Another number of displacements; nodes or components that do not exist, are named twice, or have no displacement; positions that are
    /// not finite.
    pub fn with_nodes(
        mut self,
        points: Vec<[f64; 3]>,
        displacements: &[[usize; 2]],
    ) -> Result<Self, ContactError> {
        let n = self.num_displacements();
        check_length("the list of nodes of displacements", displacements.len(), n)?;
        check_nodes(&points, displacements, 1 + self.num_tangents())?;
        let displacements = displacements.to_vec();
        self.nodes = Some(Arc::new(Nodes {
            points,
            displacements,
        }));
        Ok(self)
    }

    /// Sets the initial gap of each contact node: u_ν ≤ gap.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_gap(mut self, gap: Vec<f64>) -> Result<Self, ContactError> {
        check_vector("the gap", &gap, self.num_contacts())?;
        self = self.released();
        Arc::make_mut(&mut self.operator).set_sizes(&gap);
        self.gap = gap;
        Ok(self)
    }

    /// Replaces the load.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_load(mut self, load: LoadPath) -> Result<Self, ContactError> {
        self = self.released();
        let mut operator = self.operator.with_load(load)?;
        operator.set_sizes(&self.gap);
        self.operator = Arc::new(operator);
        Ok(self)
    }

    /// The load.
    #[must_use]
    pub fn load(&self) -> &LoadPath {
        &self.operator.load
    }

    /// The forces f(α) on the displacements, those that stem from supports included.
    #[must_use]
    pub fn load_at(&self, alpha: f64) -> Vec<f64> {
        self.operator.load_at(&[alpha])
    }

    /// The displacements of the supports at α, as numbered in the [load cases](super::LoadCase::of_supports); empty where no case
    /// has any.
    #[must_use]
    pub fn support_displacements(&self, alpha: f64) -> Vec<f64> {
        self.operator
            .load
            .support_state(&[alpha])
            .displacements()
            .to_vec()
    }

    /// Number n of displacements.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.operator.num_displacements()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.gap.len()
    }

    /// 1 in the plane, 2 in space.
    #[must_use]
    pub fn num_tangents(&self) -> usize {
        (self.operator.num_traces() - self.anchors().len()) / self.num_contacts() - 1
    }

    /// The initial gaps.
    #[must_use]
    pub fn gap(&self) -> &[f64] {
        &self.gap
    }

    /// The stiffness matrix A.
    #[must_use]
    pub fn stiffness(&self) -> &Matrix {
        &self.floating.as_ref().unwrap_or(&self.operator).a
    }

    /// Bytes that the [condensed form](super::CondensedContact) takes in addition to the body, by an estimate made before they are
    /// allocated: the [factorisation](crate::linear::Condensation::memory) with C, and the Jacobians of the search for a solution.
    ///
    /// # Errors
    /// None in practice; shapes are checked again.
    pub fn condensed_memory(&self) -> Result<u64, ContactError> {
        let operator = &self.operator;
        let made = Condensation::memory(&operator.a, &operator.b_t.transpose())?;
        let q = operator.num_traces() as u64;
        Ok(made.saturating_add(8u64.saturating_mul(JACOBIANS).saturating_mul(q).saturating_mul(q)))
    }

    /// Why the stiffness matrix is not positive definite, if the reason is a zero-energy motion or a single connected part of the body.
    pub(super) fn refused(&self) -> ContactError {
        self.indefinite_piece()
            .unwrap_or(LinearError::NotPositiveDefinite.into())
    }

    fn indefinite_piece(&self) -> Option<ContactError> {
        let a = self.stiffness();
        let nodal = self.nodes.as_deref().and_then(|nodes| {
            let dim = 1 + self.num_tangents();
            NodalMatrix::new(a, nodes.points.clone(), &nodes.displacements, dim).ok()
        });
        if let Some(found) = nodal.and_then(|a| floating_piece(&a, &[], &[])) {
            return Some(found);
        }
        let piece = pieces(a.nrows(), |connect| {
            for (i, j, _) in a.triplets().filter(|t| t.2 != 0.0) {
                connect(&mut [i, j].into_iter());
            }
        });
        let count = piece.iter().max().map_or(0, |m| m + 1);
        let mut entries = vec![Vec::new(); count];
        let (mut size, mut place) = (vec![0; count], vec![0; piece.len()]);
        for (k, &own) in piece.iter().enumerate() {
            place[k] = size[own];
            size[own] += 1;
        }
        for (i, j, v) in a.triplets() {
            if piece[i] == piece[j] {
                entries[piece[i]].push((place[i], place[j], v));
            }
        }
        let definite = |a: &Matrix| {
            let mut cholesky = Cholesky::new();
            cholesky.analyze(a.pattern().as_ref()).is_ok()
                && cholesky.factor_by_pivots(a.as_ref(), Until::default()).is_ok()
        };
        let matrix = |own: usize| Matrix::from_triplets(size[own], size[own], &entries[own]).ok();
        let (own, a) = (0..count)
            .filter_map(|own| Some((own, matrix(own)?)))
            .find(|(_, a)| count == 1 || !definite(a))?;
        let mut members = (0..piece.len()).filter(|k| piece[*k] == own);
        let modes = match free_motion(&a, random_start(a.nrows())) {
            Some(z) => format!(
                "a motion in which displacement {} moves most",
                members.clone().nth(largest(&z))?
            ),
            None if count == 1 => return None,
            None => String::new(),
        };
        Some(ContactError::Unsupported {
            displacement: members.next()?,
            at: None,
            modes,
        })
    }

    /// The same body under another load; typical sizes are not recomputed.
    pub(super) fn under(&self, load: LoadPath) -> Result<Self, ContactError> {
        Ok(Self {
            operator: Arc::new(self.operator.with_load(load)?),
            ..self.clone()
        })
    }

    /// Mean stiffness b A bᵀ / (b bᵀ)² of single contact nodes, over the rows b of the traces; 1 where that is not positive.
    pub(super) fn node_stiffness(&self) -> f64 {
        let (a, b_t) = (&self.operator.a, &self.operator.b_t);
        let mut mean = 0.0;
        let mut b = vec![0.0; a.nrows()];
        let moving = || (0..b_t.ncols()).filter(|i| !is_zero_column(b_t, *i));
        let count = moving().count() as f64;
        for i in moving() {
            for_column(b_t, i, |j, v| b[j] = v);
            // Only the columns of A that the row touches.
            let (mut square, mut energy) = (0.0, 0.0);
            for_column(b_t, i, |j, v| {
                square += v * v;
                for_column(a, j, |k, a| energy += b[k] * a * v);
            });
            for_column(b_t, i, |j, _| b[j] = 0.0);
            mean += energy / (square * square) / count;
        }
        if mean > 0.0 && mean.is_finite() { mean } else { 1.0 }
    }
}

fn for_column(matrix: &Matrix, j: usize, mut f: impl FnMut(usize, f64)) {
    let p = matrix.pattern();
    for k in p.col_ptr()[j]..p.col_ptr()[j + 1] {
        f(p.row_idx()[k], matrix.values()[k]);
    }
}

fn is_zero_column(matrix: &Matrix, j: usize) -> bool {
    let mut zero = true;
    for_column(matrix, j, |_, v| zero &= v == 0.0);
    zero
}

/// Number of products in the sparse Gram matrix of the normal trace, 24 bytes each, beyond which displacements shared by many nodes are
/// left out.
const MAX_PRODUCTS: f64 = (1 << 25) as f64;
/// The number of nodes that may share a displacement in that case.
const MAX_SHARED: usize = 64;

/// Condition (1) for the normal trace: the rank is computed only where a factorisation of the sparse Gram matrix fails.
fn check_visible(trace: &Matrix) -> Result<(), ContactError> {
    let transpose = trace.transpose();
    let (pattern, values) = (transpose.pattern(), transpose.values());
    let p = trace.nrows();
    let columns = trace.pattern().col_ptr();
    // Rows that are independent in some of the columns are independent: a column that many of them share would fill the matrix.
    let counts = || columns.windows(2).map(|w| w[1] - w[0]);
    let products = counts().map(|c| c as f64 * c as f64).sum::<f64>();
    let most = if products > MAX_PRODUCTS {
        MAX_SHARED
    } else {
        usize::MAX
    };
    let shared = |j: usize| columns[j + 1] - columns[j] > most;
    let mut length = vec![0.0; p];
    for (i, _, v) in trace.triplets().filter(|t| !shared(t.1)) {
        length[i] += v * v;
    }
    if length.iter().all(|l| *l > 0.0) {
        // Rows that share no displacement cannot depend on each other.
        if counts().all(|c| c <= 1) {
            return Ok(());
        }
        let mut gram = Vec::new();
        for i in 0..p {
            for k in pattern.col_ptr()[i]..pattern.col_ptr()[i + 1] {
                let j = pattern.row_idx()[k];
                if shared(j) {
                    continue;
                }
                for e in columns[j]..columns[j + 1] {
                    let other = trace.pattern().row_idx()[e];
                    let product = values[k] * trace.values()[e] / (length[i] * length[other]).sqrt();
                    gram.push((i, other, product));
                }
            }
        }
        let gram = Matrix::from_triplets(p, p, &gram)?;
        let mut cholesky = Cholesky::new();
        cholesky.analyze(gram.pattern().as_ref())?;
        if cholesky.factor(gram.as_ref()).is_ok() {
            return Ok(());
        }
    }
    check_multipliers(trace)
}

/// Checks A (n × n) and the traces (p × n; normal, tangential): shapes, and that all entries are finite.
pub(super) fn check_matrices(a: &Matrix, traces: &[&Matrix]) -> Result<(), ContactError> {
    const NAMES: [&str; 3] = [
        "the normal trace",
        "the tangential trace",
        "the second tangential trace",
    ];
    let (n, p) = (a.nrows(), traces.first().map_or(0, |t| t.nrows()));
    for (count, what) in [
        (n, "there are no displacements"),
        (p, "there are no contact nodes"),
    ] {
        if count == 0 {
            return Err(ContactError::Empty { what });
        }
    }
    let traces = NAMES.into_iter().zip(traces).map(|(what, m)| (what, *m, p));
    for (what, matrix, rows) in std::iter::once(("the stiffness matrix A", a, n)).chain(traces) {
        if matrix.nrows() != rows || matrix.ncols() != n {
            return Err(ContactError::Input(InputError::Shape {
                what,
                rows,
                cols: n,
                found_rows: matrix.nrows(),
                found_cols: matrix.ncols(),
            }));
        }
        matrix
            .check_finite()
            .map_err(|source| ContactError::Matrix { what, source })?;
    }
    Ok(())
}
