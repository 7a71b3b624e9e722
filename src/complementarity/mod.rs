//! Complementarity problems: LCP, NCP, box-constrained variational inequalities and MCP.
//!
//! All of them are the mixed complementarity problem MCP(F, l, u): find l ≤ x ≤ u such that, component by component,
//!
//! * xᵢ = lᵢ and Fᵢ(x) ≥ 0, or
//! * lᵢ ≤ xᵢ ≤ uᵢ and Fᵢ(x) = 0, or
//! * xᵢ = uᵢ and Fᵢ(x) ≤ 0.
//!
//! With l = 0, u = ∞ this is the nonlinear complementarity problem 0 ≤ x ⟂ F(x) ≥ 0 (LCP for affine F), with l = −∞, u = ∞ a
//! system of equations, with F = ∇f + … the first-order conditions of a program (`kkt`). Bounds may be infinite or equal.
//!
//! # Pieces
//! * [`McpFunction`] is F, with its Jacobian: [`WithJacobian`] (two closures), `Differenced` (coloured finite differences over a
//!   sparse pattern), `Autodiff` (dual numbers), [`AffineFunction`] (M x + q).
//! * [`Mcp`] is the problem: F and its bounds. It is a [`PiecewiseSmooth`](crate::piecewise::PiecewiseSmooth) map, the natural map
//!   x − mid(l, u, x − F(x)), with one site a component and the pieces lower, interior, upper. So Newton's method, continuation,
//!   transitions, diagrams and enumeration know it. A function of one variable more than values is a *parametric* MCP, its last
//!   variable the parameter.
//! * `FischerBurmeister` is the semismooth reformulation with a smooth merit function.
//! * `McpSolver` solves an MCP from any start; see there for the strategy.

pub mod active_set;
mod affine;
mod error;
mod function;
mod lcp;
mod natural;
pub mod pivoting;
mod problem;

pub use affine::AffineFunction;
pub use error::ComplementarityError;
pub use function::{McpFunction, WithJacobian};
pub use lcp::Lcp;
pub use problem::{AtParameter, Mcp};
