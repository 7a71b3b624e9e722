//! Laws of contact at one node.

mod bonded;
mod coefficient;
mod cohesive;
mod frictionless;
mod given_bound;
mod limited_shear;
mod multiplier;
mod node_law;
mod orthotropic;
mod planar;
mod state;
mod worn;

use super::ContactError;

pub use bonded::Bonded;
pub use coefficient::{FrictionCoefficient, FrictionCurve};
pub use cohesive::Cohesive;
pub use frictionless::Frictionless;
pub use given_bound::GivenBound;
pub use limited_shear::LimitedShear;
pub use multiplier::MultiplierCoulomb;
pub(in crate::contact) use node_law::of_inner_law;
pub use node_law::{LocalRow, LocalValues, MAX_HISTORY, MAX_TESTS, NodeLaw, check_law};
pub use orthotropic::OrthotropicCoulomb;
pub use planar::PlanarCoulomb;
pub use state::ContactState;
pub use worn::Worn;

/// Checks bounds of forces, or coefficients, one a contact node.
fn check_bounds(what: &str, bounds: &[f64]) -> Result<(), ContactError> {
    match bounds.iter().position(|b| !(*b >= 0.0 && b.is_finite())) {
        None => Ok(()),
        Some(node) => Err(ContactError::Invalid {
            what: format!(
                "{what} at contact node {node} is {}; it must be finite and not negative",
                bounds[node]
            ),
        }),
    }
}
