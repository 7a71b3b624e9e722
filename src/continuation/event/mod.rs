//! Events along a curve: detection within a step, location, coincidence, and the arms that leave.

pub(super) mod branch_point;
mod leave;
mod locate;
mod monitor;
mod singular;
pub(super) mod turn;
pub(super) mod watch;
