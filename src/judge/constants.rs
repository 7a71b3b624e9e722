//! What is empty as stored, and what is empty however its constants were rounded, are two statements.

/// By how much a stored constant may differ from the number that was meant: half a unit in the last place, 2⁻⁵³ of itself; zero and integers
/// are meant as they are. Coefficients do not move: that would change directions.
pub(crate) fn slack(constant: f64) -> f64 {
    match constant == constant.trunc() {
        true => 0.0,
        false => 0.5 * f64::EPSILON * constant.abs(),
    }
}

/// Whether conditions have a common point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Emptiness {
    /// They have, with their numbers taken as exact.
    Feasible,
    /// They have none, but some do whose constants differ by their [`slack`].
    WithinRounding,
    /// They have none, however constants were rounded.
    Empty,
}
