//! Piecewise-smooth equations: correctors, continuation through kinks, contact with friction.

pub mod linear;
pub mod sparse;
