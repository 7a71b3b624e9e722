//! The ledger of numbers that several files of contact share: value, unit, where it comes from, the test that
//! fixes it.

use crate::tolerances::ROUNDING;

/// Largest residual of a solution relative to the largest force, the default of
/// [`ReducedOptions`](super::ReducedOptions).
pub(super) const SOLVED: f64 = 1e-10;

/// Part of the terms that cancel in a force below which their rounding is more than [`SOLVED`] of it: a body
/// that its supports have moved up to its foundation has no other forces.
pub(super) const BLURRED: f64 = ROUNDING / SOLVED;

/// Largest number of pressures and tractions with which the condensed form, whose matrices are dense, is
/// tried.
pub(super) const CONDENSED: usize = 10_000;

/// The augmentation parameter relative to the stiffness of a single contact node with all other nodes fixed:
/// on meshes a node is about four times as compliant, as its neighbours move with it.
pub(super) const RELATIVE_R: f64 = 0.25;
