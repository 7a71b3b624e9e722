use thiserror::Error;

use crate::InputError;
use crate::linear::LinearError;
use crate::piecewise::{PiecewiseError, carries_maps};

/// What can go wrong in an enumeration.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EnumerationError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The pieces are not affine in y at fixed parameter, so that they have no finite list of solutions to enumerate.
    #[error(
        "{what} is not affine in the unknowns at fixed parameter: its derivatives differ between two points"
    )]
    NotAffine {
        /// Which row or test function.
        what: String,
    },
    /// The dense table of the search would not fit.
    #[error(
        "{rows} forms of {unknowns} unknowns are too many for a complete enumeration; condense the problem first"
    )]
    TooLarge {
        /// Number of affine forms.
        rows: usize,
        /// Number of unknowns.
        unknowns: usize,
    },
    /// The point lies in the cell of no piece at some site.
    #[error("the point lies outside the domain of the map at {site}")]
    Outside {
        /// Name of the site.
        site: String,
    },
    /// The map or a vector does not fit.
    #[error(transparent)]
    Map(PiecewiseError),
}

carries_maps!(EnumerationError);

impl From<LinearError> for EnumerationError {
    fn from(e: LinearError) -> Self {
        Self::Map(e.into())
    }
}
