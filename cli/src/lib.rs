//! Complementarity problems and first-order conditions of nonlinear programs from AMPL's .nl files: the parts of the program
//! `semismooth`.
//!
//! [`nl`] reads a file into a [`model`] over the expressions of a [`graph`]; [`solve`] turns the model into a mixed complementarity problem
//! ([`square`], or [`program`] if it has an objective; [`mpec`] minimises over the variables that complementarities leave), solves it and classifies the result ([`second_order`]: whether a KKT point is a
//! minimum); [`solution`] writes the .sol file, [`options`] are those of the command line, [`cli`] is the program.

pub mod cli;
pub mod commands;
pub mod graph;
pub mod matching;
pub mod model;
pub mod mpec;
pub mod names;
pub mod nl;
pub mod options;
pub mod program;
pub mod second_order;
pub mod solution;
pub mod solve;
pub mod square;
