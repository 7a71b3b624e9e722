//! Contact with Coulomb friction: the discrete problem in the plane, in full and condensed form.
//!
//! Signs: u_ν ≤ gap is the admissible side, λ_ν ≥ 0 the pressure, λ_t has the sign of the slip u_t. A node is *open* (λ = 0),
//! *sticking* (u_ν = gap, u_t = 0) or *slipping* (u_ν = gap, λ_t = ±F λ_ν with ±u_t ≥ 0).

mod approach;
mod body;
mod body_state;
mod conversion;
mod coulomb_laws;
mod curve;
mod delassus;
mod displacements;
mod error;
mod evolution;
mod exact;
mod fixed_point;
#[cfg(feature = "json")]
mod folder;
mod given_bound;
mod hild_renard;
mod multiplier_coulomb;
mod node_law;
mod options;
mod per_node;
mod problem;
mod reduced;
mod solution;
mod state;
mod strategy;
mod tries;
mod uniqueness;

pub use crate::interface::{LoadCase, LoadPath};
pub use body::ContactBody;
pub use coulomb_laws::{OrthotropicCoulomb, PlanarCoulomb};
pub use curve::{FrictionCoefficient, FrictionCurve};
#[cfg(feature = "json")]
pub use delassus::read_delassus;
pub use delassus::{
    DelassusError, DelassusIteration, DelassusOptions, DelassusPhase, DelassusProblem, DelassusReport,
    DelassusSolver, DelassusStatus,
};
pub use displacements::{
    KrylovOutcome, ReducedBody, ReducedContact, ReducedError, ReducedIteration, ReducedNodes, ReducedOptions,
    ReducedReport, ReducedStep, ReducedStrategy, ReducedSystem, ReducedTimes, solve_reduced,
};
pub use error::ContactError;
pub use evolution::{Arrival, EvolutionOptions, EvolutionStep, evolve};
pub use fixed_point::{FixedPointOptions, FixedPointReport, fixed_point, fixed_point_observed};
#[cfg(feature = "json")]
pub use folder::{DiscreteFolder, read_folder};
pub use given_bound::GivenBound;
pub use hild_renard::{HildRenard, HildRenardBranch, HildRenardCase};
pub use multiplier_coulomb::MultiplierCoulomb;
pub use node_law::{Frictionless, LocalRow, LocalValues, MAX_HISTORY, MAX_TESTS, NodeLaw};
pub use options::ContactOptions;
pub use per_node::PerNode;
pub use problem::{CondensedContact, Contact, FullContact};
pub use solution::{ContactEnergy, ContactResiduals, ContactSolution};
pub use state::ContactState;
pub use strategy::{ContactAttempt, ContactProgress, ContactReport, ContactStrategy};
pub use uniqueness::{
    FixedPointBound, UniquenessConstants, check_multipliers, critical_friction, friction_bounds,
    friction_derivative, inf_sup_constant, pressure_norm,
};
