//! The invariants of the fuzz targets, shared with the tests of the crate.

#[path = "../../tests/fuzzed/oracles.rs"]
mod oracles;

pub use oracles::{friction, mcp, readers};
