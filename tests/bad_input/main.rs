//! Bad input: each is refused by an error that names it, none panics, and no public function that can refuse is left out.

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
mod output;
mod piecewise;
mod sources;
mod sparse;
mod table;
mod variational;
