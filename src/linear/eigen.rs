use nalgebra::{Cholesky, DMatrix};

use super::LinearError;
use super::memory::{check_finite, dense_zeros};
use crate::sparse::Matrix;

/// Most sweeps of the eigenvalue iterations for each row of the matrix.
const SWEEPS: usize = 100;

fn dense(a: &Matrix) -> Result<DMatrix<f64>, LinearError> {
    check_finite(a.values(), "the matrix")?;
    if a.nrows() != a.ncols() {
        return Err(LinearError::NotSquare {
            nrows: a.nrows(),
            ncols: a.ncols(),
        });
    }
    let zeros = dense_zeros(a.nrows(), a.ncols())?;
    let mut m = DMatrix::from_vec(a.nrows(), a.ncols(), zeros);
    for (i, j, v) in a.triplets() {
        m[(i, j)] = v;
    }
    Ok(m)
}

fn failed() -> LinearError {
    LinearError::Solver {
        what: "the eigenvalue iteration did not converge".to_owned(),
    }
}

fn sorted(m: DMatrix<f64>) -> Result<Vec<f64>, LinearError> {
    let n = m.nrows();
    if n == 0 {
        return Ok(Vec::new());
    }
    let eigen = m
        .try_symmetric_eigen(5.0 * f64::EPSILON, SWEEPS * n)
        .ok_or_else(failed)?;
    let mut values = eigen.eigenvalues.as_slice().to_vec();
    values.sort_by(f64::total_cmp);
    Ok(values)
}

/// The eigenvalues of a symmetric matrix (its lower triangle is read), increasing. Dense: O(n³).
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
    sorted(dense(a)?)
}

/// The eigenvalues λ of A v = λ B v, A symmetric, B symmetric positive definite, increasing. Dense: O(n³).
///
/// # Errors
/// As [`symmetric_eigenvalues`]; different orders; B not positive definite.
pub fn generalized_eigenvalues(a: &Matrix, b: &Matrix) -> Result<Vec<f64>, LinearError> {
    let (a, b) = (dense(a)?, dense(b)?);
    if a.nrows() != b.nrows() {
        return Err(LinearError::Shape {
            what: "the second matrix",
            expected: a.nrows(),
            found: b.nrows(),
        });
    }
    let factor = Cholesky::new(b).ok_or(LinearError::NotPositiveDefinite)?;
    let l = factor.l();
    let half = l
        .solve_lower_triangular(&a)
        .ok_or(LinearError::NotPositiveDefinite)?;
    let mut m = l
        .solve_lower_triangular(&half.transpose())
        .ok_or(LinearError::NotPositiveDefinite)?;
    m = (&m + m.transpose()) * 0.5;
    sorted(m)
}

/// The eigenvalues (real part, imaginary part) of any square matrix. Dense: O(n³).
///
/// # Errors
/// As [`symmetric_eigenvalues`].
pub fn eigenvalues(a: &Matrix) -> Result<Vec<(f64, f64)>, LinearError> {
    let m = dense(a)?;
    let n = m.nrows();
    if n == 0 {
        return Ok(Vec::new());
    }
    let schur = m.try_schur(5.0 * f64::EPSILON, SWEEPS * n).ok_or_else(failed)?;
    Ok(schur.complex_eigenvalues().iter().map(|z| (z.re, z.im)).collect())
}
