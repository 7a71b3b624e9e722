//! Errors in .nl files, with their places.

use std::fmt;

use thiserror::Error;

/// A place in a file: a line of a text file or a byte of a binary one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// Line, from 1.
    Line(usize),
    /// Offset in bytes, from 0.
    Byte(usize),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// A file that cannot be parsed, with the place of the first fault.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{at}: {fault}")]
pub struct NlError {
    /// Where the fault is.
    pub at: Position,
    /// What is wrong there.
    pub fault: Fault,
}

/// What is wrong at one place of a file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Fault {
    /// An unexpected token.
    #[error("expected {what}, found {found}")]
    Expected {
        /// What is expected.
        what: &'static str,
        /// What the file has, truncated if it is long.
        found: String,
    },
    /// The file ends too early.
    #[error("the file ends where {what} should follow")]
    End {
        /// What is missing.
        what: &'static str,
    },
    /// A number or an index is out of its range.
    #[error("{what} {value} is out of range; it must be {range}")]
    Range {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: String,
        /// The range.
        range: String,
    },
    /// A count that the rest of the file cannot hold.
    #[error("{count} {what} are announced, more than the rest of the file can hold")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many.
        count: usize,
    },
    /// An operator that this program does not know, or that has no numeric value.
    #[error("operator o{0} is not supported")]
    Operator(usize),
    /// A call of an imported function, whose code this program does not have.
    #[error("function {0} is imported from a library, and cannot be called here")]
    Function(String),
    /// A string where a number is needed.
    #[error("a string stands where a numeric expression is needed")]
    Text,
    /// A letter that begins no segment.
    #[error("no segment begins with {0:?}")]
    Segment(char),
    /// Something that is given twice.
    #[error("{what} {index} is given twice")]
    Twice {
        /// What.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
    },
    /// A defined variable that is used before its V segment.
    #[error("v{0} is used before its V segment")]
    Undefined(usize),
    /// A required segment that is missing.
    #[error("segment {0:?} is missing")]
    Missing(char),
    /// Column counts that differ from those of the J segments.
    #[error("column {column} has {found} entries in the J segments, but {announced} are announced")]
    Columns {
        /// Column, from 0.
        column: usize,
        /// Entries announced by the k segment.
        announced: usize,
        /// Entries found.
        found: usize,
    },
    /// Fewer or more entries than the header announces.
    #[error("the {segment} segments have {found} entries, but the header announces {announced}")]
    Entries {
        /// Letter of the segments.
        segment: char,
        /// Entries announced.
        announced: usize,
        /// Entries found.
        found: usize,
    },
    /// A J segment that lacks a variable on which the row depends.
    #[error("row {row} depends on variable {variable}, which its J segment does not list")]
    Unlisted {
        /// Row, from 0.
        row: usize,
        /// Variable, from 0.
        variable: usize,
    },
    /// A binary file with an unsupported number format.
    #[error(
        "binary files with arithmetic of kind {0} are not supported; 1 (IEEE, little endian) and 2 (IEEE, big endian) are"
    )]
    Arithmetic(usize),
}
