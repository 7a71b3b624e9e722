//! Sparse patterns and matrices: the storage in which maps write their Jacobians.
//!
//! A [`Pattern`] is declared once; a [`Matrix`] shares it and is filled many times. Matrices are stored by columns
//! (CSC, zero-based, row indices strictly increasing inside a column). A *full* pattern holds every entry, so the values of a
//! matrix over it are the usual column-major dense array: small dense and large sparse problems use one type.

mod blocks;
mod coloring;
mod matrix;
mod matrix_market;
mod nodal;
mod pattern;
mod rigid;
mod substructure;
mod vector;

pub(crate) use blocks::{
    Blocks, Entry, MOST_PARTS, ROWS, RowSum, Symmetric, add_all, add_product, add_transposed,
    subtract_transposed, wide,
};
pub(crate) use coloring::Coloring;
pub use matrix::{Matrix, MatrixRef};
pub(crate) use matrix_market::replace_file;
#[cfg(feature = "json")]
pub(crate) use matrix_market::{Announced, read_matrix_if};
pub use matrix_market::{
    parse_matrix_market, parse_vector, read_matrix_market, read_vector, write_matrix_market,
};
pub use nodal::NodalMatrix;
pub(crate) use nodal::{NodalBlocks, check_nodes, own_nodes};
pub use pattern::{Pattern, PatternRef};
pub(crate) use rigid::{Place, Resistance, pieces};
pub use substructure::{Substructure, parse_substructure, read_substructure};
pub(crate) use vector::{distance, dot, max_abs, max_abs_scaled, norm, sum_abs};
