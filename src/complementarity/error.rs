use thiserror::Error;

use crate::linear::LinearError;
use crate::piecewise::PiecewiseError;
use crate::sparse::SparseError;

/// What can be wrong with a complementarity problem or its options. How a solve ended is in its report.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ComplementarityError {
    /// There is nothing to solve for.
    #[error("the problem has no variables; at least one is needed")]
    Empty,
    /// A vector has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which vector.
        what: &'static str,
        /// Length required.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A bound is NaN, a lower bound +∞ or an upper bound −∞.
    #[error("{what}[{index}] = {value} is not a bound; use a number, or {free} for no bound")]
    Bound {
        /// Which vector.
        what: &'static str,
        /// Component, from 0.
        index: usize,
        /// Its value.
        value: f64,
        /// The infinity that says "no bound" here.
        free: &'static str,
    },
    /// A lower bound lies above the upper one.
    #[error("lower[{index}] = {lower} lies above upper[{index}] = {upper}; no x satisfies both")]
    CrossedBounds {
        /// Component, from 0.
        index: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// Two blocks of variables of one name.
    #[error("variables \"{name}\" exist already; each block needs a name of its own")]
    BlockTwice {
        /// The name.
        name: String,
    },
    /// No block of variables has this name.
    #[error("there are no variables \"{name}\"; the blocks are {known}")]
    NoSuchBlock {
        /// The unknown name.
        name: String,
        /// The names that exist.
        known: String,
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
    /// The numbers of variables and values of the function do not fit its use.
    #[error("a function of {vars} variables with {values} values cannot be used here; {expected}")]
    Dimensions {
        /// Number of variables.
        vars: usize,
        /// Number of values.
        values: usize,
        /// What would fit.
        expected: &'static str,
    },
    /// A Jacobian entry is not the derivative of the function.
    #[error(
        "the Jacobian has {given} at ({row}, {col}), but difference quotients give {found}; check the derivative"
    )]
    WrongDerivative {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        col: usize,
        /// The entry.
        given: f64,
        /// Its difference quotient.
        found: f64,
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
    /// A method does not apply to the problem.
    #[error("{method} cannot solve this problem: {reason}")]
    Unsuitable {
        /// The method.
        method: &'static str,
        /// Why, and what to do.
        reason: String,
    },
    /// The map could not be used.
    #[error(transparent)]
    Map(#[from] PiecewiseError),
    /// A matrix or pattern does not fit.
    #[error(transparent)]
    Sparse(#[from] SparseError),
    /// The linear solver refused the problem (size, memory).
    #[error(transparent)]
    Linear(#[from] LinearError),
}

/// Checks the length of a vector and that its entries are finite.
pub(super) fn check_finite(
    what: &'static str,
    v: &[f64],
    expected: usize,
) -> Result<(), ComplementarityError> {
    if v.len() != expected {
        return Err(ComplementarityError::Length {
            what,
            expected,
            found: v.len(),
        });
    }
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ComplementarityError::NotFinite {
            what,
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}
