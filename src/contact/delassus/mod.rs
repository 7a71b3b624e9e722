//! Frictional contact in Delassus form, u = M r + q, in the plane and in space.

mod cone;
#[cfg(feature = "json")]
mod file;
mod interior;
mod local;
mod newton;
mod options;
mod path;
mod problem;
mod report;
mod run;
mod scaled;
mod settled;
mod solver;
mod tolerances;

#[cfg(feature = "json")]
pub use file::read_delassus;
pub use options::DelassusOptions;
pub use problem::DelassusProblem;
pub use report::{DelassusIteration, DelassusPhase, DelassusReport};
pub use solver::DelassusSolver;
