//! One attempt: a globalised Newton iteration from one start.

use std::ops::ControlFlow;

use super::work::Work;
use super::{McpIteration, McpOptions, McpReport, McpStatus, McpStep, McpStrategy};
use crate::clock::Clock;
use crate::complementarity::McpFunction;
use crate::complementarity::accuracy::Measure;
use crate::complementarity::fischer::{Gap, component};
use crate::complementarity::problem::natural;
use crate::sparse::max_abs;

/// Iterates beyond this size, relative to the start, count as tending to infinity.
const FAR: f64 = 1e10;

/// Sufficient decrease of the line search.
pub(super) const ARMIJO: f64 = 1e-4;

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
    pub(super) clock: Clock,
    pub(super) strategy: McpStrategy,
    pub(super) affine: bool,
    /// Smallest natural residual so far, at `work.best`; and that of the current attempt.
    pub(super) best: f64,
    pub(super) attempt_best: f64,
    /// Smallest error relative to the terms of rows, at `work.nearest`.
    pub(super) least_error: f64,
    pub(super) far: f64,
    pub(super) interrupted: bool,
    /// The merit vanished on the way to infinity.
    pub(super) asymptotic: bool,
    /// Whether at the iterate some residual is no small part of its terms.
    pub(super) open: bool,
    pub(super) bad_component: Option<usize>,
    /// Whether `work.f` is F at `work.x` already.
    pub(super) fresh: bool,
    /// Where the first active set is given by the user.
    pub(super) given_active: bool,
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

    pub(super) fn evaluate_trial(&mut self) -> bool {
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

    pub(super) fn residual_of(&self, x: &[f64], f: &[f64]) -> f64 {
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

    pub(super) fn gap(&self, i: usize, x: f64) -> Gap {
        let c = self.work.lin.col()[i];
        Gap {
            below: (x - self.lower[i]) / c,
            above: (self.upper[i] - x) / c,
        }
    }

    pub(super) fn scaled_value(&self, plan: &Plan, i: usize, x: f64, f: f64) -> f64 {
        let w = &*self.work;
        let mut v = w.lin.row()[i] * f;
        if plan.proximal > 0.0 {
            v += plan.proximal * (x - w.centre[i]) / w.lin.col()[i];
        }
        v
    }

    /// Scaled values, Φ and merit at `work.x`.
    pub(super) fn merit(&mut self, plan: &Plan) -> f64 {
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

    pub(super) fn trial_merit(&self, plan: &Plan) -> f64 {
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
            let finite = if shift == 0.0 {
                w.lin.evaluate(self.function, &w.x)
            } else {
                for i in 0..w.n {
                    let (l, u, x) = (self.lower[i], self.upper[i], w.x[i]);
                    let h = shift * (1.0 + x.abs());
                    let inner = if x + h <= u { x + h } else { x - h };
                    w.scratch[i] = if inner >= l { inner } else { 0.5 * (l + u) };
                }
                w.lin.evaluate(self.function, &w.scratch)
            };
            // Misuse, which ends every attempt and is told in the end.
            if w.lin.jac().stray().is_some() {
                return false;
            }
            if finite {
                return true;
            }
            shift = if shift == 0.0 { 1e-10 } else { shift * 100.0 };
        }
        let bad = self.work.lin.jac().triplets().find(|t| !t.2.is_finite());
        self.bad_component = bad.map(|t| t.0);
        false
    }

    /// Equilibrates anew, where the plan asks for it.
    pub(super) fn equilibrate(&mut self, plan: &Plan) {
        let w = &mut *self.work;
        match plan.scaled && self.options.equilibrate {
            true => w.lin.equilibrate(&w.f),
            false => w.lin.reset(),
        }
    }

    fn is_stale(&mut self, plan: &Plan) -> bool {
        let w = &mut *self.work;
        plan.scaled && self.options.equilibrate && w.lin.is_stale(&w.f)
    }

    pub(super) fn record(&mut self, residual: f64, merit: f64, step: McpStep, damping: f64) {
        let iteration = McpIteration {
            index: self.report.iterations,
            strategy: self.strategy,
            residual,
            merit,
            step,
            damping,
            sites_changed: self.sites_changed(),
        };
        self.report.history.push(iteration);
        if step != McpStep::None {
            self.report.iterations += 1;
        }
        if (self.observe)(&iteration).is_break() {
            self.interrupted = true;
        }
    }

    /// The number of components whose piece of the natural map at `work.x` is not that of the iterate recorded last.
    fn sites_changed(&mut self) -> usize {
        let first = self.report.history.is_empty();
        let w = &mut *self.work;
        let mut changed = 0;
        for i in 0..w.n {
            let z = w.x[i] - w.f[i];
            let now = i8::from(z > self.upper[i]) - i8::from(z < self.lower[i]);
            changed += usize::from(!first && now != w.pieces[i]);
            w.pieces[i] = now;
        }
        changed
    }

    /// A reason to stop altogether.
    pub(super) fn exhausted(&self) -> Option<McpStatus> {
        if self.interrupted {
            Some(McpStatus::Interrupted)
        } else if self.report.iterations >= self.options.max_iterations {
            Some(McpStatus::IterationLimit)
        } else if self.is_over_time() {
            Some(McpStatus::TimeLimit)
        } else {
            None
        }
    }

    /// Looked at before each factorisation and each trial of a search, which may be many in one step.
    pub(super) fn is_over_time(&self) -> bool {
        self.options.max_time.is_some_and(|t| self.clock.elapsed() >= t)
    }

    pub(super) fn note_best(&mut self, residual: f64) {
        self.attempt_best = self.attempt_best.min(residual);
        if residual < self.best {
            self.best = residual;
            let Work { best, x, .. } = &mut *self.work;
            best.copy_from_slice(x);
        }
    }

    pub(super) fn note_nearest(&mut self, measure: Measure) {
        if measure.error < self.least_error && !measure.flat && self.is_inside() {
            self.least_error = measure.error;
            let Work { nearest, x, .. } = &mut *self.work;
            nearest.copy_from_slice(x);
        }
    }

    /// Scaled values, Jacobian and merit at `work.x`, where F and its Jacobian have just been evaluated; scaling anew if asked.
    pub(super) fn linearise(&mut self, plan: &Plan, anew: bool) -> Option<f64> {
        if anew {
            self.equilibrate(plan);
        }
        self.work.lin.rescale(plan.proximal);
        let psi = self.merit(plan);
        psi.is_finite().then_some(psi)
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
        let mut slow = 0;
        let mut anew = 0;
        let mut watch = Watch::new(psi, max_abs(&self.work.x));
        self.work.merits.clear();
        for k in 0.. {
            let residual = self.residual();
            if inside || self.is_inside() {
                self.note_best(residual);
            }
            if !fresh_jacobian && !self.jacobian() {
                return failure(self);
            }
            // Only at the best point: factors from an excursion would make light of what is wrong elsewhere.
            if !fresh_jacobian && psi < kept_psi && anew < 20 && self.is_stale(plan) {
                anew += 1;
                self.equilibrate(plan);
                psi = self.merit(plan);
                kept_psi = f64::INFINITY;
                self.work.merits.clear();
            }
            fresh_jacobian = false;
            self.work.lin.rescale(plan.proximal);
            if plan.proximal > 0.0 {
                if self.is_solution(residual) || self.proximal_residual() <= plan.loose {
                    self.record(residual, psi, McpStep::None, 0.0);
                    return McpStatus::Solved;
                }
            } else if self.arrives(residual, inside) || self.is_next_to_solution(psi, &mut watch) {
                let residual = self.residual();
                self.note_best(residual);
                self.record(residual, psi, McpStep::None, 0.0);
                return McpStatus::Solved;
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
            let step = match excursion > plan.credit {
                true => None,
                false => self.step(plan, psi, locked, inside),
            };
            let Some((kind, damping)) = step else {
                if excursion == 0 {
                    self.record(residual, psi, McpStep::None, 0.0);
                    return self.settle(plan, psi);
                }
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
            };
            self.record(residual, psi, kind, damping);
            self.accept_trial();
            psi = self.merit(plan);
        }
        McpStatus::IterationLimit
    }

    /// Whether `work.x` is a solution, once it is inside the bounds.
    fn arrives(&mut self, residual: f64, inside: bool) -> bool {
        if !self.is_solution(residual) {
            return false;
        }
        if inside || self.is_inside() {
            return true;
        }
        self.clamp_all() && {
            let residual = self.residual();
            self.is_solution(residual)
        }
    }

    /// Whether there is a solution next to `work.x`, where the merit has fallen far. Notes where it falls on the way to infinity.
    fn is_next_to_solution(&mut self, psi: f64, watch: &mut Watch) -> bool {
        let fallen = psi <= Watch::FALLEN * watch.first;
        self.asymptotic |= fallen && self.open && max_abs(&self.work.x) > Watch::AWAY * watch.size;
        if psi > watch.next || psi.is_nan() {
            return false;
        }
        watch.next = psi * Watch::AGAIN;
        self.round_off()
    }

    /// A step from `work.x`, into `work.trial_x`.
    fn step(&mut self, plan: &Plan, psi: f64, locked: bool, inside: bool) -> Option<(McpStep, f64)> {
        self.work.merits.push(psi);
        let from = self.work.merits.len().saturating_sub(plan.memory);
        let reference = self.work.merits[from..].iter().fold(psi, |m, p| m.max(*p));
        if plan.natural
            && let Some(t) = self.try_natural(plan, reference, locked, inside)
        {
            return Some((McpStep::Natural, t));
        }
        self.try_fischer(plan, psi, reference, inside)
    }
}

/// When to look whether a falling merit leads to a solution.
struct Watch {
    first: f64,
    size: f64,
    next: f64,
}

impl Watch {
    /// Part of its first value to which the merit must fall.
    const FALLEN: f64 = 1e-16;
    /// The same from one look to the next.
    const AGAIN: f64 = 1e-8;
    /// Growth of the iterates on the way to infinity.
    const AWAY: f64 = 1.2;

    fn new(first: f64, size: f64) -> Self {
        Self {
            first,
            size,
            next: Self::FALLEN * first.max(1.0),
        }
    }
}

/// The size beyond which iterates count as infinite.
pub(super) fn far(start: &[f64]) -> f64 {
    FAR * (1.0 + max_abs(start))
}
