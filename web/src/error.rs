use std::error::Error as _;

use semismooth::InputError;
use semismooth::contact::ContactError;
use semismooth::continuation::ContinuationError;
use semismooth::enumeration::EnumerationError;
use semismooth::piecewise::{FormulaError, PiecewiseError};
use serde::Serialize;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Text that is not a question of this page.
    #[error("the question is not understood")]
    Question(#[source] serde_json::Error),
    /// A number out of its range.
    #[error("{what} is {value}; it must be {range}")]
    Value {
        /// Its name.
        what: String,
        /// Its value.
        value: f64,
        /// The range, in words.
        range: &'static str,
    },
    /// A list of the wrong length.
    #[error("{what} has {found} entries; expected {expected}")]
    Length {
        /// Its name.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A formula that cannot be read.
    #[error(transparent)]
    Formula(#[from] FormulaError),
    /// The problem was refused.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// The curves could not be followed.
    #[error(transparent)]
    Continuation(#[from] ContinuationError),
    /// The solutions could not be listed.
    #[error(transparent)]
    Enumeration(#[from] EnumerationError),
    /// A map of the wrong shape.
    #[error(transparent)]
    Map(#[from] PiecewiseError),
    /// A matrix that was refused.
    #[error(transparent)]
    Matrix(#[from] InputError),
}

/// An error as the page shows it.
#[derive(Serialize)]
pub(crate) struct Told {
    message: String,
    /// For formulas: the equation, and its characters from `from` to before `to`, in UTF-16 units as in the browser.
    #[serde(skip_serializing_if = "Option::is_none")]
    equation: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    from: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    to: Option<usize>,
}

impl From<Error> for Told {
    fn from(error: Error) -> Self {
        let mut message = error.to_string();
        let mut cause = error.source();
        while let Some(inner) = cause {
            let text = inner.to_string();
            if !message.contains(&text) {
                message = format!("{message}: {text}");
            }
            cause = inner.source();
        }
        let place = match &error {
            Error::Formula(e) => Some((e.equation, e.from, e.to)),
            _ => None,
        };
        Self {
            message,
            equation: place.map(|p| p.0),
            from: place.map(|p| p.1),
            to: place.map(|p| p.2),
        }
    }
}

/// Rejects values outside a closed interval, and NaN.
pub(crate) fn within(
    what: &str,
    value: f64,
    (lower, upper): (f64, f64),
    range: &'static str,
) -> Result<(), Error> {
    match value >= lower && value <= upper {
        true => Ok(()),
        false => Err(Error::Value {
            what: what.to_owned(),
            value,
            range,
        }),
    }
}

/// Rejects bounds beyond a million, and intervals that are empty or of negligible width.
pub(crate) fn interval(what: &str, [lower, upper]: [f64; 2]) -> Result<(), Error> {
    within(what, lower, (-1e6, 1e6), "between -1e6 and 1e6")?;
    within(what, upper, (-1e6, 1e6), "between -1e6 and 1e6")?;
    within(
        &format!("the width of {what}"),
        upper - lower,
        (1e-6, 2e6),
        "at least 1e-6",
    )
}
