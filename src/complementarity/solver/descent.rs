//! The globalised iteration that most strategies use: steps of the natural map or of Φ while they reduce the merit, and a few without
//! decrease (watchdog technique).

use super::McpStep;
use super::engine::Engine;
use super::plan::Plan;
use crate::run::Status;
use crate::sparse::max_abs;
use crate::tolerances::HALF_DIGITS;

/// A merit above this part of the best one counts as hardly reduced; so many such steps in a row end the descent.
const HARDLY: f64 = 0.99;
const PATIENCE: usize = 40;

/// After an excursion without decrease has failed, another one is allowed once the merit is below this part of the best one.
const TRUSTED: f64 = 0.25;

/// How often rows and columns are equilibrated again, at most.
const ANEW: usize = 20;

/// State of one descent.
#[derive(Debug, Clone)]
pub(super) struct Descent {
    /// Point with the smallest merit, and that merit.
    kept: Vec<f64>,
    best: f64,
    merits: Vec<f64>,
    /// Number of steps in a row that have not brought the merit below its best value, and of those that have hardly done so.
    excursion: usize,
    slow: usize,
    /// Whether an excursion without decrease has failed.
    locked: bool,
    anew: usize,
}

impl Descent {
    pub(super) fn new(n: usize) -> Self {
        Self {
            kept: vec![0.0; n],
            best: f64::INFINITY,
            merits: Vec::new(),
            excursion: 0,
            slow: 0,
            locked: false,
            anew: 0,
        }
    }

    fn begin(&mut self) {
        (self.excursion, self.slow, self.locked, self.anew) = (0, 0, false, 0);
        self.compare_with(f64::INFINITY);
    }

    /// Discards the merits so far except the best.
    fn compare_with(&mut self, best: f64) {
        self.best = best;
        self.merits.clear();
    }

    /// Records the merit at x; `false` where it has hardly fallen for too long.
    fn note(&mut self, psi: f64, x: &[f64]) -> bool {
        if psi < self.best {
            self.slow = if psi > HARDLY * self.best {
                self.slow + 1
            } else {
                0
            };
            self.locked &= psi >= TRUSTED * self.best;
            self.best = psi;
            self.excursion = 0;
            self.kept.copy_from_slice(x);
        } else {
            self.excursion += 1;
            self.slow += 1;
        }
        self.slow <= PATIENCE
    }
}

