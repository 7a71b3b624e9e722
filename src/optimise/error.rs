use thiserror::Error;

use crate::Cause;
use crate::complementarity::ComplementarityError;
use crate::run::Status;
use crate::sensitivity::SensitivityError;
use crate::variational::{Infeasibility, VariationalError};

/// What can be wrong with a problem of optimisation, and why a function has no value or gradient at a point.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OptimiseError {
    /// A vector has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which one.
        what: &'static str,
        /// Length required.
        expected: usize,
        /// Length given.
        found: usize,
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
    /// No parameters satisfy the constraints, which is proven.
    #[error(
        "no parameters satisfy the constraints; the certificate says which of them contradict each other"
    )]
    EmptySet(Box<Infeasibility>),
    /// The function has no value or no gradient at the start.
    #[error(
        "the function has no value or gradient at the start, projected on the constraints: {source}; start elsewhere"
    )]
    Start {
        /// Why.
        source: Cause,
    },
    /// A value or gradient is not finite.
    #[error("the function or its gradient is not finite")]
    NotFinite,
    /// The equations were not solved at a point.
    #[error("the equations were not solved at these parameters: {0}")]
    Unsolved(Status),
    /// The solution has no generalised derivative at a point, or none that is known.
    #[error(transparent)]
    Sensitivity(#[from] SensitivityError),
    /// The complementarity problem was refused.
    #[error(transparent)]
    Complementarity(#[from] ComplementarityError),
    /// The constraints, or a start, were refused.
    #[error(transparent)]
    Set(#[from] VariationalError),
}
