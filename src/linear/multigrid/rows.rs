use std::sync::Arc;

use crate::sparse::MatrixRef;

/// A matrix by rows, columns increasing in each, with short indices: what smoothers run over. Clones share their arrays until values
/// are written.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    ncols: usize,
    start: Arc<Vec<u32>>,
    col: Arc<Vec<u32>>,
    value: Arc<Vec<f64>>,
}

/// The arrays of [`Rows`], for loops.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowsRef<'a> {
    pub(super) start: &'a [u32],
    pub(super) col: &'a [u32],
    pub(crate) value: &'a [f64],
}

impl<'a> RowsRef<'a> {
    #[inline(always)]
    pub(super) fn span(self, i: usize) -> std::ops::Range<usize> {
        self.start[i] as usize..self.start[i + 1] as usize
    }

    #[inline(always)]
    pub(crate) fn row(self, i: usize) -> (&'a [u32], &'a [f64]) {
        let span = self.span(i);
        (&self.col[span.clone()], &self.value[span])
    }

    /// Row i times x.
    #[inline(always)]
    pub(super) fn dot(self, i: usize, x: &[f64]) -> f64 {
        let (cols, values) = self.row(i);
        cols.iter().zip(values).map(|(&j, v)| v * x[j as usize]).sum()
    }
}

impl Rows {
    pub(super) fn new(ncols: usize, start: Vec<u32>, col: Vec<u32>, value: Vec<f64>) -> Self {
        Self {
            ncols,
            start: Arc::new(start),
            col: Arc::new(col),
            value: Arc::new(value),
        }
    }

    /// The transpose of a matrix in compressed columns: its columns are our rows.
    pub(crate) fn transposed(a: MatrixRef<'_>) -> Self {
        Self::new(
            a.pattern.nrows,
            a.pattern.col_ptr.iter().map(|&p| p as u32).collect(),
            a.pattern.row_idx.iter().map(|&i| i as u32).collect(),
            a.values.to_vec(),
        )
    }

    pub(crate) fn nrows(&self) -> usize {
        self.start.len() - 1
    }

    #[inline]
    pub(crate) fn view(&self) -> RowsRef<'_> {
        RowsRef {
            start: &self.start,
            col: &self.col,
            value: &self.value,
        }
    }

    /// Starts, columns and, for writing, values.
    pub(super) fn parts_mut(&mut self) -> (&[u32], &[u32], &mut [f64]) {
        let value = Arc::make_mut(&mut self.value);
        (&self.start, &self.col, value)
    }

    pub(super) fn transpose(&self) -> Self {
        let a = self.view();
        let mut start = vec![0_u32; self.ncols + 1];
        for &j in a.col {
            start[j as usize + 1] += 1;
        }
        for j in 0..self.ncols {
            start[j + 1] += start[j];
        }
        let mut next = start.clone();
        let mut col = vec![0; a.col.len()];
        let mut value = vec![0.0; a.col.len()];
        for i in 0..self.nrows() {
            for k in a.span(i) {
                let slot = &mut next[a.col[k] as usize];
                col[*slot as usize] = i as u32;
                value[*slot as usize] = a.value[k];
                *slot += 1;
            }
        }
        Self::new(self.nrows(), start, col, value)
    }
}
