//! One attempt: a globalised Newton iteration from one start.

use std::ops::ControlFlow;
use std::time::Instant;

use super::work::{NORMAL_EQUATIONS, Work};
use super::{McpIteration, McpOptions, McpReport, McpStatus, McpStep, McpStrategy};
use crate::complementarity::McpFunction;
use crate::complementarity::fischer::{Gap, component, component_gradient};
use crate::complementarity::problem::natural;
use crate::newton::equilibrate;

/// Iterates beyond this size, relative to the start, count as tending to infinity.
const FAR: f64 = 1e10;

/// Distance, relative to 1 + ‖x‖, within which a point with a small residual must have a solution by linearisation.
const NEAR: f64 = 1e-3;

/// Factor by which rows may grow or shrink before they are equilibrated anew.
const STALE: f64 = 1e7;

/// Sufficient decrease of the line search.
const ARMIJO: f64 = 1e-4;

/// How an attempt goes about it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    /// Whether steps of the natural map are tried first.
    pub(super) natural: bool,
    /// λ of the penalised Fischer–Burmeister merit.
    pub(super) lambda: f64,
    pub(super) scaled: bool,
    /// Number of merits the non-monotone line search looks back on.
    pub(super) memory: usize,
    /// Number of steps in a row that need not bring the merit below its best value.
    pub(super) credit: usize,
    /// ε of the proximal term (0: none), around `Work::centre`.
    pub(super) proximal: f64,
    /// Residual at which a proximal problem counts as solved.
    pub(super) loose: f64,
    pub(super) max_iterations: usize,
}

pub(super) struct Engine<'a> {
    pub(super) function: &'a dyn McpFunction,
    pub(super) lower: &'a [f64],
    pub(super) upper: &'a [f64],
    pub(super) options: &'a McpOptions,
    pub(super) work: &'a mut Work,
    pub(super) report: &'a mut McpReport,
    pub(super) observe: &'a mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
    pub(super) started: Instant,
    pub(super) strategy: McpStrategy,
    pub(super) affine: bool,
    /// Smallest natural residual so far, at `work.best`; and that of the current attempt.
    pub(super) best: f64,
    pub(super) attempt_best: f64,
    pub(super) far: f64,
    pub(super) interrupted: bool,
    /// A point far out had a small residual.
    pub(super) asymptotic: bool,
    pub(super) bad_component: Option<usize>,
    /// Whether `work.f` is F at `work.x` already.
    pub(super) fresh: bool,
    /// Where the first active set is given by the user.
    pub(super) given_active: bool,
}

pub(super) fn max_abs(v: &[f64]) -> f64 {
    v.iter().fold(
        0.0,
        |m: f64, x| if x.is_nan() { f64::NAN } else { m.max(x.abs()) },
    )
}

