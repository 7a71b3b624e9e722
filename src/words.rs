//! Conversion of enums to and from words, and counts in sentences.

use std::fmt;

use crate::InputError;

/// Longest part of a word that an error repeats.
pub(crate) const SHOWN: usize = 40;

/// Names that an error lists.
pub(crate) const LISTED: usize = 20;

/// Words in a sentence: "a, b or c".
pub(crate) fn alternatives(known: &[&str]) -> String {
    match known {
        [rest @ .., last] if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => known.join(""),
    }
}

/// The value of that name.
pub(crate) fn find<T: Copy>(
    what: &'static str,
    found: &str,
    all: impl Iterator<Item = T> + Clone,
    name: impl Fn(T) -> &'static str,
) -> Result<T, InputError> {
    (all.clone().find(|value| name(*value) == found)).ok_or_else(|| InputError::Name {
        what,
        found: found.chars().take(SHOWN).collect(),
        known: all.map(name).collect(),
    })
}

/// A count with its noun: "1 fold", "2 folds".
pub(crate) struct Count(pub(crate) usize, pub(crate) &'static str, pub(crate) &'static str);

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(number, one, many) = self;
        write!(f, "{number} {}", if *number == 1 { one } else { many })
    }
}

/// Iterations of a method.
pub(crate) fn iterations(number: usize) -> Count {
    Count(number, "iteration", "iterations")
}

/// Selections of a map, of which there may be more than memory has addresses.
pub(crate) fn selections(number: u64) -> Count {
    Count(
        usize::try_from(number).unwrap_or(usize::MAX),
        "selection",
        "selections",
    )
}

/// A residual or another size with two digits: "0", "1.3", "2.4e-12".
pub(crate) struct Size(pub(crate) f64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0.0 => f.write_str("0"),
            v if (1.0..9.95).contains(&v.abs()) => write!(f, "{v:.1}"),
            v => write!(f, "{v:.1e}"),
        }
    }
}

/// The line common to the reports of iterations.
pub(crate) fn ended(
    f: &mut fmt::Formatter<'_>,
    status: &dyn fmt::Display,
    number: usize,
    residual: f64,
) -> fmt::Result {
    write!(
        f,
        "{status} after {}, residual {}",
        iterations(number),
        Size(residual)
    )
}

/// Something at a parameter value, which is rounded where the format says so (`{:.6}`).
pub(crate) fn at_parameter(
    f: &mut fmt::Formatter<'_>,
    what: &dyn fmt::Display,
    parameter: f64,
) -> fmt::Result {
    match f.precision() {
        Some(digits) => {
            let text = format!("{parameter:.digits$}");
            // No minus sign for a value that is rounded to 0.
            let size = text.trim_start_matches('-');
            let zero = size.bytes().all(|b| matches!(b, b'0' | b'.'));
            write!(f, "{what} at parameter {}", if zero { size } else { &text })
        }
        None => write!(f, "{what} at parameter {parameter}"),
    }
}

/// A number rounded to six digits.
pub(crate) struct Short(pub(crate) f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, size) = (self.0, self.0.abs());
        if size == 0.0 {
            return f.write_str("0");
        }
        if !(1e-4..1e6).contains(&size) {
            return write!(f, "{value:.5e}");
        }
        let digits = (5.0 - size.log10().floor()).clamp(0.0, 9.0) as usize;
        let text = format!("{value:.digits$}");
        f.write_str(match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.'),
            false => &text,
        })
    }
}

/// The first coordinates of a point, rounded to six digits.
pub(crate) struct Coordinates<'a>(pub(crate) &'a [f64]);

impl fmt::Display for Coordinates<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const FIRST: usize = 6;
        f.write_str("(")?;
        for (k, value) in self.0.iter().take(FIRST).enumerate() {
            let gap = if k > 0 { ", " } else { "" };
            write!(f, "{gap}{}", Short(*value))?;
        }
        match self.0.len().saturating_sub(FIRST) {
            0 => f.write_str(")"),
            more => write!(f, ", and {more} more)"),
        }
    }
}

/// `Display` by the method `name`, and `FromStr` from the same words.
macro_rules! named {
    ($type:ty, $what:literal, $all:expr) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = crate::InputError;

            #[doc = concat!("The ", $what, " of this name, as `Display` writes it.")]
            fn from_str(word: &str) -> Result<Self, Self::Err> {
                crate::words::find($what, word, $all.into_iter(), Self::name)
            }
        }
    };
}

pub(crate) use named;
