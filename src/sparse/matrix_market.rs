use std::path::Path;

use super::{Matrix, SparseError};

/// Reads a real matrix in MatrixMarket form (`coordinate` or `array`; `general`, `symmetric` or `skew-symmetric`).
///
/// # Errors
/// [`SparseError::Io`] or [`SparseError::Parse`] with the line.
pub fn read_matrix_market(path: impl AsRef<Path>) -> Result<Matrix, SparseError> {
    let _ = path;
    todo!()
}

/// Reads a vector: one number a line (several on a line are taken in order), blank lines and `#` or `%` comments skipped.
///
/// # Errors
/// [`SparseError::Io`] or [`SparseError::Parse`] with the line.
pub fn read_vector(path: impl AsRef<Path>) -> Result<Vec<f64>, SparseError> {
    let _ = path;
    todo!()
}