impl Engine<'_> {
    pub(super) fn n(&self) -> usize {
        self.work.n
    }

    pub(super) fn clamp(&self, i: usize, x: f64) -> f64 {
        x.max(self.lower[i]).min(self.upper[i])
    }

    /// F at `work.x`; `false` and the component noted where it is not finite.
    pub(super) fn evaluate(&mut self) -> bool {
        if std::mem::take(&mut self.fresh) {
            return true;
        }
        self.report.evaluations += 1;
        self.function.value(&self.work.x, &mut self.work.f);
        let bad = self.work.f.iter().position(|f| !f.is_finite());
        if bad.is_some() {
            self.bad_component = bad;
        }
        bad.is_none()
    }

    fn evaluate_trial(&mut self) -> bool {
        let x = &self.work.trial_x;
        // Written so that NaN fails.
        if !x.iter().all(|v| v.abs() <= self.far) {
            return false;
        }
        self.report.evaluations += 1;
        self.function.value(x, &mut self.work.trial_f);
        let bad = self.work.trial_f.iter().position(|f| !f.is_finite());
        if bad.is_some() {
            self.bad_component = bad;
        }
        bad.is_none()
    }

    /// Natural residual at `work.x`, in the units of the problem.
    pub(super) fn residual(&self) -> f64 {
        let w = &*self.work;
        self.residual_of(&w.x, &w.f)
    }

    fn residual_of(&self, x: &[f64], f: &[f64]) -> f64 {
        let mut largest = 0.0_f64;
        for i in 0..x.len() {
            let r = natural(x[i], self.lower[i], self.upper[i], f[i]).abs();
            if r.is_nan() {
                return f64::NAN;
            }
            largest = largest.max(r);
        }
        largest
    }

    fn gap(&self, i: usize, x: f64) -> Gap {
        let c = self.work.col[i];
        Gap {
            below: (x - self.lower[i]) / c,
            above: (self.upper[i] - x) / c,
        }
    }

    fn scaled_value(&self, plan: &Plan, i: usize, x: f64, f: f64) -> f64 {
        let w = &*self.work;
        let mut v = w.row[i] * f;
        if plan.proximal > 0.0 {
            v += plan.proximal * (x - w.centre[i]) / w.col[i];
        }
        v
    }

    /// Scaled values, Φ and merit at `work.x`.
    fn merit(&mut self, plan: &Plan) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.n() {
            let x = self.work.x[i];
            let f = self.scaled_value(plan, i, x, self.work.f[i]);
            let phi = component(self.gap(i, x), f, plan.lambda);
            self.work.scaled[i] = f;
            self.work.phi[i] = phi;
            sum += phi * phi;
        }
        0.5 * sum
    }

    fn trial_merit(&self, plan: &Plan) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.n() {
            let x = self.work.trial_x[i];
            let f = self.scaled_value(plan, i, x, self.work.trial_f[i]);
            let phi = component(self.gap(i, x), f, plan.lambda);
            sum += phi * phi;
        }
        0.5 * sum
    }

    /// ∇F at `work.x`, as it is. Where entries are not finite (√x at 0) that of a point a little inside the bounds serves.
    pub(super) fn jacobian(&mut self) -> bool {
        let mut shift = 0.0;
        for _ in 0..6 {
            self.report.jacobians += 1;
            let w = &mut *self.work;
            w.jac.clear();
            if shift == 0.0 {
                self.function.jacobian(&w.x, &mut w.jac);
            } else {
                for i in 0..w.n {
                    let (l, u, x) = (self.lower[i], self.upper[i], w.x[i]);
                    let h = shift * (1.0 + x.abs());
                    let inner = if x + h <= u { x + h } else { x - h };
                    w.scratch[i] = if inner >= l { inner } else { 0.5 * (l + u) };
                }
                self.function.jacobian(&w.scratch, &mut w.jac);
            }
            if w.jac.values().iter().all(|v| v.is_finite()) {
                return true;
            }
            shift = if shift == 0.0 { 1e-10 } else { shift * 100.0 };
        }
        let bad = self.work.jac.triplets().find(|t| !t.2.is_finite());
        self.bad_component = bad.map(|t| t.0);
        false
    }

    /// Row and column factors that equilibrate `work.jac`, powers of two within bounds.
    fn equilibrate(&mut self, plan: &Plan) {
        let w = &mut *self.work;
        if !(plan.scaled && self.options.equilibrate) {
            w.row.fill(1.0);
            w.col.fill(1.0);
            return;
        }
        equilibrate(w.jac.as_ref(), &mut w.row, &mut w.col, &mut w.scratch);
        let power = |v: f64| v.clamp(1e-150, 1e150).log2().round().exp2();
        // Rows all of whose entries are huge or tiny follow their value; a Jacobian that happens to vanish does not make a row huge.
        for (r, f) in w.row.iter_mut().zip(&w.f) {
            *r = power(r.clamp(1e-8_f64.min(1.0 / f.abs()), 1e8_f64.max(1.0 / f.abs())));
        }
        w.col.iter_mut().for_each(|c| *c = power(c.clamp(1e-8, 1e8)));
    }

    /// Whether rows have left the range in which the factors equilibrate `work.jac` (not yet scaled).
    fn is_stale(&mut self, plan: &Plan) -> bool {
        if !(plan.scaled && self.options.equilibrate) {
            return false;
        }
        let w = &mut *self.work;
        w.scratch.fill(0.0);
        for (i, j, v) in w.jac.triplets() {
            w.scratch[i] = w.scratch[i].max((v * w.row[i] * w.col[j]).abs());
        }
        (w.scratch.iter().zip(&w.f).zip(&w.row))
            .any(|((s, f), r)| *s > STALE || (*s < 1.0 / STALE && *s > 0.0 && (r * f).abs() < 1.0 / STALE))
    }

    fn scale_jacobian(&mut self, plan: &Plan) {
        let w = &mut *self.work;
        let pattern = w.jac.pattern().clone();
        for j in 0..w.n {
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                let v = &mut w.jac.values_mut()[e];
                *v *= w.row[i] * w.col[j];
                if i == j {
                    *v += plan.proximal;
                }
            }
        }
    }

    pub(super) fn record(&mut self, residual: f64, merit: f64, step: McpStep, damping: f64) {
        let iteration = McpIteration {
            index: self.report.iterations,
            strategy: self.strategy,
            residual,
            merit,
            step,
            damping,
        };
        self.report.history.push(iteration);
        if step != McpStep::None {
            self.report.iterations += 1;
        }
        if (self.observe)(&iteration).is_break() {
            self.interrupted = true;
        }
    }

    /// A reason to stop altogether.
    pub(super) fn exhausted(&self) -> Option<McpStatus> {
        if self.interrupted {
            Some(McpStatus::Interrupted)
        } else if self.report.iterations >= self.options.max_iterations {
            Some(McpStatus::IterationLimit)
        } else if self.options.max_time.is_some_and(|t| self.started.elapsed() >= t) {
            Some(McpStatus::TimeLimit)
        } else {
            None
        }
    }

    pub(super) fn note_best(&mut self, residual: f64) {
        self.attempt_best = self.attempt_best.min(residual);
        if residual < self.best {
            self.best = residual;
            let Work { best, x, .. } = &mut *self.work;
            best.copy_from_slice(x);
        }
    }

    /// The active set at `work.x`: −1 lower, +1 upper; whether it is the one it was.
    pub(super) fn update_active(&mut self) -> bool {
        let mut same = true;
        for i in 0..self.n() {
            let Gap { below, above } = self.gap(i, self.work.x[i]);
            let f = self.work.scaled[i];
            let now = if self.lower[i] == self.upper[i] || f > below {
                -1
            } else if -f > above {
                1
            } else {
                0
            };
            same &= now == self.work.active[i];
            self.work.active[i] = now;
        }
        same
    }

    /// The Newton step of the natural map for the active set at hand.
    pub(super) fn natural_step(&mut self) -> bool {
        self.bound_steps();
        self.report.factorisations += 1;
        self.work.solve_reduced()
    }

    /// The steps of the components at bounds, 0 for the others.
    fn bound_steps(&mut self) {
        let w = &mut *self.work;
        for i in 0..w.n {
            w.d[i] = match w.active[i] {
                -1 => (self.lower[i] - w.x[i]) / w.col[i],
                1 => (self.upper[i] - w.x[i]) / w.col[i],
                _ => 0.0,
            };
        }
    }

    /// trial_x = P(x + t C d); components that step to a bound land on it.
    fn make_trial(&mut self, t: f64, inside: bool) {
        let w = &mut *self.work;
        for i in 0..w.n {
            let x = w.x[i] + t * w.col[i] * w.d[i];
            w.trial_x[i] = match w.active[i] {
                -1 if t == 1.0 && inside => self.lower[i],
                1 if t == 1.0 && inside => self.upper[i],
                _ if inside => x.max(self.lower[i]).min(self.upper[i]),
                _ => x,
            };
        }
    }

    pub(super) fn accept_trial(&mut self) {
        let w = &mut *self.work;
        std::mem::swap(&mut w.x, &mut w.trial_x);
        std::mem::swap(&mut w.f, &mut w.trial_f);
    }

    /// ‖x − trial_x‖∞.
    fn step_length(&self) -> f64 {
        let w = &*self.work;
        (0..w.n).fold(0.0, |m: f64, i| m.max((w.x[i] - w.trial_x[i]).abs()))
    }

    /// Whether a small residual at `work.x` belongs to a solution nearby, and not to one at infinity (as of e⁻ˣ): each free row
    /// vanishes close by on its own, and so do all together. Uses `work.jac`; `last_step` is the
    /// length of the step that led here, if it was a full one of Newton's method for the natural map.
    fn is_localised(&mut self, last_step: Option<f64>) -> bool {
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
    fn is_isolated(&mut self, i: usize) -> bool {
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
    fn is_rounding(&mut self) -> bool {
        let n = self.n();
        let w = &mut *self.work;
        w.scratch.fill(0.0);
        w.rate.fill(0.0);
        for (i, j, v) in w.jac.triplets() {
            w.scratch[i] += (v * w.x[j] / w.col[j]).abs();
            w.rate[i] = w.rate[i].max(v.abs());
        }
        let size = (0..n).fold(0.0_f64, |m, i| m.max(w.x[i].abs() / w.col[i]));
        (0..n).all(|i| {
            let r = natural(w.x[i], self.lower[i], self.upper[i], w.f[i]).abs();
            r <= self.options.tolerance
                || (w.row[i] * r <= 64.0 * f64::EPSILON * w.scratch[i]
                    && w.row[i] * r <= 1e-9 * w.rate[i] * (1.0 + size))
        })
    }

    /// Full steps of the natural map for affine F, where each active set has one step: ends at a solution, or where a set comes back.
    pub(super) fn affine_newton(&mut self, plan: &Plan) -> McpStatus {
        let limit = (50 + self.n() / 2).min(plan.max_iterations);
        self.work.visited.clear();
        if !self.evaluate() {
            return McpStatus::EvaluationFailure {
                component: self.bad_component.unwrap_or(0),
            };
        }
        if !self.jacobian() {
            return McpStatus::EvaluationFailure {
                component: self.bad_component.unwrap_or(0),
            };
        }
        self.equilibrate(plan);
        self.scale_jacobian(plan);
        let mut unchanged = false;
        for k in 0..=limit {
            if let Some(status) = self.exhausted() {
                return status;
            }
            let merit = self.merit(plan);
            let residual = self.residual();
            let small = residual <= self.options.tolerance;
            if small || unchanged {
                let Work { x, trial_x, .. } = &mut *self.work;
                trial_x.copy_from_slice(x);
                for i in 0..self.n() {
                    self.work.x[i] = self.clamp(i, self.work.x[i]);
                }
                if !self.evaluate() {
                    break;
                }
                let residual = self.residual();
                self.note_best(residual);
                if plan.proximal > 0.0 || residual <= self.options.tolerance || self.is_rounding() {
                    self.record(residual, merit, McpStep::None, 0.0);
                    return McpStatus::Solved;
                }
                break;
            }
            if (0..self.n()).all(|i| self.work.x[i] == self.clamp(i, self.work.x[i])) {
                self.note_best(residual);
            }
            let given = self.given_active && k == 0;
            unchanged = !given && self.update_active() && k > 0;
            if unchanged {
                continue;
            }
            let mark = hash(&self.work.active);
            if k == limit || self.work.visited.contains(&mark) {
                break;
            }
            self.work.visited.push(mark);
            if !self.natural_step() {
                break;
            }
            self.record(residual, merit, McpStep::Natural, 1.0);
            self.make_trial(1.0, false);
            for i in 0..self.n() {
                match self.work.active[i] {
                    -1 => self.work.trial_x[i] = self.lower[i],
                    1 => self.work.trial_x[i] = self.upper[i],
                    _ => {}
                }
            }
            if !self.evaluate_trial() {
                break;
            }
            self.accept_trial();
        }
        McpStatus::Stalled
    }

    /// Scaled values, Jacobian and merit at `work.x`, where F and its Jacobian have just been evaluated; scaling anew if asked.
    pub(super) fn linearise(&mut self, plan: &Plan, anew: bool) -> Option<f64> {
        if anew {
            self.equilibrate(plan);
        }
        self.scale_jacobian(plan);
        let psi = self.merit(plan);
        psi.is_finite().then_some(psi)
    }

    /// The merit at P(x + t C d), which is left in `work.trial_x`; `None` where F is not finite.
    pub(super) fn try_along(&mut self, plan: &Plan, t: f64) -> Option<f64> {
        self.work.active.fill(0);
        self.make_trial(t, true);
        if !self.evaluate_trial() {
            return None;
        }
        Some(self.trial_merit(plan))
    }

    /// The globalised iteration from `work.x`.
    pub(super) fn descend(&mut self, plan: &Plan) -> McpStatus {
        let inside = self.options.stay_inside || plan.proximal > 0.0;
        for i in 0..self.n() {
            self.work.x[i] = self.clamp(i, self.work.x[i]);
        }
        let failure = |e: &Self| McpStatus::EvaluationFailure {
            component: e.bad_component.unwrap_or(0),
        };
        if !self.evaluate() || !self.jacobian() {
            return failure(self);
        }
        self.equilibrate(plan);
        let mut fresh_jacobian = true;
        let mut psi = self.merit(plan);
        let mut kept_psi = f64::INFINITY;
        let mut excursion = 0;
        let mut locked = false;
        let mut last_step = None;
        let mut slow = 0;
        let mut anew = 0;
        self.work.merits.clear();
        for k in 0.. {
            let residual = self.residual();
            if inside || self.is_inside() {
                self.note_best(residual);
            }
            if !fresh_jacobian && !self.jacobian() {
                return failure(self);
            }
            if !fresh_jacobian && anew < 20 && self.is_stale(plan) {
                anew += 1;
                self.equilibrate(plan);
                psi = self.merit(plan);
                kept_psi = f64::INFINITY;
                self.work.merits.clear();
            }
            fresh_jacobian = false;
            self.scale_jacobian(plan);
            if plan.proximal > 0.0 {
                if residual <= self.options.tolerance || self.proximal_residual() <= plan.loose {
                    self.record(residual, psi, McpStep::None, 0.0);
                    return McpStatus::Solved;
                }
            } else if residual <= self.options.tolerance {
                if !inside && !self.is_inside() {
                    for i in 0..self.n() {
                        self.work.x[i] = self.clamp(i, self.work.x[i]);
                    }
                    if !self.evaluate() {
                        return failure(self);
                    }
                }
                let residual = self.residual();
                if residual <= self.options.tolerance {
                    if self.is_localised(last_step) {
                        self.note_best(residual);
                        self.record(residual, psi, McpStep::None, 0.0);
                        return McpStatus::Solved;
                    }
                    self.asymptotic = true;
                }
            }
            if let Some(status) = self.exhausted() {
                self.record(residual, psi, McpStep::None, 0.0);
                return status;
            }
            if k >= plan.max_iterations {
                self.record(residual, psi, McpStep::None, 0.0);
                return McpStatus::IterationLimit;
            }
            if psi < kept_psi {
                if psi > 0.99 * kept_psi {
                    slow += 1;
                } else {
                    slow = 0;
                }
                if locked && psi < 0.25 * kept_psi {
                    locked = false;
                }
                kept_psi = psi;
                excursion = 0;
                let Work { kept, x, .. } = &mut *self.work;
                kept.copy_from_slice(x);
            } else {
                excursion += 1;
                slow += 1;
            }
            if slow > 40 {
                self.record(residual, psi, McpStep::None, 0.0);
                return self.settle(plan, psi);
            }
            if excursion > plan.credit && psi > kept_psi {
                // Back to the best point, and no such excursion again before there is progress.
                let Work { kept, x, .. } = &mut *self.work;
                x.copy_from_slice(kept);
                if !self.evaluate() || !self.jacobian() {
                    return failure(self);
                }
                fresh_jacobian = true;
                psi = self.merit(plan);
                locked = true;
                excursion = 0;
                self.work.merits.clear();
                kept_psi = psi * (1.0 + 1e-12);
                continue;
            }
            self.work.merits.push(psi);
            let from = self.work.merits.len().saturating_sub(plan.memory);
            let reference = self.work.merits[from..].iter().fold(psi, |m, p| m.max(*p));
            let natural = match plan.natural {
                true => self.try_natural(plan, reference, locked, inside),
                false => None,
            };
            let step = match natural {
                Some(t) => Some((McpStep::Natural, t)),
                None => self.try_fischer(plan, psi, reference, inside),
            };
            let Some((kind, damping)) = step else {
                self.record(residual, psi, McpStep::None, 0.0);
                return self.settle(plan, psi);
            };
            self.record(residual, psi, kind, damping);
            last_step = (kind == McpStep::Natural && damping == 1.0).then(|| self.step_length());
            self.accept_trial();
            psi = self.merit(plan);
        }
        McpStatus::IterationLimit
    }

    fn is_inside(&self) -> bool {
        (0..self.n()).all(|i| self.work.x[i] == self.clamp(i, self.work.x[i]))
    }

    /// Natural residual of the proximal problem, scaled.
    fn proximal_residual(&self) -> f64 {
        let w = &*self.work;
        (0..w.n).fold(0.0, |m: f64, i| {
            let c = w.col[i];
            let r = natural(w.x[i] / c, self.lower[i] / c, self.upper[i] / c, w.scaled[i]);
            m.max(r.abs())
        })
    }

    /// No step helps: a solution to rounding, a stationary point, or neither.
    fn settle(&mut self, plan: &Plan, psi: f64) -> McpStatus {
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

    /// A full, projected step of the natural map: taken where it helps, or on credit.
    fn try_natural(&mut self, plan: &Plan, reference: f64, locked: bool, inside: bool) -> Option<f64> {
        self.update_active();
        if !self.natural_step() {
            return None;
        }
        self.make_trial(1.0, inside);
        let mut t = 1.0;
        // Out of the domain: half way, and so on.
        while !self.evaluate_trial() {
            t *= 0.5;
            if t < 1e-3 {
                return None;
            }
            self.make_trial(t, inside);
        }
        let psi = self.trial_merit(plan);
        if psi.is_nan() {
            return None;
        }
        let wanted = if plan.credit == 0 { 0.5 } else { 1.0 - ARMIJO };
        if psi <= wanted * reference {
            return Some(t);
        }
        let w = &*self.work;
        if plan.proximal == 0.0 && self.residual_of(&w.trial_x, &w.trial_f) <= 0.25 * self.attempt_best {
            return Some(t);
        }
        (!locked && plan.credit > 0 && psi < 1e6 * (1.0 + reference)).then_some(t)
    }

    /// ∂Φ and its H in `work.system`, HᵀΦ in `work.gradient`.
    fn prepare_fischer(&mut self, plan: &Plan, shift: f64) {
        let n = self.n();
        let mut any = false;
        for i in 0..n {
            let Gap { below, above } = self.gap(i, self.work.x[i]);
            let kink = self.work.scaled[i] == 0.0 && (below == 0.0 || above == 0.0);
            self.work.scratch[i] = f64::from(u8::from(kink));
            any |= kink;
        }
        self.work.rate.fill(0.0);
        if any {
            let Work {
                jac, scratch, rate, ..
            } = &mut *self.work;
            jac.mul_vec(scratch, rate);
        }
        for i in 0..n {
            let gap = self.gap(i, self.work.x[i]);
            let (a, b) = component_gradient(gap, self.work.scaled[i], plan.lambda, self.work.rate[i]);
            self.work.da[i] = a;
            self.work.db[i] = b;
        }
        self.work.build_fischer(shift);
        let Work {
            system,
            phi,
            gradient,
            ..
        } = &mut *self.work;
        system.mul_transpose_vec(phi, gradient);
    }

    /// Line searches along the Newton step of Φ, regularised steps and the negative gradient.
    fn try_fischer(&mut self, plan: &Plan, psi: f64, reference: f64, inside: bool) -> Option<(McpStep, f64)> {
        let n = self.n();
        // Steps to bounds are not special here.
        self.work.active.fill(0);
        self.prepare_fischer(plan, 0.0);
        let norm = (2.0 * psi).sqrt();
        for i in 0..n {
            self.work.d[i] = -self.work.phi[i];
        }
        self.report.factorisations += 1;
        let mut solved = self.work.solve_system();
        if solved {
            if let Some(t) = self.search(plan, psi, reference, 1.0, 1e-2, inside) {
                return Some((McpStep::FischerBurmeister, t));
            }
        }
        if n <= NORMAL_EQUATIONS {
            let mut mu = norm.min(1.0) * 1e-3;
            for _ in 0..5 {
                self.report.factorisations += 1;
                if self.work.solve_regularised(mu)
                    && let Some(t) = self.search(plan, psi, reference, 1.0, 0.1, inside)
                {
                    return Some((McpStep::Regularised, t));
                }
                mu *= 30.0;
            }
        } else {
            let mut shift = norm.min(1.0) * 1e-3;
            for _ in 0..4 {
                self.work.build_fischer(shift);
                for i in 0..n {
                    self.work.d[i] = -self.work.phi[i];
                }
                self.report.factorisations += 1;
                solved = self.work.solve_system();
                if solved && let Some(t) = self.search(plan, psi, reference, 1.0, 0.1, inside) {
                    return Some((McpStep::Regularised, t));
                }
                shift *= 10.0;
            }
        }
        let steepest: f64 = self.work.gradient.iter().map(|g| g * g).sum();
        if steepest == 0.0 {
            return None;
        }
        let t = (2.0 * psi / steepest).min(1e6);
        for i in 0..n {
            self.work.d[i] = -self.work.gradient[i];
        }
        self.search(plan, psi, reference, t, t * 1e-10, inside)
            .map(|s| (McpStep::Gradient, s))
    }

    /// Armijo search along P(x + t C d) from t = `first` down to `least`.
    fn search(
        &mut self,
        plan: &Plan,
        psi: f64,
        reference: f64,
        first: f64,
        least: f64,
        inside: bool,
    ) -> Option<f64> {
        let mut t = first;
        for _ in 0..40 {
            if !(t >= least && t > 0.0) {
                break;
            }
            self.make_trial(t, inside);
            let slope: f64 = {
                let w = &*self.work;
                (0..w.n)
                    .map(|i| w.gradient[i] * (w.trial_x[i] - w.x[i]) / w.col[i])
                    .sum()
            };
            if slope < 0.0 && self.evaluate_trial() {
                let trial = self.trial_merit(plan);
                if trial <= reference + ARMIJO * slope && (trial < psi * (1.0 - 1e-14) || reference > psi) {
                    return Some(t);
                }
            }
            t *= 0.5;
        }
        None
    }
}

/// FNV-1a.
fn hash(active: &[i8]) -> u64 {
    active.iter().fold(0xcbf2_9ce4_8422_2325, |h, a| {
        (h ^ u64::from(a.cast_unsigned())).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The size beyond which iterates count as infinite.
pub(super) fn far(start: &[f64]) -> f64 {
    FAR * (1.0 + max_abs(start))
}
