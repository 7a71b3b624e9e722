use thiserror::Error;

use crate::Cause;
use crate::InputError;
use crate::complementarity::ComplementarityError;
use crate::run::Status;
use crate::sensitivity::SensitivityError;
use crate::variational::Infeasibility;

/// What can be wrong with a problem of optimisation, and why a function has no value or gradient at a point.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OptimiseError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
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
}

impl OptimiseError {
    /// The status with which an observer or a limit of time ended an evaluation, which says nothing of its
    /// point; that at the start included.
    #[must_use]
    pub fn stopped(&self) -> Option<Status> {
        match self {
            Self::Unsolved(status @ (Status::Interrupted | Status::TimeLimit)) => Some(*status),
            Self::Start { source } => source.downcast_ref::<Self>().and_then(Self::stopped),
            _ => None,
        }
    }
}
