//! Complementarity problems: LCP, NCP, box-constrained variational inequalities and MCP.
//!
//! All of them are the mixed complementarity problem MCP(F, l, u): find l ≤ x ≤ u such that, component by component,
//!
//! * xᵢ = lᵢ and Fᵢ(x) ≥ 0, or
//! * lᵢ ≤ xᵢ ≤ uᵢ and Fᵢ(x) = 0, or
//! * xᵢ = uᵢ and Fᵢ(x) ≤ 0.
//!
//! With l = 0, u = ∞ this is the nonlinear complementarity problem 0 ≤ x ⟂ F(x) ≥ 0 (LCP for affine F), with l = −∞, u = ∞ a
//! system of equations, with F = ∇f + … the first-order conditions of a program ([`kkt()`]). Bounds may be infinite or equal.
//!
//! # Parts
//! * [`McpFunction`] is F, with its Jacobian: [`WithJacobian`] (two closures), [`Differenced`] (coloured finite differences over a
//!   sparse pattern), `Autodiff` (dual numbers), [`AffineFunction`] (M x + q).
//! * [`Mcp`] is the problem: F and its bounds. It is a [`PiecewiseSmooth`](crate::piecewise::PiecewiseSmooth) map, the natural map
//!   x − mid(l, u, x − F(x)), with one site a component and the pieces lower, interior, upper. Newton's method, continuation, transitions,
//!   diagrams and enumeration therefore apply to it. A function with one variable more than values gives a *parametric* MCP, its last
//!   variable the parameter.
//! * [`Variables`] are named blocks of variables with their bounds, so that a model is written without arithmetic with indices.
//! * [`FischerBurmeister`] is the semismooth reformulation with a smooth merit function.
//! * [`McpSolver`] solves an MCP from any start; see there for the strategy.
//!
//! # Accuracy
//! One rule says when a point x within its bounds is a solution to a tolerance τ, whatever the units of F and of x. With f = F(x) and
//! J = ∇F(x) the *terms* of row i are the |Jᵢⱼ xⱼ| of unknowns between their bounds, its *constants* the others and |fᵢ − Σⱼ Jᵢⱼ xⱼ|, for
//! F = M x + q all |qᵢ|. Component i is solved where
//!
//! * xᵢ is at a bound, exactly, and fᵢ has the sign that belongs to it (or both bounds are equal), or
//! * |fᵢ| ≤ τ Sᵢ with the sum Sᵢ of its terms and constants. Where all of these are rounding (F = x₀ at x₀ = 1e-17, found from 1), Sᵢ is
//!   Σⱼ |Jᵢⱼ| sⱼ instead, sⱼ the largest |x_k| of its part, in units in which J is equilibrated; at the start, too, where a part has
//!   neither constants nor terms from outside.
//!
//! The *parts* are the strongly connected components of J among the unknowns that do not rest at bounds. The largest error in this sense is
//! [`McpReport::error`]. It does not change with the units of rows and unknowns. Far out more is asked: where J is singular in the part of a
//! row, |fᵢ| and the rounding of the terms together must not exceed √τ of the constants, as along the kernel of J every residual is small
//! relative to its terms. Where J is regular there, beyond rounding, and the same elsewhere (F is affine), 1e-20 x₀ = 1, x₀ − x₁ = 1 is
//! solved. Where F is curved, terms count only if they stay the same, up to a factor of two, when the components of x change to one side by
//! twice the error: near a singularity of F terms are large without a solution nearby. A residual that is only the rounding error of huge
//! terms gives [`Status::AtRounding`](crate::run::Status::AtRounding). McpSolver, [`ActiveSetSolver`](active_set::ActiveSetSolver),
//! [`Nested`](active_set::Nested), [`Lemke`](pivoting::Lemke) and [`ViSolver`](crate::variational::ViSolver) use this rule.
//! [`Newton`](crate::newton::Newton) compares residuals with their terms alone, but refuses points far out where J is singular, too.
//!
//! ```
//! use semismooth::complementarity::{Mcp, McpSolver, WithJacobian};
//!
//! // 0 ≤ x ⟂ (x − 1)² − 1.01 ≥ 0 (Billups 1995): Newton's method stops near 0, where the merit function has a local minimum.
//! let f = WithJacobian::new(
//!     1,
//!     |x: &[f64], out: &mut [f64]| out[0] = (x[0] - 1.0).powi(2) - 1.01,
//!     |x: &[f64], jac: &mut semismooth::sparse::Matrix| jac.add(0, 0, 2.0 * (x[0] - 1.0)),
//! );
//! let problem = Mcp::ncp(f)?;
//! let mut x = [0.0];
//! let mut solver = McpSolver::default();
//! let report = solver.solve(&problem, &mut x)?;
//! assert!(report.is_solved() && (x[0] - 1.0 - 1.01_f64.sqrt()).abs() < 1e-9);
//! # Ok::<(), semismooth::complementarity::ComplementarityError>(())
//! ```

mod accuracy;
pub mod active_set;
mod affine;
#[cfg(feature = "autodiff")]
mod autodiff;
mod blocks;
mod columns;
mod differences;
mod error;
mod fischer;
mod function;
mod in_units;
mod infeasible;
mod kkt;
mod lcp;
mod natural;
mod normal;
pub mod pivoting;
mod problem;
mod scratch;
mod solver;
mod strong;
mod units;
mod variables;

pub use affine::AffineFunction;
#[cfg(feature = "autodiff")]
pub use autodiff::{Autodiff, SmoothFunction};
pub use differences::{Differenced, JacobianCheck, check_jacobian};
pub use error::ComplementarityError;
pub use fischer::FischerBurmeister;
pub use function::{McpFunction, WithJacobian};
pub(crate) use in_units::InUnits;
pub use kkt::{ConstraintKind, Program, kkt};
pub use lcp::Lcp;
pub use normal::NormalMap;
pub use problem::Mcp;
#[cfg(feature = "autodiff")]
pub(crate) use problem::check_bounds;
pub(crate) use scratch::Scratch;
pub use solver::{
    BoundState, Fallback, McpIteration, McpOptions, McpReport, McpSolver, McpStep, McpStrategy,
};
pub use strong::strong_regularity;
pub use variables::{Block, Variables, VariablesView};
