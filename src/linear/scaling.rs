use super::LinearError;
use super::condition::norm_1_estimate;
use super::dense_lu::PANELS;
use super::memory::check_finite;
use crate::parallel;
use crate::sparse::max_abs_scaled;

/// Sweeps of [`Scaling::balance`]; a handful suffices unless units vary along a long chain.
const BALANCE_SWEEPS: usize = 12;
/// Change of the exponents within a sweep below which further sweeps hardly ever change the rounded exponents.
const SETTLED: f64 = 1e-2;

/// Rows or columns of a full matrix that one core scales at a time, where all cores do.
const ROWS: usize = 512;

/// Equilibration S = R A C by powers of two, so that the largest entry of every row and column of S lies near 1.
///
/// Scaling is exact, and solutions do not depend on the units of equations and unknowns. Reciprocal condition numbers of S may: where the
/// largest entry of a row lies in a column of large units alone, they come out too small. Those of the [balanced](Scaling::balance) matrix
/// do not.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scaling {
    row: Vec<f64>,
    col: Vec<f64>,
    /// Of rows, then of columns; for [`balance`](Scaling::balance).
    totals: Vec<Total>,
    regular: bool,
}

/// The number of nonzero entries of a row or column, and the sum of their exponents.
#[derive(Debug, Clone, Copy, Default)]
struct Total {
    count: f64,
    exponents: f64,
}

impl Scaling {
    pub(crate) fn resize(&mut self, n: usize) {
        self.row.clear();
        self.row.resize(n, 1.0);
        self.col.clear();
        self.col.resize(n, 1.0);
        self.totals.clear();
        self.totals.reserve_exact(2 * n);
    }

    /// Finds R and C; an empty row or column is a singularity.
    pub(super) fn compute(
        &mut self,
        col_ptr: &[usize],
        row_idx: &[usize],
        values: &[f64],
    ) -> Result<(), LinearError> {
        check_finite(values, "the matrix")?;
        self.regular = false;
        self.row.fill(0.0);
        for (&i, v) in row_idx.iter().zip(values) {
            self.row[i] = self.row[i].max(v.abs());
        }
        invert_all(&mut self.row)?;
        for (c, span) in self.col.iter_mut().zip(col_ptr.windows(2)) {
            let rows = &row_idx[span[0]..span[1]];
            *c = rows
                .iter()
                .zip(&values[span[0]..span[1]])
                .fold(0.0, |m: f64, (&i, v)| m.max(v.abs() * self.row[i]));
        }
        invert_all(&mut self.col)?;
        self.regular = true;
        Ok(())
    }

    /// Finds R and C that bring the *geometric means* of rows and columns near 1: more expensive, but it undoes any scaling of a matrix
    /// with entries of one size, where largest entries mislead.
    ///
    /// Alternating least squares of log₂ |r a c| (A. R. Curtis and J. K. Reid, 1972, doi:10.1093/imamat/10.1.118).
    pub(crate) fn balance(&mut self, col_ptr: &[usize], row_idx: &[usize], values: &[f64]) {
        let (u, v) = (&mut self.row, &mut self.col);
        let n = u.len();
        self.totals.clear();
        self.totals.resize(2 * n, Total::default());
        let (rows, cols) = self.totals.split_at_mut(n);
        for (j, span) in col_ptr.windows(2).enumerate() {
            for k in (span[0]..span[1]).filter(|k| values[*k] != 0.0) {
                let exponent = ((values[k].to_bits() >> 52) & 0x7ff) as f64 - 1023.0;
                for total in [&mut rows[row_idx[k]], &mut cols[j]] {
                    total.count += 1.0;
                    total.exponents += exponent;
                }
            }
        }
        v.fill(0.0);
        for _ in 0..BALANCE_SWEEPS {
            u.fill(0.0);
            for (span, v) in col_ptr.windows(2).zip(v.iter()) {
                let span = span[0]..span[1];
                add_to_rows(&row_idx[span.clone()], &values[span], *v, u);
            }
            for (u, total) in u.iter_mut().zip(&*rows) {
                *u = -(*u + total.exponents) / total.count.max(1.0);
            }
            let mut change = 0.0f64;
            for ((span, v), total) in col_ptr.windows(2).zip(v.iter_mut()).zip(&*cols) {
                let span = span[0]..span[1];
                let sum = sum_of_rows(&row_idx[span.clone()], &values[span], u);
                let new = -(sum + total.exponents) / total.count.max(1.0);
                change = change.max((new - *v).abs());
                *v = new;
            }
            if change < SETTLED {
                break;
            }
        }
        for f in u.iter_mut().chain(v) {
            *f = f.clamp(-500.0, 500.0).round().exp2();
        }
    }

