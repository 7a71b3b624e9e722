//! What the rounding of the terms that cancel in them leaves of forces and displacements.

use super::body_state::{BodyState, offsets};
use super::law::{LocalValues, NodeLaw};
use super::problem::Contact;
use super::solution::judge;
use super::tolerances::BLURRED;
use crate::interface::View;
use crate::sparse::{Matrix, max_abs};
use crate::tolerances::ROUNDING;

/// Whether every entry is no more than the rounding of its terms.
pub(super) fn is_rounding_of(sums: &[f64], terms: &[f64]) -> bool {
    sums.iter()
        .zip(terms)
        .all(|(sum, terms)| sum.abs() <= ROUNDING * terms)
}

/// Forces below this are rounding where load cases balance each other: [`BLURRED`] times their `terms`, if the load is no larger; else 0.
pub(super) fn blurred_load(load: &[f64], terms: &[f64]) -> f64 {
    let blurred = BLURRED * max_abs(terms);
    if max_abs(load) < blurred { blurred } else { 0.0 }
}

/// The size of the forces of a node, against which residuals of its law are measured: of λ and r times the displacements from which the law
/// counts; where these cancel against their `offsets` (the gap and the reference slips), at least [`BLURRED`] times r times the latter.
pub(super) fn size_of_forces(v: &LocalValues, offsets: [f64; 3]) -> f64 {
    let forces = v.pressure.abs().max(v.traction[0].abs()).max(v.traction[1].abs());
    let lengths = v.penetration.abs().max(v.slip[0].abs()).max(v.slip[1].abs());
    let cancelled = offsets.iter().fold(0.0f64, |m, o| m.max(o.abs()));
    forces.max(v.r * lengths.max(BLURRED * cancelled))
}

impl<V: View, L: NodeLaw> Contact<V, L> {
    /// Whether the residual of every row at x is rounding of its terms. Those of equilibrium are |A| |u|, |Bᵀ| |λ| and the load cases; in
    /// the laws count λ, displacements and offsets times r, and what the rounding of the equilibrium of a trace leaves of its force.
    ///
    /// Never where the terms are so large, as on a body that floats away, that their rounding covers whatever drives the body: the load,
    /// gaps, and earlier slips.
    pub(super) fn is_rounding(&self, x: &[f64]) -> bool {
        let (first, n, q) = (self.leading(), self.num_displacements(), self.num_traces());
        let Ok(state) = BodyState::at(self, x) else {
            return false;
        };
        let known = |v: &f64| v.abs().max(f64::MIN_POSITIVE);
        let u: Vec<f64> = state.u.iter().map(known).collect();
        let forces = &x[first..first + q];
        let sizes: Vec<f64> = forces.iter().map(known).collect();
        let (a, b_t) = (&self.operator.a, &self.operator.b_t);
        let mut terms = self.operator.load.terms(&x[first + q..], n);
        terms.iter_mut().for_each(|f| *f = known(f));
        let nodes = &self.law;
        let driving =
            max_abs(&terms).max(nodes.scale * max_abs(&nodes.body.gap).max(max_abs(&nodes.reference)));
        Matrix::as_ref(a).add_term_sizes(&u, &mut terms);
        Matrix::as_ref(b_t).add_term_sizes(&sizes, &mut terms);
        if ROUNDING * max_abs(&terms) >= driving {
            return false;
        }
        if first > 0 {
            let mut rest = state.imbalances();
            Matrix::as_ref(b_t).mul_add(1.0, forces, &mut rest);
            if !is_rounding_of(&rest, &terms) {
                return false;
            }
        }
        // Of each trace: Σ |b| |u|, and Σ |b| S / Σ b² for the force that balances rows with terms S.
        let (mut lengths, mut blurred, mut squares) = (vec![0.0; q], vec![0.0; q], vec![0.0; q]);
        for (j, k, b) in b_t.triplets() {
            lengths[k] += b.abs() * u[j];
            blurred[k] += b.abs() * terms[j];
            squares[k] += b * b;
        }
        let p = self.num_contacts();
        self.nodes_in_own_scale(x).iter().enumerate().all(|(i, v)| {
            let offsets = offsets(&nodes.body.gap, &nodes.reference, i);
            let mut size = size_of_forces(v, [0.0; 3]);
            for (k, offset) in (i..nodes.own_traces()).step_by(p).zip(offsets) {
                let blurred = if squares[k] > 0.0 {
                    blurred[k] / squares[k]
                } else {
                    0.0
                };
                size = size.max(v.r * (lengths[k] + offset.abs())).max(blurred);
            }
            let (_, h) = judge(&nodes.law, v);
            h.iter().all(|h| h.abs() <= ROUNDING * size)
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::contact::{ContactBody, Frictionless, FullContact, LoadPath};
    use crate::sparse::Matrix;

    /// Two nodes with a spring between them in the vertical direction, held in the other; the first may touch the ground below, and both are
    /// pulled upwards: nothing balances that. However far up, where the load is less than the
    /// rounding of the springs' terms, there is no solution.
    #[test]
    fn bodies_that_float_away_are_not_at_rest() {
        let a = Matrix::from_rows(&[
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, -1.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0, 1.0],
        ])
        .unwrap();
        let normal = Matrix::from_rows(&[[0.0, -1.0, 0.0, 0.0]]).unwrap();
        let tangential = Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0]]).unwrap();
        let load = LoadPath::constant(vec![0.0, 1.0, 0.0, 1.0]);
        let body = ContactBody::new(a, normal, vec![tangential], load).unwrap();
        let problem = FullContact::new(body, Frictionless::plane()).unwrap();
        for far in [1e3, 1e12, 1e15, 1e18, 1e30] {
            let x = [0.0, far, 0.0, far, 0.0, 0.0, 0.0];
            assert!(!problem.is_rounding(&x), "{far:e}");
        }
    }
}
