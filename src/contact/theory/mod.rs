//! Theory of solutions: constants of the fixed-point map and consequences for uniqueness, the fixed-point iteration itself, and the
//! one-element model in closed form.

mod constants;
mod hild_renard;
mod iteration;

pub use constants::{
    FixedPointBound, UniquenessConstants, critical_friction, friction_bounds, friction_derivative,
    pressure_norm,
};

pub use hild_renard::{HildRenard, HildRenardBranch, HildRenardCase};
pub use iteration::{FixedPointOptions, FixedPointReport, fixed_point, fixed_point_observed};
