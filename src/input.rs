//! What can be wrong with data, in the same words for all modules.

use std::path::PathBuf;

use thiserror::Error;

use crate::Cause;
use crate::words::alternatives;

/// What is wrong with data: vectors, matrices, options, names, files. The errors of the modules carry it and add what their subject is.
///
/// ```
/// use semismooth::InputError;
/// use semismooth::fem::CellKind;
/// use semismooth::sparse::Matrix;
/// assert_eq!("triangle".parse(), Ok(CellKind::Triangle));
/// let wrong = "prism".parse::<CellKind>().unwrap_err();
/// assert!(wrong.to_string().starts_with("\"prism\" is no kind of cell: write triangle, quadrilateral, "));
/// let outside = Matrix::from_triplets(1, 1, &[(0, 1, 2.0)]);
/// assert!(matches!(outside, Err(InputError::OutOfBounds { col: 1, ncols: 1, .. })));
/// ```
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum InputError {
    /// A vector or list has the wrong length.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which one.
        what: &'static str,
        /// Length required.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A number of rows, columns or variables does not fit the other parts.
    #[error("{what} must be {expected}, found {found}")]
    Size {
        /// Which part, and which of its sizes.
        what: &'static str,
        /// The size that the other parts require.
        expected: usize,
        /// The size given.
        found: usize,
    },
    /// A matrix has the wrong shape.
    #[error("{what} is {found_rows} x {found_cols}, expected {rows} x {cols}")]
    Shape {
        /// Which matrix.
        what: &'static str,
        /// Rows expected.
        rows: usize,
        /// Columns expected.
        cols: usize,
        /// Rows given.
        found_rows: usize,
        /// Columns given.
        found_cols: usize,
    },
    /// An entry of a vector is NaN or infinite.
    #[error("{what}[{index}] = {value} is not finite")]
    NotFinite {
        /// Which vector.
        what: &'static str,
        /// Position, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// An entry of a matrix is NaN or infinite.
    #[error("entry ({row}, {col}) is {value}; all entries must be finite")]
    Entry {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        col: usize,
        /// Its value.
        value: f64,
    },
    /// An entry lies outside its matrix.
    #[error("entry ({row}, {col}) lies outside a {nrows} x {ncols} matrix; indices count from 0")]
    OutOfBounds {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        col: usize,
        /// Number of rows.
        nrows: usize,
        /// Number of columns.
        ncols: usize,
    },
    /// Column pointers or row indices do not describe a matrix in compressed-column form.
    #[error("not a compressed-column pattern: {what}")]
    Malformed {
        /// Which rule is broken, and where.
        what: String,
    },
    /// A matrix that must be symmetric is not.
    #[error(
        "{what} is not symmetric: entries ({row}, {col}) and ({col}, {row}) differ by {difference:e}; use the full form"
    )]
    NotSymmetric {
        /// Which matrix.
        what: &'static str,
        /// Row of the worst entry, from 0.
        row: usize,
        /// Its column, from 0.
        col: usize,
        /// |a_ij − a_ji|.
        difference: f64,
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
    /// A word that names no value of an enum.
    #[error("\"{found}\" is no {what}: write {}", alternatives(known))]
    Name {
        /// What should have been named.
        what: &'static str,
        /// The word found; of a long one its beginning.
        found: String,
        /// The words there are.
        known: Vec<&'static str>,
    },
    /// A file could not be read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: Cause,
    },
    /// A line of a file is not in the format it should be in.
    #[error("{path}, line {line}: {what}", path = path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was found and what was expected.
        what: String,
        /// The underlying error, if there is one: of the JSON, or of the matrix that the file describes.
        source: Option<Cause>,
    },
    /// A file lacks a member, or has one that is malformed.
    #[error("{path}: {what}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        what: String,
        /// The underlying error, if there is one.
        source: Option<Cause>,
    },
}

/// Checks a length.
pub(crate) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), InputError> {
    match found == expected {
        true => Ok(()),
        false => Err(InputError::Length {
            what,
            expected,
            found,
        }),
    }
}

/// Checks that the entries of a vector are finite.
pub(crate) fn check_finite(what: &'static str, v: &[f64]) -> Result<(), InputError> {
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(InputError::NotFinite {
            what,
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}

/// Checks the length of a vector and that its entries are finite.
pub(crate) fn check_vector(what: &'static str, v: &[f64], expected: usize) -> Result<(), InputError> {
    check_length(what, v.len(), expected)?;
    check_finite(what, v)
}

/// Checks a number of rows, columns or variables.
pub(crate) fn check_size(what: &'static str, expected: usize, found: usize) -> Result<(), InputError> {
    match expected == found {
        true => Ok(()),
        false => Err(InputError::Size {
            what,
            expected,
            found,
        }),
    }
}

/// An option: its name, its value, whether that is allowed, and what is.
pub(crate) type Check = (&'static str, f64, bool, &'static str);

pub(crate) fn positive(name: &'static str, value: f64) -> Check {
    let fine = value > 0.0 && value.is_finite();
    (name, value, fine, "positive and finite")
}

pub(crate) fn not_negative(name: &'static str, value: f64) -> Check {
    let fine = value >= 0.0 && value.is_finite();
    (name, value, fine, "finite and at least 0")
}

pub(crate) fn fraction(name: &'static str, value: f64) -> Check {
    (name, value, value > 0.0 && value < 1.0, "in (0, 1)")
}

/// At least one of what is counted.
pub(crate) fn any(name: &'static str, value: u64) -> Check {
    (name, value as f64, value > 0, "at least 1")
}

/// Checks options in turn.
pub(crate) fn check_options(checks: &[Check]) -> Result<(), InputError> {
    match checks.iter().find(|check| !check.2) {
        Some(&(name, value, _, range)) => Err(InputError::Option { name, value, range }),
        None => Ok(()),
    }
}
