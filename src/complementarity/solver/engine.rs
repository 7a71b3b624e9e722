//! State that all strategies share: the problem, the iterate, the report, and the limits.

use std::ops::ControlFlow;

use super::parts::Parts;
use super::plan::Plan;
use super::work::Work;
use super::{McpIteration, McpOptions, McpReport, McpStep, McpStrategy};
use crate::clock::Clock;
use crate::complementarity::McpFunction;
use crate::complementarity::fischer::{Gap, component};
use crate::complementarity::problem::natural;
use crate::judge::Verdict;
use crate::run::Status;
use crate::sparse::max_abs;

/// Iterates beyond this size, relative to the start, count as tending to infinity.
const FAR: f64 = 1e10;

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
    /// Smallest natural residual so far, at `work.seen.best`; and that of the current attempt.
    pub(super) best: f64,
    pub(super) attempt_best: f64,
    /// Smallest error relative to the terms of rows, at `work.seen.nearest`.
    pub(super) least_error: f64,
    pub(super) far: f64,
    pub(super) interrupted: bool,
    /// The merit vanished on the way to infinity.
    pub(super) asymptotic: bool,
    /// Whether at the iterate some residual is no small part of its terms.
    pub(super) open: bool,
    pub(super) bad_component: Option<usize>,
    /// Whether `work.here.f` is F at `work.here.x` already.
    pub(super) fresh: bool,
    /// Where the first active set is given by the user.
    pub(super) given_active: bool,
}

impl<'a> Engine<'a> {
    /// For a solve from `work.start`.
    pub(super) fn new(
        problem: &Parts<'a>,
        options: &'a McpOptions,
        work: &'a mut Work,
        report: &'a mut McpReport,
        observe: &'a mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
        clock: Clock,
    ) -> Self {
        let affine = problem.function.is_affine();
        work.constants.clear();
        if affine {
            work.constants.resize(work.n, 0.0);
            work.trial.x.fill(0.0);
            problem.function.value(&work.trial.x, &mut work.constants);
        }
        Engine {
            function: problem.function,
            lower: problem.lower,
            upper: problem.upper,
            options,
            far: far(&work.start),
            work,
            report,
            observe,
            clock,
            strategy: options.strategies[0],
            affine,
            best: f64::INFINITY,
            attempt_best: f64::INFINITY,
            least_error: f64::INFINITY,
            interrupted: false,
            asymptotic: false,
            open: true,
            bad_component: None,
            fresh: false,
            given_active: false,
        }
    }
}

