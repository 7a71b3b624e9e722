//! Complementarity problems.

mod lcp;
pub mod pivoting;

pub use lcp::{Lcp, LcpError};
