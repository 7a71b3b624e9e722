//! Sparse matrices of small dense blocks.

use super::SparseError;
use crate::parallel;

/// Rows that one thread takes at a time.
pub(crate) const ROWS: usize = 1024;

/// A sparse matrix of R × C blocks, by block rows: half the memory of single entries, and products without a look-up for each.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Blocks<const R: usize, const C: usize> {
    pub(crate) ncols: usize,
    /// Row i owns the blocks `start[i]..start[i + 1]`.
    pub(crate) start: Vec<usize>,
    /// Column of each block, increasing in a row.
    pub(crate) col: Vec<u32>,
    pub(crate) value: Vec<[[f64; C]; R]>,
}

impl<const R: usize, const C: usize> Blocks<R, C> {
    pub(crate) fn new(ncols: usize) -> Self {
        Self {
            ncols,
            start: vec![0],
            col: Vec::new(),
            value: Vec::new(),
        }
    }

    pub(crate) fn nrows(&self) -> usize {
        self.start.len() - 1
    }

    /// Columns and blocks of a row.
    #[inline]
    pub(crate) fn row(&self, i: usize) -> (&[u32], &[[[f64; C]; R]]) {
        let span = self.start[i]..self.start[i + 1];
        (&self.col[span.clone()], &self.value[span])
    }

    /// Place of a block among the values.
    pub(crate) fn slot(&self, i: usize, j: usize) -> Option<usize> {
        let first = self.start[i];
        let cols = &self.col[first..self.start[i + 1]];
        cols.binary_search(&(j as u32)).ok().map(|k| first + k)
    }

    /// As [`Matrix::check_finite`](super::Matrix::check_finite), of the entries by component.
    pub(crate) fn check_finite(&self) -> Result<(), SparseError> {
        for i in 0..self.nrows() {
            let (cols, values) = self.row(i);
            for (&j, block) in cols.iter().zip(values) {
                for (e, &value) in block.as_flattened().iter().enumerate() {
                    if !value.is_finite() {
                        let (row, col) = (R * i + e / C, C * j as usize + e % C);
                        return Err(SparseError::NotFinite { row, col, value });
                    }
                }
            }
        }
        Ok(())
    }

    /// y ← A x.
    pub(crate) fn mul(&self, x: &[f64], y: &mut [f64]) {
        self.for_products(x, y, &|_, sum, y| *y = sum);
    }

    /// Calls `put` with each row, its entries of A x, and those of y.
    pub(crate) fn for_products(
        &self,
        x: &[f64],
        y: &mut [f64],
        put: &(impl Fn(usize, [f64; R], &mut [f64; R]) + Sync),
    ) {
        let x = x.as_chunks::<C>().0;
        parallel::parts(y.as_chunks_mut::<R>().0, ROWS, &|first, y| {
            for (i, y) in (first..).zip(y) {
                let (cols, values) = self.row(i);
                let mut sum = [0.0; R];
                for (&j, block) in cols.iter().zip(values) {
                    add_product(block, &x[j as usize], &mut sum);
                }
                put(i, sum, y);
            }
        });
    }
}

/// y += M x.
#[inline(always)]
pub(crate) fn add_product<const R: usize, const C: usize>(m: &[[f64; C]; R], x: &[f64; C], y: &mut [f64; R]) {
    for a in 0..R {
        for b in 0..C {
            y[a] += m[a][b] * x[b];
        }
    }
}

/// y −= Mᵀ x.
#[inline(always)]
pub(crate) fn subtract_transposed<const R: usize, const C: usize>(
    m: &[[f64; C]; R],
    x: &[f64; R],
    y: &mut [f64; C],
) {
    for a in 0..R {
        for b in 0..C {
            y[b] -= m[a][b] * x[a];
        }
    }
}
