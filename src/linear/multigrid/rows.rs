use crate::sparse::MatrixRef;

/// A matrix by rows, columns increasing in each, with short indices: what smoothers run over.
#[derive(Debug, Clone, Default)]
pub(super) struct Rows {
    pub(super) ncols: usize,
    pub(super) start: Vec<u32>,
    pub(super) col: Vec<u32>,
    pub(super) value: Vec<f64>,
}

impl Rows {
    /// The transpose of a matrix in compressed columns: its columns are our rows.
    pub(super) fn transposed(a: MatrixRef<'_>) -> Self {
        Self {
            ncols: a.pattern.nrows,
            start: a.pattern.col_ptr.iter().map(|&p| p as u32).collect(),
            col: a.pattern.row_idx.iter().map(|&i| i as u32).collect(),
            value: a.values.to_vec(),
        }
    }

    pub(super) fn nrows(&self) -> usize {
        self.start.len() - 1
    }

    #[inline]
    pub(super) fn span(&self, i: usize) -> std::ops::Range<usize> {
        self.start[i] as usize..self.start[i + 1] as usize
    }

    #[inline]
    pub(super) fn row(&self, i: usize) -> (&[u32], &[f64]) {
        let span = self.span(i);
        (&self.col[span.clone()], &self.value[span])
    }

    /// Row i times x.
    #[inline]
    pub(super) fn dot(&self, i: usize, x: &[f64]) -> f64 {
        let (cols, values) = self.row(i);
        cols.iter().zip(values).map(|(&j, v)| v * x[j as usize]).sum()
    }

    pub(super) fn transpose(&self) -> Self {
        let mut start = vec![0_u32; self.ncols + 1];
        for &j in &self.col {
            start[j as usize + 1] += 1;
        }
        for j in 0..self.ncols {
            start[j + 1] += start[j];
        }
        let mut next = start.clone();
        let mut col = vec![0; self.col.len()];
        let mut value = vec![0.0; self.col.len()];
        for i in 0..self.nrows() {
            for k in self.span(i) {
                let slot = &mut next[self.col[k] as usize];
                col[*slot as usize] = i as u32;
                value[*slot as usize] = self.value[k];
                *slot += 1;
            }
        }
        Self {
            ncols: self.nrows(),
            start,
            col,
            value,
        }
    }
}
