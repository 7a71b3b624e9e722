use super::row_updates::is_far_from_one;
use super::{Bordered, LinearError, LinearSolver};
use crate::sparse::dot;

/// The inverse of [∇H; tᵀ] for a small ∇H: Sherman–Morrison, O(n²) operations a row that is replaced.
#[derive(Debug, Clone)]
pub(super) struct RowInverse {
    order: usize,
    /// Column-major.
    entries: Vec<f64>,
    weights: Vec<f64>,
    column: Vec<f64>,
}

impl RowInverse {
    pub(super) fn new<L: LinearSolver>(bordered: &mut Bordered<L>) -> Result<Self, LinearError> {
        let order = bordered.tangent().len();
        let mut entries = vec![0.0; order * order];
        bordered.inverse(&mut entries)?;
        Ok(Self {
            order,
            entries,
            weights: vec![0.0; order],
            column: vec![0.0; order],
        })
    }

    /// Adds `change` to row i: B' = B + eᵢ dᵀ. Returns the factor by which the determinant changes; `None` where too many digits would be
    /// lost.
    pub(super) fn add_to_row(&mut self, i: usize, change: &[f64]) -> Option<f64> {
        let m = self.order;
        for (w, column) in self.weights.iter_mut().zip(self.entries.chunks_exact(m)) {
            *w = dot(change, column);
        }
        let pivot = 1.0 + self.weights[i];
        if is_far_from_one(pivot) {
            return None;
        }
        self.column.copy_from_slice(&self.entries[i * m..(i + 1) * m]);
        for (w, target) in self.weights.iter().zip(self.entries.chunks_exact_mut(m)) {
            if *w != 0.0 {
                let factor = w / pivot;
                for (v, c) in target.iter_mut().zip(&self.column) {
                    *v -= factor * c;
                }
            }
        }
        Some(pivot)
    }

    /// The kernel of ∇H.
    pub(super) fn kernel(&self) -> &[f64] {
        &self.entries[(self.order - 1) * self.order..]
    }

    /// x ← x − [∇H; tᵀ]⁻¹ [r; 0].
    pub(super) fn correct(&self, r: &[f64], x: &mut [f64]) {
        for (column, r) in self.entries.chunks_exact(self.order).zip(r) {
            if *r != 0.0 {
                x.iter_mut().zip(column).for_each(|(x, c)| *x -= r * c);
            }
        }
    }
}
