//! Events along a curve: detection within a step, location, coincidence, and the arms that leave.

pub(super) mod arms;
mod branch_point;
mod branching;
pub(super) mod coincidence;
mod heading;
mod leave;
pub(super) mod locate;
mod monitor;
mod singular;
pub(super) mod turn;
mod units;
mod unseen;
pub(super) mod watch;
