use crate::linear::RowsRef;
use crate::sparse::MatrixRef;

/// A square matrix by columns, with long or short indices.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Columns<'a> {
    Long(MatrixRef<'a>),
    /// A symmetric matrix by rows.
    Short(RowsRef<'a>),
}

impl Columns<'_> {
    /// Hands out the entries of column j, row and value.
    #[inline(always)]
    pub(crate) fn each(self, j: usize, mut take: impl FnMut(usize, f64)) {
        match self {
            Self::Long(a) => {
                let span = a.pattern.col_ptr[j]..a.pattern.col_ptr[j + 1];
                for (&i, &v) in a.pattern.row_idx[span.clone()].iter().zip(&a.values[span]) {
                    take(i, v);
                }
            }
            Self::Short(a) => {
                let (rows, values) = a.row(j);
                for (&i, &v) in rows.iter().zip(values) {
                    take(i as usize, v);
                }
            }
        }
    }

    /// Adds M x to y.
    pub(crate) fn mul_add(self, x: &[f64], y: &mut [f64]) {
        match self {
            Self::Long(a) => a.mul_add(1.0, x, y),
            Self::Short(_) => {
                for (j, &x) in x.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                    self.each(j, |i, v| y[i] += x * v);
                }
            }
        }
    }
}
