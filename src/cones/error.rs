use thiserror::Error;

use crate::linear::LinearError;
use crate::sparse::SparseError;

/// What can be wrong with a cone problem or its options. How a solve ended is in its report.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ConeError {
    /// There is nothing to solve for.
    #[error("the problem has no variables; at least one is needed")]
    Empty,
    /// A cone needs at least one variable.
    #[error("cone {index} has no variables; leave it out")]
    NoVariables {
        /// Position of the cone, from 0.
        index: usize,
    },
    /// The numbers of variables add up to more than a `usize` holds.
    #[error(
        "the cones up to number {index} have more variables than can be counted; check their numbers of variables"
    )]
    TooLarge {
        /// Position of the last cone of the sum, from 0.
        index: usize,
    },
    /// A cone whose projection has no finite list of smooth pieces.
    #[error(
        "cone {index} is one of semidefinite matrices, whose projection has no finite list of smooth pieces"
    )]
    NoPieces {
        /// Position of the cone, from 0.
        index: usize,
    },
    /// The numbers of variables do not agree.
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
    #[error("the start has {value} at {index}, which is not finite")]
    NotFinite {
        /// Position, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The Jacobian of F has an entry outside its pattern.
    #[error("the Jacobian has an entry at ({row}, {col}), where its pattern has none")]
    OutsidePattern {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        col: usize,
    },
    /// An option is out of its range.
    #[error("option {name} = {value} is out of range; it must be {range}")]
    Option {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        range: &'static str,
    },
    /// The blocks of the cones, whose derivatives are full, would take more memory than is allowed.
    #[error(
        "the derivatives of the cones are full: some {needed:.1e} bytes, more than {limit:.1e} allowed by `max_memory`; state large cones as \
         several small ones"
    )]
    Memory {
        /// An estimate, in bytes.
        needed: f64,
        /// The limit, in bytes.
        limit: f64,
    },
    /// A matrix or pattern does not fit.
    #[error(transparent)]
    Sparse(#[from] SparseError),
    /// The linear solver refused the problem (size, memory).
    #[error(transparent)]
    Linear(#[from] LinearError),
}
