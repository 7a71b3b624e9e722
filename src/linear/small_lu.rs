use std::fmt;
use std::mem::MaybeUninit;

use super::dense_lu::{BLOCKED, Factors, eliminate_blocked, eliminate_small, scratch_bytes};
use crate::sparse::max_abs;
use crate::tolerances::LEFT;

/// LU with partial pivoting of a small dense matrix whose order changes from call to call; no scaling, no condition estimate, no
/// allocation up to the largest order seen. Meant for the reduced systems of active-set methods, which are equilibrated.
#[derive(Clone, Default)]
pub(crate) struct SmallLu {
    order: usize,
    /// Column-major.
    entries: Vec<f64>,
    exchanged: Vec<usize>,
    /// From order `BLOCKED` on `exchanged` is the permutation, and this its inverse.
    inverse: Vec<usize>,
    scratch: Vec<MaybeUninit<u8>>,
    odd: bool,
    /// Largest modulus in each column before elimination.
    largest: Vec<f64>,
}

impl SmallLu {
    /// A zeroed matrix of order k to be filled, column-major.
    pub(crate) fn matrix(&mut self, k: usize) -> &mut [f64] {
        self.order = k;
        self.entries.clear();
        self.entries.resize(k * k, 0.0);
        &mut self.entries
    }

    /// Factors what [`matrix`](Self::matrix) was filled with; `false` when it is singular or not finite.
    pub(crate) fn factor(&mut self) -> bool {
        let k = self.order;
        self.exchanged.clear();
        self.exchanged.resize(k, 0);
        self.largest.clear();
        let columns = self.entries.chunks_exact(k.max(1));
        self.largest.extend(columns.map(max_abs));
        if k >= BLOCKED {
            self.inverse.clear();
            self.inverse.resize(k, 0);
            let needed = scratch_bytes(k).max(self.scratch.len());
            self.scratch.resize(needed, MaybeUninit::uninit());
            let (exchanged, inverse) = (&mut self.exchanged, &mut self.inverse);
            self.odd = eliminate_blocked(k, &mut self.entries, exchanged, inverse, &mut self.scratch);
        } else {
            let Some(odd) = eliminate_small(k, &mut self.entries, &mut self.exchanged) else {
                return false;
            };
            self.odd = odd;
        }
        // Written so that NaN fails.
        self.largest.iter().enumerate().all(|(j, largest)| {
            let pivot = self.entries[j * k + j];
            pivot.abs() > LEFT * largest && pivot.is_finite()
        })
    }

    /// Sign and natural logarithm of |det A|.
    pub(crate) fn log_det(&self) -> (i8, f64) {
        let pivots = self.entries.iter().step_by(self.order + 1);
        pivots.fold((if self.odd { -1 } else { 1 }, 0.0), |(sign, log), pivot| {
            (if *pivot < 0.0 { -sign } else { sign }, log + pivot.abs().ln())
        })
    }

    /// Overwrites b by A⁻¹ b.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        let factors = Factors {
            n: self.order,
            lu: &self.entries,
            perm: &self.exchanged,
            perm_inv: &self.inverse,
        };
        factors.solve(b, false, &mut self.scratch);
    }
}

impl fmt::Debug for SmallLu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SmallLu")
            .field("order", &self.order)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::SmallLu;

    #[test]
    fn solves_after_exchanges_of_rows() {
        let a = [[0.0, 2.0, 1.0], [1.0, 1.0, 4.0], [3.0, -1.0, 0.5]];
        let x = [1.0, -2.0, 3.0];
        let mut lu = SmallLu::default();
        let m = lu.matrix(3);
        for (i, row) in a.iter().enumerate() {
            for (j, v) in row.iter().enumerate() {
                m[j * 3 + i] = *v;
            }
        }
        assert!(lu.factor());
        let mut b: Vec<f64> = a
            .iter()
            .map(|r| r.iter().zip(&x).map(|(a, x)| a * x).sum())
            .collect();
        lu.solve(&mut b);
        for (b, x) in b.iter().zip(&x) {
            assert!((b - x).abs() < 1e-14);
        }
        // By the rule of Sarrus: 24 - 1 - 3 - 1.
        let (sign, log) = lu.log_det();
        assert_eq!(sign, 1);
        assert!((log - 19.0_f64.ln()).abs() < 1e-14);
        let m = lu.matrix(2);
        m.copy_from_slice(&[1.0, 2.0, 2.0, 4.0]);
        assert!(!lu.factor());
    }
}
