use std::fmt;
use std::mem::MaybeUninit;

use faer::dyn_stack::{MemStack, StackReq};
use faer::perm::PermRef;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{
    LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu, simplicial,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};

use super::condition::{judge, norm_1_estimate};
use super::memory::{PatternMemory, check_finite, count_rhs};
use super::scaling::{Scaling, scale_columns};
use super::{LinearError, LinearSolver};
use crate::Cause;
use crate::sparse::{MatrixRef, PatternRef};
use crate::tolerances::{CHECKED, ROUNDING, SIX_DIGITS};

/// Right-hand sides solved for at a time, so that scratch is bounded.
pub(super) const BLOCK_RHS: usize = 8;

/// Sparse LU with partial pivoting and a fill-reducing column order.
///
/// The order and all memory are reused as long as the pattern stays. The matrix is first equilibrated by powers of two,
/// S = R A C; [`rcond`](LinearSolver::rcond) is that of S, or where it is below 1e-6 that of the matrix with rows and columns balanced in
/// the geometric mean, if that is larger, and [`LinearError::Singular`] is returned below 1e-14. Every solution is checked by its
/// residual, after one step of refinement where that helps.
///
/// Determinants are known when the factors are sparse enough to be eliminated column by column, and always with
/// [`with_determinants`](Self::with_determinants).
#[derive(Clone, Default)]
pub struct SparseLu {
    pattern: PatternMemory,
    determinants: bool,
    scaling: Scaling,
    /// For condition numbers alone.
    balance: Scaling,
    values: Vec<f64>,
    norm_1: f64,
    norm_max: f64,
    engine: Option<Engine>,
    work: Vec<f64>,
    rcond: Option<f64>,
    /// The entries of the matrix, where its condition number is still to be compared with that of the balanced one; else empty.
    to_balance: Vec<f64>,
}

/// Factors and scratch, apart from the matrix.
#[derive(Clone)]
struct Engine {
    symbolic: SymbolicLu<usize>,
    factors: Factors,
    scratch: Vec<MaybeUninit<u8>>,
}

#[derive(Clone)]
enum Factors {
    /// faer does not give access to the factors of its blocked elimination: no determinant.
    Blocked(NumericLu<usize, f64>),
    Columns(Columns),
}

#[derive(Clone, Default)]
struct Columns {
    lu: simplicial::SimplicialLu<usize, f64>,
    row_perm: Vec<usize>,
    row_perm_inv: Vec<usize>,
    seen: Vec<bool>,
    odd: bool,
}

impl SparseLu {
    /// A solver without a pattern.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A solver whose [`log_det`](LinearSolver::log_det) is always known, at the price of an elimination without blocking: slower
    /// by a factor of about 2 to 5 where fill-in is heavy.
    #[must_use]
    pub fn with_determinants() -> Self {
        Self {
            determinants: true,
            ..Self::default()
        }
    }

    fn attempt(&mut self, values: &[f64], balanced: bool) -> Result<(), LinearError> {
        let Some(engine) = self.engine.as_mut() else {
            return Err(LinearError::NotAnalyzed);
        };
        let n = self.pattern.n();
        let (col_ptr, row_idx) = (self.pattern.col_ptr(), self.pattern.row_idx());
        if n == 0 {
            self.rcond = Some(1.0);
            return Ok(());
        }
        match balanced {
            false => self.scaling.compute(col_ptr, row_idx, values)?,
            true => (self.scaling).balance(col_ptr, row_idx, values),
        }
        let (row, col) = (self.scaling.row(), self.scaling.col());
        let row_sums = &mut self.work[..n];
        row_sums.fill(0.0);
        self.norm_1 = 0.0;
        for j in 0..n {
            let mut sum = 0.0;
            for k in col_ptr[j]..col_ptr[j + 1] {
                let s = values[k] * row[row_idx[k]] * col[j];
                self.values[k] = s;
                row_sums[row_idx[k]] += s.abs();
                sum += s.abs();
            }
            self.norm_1 = self.norm_1.max(sum);
        }
        self.norm_max = norm_max(row_sums);
        let symbolic = SymbolicSparseColMatRef::new_checked(n, n, col_ptr, None, row_idx);
        engine.factor(SparseColMatRef::new(symbolic, &self.values))?;
        let (x, rest) = self.work.split_at_mut(n);
        let solve = |x: &mut [f64], transpose: bool| engine.solve(x, transpose);
        let inverse_norm = norm_1_estimate(solve, x, &mut rest[..n]);
        let rcond = judge(self.norm_1, inverse_norm)?;
        // A small one may be due to units: that of the balanced matrix is computed, too.
        if rcond < SIX_DIGITS && !balanced {
            self.to_balance.extend_from_slice(values);
        }
        self.rcond = Some(rcond);
        Ok(())
    }

