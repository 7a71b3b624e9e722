//! How far the entering variable can move: the lexicographic ratio test.

use super::{Lemke, Var};
use crate::complementarity::Lcp;
use crate::tolerances::{DOUBTFUL, LEFT};

/// What bounds the move of the entering variable.
pub(super) enum Block {
    Slot { slot: usize, step: f64, at_upper: bool },
    Flip { step: f64 },
    Nothing,
}

impl Lemke {
    /// How far `entering` can move, and what stops it.
    pub(super) fn ratio_test(&mut self, lcp: &Lcp, entering: Var, direction: f64) -> Block {
        let largest = self.entering.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let smallest_pivot = DOUBTFUL * largest;
        let mut least = f64::INFINITY;
        for k in 0..self.basic.len() {
            let rate = -direction * self.entering[k];
            // 0 marks slots that do not stop the move.
            self.rate[k] = 0.0;
            if rate.abs() <= smallest_pivot {
                continue;
            }
            let (lower, upper) = self.bounds(lcp, self.basic[k]);
            let room = if rate < 0.0 {
                self.value[k] - lower
            } else {
                upper - self.value[k]
            };
            if room.is_finite() {
                self.rate[k] = rate;
                let room = if room <= self.zero { 0.0 } else { room };
                let ratio = room / rate.abs();
                self.work[k] = ratio;
                least = least.min(ratio);
            }
        }
        let (lower, upper) = self.bounds(lcp, entering);
        let flip = match entering {
            Var::Point(_) => upper - lower,
            _ => f64::INFINITY,
        };
        if flip <= least {
            return if flip.is_finite() {
                Block::Flip { step: flip }
            } else {
                Block::Nothing
            };
        }
        // Ratios that differ by rounding only are ties; the lexicographic rule decides among them.
        let limit = least * (1.0 + LEFT);
        self.tied.clear();
        for k in 0..self.basic.len() {
            if self.rate[k] != 0.0 && self.work[k] <= limit {
                self.tied.push(k);
            }
        }
        let cover = self.tied.iter().position(|&k| self.is_last(self.basic[k]));
        let mut best = self.tied[cover.unwrap_or(0)];
        if cover.is_none() {
            for t in 1..self.tied.len() {
                let k = self.tied[t];
                if self.lexicographically_less((k, -self.rate[k]), (best, -self.rate[best])) {
                    best = k;
                }
            }
        }
        Block::Slot {
            slot: best,
            step: self.work[best],
            at_upper: self.rate[best] > 0.0,
        }
    }

    /// Whether the perturbed ratio of one slot is smaller than that of another, the unperturbed ones being equal. Slots come with
    /// the rate at which the distance to their bound shrinks, signed: positive towards a lower, negative towards an upper bound.
    pub(super) fn lexicographically_less(
        &self,
        (k, k_rate): (usize, f64),
        (p, p_rate): (usize, f64),
    ) -> bool {
        for ((a, b), sign) in self
            .basis
            .row(k)
            .iter()
            .zip(self.basis.row(p))
            .zip(&self.perturbation)
        {
            let (a, b) = (a / k_rate, b / p_rate);
            let difference = sign * (a - b);
            if difference.abs() > DOUBTFUL * a.abs().max(b.abs()) {
                return difference < 0.0;
            }
        }
        false
    }
}
