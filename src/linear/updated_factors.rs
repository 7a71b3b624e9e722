use super::{Bordered, LinearError, LinearSolver, SmallLu};
use crate::sparse::dot;

/// Solves with B + E D, the [∇H; tᵀ] in which some rows differ from those of the factored B, by the factors of B (Woodbury). Two solves a
/// row that is replaced.
#[derive(Debug, Clone)]
pub(super) struct UpdatedFactors {
    border: Vec<f64>,
    /// Sign and logarithm of |det B|.
    det: (i8, f64),
    /// Rows that differ.
    rows: Vec<usize>,
    /// D, a row of it at a time.
    changes: Vec<f64>,
    /// B⁻¹ E, column-major.
    columns: Vec<f64>,
    /// D B⁻¹ E, a row of it every `limit` entries.
    products: Vec<f64>,
    limit: usize,
    /// I + D B⁻¹ E.
    small: SmallLu,
    weights: Vec<f64>,
    step: Vec<f64>,
    /// Scratch of solves.
    block: Vec<f64>,
}

impl UpdatedFactors {
    /// `limit`: the most rows that may differ.
    pub(super) fn new<L: LinearSolver>(bordered: &Bordered<L>, det: (i8, f64), limit: usize) -> Self {
        let border = bordered.tangent().to_vec();
        Self {
            step: vec![0.0; border.len()],
            block: Vec::new(),
            border,
            det,
            rows: Vec::new(),
            changes: Vec::new(),
            columns: Vec::new(),
            products: vec![0.0; limit * limit],
            limit,
            small: SmallLu::default(),
            weights: Vec::with_capacity(limit),
        }
    }

    /// Adds `changes`, one after another, to different rows; `false` where there are too many of them.
    pub(super) fn add_to_rows<L: LinearSolver>(
        &mut self,
        rows: &[usize],
        changes: &[f64],
        bordered: &mut Bordered<L>,
    ) -> Result<bool, LinearError> {
        let (m, limit) = (self.border.len(), self.limit);
        let known = self.rows.len();
        for (&i, change) in rows.iter().zip(changes.chunks_exact(m)) {
            if change.iter().all(|d| *d == 0.0) {
                continue;
            }
            if let Some(place) = self.rows[..known].iter().position(|row| *row == i) {
                let known = &mut self.changes[place * m..(place + 1) * m];
                known.iter_mut().zip(change).for_each(|(d, c)| *d += c);
            } else {
                self.rows.push(i);
                self.changes.extend_from_slice(change);
            }
        }
        let new = &self.rows[known..];
        if self.rows.len() > limit {
            return Ok(false);
        }
        if !new.is_empty() {
            self.columns.resize(self.rows.len() * m, 0.0);
            let columns = &mut self.columns[known * m..];
            bordered.solve_units(new, &self.border, columns, &mut self.block)?;
        }
        for (place, d) in self.changes.chunks_exact(m).enumerate() {
            let first = if rows.contains(&self.rows[place]) {
                0
            } else {
                known
            };
            let products = &mut self.products[place * limit..][first..self.rows.len()];
            for (product, column) in products.iter_mut().zip(self.columns[first * m..].chunks_exact(m)) {
                *product = dot(d, column);
            }
        }
        Ok(true)
    }

    /// Prepares solves with the changes since the last call; returns sign and logarithm of the modulus of the determinant, `None` where it
    /// is 0.
    pub(super) fn factor(&mut self) -> Option<(i8, f64)> {
        let k = self.rows.len();
        let matrix = self.small.matrix(k);
        for (j, column) in matrix.chunks_exact_mut(k.max(1)).enumerate() {
            for (i, v) in column.iter_mut().enumerate() {
                *v = self.products[i * self.limit + j] + f64::from(i == j);
            }
        }
        let det = self.small.factor().then(|| self.small.log_det())?;
        Some((self.det.0 * det.0, self.det.1 + det.1))
    }

    /// The kernel of ∇H.
    pub(super) fn kernel(&mut self, out: &mut [f64]) {
        out.copy_from_slice(&self.border);
        self.complete(out);
    }

    /// x ← x − [∇H; tᵀ]⁻¹ [r; 0].
    pub(super) fn correct<L: LinearSolver>(
        &mut self,
        r: &[f64],
        x: &mut [f64],
        bordered: &mut Bordered<L>,
    ) -> Result<(), LinearError> {
        let mut step = std::mem::take(&mut self.step);
        let solved = bordered.solve(r, &self.border, 0.0, &mut step);
        if solved.is_ok() {
            self.complete(&mut step);
            x.iter_mut().zip(&step).for_each(|(x, d)| *x -= d);
        }
        self.step = step;
        solved
    }

    /// Turns y = B⁻¹ b into (B + E D)⁻¹ b.
    fn complete(&mut self, y: &mut [f64]) {
        let m = self.border.len();
        self.weights.clear();
        let weights = self.changes.chunks_exact(m).map(|d| dot(d, y));
        self.weights.extend(weights);
        self.small.solve(&mut self.weights);
        for (w, column) in self.weights.iter().zip(self.columns.chunks_exact(m)) {
            y.iter_mut().zip(column).for_each(|(y, c)| *y -= w * c);
        }
    }
}
