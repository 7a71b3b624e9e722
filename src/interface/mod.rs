//! A constant symmetric positive definite operator with a nonsmooth law on few of its quantities, in full and condensed form.
//!
//! ```text
//! A u + Bᵀ λ = f(α),   G(B u, λ, α) = 0
//! ```
//!
//! A is n × n, B is q × n with q ≪ n, and only G switches: contact, diodes in a network, valves in a pipe system, a membrane over
//! few stops. [`InterfaceProblem`] is the map of x = (u, λ, α); [`CondensedInterface`] the same problem in x = (λ, α), with
//! v = B A⁻¹ f(α) − C λ, C = B A⁻¹ Bᵀ, from one Cholesky factorisation. Both are piecewise-smooth maps with the sites and pieces of
//! G, the same solutions, transitions and signs of determinants, so that whatever the crate does with one it does with the other;
//! displacements, residuals, tangents and determinants of the full form come back on demand.

mod condensed;
mod error;
mod full;
mod load;
mod sizes;

pub use condensed::CondensedInterface;
pub use error::InterfaceError;
pub use full::InterfaceProblem;
pub use load::InterfaceLoad;
pub(crate) use sizes::{fill_sizes, largest, typical_of, typical_sizes};