    fn solve(&mut self, b: &mut [f64], transpose: bool) -> Result<(), LinearError> {
        let (Some(engine), Some(_)) = (self.engine.as_mut(), self.rcond) else {
            return Err(LinearError::NotFactored);
        };
        let n = self.pattern.n();
        count_rhs(n, b)?;
        check_finite(b, "the right-hand side")?;
        if n == 0 {
            return Ok(());
        }
        let s = MatrixRef {
            pattern: PatternRef {
                nrows: n,
                ncols: n,
                col_ptr: self.pattern.col_ptr(),
                row_idx: self.pattern.row_idx(),
            },
            values: &self.values,
        };
        let (before, after) = match transpose {
            false => (self.scaling.row(), self.scaling.col()),
            true => (self.scaling.col(), self.scaling.row()),
        };
        let norm = match transpose {
            false => self.norm_max,
            true => self.norm_1,
        };
        let (rhs, residual) = self.work.split_at_mut(n * BLOCK_RHS);
        let residual = &mut residual[..n];
        for block in b.chunks_mut(n * BLOCK_RHS) {
            scale_columns(block, before);
            rhs[..block.len()].copy_from_slice(block);
            engine.solve(block, transpose);
            for (x, rhs) in block.chunks_exact_mut(n).zip(rhs.chunks_exact(n)) {
                let mut found = relative_residual(&s, norm, transpose, x, rhs, residual);
                if found > ROUNDING {
                    engine.solve(residual, transpose);
                    x.iter_mut().zip(residual.iter()).for_each(|(x, d)| *x += d);
                    found = relative_residual(&s, norm, transpose, x, rhs, residual);
                }
                if found.is_nan() || found > CHECKED {
                    return Err(LinearError::Inaccurate { residual: found });
                }
            }
            scale_columns(block, after);
        }
        check_finite(b, "").map_err(|_| LinearError::Inaccurate { residual: f64::NAN })
    }
}

/// Writes b - S x (or b - Sᵀ x) into `r`; returns its ∞-norm relative to ‖S‖ ‖x‖ + ‖b‖.
fn relative_residual(
    s: &MatrixRef<'_>,
    norm: f64,
    transpose: bool,
    x: &[f64],
    b: &[f64],
    r: &mut [f64],
) -> f64 {
    r.copy_from_slice(b);
    if transpose {
        s.mul_transpose_add(-1.0, x, r);
    } else {
        s.mul_add(-1.0, x, r);
    }
    let size = norm * norm_max(x) + norm_max(b);
    // 0 / 0 is an exact zero solution.
    if size == 0.0 { 0.0 } else { norm_max(r) / size }
}

/// The ∞-norm; NaN if any entry is.
fn norm_max(x: &[f64]) -> f64 {
    x.iter()
        .fold(0.0, |m: f64, v| if v.abs() <= m { m } else { v.abs() })
}

impl Engine {
    fn new(pattern: &PatternMemory, determinants: bool) -> Result<Self, LinearError> {
        let n = pattern.n();
        let a = SymbolicSparseColMatRef::new_checked(n, n, pattern.col_ptr(), None, pattern.row_idx());
        let symbolic = factorize_symbolic_lu(a, LuSymbolicParams::default()).map_err(give_up)?;
        let blocked = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        let columns = simplicial::factorize_simplicial_numeric_lu_scratch::<usize, f64>(n, n);
        // The analysis does not tell which elimination it chose, but the two need different scratch; if both need the same, elimination by
        // columns is still right.
        let (factors, scratch) = if determinants || blocked == columns {
            let identity: Vec<usize> = (0..n).collect();
            let factors = Columns {
                row_perm: identity.clone(),
                row_perm_inv: identity,
                seen: vec![false; n],
                ..Columns::default()
            };
            let solve = simplicial::solve_in_place_scratch::<usize, f64>(n, BLOCK_RHS, Par::Seq);
            (Factors::Columns(factors), columns.or(solve))
        } else {
            let solve = symbolic.solve_in_place_scratch::<f64>(BLOCK_RHS, Par::Seq);
            let solve_t = symbolic.solve_transpose_in_place_scratch::<f64>(BLOCK_RHS, Par::Seq);
            let request = StackReq::any_of(&[blocked, solve, solve_t]);
            (Factors::Blocked(NumericLu::new()), request)
        };
        Ok(Self {
            symbolic,
            factors,
            scratch: vec![MaybeUninit::uninit(); scratch.unaligned_bytes_required()],
        })
    }

