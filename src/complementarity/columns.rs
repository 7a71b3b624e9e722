//! A box LCP as its solvers read it: M by columns, with long or short indices.

use super::Lcp;
use super::problem::natural;
use crate::linear::RowsRef;
use crate::sparse::MatrixRef;

/// A square matrix by columns.
#[derive(Debug, Clone, Copy)]
pub(super) enum Columns<'a> {
    Long(MatrixRef<'a>),
    /// A symmetric matrix by rows.
    Short(RowsRef<'a>),
}

impl Columns<'_> {
    /// Hands out the entries of column j, row and value.
    #[inline(always)]
    pub(super) fn each(self, j: usize, mut take: impl FnMut(usize, f64)) {
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
    fn mul_add(self, x: &[f64], y: &mut [f64]) {
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

/// Find l ≤ z ≤ u with the signs of w = M z + q that belong to its bounds; see [`Lcp`].
#[derive(Debug, Clone, Copy)]
pub(super) struct BoxLcp<'a> {
    pub(super) matrix: Columns<'a>,
    pub(super) q: &'a [f64],
    pub(super) lower: &'a [f64],
    pub(super) upper: &'a [f64],
}

impl BoxLcp<'_> {
    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.q.len()
    }

    /// w = M z + q.
    pub(super) fn value(&self, z: &[f64], w: &mut [f64]) {
        w.copy_from_slice(self.q);
        self.matrix.mul_add(z, w);
    }

    /// Overwrites z by the point within the bounds that is nearest to zero.
    pub(super) fn nearest_to_zero(&self, z: &mut [f64]) {
        for ((z, l), u) in z.iter_mut().zip(self.lower).zip(self.upper) {
            *z = 0.0_f64.max(*l).min(*u);
        }
    }

    /// The largest natural residual, given w = M z + q.
    pub(super) fn natural_residual(&self, z: &[f64], w: &[f64]) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..z.len() {
            let r = natural(z[i], self.lower[i], self.upper[i], w[i]).abs();
            if r > worst || r.is_nan() {
                worst = r;
            }
        }
        worst
    }
}

impl<'a> From<&'a Lcp> for BoxLcp<'a> {
    fn from(lcp: &'a Lcp) -> Self {
        Self {
            matrix: Columns::Long(lcp.matrix().as_ref()),
            q: lcp.q(),
            lower: lcp.lower(),
            upper: lcp.upper(),
        }
    }
}
