use super::{ComplementarityError, McpFunction};
use crate::input::check_vector;
use crate::sparse::{Matrix, Pattern};

/// F(x) = M x + q, dense or sparse; with one column more than rows the last variable is a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct AffineFunction {
    matrix: Matrix,
    q: Vec<f64>,
}

impl AffineFunction {
    /// The function M x + q.
    ///
    /// # Errors
    /// Entries that are not finite; M neither n × n nor n × (n + 1) for q of length n; n = 0.
    pub fn new(matrix: Matrix, q: Vec<f64>) -> Result<Self, ComplementarityError> {
        let (rows, cols) = (matrix.nrows(), matrix.ncols());
        if rows > 0 && cols != rows && cols != rows + 1 {
            return Err(ComplementarityError::Dimensions {
                vars: cols,
                values: rows,
                expected: "M has as many columns as rows, or one more (the parameter)",
            });
        }
        Self::with_parameters(matrix, q)
    }

    /// The function M x + q with parameters: the variables behind as many as there are rows.
    ///
    /// # Errors
    /// Entries that are not finite; fewer columns than rows, q of another length; n = 0.
    pub fn with_parameters(matrix: Matrix, q: Vec<f64>) -> Result<Self, ComplementarityError> {
        let (rows, cols) = (matrix.nrows(), matrix.ncols());
        if rows == 0 {
            return Err(ComplementarityError::Empty);
        }
        if cols < rows {
            return Err(ComplementarityError::Dimensions {
                vars: cols,
                values: rows,
                expected: "M has as many columns as rows, and those behind them belong to parameters",
            });
        }
        check_vector("q", &q, rows)?;
        matrix.check_finite()?;
        // With the diagonal stored, Jacobians of reformulations have the pattern of M and are copied value by value.
        let pattern = with_diagonal(matrix.pattern())?;
        let matrix = if pattern == *matrix.pattern() {
            matrix
        } else {
            let mut full = Matrix::zeros(pattern);
            for (i, j, v) in matrix.triplets() {
                full.add(i, j, v);
            }
            full
        };
        Ok(Self { matrix, q })
    }

    /// M, its diagonal stored.
    #[must_use]
    pub fn matrix(&self) -> &Matrix {
        &self.matrix
    }

    /// q.
    #[must_use]
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    pub(super) fn q_mut(&mut self) -> &mut [f64] {
        &mut self.q
    }

    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        self.matrix.values_mut()
    }
}

impl McpFunction for AffineFunction {
    fn num_vars(&self) -> usize {
        self.matrix.ncols()
    }

    fn num_values(&self) -> usize {
        self.matrix.nrows()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&self.q);
        self.matrix.as_ref().mul_add(1.0, x, out);
    }

    fn jacobian(&self, _x: &[f64], jac: &mut Matrix) {
        if jac.pattern() == self.matrix.pattern() {
            for (a, m) in jac.values_mut().iter_mut().zip(self.matrix.values()) {
                *a += m;
            }
        } else {
            jac.add_block(0, 0, 1.0, &self.matrix);
        }
    }

    fn pattern(&self) -> Pattern {
        self.matrix.pattern().clone()
    }

    fn is_affine(&self) -> bool {
        true
    }

    fn coefficients(&self) -> Option<(&AffineFunction, Option<f64>)> {
        Some((self, None))
    }
}

/// The union of a pattern and the diagonal.
pub(super) fn with_diagonal(pattern: &Pattern) -> Result<Pattern, ComplementarityError> {
    let (rows, cols) = (pattern.nrows(), pattern.ncols());
    let diagonal = rows.min(cols);
    if (0..diagonal).all(|i| pattern.slot(i, i).is_some()) {
        return Ok(pattern.clone());
    }
    let stored = (0..cols).flat_map(|j| {
        let span = pattern.col_ptr()[j]..pattern.col_ptr()[j + 1];
        pattern.row_idx()[span].iter().map(move |&i| (i, j))
    });
    Ok(Pattern::from_entries(
        rows,
        cols,
        stored.chain((0..diagonal).map(|i| (i, i))),
    )?)
}
