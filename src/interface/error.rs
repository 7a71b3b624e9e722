use thiserror::Error;

use crate::linear::LinearError;
use crate::piecewise::PiecewiseError;
use crate::sparse::SparseError;

/// What can be wrong with an interface problem.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum InterfaceError {
    /// A part has the wrong size.
    #[error("{what} must be {expected}, found {found}")]
    Size {
        /// Which part, and which of its sizes.
        what: &'static str,
        /// The size that the other parts require.
        expected: usize,
        /// The size given.
        found: usize,
    },
    /// A vector has an entry that is not finite.
    #[error("entry {index} of {what} is not finite: {value}")]
    NotFinite {
        /// Which vector.
        what: &'static str,
        /// Position.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// A is not symmetric.
    #[error(
        "the operator A must be symmetric: entries ({row}, {col}) and ({col}, {row}) differ by {difference}; use the full form"
    )]
    NotSymmetric {
        /// Row of the worst entry.
        row: usize,
        /// Its column.
        col: usize,
        /// |A_ij − A_ji|.
        difference: f64,
    },
    /// A failure in a map.
    #[error(transparent)]
    Map(#[from] PiecewiseError),
    /// A failure in linear algebra, in particular where A is not positive definite.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// A matrix with entries that are not finite.
    #[error(transparent)]
    Matrix(#[from] SparseError),
}

/// Prefix of the names of lengths in errors; the name of the vector follows.
pub(crate) const LENGTH: &str = "the length of ";

pub(super) fn check_size(what: &'static str, expected: usize, found: usize) -> Result<(), InterfaceError> {
    if expected == found {
        Ok(())
    } else {
        Err(InterfaceError::Size {
            what,
            expected,
            found,
        })
    }
}

pub(super) fn check_vector(what: &'static str, expected: usize, v: &[f64]) -> Result<(), InterfaceError> {
    check_size(what, expected, v.len())?;
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(InterfaceError::NotFinite {
            what: what.strip_prefix(LENGTH).unwrap_or(what),
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}
