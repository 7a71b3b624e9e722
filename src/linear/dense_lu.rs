mod small;

pub(super) use small::eliminate_small;
use small::{eliminate_fixed, solve_small};
use std::fmt;
use std::mem::MaybeUninit;

use faer::dyn_stack::{MemStack, StackReq};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::perm::PermRef;
use faer::{Accum, Conj, MatMut, MatRef, Par};

use super::condition::{judge, norm_1_estimate};
use super::memory::{PatternMemory, check_finite, count_rhs, dense_zeros};
use super::scaling::{Scaling, scale_columns};
use super::{LinearError, LinearSolver};
use crate::parallel;
use crate::sparse::{MatrixRef, PatternRef, max_abs, sum_abs};
use crate::tolerances::{HALF_DIGITS, SIX_DIGITS};

/// Orders below this are eliminated column by column, where blocking does not pay.
pub(super) const BLOCKED: usize = 50;

/// Orders from which all cores eliminate, and columns that one takes at a time.
pub(super) const PANELS: usize = 1024;
const PANEL: usize = 256;

/// Right-hand sides solved for at a time by the blocked route, so that scratch is bounded.
const BLOCK_RHS: usize = 16;

/// Orders up to which large pivots alone prove a good condition: |U⁻¹| is at most 2ⁿ⁻¹ times the growth over the smallest pivot.
/// The estimator would cost more than the elimination.
const TINY: usize = 4;

/// Dense LU with partial pivoting, for any pattern (entries not stored are zeros).
///
/// The matrix is first equilibrated by powers of two, S = R A C, so that neither pivots nor the verdict *singular* depend on
/// the units of equations and unknowns; [`rcond`](LinearSolver::rcond) is that of S (up to
/// order 4 the ratio of the smallest pivot to the norm, while that is large), and where it is below 1e-6, that of the matrix with rows
/// and columns balanced in the geometric mean, if that is larger. [`LinearError::Singular`] is returned below
/// 1e-14. Nothing is allocated after [`analyze`](LinearSolver::analyze), but for lists of n integers from order 1024 on, where all cores
/// eliminate; it refuses orders above 50 000
/// ([`LinearError::TooLarge`]).
///
/// # Complexity
/// 2n³/3 operations a factorisation, 2n² a solve; 8 n² bytes.
#[derive(Clone, Default)]
pub struct DenseLu {
    pattern: PatternMemory,
    scaling: Scaling,
    /// For condition numbers alone.
    balance: Scaling,
    lu: Vec<f64>,
    /// Row exchanged with row k at step k, or (blocked) the permutation and its inverse.
    perm: Vec<usize>,
    perm_inv: Vec<usize>,
    odd: bool,
    work: Vec<f64>,
    sign: Vec<f64>,
    scratch: Vec<MaybeUninit<u8>>,
    rcond: Option<f64>,
    /// The entries of the matrix, where its condition number is still to be compared with that of the balanced one; else empty.
    to_balance: Vec<f64>,
}

impl DenseLu {
    /// A solver without a pattern.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Analyses and factors a full matrix of order n, given by columns.
    pub(crate) fn factor_full(&mut self, n: usize, values: &[f64]) -> Result<(), LinearError> {
        if self.pattern.learn_full(n) {
            self.make_room()?;
        }
        self.rcond = None;
        self.to_balance.clear();
        self.factor_values(values)
    }

    /// Allocates for matrices over the pattern.
    fn make_room(&mut self) -> Result<(), LinearError> {
        self.rcond = None;
        self.to_balance = Vec::new();
        let n = self.pattern.n();
        self.scaling.resize(n);
        self.balance.resize(n);
        // Memory that is large enough is kept: new pages cost as much as a pass through the matrix.
        self.lu.clear();
        if n.checked_mul(n).is_none_or(|size| size > self.lu.capacity()) {
            self.lu = Vec::new();
            self.lu = dense_zeros(n, n).inspect_err(|_| self.pattern.forget())?;
        }
        self.lu.resize(n * n, 0.0);
        self.perm.clear();
        self.perm.resize(n, 0);
        self.work.resize(n, 0.0);
        self.sign.resize(n, 0.0);
        if n >= BLOCKED {
            self.perm_inv.clear();
            self.perm_inv.resize(n, 0);
            self.scratch.resize(scratch_bytes(n), MaybeUninit::uninit());
        }
        Ok(())
    }

    fn factor_values(&mut self, values: &[f64]) -> Result<(), LinearError> {
        match self.attempt(values, false) {
            Err(LinearError::Singular { rcond }) if self.scaling.is_regular() => {
                // Largest entries may have misled the equilibration: try the balanced matrix before reporting it singular.
                self.pattern.write_down();
                self.attempt(values, true)
                    .map_err(|_| LinearError::Singular { rcond })
            }
            result => result,
        }
    }

