use std::ops::ControlFlow;

use super::moore_penrose::norm as norm2;
use super::system::{Evaluation, System};
use super::{Convergence, Damping, Failure, Iteration, NewtonError, NewtonOptions, Report, Step, Unsolved};
use crate::linear::{LinearError, LinearSolver};
use crate::piecewise::PiecewiseError;
use crate::sparse::{Matrix, Pattern};

/// Everything a run needs room for.
#[derive(Debug, Clone, Default)]
pub(super) struct Workspace<L> {
    solver: L,
    jac: Option<Matrix>,
    n: usize,
    r: Vec<f64>,
    trial_r: Vec<f64>,
    d: Vec<f64>,
    trial: Vec<f64>,
    best: Vec<f64>,
    scale: Vec<f64>,
    visited: Vec<(u64, f64)>,
    pub(super) report: Report,
}

impl<L: LinearSolver> Workspace<L> {
    pub(super) fn new(solver: L) -> Self {
        Self {
            solver,
            jac: None,
            n: 0,
            r: Vec::new(),
            trial_r: Vec::new(),
            d: Vec::new(),
            trial: Vec::new(),
            best: Vec::new(),
            scale: Vec::new(),
            visited: Vec::new(),
            report: Report::default(),
        }
    }

    pub(super) fn fits(&self, m: usize, n: usize) -> bool {
        self.n == n && self.jac.as_ref().is_some_and(|j| j.ncols() == m)
    }

    pub(super) fn prepare(&mut self, pattern: Pattern, n: usize) -> Result<(), NewtonError> {
        let m = pattern.ncols();
        if pattern.nrows() != n {
            return Err(PiecewiseError::Length {
                what: "the rows of the declared pattern",
                expected: n,
                found: pattern.nrows(),
            }
            .into());
        }
        self.solver.analyze(pattern.leading_columns(n))?;
        self.jac = Some(Matrix::zeros(pattern));
        self.n = n;
        for v in [&mut self.r, &mut self.trial_r, &mut self.d, &mut self.scale] {
            v.resize(n, 0.0);
        }
        self.trial.resize(m, 0.0);
        self.best.resize(m, 0.0);
        Ok(())
    }
}

/// How far the globalisation has been driven.
#[derive(PartialEq, PartialOrd, Clone, Copy)]
enum Mode {
    Full,
    LineSearch,
    LeastIndex,
}

pub(super) fn iterate<L: LinearSolver>(
    work: &mut Workspace<L>,
    options: &NewtonOptions,
    system: &mut dyn System,
    x: &mut [f64],
    observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
) -> Result<Convergence, NewtonError> {
    let n = work.n;
    work.report.iterations.clear();
    work.report.factorisations = 0;
    work.report.evaluations = 1;
    work.visited.clear();
    let Some(mut jac) = work.jac.take() else {
        return Err(LinearError::NotAnalyzed.into());
    };
    let mut run = Run {
        work,
        options,
        system,
        mode: match options.damping {
            Damping::Always => Mode::LineSearch,
            _ => Mode::Full,
        },
        best_norm: f64::INFINITY,
        n,
    };
    let outcome = run.go(&mut jac, x, observe);
    let best_norm = run.best_norm;
    work.jac = Some(jac);
    match outcome {
        Ok(Ok(convergence)) => Ok(convergence),
        Ok(Err(reason)) => {
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
        Err(e) => Err(e),
    }
}

struct Run<'a, L> {
    work: &'a mut Workspace<L>,
    options: &'a NewtonOptions,
    system: &'a mut dyn System,
    mode: Mode,
    best_norm: f64,
    n: usize,
}

