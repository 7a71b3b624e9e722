//! Where *solved* is decided for complementarity problems, variational inequalities, cones and Delassus problems: a solver proposes a point,
//! the judge decides. Newton's method has its own test, `newton/convergence.rs`, and asks here what rounding hides far out.
//!
//! [`Judge`] decides for equations, complementarity problems and whatever else is solved row by row; the laws of cones and of contact are
//! checked as laws in [`laws`].

mod columns;
mod constants;
mod equilibrate;
pub(crate) mod laws;
mod parts;
mod rows;
mod units;

pub(crate) use columns::Columns;
pub(crate) use constants::{Emptiness, slack};
pub(crate) use equilibrate::{equilibrate, power_below, row_sizes};
pub(crate) use parts::Parts;
pub(crate) use rows::{Judge, Point, Verdict};
pub(crate) use units::{Sizes, Units};
