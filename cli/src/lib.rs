//! Complementarity problems and first-order conditions of nonlinear programs from AMPL's .nl files: the parts of the program
//! `semismooth`.
//!
//! [`nl`] reads a file into a [`model`] over the expressions of a [`graph`]; [`solve`] makes a mixed complementarity problem of it
//! ([`square`], or [`program`] where there is something to optimise) and says how that ended ([`second_order`]: whether it is a minimum); [`solution`] is the file with the
//! answer, [`options`] are those of the command line, [`cli`] is the program.

pub mod cli;
pub mod commands;
pub mod graph;
pub mod matching;
pub mod model;
pub mod names;
pub mod nl;
pub mod options;
pub mod program;
pub mod second_order;
pub mod solution;
pub mod solve;
pub mod square;
