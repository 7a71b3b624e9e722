//! Complete lists: all solutions of a piecewise-affine equation at a fixed parameter, all arms of a solution set at a point.
//!
//! Where the pieces are affine both are finite problems: choose a piece at every site such that the equalities and the cell
//! conditions of all chosen pieces hold together. The search chooses site after site, eliminates the equalities of the piece, and
//! drops a partial choice as soon as a linear program shows that no point satisfies what has been decided and what all pieces of
//! the open sites have in common. Kᵖ selections are never stored; each pruned partial choice counts the selections it rules out.
//!
//! Lists are proven where the map states its coefficients exactly: see [`all_solutions`], and [`all_arms`] for the point of which they are.
//!
//! [`all_solutions`] and [`all_arms`] prune the search for maps that state their coefficients, for those whose residuals belong each to few
//! sites ([`site_rows`](crate::piecewise::PiecewiseSmooth::site_rows)), and for those whose residuals are sums over sites, which is tested;
//! for other maps selections are enumerated one by one, up to the cap.

mod arms;
mod certificate;
mod enclosure;
mod error;
mod exhaustive;
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
mod search;
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
pub(crate) use local::local_selections;
pub use options::EnumerationOptions;
pub use solutions::{all_solutions, all_solutions_until};
