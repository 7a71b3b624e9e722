//! Primal–dual active sets for linear complementarity problems, from a handful of unknowns to millions.
//!
//! An iteration guesses which components are at which bound, solves the equations of the others (the *reduced system*), and corrects the
//! guess by the signs of the result: the Newton method of the natural map, also known as block principal pivoting. It ends after finitely
//! many iterations, and needs few. [`ReducedSolver`] is the trait of solvers for reduced systems; [`Nested`] starts from coarser problems.

mod auto;
mod direct;
mod engine;
mod iterative;
mod krylov;
mod nested;
mod options;
mod reduced;
mod solver;

pub use auto::AutoReduced;
pub use direct::DirectReduced;
pub use iterative::MultigridReduced;
pub use krylov::GmresReduced;
pub use nested::{LevelReport, Nested, NestedReport};
pub use options::{ActiveSetIteration, ActiveSetOptions, ActiveSetReport, Exchange};
pub use reduced::{ReducedSolver, Start};
pub use solver::ActiveSetSolver;
