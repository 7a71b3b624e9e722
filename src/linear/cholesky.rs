use std::fmt;
use std::mem::MaybeUninit;
use std::sync::Arc;

use faer::dyn_stack::{MemStack, StackReq};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal::SupernodalLltRef,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use super::condition::{judge, norm_1_estimate};
use super::memory::{PatternMemory, check_finite, count_rhs, dense_zeros, zeros};
use super::ordering::{Nodes, Order};
use super::sparse_lu::{BLOCK_RHS, give_up};
use super::supernodal;
use super::{LinearError, LinearSolver};
use crate::clock::Until;
use crate::sparse::{MatrixRef, PatternRef};

/// Operations for an entry of L, in units of faer, above which dense blocks are used: measured on meshes of a few hundred nodes, where they
/// are faster already at a quarter of faer's own limit.
const SUPERNODAL: SupernodalThreshold = SupernodalThreshold(0.25);

/// Operations of a factorisation above which a second order is tried.
const HEAVY: f64 = 2e10;

/// Sparse Cholesky A = L Lᵀ for symmetric positive definite matrices.
///
/// Only the lower triangle of A is read (the pattern may hold the upper one too; it is taken to be symmetric, not checked).
/// The fill-reducing order and all memory are reused as long as the pattern stays. The matrix is scaled by powers of two to a
/// diagonal near 1 first; [`rcond`](LinearSolver::rcond) is that of the scaled matrix.
///
/// # Complexity
/// On a mesh of n nodes about n^1.5 operations and n log n numbers in the plane, n² operations and n^1.33 numbers in space; a solve is
/// linear in the entries of the factor.
#[derive(Clone, Default)]
pub struct Cholesky {
    pattern: PatternMemory,
    /// Powers of two d with diagonal entries of D A D near 1.
    scale: Vec<f64>,
    values: Vec<f64>,
    engine: Option<Engine>,
    work: Vec<f64>,
    rcond: Option<f64>,
}

#[derive(Clone)]
struct Engine {
    symbolic: Arc<SymbolicCholesky<usize>>,
    factor: Vec<f64>,
    scratch: Vec<MaybeUninit<u8>>,
}

impl Cholesky {
    /// A solver without a pattern.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// [`analyze`](LinearSolver::analyze), with the unknowns in `last` (distinct, below n) eliminated last, in that order.
    pub(crate) fn analyze_with_last(
        &mut self,
        pattern: PatternRef<'_>,
        last: &[usize],
    ) -> Result<(), LinearError> {
        self.pattern.learn(pattern)?;
        self.prepare(last)
    }

