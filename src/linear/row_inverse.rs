use super::{Bordered, LinearError, LinearSolver};
use crate::sparse::{Matrix, dot};

/// Change of the determinant by one row below which the update would lose too many digits.
const SMALL_PIVOT: f64 = 1e-7;
/// Updates after which the inverse is made anew, at least; so many as there are rows cost as much as making it anew.
const MAX_UPDATES: usize = 100;
/// Residual of the tangent, relative to the entries of ∇H, above which the inverse has decayed.
const DECAY: f64 = 1e-10;

/// The inverse of [∇H; tᵀ] for a small dense ∇H, kept up to date while rows of ∇H are replaced (Sherman–Morrison).
///
/// A change of the piece at one site replaces the few rows of that site: O(n²) operations a row instead of a factorisation.
/// Every update is checked by the residual of the tangent it gives.
#[derive(Debug, Clone)]
pub(crate) struct RowInverse {
    order: usize,
    /// Row-major rows of ∇H.
    rows: Vec<f64>,
    /// Largest modulus in each row.
    sizes: Vec<f64>,
    border: Vec<f64>,
    /// Column-major inverse.
    inverse: Vec<f64>,
    /// Sign and logarithm of |det [∇H; tᵀ]|.
    det: (i8, f64),
    tangent: Vec<f64>,
    weights: Vec<f64>,
    column: Vec<f64>,
    updates: usize,
}

impl RowInverse {
    /// The inverse of the system factored in `bordered`, bordered by its tangent. `None` without determinants.
    pub(crate) fn new<L: LinearSolver>(
        jacobian: &Matrix,
        bordered: &mut Bordered<L>,
    ) -> Result<Option<Self>, LinearError> {
        let Some(det) = bordered.log_det() else {
            return Ok(None);
        };
        let n = jacobian.nrows();
        let order = n + 1;
        let border = bordered.tangent().to_vec();
        let mut rows = vec![0.0; n * order];
        for (i, j, v) in jacobian.triplets() {
            rows[i * order + j] = v;
        }
        let sizes = rows
            .chunks_exact(order)
            .map(|r| r.iter().fold(0.0, |m: f64, v| m.max(v.abs())))
            .collect();
        let mut inverse = vec![0.0; order * order];
        bordered.inverse(&mut inverse)?;
        Ok(Some(Self {
            order,
            rows,
            sizes,
            tangent: border.clone(),
            border,
            inverse,
            det,
            weights: vec![0.0; order],
            column: vec![0.0; order],
            updates: 0,
        }))
    }

    /// Replaces the given rows of ∇H by those of `jacobian`; false when the result is not to be trusted, and the inverse with it.
    pub(crate) fn replace(&mut self, jacobian: &Matrix, rows: &[usize]) -> bool {
        self.updates += 1;
        if self.updates > MAX_UPDATES.max(self.order) {
            return false;
        }
        for &i in rows {
            if !self.replace_row(jacobian, i) {
                return false;
            }
        }
        let last = &self.inverse[(self.order - 1) * self.order..];
        self.tangent.copy_from_slice(last);
        self.normalise() && self.refine() && self.normalise()
    }

    fn normalise(&mut self) -> bool {
        let length = dot(&self.tangent, &self.tangent).sqrt();
        self.tangent.iter_mut().for_each(|t| *t /= length);
        length.is_finite() && length > 0.0
    }

    /// One step of iterative refinement of the tangent; false when its residual shows that the inverse has decayed.
    fn refine(&mut self) -> bool {
        let m = self.order;
        let mut worst = 0.0f64;
        for (i, row) in self.rows.chunks_exact(m).enumerate() {
            let sum = dot(row, &self.tangent);
            self.column[i] = sum;
            if self.sizes[i] > 0.0 {
                worst = worst.max(sum.abs() / self.sizes[i]);
            }
        }
        for (column, r) in self.inverse.chunks_exact(m).zip(&self.column[..m - 1]) {
            self.tangent.iter_mut().zip(column).for_each(|(t, c)| *t -= r * c);
        }
        worst <= DECAY
    }

    fn replace_row(&mut self, jacobian: &Matrix, i: usize) -> bool {
        let m = self.order;
        // d = new row − old row; B' = B + eᵢ dᵀ.
        let row = &mut self.rows[i * m..(i + 1) * m];
        let mut size = 0.0f64;
        let strided = jacobian.pattern().is_full().then(|| jacobian.values());
        for (j, (old, d)) in row.iter_mut().zip(self.column.iter_mut()).enumerate() {
            let new = match strided {
                Some(values) => values[j * (m - 1) + i],
                None => jacobian.get(i, j),
            };
            size = size.max(new.abs());
            *d = new - *old;
            *old = new;
        }
        self.sizes[i] = size;
        if self.column.iter().all(|d| *d == 0.0) {
            return true;
        }
        for (k, w) in self.weights.iter_mut().enumerate() {
            let column = &self.inverse[k * m..(k + 1) * m];
            *w = dot(&self.column, column);
        }
        let pivot = 1.0 + self.weights[i];
        if !pivot.is_finite() || pivot.abs() < SMALL_PIVOT || pivot.abs() > 1.0 / SMALL_PIVOT || size == 0.0 {
            return false;
        }
        if pivot < 0.0 {
            self.det.0 = -self.det.0;
        }
        self.det.1 += pivot.abs().ln();
        self.column.copy_from_slice(&self.inverse[i * m..(i + 1) * m]);
        for (k, w) in self.weights.iter().enumerate() {
            if *w != 0.0 {
                let factor = w / pivot;
                let target = &mut self.inverse[k * m..(k + 1) * m];
                for (v, c) in target.iter_mut().zip(&self.column) {
                    *v -= factor * c;
                }
            }
        }
        true
    }

    /// The unit kernel vector of ∇H; det [∇H; τᵀ] and the border fix its sign.
    pub(crate) fn tangent(&self) -> &[f64] {
        &self.tangent
    }

    /// x ← x − [∇H; tᵀ]⁻¹ [r; 0].
    pub(crate) fn correct(&self, r: &[f64], x: &mut [f64]) {
        for (column, r) in self.inverse.chunks_exact(self.order).zip(r) {
            if *r != 0.0 {
                x.iter_mut().zip(column).for_each(|(x, c)| *x -= r * c);
            }
        }
    }

    /// Sign of det [∇H; vᵀ]: that of [∇H; tᵀ] is known, and both are proportional to the component along the kernel.
    pub(crate) fn orientation(&self, v: &[f64]) -> i8 {
        let along = |w: &[f64]| dot(w, &self.tangent);
        let product = along(v) * along(&self.border);
        if product == 0.0 {
            0
        } else if product > 0.0 {
            self.det.0
        } else {
            -self.det.0
        }
    }

    /// Logarithm of |det [∇H; τᵀ]|, with the unit tangent as border.
    pub(crate) fn log_det(&self) -> f64 {
        let along = dot(&self.border, &self.tangent);
        self.det.1 - along.abs().ln()
    }
}
