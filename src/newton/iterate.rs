use std::ops::ControlFlow;

use super::convergence::{Scratch, is_small, row_sizes};
use super::system::{Evaluation, System};
use super::workspace::Workspace;
use super::{Convergence, Damping, Failure, Iteration, NewtonError, NewtonOptions, Step, Unsolved};
use crate::linear::{LinearError, LinearSolver};
use crate::piecewise::PiecewiseError;
use crate::sparse::Matrix;
use crate::sparse::norm as norm2;

/// Line-search iterations after which the residual must have halved, or pieces are changed one at a time.
const PATIENCE: usize = 12;

/// Share of its terms beyond which a residual that changes with the last digits of x is a jump of H, not rounding.
const JUMP: f64 = 1e-6;

/// How far the globalisation has been driven.
#[derive(PartialEq, PartialOrd, Clone, Copy)]
pub(super) enum Mode {
    Full,
    LineSearch,
    LeastIndex,
}

pub(super) fn iterate(
    work: &mut Workspace,
    solver: &mut dyn LinearSolver,
    options: &NewtonOptions,
    system: &mut dyn System,
    x: &mut [f64],
    observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
) -> Result<Convergence, NewtonError> {
    work.report.history.clear();
    work.report.factorisations = 0;
    work.report.evaluations = 0;
    work.visited.clear();
    work.weight.fill(1.0);
    let Some(mut jac) = work.jac.take() else {
        return Err(LinearError::NotAnalyzed.into());
    };
    let mut run = Run {
        n: work.n,
        work,
        solver,
        options,
        system,
        observe,
        mode: match options.damping {
            Damping::Always => Mode::LineSearch,
            _ => Mode::Full,
        },
        best_norm: f64::INFINITY,
        weighted: false,
    };
    let outcome = run.go(&mut jac, x);
    let best_norm = run.best_norm;
    work.jac = Some(jac);
    match outcome? {
        Ok(convergence) => Ok(convergence),
        Err(reason) => {
            if best_norm.is_finite() {
                x.copy_from_slice(&work.best);
            }
            Err(NewtonError::Failed(Box::new(Unsolved {
                reason,
                x: x.to_vec(),
                residual_norm: best_norm,
                report: work.report.clone(),
            })))
        }
    }
}

pub(super) struct Run<'a> {
    pub(super) work: &'a mut Workspace,
    pub(super) solver: &'a mut dyn LinearSolver,
    pub(super) options: &'a NewtonOptions,
    pub(super) system: &'a mut dyn System,
    observe: &'a mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    pub(super) mode: Mode,
    /// ‖H‖₂ at `work.best`.
    best_norm: f64,
    /// Whether `work.weight` has been computed.
    pub(super) weighted: bool,
    pub(super) n: usize,
}

