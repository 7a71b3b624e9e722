//! Piecewise-smooth equations: solve them, follow their solution curves through every kink, list all their solutions.
//!
//! For equations that are continuous but only piecewise smooth: contact with Coulomb friction, obstacle problems, economic and traffic
//! equilibria, complementarity problems, circuits with diodes. The [guide] is an introduction; the [prelude] has the names most programs
//! need. Modules:
//!
//! | | |
//! |---|---|
//! | [`piecewise`] | the trait for maps: sites, pieces, selections, test functions |
//! | [`newton`] | the corrector for H(x) = 0 |
//! | [`continuation`] | solution curves, transitions, branches, diagrams, curves in two parameters |
//! | [`enumeration`] | all solutions at a parameter, all arms at a point, with certificates |
//! | [`complementarity`] | LCP, NCP, MCP, obstacle problems |
//! | [`variational`] | variational inequalities over polyhedra |
//! | [`cones`] | complementarity over second-order and semidefinite cones |
//! | [`interface`] | any nonsmooth law on few traces of a definite operator |
//! | [`fem`], [`contact`] | linear elasticity on meshes, Coulomb friction in the plane and in space |
//! | [`output`] | tables, JSON, pictures, VTU |
//! | [`sensitivity`] | derivatives of solutions in parameters, one-sided ones at kinks |
//! | [`stability`] | eigenvalues along curves of equilibria, Hopf points, equilibria at kinks |
//! | [`optimise`] | functions of solutions minimised over parameters |
//! | [`linear`], [`sparse`] | linear solvers behind one trait, sparse matrices |
//! | [`sweep`] | many problems at once |
//! | [`fallible`] | functions that may fail: their errors come back unchanged |

#![warn(missing_docs, unreachable_pub)]
// Badges of features, where the documentation is built by docs.rs.
#![cfg_attr(docsrs, feature(doc_cfg))]

// Files shared by the unit tests and the programs in `tests` refer to the crate by name.
#[cfg(test)]
extern crate self as semismooth;

mod bodies;
mod cause;
mod clock;
pub mod complementarity;
pub mod cones;
pub mod contact;
pub mod continuation;
#[cfg(feature = "autodiff")]
mod doors;
pub mod enumeration;
mod exact;
#[cfg(feature = "serde")]
mod extended;
pub mod fallible;
pub mod fem;
pub mod guide;
mod input;
pub mod interface;
mod judge;
pub mod linear;
pub mod newton;
pub mod optimise;
mod options;
pub mod output;
mod parallel;
pub mod piecewise;
pub mod prelude;
pub mod run;
pub mod sensitivity;
pub mod sparse;
mod spread;
pub mod stability;
pub mod sweep;
mod tolerances;
pub mod variational;
mod words;

pub use bodies::{contact_body, contact_problem, reduced_body};
pub use cause::Cause;
#[cfg(feature = "autodiff")]
pub use doors::{
    ImplicitFormula, McpResult, Solution, SolveError, ViResult, all_solutions, diagram, follow, implicit,
    minimise, parametric, parametric_mcp, solve, solve_cone, solve_lcp, solve_mcp, solve_qp, solve_vi,
};
pub use input::InputError;

/// The example of the README, compiled with the tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