    /// Writes S = R A C into `lu` and returns its 1-norm.
    fn scatter(&mut self, values: &[f64], balanced: bool) -> Result<f64, LinearError> {
        let n = self.pattern.n();
        let (col_ptr, row_idx) = (self.pattern.col_ptr(), self.pattern.row_idx());
        let full = n > 0 && self.pattern.is_full();
        match (balanced, full) {
            (false, true) => self.scaling.compute_full(values)?,
            (false, false) => self.scaling.compute(col_ptr, row_idx, values)?,
            (true, _) => (self.scaling).balance(col_ptr, row_idx, values),
        }
        if !full {
            self.lu.fill(0.0);
        }
        let (row, col) = (self.scaling.row(), self.scaling.col());
        if full {
            let size = columns_at_once(n) * n.max(1);
            return Ok(parallel::largest_of_parts(&mut self.lu, size, &|first, part| {
                let mut norm = 0.0_f64;
                let columns = values[first..].chunks_exact(n).zip(&col[first / n..]);
                for (target, (values, col)) in part.chunks_exact_mut(n).zip(columns) {
                    for ((s, v), r) in target.iter_mut().zip(values).zip(row) {
                        *s = v * r * col;
                    }
                    norm = norm.max(sum_abs(target));
                }
                norm
            }));
        }
        let mut norm = 0.0_f64;
        for j in 0..n {
            let span = col_ptr[j]..col_ptr[j + 1];
            let target = &mut self.lu[j * n..(j + 1) * n];
            let mut sum = 0.0;
            for (&i, v) in row_idx[span.clone()].iter().zip(&values[span]) {
                target[i] = v * row[i] * col[j];
                sum += target[i].abs();
            }
            norm = norm.max(sum);
        }
        Ok(norm)
    }

    fn eliminate(&mut self) -> Result<(), LinearError> {
        let n = self.pattern.n();
        if n >= BLOCKED {
            self.odd = eliminate_blocked(
                n,
                &mut self.lu,
                &mut self.perm,
                &mut self.perm_inv,
                &mut self.scratch,
            );
        } else {
            let run = match n {
                1 => eliminate_fixed::<1>,
                2 => eliminate_fixed::<2>,
                3 => eliminate_fixed::<3>,
                4 => eliminate_fixed::<4>,
                _ => eliminate_small,
            };
            self.odd = run(n, &mut self.lu, &mut self.perm).ok_or(LinearError::Singular { rcond: 0.0 })?;
        }
        let size = columns_at_once(n) * n.max(1);
        let growth = parallel::largest_of_parts(&mut self.lu, size, &|_, part| max_abs(part));
        if (0..n).any(|k| self.lu[k * n + k] == 0.0 || !self.lu[k * n + k].is_finite()) {
            return Err(LinearError::Singular { rcond: 0.0 });
        }
        // Entries of S are below 4, so this is the growth of pivoting, the only way it loses its backward stability.
        if growth > 1.0 / HALF_DIGITS {
            return Err(LinearError::Inaccurate {
                residual: growth * f64::EPSILON,
            });
        }
        Ok(())
    }

    fn attempt(&mut self, values: &[f64], balanced: bool) -> Result<(), LinearError> {
        let norm = self.scatter(values, balanced)?;
        self.eliminate()?;
        let factors = Factors {
            n: self.pattern.n(),
            lu: &self.lu,
            perm: &self.perm,
            perm_inv: &self.perm_inv,
        };
        if factors.n == 0 {
            self.rcond = Some(1.0);
            return Ok(());
        }
        if factors.n <= TINY {
            let pivots = (0..factors.n).map(|k| self.lu[k * (factors.n + 1)].abs());
            let ratio = pivots.fold(f64::INFINITY, f64::min) / norm;
            if ratio > SIX_DIGITS {
                self.rcond = Some(ratio);
                return Ok(());
            }
        }
        let inverse_norm = norm_1_estimate(
            |x, transpose| factors.solve(x, transpose, &mut self.scratch),
            &mut self.work,
            &mut self.sign,
        );
        let rcond = judge(norm, inverse_norm)?;
        // A small one may be due to units: that of the balanced matrix is computed, too.
        if rcond < SIX_DIGITS && !balanced {
            self.to_balance.extend_from_slice(values);
        }
        self.rcond = Some(rcond);
        Ok(())
    }

