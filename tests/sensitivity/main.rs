//! Derivatives of solutions: against exact arithmetic at kinks, differences away from them, and each other.
#![cfg(feature = "autodiff")]

#[path = "../common/random.rs"]
mod random;

mod bodies;
mod cones;
mod contact;
mod degenerate;
mod exact;
mod history;
mod kinks;
mod nested;
mod parameters;
mod ranges;
mod rational;
mod smooth;
mod symmetry;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
