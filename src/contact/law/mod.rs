//! Laws of contact at one node: the only place where friction is written.

mod coefficient;
mod coulomb_laws;
mod given_bound;
mod multiplier_coulomb;
mod node_law;
mod state;

pub use coefficient::{FrictionCoefficient, FrictionCurve};
pub use coulomb_laws::{OrthotropicCoulomb, PlanarCoulomb};
pub use given_bound::GivenBound;
pub use multiplier_coulomb::MultiplierCoulomb;
pub use node_law::{Frictionless, LocalRow, LocalValues, MAX_HISTORY, MAX_TESTS, NodeLaw};
pub use state::ContactState;