    fn solve(&mut self, b: &mut [f64], transpose: bool) -> Result<(), LinearError> {
        if self.rcond.is_none() {
            return Err(LinearError::NotFactored);
        }
        let n = self.pattern.n();
        count_rhs(n, b)?;
        check_finite(b, "the right-hand side")?;
        let (before, after) = match transpose {
            false => (self.scaling.row(), self.scaling.col()),
            true => (self.scaling.col(), self.scaling.row()),
        };
        let factors = Factors {
            n,
            lu: &self.lu,
            perm: &self.perm,
            perm_inv: &self.perm_inv,
        };
        scale_columns(b, before);
        factors.solve(b, transpose, &mut self.scratch);
        scale_columns(b, after);
        check_finite(b, "").map_err(|_| LinearError::Inaccurate { residual: f64::NAN })
    }
}

/// Columns of a part for which a thread pays off.
fn columns_at_once(n: usize) -> usize {
    if n >= PANELS { PANEL } else { n.max(1) }
}

/// The factors of P S = L U, borrowed apart from the scratch of a solve.
pub(super) struct Factors<'a> {
    pub(super) n: usize,
    pub(super) lu: &'a [f64],
    pub(super) perm: &'a [usize],
    pub(super) perm_inv: &'a [usize],
}

impl Factors<'_> {
    pub(super) fn solve(&self, b: &mut [f64], transpose: bool, scratch: &mut [MaybeUninit<u8>]) {
        let n = self.n;
        if n == 0 {
            return;
        }
        if n < BLOCKED {
            for column in b.chunks_exact_mut(n) {
                let run = match n {
                    1 => solve_fixed::<1>,
                    2 => solve_fixed::<2>,
                    3 => solve_fixed::<3>,
                    4 => solve_fixed::<4>,
                    _ => solve_small,
                };
                run(self.lu, self.perm, column, transpose);
            }
            return;
        }
        let lu = MatRef::from_column_major_slice(self.lu, n, n);
        for block in b.chunks_mut(BLOCK_RHS * n) {
            let perm = PermRef::new_checked(self.perm, self.perm_inv, n);
            let k = block.len() / n;
            let rhs = MatMut::from_column_major_slice_mut(block, n, k);
            let stack = MemStack::new(scratch);
            let run = match transpose {
                false => solve::solve_in_place_with_conj::<usize, f64>,
                true => solve::solve_transpose_in_place_with_conj::<usize, f64>,
            };
            run(lu, lu, perm, Conj::No, rhs, Par::Seq, stack);
        }
    }
}

/// Solves with a copy of the factors of a constant order, which the compiler keeps in registers.
#[inline]
fn solve_fixed<const N: usize>(lu: &[f64], perm: &[usize], b: &mut [f64], transpose: bool) {
    let (Some(columns), Some(perm), Some(b)) = (
        lu.as_chunks::<N>().0.first_chunk::<N>(),
        perm.first_chunk::<N>(),
        b.first_chunk_mut::<N>(),
    ) else {
        return;
    };
    let mut x = *b;
    if transpose {
        for k in 0..N {
            for i in 0..k {
                x[k] -= columns[k][i] * x[i];
            }
            x[k] /= columns[k][k];
        }
        for k in (0..N).rev() {
            for i in k + 1..N {
                x[k] -= columns[k][i] * x[i];
            }
        }
        (0..N).rev().for_each(|k| x.swap(k, perm[k]));
    } else {
        (0..N).for_each(|k| x.swap(k, perm[k]));
        for k in 0..N {
            for i in k + 1..N {
                x[i] -= columns[k][i] * x[k];
            }
        }
        for k in (0..N).rev() {
            x[k] /= columns[k][k];
            for i in 0..k {
                x[i] -= columns[k][i] * x[k];
            }
        }
    }
    *b = x;
}

/// Bytes of scratch for elimination by blocks and for solves.
pub(super) fn scratch_bytes(n: usize) -> usize {
    let request = StackReq::any_of(&[
        factor::lu_in_place_scratch::<usize, f64>(n, n, Par::Seq, Default::default()),
        solve::solve_in_place_scratch::<usize, f64>(n, BLOCK_RHS, Par::Seq),
        solve::solve_transpose_in_place_scratch::<usize, f64>(n, BLOCK_RHS, Par::Seq),
    ]);
    request.unaligned_bytes_required()
}

/// Elimination with partial pivoting in place, by blocks; `true` for an odd number of exchanges.
pub(super) fn eliminate_blocked(
    n: usize,
    lu: &mut [f64],
    perm: &mut [usize],
    perm_inv: &mut [usize],
    scratch: &mut [MaybeUninit<u8>],
) -> bool {
    if n >= PANELS {
        return eliminate_panels(n, lu, (perm, perm_inv), scratch);
    }
    let (info, _) = factor::lu_in_place(
        MatMut::from_column_major_slice_mut(lu, n, n),
        perm,
        perm_inv,
        Par::Seq,
        MemStack::new(scratch),
        Default::default(),
    );
    info.transposition_count % 2 == 1
}

