use super::error::check_length;
use super::{ContactError, LoadPath, NodeLaw, check_multipliers};
use crate::interface::typical_sizes;
use crate::linear::{Cholesky, LinearSolver};
use crate::sparse::Matrix;

/// A discrete elastic body with contact nodes, without a law of friction: A u = f(α) − Bνᵀ λν − Σ Btᵀ λt, u_ν = Bν u ≤ gap.
///
/// One tangential trace in the plane, two in space. Matrices as in [`FrictionProblem`](super::FrictionProblem), for instance from
/// [`fem`](crate::fem).
#[derive(Debug, Clone)]
pub struct ContactBody {
    pub(super) a: Matrix,
    /// Bν, Bt₁ and, in space, Bt₂: p × n each.
    pub(super) traces: Vec<Matrix>,
    pub(super) gap: Vec<f64>,
    pub(super) load: LoadPath,
}

impl ContactBody {
    /// Bνᵀ and Btᵀ of a body in the plane.
    pub(super) fn planar_transposes(&self) -> Option<[Matrix; 2]> {
        match self.traces.as_slice() {
            [normal, tangential] => Some([normal.transpose(), tangential.transpose()]),
            _ => None,
        }
    }

    /// A body with its normal trace, one or two tangential traces, and a load; gap 0.
    ///
    /// # Errors
    /// Empty problems, wrong shapes, entries that are not finite; multipliers that no displacement sees
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
        let (n, p) = (a.nrows(), traces[0].nrows());
        load.0.check("the load", n)?;
        check_visible(&traces[0])?;
        Ok(Self {
            a,
            traces,
            gap: vec![0.0; p],
            load,
        })
    }

    /// Sets the initial gap of each contact node: u_ν ≤ gap.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_gap(mut self, gap: Vec<f64>) -> Result<Self, ContactError> {
        check_length("the gap", &gap, self.num_contacts())?;
        self.gap = gap;
        Ok(self)
    }

    /// The load f(α).
    #[must_use]
    pub fn load_at(&self, alpha: f64) -> Vec<f64> {
        let n = self.num_displacements();
        let (mut f, mut rate) = (vec![0.0; n], vec![0.0; n]);
        self.load.0.value(alpha, &mut f, &mut rate);
        f
    }

    /// Typical sizes of u, λ and α.
    pub(super) fn sizes(&self) -> Option<[f64; 3]> {
        let loads = self.load.0.sizes(self.num_displacements());
        typical_sizes(&self.a, &self.traces, loads, &self.gap)
    }

    /// Number n of displacements.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.a.nrows()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.gap.len()
    }

    /// 1 in the plane, 2 in space.
    #[must_use]
    pub fn num_tangents(&self) -> usize {
        self.traces.len() - 1
    }

    /// The stiffness matrix A.
    #[must_use]
    pub fn stiffness(&self) -> &Matrix {
        &self.a
    }

    pub(super) fn check_law<L: NodeLaw>(&self, law: &L) -> Result<(), ContactError> {
        if law.num_tangents() == self.num_tangents() {
            return Ok(());
        }
        Err(ContactError::Tangents {
            law: law.num_tangents(),
            body: self.num_tangents(),
        })
    }
}

/// Products in the sparse Gram matrix of the normal trace, 24 bytes each, beyond which displacements that many nodes share are left
/// out.
const MAX_PRODUCTS: f64 = (1 << 25) as f64;
/// How many nodes may share a displacement then.
const MAX_SHARED: usize = 64;

/// Condition (1) for the normal trace: the rank is told only where a factorisation of the sparse Gram matrix fails.
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
            return Err(ContactError::Shape {
                what,
                rows,
                cols: n,
                found_rows: matrix.nrows(),
                found_cols: matrix.ncols(),
            });
        }
        matrix
            .check_finite()
            .map_err(|source| ContactError::Matrix { what, source })?;
    }
    Ok(())
}
