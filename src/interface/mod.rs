//! A constant operator with a nonsmooth law on few of its quantities, in full and condensed form.
//!
//! ```text
//! A u + Bᵀ λ = f(α),   G(B u, λ, α) = 0
//! ```
//!
//! A is n × n, B is q × n with q ≪ n, and only G switches: contact, diodes in a network, valves in a pipe system, a membrane over
//! few stops. [`Interface`] is the map, in one of two views: [`InterfaceProblem`] of x = (u, λ, α), and, where A is symmetric and
//! positive definite, [`CondensedInterface`] of x = (λ, α), with v = B A⁻¹ f(α) − C λ, C = B A⁻¹ Bᵀ. Both have the sites and
//! pieces of G, the same solutions, transitions and signs of determinants, so that whatever the crate does with one it does with the
//! other; displacements, residuals, tangents and determinants of the full form come back on demand. Contact is the case where G is one
//! law at each node ([`contact`](crate::contact)).

mod condensed;
mod error;
mod exact;
mod full;
mod load;
mod map;
mod operator;
mod sizes;
mod view;

pub use error::InterfaceError;
pub(crate) use error::LENGTH;
pub(crate) use load::SupportState;
pub use load::{LoadCase, LoadPath};
pub use map::{CondensedInterface, Interface, InterfaceProblem};
pub(crate) use operator::Operator;
pub(crate) use sizes::{fill_sizes, typical_sizes};
pub use view::{CondensedView, FullView, View};
