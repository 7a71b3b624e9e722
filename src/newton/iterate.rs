use std::ops::ControlFlow;

use super::system::{Evaluation, System};
use super::workspace::Workspace;
use super::{Convergence, Damping, Failure, Iteration, NewtonError, NewtonOptions, Step, Unsolved};
use crate::judge::{Columns, Point, ROUNDING, row_sizes};
use crate::linear::{LinearError, LinearSolver};
use crate::piecewise::PiecewiseError;
use crate::sparse::Matrix;
use crate::sparse::norm as norm2;

/// Line-search iterations after which the residual must have halved, or pieces are changed one at a time.
const PATIENCE: usize = 12;

/// Share of its terms beyond which a residual that changes with the last digits of x is a jump of H, not rounding.
const JUMP: f64 = 1e-6;

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
    work.start.clear();
    work.start.extend_from_slice(x);
    work.typical.clear();
    work.typical.resize(x.len(), 1.0);
    system.typical_sizes(&mut work.typical);
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
    /// The outer result is for invalid input, the inner one for the outcome of the iteration.
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
            if let Some(convergence) = self.converged(jac, x, natural_norm, previous_norm, evaluation)? {
                self.best_norm = natural_norm;
                self.record_last(index, self.best_norm, evaluation);
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
                    return Ok(self.give_up(jac, x, index, norm, evaluation, Failure::NotFinite));
                }
                Err(e) => return Err(e.into()),
            };
            if self.step_is_rounding(jac, norm, previous_norm, step, evaluation)
                && self.is_small(jac, x, JUMP)?
            {
                self.record_last(index, self.best_norm, evaluation);
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
                    // A stationary point is a more useful diagnosis than the failure of the least-index rule.
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
    /// the residual no longer falls. May improve a solution.
    fn converged(
        &mut self,
        jac: &mut Matrix,
        x: &mut [f64],
        norm: f64,
        previous: f64,
        evaluation: Evaluation,
    ) -> Result<Option<Convergence>, NewtonError> {
        let floor = 8.0 * f64::EPSILON * (self.n as f64).sqrt().max(4.0);
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
                let found = match evaluation.settled {
                    true => self.is_small(jac, x, tolerance)?,
                    false => {
                        // `trial_r` holds the natural residual.
                        std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
                        let found = self.is_small(jac, x, tolerance);
                        std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
                        found?
                    }
                };
                if found {
                    outcome = Some(convergence);
                    break;
                }
            }
        }
        if outcome.is_some() && !evaluation.settled {
            self.system.natural(x, &mut self.work.trial_r);
            self.work.report.evaluations += 1;
            self.system.accept();
        }
        Ok(outcome)
    }

    /// The verdict of the judge on `r` at x.
    fn is_small(&mut self, jac: &Matrix, x: &[f64], tolerance: f64) -> Result<bool, NewtonError> {
        let (n, work) = (self.n, &mut *self.work);
        let point = Point {
            x: &x[..n],
            f: &work.r,
            jac: Columns::Long(jac.leading_columns(n)),
            rest: None,
            start: &work.start[..n],
            typical: &work.typical[..n],
            sizes: None,
            lower: &[],
            upper: &[],
        };
        let verdict = work.judge.verdict(&point, tolerance);
        Ok(verdict.is_solved(tolerance)
            && (self.system.is_affine() || !verdict.needs_straight(tolerance) || self.is_straight(jac, x)?))
    }

    /// Whether the rows that have to be straight have the same derivatives at the start, or, from there, beside it.
    fn is_straight(&mut self, jac: &Matrix, x: &[f64]) -> Result<bool, NewtonError> {
        /// Where the point is the start, part of x by which the other point differs.
        const BESIDE: f64 = 1.0 / 1024.0;
        let mut there = self.work.start.clone();
        if there == x {
            there.iter_mut().for_each(|v| *v -= BESIDE * *v);
        }
        let mut beside = Matrix::zeros(jac.pattern().clone());
        self.linearize(&mut beside, &there)?;
        let rows = self.work.judge.distant_rows();
        let mut pairs = jac.triplets().zip(beside.values());
        // Written so that NaN differs.
        Ok(
            pairs
                .all(|((i, _, a), b)| rows.binary_search(&i).is_err() || (a - b).abs() <= ROUNDING * a.abs()),
        )
    }

    /// Whether the Newton step changes no row by more than the rounding of its terms while the residual no longer decreases.
    fn step_is_rounding(
        &mut self,
        jac: &Matrix,
        norm: f64,
        previous: f64,
        step: Step,
        evaluation: Evaluation,
    ) -> bool {
        if !evaluation.settled || step == Step::Gradient || norm < 0.5 * previous {
            return false;
        }
        let work = &mut *self.work;
        row_sizes(jac.leading_columns(self.n), &work.d, &mut work.size);
        let changes = work.size.iter().zip(work.judge.terms());
        { changes }.all(|(change, terms)| *change <= 16.0 * f64::EPSILON * terms)
    }

    /// Whether the residual at the best iterate is the noise of its own evaluation: no larger than the change made by moving
    /// each variable by two units in its last place. The best iterate becomes `x`.
    fn is_rounding(&mut self, jac: &mut Matrix, x: &mut [f64]) -> bool {
        const PATTERNS: [u64; 4] = [0, u64::MAX, 0x5555_5555_5555_5555, 0x6666_6666_6666_6666];
        self.back_to_best(x);
        self.system.natural(x, &mut self.work.r);
        self.work.report.evaluations += 1;
        self.system.accept();
        if self.linearize(jac, x).is_err() {
            return false;
        }
        if !self.is_small(jac, x, JUMP).unwrap_or(false) {
            return false;
        }
        let work = &mut *self.work;
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
        let noise = work.size.iter().zip(&work.r);
        { noise }.all(|(noise, r)| r.abs() <= 2.0 * noise)
    }

    /// The end of an unsuccessful run, unless its best iterate is as accurate as rounding allows.
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
