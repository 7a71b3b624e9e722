//! Checks of the book: runs the programs of its lessons, compares what they print and draw with what the text shows, and typesets
//! formulas for mdBook.

mod compare;
pub mod formulas;
mod guide;
pub mod record;
mod shown;

/// A result whose error is a message.
pub type Outcome<T> = Result<T, Box<dyn std::error::Error>>;
