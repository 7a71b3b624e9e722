//! Whether a point is a solution.

use super::McpStatus;
use super::engine::{Engine, NEAR, Plan};
use crate::complementarity::problem::natural;
use crate::sparse::max_abs;

impl Engine<'_> {
    /// Whether a small residual at `work.x` belongs to a solution nearby, and not to one at infinity (as of e⁻ˣ): each free row
    /// vanishes close by on its own, and so do all together. Uses `work.jac`; `last_step` is the
    /// length of the step that led here, if it was a full one of Newton's method for the natural map.
    pub(super) fn is_localised(&mut self, last_step: Option<f64>) -> bool {
        if self.affine {
            return true;
        }
        let n = self.n();
        // In the units of the problem: equilibration at a point far out would hide how far it is.
        let size = 1.0 + max_abs(&self.work.x);
        {
            let w = &mut *self.work;
            w.scratch.fill(0.0);
            for (i, j, v) in w.jac.triplets() {
                w.scratch[i] = w.scratch[i].max((v / (w.row[i] * w.col[j])).abs());
            }
        }
        for i in 0..n {
            let w = &*self.work;
            let f = w.f[i];
            let free = natural(w.x[i], self.lower[i], self.upper[i], f) == f;
            if free && f != 0.0 && f.abs() > NEAR * size * w.scratch[i] && !self.is_isolated(i) {
                return false;
            }
        }
        if last_step.is_some_and(|s| s <= NEAR * size) {
            return true;
        }
        self.update_active();
        self.bound_steps();
        self.report.factorisations += 1;
        let w = &mut *self.work;
        // An ill-conditioned system says nothing.
        !w.solve_carefully(1e-8) || (0..n).all(|i| (w.d[i] * w.col[i]).abs() <= NEAR * size)
    }

    /// Whether |F_i| grows a hundredfold when one variable changes by a thousandth.
    pub(super) fn is_isolated(&mut self, i: usize) -> bool {
        let n = self.n();
        let f = self.work.f[i];
        self.work.trial_x.copy_from_slice(&self.work.x);
        for j in 0..n {
            if self.work.jac.pattern().slot(i, j).is_none() {
                continue;
            }
            let x = self.work.x[j];
            for h in [1e-3, -1e-3] {
                let moved = self.clamp(j, x + h * (1.0 + x.abs()));
                self.work.trial_x[j] = moved;
                self.report.evaluations += 1;
                self.function.value(&self.work.trial_x, &mut self.work.trial_f);
                if self.work.trial_f[i].abs() > 100.0 * f.abs() {
                    self.work.trial_x[j] = x;
                    return true;
                }
            }
            self.work.trial_x[j] = x;
        }
        false
    }

    /// Whether the residual at `work.x` is no more than the rounding error of the terms of F (by `work.jac`).
    pub(super) fn is_rounding(&mut self) -> bool {
        let n = self.n();
        let w = &mut *self.work;
        w.scratch.fill(0.0);
        for (i, j, v) in w.jac.triplets() {
            w.scratch[i] += (v * w.x[j] / w.col[j]).abs();
        }
        // Far out the rounding error hides residuals of any size: there it excuses little.
        let near = max_abs(&w.x) <= 1e-6 * self.far;
        (0..n).all(|i| {
            let r = natural(w.x[i], self.lower[i], self.upper[i], w.f[i]).abs();
            r <= self.options.tolerance
                || (w.row[i] * r <= 64.0 * f64::EPSILON * w.scratch[i] && (near || r <= 1e-7))
        })
    }

    pub(super) fn is_inside(&self) -> bool {
        (0..self.n()).all(|i| self.work.x[i] == self.clamp(i, self.work.x[i]))
    }

    /// Natural residual of the proximal problem, scaled.
    pub(super) fn proximal_residual(&self) -> f64 {
        let w = &*self.work;
        (0..w.n).fold(0.0, |m: f64, i| {
            let c = w.col[i];
            let r = natural(w.x[i] / c, self.lower[i] / c, self.upper[i] / c, w.scaled[i]);
            m.max(r.abs())
        })
    }

    /// No step helps: a solution to rounding, a stationary point, or neither.
    pub(super) fn settle(&mut self, plan: &Plan, psi: f64) -> McpStatus {
        if plan.proximal == 0.0 && self.is_inside() && self.is_rounding() && self.is_localised(None) {
            return McpStatus::Solved;
        }
        if plan.natural {
            self.prepare_fischer(plan, 0.0);
        }
        let w = &*self.work;
        let projected = (0..w.n).fold(0.0, |m: f64, i| {
            let x = w.x[i] / w.col[i];
            let y = (x - w.gradient[i])
                .max(self.lower[i] / w.col[i])
                .min(self.upper[i] / w.col[i]);
            m.max((x - y).abs())
        });
        if projected <= 1e-4 * (2.0 * psi).sqrt() {
            McpStatus::Stationary {
                gradient_norm: projected,
            }
        } else {
            McpStatus::Stalled
        }
    }
}