impl Engine<'_> {
    /// The globalised iteration from `work.here.x`.
    pub(super) fn descend(&mut self, plan: &Plan) -> Status {
        let inside = self.options.stay_inside || plan.proximal > 0.0;
        let failure = |e: &Self| Status::EvaluationFailure {
            component: e.bad_component.unwrap_or(0),
        };
        if !self.clamp_all() {
            return failure(self);
        }
        self.equilibrate(plan);
        let mut fresh_jacobian = true;
        let mut psi = self.merit(plan);
        let mut watch = Watch::new(psi, max_abs(&self.work.here.x));
        self.work.descent.begin();
        for k in 0.. {
            let residual = self.residual();
            if inside || self.is_inside() {
                self.note_best(residual);
            }
            if !fresh_jacobian {
                if !self.jacobian() {
                    return failure(self);
                }
                psi = self.equilibrate_anew(plan, psi);
            }
            fresh_jacobian = false;
            self.work.lin.rescale(plan.proximal);
            if let Some(status) = self.ends(plan, k, (residual, psi), &mut watch) {
                return status;
            }
            let w = &mut *self.work;
            let patient = w.descent.note(psi, &w.here.x);
            let excursion = w.descent.excursion;
            let step = match patient && excursion <= plan.credit {
                true => self.step(plan, psi, inside),
                false => None,
            };
            let Some((kind, damping)) = step else {
                if !patient || excursion == 0 {
                    self.record(residual, psi, McpStep::None, 0.0);
                    return self.settle(plan, psi);
                }
                let Some(best) = self.go_back(plan) else {
                    return failure(self);
                };
                (psi, fresh_jacobian) = (best, true);
                continue;
            };
            self.record(residual, psi, kind, damping);
            self.accept_trial();
            psi = self.merit(plan);
        }
        Status::IterationLimit
    }

    /// Re-equilibrates where factors are outdated, and returns the merit. Only at the best point: factors from an excursion would hide
    /// errors elsewhere.
    fn equilibrate_anew(&mut self, plan: &Plan, psi: f64) -> f64 {
        let descent = &self.work.descent;
        if psi >= descent.best || psi.is_nan() || descent.anew >= ANEW || !self.is_stale(plan) {
            return psi;
        }
        self.equilibrate(plan);
        self.work.descent.anew += 1;
        self.work.descent.compare_with(f64::INFINITY);
        self.merit(plan)
    }

    /// Why the descent ends at iterate k, if it does.
    fn ends(
        &mut self,
        plan: &Plan,
        k: usize,
        (mut residual, psi): (f64, f64),
        watch: &mut Watch,
    ) -> Option<Status> {
        let inside = self.options.stay_inside;
        let solved = if plan.proximal > 0.0 {
            self.is_solution(residual) || self.proximal_residual() <= plan.loose
        } else {
            let found = self.arrives(residual, inside) || self.is_next_to_solution(psi, watch);
            if found {
                residual = self.residual();
                self.note_best(residual);
            }
            found
        };
        let limit = (k >= plan.max_iterations).then_some(Status::IterationLimit);
        let status = match solved {
            true => Status::Solved,
            false => self.exhausted().or(limit)?,
        };
        self.record(residual, psi, McpStep::None, 0.0);
        Some(status)
    }

    /// Back to the best point, and no such excursion again before there is progress; the merit there, or `None` where F is not finite.
    fn go_back(&mut self, plan: &Plan) -> Option<f64> {
        let w = &mut *self.work;
        w.here.x.copy_from_slice(&w.descent.kept);
        if !self.evaluate() || !self.jacobian() {
            return None;
        }
        let psi = self.merit(plan);
        let descent = &mut self.work.descent;
        (descent.locked, descent.excursion) = (true, 0);
        // Changes by rounding are no progress.
        descent.compare_with(psi * (1.0 + 1e-12));
        Some(psi)
    }

    /// Whether `work.here.x` is a solution, once it is inside the bounds.
    pub(super) fn arrives(&mut self, residual: f64, inside: bool) -> bool {
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

    /// Whether there is a solution next to `work.here.x`, where the merit has fallen far. Notes where it falls on the way to infinity.
    fn is_next_to_solution(&mut self, psi: f64, watch: &mut Watch) -> bool {
        let fallen = psi <= Watch::FALLEN * watch.first;
        let size = max_abs(&self.work.here.x);
        // Iterates that come to rest converge, however far from the start.
        let moving = self.step_length() > Watch::REST * size;
        self.asymptotic |= fallen && self.open && size > Watch::AWAY * watch.size && moving;
        if psi > watch.next || psi.is_nan() {
            return false;
        }
        // Rounded off again once the merit has fallen by as much again.
        watch.next = psi * HALF_DIGITS;
        self.round_off()
    }

    /// A step from `work.here.x`, into `work.trial.x`.
    fn step(&mut self, plan: &Plan, psi: f64, inside: bool) -> Option<(McpStep, f64)> {
        let Descent { merits, locked, .. } = &mut self.work.descent;
        merits.push(psi);
        let last = &merits[merits.len().saturating_sub(plan.memory)..];
        let (reference, locked) = (last.iter().fold(psi, |m: f64, p| m.max(*p)), *locked);
        if plan.natural
            && let Some(t) = self.try_natural(plan, reference, locked, inside)
        {
            return Some((McpStep::Natural, t));
        }
        self.try_fischer(plan, psi, reference, inside)
    }
}

/// When to check whether a falling merit leads to a solution.
struct Watch {
    first: f64,
    size: f64,
    next: f64,
}

impl Watch {
    /// Part of its first value to which the merit must fall.
    const FALLEN: f64 = 1e-16;
    /// Growth of the iterates on the way to infinity.
    const AWAY: f64 = 1.2;
    /// Last step relative to the size of the iterates below which they are at rest. Where the merit of exp(−x), exp(−x²) or exp(−exp x) has
    /// fallen so far on the way to infinity it is 1e-3 and more; quadratic convergence leaves less than 1e-4.
    const REST: f64 = 1e-4;

    fn new(first: f64, size: f64) -> Self {
        Self {
            first,
            size,
            next: Self::FALLEN * first.max(1.0),
        }
    }
}
