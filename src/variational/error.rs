use thiserror::Error;

use crate::complementarity::ComplementarityError;
use crate::enumeration::EnumerationError;
use crate::sparse::SparseError;

/// What can be wrong with a polyhedron or a variational inequality. How a solve ended is in its report.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum VariationalError {
    /// A vector or matrix has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which one.
        what: &'static str,
        /// Length required.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A number that must be finite is not.
    #[error("{what}[{index}] = {value} is not finite")]
    NotFinite {
        /// Which vector.
        what: &'static str,
        /// Position, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Constraints are linearly dependent up to rounding, and it is undecided whether they have a common point.
    #[error(
        "rounding leaves open whether the constraints have a common point (after {steps} changes of the active set, at row {row}, \
         equations before inequalities, lower and upper bounds); state constraints that nearly depend on each other once"
    )]
    Unresolved {
        /// Changes made.
        steps: usize,
        /// The row last tried: equations first, then inequalities, lower and upper bounds.
        row: usize,
    },
    /// The problem, its bounds or the solver's options are wrong.
    #[error(transparent)]
    Complementarity(#[from] ComplementarityError),
    /// The list of all solutions could not be made.
    #[error(transparent)]
    Enumeration(#[from] EnumerationError),
    /// A matrix does not fit.
    #[error(transparent)]
    Sparse(#[from] SparseError),
}

pub(super) fn check_length(
    what: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), VariationalError> {
    match found == expected {
        true => Ok(()),
        false => Err(VariationalError::Length {
            what,
            expected,
            found,
        }),
    }
}

pub(super) fn check_finite(what: &'static str, v: &[f64], expected: usize) -> Result<(), VariationalError> {
    check_length(what, v.len(), expected)?;
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(VariationalError::NotFinite {
            what,
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}