    fn factor(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<(), LinearError> {
        let stack = MemStack::new(&mut self.scratch);
        let result = match &mut self.factors {
            Factors::Blocked(numeric) => self
                .symbolic
                .factorize_numeric_lu(numeric, a, Par::Seq, stack, Default::default())
                .map(|_| ()),
            Factors::Columns(columns) => simplicial::factorize_simplicial_numeric_lu(
                &mut columns.row_perm,
                &mut columns.row_perm_inv,
                &mut columns.lu,
                a,
                self.symbolic.col_perm(),
                stack,
            ),
        };
        match result {
            Ok(()) => {}
            Err(LuError::SymbolicSingular { .. }) => {
                return Err(LinearError::Singular { rcond: 0.0 });
            }
            Err(LuError::Generic(e)) => return Err(give_up(e)),
        }
        if let Factors::Columns(columns) = &mut self.factors {
            let mut odd = is_odd(&columns.row_perm, &mut columns.seen)
                ^ is_odd(self.symbolic.col_perm().arrays().0, &mut columns.seen);
            for pivot in columns.pivots() {
                if pivot == 0.0 || !pivot.is_finite() {
                    return Err(LinearError::Singular { rcond: 0.0 });
                }
                odd ^= pivot < 0.0;
            }
            columns.odd = odd;
        }
        Ok(())
    }

    /// Solves with S for at most `BLOCK_RHS` right-hand sides; the result may be anything if S is singular.
    fn solve(&mut self, b: &mut [f64], transpose: bool) {
        let n = self.symbolic.nrows();
        let k = b.len() / n;
        let rhs = MatMut::from_column_major_slice_mut(b, n, k);
        let stack = MemStack::new(&mut self.scratch);
        let col_perm = self.symbolic.col_perm();
        match &self.factors {
            Factors::Blocked(numeric) => {
                let lu = LuRef::new_unchecked(&self.symbolic, numeric);
                match transpose {
                    false => lu.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack),
                    true => lu.solve_transpose_in_place_with_conj(Conj::No, rhs, Par::Seq, stack),
                }
            }
            Factors::Columns(c) => {
                let row_perm = PermRef::new_checked(&c.row_perm, &c.row_perm_inv, n);
                let run = match transpose {
                    false => simplicial::SimplicialLu::solve_in_place_with_conj,
                    true => simplicial::SimplicialLu::solve_transpose_in_place_with_conj,
                };
                run(&c.lu, row_perm, col_perm, Conj::No, rhs, Par::Seq, stack);
            }
        }
    }
}

impl Columns {
    /// The diagonal of U: the last entry stored in each column.
    fn pivots(&self) -> impl Iterator<Item = f64> + '_ {
        let u = self.lu.u_factor_unsorted();
        (0..u.ncols()).map(move |j| u.val()[u.col_ptr()[j + 1] - 1])
    }
}

/// Parity of a permutation: a cycle of even length is odd.
fn is_odd(perm: &[usize], seen: &mut [bool]) -> bool {
    seen.fill(false);
    let mut odd = false;
    for start in 0..perm.len() {
        let mut i = start;
        let mut length = 0;
        while !seen[i] {
            seen[i] = true;
            i = perm[i];
            length += 1;
        }
        odd ^= length > 0 && length % 2 == 0;
    }
    odd
}

pub(super) fn give_up(e: faer::sparse::FaerError) -> LinearError {
    LinearError::External {
        source: Cause::new(e),
    }
}

impl LinearSolver for SparseLu {
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
        if !self.pattern.learn(pattern)? {
            return Ok(());
        }
        self.rcond = None;
        self.to_balance = Vec::new();
        self.engine = None;
        let n = pattern.ncols;
        self.scaling.resize(n);
        self.balance.resize(n);
        self.values.clear();
        self.values.resize(pattern.nnz(), 0.0);
        self.work.resize(n * (BLOCK_RHS + 1), 0.0);
        match Engine::new(&self.pattern, self.determinants) {
            Ok(engine) => {
                self.engine = Some(engine);
                Ok(())
            }
            Err(e) => {
                self.pattern.forget();
                Err(e)
            }
        }
    }

    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        self.rcond = None;
        self.to_balance.clear();
        self.pattern.check(&a)?;
        match self.attempt(a.values, false) {
            Err(LinearError::Singular { rcond }) if self.scaling.is_regular() => {
                // Largest entries may have misled the equilibration: try the balanced matrix before reporting it singular.
                self.attempt(a.values, true)
                    .map_err(|_| LinearError::Singular { rcond })
            }
            result => result,
        }
    }

    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve(b, false)
    }

    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve(b, true)
    }

    fn rcond(&mut self) -> Option<f64> {
        if let Some(engine) = &mut self.engine
            && !self.to_balance.is_empty()
        {
            let n = self.pattern.n();
            let (x, rest) = self.work.split_at_mut(n);
            let balanced = self.balance.balanced_rcond(
                &self.scaling,
                (self.pattern.col_ptr(), self.pattern.row_idx(), &self.to_balance),
                |x, transpose| engine.solve(x, transpose),
                x,
                &mut rest[..n],
            );
            self.rcond = self.rcond.map(|rcond| rcond.max(balanced));
            self.to_balance.clear();
        }
        self.rcond
    }

    fn log_det(&self) -> Option<(i8, f64)> {
        self.rcond?;
        if self.pattern.n() == 0 {
            return Some((1, 0.0));
        }
        match &self.engine.as_ref()?.factors {
            Factors::Blocked(_) => None,
            Factors::Columns(c) => {
                let log: f64 = c.pivots().map(|p| p.abs().ln()).sum();
                Some((if c.odd { -1 } else { 1 }, log + self.scaling.ln_det()))
            }
        }
    }
}

impl fmt::Debug for SparseLu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SparseLu")
            .field("n", &self.pattern.n())
            .field("nnz", &self.pattern.row_idx().len())
            .field("rcond", &self.rcond)
            .finish_non_exhaustive()
    }
}
