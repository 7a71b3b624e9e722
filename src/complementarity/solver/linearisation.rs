//! ∇F at a point, in the units of the problem and equilibrated.

use crate::complementarity::McpFunction;
use crate::judge::equilibrate;
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::ROUNDING;

/// Factors of rows and columns lie between this and its reciprocal, except for rows whose value of F requires more.
const LEAST_FACTOR: f64 = 1e-8;

/// Factor by which rows may grow or shrink before they are equilibrated again.
const STALE: f64 = 1e3;

/// ∇F as evaluated, and R ∇F C + ε I with powers of two on the diagonals of R and C, each in its own matrix.
#[derive(Debug, Clone)]
pub(super) struct Linearisation {
    jac: Matrix,
    scaled: Matrix,
    row: Vec<f64>,
    col: Vec<f64>,
    max: Vec<f64>,
    /// Where ∇F is evaluated, if not at the iterate.
    point: Vec<f64>,
    /// ∇F at a point next to the iterate, and Σⱼ |∇Fᵢⱼ xⱼ| at both points; for functions that are not affine.
    beside: Option<Matrix>,
    terms: Vec<[f64; 2]>,
}

impl Linearisation {
    pub(super) fn new(pattern: Pattern) -> Self {
        let n = pattern.nrows();
        Self {
            jac: Matrix::zeros(pattern.clone()),
            scaled: Matrix::zeros(pattern),
            row: vec![1.0; n],
            col: vec![1.0; n],
            max: vec![0.0; n],
            point: vec![0.0; n],
            beside: None,
            terms: Vec::new(),
        }
    }

    /// Evaluates ∇F at x; the scaled matrix follows by [`rescale`](Self::rescale). `false` where entries are not finite.
    pub(super) fn evaluate(&mut self, function: &dyn McpFunction, x: &[f64]) -> bool {
        self.jac.clear();
        function.jacobian(x, &mut self.jac);
        self.jac.values().iter().all(|v| v.is_finite())
    }

    /// The same at a point whose components come one by one.
    pub(super) fn evaluate_at(&mut self, function: &dyn McpFunction, x: impl Iterator<Item = f64>) -> bool {
        let mut point = std::mem::take(&mut self.point);
        point.iter_mut().zip(x).for_each(|(to, x)| *to = x);
        let finite = self.evaluate(function, &point);
        self.point = point;
        finite
    }

    /// Σⱼ |∇Fᵢⱼ xⱼ| with the present ∇F and with that at another point; NaN or infinite where it is not finite there.
    pub(super) fn terms_beside(
        &mut self,
        function: &dyn McpFunction,
        x: &[f64],
        there: impl Iterator<Item = f64>,
    ) -> &[[f64; 2]] {
        let beside = self
            .beside
            .get_or_insert_with(|| Matrix::zeros(self.jac.pattern().clone()));
        self.point.iter_mut().zip(there).for_each(|(to, x)| *to = x);
        beside.clear();
        function.jacobian(&self.point, beside);
        self.terms.clear();
        self.terms.resize(x.len(), [0.0; 2]);
        for (side, jac) in [&self.jac, &*beside].into_iter().enumerate() {
            for (i, j, v) in jac.triplets() {
                self.terms[i][side] += (v * x[j]).abs();
            }
        }
        &self.terms
    }

    /// Whether some rows of ∇F are the same at another point, up to rounding.
    pub(super) fn is_same_at(
        &mut self,
        function: &dyn McpFunction,
        there: impl Iterator<Item = f64>,
        rows: &[usize],
    ) -> bool {
        let beside = self
            .beside
            .get_or_insert_with(|| Matrix::zeros(self.jac.pattern().clone()));
        self.point.iter_mut().zip(there).for_each(|(to, x)| *to = x);
        beside.clear();
        function.jacobian(&self.point, beside);
        let mut pairs = self.jac.triplets().zip(beside.values());
        // Written so that NaN differs.
        pairs.all(|((i, _, a), b)| rows.binary_search(&i).is_err() || (a - b).abs() <= ROUNDING * a.abs())
    }

    /// ∇F, to be overwritten.
    pub(super) fn room(&mut self) -> &mut Matrix {
        &mut self.jac
    }

    /// ∇F.
    pub(super) fn jac(&self) -> &Matrix {
        &self.jac
    }

