use crate::linear::{DenseLu, LinearError, LinearSolver};
use crate::sparse::{Matrix, dot};

/// Rows of the inverse with fewer entries than this part of n are updated by index.
const SPARSE_ROW: usize = 4;

/// The inverse of a basis, by rows, kept up to date while columns of the basis are exchanged.
#[derive(Debug, Clone, Default)]
pub(super) struct Basis {
    n: usize,
    inverse: Vec<f64>,
    places: Vec<usize>,
    pivot_row: Vec<f64>,
    /// For recomputing the inverse.
    solver: DenseLu,
}

impl Basis {
    /// The identity of order n; allocates only where n has grown.
    pub(super) fn reset(&mut self, n: usize) {
        self.n = n;
        self.inverse.clear();
        self.inverse.resize(n * n, 0.0);
        for k in 0..n {
            self.inverse[k * n + k] = 1.0;
        }
        self.pivot_row.resize(n, 0.0);
        self.places.clear();
        self.places.reserve(n);
    }

    pub(super) fn row(&self, k: usize) -> &[f64] {
        &self.inverse[k * self.n..(k + 1) * self.n]
    }

    /// y ← scale · B⁻¹ e_i.
    pub(super) fn column(&self, i: usize, scale: f64, y: &mut [f64]) {
        for (y, row) in y.iter_mut().zip(self.inverse.chunks_exact(self.n)) {
            *y = scale * row[i];
        }
    }

    /// y ← B⁻¹ a.
    pub(super) fn apply(&self, a: &[f64], y: &mut [f64]) {
        for (y, row) in y.iter_mut().zip(self.inverse.chunks_exact(self.n)) {
            *y = dot(row, a);
        }
    }

    /// y ← B⁻¹ a for a column with few entries.
    pub(super) fn apply_sparse(&self, rows: &[usize], values: &[f64], scale: f64, y: &mut [f64]) {
        for (y, row) in y.iter_mut().zip(self.inverse.chunks_exact(self.n)) {
            *y = scale * rows.iter().zip(values).map(|(&i, v)| row[i] * v).sum::<f64>();
        }
    }

    /// The column of slot `p` is replaced by one with B⁻¹ a = y.
    pub(super) fn exchange(&mut self, p: usize, y: &[f64]) {
        let n = self.n;
        self.pivot_row.copy_from_slice(&self.inverse[p * n..(p + 1) * n]);
        self.places.clear();
        for (j, v) in self.pivot_row.iter_mut().enumerate() {
            *v /= y[p];
            if *v != 0.0 {
                self.places.push(j);
            }
        }
        let sparse = self.places.len() * SPARSE_ROW < n;
        for (k, row) in self.inverse.chunks_exact_mut(n).enumerate() {
            if k == p {
                row.copy_from_slice(&self.pivot_row);
            } else if y[k] != 0.0 {
                let c = y[k];
                if sparse {
                    self.places.iter().for_each(|&j| row[j] -= c * self.pivot_row[j]);
                } else {
                    row.iter_mut().zip(&self.pivot_row).for_each(|(v, r)| *v -= c * r);
                }
            }
        }
    }

    /// Recomputes the inverse from `basis` (full pattern).
    pub(super) fn factor(&mut self, basis: &Matrix) -> Result<(), LinearError> {
        let n = self.n;
        self.solver.analyze(basis.pattern().as_ref())?;
        self.solver.factor(basis.as_ref())?;
        // The columns of B⁻ᵀ are the rows of B⁻¹.
        self.inverse.fill(0.0);
        for k in 0..n {
            self.inverse[k * n + k] = 1.0;
        }
        self.solver.solve_transpose_in_place(&mut self.inverse)
    }
}
