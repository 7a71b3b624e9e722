use super::LinearError;
use super::memory::check_finite;

/// Equilibration S = R A C by powers of two, so that the largest entry of every row and column of S lies near 1.
///
/// Pivots and condition numbers of S do not depend on the units of equations and unknowns, and scaling is exact.
#[derive(Clone, Default)]
pub(super) struct Scaling {
    row: Vec<f64>,
    col: Vec<f64>,
}

impl Scaling {
    pub(super) fn resize(&mut self, n: usize) {
        self.row.clear();
        self.row.resize(n, 1.0);
        self.col.clear();
        self.col.resize(n, 1.0);
    }

    /// Finds R and C; an empty row or column is a singularity. `entries` yields (row, column, value).
    pub(super) fn compute(
        &mut self,
        col_ptr: &[usize],
        row_idx: &[usize],
        values: &[f64],
    ) -> Result<(), LinearError> {
        check_finite(values, "the matrix")?;
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
        invert_all(&mut self.col)
    }

    /// As [`compute`](Self::compute), for a full matrix.
    pub(super) fn compute_full(&mut self, values: &[f64]) -> Result<(), LinearError> {
        check_finite(values, "the matrix")?;
        let n = self.row.len();
        self.row.fill(0.0);
        if n == 0 {
            return Ok(());
        }
        for column in values.chunks_exact(n) {
            for (r, v) in self.row.iter_mut().zip(column) {
                *r = r.max(v.abs());
            }
        }
        invert_all(&mut self.row)?;
        for (c, column) in self.col.iter_mut().zip(values.chunks_exact(n)) {
            *c = (self.row.iter().zip(column)).fold(0.0, |m: f64, (r, v)| m.max(v.abs() * r));
        }
        invert_all(&mut self.col)
    }

    pub(super) fn row(&self) -> &[f64] {
        &self.row
    }

    pub(super) fn col(&self) -> &[f64] {
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
