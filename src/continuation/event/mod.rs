//! What may happen along a curve: what lies inside a step, where exactly, what of it happens together, and what leaves from there.

pub(super) mod arms;
mod branch_point;
mod branching;
pub(super) mod coincidence;
mod leave;
mod locate;
mod monitor;
mod singular;
pub(super) mod turn;
mod units;
pub(super) mod watch;
