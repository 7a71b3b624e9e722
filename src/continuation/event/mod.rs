//! Events along a curve: detection within a step, location, coincidence, and the arms that leave.

pub(super) mod branch_point;
mod heading;
mod leave;
pub(super) mod locate;
pub(super) mod monitor;
pub(super) mod singular;
pub(super) mod turn;
mod unseen;
pub(super) mod watch;
