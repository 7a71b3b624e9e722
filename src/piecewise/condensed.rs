use std::sync::Arc;

use super::Selection;
use crate::linear::{CondensedRows, Hierarchical, RowSource};

/// Affine pieces in variables (λ, α) whose Jacobians are [−G C + H, g]: C is large, symmetric and the same for all selections, G and H have
/// few entries.
pub(crate) trait CondensedPieces {
    /// C, where it has a hierarchical form.
    fn hierarchical(&self) -> Option<&Arc<Hierarchical>>;

    /// Row k of C.
    fn row(&self, k: usize) -> &[f64];

    /// Replaces `rows` by G, H and g of a selection.
    fn rows(&self, selection: &Selection, rows: &mut CondensedRows);

    /// Replaces `out` by −C λ.
    fn motion(&self, lambda: &[f64], out: &mut [f64]);
}

/// Condensed pieces in scaled variables.
#[derive(Clone, Copy)]
pub struct Condensed<'a> {
    pub(crate) pieces: &'a dyn CondensedPieces,
    /// Sizes of the variables; empty for ones.
    pub(crate) sizes: &'a [f64],
}

/// The Jacobian of one selection of them.
pub(crate) struct CondensedJacobian<'a> {
    pub(crate) of: Condensed<'a>,
    pub(crate) rows: &'a CondensedRows,
    pub(crate) room: &'a mut CondensedRoom,
}

/// Scratch of products.
#[derive(Debug, Clone, Default)]
pub(crate) struct CondensedRoom {
    direction: Vec<f64>,
    motion: Vec<f64>,
}

impl CondensedJacobian<'_> {
    fn size(&self, k: usize) -> f64 {
        self.of.sizes.get(k).copied().unwrap_or(1.0)
    }

    /// For each row, a modulus that is at least that of an entry, and for rows of a definite C at least that of most.
    pub(crate) fn row_sizes(&self) -> Vec<f64> {
        let last = self.rows.parameter.len();
        let parameter = self.rows.parameter.iter();
        let mut sizes: Vec<f64> = parameter.map(|g| (g * self.size(last)).abs()).collect();
        for &(i, k, g) in &self.rows.traces {
            sizes[i] = sizes[i].max((g * self.of.pieces.row(k)[k] * self.size(k)).abs());
        }
        for &(i, k, h) in &self.rows.multipliers {
            sizes[i] = sizes[i].max((h * self.size(k)).abs());
        }
        sizes
    }

    /// Adds Σⱼ |Jᵢⱼ| sⱼ to each entry of `out`.
    pub(crate) fn add_term_sizes(&self, sizes: &[f64], out: &mut [f64]) {
        let scaled: Vec<f64> = (sizes.iter().enumerate())
            .map(|(k, s)| s * self.size(k))
            .collect();
        for &(i, k, g) in &self.rows.traces {
            let terms = self.of.pieces.row(k).iter().zip(&scaled);
            out[i] += g.abs() * terms.map(|(c, s)| c.abs() * s).sum::<f64>();
        }
        for &(i, k, h) in &self.rows.multipliers {
            out[i] += h.abs() * scaled[k];
        }
        if let Some(last) = scaled.last() {
            (out.iter_mut().zip(&self.rows.parameter)).for_each(|(out, g)| *out += g.abs() * last);
        }
    }
}

impl RowSource for CondensedJacobian<'_> {
    fn add_row(&mut self, scale: f64, i: usize, out: &mut [f64]) -> f64 {
        let row = &mut self.room.direction;
        row.clear();
        row.resize(out.len(), 0.0);
        for &(_, k, g) in self.rows.traces.iter().filter(|e| e.0 == i) {
            (row.iter_mut().zip(self.of.pieces.row(k))).for_each(|(v, c)| *v -= g * c);
        }
        for &(_, k, h) in self.rows.multipliers.iter().filter(|e| e.0 == i) {
            row[k] += h;
        }
        if let (Some(last), Some(g)) = (row.last_mut(), self.rows.parameter.get(i)) {
            *last += g;
        }
        row.iter_mut().zip(self.of.sizes).for_each(|(v, d)| *v *= d);
        out.iter_mut().zip(&*row).for_each(|(out, v)| *out += scale * v);
        row.iter().fold(0.0, |m, v| m.max(v.abs()))
    }

    fn add_product(&mut self, x: &[f64], out: &mut [f64]) {
        let CondensedRoom { direction, motion } = &mut *self.room;
        direction.clear();
        direction.extend_from_slice(x);
        direction.iter_mut().zip(self.of.sizes).for_each(|(v, d)| *v *= d);
        let Some((rate, lambda)) = direction.split_last() else {
            return;
        };
        motion.resize(lambda.len(), 0.0);
        self.of.pieces.motion(lambda, motion);
        for &(i, k, g) in &self.rows.traces {
            out[i] += g * motion[k];
        }
        for &(i, k, h) in &self.rows.multipliers {
            out[i] += h * lambda[k];
        }
        (out.iter_mut().zip(&self.rows.parameter)).for_each(|(out, g)| *out += g * rate);
    }
}
