use super::LinearError;
use super::memory::check_finite;
use crate::input::check_length;
use crate::sparse::MatrixRef;
use crate::tolerances::{HALF_DIGITS, NONE};

/// A preconditioner: solves with a matrix near the given one.
pub trait Preconditioner {
    /// Prepares for a square matrix, whose diagonal is stored; called again whenever it has changed.
    ///
    /// # Errors
    /// A matrix that the preconditioner cannot handle.
    fn prepare(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError>;

    /// Overwrites the right-hand side by the solution of the nearby system.
    ///
    /// # Errors
    /// A wrong length; a failure of the solve.
    fn apply(&mut self, b: &mut [f64]) -> Result<(), LinearError>;
}

/// Incomplete LU factors without fill, ILU(0) (J. A. Meijerink, H. A. van der Vorst, Math. Comp. 31 (1977)).
///
/// Exact for matrices whose factors do not fill, as tridiagonal ones; stable for M matrices. Pivots near zero are replaced, so that it
/// always exists.
///
/// ```
/// use semismooth::linear::{IncompleteLu, Preconditioner};
/// use semismooth::sparse::Matrix;
/// let a = Matrix::from_rows(&[[4.0, -1.0, 0.0], [-2.0, 4.0, -1.0], [0.0, -2.0, 4.0]])?;
/// let mut ilu = IncompleteLu::default();
/// ilu.prepare(a.as_ref())?;
/// let mut b = [2.0, 3.0, 8.0];
/// ilu.apply(&mut b)?;
/// // No entry of the factors is left out here.
/// let mut r = [0.0; 3];
/// a.mul_vec(&b, &mut r);
/// assert!(r.iter().zip([2.0, 3.0, 8.0]).all(|(r, b)| (r - b).abs() < 1e-14));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct IncompleteLu {
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    /// Unit lower factor below the diagonal, upper factor on and above it.
    values: Vec<f64>,
    /// Where the diagonal entry of each column is.
    diagonal: Vec<usize>,
    /// Where each row of the current column is.
    slot: Vec<usize>,
}

impl Preconditioner for IncompleteLu {
    fn prepare(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        let (n, ncols) = (a.pattern.nrows, a.pattern.ncols);
        if n != ncols {
            return Err(LinearError::NotSquare { nrows: n, ncols });
        }
        check_finite(a.values, "the matrix")?;
        self.col_ptr.clear();
        self.col_ptr.extend_from_slice(a.pattern.col_ptr);
        self.row_idx.clear();
        self.row_idx.extend_from_slice(a.pattern.row_idx);
        self.values.clear();
        self.values.extend_from_slice(a.values);
        self.diagonal.clear();
        self.slot.clear();
        self.slot.resize(n, NONE);
        for j in 0..n {
            let span = self.col_ptr[j]..self.col_ptr[j + 1];
            let mut largest = 0.0_f64;
            for e in span.clone() {
                self.slot[self.row_idx[e]] = e;
                largest = largest.max(self.values[e].abs());
            }
            let place = self.slot[j];
            if place == NONE || largest == 0.0 {
                return Err(LinearError::Singular { rcond: 0.0 });
            }
            // Rows ascend within a column.
            for e in span.start..place {
                let u = self.values[e];
                if u == 0.0 {
                    continue;
                }
                let k = self.row_idx[e];
                for l in self.diagonal[k] + 1..self.col_ptr[k + 1] {
                    let target = self.slot[self.row_idx[l]];
                    if target != NONE {
                        self.values[target] -= self.values[l] * u;
                    }
                }
            }
            // Smaller pivots are moved up to this size.
            let least = HALF_DIGITS * largest;
            let pivot = &mut self.values[place];
            if pivot.abs() < least {
                *pivot = least.copysign(*pivot);
            }
            let pivot = *pivot;
            for e in place + 1..span.end {
                self.values[e] /= pivot;
            }
            self.diagonal.push(place);
            for e in span {
                self.slot[self.row_idx[e]] = NONE;
            }
        }
        Ok(())
    }

    fn apply(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let n = self.diagonal.len();
        check_length("the right-hand side", b.len(), n)?;
        for j in 0..n {
            let x = b[j];
            for e in self.diagonal[j] + 1..self.col_ptr[j + 1] {
                b[self.row_idx[e]] -= self.values[e] * x;
            }
        }
        for j in (0..n).rev() {
            let x = b[j] / self.values[self.diagonal[j]];
            b[j] = x;
            for e in self.col_ptr[j]..self.diagonal[j] {
                b[self.row_idx[e]] -= self.values[e] * x;
            }
        }
        Ok(())
    }
}
