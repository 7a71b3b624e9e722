//! Contact with Coulomb friction: the discrete problem in the plane, in full and condensed form.
//!
//! Signs: u_ν ≤ gap is the admissible side, λ_ν ≥ 0 the pressure, λ_t has the sign of the slip u_t. A node is *open* (λ = 0),
//! *sticking* (u_ν = gap, u_t = 0) or *slipping* (u_ν = gap, λ_t = ±F λ_ν with ±u_t ≥ 0).

mod condensed;
mod delassus;
mod error;
mod family;
#[cfg(feature = "json")]
mod folder;
mod full;
mod hild_renard;
mod law;
mod paths;
mod problem;
mod start;

pub use condensed::CondensedFriction;
#[cfg(feature = "json")]
pub use delassus::read_delassus;
pub use delassus::{
    DelassusError, DelassusIteration, DelassusOptions, DelassusPhase, DelassusProblem, DelassusReport,
    DelassusSolver, DelassusState, DelassusStatus,
};
pub use error::ContactError;
pub use family::FrictionFamily;
#[cfg(feature = "json")]
pub use folder::{DiscreteFolder, read_folder};
pub use hild_renard::{HildRenard, HildRenardBranch, HildRenardCase};
pub use law::{ContactState, NodeValues, SlipBound};
pub use paths::{FrictionPath, LoadPath};
pub use problem::{FrictionMap, FrictionProblem};
pub use start::{FrictionStart, first_point};