impl<L: LinearSolver> Run<'_, L> {
    fn go(
        &mut self,
        jac: &mut Matrix,
        x: &mut [f64],
        observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Result<Convergence, Failure>, NewtonError> {
        let mut evaluation = self.system.evaluate(x, &mut self.work.r);
        let mut norm = norm2(&self.work.r);
        if !norm.is_finite() {
            return Ok(Err(Failure::NotFinite));
        }
        let mut previous_norm = f64::INFINITY;
        let mut budget = self.options.max_iterations;
        for index in 0.. {
            if norm < self.best_norm && (evaluation.settled || index == 0) {
                self.best_norm = norm;
                self.work.best.copy_from_slice(x);
            }
            jac.clear();
            self.system.linearize(x, jac);
            if let Some((row, col)) = jac.stray() {
                return Err(PiecewiseError::StrayEntry { row, col }.into());
            }
            if let Some(convergence) = self.converged(jac, x, norm, previous_norm, &evaluation) {
                self.best_norm = norm;
                self.record_last(observe, index, norm, evaluation.changed);
                return Ok(Ok(convergence));
            }
            if index == budget {
                self.record_last(observe, index, norm, evaluation.changed);
                return Ok(Err(Failure::MaxIterations));
            }
            let trouble = self.cycles(norm) || norm > 1e3 * self.best_norm;
            if trouble && self.options.damping == Damping::OnTrouble && self.mode == Mode::Full {
                self.mode = Mode::LineSearch;
                self.work.visited.clear();
            }
            let mut step = self.newton_direction(jac)?;
            let negligible = 16.0 * f64::EPSILON * norm2(x);
            if step == Step::Newton && evaluation.settled && norm2(&self.work.d) <= negligible {
                self.best_norm = norm;
                self.record_last(observe, index, norm, evaluation.changed);
                return Ok(Ok(Convergence::Rounding));
            }
            let (damping, next, next_norm) = match self.advance(jac, x, norm, &mut step) {
                Ok(found) => found,
                Err(reason) if self.options.damping != Damping::Never && self.mode < Mode::LeastIndex => {
                    if !self.system.use_least_index() {
                        self.record_last(observe, index, norm, evaluation.changed);
                        return Ok(Err(reason));
                    }
                    self.mode = Mode::LeastIndex;
                    self.work.visited.clear();
                    budget += self.options.max_iterations;
                    // Trial steps have moved the selection.
                    evaluation = self.system.evaluate(x, &mut self.work.r);
                    norm = norm2(&self.work.r);
                    continue;
                }
                Err(reason) => {
                    self.record_last(observe, index, norm, evaluation.changed);
                    return Ok(Err(reason));
                }
            };
            let step_norm = damping * norm2(&self.work.d);
            let flow = self.record(observe, index, norm, step_norm, damping, evaluation.changed, step);
            x.copy_from_slice(&self.work.trial);
            std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
            previous_norm = norm;
            norm = next_norm;
            evaluation = next;
            if flow.is_break() {
                if norm < self.best_norm {
                    self.best_norm = norm;
                    self.work.best.copy_from_slice(x);
                }
                return Ok(Err(Failure::Interrupted));
            }
        }
        Ok(Err(Failure::MaxIterations))
    }

    /// Tolerance on the residual relative to the size of its terms; the rounding floor of those terms counts as converged once
    /// the residual no longer falls.
    fn converged(
        &mut self,
        jac: &Matrix,
        x: &[f64],
        norm: f64,
        previous: f64,
        evaluation: &Evaluation,
    ) -> Option<Convergence> {
        if !evaluation.settled {
            return None;
        }
        if norm <= self.options.absolute_tolerance {
            return Some(Convergence::Tolerance);
        }
        let scale = &mut self.work.scale;
        scale.fill(0.0);
        let a = jac.as_ref();
        for (j, xj) in x.iter().enumerate() {
            for k in a.pattern.col_ptr[j]..a.pattern.col_ptr[j + 1] {
                scale[a.pattern.row_idx[k]] += (a.values[k] * xj).abs();
            }
        }
        let size = norm2(scale);
        if norm <= self.options.relative_tolerance * size {
            return Some(Convergence::Tolerance);
        }
        let floor = 8.0 * f64::EPSILON * (self.n as f64).sqrt().max(4.0) * size;
        (norm == 0.0 || (norm <= floor && norm >= 0.5 * previous)).then_some(Convergence::Rounding)
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

    /// Puts the Newton direction into `d`, or −∇Hᵀ H where the Jacobian is singular.
    fn newton_direction(&mut self, jac: &Matrix) -> Result<Step, NewtonError> {
        let leading = jac.leading_columns(self.n);
        self.work.report.factorisations += 1;
        let solved = self.work.solver.factor(leading).and_then(|()| {
            for (d, r) in self.work.d.iter_mut().zip(&self.work.r) {
                *d = -r;
            }
            self.work.solver.solve_in_place(&mut self.work.d)
        });
        match solved {
            Ok(()) => Ok(match self.mode {
                Mode::LeastIndex => Step::LeastIndex,
                _ => Step::Newton,
            }),
            Err(LinearError::Singular { .. } | LinearError::Inaccurate { .. }) => Ok(Step::Gradient),
            Err(e) => Err(e.into()),
        }
    }

    /// The Cauchy step −t ∇Hᵀ H with the t that minimises the linear model; its norm of the gradient is returned.
    fn gradient_direction(&mut self, jac: &Matrix) -> f64 {
        let leading = jac.leading_columns(self.n);
        let work = &mut *self.work;
        work.d.fill(0.0);
        leading.mul_transpose_add(-1.0, &work.r, &mut work.d);
        let gradient = norm2(&work.d);
        work.scale.fill(0.0);
        leading.mul_add(1.0, &work.d, &mut work.scale);
        let curvature = norm2(&work.scale);
        if gradient > 0.0 && curvature > 0.0 {
            let t = (gradient / curvature).powi(2);
            work.d.iter_mut().for_each(|d| *d *= t);
        }
        gradient
    }

    /// Takes the step: leaves the new iterate in `trial`, its residual in `trial_r`.
    fn advance(
        &mut self,
        jac: &Matrix,
        x: &[f64],
        norm: f64,
        step: &mut Step,
    ) -> Result<(f64, Evaluation, f64), Failure> {
        if *step == Step::Gradient
            && (self.options.damping == Damping::Never || self.mode == Mode::LeastIndex)
        {
            return Err(Failure::Singular);
        }
        if *step != Step::Gradient && self.mode != Mode::LineSearch {
            let limit = if self.mode == Mode::LeastIndex || self.options.damping == Damping::Never {
                f64::INFINITY
            } else {
                // A residual that explodes leaves the region where the piece means anything.
                1e6 * norm
            };
            if let Some(found) = self.search(x, limit, false) {
                if self.mode == Mode::LeastIndex && self.cycles(found.2) {
                    return Err(Failure::Cycling);
                }
                return Ok(found);
            }
            if self.mode == Mode::LeastIndex || self.options.damping == Damping::Never {
                return Err(Failure::NotFinite);
            }
        }
        if *step != Step::Gradient
            && let Some(found) = self.search(x, norm, true)
        {
            return Ok(found);
        }
        let gradient = self.gradient_direction(jac);
        *step = Step::Gradient;
        let flat = 1e-14 * norm * jac.as_ref().norm_1().max(f64::MIN_POSITIVE);
        if gradient <= flat {
            return Err(Failure::Stationary {
                gradient_norm: gradient,
            });
        }
        self.search(x, norm, true).ok_or(Failure::Stagnation)
    }

    /// Halves the step until the residual is at most `limit` (with sufficient decrease if `armijo`) and finite. Without
    /// `armijo` only one full step and steps out of a domain are tried.
    fn search(&mut self, x: &[f64], limit: f64, armijo: bool) -> Option<(f64, Evaluation, f64)> {
        let mut t = 1.0;
        while t >= self.options.min_damping {
            for (i, trial) in self.work.trial.iter_mut().enumerate() {
                *trial = x[i] + if i < self.n { t * self.work.d[i] } else { 0.0 };
            }
            let evaluation = self.system.evaluate(&self.work.trial, &mut self.work.trial_r);
            self.work.report.evaluations += 1;
            let norm = norm2(&self.work.trial_r);
            let bound = if armijo {
                (1.0 - self.options.armijo * t) * limit
            } else {
                limit
            };
            if norm.is_finite() && norm <= bound {
                return Some((t, evaluation, norm));
            }
            if norm.is_finite() && !armijo {
                return None;
            }
            t *= 0.5;
        }
        None
    }

    /// Records the last iterate; what the observer says no longer matters.
    fn record_last(
        &mut self,
        observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
        index: usize,
        residual_norm: f64,
        sites_changed: usize,
    ) {
        let _ = self.record(observe, index, residual_norm, 0.0, 0.0, sites_changed, Step::None);
    }

    #[allow(clippy::too_many_arguments)]
    fn record(
        &mut self,
        observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
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
            rcond: (step != Step::None).then(|| self.work.solver.rcond()).flatten(),
            step,
        };
        self.work.report.iterations.push(entry);
        observe(&entry)
    }
}
