//! What may happen along a curve: where exactly, which of it happens together, and what leaves from there.

pub(super) mod arms;
mod branch_point;
pub(super) mod coincidence;
pub(super) mod locate;
mod monitor;
mod singular;
pub(super) mod transition;
pub(super) mod watch;
