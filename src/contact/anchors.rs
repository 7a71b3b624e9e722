//! Bodies without supports in condensed form.

use std::sync::Arc;

use super::ContactBody;
use super::zero_energy::free_motions;
use crate::interface::Operator;
use crate::sparse::{Matrix, max_abs};
use crate::tolerances::SIX_DIGITS;

impl ContactBody {
    /// The same body with as many springs as it has zero-energy motions R, at displacements that no two motions have in common, and with
    /// the displacements c of these springs as further unknowns, whose forces take those of the springs away: A⁺ is the inverse of
    /// Ã = A + E ρ Eᵀ, u = Ã⁻¹ (f − Bᵀ λ) + R c, and the rows of c are those of balance, Rᵀ (f − Bᵀ λ) = 0 (C. Farhat and F.-X. Roux, Int. J.
    /// Numer. Methods Eng. 32 (1991)). Nothing is approximated: ρ is any positive number.
    ///
    /// In the words of an [`Operator`]: the traces −ρ Eᵀ u with the multipliers c and the compliance −ρ, by which they are ρ (c − Eᵀ u), and
    /// the law that they are 0. `None` where the body has no such motion, and where contact does not see one of them, so that no force holds
    /// it.
    pub(super) fn anchored(&self) -> Option<Self> {
        let motions = free_motions(&self.operator.a);
        let places = pivots(motions.clone(), 1.0)?;
        let traces = motions.iter().map(|z| {
            let mut moved = vec![0.0; self.operator.num_traces()];
            Matrix::as_ref(&self.operator.b_t).mul_transpose_add(1.0, z, &mut moved);
            moved
        });
        pivots(traces.collect(), max_abs(self.operator.b_t.values()))?;
        let (n, q) = (self.num_displacements(), self.operator.num_traces());
        let mut a: Vec<_> = self.operator.a.triplets().collect();
        let mut b_t: Vec<_> = self.operator.b_t.triplets().collect();
        let mut yielding = self.operator.yielding.clone();
        yielding.resize(q, 0.0);
        for (k, &place) in places.iter().enumerate() {
            // Twice a number is one: coefficients that were exact stay so.
            let spring = self.operator.a.get(place, place);
            a.push((place, place, spring));
            b_t.push((place, q + k, -spring));
            yielding.push(-spring);
        }
        Some(Self {
            operator: Arc::new(Operator {
                a: Arc::new(Matrix::from_triplets(n, n, &a).ok()?),
                b_t: Arc::new(Matrix::from_triplets(n, q + places.len(), &b_t).ok()?),
                yielding,
                anchors: places,
                ..(*self.operator).clone()
            }),
            floating: Some(Arc::clone(&self.operator)),
            ..self.clone()
        })
    }

    /// The body without these springs.
    pub(super) fn released(&self) -> Self {
        match &self.floating {
            Some(own) => Self {
                operator: Arc::new(Operator {
                    load: self.operator.load.clone(),
                    ..(**own).clone()
                }),
                floating: None,
                ..self.clone()
            },
            None => self.clone(),
        }
    }

    /// The point (λ, c, α) of the condensed form.
    pub(super) fn point_of(&self, u: &[f64], forces: &[f64], alpha: f64) -> Vec<f64> {
        let c = self.anchors().iter().map(|&place| u[place]);
        forces.iter().copied().chain(c).chain([alpha]).collect()
    }

    /// The displacements of the springs.
    pub(super) fn anchors(&self) -> &[usize] {
        &self.operator.anchors
    }
}

/// An entry of each vector in which the others, freed of it, vanish: by elimination with the largest entry as pivot. `None` where there is no
/// vector, or where what is left of one vanishes to six digits of `size`, that of their largest entries.
fn pivots(mut vectors: Vec<Vec<f64>>, size: f64) -> Option<Vec<usize>> {
    let mut places = Vec::new();
    while !vectors.is_empty() {
        let entries = vectors.iter().enumerate();
        let entries = entries.flat_map(|(k, v)| v.iter().enumerate().map(move |(i, x)| (k, i, x.abs())));
        let (own, place, most) = entries.max_by(|a, b| a.2.total_cmp(&b.2))?;
        let vector = vectors.swap_remove(own);
        if most.is_nan() || most <= SIX_DIGITS * size {
            return None;
        }
        for other in &mut vectors {
            let factor = other[place] / vector[place];
            other.iter_mut().zip(&vector).for_each(|(o, v)| *o -= factor * v);
        }
        places.push(place);
    }
    (!places.is_empty()).then_some(places)
}
