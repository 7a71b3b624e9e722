use nalgebra::Cholesky;

use super::spectral::{self, ScaledMatrix};
use super::{LinearError, memory::check_finite};
use crate::input::check_length;
use crate::sparse::Matrix;

fn dense(a: &Matrix) -> Result<ScaledMatrix, LinearError> {
    if a.nrows() != a.ncols() {
        return Err(LinearError::NotSquare {
            nrows: a.nrows(),
            ncols: a.ncols(),
        });
    }
    spectral::scaled(a, a.nrows())
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// The eigenvalues of a symmetric matrix (its lower triangle is read), increasing.
///
/// # Complexity
/// Dense: O(n³) operations and 8 n² bytes.
///
/// # Errors
/// Matrices that are not square or not finite; [`LinearError::TooLarge`]; [`LinearError::Solver`] should the iteration not converge.
///
/// ```
/// use semismooth::{linear::symmetric_eigenvalues, sparse::Matrix};
/// let values = symmetric_eigenvalues(&Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?)?;
/// assert!((values[0] - 1.0).abs() < 1e-14 && (values[1] - 3.0).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn symmetric_eigenvalues(a: &Matrix) -> Result<Vec<f64>, LinearError> {
    let m = dense(a)?;
    let unit = m.unit;
    let values = spectral::symmetric(m.entries)?;
    Ok(sorted(values.iter().map(|v| v * unit * unit).collect()))
}

/// The eigenvalues λ of A v = λ B v, A symmetric, B symmetric positive definite, increasing.
///
/// # Complexity
/// Dense: O(n³) operations and a few times 8 n² bytes.
///
/// # Errors
/// As [`symmetric_eigenvalues`]; different orders; B not positive definite.
pub fn generalized_eigenvalues(a: &Matrix, b: &Matrix) -> Result<Vec<f64>, LinearError> {
    let (a, b) = (dense(a)?, dense(b)?);
    check_length("the second matrix", b.entries.nrows(), a.entries.nrows())?;
    let unit = a.unit / b.unit;
    let factor = Cholesky::new(b.entries).ok_or(LinearError::NotPositiveDefinite)?;
    let l = factor.l();
    let half = l
        .solve_lower_triangular(&a.entries)
        .ok_or(LinearError::NotPositiveDefinite)?;
    let mut m = l
        .solve_lower_triangular(&half.transpose())
        .ok_or(LinearError::NotPositiveDefinite)?;
    m = (&m + m.transpose()) * 0.5;
    // Where B is nearly singular its factors overflow.
    check_finite(m.as_slice(), "the reduced matrix").map_err(|_| LinearError::NotPositiveDefinite)?;
    let values = spectral::symmetric(m)?;
    Ok(sorted(values.iter().map(|v| v * unit * unit).collect()))
}

/// The eigenvalues (real part, imaginary part) of any square matrix.
///
/// # Complexity
/// Dense: O(n³) operations and 8 n² bytes.
///
/// # Errors
/// As [`symmetric_eigenvalues`].
pub fn eigenvalues(a: &Matrix) -> Result<Vec<(f64, f64)>, LinearError> {
    let m = dense(a)?;
    let unit = m.unit;
    let values = spectral::any(m.entries)?;
    Ok(values
        .iter()
        .map(|z| (z.0 * unit * unit, z.1 * unit * unit))
        .collect())
}
