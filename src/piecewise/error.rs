use thiserror::Error;

use super::{PiecewiseSmooth, Selection};
use crate::InputError;
use crate::input::check_length;
use crate::linear::LinearError;

/// What can go wrong in analysing a piecewise-smooth map at a point.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PiecewiseError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A selection names a piece that its site does not have: it is of another map, or its file was changed.
    #[error("{what} has piece {piece} at site {site}, whose pieces are counted from 0 and are {pieces}")]
    NoSuchPiece {
        /// Which selection.
        what: &'static str,
        /// The site, from 0.
        site: usize,
        /// The piece it names.
        piece: usize,
        /// Number of pieces of the site.
        pieces: usize,
    },
    /// The map wrote a Jacobian entry outside its declared pattern.
    #[error("the Jacobian has an entry at ({row}, {col}) outside the declared pattern; extend `pattern()`")]
    StrayEntry {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        col: usize,
    },
    /// The map is neither an equation nor a curve.
    #[error("a map of {vars} variables and {residuals} residuals cannot be used here; {expected}")]
    Dimensions {
        /// Number of variables.
        vars: usize,
        /// Number of residuals.
        residuals: usize,
        /// The dimensions required.
        expected: &'static str,
    },
    /// A typical size of a variable is not positive.
    #[error("the typical size of variable {index} is {value}; it must be positive")]
    Size {
        /// The variable, from 0.
        index: usize,
        /// Its size.
        value: f64,
    },
    /// Weights and selections that make no element of Clarke's generalised Jacobian.
    #[error("no convex combination of essentially active selections: {what}")]
    Combination {
        /// What is wrong.
        what: &'static str,
    },
    /// A linear-algebra failure.
    #[error(transparent)]
    Linear(#[from] LinearError),
}

/// An error that carries those of maps: what is wrong with data is its `Input`.
macro_rules! carries_maps {
    ($error:ty) => {
        impl From<PiecewiseError> for $error {
            fn from(error: PiecewiseError) -> Self {
                match error {
                    PiecewiseError::Input(error) => Self::Input(error),
                    error => Self::Map(error),
                }
            }
        }
    };
}

pub(crate) use carries_maps;

/// Checks that a selection is one of the map's.
pub(crate) fn check_selection<P: PiecewiseSmooth + ?Sized>(
    what: &'static str,
    selection: &Selection,
    map: &P,
) -> Result<(), PiecewiseError> {
    check_length(what, selection.len(), map.num_sites())?;
    for (site, piece) in selection.pieces().enumerate() {
        let pieces = map.num_pieces(site);
        if piece >= pieces {
            return Err(PiecewiseError::NoSuchPiece {
                what,
                site,
                piece,
                pieces,
            });
        }
    }
    Ok(())
}
