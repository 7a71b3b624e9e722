//! Zero-energy motions: null vectors of A.

use crate::linear::{Cholesky, LinearSolver};
use crate::sparse::{Matrix, dot};
use crate::spread::Random;
use crate::tolerances::{RESULT, SIX_DIGITS};

/// The shift added to the matrix scaled to unit diagonal, and the number of inverse iterations with it.
const SHIFT: f64 = 1e-10;
const STEPS: usize = 8;

/// Largest number of zero-energy motions that are looked for: those of two solids, or of four plane bodies.
const MOTIONS: usize = 12;

/// A random start of inverse iteration.
pub(super) fn random_start(n: usize) -> Vec<f64> {
    let mut random = Random::new(5);
    (0..n).map(|_| random.symmetric()).collect()
}

/// The index of the largest modulus.
pub(super) fn largest(z: &[f64]) -> usize {
    let by_modulus = |i: &usize, j: &usize| z[*i].abs().total_cmp(&z[*j].abs());
    (0..z.len()).max_by(by_modulus).unwrap_or(0)
}

/// A zero-energy motion, A z = 0 up to rounding with a largest displacement of 1, by inverse iteration from
/// `start`, which must not be orthogonal to it. `None` where there is no such motion.
pub(super) fn free_motion(a: &Matrix, start: Vec<f64>) -> Option<Vec<f64>> {
    let n = a.nrows();
    let mut scale = vec![0.0; n];
    for (i, _, v) in a.triplets().filter(|t| t.0 == t.1) {
        scale[i] = v;
    }
    if !scale.iter().all(|d| *d >= 0.0) {
        return None;
    }
    scale
        .iter_mut()
        .for_each(|d| *d = if *d > 0.0 { 1.0 / d.sqrt() } else { 1.0 });
    let mut scaled: Vec<_> = a
        .triplets()
        .map(|(i, j, v)| (i, j, v * scale[i] * scale[j]))
        .collect();
    let entries = scaled.len();
    scaled.extend((0..n).map(|k| (k, k, SHIFT)));
    let shifted = Matrix::from_triplets(n, n, &scaled).ok()?;
    let mut cholesky = Cholesky::new();
    cholesky.analyze(shifted.pattern().as_ref()).ok()?;
    cholesky.factor(shifted.as_ref()).ok()?;
    let mut z = start;
    z.iter_mut().zip(&scale).for_each(|(z, d)| *z *= d);
    for _ in 0..STEPS {
        cholesky.solve_in_place(&mut z).ok()?;
        let size = z[largest(&z)].abs();
        z.iter_mut().for_each(|v| *v /= size);
    }
    let (mut energy, mut terms) = (0.0f64, 0.0);
    for &(i, j, v) in &scaled[..entries] {
        let term = v * z[i] * z[j];
        energy += term;
        terms += term.abs();
    }
    // NaN counts as no such motion.
    // The energy of a motion without energy is what rounding leaves of its terms.
    let (energy, free) = (energy.abs(), RESULT * terms);
    if energy.is_nan() || energy > free {
        return None;
    }
    z.iter_mut().zip(&scale).for_each(|(z, d)| *z *= d);
    let size = z[largest(&z)].abs();
    z.iter_mut().for_each(|v| *v /= size);
    Some(z)
}

/// Independent zero-energy motions, at most [`MOTIONS`], of length 1.
pub(super) fn free_motions(a: &Matrix) -> Vec<Vec<f64>> {
    let mut random = Random::new(7);
    let mut found: Vec<Vec<f64>> = Vec::new();
    while found.len() < MOTIONS {
        let start = (0..a.nrows()).map(|_| random.symmetric()).collect();
        let Some(mut z) = free_motion(a, start) else {
            break;
        };
        let whole = dot(&z, &z).sqrt();
        // Twice, since what one pass leaves is rounding of what it takes away.
        for other in found.iter().chain(&found) {
            let along = dot(&z, other);
            z.iter_mut().zip(other).for_each(|(z, o)| *z -= along * o);
        }
        let rest = dot(&z, &z).sqrt();
        // What depends on the motions before is one of them.
        if rest.is_nan() || rest <= SIX_DIGITS * whole {
            break;
        }
        z.iter_mut().for_each(|z| *z /= rest);
        found.push(z);
    }
    found
}
