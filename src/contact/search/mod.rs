//! The search for a solution at fixed parameter.

mod lowering;
mod options;
mod reduced;
mod solve;
mod springs;
mod strategy;
mod tries;

pub use options::ContactOptions;
pub(super) use reduced::ReducedNewton;
pub use strategy::{ContactAttempt, ContactProgress, ContactReport, ContactStrategy};
