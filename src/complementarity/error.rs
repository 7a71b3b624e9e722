use thiserror::Error;

use crate::InputError;
use crate::enumeration::EnumerationError;
use crate::linear::LinearError;
use crate::piecewise::{PiecewiseError, carries_maps};

/// What can be wrong with a complementarity problem or its options. How a solve ended is in its report.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ComplementarityError {
    /// A cone needs at least one variable.
    #[error("cone {index} has no variables; leave it out")]
    EmptyCone {
        /// Position of the cone, from 0.
        index: usize,
    },
    /// The numbers of variables add up to more than a `usize` holds.
    #[error(
        "the cones up to number {index} have more variables than can be counted; check their numbers of variables"
    )]
    TooManyVariables {
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
    /// The Jacobian of F has an entry outside its pattern.
    #[error("the Jacobian has an entry at ({row}, {col}), where its pattern has none")]
    OutsidePattern {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        col: usize,
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
    /// The list of all solutions could not be made.
    #[error(transparent)]
    Enumeration(#[from] EnumerationError),
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// There is nothing to solve for.
    #[error("the problem has no variables; at least one is needed")]
    Empty,
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
    Map(PiecewiseError),
    /// The linear solver refused the problem (size, memory).
    #[error(transparent)]
    Linear(#[from] LinearError),
}

carries_maps!(ComplementarityError);