    /// Bytes of a factorisation of matrices over a pattern, the unknowns in `last` eliminated last; nothing of that size is allocated.
    pub(crate) fn memory_with_last(pattern: PatternRef<'_>, last: &[usize]) -> Result<u64, LinearError> {
        let mut memory = PatternMemory::default();
        memory.learn(pattern)?;
        let analysis = Analysis::new(&memory, last)?;
        let numbers = analysis.symbolic.len_val() + 3 * memory.n() + memory.row_idx().len();
        let more = match analysis.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(s) => supernodal::memory(s, memory.row_idx().len()),
            SymbolicCholeskyRaw::Simplicial(_) => 0,
        };
        Ok((size_of::<f64>() * numbers + analysis.scratch + more) as u64)
    }

    /// The trailing q × q block of the factor of A (not scaled), column-major, lower triangular. With the unknowns of an index
    /// set J eliminated last, L Lᵀ of this block is the Schur complement of A on J.
    pub(crate) fn trailing_factor(&self, last: &[usize]) -> Result<Vec<f64>, LinearError> {
        let (Some(engine), Some(_)) = (self.engine.as_ref(), self.rcond) else {
            return Err(LinearError::NotFactored);
        };
        let q = last.len();
        let mut block = engine.trailing(q)?;
        for column in block.chunks_exact_mut(q.max(1)) {
            for (v, &i) in column.iter_mut().zip(last) {
                *v /= self.scale[i];
            }
        }
        Ok(block)
    }

    /// [`factor`](LinearSolver::factor), with the condition judged by the pivots alone where they are conclusive. With a unit diagonal
    /// 1/l_jj² bounds ‖A⁻¹‖ from below, and is near it in all but contrived matrices.
    pub(crate) fn factor_by_pivots(&mut self, a: MatrixRef<'_>, until: Until) -> Result<(), LinearError> {
        const DOUBTFUL: f64 = 1e-9;
        let norm = self.decompose(a, until)?;
        let smallest = self.engine.as_ref().map_or(1.0, Engine::smallest_pivot);
        if smallest < DOUBTFUL {
            return self.estimate_condition(norm);
        }
        self.rcond = Some((smallest / norm.max(1.0)).min(1.0));
        Ok(())
    }

    /// Scales and factors; returns the norm of the scaled matrix. Its condition is then unknown.
    fn decompose(&mut self, a: MatrixRef<'_>, until: Until) -> Result<f64, LinearError> {
        self.rcond = None;
        self.pattern.check(&a)?;
        check_finite(a.values, "the matrix")?;
        let norm = self.scale(a.values)?;
        // With a unit diagonal, larger entries mean an indefinite matrix; infinite ones are not passed to the factorisation.
        if !norm.is_finite() {
            return Err(LinearError::NotPositiveDefinite);
        }
        let Some(engine) = self.engine.as_mut() else {
            return Err(LinearError::NotAnalyzed);
        };
        let n = self.pattern.n();
        if n == 0 {
            return Ok(0.0);
        }
        if let SymbolicCholeskyRaw::Supernodal(s) = engine.symbolic.raw() {
            let a = (self.pattern.col_ptr(), self.pattern.row_idx(), &self.values[..]);
            let place = engine.symbolic.perm().map(|p| p.arrays().1);
            supernodal::factorize(s, place, a, &mut engine.factor, until)?;
            return Ok(norm);
        }
        let symbolic =
            SymbolicSparseColMatRef::new_checked(n, n, self.pattern.col_ptr(), None, self.pattern.row_idx());
        let result = engine.symbolic.factorize_numeric_llt(
            &mut engine.factor,
            SparseColMatRef::new(symbolic, &self.values),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut engine.scratch),
            Default::default(),
        );
        // The only possible error is a pivot that is not positive.
        if result.is_err() {
            return Err(LinearError::NotPositiveDefinite);
        }
        Ok(norm)
    }

    fn estimate_condition(&mut self, norm: f64) -> Result<(), LinearError> {
        let n = self.pattern.n();
        let Some(engine) = self.engine.as_mut().filter(|_| n > 0) else {
            self.rcond = Some(1.0);
            return Ok(());
        };
        let (x, sign) = self.work.split_at_mut(n);
        let mut scratch = std::mem::take(&mut engine.scratch);
        let inverse_norm = norm_1_estimate(|x, _| engine.solve(x, &mut scratch), x, sign);
        engine.scratch = scratch;
        // Rounding may make all pivots of a semidefinite matrix positive: the condition number decides.
        match judge(norm, inverse_norm) {
            Ok(rcond) => self.rcond = Some(rcond),
            Err(_) => return Err(LinearError::NotPositiveDefinite),
        }
        Ok(())
    }

    fn prepare(&mut self, last: &[usize]) -> Result<(), LinearError> {
        self.rcond = None;
        self.engine = None;
        let n = self.pattern.n();
        self.scale.resize(n, 1.0);
        self.values.resize(self.pattern.row_idx().len(), 0.0);
        self.work.resize(2 * n, 0.0);
        match Engine::new(&self.pattern, last) {
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

    /// Finds the scales and writes D A D into `values`; returns its 1-norm.
    fn scale(&mut self, a: &[f64]) -> Result<f64, LinearError> {
        let n = self.pattern.n();
        let (col_ptr, row_idx) = (self.pattern.col_ptr(), self.pattern.row_idx());
        for j in 0..n {
            let span = col_ptr[j]..col_ptr[j + 1];
            let diagonal = row_idx[span.clone()]
                .binary_search(&j)
                .map_or(0.0, |k| a[span.start + k]);
            if diagonal.is_nan() || diagonal <= 0.0 {
                return Err(LinearError::NotPositiveDefinite);
            }
            self.scale[j] = inverse_root(diagonal);
        }
        let sums = &mut self.work[..n];
        sums.fill(0.0);
        for j in 0..n {
            let span = col_ptr[j]..col_ptr[j + 1];
            let entries = row_idx[span.clone()].iter().zip(&a[span.clone()]);
            for ((&i, v), scaled) in entries.zip(&mut self.values[span]) {
                // The upper triangle is never read.
                if i >= j {
                    *scaled = v * self.scale[i] * self.scale[j];
                    sums[i] += scaled.abs();
                    if i > j {
                        sums[j] += scaled.abs();
                    }
                }
            }
        }
        Ok(sums.iter().fold(0.0, |m: f64, s| m.max(*s)))
    }

    fn solve(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let mut scratch = match &mut self.engine {
            Some(engine) => std::mem::take(&mut engine.scratch),
            None => Vec::new(),
        };
        let result = self.solve_with(b, &mut scratch);
        if let Some(engine) = &mut self.engine {
            engine.scratch = scratch;
        }
        result
    }

    /// Solves through a shared reference, with its own scratch.
    pub(crate) fn solve_shared(&self, b: &mut [f64]) -> Result<(), LinearError> {
        let bytes = self.engine.as_ref().map_or(0, |e| e.scratch.len());
        self.solve_with(b, &mut Box::new_uninit_slice(bytes))
    }

    /// L⁻¹ f for the factor L of A, as ordered: its last entries are those of the unknowns eliminated last. Several f are taken one
    /// after another.
    pub(crate) fn forward(&self, f: &[f64]) -> Result<Vec<f64>, LinearError> {
        let (Some(engine), Some(_)) = (self.engine.as_ref(), self.rcond) else {
            return Err(LinearError::NotFactored);
        };
        let n = self.pattern.n();
        count_rhs(n, f)?;
        check_finite(f, "the right-hand side")?;
        let mut y = f.to_vec();
        super::scaling::scale_columns(&mut y, &self.scale);
        if let Some(perm) = engine.symbolic.perm() {
            for (y, f) in y.chunks_exact_mut(n).zip(f.chunks_exact(n)) {
                for (y, &i) in y.iter_mut().zip(perm.arrays().0) {
                    *y = f[i] * self.scale[i];
                }
            }
        }
        y.chunks_exact_mut(n.max(1)).for_each(|y| engine.forward(y));
        Ok(y)
    }

    fn solve_with(&self, b: &mut [f64], scratch: &mut [MaybeUninit<u8>]) -> Result<(), LinearError> {
        let (Some(engine), Some(_)) = (self.engine.as_ref(), self.rcond) else {
            return Err(LinearError::NotFactored);
        };
        let n = self.pattern.n();
        count_rhs(n, b)?;
        check_finite(b, "the right-hand side")?;
        if n == 0 {
            return Ok(());
        }
        for block in b.chunks_mut(n * BLOCK_RHS) {
            super::scaling::scale_columns(block, &self.scale);
            engine.solve(block, scratch);
            super::scaling::scale_columns(block, &self.scale);
        }
        check_finite(b, "").map_err(|_| LinearError::Inaccurate { residual: f64::NAN })
    }
}

/// The symbolic factor of a pattern.
struct Analysis {
    symbolic: SymbolicCholesky<usize>,
    /// Bytes.
    scratch: usize,
}

impl Analysis {
    /// The unknowns in `last` are eliminated last, in the order given.
    fn new(pattern: &PatternMemory, last: &[usize]) -> Result<Self, LinearError> {
        let n = pattern.n();
        let a = SymbolicSparseColMatRef::new_checked(n, n, pattern.col_ptr(), None, pattern.row_idx());
        let analyse = |ordering: SymmetricOrdering<'_, usize>| {
            let params = CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SUPERNODAL,
                ..Default::default()
            };
            factorize_symbolic_cholesky(a, Side::Lower, ordering, params).map_err(give_up)
        };
        let ordered = |order: Order| {
            let (forward, backward) = (&order.unknowns, &order.places);
            analyse(SymmetricOrdering::Custom(PermRef::new_checked(
                forward, backward, n,
            )))
        };
        let mut symbolic = if last.is_empty() {
            analyse(SymmetricOrdering::Amd)?
        } else {
            ordered(Nodes::new(a, last).minimum_degree()?)?
        };
        let work = operations(&symbolic);
        if work > HEAVY {
            let dissected = ordered(Nodes::new(a, last).dissected()?)?;
            if operations(&dissected) < work {
                symbolic = dissected;
            }
        }
        let solve = symbolic.solve_in_place_scratch::<f64>(BLOCK_RHS, Par::Seq);
        let request = match symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(_) => solve,
            SymbolicCholeskyRaw::Simplicial(_) => {
                let factor = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
                StackReq::or(factor, solve)
            }
        };
        Ok(Self {
            symbolic,
            scratch: request.unaligned_bytes_required(),
        })
    }
}

