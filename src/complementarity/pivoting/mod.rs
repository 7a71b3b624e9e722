//! Pivoting methods for linear complementarity problems.
//!
//! [`Lemke`] follows one almost-complementary path and decides most problems of moderate size: it ends at a solution or on a ray,
//! which for many classes of matrices proves that there is none. The path may be exponentially long.

mod basis;
mod lemke;
mod options;

pub use lemke::Lemke;
pub use options::{LemkeOptions, LemkePivot, LemkeReport};
