use std::path::PathBuf;

use thiserror::Error;

use crate::Cause;

/// What can be wrong with a pattern, a matrix or a file that should hold one.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SparseError {
    /// An entry lies outside the matrix.
    #[error("entry ({row}, {col}) lies outside a {nrows} x {ncols} matrix; indices count from 0")]
    OutOfBounds {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        col: usize,
        /// Number of rows.
        nrows: usize,
        /// Number of columns.
        ncols: usize,
    },
    /// Column pointers or row indices do not describe a matrix in compressed-column form.
    #[error("not a compressed-column pattern: {what}")]
    Malformed {
        /// Which rule is broken, and where.
        what: String,
    },
    /// An array has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which array.
        what: &'static str,
        /// Length required.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A value is NaN or infinite.
    #[error("entry ({row}, {col}) is {value}; all entries must be finite")]
    NotFinite {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        col: usize,
        /// The value.
        value: f64,
    },
    /// A file could not be read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: Cause,
    },
    /// A file is not in the format it should be in.
    #[error("{path}, line {line}: {what}", path = path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was found and what was expected.
        what: String,
        /// The underlying error, if there is one: of the JSON, or of the matrix that the file describes.
        source: Option<Cause>,
    },
}
