//! Lines, words and numbers of mesh files, as text and binary.

use std::path::Path;

use super::FemError;
use crate::InputError;
use crate::words::SHOWN;

/// The beginning of a text of any length, for messages.
pub(super) fn shorten(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text.to_owned(),
    }
}

/// A place in a file.
pub(super) struct Reader<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
    pub(super) path: &'a Path,
    pub(super) binary: bool,
    pub(super) swapped: bool,
}

impl Reader<'_> {
    pub(super) fn fail(&self, what: impl Into<String>) -> FemError {
        let before = &self.bytes[..self.at.min(self.bytes.len())];
        let line = 1 + before.iter().filter(|b| **b == b'\n').count();
        let mut what = what.into();
        if self.binary {
            what += &format!(" (byte {})", self.at);
        }
        FemError::Input(InputError::Parse {
            path: self.path.into(),
            line,
            what,
            source: None,
        })
    }

    /// Name after the next `$` at the beginning of a line.
    pub(super) fn next_section(&mut self) -> Option<String> {
        while self.at < self.bytes.len() {
            let line = self.line();
            if let Some(name) = line.trim().strip_prefix('$') {
                return Some(name.to_owned());
            }
        }
        None
    }

    pub(super) fn line(&mut self) -> String {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        self.at = (self.at + end + 1).min(self.bytes.len());
        String::from_utf8_lossy(&rest[..end]).into_owned()
    }

    pub(super) fn skip_to_end(&mut self, section: &str) -> Result<(), FemError> {
        let mark = format!("$End{section}");
        let rest = &self.bytes[self.at..];
        match rest.windows(mark.len()).position(|w| w == mark.as_bytes()) {
            Some(k) => {
                self.at += k;
                self.line();
                Ok(())
            }
            None => Err(self.fail(format!(
                "section ${0} is not closed by $End{0}: the file is truncated",
                shorten(section)
            ))),
        }
    }

    pub(super) fn token(&mut self) -> Result<&str, FemError> {
        let start = self.at
            + self.bytes[self.at..]
                .iter()
                .position(|b| !b.is_ascii_whitespace())
                .unwrap_or(0);
        let length = self.bytes[start..]
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(self.bytes.len() - start);
        if length == 0 {
            return Err(self.fail("the file ends where a number is expected"));
        }
        self.at = start + length;
        std::str::from_utf8(&self.bytes[start..start + length]).map_err(|_| {
            FemError::Input(InputError::Parse {
                path: self.path.into(),
                line: 0,
                what: "the text is not UTF-8".into(),
                source: None,
            })
        })
    }

    pub(super) fn number<T: std::str::FromStr>(&mut self) -> Result<T, FemError> {
        let token = self.token()?.to_owned();
        token.parse().map_err(|_| {
            let found = shorten(&token);
            self.fail(format!("\"{found}\" is not the number that should be here"))
        })
    }

    pub(super) fn raw<const N: usize>(&mut self) -> Result<[u8; N], FemError> {
        match self.bytes.get(self.at..self.at + N) {
            Some(slice) => {
                let mut raw = [0; N];
                raw.copy_from_slice(slice);
                if self.swapped {
                    raw.reverse();
                }
                self.at += N;
                Ok(raw)
            }
            None => Err(self.fail("the file ends within binary data")),
        }
    }

    pub(super) fn int(&mut self) -> Result<i64, FemError> {
        if self.binary {
            Ok(i32::from_le_bytes(self.raw()?).into())
        } else {
            self.number()
        }
    }

    pub(super) fn size(&mut self) -> Result<u64, FemError> {
        if self.binary {
            Ok(u64::from_le_bytes(self.raw()?))
        } else {
            self.number()
        }
    }

    pub(super) fn double(&mut self) -> Result<f64, FemError> {
        if self.binary {
            Ok(f64::from_le_bytes(self.raw()?))
        } else {
            self.number()
        }
    }

    pub(super) fn point(&mut self) -> Result<[f64; 3], FemError> {
        Ok([self.double()?, self.double()?, self.double()?])
    }
}
