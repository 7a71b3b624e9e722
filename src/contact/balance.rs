//! Loads that nothing balances.

use super::law::NodeLaw;
use super::zero_energy::{free_motion, free_motions, largest};
use super::{Contact, ContactError};
use crate::interface::View;
use crate::sparse::{Matrix, dot};
use crate::tolerances::HALF_DIGITS;
use crate::variational::{Polyhedron, Projection};

/// Largest number of times that planes are added to the cone of motions without forces: it is found to rounding after a few.
const CUTS: usize = 30;

impl<V: View, L: NodeLaw> Contact<V, L> {
    /// Why there is no solution, if the load moves the body where neither its stiffness nor contact resists: with A z = 0,
    /// f·z = Σ λν Bν z + λt·Bt z cannot be positive where no node comes nearer, Bν z + ‖F Bt z‖ ≤ 0, as λν ≥ 0 and ‖F⁻¹ λt‖ ≤ λν.
    pub(in crate::contact) fn unbalanced(&self, alpha: f64) -> Option<ContactError> {
        if !self.law.law.is_coulomb() {
            return None;
        }
        let load = self.operator.load_at(&[alpha]);
        let z = free_motion(self.body().stiffness(), load.clone())?;
        let found = self.moved_by(alpha, &load, &z);
        found.or_else(|| self.moved_beyond_friction(alpha, &load))
    }

    /// The motion nearest to the load among those with zero energy that bring no node nearer (J. Farkas 1902: it is 0 exactly where contact
    /// forces balance the load), by planes that bound their cone: in the plane all of them, in space more where they are wanted.
    fn moved_beyond_friction(&self, alpha: f64, load: &[f64]) -> Option<ContactError> {
        let motions = free_motions(self.body().stiffness());
        let (k, p) = (motions.len(), self.num_contacts());
        let traces: Vec<Vec<f64>> = motions.iter().map(|z| self.traces_of(z)).collect();
        let friction: Vec<[f64; 2]> = self
            .nodes(&self.zero(alpha))
            .iter()
            .map(|v| self.law.law.friction(v))
            .collect();
        let ray = |i: usize, side: [f64; 2]| -> Vec<f64> {
            let tangential = |m: &[f64], d: usize| {
                side[d] * friction[i][d] * m.get((d + 1) * p + i).copied().unwrap_or(0.0)
            };
            traces
                .iter()
                .map(|m| m[i] + tangential(m, 0) + tangential(m, 1))
                .collect()
        };
        let mut rays = Vec::new();
        for i in 0..p {
            rays.extend([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]].map(|side| ray(i, side)));
        }
        let wanted: Vec<f64> = motions.iter().map(|z| dot(load, z)).collect();
        for _ in 0..CUTS {
            let rows: Vec<&[f64]> = rays.iter().map(Vec::as_slice).collect();
            let cone = Polyhedron::space(k).ok()?;
            let cone = cone.with_inequalities(Matrix::from_rows(&rows).ok()?, vec![0.0; rows.len()]);
            let Ok(Projection::Nearest(nearest)) = cone.and_then(|cone| cone.project(&wanted)) else {
                return None;
            };
            let mut z = vec![0.0; load.len()];
            for (motion, c) in motions.iter().zip(&nearest.x) {
                z.iter_mut().zip(motion).for_each(|(z, m)| *z += c * m);
            }
            let size = z[largest(&z)].abs();
            if size.is_nan() || size <= HALF_DIGITS * dot(&wanted, &wanted).sqrt() {
                return None;
            }
            z.iter_mut().for_each(|z| *z /= size);
            if let Some(found) = self.moved_by(alpha, load, &z) {
                return Some(found);
            }
            let moved = self.traces_of(&z);
            for i in 0..p {
                let slip = |d: usize| friction[i][d] * moved.get((d + 1) * p + i).copied().unwrap_or(0.0);
                let length = slip(0).hypot(slip(1));
                if length > 0.0 && moved[i] + length > HALF_DIGITS {
                    rays.push(ray(i, [slip(0) / length, slip(1) / length]));
                }
            }
        }
        None
    }

    /// B z of the contact nodes.
    fn traces_of(&self, z: &[f64]) -> Vec<f64> {
        let mut moved = vec![0.0; self.num_traces()];
        Matrix::as_ref(&self.operator.b_t).mul_transpose_add(1.0, z, &mut moved);
        moved.truncate(self.law.own_traces());
        moved
    }

    /// The error of a load that does work in a zero-energy motion, with a largest displacement of 1, in which no node comes nearer.
    fn moved_by(&self, alpha: f64, load: &[f64], z: &[f64]) -> Option<ContactError> {
        let law = &self.law.law;
        let work = dot(load, z);
        let size: f64 = load.iter().zip(z).map(|(f, z)| (f * z).abs()).sum();
        if work.is_nan() || work <= HALF_DIGITS * size {
            return None;
        }
        let p = self.num_contacts();
        let moved = self.traces_of(z);
        for v in self.nodes(&self.zero(alpha)) {
            let friction = law.friction(&v);
            let moves = |d: usize| moved.get(d * p + v.node).copied().unwrap_or(0.0);
            let slip = |d: usize| friction[d - 1] * moves(d);
            let nearer = moves(0) + slip(1).hypot(slip(2));
            if nearer.is_nan() || nearer > HALF_DIGITS {
                return None;
            }
        }
        let displacement = largest(z);
        let at = self.law.body.nodes.as_deref();
        Some(ContactError::Unbalanced {
            parameter: alpha,
            displacement,
            at: at.map(|nodes| nodes.points[nodes.displacements[displacement][0]]),
            motion: at.and_then(|nodes| super::motion::in_words(nodes, z)),
            work,
        })
    }
}
