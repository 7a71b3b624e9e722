use thiserror::Error;

use crate::linear::LinearError;
use crate::piecewise::PiecewiseError;

/// What can go wrong in an enumeration.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EnumerationError {
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
    Map(#[from] PiecewiseError),
}

impl From<LinearError> for EnumerationError {
    fn from(e: LinearError) -> Self {
        Self::Map(e.into())
    }
}
