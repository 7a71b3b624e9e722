//! Laws of contact at one node.

mod coefficient;
mod frictionless;
mod given_bound;
mod multiplier;
mod node_law;
mod orthotropic;
mod planar;
mod state;

pub use coefficient::{FrictionCoefficient, FrictionCurve};
pub use frictionless::Frictionless;
pub use given_bound::GivenBound;
pub use multiplier::MultiplierCoulomb;
pub use node_law::{LocalRow, LocalValues, MAX_HISTORY, MAX_TESTS, NodeLaw, check_law};
pub use orthotropic::OrthotropicCoulomb;
pub use planar::PlanarCoulomb;
pub use state::ContactState;
