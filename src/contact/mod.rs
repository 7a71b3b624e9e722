//! Contact with friction: the discrete problem in the plane and in space, in full and condensed form. A user-defined [`NodeLaw`] may
//! replace Coulomb's law.
//!
//! Signs: u_ν ≤ gap is the admissible side, λ_ν ≥ 0 the pressure, λ_t has the sign of the slip u_t. A node is *open* (λ = 0),
//! *sticking* (u_ν = gap, u_t = 0) or *slipping* (u_ν = gap, λ_t = ±F λ_ν with ±u_t ≥ 0).

mod anchors;
mod balance;
mod body;
mod body_state;
mod conversion;
mod delassus;
mod displacements;
mod error;
mod evolution;
mod exact;
mod exported;
#[cfg(feature = "json")]
mod folder;
mod forms;
mod history;
mod law;
mod motion;
mod multipliers;
mod parameters;
mod per_node;
mod problem;
mod residuals;
mod rounding;
mod search;
mod sensitivity;
mod solution;
mod theory;
mod tolerances;
mod zero_energy;

pub use crate::interface::{LoadCase, LoadPath};
pub use body::ContactBody;
#[cfg(feature = "json")]
pub use delassus::read_delassus;
pub use delassus::{
    DelassusIteration, DelassusOptions, DelassusPhase, DelassusProblem, DelassusReport, DelassusSolver,
};
pub use displacements::{
    KrylovObserver, ReducedBody, ReducedContact, ReducedError, ReducedIteration, ReducedLevel, ReducedNodes,
    ReducedObserver, ReducedOptions, ReducedProgress, ReducedReport, ReducedSensitivity, ReducedStep,
    ReducedSystem, ReducedTimes, solve_reduced, solve_reduced_observed,
};
pub use error::ContactError;
pub use evolution::{Arrival, EvolutionOptions, EvolutionProgress, EvolutionStep, evolve, evolve_observed};
#[cfg(feature = "json")]
pub use folder::read_folder;
pub use forms::{ContactEquilibrium, ContactForm, ContactProblem};
pub use history::HistorySensitivity;
pub use law::{
    Bonded, Cohesive, ContactState, FrictionCoefficient, FrictionCurve, Frictionless, GivenBound,
    LimitedShear, LocalRow, LocalValues, MAX_HISTORY, MAX_TESTS, MultiplierCoulomb, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, Worn, check_law,
};
pub use multipliers::{check_multipliers, inf_sup_constant};
pub use parameters::ContactParameters;
pub use per_node::PerNode;
pub use problem::{CondensedContact, Contact, FullContact};
pub use residuals::ContactResiduals;
pub use search::{ContactAttempt, ContactOptions, ContactProgress, ContactReport, ContactStrategy};
pub use sensitivity::{ContactChange, ContactSensitivity};
pub use solution::{ContactEnergy, ContactSolution};
pub use theory::{
    FixedPointBound, FixedPointOptions, FixedPointReport, HildRenard, HildRenardBranch, HildRenardCase,
    UniquenessConstants, critical_friction, fixed_point, fixed_point_observed, friction_bounds,
    friction_derivative, pressure_norm,
};
