use super::LinearError;
use crate::sparse::Matrix;

/// Orthonormal bases of the kernels of a matrix and of its transpose.
#[derive(Debug, Clone, PartialEq)]
pub struct NullSpace {
    /// Basis of {v : A v = 0}; each vector has one entry a column of A.
    pub right: Vec<Vec<f64>>,
    /// Basis of {w : Aᵀ w = 0}; each vector has one entry a row of A.
    pub left: Vec<Vec<f64>>,
    /// Singular values, largest first.
    pub singular_values: Vec<f64>,
}

/// Kernels of `a` by singular values, those at most `rtol` times the largest counting as zero. Dense: O(n³).
///
/// # Errors
/// [`LinearError::NotFinite`].
pub fn null_space(a: &Matrix, rtol: f64) -> Result<NullSpace, LinearError> {
    let _ = (a, rtol);
    todo!()
}
