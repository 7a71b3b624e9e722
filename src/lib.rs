//! Piecewise-smooth equations: correctors, continuation through kinks, contact with friction.

#![warn(missing_docs, unreachable_pub)]

pub mod contact;
pub mod continuation;
pub mod enumeration;
pub mod linear;
pub mod newton;
pub mod piecewise;
pub mod sparse;
