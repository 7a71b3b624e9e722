//! A box LCP as its solvers read it.

use super::Lcp;
use super::problem::natural;
use crate::judge::Columns;

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
