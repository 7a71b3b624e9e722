//! Complete lists: all solutions of a piecewise-affine equation at a fixed parameter, all arms of a solution
//! set at a point.
//!
//! Where the pieces are affine both are finite problems: choose a piece at every site such that the
//! equalities and the cell conditions of all chosen pieces hold together. The search chooses site after site,
//! eliminates the equalities of the piece, and drops a partial selection as soon as a linear program shows
//! that no point satisfies its conditions and those common to all pieces of the undecided sites. The kᵖ
//! selections are never stored; each pruned partial selection counts the selections it excludes.
//!
//! Lists are proven complete where the map gives its coefficients exactly: see [`all_solutions`], and
//! [`all_arms`] for the point to which its list refers.
//!
//! [`all_solutions`] and [`all_arms`] prune the search for maps that give exact coefficients, for those whose
//! residuals each depend on few sites ([`site_rows`](crate::piecewise::Structure::site_rows)), and for those
//! whose residuals are sums over sites, which is tested; for other maps selections are enumerated one by one,
//! up to the cap.

mod arms;
mod certificate;
mod contradiction;
mod enclosure;
mod error;
mod exhaustive;
mod first;
mod generators;
mod hull;
mod kernel;
mod lists;
mod local;
mod monotone;
mod near;
mod options;
mod per_selection;
mod proof;
mod proven_arms;
mod reduced;
mod refutation;
mod search;
mod shape;
mod shared;
mod solutions;
mod split;
mod stated;
mod system;
mod table;

pub(crate) use arms::directional_selections;
pub use arms::{DirectionalArm, DirectionalArms, all_arms};
pub use error::EnumerationError;
pub use lists::{Completeness, Continuum, Doubt, Solution, SolutionSet};
pub(crate) use local::{Directional, NewtonStop, local_selections};
pub use options::EnumerationOptions;
pub(crate) use refutation::refutation;
pub use solutions::{all_solutions, all_solutions_until};
