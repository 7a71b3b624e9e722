use thiserror::Error;

use super::{PiecewiseSmooth, Selection};
use crate::linear::LinearError;

/// What can go wrong in analysing a piecewise-smooth map at a point.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PiecewiseError {
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
    /// A value is NaN or infinite.
    #[error("{what}[{index}] is not finite")]
    NotFinite {
        /// Which vector.
        what: &'static str,
        /// Position, from 0.
        index: usize,
    },
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
    /// A linear-algebra failure.
    #[error(transparent)]
    Linear(#[from] LinearError),
}

/// Checks that a selection is one of the map's.
pub(crate) fn check_selection<P: PiecewiseSmooth + ?Sized>(
    what: &'static str,
    selection: &Selection,
    map: &P,
) -> Result<(), PiecewiseError> {
    if selection.len() != map.num_sites() {
        return Err(PiecewiseError::Length {
            what,
            expected: map.num_sites(),
            found: selection.len(),
        });
    }
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

/// Checks the length of a vector, not its entries.
pub(crate) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), PiecewiseError> {
    match found == expected {
        true => Ok(()),
        false => Err(PiecewiseError::Length {
            what,
            expected,
            found,
        }),
    }
}

/// Checks the length of a vector and that its entries are finite.
pub(crate) fn check_vector(what: &'static str, v: &[f64], expected: usize) -> Result<(), PiecewiseError> {
    check_length(what, v.len(), expected)?;
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(PiecewiseError::NotFinite { what, index }),
        None => Ok(()),
    }
}