    /// R ∇F C + ε I.
    pub(super) fn scaled(&self) -> &Matrix {
        &self.scaled
    }

    /// The diagonal of R.
    pub(super) fn row(&self) -> &[f64] {
        &self.row
    }

    /// The diagonal of C.
    pub(super) fn col(&self) -> &[f64] {
        &self.col
    }

    /// Recomputes the scaled matrix with ε = `proximal`.
    pub(super) fn rescale(&mut self, proximal: f64) {
        let Self {
            jac,
            scaled,
            row,
            col,
            ..
        } = self;
        let pattern = jac.pattern();
        let (values, to) = (jac.values(), scaled.values_mut());
        for j in 0..pattern.ncols() {
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                to[e] = values[e] * (row[i] * col[j]) + if i == j { proximal } else { 0.0 };
            }
        }
    }

    /// No scaling.
    pub(super) fn reset(&mut self) {
        self.row.fill(1.0);
        self.col.fill(1.0);
    }

    /// Factors that equilibrate ∇F, within bounds. `f` is F at the same point.
    pub(super) fn equilibrate(&mut self, f: &[f64]) {
        equilibrate(self.jac.as_ref(), &mut self.row, &mut self.col, &mut self.max);
        let power = |v: f64| v.clamp(1e-150, 1e150).log2().round().exp2();
        // Rows with a huge or tiny F may leave these limits; a Jacobian that happens to vanish does not make a row huge.
        for (r, f) in self.row.iter_mut().zip(f) {
            let size = if *f == 0.0 { 1.0 } else { f.abs() };
            *r = power(r.clamp(LEAST_FACTOR.min(1.0 / size), LEAST_FACTOR.recip().max(1.0 / size)));
        }
        for c in &mut self.col {
            *c = power(c.clamp(LEAST_FACTOR, LEAST_FACTOR.recip()));
        }
    }

    /// Whether rows have left the range in which the factors equilibrate ∇F.
    pub(super) fn is_stale(&mut self, f: &[f64]) -> bool {
        self.max.fill(0.0);
        for (i, j, v) in self.jac.triplets() {
            self.max[i] = self.max[i].max((v * self.row[i] * self.col[j]).abs());
        }
        (self.max.iter().zip(f).zip(&self.row))
            .any(|((s, f), r)| *s > STALE || (*s < 1.0 / STALE && *s > 0.0 && (r * f).abs() < 1.0 / STALE))
    }
}

#[cfg(test)]
mod tests {
    use super::{Linearisation, STALE};
    use crate::complementarity::WithJacobian;
    use crate::sparse::{Matrix, Pattern};

    /// ∇F = diag (s, 1): factors serve until a row, and its value with it, has grown or shrunk by more than they may leave.
    #[test]
    fn factors_are_stale_where_rows_leave_their_range() {
        let function = |s: f64| {
            WithJacobian::new(
                2,
                |_: &[f64], _: &mut [f64]| {},
                move |_: &[f64], jac: &mut Matrix| {
                    jac.add(0, 0, s);
                    jac.add(1, 1, 1.0);
                },
            )
        };
        for (s, value, stale) in [
            (1.0, 1.0, false),
            (0.9 * STALE, 1.0, false),
            (1.1 * STALE, 1.0, true),
            (1.1 / STALE, 0.0, false),
            (0.9 / STALE, 0.0, true),
            (0.9 / STALE, 0.9 / STALE, true),
            (0.9 / STALE, 1.1 / STALE, false),
            (0.0, 0.0, false),
        ] {
            let mut lin = Linearisation::new(Pattern::from_entries(2, 2, [(0, 0), (1, 1)]).unwrap());
            assert!(lin.evaluate(&function(1.0), &[0.0; 2]));
            lin.equilibrate(&[1.0; 2]);
            assert_eq!((lin.row(), lin.col()), (&[1.0; 2][..], &[1.0; 2][..]));
            assert!(lin.evaluate(&function(s), &[0.0; 2]));
            assert_eq!(lin.is_stale(&[value, 1.0]), stale, "{s} {value}");
            // Recomputed, they can be used again.
            lin.equilibrate(&[value, 1.0]);
            assert!(!lin.is_stale(&[value, 1.0]));
        }
    }
}
