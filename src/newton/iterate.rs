use std::ops::ControlFlow;

use super::convergence::{Scratch, Small, is_small, row_sizes};
use super::system::{Evaluation, System};
use super::workspace::Workspace;
use super::{Convergence, Damping, Iteration, NewtonError, NewtonOptions, Step, Unsolved};
use crate::linear::{LinearError, LinearSolver};
use crate::piecewise::PiecewiseError;
use crate::run::Status;
use crate::sparse::Matrix;
use crate::sparse::norm as norm2;
use crate::tolerances::{SIX_DIGITS, VALUE};

/// Line-search iterations after which the residual must have halved, or pieces are changed one at a time.
const PATIENCE: usize = 12;

/// Stage of the globalisation.
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
    work.report.regularity = None;
    work.visited.clear();
    work.weight.fill(1.0);
    work.settled.fill(false);
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
        tried: f64::INFINITY,
    };
    let outcome = match run.go(&mut jac, x) {
        Ok(Ok(convergence)) => Ok(match run.hidden_row(&jac, x) {
            Some(row) => Err(Status::FarOut { row }),
            None => Ok(convergence),
        }),
        other => other,
    };
    let best_norm = run.best_norm;
    work.jac = Some(jac);
    match outcome? {
        Ok(convergence) => Ok(convergence),
        Err(reason) => {
            if best_norm.is_finite() {
                x.copy_from_slice(&work.best);
            }
            Err(NewtonError::Failed(Box::new(Unsolved {
                status: reason,
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
    /// ‖H‖₂ where rows were last watched without success.
    tried: f64,
    pub(super) n: usize,
}

impl Run<'_> {
    /// The outer result is for invalid input, the inner one for the outcome of the iteration.
    fn go(&mut self, jac: &mut Matrix, x: &mut [f64]) -> Result<Result<Convergence, Status>, NewtonError> {
        let mut evaluation = self.enter(x);
        let mut norm = norm2(&self.work.r);
        if !norm.is_finite() {
            return Ok(Err(Status::evaluation_failure(&self.work.r)));
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
            if let Some(convergence) = self.converged(jac, x, natural_norm, previous_norm, evaluation)? {
                self.best_norm = self.norm_found(natural_norm, evaluation);
                self.record_last(index, self.best_norm, evaluation);
                return Ok(Ok(convergence));
            }
            if index >= self.options.max_iterations {
                let reason = why.unwrap_or(Status::IterationLimit);
                return Ok(self.give_up(jac, x, index, norm, evaluation, reason));
            }
            let cycles = self.cycles(norm);
            if self.mode == Mode::LeastIndex && cycles {
                return Ok(self.give_up(jac, x, index, norm, evaluation, why.unwrap_or(Status::Cycling)));
            }
            // Growth of ‖H‖ alone is no sign of trouble: it depends on the units of rows, and new pieces may raise it at first.
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
                    let rows = jac.triplets().filter(|(.., v)| !v.is_finite()).map(|(i, ..)| i);
                    let component = rows.min().unwrap_or(0);
                    let reason = Status::EvaluationFailure { component };
                    return Ok(self.give_up(jac, x, index, norm, evaluation, reason));
                }
                Err(e) => return Err(e.into()),
            };
            if self.step_is_rounding(x, norm, previous_norm, step, evaluation) {
                let factorisations = self.work.report.factorisations;
                let rests = |run: &mut Self, jac: &Matrix, x: &[f64]| run.terms_cancel(jac, x);
                if self.settles(jac, x, norm, &rests)? {
                    self.best_norm = norm2(&self.work.r);
                    self.record_last(index, self.best_norm, evaluation);
                    return Ok(Ok(Convergence::Rounding));
                }
                if self.work.report.factorisations > factorisations {
                    step = self.newton_direction(jac)?;
                }
            }
            let stuck = self.mode == Mode::LineSearch
                && patience.is_over(self.merit(&self.work.r), evaluation.changed);
            let next = match stuck {
                true => Err(Status::Stalled),
                false => self.advance(jac, x, &mut step),
            };
            let next = match next {
                Ok(next) => next,
                Err(reason) => {
                    let last_resort = self.options.damping != Damping::Never && self.mode < Mode::LeastIndex;
                    if reason == Status::Stalled && !stuck && self.is_rounding(jac, x) {
                        self.record_last(index, self.best_norm, evaluation);
                        return Ok(Ok(Convergence::Rounding));
                    }
                    if !(last_resort && self.system.use_least_index()) {
                        let reason = why.unwrap_or(reason);
                        return Ok(self.give_up(jac, x, index, norm, evaluation, reason));
                    }
                    // A stationary point is a more useful diagnosis than the failure of the least-index rule.
                    why = matches!(reason, Status::Stationary { .. }).then_some(reason);
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
            if evaluation.changed > 0 {
                self.work.settled.fill(false);
                self.tried = f64::INFINITY;
            }
            index += 1;
            if flow.is_break() {
                let natural_norm = self.natural_norm(x, norm, evaluation);
                if natural_norm < self.best_norm {
                    self.best_norm = natural_norm;
                    self.work.best.copy_from_slice(x);
                }
                return Ok(Err(Status::Interrupted));
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
    /// the residual no longer falls. May improve a solution.
    fn converged(
        &mut self,
        jac: &mut Matrix,
        x: &mut [f64],
        norm: f64,
        previous: f64,
        evaluation: Evaluation,
    ) -> Result<Option<Convergence>, NewtonError> {
        let floor = self.floor();
        let mut outcome = None;
        if norm <= self.options.absolute_tolerance {
            outcome = Some(Convergence::Tolerance);
        } else {
            let levels = [
                (self.options.relative_tolerance, Convergence::Tolerance),
                (floor, Convergence::Rounding),
            ];
            for (tolerance, convergence) in levels {
                if convergence == Convergence::Rounding && norm < 0.5 * previous {
                    break;
                }
                let small = |run: &mut Self, jac: &Matrix, x: &[f64]| run.is_small(jac, x, tolerance);
                let found = match evaluation.settled {
                    true => self.settles(jac, x, norm, &small)?,
                    false => {
                        // `trial_r` holds the natural residual.
                        std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
                        let found = small(self, jac, x) == Small::Yes;
                        std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
                        found
                    }
                };
                if found {
                    outcome = Some(convergence);
                    break;
                }
            }
        }
        if outcome.is_some() && !evaluation.settled {
            self.system.natural(x, &mut self.work.r);
            self.work.report.evaluations += 1;
            self.system.accept();
        }
        Ok(outcome)
    }

    /// ‖H‖₂ of the solution that [`converged`](Self::converged) has found.
    fn norm_found(&self, natural_norm: f64, evaluation: Evaluation) -> f64 {
        match evaluation.settled {
            true => norm2(&self.work.r),
            false => natural_norm,
        }
    }

    fn is_small(&mut self, jac: &Matrix, x: &[f64], tolerance: f64) -> Small {
        let work = &mut *self.work;
        row_sizes(jac.as_ref(), x, &mut work.size);
        let scratch = Scratch {
            row: &mut work.model,
            col: &mut work.trial[..self.n],
            max: &mut work.gradient,
        };
        let jac = jac.leading_columns(self.n);
        is_small(&work.r, &work.size, tolerance, jac, &work.settled, scratch)
    }

    /// Whether the residual is small, where rows whose terms vanish with them must have settled as well: if only these are missing, full
    /// steps are made until they have. x is changed only then.
    fn settles(
        &mut self,
        jac: &mut Matrix,
        x: &mut [f64],
        norm: f64,
        small: &dyn Fn(&mut Self, &Matrix, &[f64]) -> Small,
    ) -> Result<bool, NewtonError> {
        /// Steps after which every row is at the level of rounding, unless its residual still decreases.
        const STEPS: usize = 12;
        match small(self, jac, x) {
            Small::No => return Ok(false),
            Small::Yes => return Ok(true),
            Small::Perhaps => {}
        }
        if norm > 0.5 * self.tried {
            return Ok(false);
        }
        self.work.conjugate.copy_from_slice(&x[..self.n]);
        for _ in 0..STEPS {
            self.tried = norm;
            match self.refine(jac, x)? {
                Some(true) => {}
                Some(false) => break,
                // Singular: no step can improve this point.
                None => return Ok(true),
            }
            self.watch(jac);
            match small(self, jac, x) {
                Small::No => {
                    self.tried = f64::INFINITY;
                    break;
                }
                Small::Yes => return Ok(true),
                Small::Perhaps => {}
            }
        }
        x[..self.n].copy_from_slice(&self.work.conjugate);
        self.enter(x);
        self.linearize(jac, x)?;
        Ok(false)
    }

    /// A full step. `r` and `trial_r` become the residuals after and before it, `model` ∇H d. False if the step is not usable, `None` where
    /// the Jacobian is singular.
    fn refine(&mut self, jac: &mut Matrix, x: &mut [f64]) -> Result<Option<bool>, NewtonError> {
        match self.newton_direction(jac) {
            Ok(Step::Newton | Step::LeastIndex) => {}
            Ok(_) => return Ok(None),
            Err(LinearError::NotFinite { .. }) => return Ok(Some(false)),
            Err(e) => return Err(e.into()),
        }
        let n = self.n;
        let work = &mut *self.work;
        work.model.fill(0.0);
        jac.leading_columns(n).mul_add(1.0, &work.d, &mut work.model);
        work.trial.copy_from_slice(x);
        work.trial.iter_mut().zip(&work.d).for_each(|(x, d)| *x += d);
        let there = self.system.evaluate(&work.trial, &mut work.trial_r);
        work.report.evaluations += 1;
        if !there.settled || !norm2(&work.trial_r).is_finite() {
            return Ok(Some(false));
        }
        self.system.accept();
        x.copy_from_slice(&work.trial);
        std::mem::swap(&mut work.r, &mut work.trial_r);
        self.linearize(jac, x)?;
        Ok(Some(true))
    }

    /// Marks the rows whose residual the last step has not reduced although it exceeds the error of the linear model, and those that it has
    /// reduced to rounding: a row c·x_i = 0 would be reduced by that factor in every step.
    fn watch(&mut self, jac: &Matrix) {
        let work = &mut *self.work;
        work.model.iter_mut().for_each(|m| *m = -*m);
        (jac.leading_columns(self.n)).mul_add(1.0, &work.d, &mut work.model);
        for i in 0..self.n {
            let (now, before) = (work.r[i].abs(), work.trial_r[i].abs());
            let bend = work.model[i].abs();
            work.settled[i] |= now > 0.5 * before && now > bend || now <= VALUE * before;
        }
    }

    /// Whether the Newton step is within the rounding of x while the residual no longer decreases.
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

    /// Whether each residual is a small part of its terms, whatever the precision of the map; perhaps where it may still fall.
    fn terms_cancel(&mut self, jac: &Matrix, x: &[f64]) -> Small {
        // A larger share that changes with the last digits of x is a jump of H, not rounding.
        let small = self.is_small(jac, x, SIX_DIGITS);
        let work = &*self.work;
        let tolerance = self.options.relative_tolerance;
        let rests = |i: usize| work.settled[i] || work.r[i].abs() <= tolerance * work.size[i];
        match small {
            Small::Yes if !(0..self.n).all(rests) => Small::Perhaps,
            small => small,
        }
    }

    /// Whether the residual at the best iterate is the noise of its own evaluation: no larger than the change made by moving
    /// each variable by two units in its last place. The best iterate becomes `x`.
    fn is_rounding(&mut self, jac: &mut Matrix, x: &mut [f64]) -> bool {
        const PATTERNS: [u64; 4] = [0, u64::MAX, 0x5555_5555_5555_5555, 0x6666_6666_6666_6666];
        self.back_to_best(x);
        self.work.settled.fill(false);
        self.system.natural(x, &mut self.work.r);
        self.work.report.evaluations += 1;
        self.system.accept();
        if self.linearize(jac, x).is_err() {
            return false;
        }
        let work = &mut *self.work;
        row_sizes(jac.as_ref(), x, &mut work.size);
        if norm2(&work.r) > SIX_DIGITS * norm2(&work.size) {
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
        self.tried = f64::INFINITY;
        let norm = norm2(&work.r);
        let noise = |run: &mut Self, jac: &Matrix, _: &[f64]| run.is_noise(jac);
        self.settles(jac, x, norm, &noise).unwrap_or(false)
    }

    /// Whether the residual is no larger than twice the noise in `size`.
    fn is_noise(&mut self, jac: &Matrix) -> Small {
        let work = &mut *self.work;
        let scratch = Scratch {
            row: &mut work.model,
            col: &mut work.trial[..self.n],
            max: &mut work.gradient,
        };
        let jac = jac.leading_columns(self.n);
        is_small(&work.r, &work.size, 2.0, jac, &work.settled, scratch)
    }

    /// The end of an unsuccessful run, unless its best iterate is as accurate as rounding allows.
    fn give_up(
        &mut self,
        jac: &mut Matrix,
        x: &mut [f64],
        index: usize,
        norm: f64,
        evaluation: Evaluation,
        reason: Status,
    ) -> Result<Convergence, Status> {
        if !matches!(reason, Status::EvaluationFailure { .. }) && self.is_rounding(jac, x) {
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

    /// Records the last iterate; the observer's return value is ignored.
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

/// Detects a line search that stalls: it changes pieces back and forth, or its steps shrink towards a kink.
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
        // Slow decrease is accepted on one selection, but not ever shorter steps towards a kink.
        self.iterations > PATIENCE && (self.changes > 0 || norm > 0.99 * self.norm)
    }
}

#[cfg(test)]
mod tests {
    use super::{PATIENCE, Patience};

    /// Iterations until patience is over, if it is within 1000, where each multiplies the norm by `factor` and changes `changes` sites.
    fn lasts(factor: f64, changes: usize) -> Option<usize> {
        let mut patience = Patience::new(f64::INFINITY);
        let mut norm = 1.0;
        (1..1000).find(|_| {
            norm *= factor;
            patience.is_over(norm, changes)
        })
    }

    #[test]
    fn line_searches_that_halve_go_on_and_those_that_creep_do_not() {
        // The first iteration sets the mark, PATIENCE more may fail to halve it.
        assert_eq!(lasts(1.0, 0), Some(PATIENCE + 1));
        assert_eq!(lasts(1.0, 1), Some(PATIENCE + 1));
        // Slowly along a smooth stretch, and among changes of pieces.
        assert_eq!(lasts(0.99, 0), None);
        assert_eq!(lasts(0.99, 1), Some(PATIENCE + 1));
        assert_eq!(lasts(0.5, 1), None);
        // Halved just within patience again and again.
        assert_eq!(lasts(0.5_f64.powf(1.0 / (PATIENCE as f64 - 2.0)), 1), None);
    }
}
