//! Bad input: each case is refused by an error that names it, none panics, and every public function that returns a `Result` is covered.

#[path = "../maps/mod.rs"]
mod maps;

mod complementarity;
mod cones;
mod contact;
mod continuation;
mod enumeration;
mod fem;
mod files;
mod interface;
mod linear;
mod named;
mod newton;
mod optimise;
mod output;
mod piecewise;
mod sensitivity;
mod sources;
mod sparse;
mod stability;
mod table;
mod variational;
