//! Zero-energy motions (null vectors of A), and loads that nothing balances.

use super::law::NodeLaw;
use super::{Contact, ContactError};
use crate::interface::View;
use crate::linear::{Cholesky, LinearSolver};
use crate::sparse::{Matrix, dot};
use crate::spread::Random;

/// The shift added to the matrix scaled to unit diagonal, and the number of inverse iterations with it.
const SHIFT: f64 = 1e-10;
const STEPS: usize = 8;
/// Largest energy of a zero-energy motion, relative to the sum of the moduli of its terms.
const ROUNDING: f64 = 1e-12;
/// Displacements of contact nodes in such a motion, and resultants of the load, below this share of their terms count as zero.
const NOTHING: f64 = 1e-8;

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

/// A zero-energy motion, A z = 0 up to rounding with a largest displacement of 1, by inverse iteration from `start`, which must not be
/// orthogonal to it. `None` where there is no such motion.
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
    let (energy, free) = (energy.abs(), ROUNDING * terms);
    if energy.is_nan() || energy > free {
        return None;
    }
    z.iter_mut().zip(&scale).for_each(|(z, d)| *z *= d);
    let size = z[largest(&z)].abs();
    z.iter_mut().for_each(|v| *v /= size);
    Some(z)
}

impl<V: View, L: NodeLaw> Contact<V, L> {
    /// Why there is no solution, if the load moves the body where neither its stiffness nor contact resists: with A z = 0,
    /// f·z = Σ λν Bν z + λt·Bt z cannot be positive where no node comes nearer, Bν z + F |Bt z| ≤ 0, as λν ≥ 0 and |λt| ≤ F λν.
    pub(in crate::contact) fn unbalanced(&self, alpha: f64) -> Option<ContactError> {
        let law = &self.law.law;
        if !law.is_coulomb() {
            return None;
        }
        let load = self.operator.load_at(&[alpha]);
        let z = free_motion(&self.operator.a, load.clone())?;
        let work = dot(&load, &z);
        let size: f64 = load.iter().zip(&z).map(|(f, z)| (f * z).abs()).sum();
        if work.is_nan() || work <= NOTHING * size {
            return None;
        }
        let p = self.num_contacts();
        let mut moved = vec![0.0; self.num_traces()];
        Matrix::as_ref(&self.operator.b_t).mul_transpose_add(1.0, &z, &mut moved);
        for v in self.nodes(&self.zero(alpha)) {
            let friction = law.friction(&v);
            let moves = |d: usize| moved.get(d * p + v.node).copied().unwrap_or(0.0);
            let slip = |d: usize| friction[d - 1] * moves(d).abs();
            let nearer = moves(0) + slip(1) + slip(2);
            if nearer.is_nan() || nearer > NOTHING {
                return None;
            }
        }
        let displacement = largest(&z);
        let at = self.law.body.nodes.as_deref();
        Some(ContactError::Unbalanced {
            parameter: alpha,
            displacement,
            at: at.map(|nodes| nodes.points[nodes.displacements[displacement][0]]),
            work,
        })
    }
}
