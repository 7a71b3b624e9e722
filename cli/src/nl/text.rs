//! Tokens of text files.

use super::{Fault, NlError, Position, Source};

/// A text file: tokens separated by blanks, lines that may end in a comment.
#[derive(Debug, Clone)]
pub struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// Line of the token read last.
    seen: usize,
}

impl<'a> Text<'a> {
    /// The file from its first byte on.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            line: 1,
            seen: 1,
        }
    }

    /// How many bytes have been read.
    #[must_use]
    pub fn offset(&self) -> usize {
        self.at
    }

    /// The next number on this line, if there is one.
    pub fn optional(&mut self) -> Result<Option<f64>, NlError> {
        match self.at_end_of_line() {
            true => Ok(None),
            false => self.number("a number").map(Some),
        }
    }

    /// The next integer on this line, or 0.
    pub fn optional_index(&mut self, what: &'static str) -> Result<usize, NlError> {
        match self.at_end_of_line() {
            true => Ok(0),
            false => self.index(what),
        }
    }

    /// Goes to the next line and skips the rest of this one.
    pub fn skip_line(&mut self) -> Result<(), NlError> {
        while let Some(&b) = self.bytes.get(self.at) {
            self.at += 1;
            if b == b'\n' {
                self.line += 1;
                break;
            }
        }
        Ok(())
    }

    fn skip_blanks(&mut self) {
        while let Some(b' ' | b'\t' | b'\r') = self.bytes.get(self.at) {
            self.at += 1;
        }
        self.seen = self.line;
    }

    fn at_end_of_line(&mut self) -> bool {
        self.skip_blanks();
        matches!(self.bytes.get(self.at), None | Some(b'\n' | b'#'))
    }

    /// The bytes up to the next blank.
    fn word(&mut self, what: &'static str) -> Result<&'a [u8], NlError> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let length = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        if rest.is_empty() {
            return Err(self.fail(Fault::End { what }));
        }
        if length == 0 {
            return Err(self.expected(what, b"the end of the line"));
        }
        self.at += length;
        Ok(&rest[..length])
    }

    fn expected(&self, what: &'static str, found: &[u8]) -> NlError {
        let shown = &found[..found.len().min(40)];
        self.fail(Fault::Expected {
            what,
            found: String::from_utf8_lossy(shown).into_owned(),
        })
    }

    fn parse<T: std::str::FromStr>(&mut self, what: &'static str) -> Result<T, NlError> {
        let word = self.word(what)?;
        let parsed = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        parsed.ok_or_else(|| self.expected(what, word))
    }
}

impl Source for Text<'_> {
    fn position(&self) -> Position {
        Position::Line(self.seen)
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn tag(&mut self) -> Result<Option<u8>, NlError> {
        self.skip_blanks();
        let tag = self.bytes.get(self.at).copied();
        self.at += usize::from(tag.is_some());
        if tag == Some(b'\n') {
            return Err(self.expected("a segment, an expression or a bound", b"an empty line"));
        }
        Ok(tag)
    }

    fn integer(&mut self, what: &'static str) -> Result<i32, NlError> {
        self.parse(what)
    }

    fn short(&mut self, what: &'static str) -> Result<i16, NlError> {
        self.parse(what)
    }

    fn number(&mut self, what: &'static str) -> Result<f64, NlError> {
        self.parse(what)
    }

    fn name(&mut self) -> Result<String, NlError> {
        let word = self.word("a name")?;
        Ok(String::from_utf8_lossy(word).into_owned())
    }

    fn end_line(&mut self) -> Result<(), NlError> {
        if !self.at_end_of_line() {
            let word = self.word("the end of the line")?;
            return Err(self.expected("the end of the line", word));
        }
        self.skip_line()
    }
}