impl Engine<'_> {
    pub(super) fn n(&self) -> usize {
        self.work.n
    }

    pub(super) fn clamp(&self, i: usize, x: f64) -> f64 {
        x.max(self.lower[i]).min(self.upper[i])
    }

    /// F at `work.here.x`; `false` and the component noted where it is not finite.
    pub(super) fn evaluate(&mut self) -> bool {
        if std::mem::take(&mut self.fresh) {
            return true;
        }
        self.report.evaluations += 1;
        self.function.value(&self.work.here.x, &mut self.work.here.f);
        let bad = self.work.here.f.iter().position(|f| !f.is_finite());
        if bad.is_some() {
            self.bad_component = bad;
        }
        bad.is_none()
    }

    pub(super) fn evaluate_trial(&mut self) -> bool {
        let x = &self.work.trial.x;
        // Written so that NaN fails.
        if !x.iter().all(|v| v.abs() <= self.far) {
            return false;
        }
        self.report.evaluations += 1;
        self.function.value(x, &mut self.work.trial.f);
        let bad = self.work.trial.f.iter().position(|f| !f.is_finite());
        if bad.is_some() {
            self.bad_component = bad;
        }
        bad.is_none()
    }

    /// Natural residual at `work.here.x`, in the units of the problem.
    pub(super) fn residual(&self) -> f64 {
        let w = &*self.work;
        self.residual_of(&w.here.x, &w.here.f)
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
            v += plan.proximal * (x - w.equations.centre[i]) / w.lin.col()[i];
        }
        v
    }

    /// Scaled values, Φ and merit at `work.here.x`.
    pub(super) fn merit(&mut self, plan: &Plan) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.n() {
            let x = self.work.here.x[i];
            let f = self.scaled_value(plan, i, x, self.work.here.f[i]);
            let phi = component(self.gap(i, x), f, plan.lambda);
            self.work.equations.scaled[i] = f;
            self.work.equations.phi[i] = phi;
            sum += phi * phi;
        }
        0.5 * sum
    }

    pub(super) fn trial_merit(&self, plan: &Plan) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.n() {
            let x = self.work.trial.x[i];
            let f = self.scaled_value(plan, i, x, self.work.trial.f[i]);
            let phi = component(self.gap(i, x), f, plan.lambda);
            sum += phi * phi;
        }
        0.5 * sum
    }

    /// ∇F at `work.here.x`, unscaled. Where entries are not finite (√x at 0) that of a point a little inside the bounds is used.
    pub(super) fn jacobian(&mut self) -> bool {
        let mut shift = 0.0;
        for _ in 0..6 {
            self.report.jacobians += 1;
            let w = &mut *self.work;
            let finite = if shift == 0.0 {
                w.lin.evaluate(self.function, &w.here.x)
            } else {
                let (x, bounds) = (w.here.x.iter(), self.lower.iter().zip(self.upper));
                let inner = x.zip(bounds).map(|(&x, (&l, &u))| {
                    let h = shift * (1.0 + x.abs());
                    let inner = if x + h <= u { x + h } else { x - h };
                    if inner >= l { inner } else { 0.5 * (l + u) }
                });
                w.lin.evaluate_at(self.function, inner)
            };
            // Misuse, which ends every attempt and is reported at the end.
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

    /// Equilibrates again, if the plan requires it.
    pub(super) fn equilibrate(&mut self, plan: &Plan) {
        let w = &mut *self.work;
        match plan.scaled && self.options.equilibrate {
            true => w.lin.equilibrate(&w.here.f),
            false => w.lin.reset(),
        }
    }

    pub(super) fn is_stale(&mut self, plan: &Plan) -> bool {
        let w = &mut *self.work;
        plan.scaled && self.options.equilibrate && w.lin.is_stale(&w.here.f)
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
        // An observer that has asked to stop is not called again, though the last iterate is recorded.
        self.interrupted = self.interrupted || (self.observe)(&iteration).is_break();
    }

    /// Calls the observer, which may want to stop, between iterates.
    pub(super) fn tell(&mut self, strategy: McpStrategy) {
        let now = self.between(strategy);
        self.interrupted = self.interrupted || (self.observe)(&now).is_break();
    }

    /// What the observer is told between iterates, where no residual of the problem is at hand.
    pub(super) fn between(&self, strategy: McpStrategy) -> McpIteration {
        McpIteration {
            index: self.report.iterations,
            strategy,
            residual: f64::NAN,
            merit: f64::NAN,
            step: McpStep::None,
            damping: 0.0,
            sites_changed: 0,
        }
    }

    /// The number of components whose piece of the natural map at `work.here.x` is not that of the iterate recorded last.
    fn sites_changed(&mut self) -> usize {
        let first = self.report.history.is_empty();
        let w = &mut *self.work;
        let mut changed = 0;
        for i in 0..w.n {
            let z = w.here.x[i] - w.here.f[i];
            let now = i8::from(z > self.upper[i]) - i8::from(z < self.lower[i]);
            changed += usize::from(!first && now != w.seen.pieces[i]);
            w.seen.pieces[i] = now;
        }
        changed
    }

    /// A reason to stop altogether.
    pub(super) fn exhausted(&self) -> Option<Status> {
        if self.interrupted {
            Some(Status::Interrupted)
        } else if self.report.iterations >= self.options.max_iterations {
            Some(Status::IterationLimit)
        } else if self.is_over_time() {
            Some(Status::TimeLimit)
        } else {
            None
        }
    }

    /// Checked before each factorisation and each trial point of a search, of which there may be many in one step.
    pub(super) fn is_over_time(&self) -> bool {
        self.options.max_time.is_some_and(|t| self.clock.elapsed() >= t)
    }

    pub(super) fn note_best(&mut self, residual: f64) {
        self.attempt_best = self.attempt_best.min(residual);
        if residual < self.best {
            self.best = residual;
            let w = &mut *self.work;
            w.seen.best.copy_from_slice(&w.here.x);
        }
    }

    pub(super) fn note_nearest(&mut self, verdict: Verdict) {
        if verdict.error < self.least_error && !verdict.flat && self.is_inside() {
            self.least_error = verdict.error;
            let w = &mut *self.work;
            w.seen.nearest.copy_from_slice(&w.here.x);
        }
    }

    /// Scaled values, Jacobian and merit at `work.here.x`, where F and its Jacobian have just been evaluated; rescaled if `anew`.
    pub(super) fn linearise(&mut self, plan: &Plan, anew: bool) -> Option<f64> {
        if anew {
            self.equilibrate(plan);
        }
        self.work.lin.rescale(plan.proximal);
        let psi = self.merit(plan);
        psi.is_finite().then_some(psi)
    }
}

/// The size beyond which iterates count as infinite.
fn far(start: &[f64]) -> f64 {
    FAR * (1.0 + max_abs(start))
}
