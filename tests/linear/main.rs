//! Linear algebra: solvers, their contract, bordered systems, sparse matrices and their files.

#[path = "../maps/mod.rs"]
mod maps;
#[path = "../common/random.rs"]
mod random;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

mod bordered;
mod contract;
mod krylov;
mod large_sparse;
mod solvers;
mod sparse;
