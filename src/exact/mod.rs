//! Exact arithmetic for decisions that rounding must not make: floating-point data are exact rational numbers.

mod bounds;
mod contradiction;
mod determinant;
mod dictionary;
mod number;

pub(crate) use bounds::passive_bounds;
pub(crate) use contradiction::contradict;
pub(crate) use determinant::{determinant_sign, parity};
pub(crate) use dictionary::{Dictionary, Halt, LOOKED_AT, Place, quotient};
pub use number::Exact;