impl Engine {
    /// Analyses a pattern; the unknowns in `last` are eliminated last, in the order given.
    fn new(pattern: &PatternMemory, last: &[usize]) -> Result<Self, LinearError> {
        let Analysis {
            symbolic,
            scratch: bytes,
        } = Analysis::new(pattern, last)?;
        let entries = symbolic.len_val();
        let mut scratch = Vec::new();
        let factor = zeros(entries).filter(|_| scratch.try_reserve_exact(bytes).is_ok());
        let factor = factor.ok_or_else(|| LinearError::Solver {
            what: format!("a Cholesky factor of {entries} entries does not fit into memory"),
        })?;
        scratch.resize(bytes, MaybeUninit::uninit());
        Ok(Self {
            factor,
            symbolic: Arc::new(symbolic),
            scratch,
        })
    }

    fn solve(&self, b: &mut [f64], scratch: &mut [MaybeUninit<u8>]) {
        let n = self.symbolic.nrows();
        let k = b.len() / n;
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(b, n, k),
            Par::Seq,
            MemStack::new(scratch),
        );
    }

    /// Overwrites y by L⁻¹ y, in the order of elimination.
    fn forward(&self, y: &mut [f64]) {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => {
                for j in 0..s.ncols() {
                    let span = s.col_ptr()[j]..s.col_ptr()[j + 1];
                    let (rows, values) = (&s.row_idx()[span.clone()], &self.factor[span]);
                    let pivot = y[j] / values[0];
                    y[j] = pivot;
                    for (&i, v) in rows.iter().zip(values).skip(1) {
                        y[i] -= pivot * v;
                    }
                }
            }
            SymbolicCholeskyRaw::Supernodal(s) => {
                let llt = SupernodalLltRef::new(s, &self.factor);
                for k in 0..s.n_supernodes() {
                    let supernode = llt.supernode(k);
                    let (start, values) = (supernode.start(), supernode.val());
                    let width = values.ncols();
                    for (c, column) in values.col_iter().enumerate() {
                        let Some(column) = column.try_as_col_major().map(|c| c.as_slice()) else {
                            continue;
                        };
                        let pivot = y[start + c] / column[c];
                        y[start + c] = pivot;
                        for (y, v) in y[start + c + 1..start + width].iter_mut().zip(&column[c + 1..]) {
                            *y -= pivot * v;
                        }
                        for (&i, v) in supernode.pattern().iter().zip(&column[width..]) {
                            y[i] -= pivot * v;
                        }
                    }
                }
            }
        }
    }

    /// The trailing q × q block of L, column-major; its upper triangle is zero.
    fn trailing(&self, q: usize) -> Result<Vec<f64>, LinearError> {
        let first = self.symbolic.nrows() - q;
        let mut block = dense_zeros(q, q)?;
        let mut put = |i: usize, j: usize, v: f64| {
            if i >= j && j >= first {
                block[(j - first) * q + (i - first)] = v;
            }
        };
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => {
                for j in first..s.ncols() {
                    for k in s.col_ptr()[j]..s.col_ptr()[j + 1] {
                        put(s.row_idx()[k], j, self.factor[k]);
                    }
                }
            }
            SymbolicCholeskyRaw::Supernodal(s) => {
                let llt = SupernodalLltRef::new(s, &self.factor);
                for k in 0..s.n_supernodes() {
                    let supernode = llt.supernode(k);
                    let (start, values) = (supernode.start(), supernode.val());
                    if start + values.ncols() <= first {
                        continue;
                    }
                    for c in 0..values.ncols() {
                        for r in c..values.nrows() {
                            let row = match r.checked_sub(values.ncols()) {
                                None => start + r,
                                Some(below) => supernode.pattern()[below],
                            };
                            put(row, start + c, values[(r, c)]);
                        }
                    }
                }
            }
        }
        Ok(block)
    }

    /// Calls `f` with every diagonal entry of L.
    fn for_diagonal(&self, mut f: impl FnMut(f64)) {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => {
                (0..s.ncols()).for_each(|j| f(self.factor[s.col_ptr()[j]]));
            }
            SymbolicCholeskyRaw::Supernodal(s) => {
                let llt = SupernodalLltRef::new(s, &self.factor);
                for k in 0..s.n_supernodes() {
                    let block = llt.supernode(k).val();
                    (0..block.ncols()).for_each(|j| f(block[(j, j)]));
                }
            }
        }
    }

    /// Σ ln l_jj.
    fn log_diagonal(&self) -> f64 {
        let mut sum = 0.0;
        self.for_diagonal(|l| sum += l.ln());
        sum
    }

    /// min l_jj².
    fn smallest_pivot(&self) -> f64 {
        let mut smallest = 1.0f64;
        self.for_diagonal(|l| smallest = smallest.min(l * l));
        smallest
    }
}

