use thiserror::Error;

use crate::InputError;
use crate::enumeration::EnumerationError;
use crate::newton::{Correction, NewtonError};
use crate::piecewise::{PiecewiseError, carries_maps};

/// What can go wrong in starting or following a curve.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ContinuationError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The map or a vector does not fit.
    #[error(transparent)]
    Map(PiecewiseError),
    /// The start could not be corrected onto the curve.
    #[error("the start is not on the curve and Newton's method at its parameter failed: {0}")]
    Start(#[from] NewtonError),
    /// The solutions at a parameter could not be enumerated.
    #[error(transparent)]
    Enumeration(#[from] EnumerationError),
    /// An error of an earlier run, read from a file.
    #[error("{message}")]
    Recorded {
        /// Its message.
        message: String,
    },
    /// The start lies in the cell of no piece at some site.
    #[error("the start lies outside the domain of the map at {site}; no piece is active there")]
    Outside {
        /// Name of the site.
        site: String,
    },
    /// A diagram was queried, or a run resumed, with another map than its own.
    #[error(
        "the curve is not that of this map: at its point with parameter {parameter} the residual is {residual:e}; use the map it was \
         computed with"
    )]
    OtherMap {
        /// α at the point.
        parameter: f64,
        /// ‖H‖₂ there.
        residual: f64,
    },
    /// No arm of the curve leaves the start in the requested direction.
    #[error("no arm leaves the start with {wanted}; {found} arms leave it in other directions")]
    NoArm {
        /// The direction requested.
        wanted: &'static str,
        /// Number of arms in all.
        found: usize,
    },
    /// No arm was found in the requested direction, and the search was not complete: more arms may leave the start.
    #[error(
        "undecided whether an arm leaves the start with {wanted}: {reason}; {found} arms were found in other directions"
    )]
    UndecidedArms {
        /// The direction requested.
        wanted: &'static str,
        /// Number of arms found.
        found: usize,
        /// Dimension of the kernel of ∇H that left the search undecided; 0 where a limit ended it.
        kernel: usize,
        /// The variables that take part in that kernel, the one with the largest component first, counted from 0.
        variables: Vec<usize>,
        /// Why it is undecided, and a remedy.
        reason: String,
    },
    /// A saved run is not as it was saved, or its facets are not those of the map.
    #[error(
        "the saved run was altered, was written by another version, or is not one of this map; start a new run from its point"
    )]
    Saved,
    /// The two independent rules of orientation disagree at a transition.
    #[error(
        "at parameter {parameter}, {site}: the determinant and the test functions disagree on the orientation of the curve; \
             the choice of an arm would be arbitrary (the map may be discontinuous there: run `piecewise::check`)"
    )]
    Orientation {
        /// α at the transition.
        parameter: f64,
        /// Name of the site.
        site: String,
    },
}

carries_maps!(ContinuationError);

/// `None` where a linear system has no accurate solution, as next to singular points.
pub(super) fn if_solved<T>(found: Result<T, PiecewiseError>) -> Result<Option<T>, PiecewiseError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(PiecewiseError::Linear(_)) => Ok(None),
        Err(e) => Err(e),
    }
}

/// `None` where a correction does not converge, too.
pub(super) fn if_converged<T>(
    found: Result<(Correction, T), PiecewiseError>,
) -> Result<Option<(Correction, T)>, PiecewiseError> {
    Ok(if_solved(found)?.filter(|(c, _)| c.converged))
}