    /// The reciprocal condition number of the balanced matrix, whose factors need not be known: `solve` solves with S, the matrix as scaled
    /// by `own`. `x` and `sign` are scratch of the order of the matrix.
    pub(super) fn balanced_rcond(
        &mut self,
        own: &Scaling,
        (col_ptr, row_idx, values): (&[usize], &[usize], &[f64]),
        mut solve: impl FnMut(&mut [f64], bool),
        x: &mut [f64],
        sign: &mut [f64],
    ) -> f64 {
        self.balance(col_ptr, row_idx, values);
        let mut norm = 0.0_f64;
        for (span, c) in col_ptr.windows(2).zip(&self.col) {
            let rows = &row_idx[span[0]..span[1]];
            let entries = rows.iter().zip(&values[span[0]..span[1]]);
            norm = norm.max(entries.map(|(&i, v)| (v * self.row[i] * c).abs()).sum());
        }
        // With R' and C' of the balanced matrix its inverse is (C / C') S⁻¹ (R / R').
        let ratios =
            |balanced: &mut [f64], own: &[f64]| balanced.iter_mut().zip(own).for_each(|(b, o)| *b = o / *b);
        ratios(&mut self.row, &own.row);
        ratios(&mut self.col, &own.col);
        let inverse = |x: &mut [f64], transpose: bool| {
            let (before, after) = if transpose {
                (&self.col, &self.row)
            } else {
                (&self.row, &self.col)
            };
            x.iter_mut().zip(before).for_each(|(x, f)| *x *= f);
            solve(x, transpose);
            x.iter_mut().zip(after).for_each(|(x, f)| *x *= f);
        };
        1.0 / (norm * norm_1_estimate(inverse, x, sign))
    }

    /// As [`compute`](Self::compute), for a full matrix.
    pub(super) fn compute_full(&mut self, values: &[f64]) -> Result<(), LinearError> {
        check_finite(values, "the matrix")?;
        let n = self.row.len();
        self.row.fill(0.0);
        if n == 0 {
            return Ok(());
        }
        // Rows by parts, and columns after that.
        let size = if n >= PANELS { ROWS } else { n };
        parallel::parts(&mut self.row, size, &|first, row| {
            for column in values.chunks_exact(n) {
                for (r, v) in row.iter_mut().zip(&column[first..]) {
                    *r = larger(*r, v.abs());
                }
            }
        });
        invert_all(&mut self.row)?;
        let row = &self.row;
        parallel::parts(&mut self.col, size, &|first, col| {
            for (c, column) in col.iter_mut().zip(values[first * n..].chunks_exact(n)) {
                *c = max_abs_scaled(column, row);
            }
        });
        invert_all(&mut self.col)?;
        self.regular = true;
        Ok(())
    }

    /// Whether no row or column was found empty.
    pub(super) fn is_regular(&self) -> bool {
        self.regular
    }

    pub(super) fn row(&self) -> &[f64] {
        &self.row
    }

    pub(crate) fn col(&self) -> &[f64] {
        &self.col
    }

    /// ln |det A| - ln |det S|.
    pub(super) fn ln_det(&self) -> f64 {
        let exponents: i64 = (self.row.iter().chain(&self.col))
            .map(|f| 1023 - (f.to_bits() >> 52) as i64)
            .sum();
        exponents as f64 * std::f64::consts::LN_2
    }
}

/// Multiplies each column of the block `b` by `factors`, entry by entry.
pub(super) fn scale_columns(b: &mut [f64], factors: &[f64]) {
    if factors.is_empty() {
        return;
    }
    for column in b.chunks_exact_mut(factors.len()) {
        for (b, f) in column.iter_mut().zip(factors) {
            *b *= f;
        }
    }
}

/// The maximum of finite numbers: cheaper than `f64::max`, which handles NaN.
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// Adds v to u where the column has an entry that is not zero.
fn add_to_rows(rows: &[usize], values: &[f64], v: f64, u: &mut [f64]) {
    if rows.len() == u.len() {
        for (u, a) in u.iter_mut().zip(values) {
            *u += if *a == 0.0 { 0.0 } else { v };
        }
    } else {
        for (&i, a) in rows.iter().zip(values) {
            u[i] += if *a == 0.0 { 0.0 } else { v };
        }
    }
}

/// The sum of u where the column has an entry that is not zero.
fn sum_of_rows(rows: &[usize], values: &[f64], u: &[f64]) -> f64 {
    let at = |a: f64, u: f64| if a == 0.0 { 0.0 } else { u };
    if rows.len() != u.len() {
        return rows.iter().zip(values).map(|(&i, a)| at(*a, u[i])).sum();
    }
    let (values, values_left) = values.as_chunks::<8>();
    let (u, u_left) = u.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, u) in values.iter().zip(u) {
        for k in 0..8 {
            sums[k] += at(a[k], u[k]);
        }
    }
    let left = values_left.iter().zip(u_left).map(|(a, u)| at(*a, *u));
    sums.iter().sum::<f64>() + left.sum::<f64>()
}

fn invert_all(maxima: &mut [f64]) -> Result<(), LinearError> {
    let mut regular = true;
    for m in maxima {
        regular &= *m > 0.0;
        // 2^-e of the leading power 2^e of m, kept a normal number.
        let exponent = ((m.to_bits() >> 52) & 0x7ff).clamp(1, 2045);
        *m = f64::from_bits((2046 - exponent) << 52);
    }
    if regular {
        Ok(())
    } else {
        Err(LinearError::Singular { rcond: 0.0 })
    }
}