/// Multiplications of a factorisation, Σ (entries of a column of L)².
fn operations(symbolic: &SymbolicCholesky<usize>) -> f64 {
    match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(s) => {
            let lengths = s.col_ptr().windows(2).map(|w| (w[1] - w[0]) as f64);
            lengths.map(|l| l * l).sum()
        }
        SymbolicCholeskyRaw::Supernodal(s) => {
            let columns = s.supernode_begin().iter().zip(s.supernode_end());
            let below = s.col_ptr_for_row_idx().windows(2);
            columns
                .zip(below)
                .map(|((begin, end), below)| {
                    let width = (end - begin) as f64;
                    let height = width + (below[1] - below[0]) as f64;
                    width * (height * (height - width) + width * width / 3.0)
                })
                .sum()
        }
    }
}

/// The power of two s with 1/2 ≤ s² d < 2, for a positive d.
fn inverse_root(d: f64) -> f64 {
    const MANTISSA: u32 = 52;
    const BIAS: i64 = 1023;
    let exponent = (d.to_bits() >> MANTISSA) as i64 - BIAS;
    f64::from_bits(((BIAS - (exponent + 1).div_euclid(2)) as u64) << MANTISSA)
}

impl LinearSolver for Cholesky {
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
        if !self.pattern.learn(pattern)? {
            return Ok(());
        }
        self.prepare(&[])
    }

    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        let norm = self.decompose(a, Until::default())?;
        self.estimate_condition(norm)
    }

    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve(b)
    }

    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve(b)
    }

    fn rcond(&mut self) -> Option<f64> {
        self.rcond
    }

    fn log_det(&self) -> Option<(i8, f64)> {
        self.rcond?;
        let log = self.engine.as_ref()?.log_diagonal();
        let scales: f64 = self.scale.iter().map(|d| d.ln()).sum();
        Some((1, 2.0 * (log - scales)))
    }
}

impl fmt::Debug for Cholesky {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cholesky")
            .field("n", &self.pattern.n())
            .field("nnz", &self.pattern.row_idx().len())
            .field("rcond", &self.rcond)
            .finish_non_exhaustive()
    }
}
