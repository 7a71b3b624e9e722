//! Whether a point is a solution.

use super::ConeError;
use super::equations::Part;
use super::run::Run;
use crate::sparse::{max_abs, norm};

/// Where the constants of all rows of a block are a smaller part of their terms, errors are compared with the constants: far out every
/// error is small relative to its terms. Parts below `NO_CONSTANT` may be rounding errors where F is curved.
const FAR: f64 = 1e-6;
const NO_CONSTANT: f64 = 8.0 * f64::EPSILON;
/// An entry of a cone counts with at least this part of the norm of all its entries: some rounding errors of the norm are then within the
/// tolerance.
const FLOOR: f64 = 1e-4;

/// How far out the parts of a block are: the largest |xᵢ|, and the largest part that constants have of the terms of a cone.
#[derive(Clone, Copy, Default)]
pub(super) struct Size {
    share: f64,
    largest: f64,
}

impl Run<'_> {
    /// Keeps the projection of x on K if it is the best point so far; returns whether it is a solution.
    pub(super) fn judge(&mut self) -> Result<bool, ConeError> {
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
        let constants = self.constant.as_ref().unwrap_or(&self.rest);
        let share = |part: &Part| {
            let size = norm(&self.terms[part.range.clone()]);
            if size > 0.0 {
                norm(&constants[part.range.clone()]) / size
            } else {
                0.0
            }
        };
        self.blocks.fill(Size::default());
        for (part, &b) in self.parts.iter().zip(&self.block) {
            let block = &mut self.blocks[b];
            block.share = block.share.max(share(part));
            block.largest = block.largest.max(max_abs(&self.x[part.range.clone()]));
        }
        let least = if self.constant.is_some() {
            f64::MIN_POSITIVE
        } else {
            NO_CONSTANT
        };
        let mut worst = 0.0_f64;
        for (part, &b) in self.parts.iter().zip(&self.block) {
            let Size { share, largest } = self.blocks[b];
            let far = match (least..FAR).contains(&share) {
                true => share / FAR,
                false => 1.0,
            };
            let largest = if largest > 0.0 { largest } else { 1.0 };
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
            // What the rounding of the terms may hide.
            let hidden = if far < 1.0 { f64::EPSILON / far } else { 0.0 };
            let error = norm(z) / far;
            if error > worst || error.is_nan() {
                worst = error;
            }
            worst = if hidden > worst { hidden } else { worst };
        }
        worst
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
