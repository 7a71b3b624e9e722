//! The invariants that the tests of the crate hold, for the targets.

#[path = "../../tests/fuzzed/oracles.rs"]
mod oracles;

pub use oracles::{friction, mcp, readers};
