//! Variational inequalities over polyhedra.
//!
//! VI(F, C): find x ∈ C with F(x)ᵀ(y − x) ≥ 0 for all y ∈ C, where C = {A x ≤ b, E x = d, l ≤ x ≤ u}. Convex programs with linear
//! constraints (F a gradient), Nash equilibria, generalised ones with shared constraints and common multipliers, and Wardrop equilibria of
//! traffic are of this kind (F. Facchinei, J.-S. Pang, 2003, chapter 1).
//!
//! * [`Polyhedron`] is C; it projects points, or proves that it is empty.
//! * [`Vi`] is the problem. Its Karush–Kuhn–Tucker conditions ([`Vi::kkt`]) are an [`Mcp`](crate::complementarity::Mcp), hence a
//!   piecewise-smooth map: parametric problems are followed by [`continuation`](crate::continuation).
//! * [`ViSolver`] solves from any start, or proves that there is no solution; [`Vi::all_solutions`] lists all solutions of affine problems.

mod emptiness;
mod limits;
mod multipliers;
mod polyhedron;
mod problem;
mod projection;
mod solutions;
mod solver;

pub use multipliers::Multipliers;
pub use polyhedron::Polyhedron;
pub use problem::Vi;
pub use projection::{Infeasibility, Nearest, Projection};
pub use solutions::ViSolutions;
pub use solver::{Ray, ViReport, ViSolver};
