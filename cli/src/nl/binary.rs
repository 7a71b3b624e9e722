//! Tokens of binary files, which begin after the header.

use super::{Fault, NlError, Position, Source};

/// A binary file: letters of one byte, integers of two and four, numbers of eight; names with their length before them.
#[derive(Debug, Clone)]
pub struct Binary<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Offset of the token read last.
    seen: usize,
    big_endian: bool,
}

impl<'a> Binary<'a> {
    /// The file from `offset`, where its header ends, on.
    #[must_use]
    pub fn new(bytes: &'a [u8], offset: usize, big_endian: bool) -> Self {
        Self {
            bytes,
            at: offset,
            seen: offset,
            big_endian,
        }
    }

    fn take<const N: usize>(&mut self, what: &'static str) -> Result<[u8; N], NlError> {
        self.seen = self.at;
        let Some(&(mut bytes)) = self.bytes.get(self.at..).and_then(<[u8]>::first_chunk::<N>) else {
            return Err(self.fail(Fault::End { what }));
        };
        self.at += N;
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl Source for Binary<'_> {
    fn position(&self) -> Position {
        Position::Byte(self.seen)
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn tag(&mut self) -> Result<Option<u8>, NlError> {
        self.seen = self.at;
        let tag = self.bytes.get(self.at).copied();
        self.at += usize::from(tag.is_some());
        Ok(tag)
    }

    fn integer(&mut self, what: &'static str) -> Result<i32, NlError> {
        self.take(what).map(i32::from_le_bytes)
    }

    fn short(&mut self, what: &'static str) -> Result<i16, NlError> {
        self.take(what).map(i16::from_le_bytes)
    }

    fn number(&mut self, what: &'static str) -> Result<f64, NlError> {
        self.take(what).map(f64::from_le_bytes)
    }

    fn name(&mut self) -> Result<String, NlError> {
        let length = self.count("bytes of a name")?;
        let name = String::from_utf8_lossy(&self.bytes[self.at..self.at + length]).into_owned();
        self.at += length;
        Ok(name)
    }

    fn end_line(&mut self) -> Result<(), NlError> {
        Ok(())
    }
}
