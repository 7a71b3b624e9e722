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

/// How many random problems a test examines: as many as a variable of the environment says, or the default.
fn cases(variable: &str, default: u64) -> u64 {
    let said = std::env::var(variable).ok();
    said.and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