impl Run<'_> {
    /// The outer result is for misuse, the inner one for the outcome of the iteration.
    fn go(&mut self, jac: &mut Matrix, x: &mut [f64]) -> Result<Result<Convergence, Failure>, NewtonError> {
        let mut evaluation = self.enter(x);
        let mut norm = norm2(&self.work.r);
        if !norm.is_finite() {
            return Ok(Err(Failure::NotFinite));
        }
        let mut previous_norm = f64::INFINITY;
        let mut why = None;
        let mut patience = Patience::new(f64::INFINITY);
        let mut index = 0;
        loop {
            let natural_norm = self.natural_norm(x, norm, evaluation);
            if natural_norm < self.best_norm {
                self.best_norm = natural_norm;
                self.work.best.copy_from_slice(x);
            }
            self.linearize(jac, x)?;
            if let Some(convergence) = self.converged(jac, x, natural_norm, previous_norm, evaluation) {
                self.best_norm = natural_norm;
                self.record_last(index, natural_norm, evaluation);
                return Ok(Ok(convergence));
            }
            if index >= self.options.max_iterations {
                return Ok(self.give_up(
                    jac,
                    x,
                    index,
                    norm,
                    evaluation,
                    why.unwrap_or(Failure::MaxIterations),
                ));
            }
            let cycles = self.cycles(norm);
            if self.mode == Mode::LeastIndex && cycles {
                return Ok(self.give_up(jac, x, index, norm, evaluation, why.unwrap_or(Failure::Cycling)));
            }
            // Growth alone tells nothing: the units of rows decide it, and pieces not seen before may cost something at first.
            if cycles && self.options.damping == Damping::OnTrouble && self.mode == Mode::Full {
                self.mode = Mode::LineSearch;
                if natural_norm > self.best_norm {
                    (evaluation, norm) = self.back_to_best(x);
                    self.linearize(jac, x)?;
                }
                patience = Patience::new(f64::INFINITY);
            }
            let mut step = match self.newton_direction(jac) {
                Ok(step) => step,
                Err(LinearError::NotFinite { .. }) => {
                    return Ok(self.give_up(jac, x, index, norm, evaluation, Failure::NotFinite));
                }
                Err(e) => return Err(e.into()),
            };
            if self.step_is_rounding(x, norm, previous_norm, step, evaluation) && self.terms_cancel(jac, x) {
                self.best_norm = norm;
                self.record_last(index, norm, evaluation);
                return Ok(Ok(Convergence::Rounding));
            }
            let stuck = self.mode == Mode::LineSearch
                && patience.is_over(self.merit(&self.work.r), evaluation.changed);
            let next = match stuck {
                true => Err(Failure::Stagnation),
                false => self.advance(jac, x, &mut step),
            };
            let next = match next {
                Ok(next) => next,
                Err(reason) => {
                    let last_resort = self.options.damping != Damping::Never && self.mode < Mode::LeastIndex;
                    if reason == Failure::Stagnation && !stuck && self.is_rounding(jac, x) {
                        self.record_last(index, self.best_norm, evaluation);
                        return Ok(Ok(Convergence::Rounding));
                    }
                    if !(last_resort && self.system.use_least_index()) {
                        let reason = why.unwrap_or(reason);
                        return Ok(self.give_up(jac, x, index, norm, evaluation, reason));
                    }
                    // A stationary point says more about the problem than how the last resort failed.
                    why = matches!(reason, Failure::Stationary { .. }).then_some(reason);
                    self.mode = Mode::LeastIndex;
                    self.work.visited.clear();
                    (evaluation, norm) = self.back_to_best(x);
                    previous_norm = f64::INFINITY;
                    continue;
                }
            };
            let step_norm = next.damping * norm2(&self.work.d);
            let flow = self.record(index, norm, step_norm, next.damping, evaluation.changed, step);
            self.system.accept();
            x.copy_from_slice(&self.work.trial);
            std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
            previous_norm = norm;
            norm = next.norm;
            evaluation = next.evaluation;
            index += 1;
            if flow.is_break() {
                let natural_norm = self.natural_norm(x, norm, evaluation);
                if natural_norm < self.best_norm {
                    self.best_norm = natural_norm;
                    self.work.best.copy_from_slice(x);
                }
                return Ok(Err(Failure::Interrupted));
            }
        }
    }

    /// Makes x the iterate.
    fn enter(&mut self, x: &[f64]) -> Evaluation {
        let evaluation = self.system.evaluate(x, &mut self.work.r);
        self.work.report.evaluations += 1;
        self.system.accept();
        evaluation
    }

    fn back_to_best(&mut self, x: &mut [f64]) -> (Evaluation, f64) {
        x.copy_from_slice(&self.work.best);
        let evaluation = self.enter(x);
        (evaluation, norm2(&self.work.r))
    }

    /// ‖H(x)‖; where the iterate uses other pieces, H(x) is left in `trial_r`.
    fn natural_norm(&mut self, x: &[f64], norm: f64, evaluation: Evaluation) -> f64 {
        if evaluation.settled {
            return norm;
        }
        self.work.report.evaluations += 1;
        self.system.natural(x, &mut self.work.trial_r);
        norm2(&self.work.trial_r)
    }

    fn linearize(&mut self, jac: &mut Matrix, x: &[f64]) -> Result<(), NewtonError> {
        jac.clear();
        self.system.linearize(x, jac);
        if let Some((row, col)) = jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col }.into());
        }
        Ok(())
    }

    /// Tolerance on the residual relative to the size of its terms; the rounding floor of those terms counts as converged once
    /// the residual no longer falls.
    fn converged(
        &mut self,
        jac: &Matrix,
        x: &[f64],
        norm: f64,
        previous: f64,
        evaluation: Evaluation,
    ) -> Option<Convergence> {
        let n = self.n;
        let work = &mut *self.work;
        let outcome = if norm <= self.options.absolute_tolerance {
            Some(Convergence::Tolerance)
        } else {
            let r = match evaluation.settled {
                true => &work.r,
                false => &work.trial_r,
            };
            row_sizes(jac.as_ref(), x, &mut work.size);
            let floor = 8.0 * f64::EPSILON * (n as f64).sqrt().max(4.0);
            let tolerance = self.options.relative_tolerance;
            let mut small = |tolerance| {
                let scratch = Scratch {
                    row: &mut work.d,
                    col: &mut work.trial[..n],
                    max: &mut work.gradient,
                };
                is_small(r, &work.size, tolerance, jac.leading_columns(n), scratch)
            };
            if small(tolerance) {
                Some(Convergence::Tolerance)
            } else {
                (norm >= 0.5 * previous && small(floor)).then_some(Convergence::Rounding)
            }
        };
        if outcome.is_some() && !evaluation.settled {
            self.system.natural(x, &mut self.work.trial_r);
            self.system.accept();
        }
        outcome
    }

    /// Whether the Newton step drowns in the rounding of x while the residual no longer falls.
    fn step_is_rounding(
        &self,
        x: &[f64],
        norm: f64,
        previous: f64,
        step: Step,
        evaluation: Evaluation,
    ) -> bool {
        evaluation.settled
            && step != Step::Gradient
            && norm >= 0.5 * previous
            && norm2(&self.work.d) <= 16.0 * f64::EPSILON * norm2(&x[..self.n])
    }

    /// Whether each residual is a small part of its terms, whatever the precision of the map.
    fn terms_cancel(&mut self, jac: &Matrix, x: &[f64]) -> bool {
        let n = self.n;
        let work = &mut *self.work;
        row_sizes(jac.as_ref(), x, &mut work.size);
        let scratch = Scratch {
            row: &mut work.trial[..n],
            col: &mut work.trial_r[..n],
            max: &mut work.gradient,
        };
        is_small(&work.r, &work.size, JUMP, jac.leading_columns(n), scratch)
    }

    /// Whether the residual at the best iterate is the noise of its own evaluation: no larger than the change made by moving
    /// each variable by two units in its last place. The best iterate becomes `x`.
    fn is_rounding(&mut self, jac: &mut Matrix, x: &mut [f64]) -> bool {
        const PATTERNS: [u64; 4] = [0, u64::MAX, 0x5555_5555_5555_5555, 0x6666_6666_6666_6666];
        self.back_to_best(x);
        self.system.natural(x, &mut self.work.r);
        self.system.accept();
        if self.linearize(jac, x).is_err() {
            return false;
        }
        let work = &mut *self.work;
        row_sizes(jac.as_ref(), x, &mut work.size);
        if norm2(&work.r) > JUMP * norm2(&work.size) {
            return false;
        }
        work.size.fill(0.0);
        for pattern in PATTERNS {
            work.trial.copy_from_slice(x);
            for (j, v) in work.trial[..self.n].iter_mut().enumerate() {
                let up = pattern >> (j % 64) & 1 == 1;
                *v *= 1.0 + if up { 2.0 } else { -2.0 } * f64::EPSILON;
            }
            self.system.natural(&work.trial, &mut work.trial_r);
            work.report.evaluations += 1;
            for i in 0..self.n {
                work.size[i] = work.size[i].max((work.trial_r[i] - work.r[i]).abs());
            }
        }
        let scratch = Scratch {
            row: &mut work.d,
            col: &mut work.trial[..self.n],
            max: &mut work.gradient,
        };
        is_small(&work.r, &work.size, 2.0, jac.leading_columns(self.n), scratch)
    }

    /// The end of a run that found nothing, unless its best iterate is as good as rounding allows.
    fn give_up(
        &mut self,
        jac: &mut Matrix,
        x: &mut [f64],
        index: usize,
        norm: f64,
        evaluation: Evaluation,
        reason: Failure,
    ) -> Result<Convergence, Failure> {
        if reason != Failure::NotFinite && self.is_rounding(jac, x) {
            self.record_last(index, self.best_norm, evaluation);
            return Ok(Convergence::Rounding);
        }
        self.record_last(index, norm, evaluation);
        Err(reason)
    }

    /// Whether the current selection was met before at a residual not much larger than now.
    fn cycles(&mut self, norm: f64) -> bool {
        let Some(print) = self.system.fingerprint() else {
            return false;
        };
        let seen = &mut self.work.visited;
        match seen.iter_mut().find(|v| v.0 == print) {
            Some(v) if norm > 0.9 * v.1 => true,
            Some(v) => {
                v.1 = norm;
                false
            }
            None => {
                seen.push((print, norm));
                false
            }
        }
    }

    /// Records the last iterate; what the observer says no longer matters.
    fn record_last(&mut self, index: usize, residual_norm: f64, evaluation: Evaluation) {
        let _ = self.record(index, residual_norm, 0.0, 0.0, evaluation.changed, Step::None);
    }

    fn record(
        &mut self,
        index: usize,
        residual_norm: f64,
        step_norm: f64,
        damping: f64,
        sites_changed: usize,
        step: Step,
    ) -> ControlFlow<()> {
        let entry = Iteration {
            index,
            residual_norm,
            step_norm,
            damping,
            sites_changed,
            rcond: (step != Step::None).then(|| self.solver.rcond()).flatten(),
            step,
            linear_iterations: 0,
            forcing: 0.0,
        };
        self.work.report.history.push(entry);
        (self.observe)(&entry)
    }
}

/// Watches a line search that does not get on: it changes pieces back and forth, or creeps up to a kink.
struct Patience {
    norm: f64,
    iterations: usize,
    changes: usize,
}

impl Patience {
    fn new(norm: f64) -> Self {
        Self {
            norm,
            iterations: 0,
            changes: 0,
        }
    }

    fn is_over(&mut self, norm: f64, changed: usize) -> bool {
        if norm <= 0.5 * self.norm {
            *self = Self::new(norm);
        }
        self.iterations += 1;
        self.changes += changed;
        // On a smooth stretch slow progress is progress, creeping up to a kink is not.
        self.iterations > PATIENCE && (self.changes > 0 || norm > 0.99 * self.norm)
    }
}
