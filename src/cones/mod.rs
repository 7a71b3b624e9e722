//! Complementarity problems over products of half-lines, second-order cones, semidefinite matrices and free variables.
//!
//! Find x ∈ K with F(x) ∈ K* and xᵀF(x) = 0. Optimality conditions of second-order cone and semidefinite programs, friction with a given
//! bound and Coulomb friction in a fixed state of pressure are of this kind (F. Facchinei, J.-S. Pang, 2003, section 1.4; F. Alizadeh,
//! D. Goldfarb, 2003). Factors of K are [`Cone`]s, a problem is a [`ConeProblem`], and [`ConeSolver`] solves it from any start. Its
//! semismooth equations, for other methods, are [`ConeMap`]s; with parameters, for derivatives of solutions, [`ConePieces`].

mod central;
mod cone;
mod equations;
mod homogeneous;
mod interior;
mod jordan;
mod judge;
mod map;
mod options;
mod pieces;
mod problem;
mod ray;
mod report;
mod root;
mod run;
mod semidefinite;
mod solver;
mod step;

pub use cone::Cone;
pub(crate) use interior::{Image, Interior};
#[cfg(test)]
pub(crate) use jordan::jordan;
pub use map::ConeMap;
pub use options::{ConeOptions, ConeStrategy};
pub use pieces::ConePieces;
pub use problem::ConeProblem;
pub use report::{ConeIteration, ConeRay, ConeReport};
pub use semidefinite::{smat, svec};
pub use solver::ConeSolver;
