//! The equations of a run at a point, and their Newton step.

use super::equations::Map;
use super::run::Run;
use crate::complementarity::ComplementarityError;
use crate::linear::{LinearError, LinearSolver};
use crate::sparse::{max_abs, norm};

impl Run<'_> {
    /// Units of F from the rows of ∇F at x.
    pub(super) fn choose_units(&mut self) {
        let largest = &mut self.terms;
        largest.fill(0.0);
        for (i, _, v) in self.jac.triplets() {
            largest[i] = largest[i].max(v.abs());
        }
        for part in &mut self.parts {
            let size = max_abs(&largest[part.range.clone()]);
            let size = if size > 0.0 {
                size
            } else {
                max_abs(&self.f[part.range.clone()])
            };
            part.unit = match size.is_normal() {
                true => size.log2().round().exp2().recip(),
                false => 1.0,
            };
        }
    }

    /// Evaluates the equations at x or at the trial point, with F there, into `phi`; returns their norm.
    pub(super) fn map(&mut self, map: Map, at_trial: bool) -> f64 {
        let x = if at_trial { &self.trial } else { &self.x };
        for part in &self.parts {
            let range = part.range.clone();
            let y = &mut self.y[range.clone()];
            y.iter_mut()
                .zip(&self.f[range.clone()])
                .for_each(|(y, f)| *y = part.unit * f);
            let (x, out) = (&x[range.clone()], &mut self.phi[range]);
            match map {
                Map::Smoothed(mu) => part.cone.smoothed(mu, x, y, out),
                Map::Natural => {
                    out.iter_mut()
                        .zip(x.iter().zip(&*y))
                        .for_each(|(o, (x, y))| *o = x - y);
                    part.cone.project(out);
                    out.iter_mut().zip(x).for_each(|(o, x)| *o = x - *o);
                }
            }
        }
        norm(&self.phi)
    }

    /// The Newton step of the equations at x, with `proximal` times the identity (in units of F) added to ∇F;
    /// `false` where the system is singular.
    pub(super) fn newton_step(&mut self, map: Map, proximal: f64) -> Result<bool, ComplementarityError> {
        self.map(map, false);
        self.system.clear();
        for part in &self.parts {
            let range = part.range.clone();
            let (n, first) = (range.len(), range.start);
            let (x, y) = (&self.x[range.clone()], &self.y[range.clone()]);
            let (by_x, by_y) = (&mut self.by_x[..n * n], &mut self.by_y[part.at..part.at + n * n]);
            match map {
                Map::Smoothed(mu) => {
                    let room = &mut self.room[..3 * n];
                    part.cone
                        .smoothed_derivatives(mu, [x, y], None, [by_x, by_y], room)
                }
                Map::Natural => {
                    // x − P(x − y): I − D by x, D by y.
                    let z = &mut self.trial[range];
                    z.iter_mut()
                        .zip(x.iter().zip(y))
                        .for_each(|(z, (x, y))| *z = x - y);
                    part.cone.projection_derivative(z, by_y);
                    for k in 0..n * n {
                        by_x[k] = f64::from(u8::from(k % (n + 1) == 0)) - by_y[k];
                    }
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let value = by_x[i * n + j] + proximal * by_y[i * n + j];
                    if value != 0.0 {
                        self.system.add(first + i, first + j, value);
                    }
                }
            }
        }
        for j in 0..self.x.len() {
            let pattern = self.jac.pattern();
            for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let (r, v) = (pattern.row_idx()[k], self.jac.values()[k]);
                let part = &self.parts[self.owner[r]];
                let (n, first) = (part.range.len(), part.range.start);
                // A column that has one row of a cone has all of its rows.
                let Some(at) = self.system.pattern().slot(first, j) else {
                    continue;
                };
                for (i, entry) in self.system.values_mut()[at..at + n].iter_mut().enumerate() {
                    *entry += self.by_y[part.at + i * n + (r - first)] * part.unit * v;
                }
            }
        }
        self.report.factorisations += 1;
        let known = |e: &LinearError| {
            matches!(
                e,
                LinearError::Singular { .. } | LinearError::Inaccurate { .. } | LinearError::NotFinite { .. }
            )
        };
        match self.solver.factor(self.system.as_ref()) {
            Err(e) if known(&e) => return Ok(false),
            result => result?,
        }
        self.step.iter_mut().zip(&self.phi).for_each(|(s, p)| *s = -p);
        match self.solver.solve_in_place(&mut self.step) {
            Err(e) if known(&e) => return Ok(false),
            result => result?,
        }
        Ok(self.step.iter().all(|v| v.is_finite()))
    }
}
