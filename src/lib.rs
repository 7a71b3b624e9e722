//! Piecewise-smooth equations: correctors, continuation through kinks, contact with friction.

#![warn(missing_docs, unreachable_pub)]

pub mod complementarity;
pub mod contact;
pub mod continuation;
pub mod enumeration;
pub mod fem;
pub mod interface;
pub mod linear;
pub mod newton;
pub mod output;
pub mod piecewise;
pub mod sparse;

/// The example of the README, compiled with the tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
