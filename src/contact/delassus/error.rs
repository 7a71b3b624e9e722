use thiserror::Error;

use crate::Cause;
use crate::sparse::SparseError;

/// What can be wrong with a problem in Delassus form, or with the options of its solver.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DelassusError {
    /// The space has neither two nor three dimensions.
    #[error("dimension {found}: contacts live in the plane (2) or in space (3)")]
    Dimension {
        /// The dimension given.
        found: usize,
    },
    /// There are no contacts.
    #[error("the problem has no contacts")]
    Empty,
    /// M is not square of order `dimension * contacts`.
    #[error("M is {nrows} x {ncols}; {contacts} contacts in dimension {dimension} need order {expected}")]
    Shape {
        /// Rows given.
        nrows: usize,
        /// Columns given.
        ncols: usize,
        /// Number of coefficients of friction.
        contacts: usize,
        /// Dimension of the space.
        dimension: usize,
        /// Order needed.
        expected: usize,
    },
    /// A vector has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which vector.
        what: &'static str,
        /// Length expected.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A value is NaN or infinite.
    #[error("{what}[{index}] = {value} is not finite")]
    NotFinite {
        /// Which vector.
        what: &'static str,
        /// Position, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// An entry of M is NaN or infinite.
    #[error("M: {source}")]
    Matrix {
        /// The entry.
        source: SparseError,
    },
    /// A coefficient of friction is negative.
    #[error("the coefficient of friction of contact {contact} is {value}; it must not be negative")]
    NegativeFriction {
        /// The contact, from 0.
        contact: usize,
        /// Its coefficient.
        value: f64,
    },
    /// A diagonal entry of M is negative, so that a push at a contact makes it move against the push.
    #[error(
        "M[{index}, {index}] = {value} is negative; a Delassus matrix is positive semidefinite: check signs and block order"
    )]
    NegativeDiagonal {
        /// Row and column, from 0.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// An option of the solver is out of range.
    #[error("option {name} = {value} must be {range}")]
    Option {
        /// Which option.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// A file could not be read or has the wrong format.
    #[error("{path}: {what}", path = path.display())]
    File {
        /// The file.
        path: std::path::PathBuf,
        /// What was found and what was expected.
        what: String,
        /// The underlying error, where there is one: of the operating system, of the JSON, or of the matrix.
        source: Option<Cause>,
    },
}
