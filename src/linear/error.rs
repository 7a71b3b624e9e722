use thiserror::Error;

use crate::Cause;
use crate::InputError;

/// What can go wrong in a factorisation or a solve.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum LinearError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The matrix is singular to working precision.
    #[error("the matrix is singular to working precision (reciprocal condition {rcond:e})")]
    Singular {
        /// Estimated reciprocal condition number; 0 where a pivot vanished.
        rcond: f64,
    },
    /// The matrix is not positive definite.
    #[error("the matrix is not positive definite; check its symmetry and that the body cannot move freely")]
    NotPositiveDefinite,
    /// A value is NaN or infinite.
    #[error("{what} holds a value that is NaN or infinite")]
    NotFinite {
        /// Which operand.
        what: &'static str,
    },
    /// The solution does not satisfy the system.
    #[error("the solve is inaccurate: relative residual {residual:e}")]
    Inaccurate {
        /// ‖A x − b‖∞ / (‖A‖ ‖x‖ + ‖b‖), or NaN.
        residual: f64,
    },
    /// The matrix is not square.
    #[error("a {nrows} x {ncols} matrix is not square")]
    NotSquare {
        /// Number of rows.
        nrows: usize,
        /// Number of columns.
        ncols: usize,
    },
    /// `factor` was called before `analyze`, or with another pattern.
    #[error("the pattern of this matrix has not been analysed; call `analyze` first")]
    NotAnalyzed,
    /// A solve was requested without a (successful) factorisation.
    #[error("there is no factorisation to solve with; call `factor` first")]
    NotFactored,
    /// The kernel of a Jacobian does not have the dimension that the method needs.
    #[error("the Jacobian has a kernel of dimension {found}, expected {expected}")]
    Kernel {
        /// Dimension needed.
        expected: usize,
        /// Dimension found (a lower bound for sparse matrices).
        found: usize,
    },
    /// A dense array that does not fit into memory, or has more entries than a square one of order 50 000 (20 GB).
    #[error(
        "a dense {nrows} x {ncols} matrix is too large (more than 50 000² entries, or more than fits into memory); use a sparse method"
    )]
    TooLarge {
        /// Number of rows.
        nrows: usize,
        /// Number of columns.
        ncols: usize,
    },
    /// Memory or index limits of the solver.
    #[error("the solver gave up: {what}")]
    Solver {
        /// The message of the solver.
        what: String,
    },
    /// The solver failed with an error of its own: of the library that factors, or of a user's [`LinearSolver`](super::LinearSolver).
    #[error("the solver gave up: {source}")]
    External {
        /// That error.
        source: Cause,
    },
    /// The time limit has passed.
    #[error("the time limit has passed")]
    TimeLimit,
}
