//! Derivatives of solutions: against exact arithmetic at kinks, differences away from them, and each other.

#[path = "../common/random.rs"]
mod random;

mod exact;
mod kinks;
mod ranges;
mod smooth;
