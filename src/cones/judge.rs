//! Whether a point is a solution.

use std::cell::OnceCell;

use super::Cone;
use super::run::Run;
use crate::complementarity::ComplementarityError;
use crate::judge::{Columns, Parts};
use crate::sparse::{max_abs, norm};
use crate::tolerances::{ROUNDING, SUM};

/// An entry of a cone counts with at least this part of the norm of all its entries: some rounding errors of the norm are then within the
/// tolerance.
const FLOOR: f64 = 1e-4;

impl Run<'_> {
    /// Keeps the projection of x on K if it is the best point so far; returns whether it is a solution.
    pub(super) fn judge(&mut self) -> Result<bool, ComplementarityError> {
        // `trial` is free between steps.
        self.trial.copy_from_slice(&self.x);
        self.problem.project(&mut self.x)?;
        let moved = self.x != self.trial;
        let finite = !moved || self.evaluate()?;
        let error = if finite { self.error() } else { f64::INFINITY };
        if error < self.least {
            self.least = error;
            self.best.copy_from_slice(&self.x);
        }
        if moved {
            self.x.copy_from_slice(&self.trial);
            self.evaluate()?;
        }
        Ok(error <= self.options.tolerance)
    }

    /// [`ConeReport::error`](super::ConeReport::error) at x, where F and ∇F have been evaluated.
    fn error(&mut self) -> f64 {
        self.rest.copy_from_slice(&self.f);
        for (i, j, v) in self.jac.triplets() {
            self.rest[i] -= v * self.x[j];
        }
        self.choose_floors();
        self.terms.fill(0.0);
        for (i, j, v) in self.jac.triplets() {
            self.terms[i] += v.abs() * self.x[j].abs().max(self.room[self.owner[j]]);
        }
        for (term, rest) in self.terms.iter_mut().zip(&self.rest) {
            *term += rest.abs();
        }
        self.blocks.fill(0.0);
        for (part, &b) in self.parts.iter().zip(&self.block) {
            self.blocks[b] = self.blocks[b].max(max_abs(&self.x[part.range.clone()]));
        }
        let mut worst = 0.0_f64;
        for (k, (part, &b)) in self.parts.iter().zip(&self.block).enumerate() {
            let largest = if self.blocks[b] > 0.0 { self.blocks[b] } else { 1.0 };
            let size = norm(&self.terms[part.range.clone()]);
            let size = if size > 0.0 { size } else { 1.0 };
            let z = &mut self.room[..part.range.len()];
            for (z, i) in z.iter_mut().zip(part.range.clone()) {
                *z = self.x[i] / largest - self.f[i] / size;
            }
            part.cone.project(z);
            for (z, i) in z.iter_mut().zip(part.range.clone()) {
                *z -= self.x[i] / largest;
            }
            let error = norm(z);
            self.errors[k] = error;
            if error > worst || error.is_nan() {
                worst = error;
            }
        }
        // Straight parts are excused only once the rest is solved, as looking for them takes longer.
        match worst.is_nan() {
            true => worst,
            false => worst.max(self.hidden(worst <= self.options.tolerance)),
        }
    }

    /// What the error of a part beyond rounding is relative to its constants, and the square of what rounding is relative to them, whichever
    /// is largest, unless (if `excuse`) half-lines and free variables alone, which are straight, determine its unknowns by a regular ∇F of a constant slope:
    /// elsewhere the terms may cancel far out whatever the constants are. The square lets no more than √τ of the constants pass at a
    /// tolerance τ.
    fn hidden(&self, excuse: bool) -> f64 {
        let constants = self.constant.as_ref().unwrap_or(&self.rest);
        let typical = OnceCell::new();
        let measure = |k: usize| {
            let range = self.parts[k].range.clone();
            let size = norm(&self.terms[range.clone()]);
            let mut constant = norm(&constants[range]);
            if self.constant.is_none() && constant <= ROUNDING * size {
                constant = constant.max(typical.get_or_init(|| self.typical())[k]);
            }
            (size, constant)
        };
        // The least part that constants have of the terms, of the parts of each block.
        let mut least = vec![f64::INFINITY; self.parts.len()];
        for (k, &b) in self.block.iter().enumerate() {
            let (size, constant) = measure(k);
            if constant > 0.0 {
                least[b] = least[b].min(constant / size);
            }
        }
        let rests = |i: usize| {
            let half_line = matches!(self.parts[self.owner[i]].cone, Cone::Nonnegative(_));
            half_line && self.x[i] == 0.0 && self.f[i] >= 0.0
        };
        let (mut found, mut worst) = (None, 0.0_f64);
        for (k, &b) in self.block.iter().enumerate() {
            let (size, constant) = measure(k);
            let beyond = (self.errors[k] - ROUNDING).max(0.0);
            let share = if constant > 0.0 { constant / size } else { least[b] };
            let hidden = match size > 0.0 {
                true => (beyond / share).max((SUM / share).powi(2)),
                false => 0.0,
            };
            let first = self.parts[k].range.start;
            if hidden <= self.options.tolerance || rests(first) {
                continue;
            }
            if !excuse {
                worst = worst.max(hidden);
                continue;
            }
            let jac = Columns::Long(self.jac.as_ref());
            let components = found.get_or_insert_with(|| {
                let mut components = Parts::default();
                components.find(jac, self.x.len(), &|i| !rests(i));
                components
            });
            let is_straight = self.constant.is_some()
                && components.of(first).is_some_and(|c| {
                    let polyhedral = |i: &usize| {
                        matches!(
                            self.parts[self.owner[*i]].cone,
                            Cone::Nonnegative(_) | Cone::Free(_)
                        )
                    };
                    components.members(c).iter().all(polyhedral) && components.is_regular(c, jac)
                });
            if !is_straight {
                worst = worst.max(hidden);
            }
        }
        worst
    }

    /// The terms of each part at x = 1.
    fn typical(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.parts.len()];
        let entries = self.jac.triplets();
        entries.for_each(|(i, _, v)| sums[self.owner[i]] += v.abs());
        sums
    }

    /// Sizes below which entries of each cone are not distinguished from zero, in `room`: rounding errors of projections are relative to
    /// the norm of all entries. Where this norm is larger than the size at which constants and other terms are alike, that size is used:
    /// far out every error is relatively small.
    fn choose_floors(&mut self) {
        let constants = self.constant.as_ref().unwrap_or(&self.rest);
        let largest = &mut self.terms;
        largest.fill(0.0);
        for (i, _, v) in self.jac.triplets() {
            largest[i] = largest[i].max(v.abs());
        }
        let (floors, sizes) = self.room.split_at_mut(self.parts.len());
        floors.fill(0.0);
        sizes.fill(0.0);
        for (i, j, v) in self.jac.triplets().filter(|e| e.2 != 0.0) {
            let part = self.owner[j];
            floors[part] = floors[part].max(constants[i].abs() / largest[i]);
            sizes[part] = sizes[part].max(v.abs() / largest[i]);
        }
        for ((part, floor), size) in self.parts.iter().zip(floors).zip(sizes) {
            let length = norm(&self.x[part.range.clone()]);
            *floor = match *floor > 0.0 {
                true => FLOOR * length.min(*floor / *size),
                false => FLOOR * length,
            };
        }
    }
}