/// Elimination with partial pivoting in place, panel by panel, the columns beside a panel on all cores; `true` for an odd number of
/// exchanges.
fn eliminate_panels(
    n: usize,
    lu: &mut [f64],
    (perm, perm_inv): (&mut [usize], &mut [usize]),
    scratch: &mut [MaybeUninit<u8>],
) -> bool {
    let (mut forward, mut backward) = (vec![0; n], vec![0; n]);
    perm.iter_mut().enumerate().for_each(|(k, p)| *p = k);
    let mut moves = Vec::with_capacity(2 * PANEL);
    let mut exchanges = 0;
    for k in (0..n).step_by(PANEL) {
        let (w, m) = (PANEL.min(n - k), n - k);
        let (left, own) = lu.split_at_mut(k * n);
        let (own, right) = own.split_at_mut(w * n);
        let (info, _) = factor::lu_in_place(
            MatMut::from_column_major_slice_mut(own, n, w).subrows_mut(k, m),
            &mut forward[..m],
            &mut backward[..m],
            Par::Seq,
            MemStack::new(scratch),
            Default::default(),
        );
        exchanges += info.transposition_count;
        // Where entries of a column go and come from.
        moves.clear();
        let changed = forward[..m].iter().enumerate().filter(|(to, from)| *to != **from);
        moves.extend(changed.map(|(to, from)| (k + to, k + from)));
        let exchange = |column: &mut [f64]| {
            let mut kept = [0.0; 2 * PANEL];
            for (kept, (_, from)) in kept.iter_mut().zip(&moves) {
                *kept = column[*from];
            }
            for (kept, (to, _)) in kept.iter().zip(&moves) {
                column[*to] = *kept;
            }
        };
        forward[..m].iter_mut().for_each(|from| *from = perm[k + *from]);
        perm[k..].copy_from_slice(&forward[..m]);
        parallel::parts(left, PANEL * n, &|_, part| {
            part.chunks_exact_mut(n).for_each(exchange)
        });
        let own = MatRef::from_column_major_slice(own, n, w);
        let (diagonal, below) = own.subrows(k, m).split_at_row(w);
        parallel::parts(right, PANEL * n, &|_, part| {
            part.chunks_exact_mut(n).for_each(exchange);
            let count = part.len() / n;
            let part = MatMut::from_column_major_slice_mut(part, n, count).subrows_mut(k, m);
            let (mut above, rest) = part.split_at_row_mut(w);
            solve_unit_lower_triangular_in_place(diagonal, above.as_mut(), Par::Seq);
            matmul(rest, Accum::Add, below, above.as_ref(), -1.0, Par::Seq);
        });
    }
    perm.iter()
        .enumerate()
        .for_each(|(to, from)| perm_inv[*from] = to);
    exchanges % 2 == 1
}

impl LinearSolver for DenseLu {
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
        match self.pattern.learn(pattern)? {
            true => self.make_room(),
            false => Ok(()),
        }
    }

    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        self.rcond = None;
        self.to_balance.clear();
        self.pattern.check(&a)?;
        self.factor_values(a.values)
    }

    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve(b, false)
    }

    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve(b, true)
    }

    fn rcond(&mut self) -> Option<f64> {
        if !self.to_balance.is_empty() {
            self.pattern.write_down();
            let factors = Factors {
                n: self.pattern.n(),
                lu: &self.lu,
                perm: &self.perm,
                perm_inv: &self.perm_inv,
            };
            let balanced = self.balance.balanced_rcond(
                &self.scaling,
                (self.pattern.col_ptr(), self.pattern.row_idx(), &self.to_balance),
                |x, transpose| factors.solve(x, transpose, &mut self.scratch),
                &mut self.work,
                &mut self.sign,
            );
            self.rcond = self.rcond.map(|rcond| rcond.max(balanced));
            self.to_balance.clear();
        }
        self.rcond
    }

    fn log_det(&self) -> Option<(i8, f64)> {
        self.rcond?;
        let n = self.pattern.n();
        let mut odd = self.odd;
        let mut log = self.scaling.ln_det();
        for k in 0..n {
            let pivot = self.lu[k * n + k];
            odd ^= pivot < 0.0;
            log += pivot.abs().ln();
        }
        Some((if odd { -1 } else { 1 }, log))
    }
}

impl fmt::Debug for DenseLu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DenseLu")
            .field("n", &self.pattern.n())
            .field("rcond", &self.rcond)
            .finish_non_exhaustive()
    }
}
