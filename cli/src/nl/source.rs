//! The tokens of both forms of the format.

use super::{Fault, NlError, Position};

/// Reads tokens one after the other. Text and binary files have the same tokens in the same order.
pub trait Source {
    /// The place of the token that was read last.
    fn position(&self) -> Position;

    /// Bytes that are left: an upper bound for every count in the file.
    fn remaining(&self) -> usize;

    /// The letter that begins a segment, an expression or a bound; `None` at the end of the file.
    fn tag(&mut self) -> Result<Option<u8>, NlError>;

    /// An integer of 32 bits.
    fn integer(&mut self, what: &'static str) -> Result<i32, NlError>;

    /// An integer of 16 bits.
    fn short(&mut self, what: &'static str) -> Result<i16, NlError>;

    /// A floating-point number.
    fn number(&mut self, what: &'static str) -> Result<f64, NlError>;

    /// A name: of a function, of a suffix.
    fn name(&mut self) -> Result<String, NlError>;

    /// In a text file, goes to the next line; the rest of the current one may only be a comment.
    fn end_line(&mut self) -> Result<(), NlError>;

    /// The error of this kind at the token read last.
    fn fail(&self, fault: Fault) -> NlError {
        NlError {
            at: self.position(),
            fault,
        }
    }

    /// An integer that is not negative.
    fn index(&mut self, what: &'static str) -> Result<usize, NlError> {
        let value = self.integer(what)?;
        usize::try_from(value).map_err(|_| self.out_of_range(what, value, "at least 0"))
    }

    /// An integer from 0 to `end` − 1.
    fn index_below(&mut self, what: &'static str, end: usize) -> Result<usize, NlError> {
        let value = self.index(what)?;
        match value < end {
            true => Ok(value),
            false => Err(self.out_of_range(what, value, format_args!("less than {end}"))),
        }
    }

    /// A number of items that take at least one byte each.
    fn count(&mut self, what: &'static str) -> Result<usize, NlError> {
        let count = self.index(what)?;
        self.can_hold(count, what)
    }

    /// `count`, if the rest of the file can hold that many items.
    fn can_hold(&self, count: usize, what: &'static str) -> Result<usize, NlError> {
        match count <= self.remaining() {
            true => Ok(count),
            false => Err(self.fail(Fault::TooMany { what, count })),
        }
    }

    /// The error for a number out of its range.
    fn out_of_range(
        &self,
        what: &'static str,
        value: impl std::fmt::Display,
        range: impl std::fmt::Display,
    ) -> NlError {
        self.fail(Fault::Range {
            what,
            value: value.to_string(),
            range: range.to_string(),
        })
    }
}
