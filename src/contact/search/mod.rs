//! The search for a solution at fixed parameter.

mod attempts;
mod lowering;
mod options;
mod reduced;
mod solve;
mod springs;
mod strategy;
mod tries;

pub use attempts::{ContactAttempt, ContactProgress, ContactReport, ContactStrategy};
pub use options::ContactOptions;
pub(super) use reduced::ReducedNewton;
