//! Inexact Newton method for matrix-free maps, each step computed by a Krylov method up to a forcing term.

use std::ops::ControlFlow;

use super::forcing::Before;
use super::{Convergence, Damping, Iteration, NewtonError, NewtonKrylovOptions, Report, Step, Unsolved};
use crate::input::check_vector;
use crate::linear::{Krylov, LinearError};
use crate::piecewise::{MatrixFree, PiecewiseError};
use crate::run::Status;
use crate::sparse::{distance, norm as norm2};
use crate::tolerances::SIX_DIGITS;

/// Full steps in a row that may fail to lower the least residual by a tenth.
const PATIENCE: usize = 5;

/// Inexact semismooth Newton method for [`MatrixFree`] maps: steps with ‖H + G d‖₂ ≤ η ‖H‖₂ by a Krylov method, with forcing terms η of
/// Eisenstat and Walker ([`Forcing`](super::Forcing)).
///
/// As long as the residual decreases, steps are full; then a line search on the unweighted ‖H‖₂ begins: scale rows to comparable units.
/// Where the Newton step gives no descent and products with Gᵀ are known, the steepest descent on ½‖H‖² is tried. Convergence is
/// superlinear at solutions where all elements of the generalized Jacobian are regular (J. M. Martínez, L. Qi, J. Comput. Appl. Math. 60
/// (1995)).
///
/// Products alone do not give the regularity of a solution, and the report has none:
/// [`bd_regularity_semismooth`](crate::piecewise::bd_regularity_semismooth) and
/// [`cd_regularity_semismooth`](crate::piecewise::cd_regularity_semismooth) examine maps with matrices at the point returned.
///
/// A solver is reused from problem to problem; nothing is allocated once it has seen one of the same size.
/// [`MatrixFree`] has an example, [`Assembled`](crate::piecewise::Assembled) another.
#[derive(Debug, Clone)]
pub struct NewtonKrylov {
    options: NewtonKrylovOptions,
    krylov: Krylov,
    work: Work,
}

#[derive(Debug, Clone, Default)]
struct Work {
    r: Vec<f64>,
    trial_r: Vec<f64>,
    d: Vec<f64>,
    trial: Vec<f64>,
    best: Vec<f64>,
    product: Vec<f64>,
    report: Report,
}

impl Default for NewtonKrylov {
    fn default() -> Self {
        Self::new(NewtonKrylovOptions::default())
    }
}

impl NewtonKrylov {
    /// A solver whose workspace is still empty.
    #[must_use]
    pub fn new(options: NewtonKrylovOptions) -> Self {
        Self {
            krylov: Krylov::new(options.method).with_max_iterations(options.max_linear_iterations),
            options,
            work: Work::default(),
        }
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &NewtonKrylovOptions {
        &self.options
    }

    /// The history of the last run.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.work.report
    }

    /// Solves H(x) = 0 from the start `x`, which is overwritten by the solution; after an error it holds the best iterate.
    ///
    /// # Errors
    /// [`NewtonError::Failed`] with the best iterate and the history; errors of options, of the start and of `linearize`.
    pub fn solve(&mut self, map: &mut dyn MatrixFree, x: &mut [f64]) -> Result<Convergence, NewtonError> {
        self.solve_observed(map, x, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting every iteration to `observe`, which may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); a stopped run is [`Status::Interrupted`].
    pub fn solve_observed(
        &mut self,
        map: &mut dyn MatrixFree,
        x: &mut [f64],
        mut observe: impl FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Convergence, NewtonError> {
        self.options.validate()?;
        let n = map.order();
        if n == 0 {
            return Err(PiecewiseError::Dimensions {
                vars: 0,
                residuals: 0,
                expected: "an equation has at least 1 variable",
            }
            .into());
        }
        check_vector("the start x", x, n)?;
        let work = &mut self.work;
        for v in [
            &mut work.r,
            &mut work.trial_r,
            &mut work.d,
            &mut work.trial,
            &mut work.best,
            &mut work.product,
        ] {
            v.resize(n, 0.0);
        }
        work.report.history.clear();
        (work.report.factorisations, work.report.evaluations) = (0, 0);
        work.best.copy_from_slice(x);
        let mut run = Run {
            options: &self.options,
            krylov: &mut self.krylov,
            work,
            map,
            observe: &mut observe,
            best_norm: f64::INFINITY,
        };
        let outcome = run.go(x);
        let best_norm = run.best_norm;
        match outcome {
            Ok(Ok(convergence)) => Ok(convergence),
            Ok(Err(reason)) => {
                x.copy_from_slice(&work.best);
                Err(NewtonError::Failed(Box::new(Unsolved {
                    status: reason,
                    x: x.to_vec(),
                    residual_norm: best_norm,
                    report: work.report.clone(),
                })))
            }
            Err(e) => {
                x.copy_from_slice(&work.best);
                Err(e)
            }
        }
    }
}

struct Run<'a> {
    options: &'a NewtonKrylovOptions,
    krylov: &'a mut Krylov,
    work: &'a mut Work,
    map: &'a mut dyn MatrixFree,
    observe: &'a mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    /// ‖H‖₂ at `work.best`.
    best_norm: f64,
}

/// A step that was taken.
struct Taken {
    step: Step,
    /// Its length, in (0, 1].
    length: f64,
    /// ‖H + G d‖₂ / ‖H‖₂ for the whole of it.
    model: f64,
    linear_iterations: usize,
}

impl Run<'_> {
    /// The outer result is for invalid input, the inner one for the outcome of the iteration.
    fn go(&mut self, x: &mut [f64]) -> Result<Result<Convergence, Status>, NewtonError> {
        let mut norm = self.evaluate(x);
        if !norm.is_finite() {
            return Ok(Err(Status::evaluation_failure(&self.work.r)));
        }
        let mut full = self.options.damping != Damping::Always;
        let mut before: Option<Before> = None;
        let (mut index, mut waited) = (0, 0);
        loop {
            waited = if norm < 0.9 * self.best_norm {
                0
            } else {
                waited + 1
            };
            self.note_best(x, norm);
            self.map.linearize(x)?;
            let scale = self.scale(x);
            let goal = (self.options.relative_tolerance * scale).max(self.options.absolute_tolerance);
            let stalls = before.is_some_and(|b| norm >= 0.5 * b.norm);
            if norm <= goal {
                return Ok(self.end(index, norm, Ok(Convergence::Tolerance)));
            }
            // A larger share of its terms that changes with the last digits of x is a jump of H, not
            // rounding.
            if stalls && norm <= SIX_DIGITS * scale && self.is_rounding(x, norm) {
                return Ok(self.end(index, norm, Ok(Convergence::Rounding)));
            }
            if index >= self.options.max_iterations {
                return Ok(self.end(index, norm, Err(Status::IterationLimit)));
            }
            let forcing = self.options.forcing.next(self.options, before, norm, goal);
            let tired = full && waited >= PATIENCE && self.options.damping == Damping::OnTrouble;
            let taken = match tired {
                true => Err(Status::Stalled),
                false => self.advance(x, norm, forcing, full)?,
            };
            let taken = match taken {
                Ok(taken) => taken,
                // Full steps have reached a point without a further step.
                Err(_) if full && self.options.damping == Damping::OnTrouble => {
                    (full, waited, before) = (false, 0, None);
                    x.copy_from_slice(&self.work.best);
                    norm = self.evaluate(x);
                    continue;
                }
                Err(_) if norm <= SIX_DIGITS * scale && self.is_rounding(x, norm) => {
                    return Ok(self.end(index, norm, Ok(Convergence::Rounding)));
                }
                Err(reason) => return Ok(self.end(index, norm, Err(reason))),
            };
            let flow = self.record(index, norm, forcing, &taken);
            before = Some(Before {
                norm,
                model: (1.0 - taken.length) + taken.length * taken.model,
                forcing,
            });
            x.copy_from_slice(&self.work.trial);
            std::mem::swap(&mut self.work.r, &mut self.work.trial_r);
            norm = norm2(&self.work.r);
            index += 1;
            if flow.is_break() {
                self.note_best(x, norm);
                return Ok(Err(Status::Interrupted));
            }
        }
    }

    /// ‖H(x)‖; H(x) is left in `r`.
    fn evaluate(&mut self, x: &[f64]) -> f64 {
        self.map.residual(x, &mut self.work.r);
        self.work.report.evaluations += 1;
        norm2(&self.work.r)
    }

    fn note_best(&mut self, x: &[f64], norm: f64) {
        if norm < self.best_norm {
            self.best_norm = norm;
            self.work.best.copy_from_slice(x);
        }
    }

    /// Finds the next iterate and leaves it in `trial`, its residual in `trial_r`.
    fn advance(
        &mut self,
        x: &[f64],
        norm: f64,
        forcing: f64,
        full: bool,
    ) -> Result<Result<Taken, Status>, NewtonError> {
        let work = &mut *self.work;
        for (d, r) in work.d.iter_mut().zip(&work.r) {
            *d = -r;
        }
        let report = match self.krylov.solve(self.map, &mut work.d, forcing) {
            Ok(report) => report,
            Err(LinearError::NotFinite { .. }) => return Ok(Err(self.not_finite())),
            Err(e) => return Err(e.into()),
        };
        let model = report.residual.min(1.0);
        let slope = self.options.armijo * (1.0 - model);
        let length = match (model < 1.0, full) {
            (false, _) => None,
            (true, true) => self.search(x, |_| f64::INFINITY),
            (true, false) => self.search(x, |t| (1.0 - slope * t) * norm),
        };
        let mut taken = Taken {
            step: Step::Newton,
            length: length.unwrap_or(0.0),
            model,
            linear_iterations: report.iterations,
        };
        if length.is_some() {
            return Ok(Ok(taken));
        }
        if self.options.damping != Damping::Never
            && !full
            && let Some(length) = self.steepest_descent(x, norm)
        {
            (taken.step, taken.length, taken.model) = (Step::Gradient, length, 1.0);
            return Ok(Ok(taken));
        }
        Ok(Err(match report.is_solved() {
            true => Status::Stalled,
            false => Status::Linear {
                residual: report.residual,
            },
        }))
    }

    /// Why a product is not finite: a row of the derivative, or else the preconditioner.
    fn not_finite(&mut self) -> Status {
        let work = &mut *self.work;
        self.map.product(&work.r, &mut work.product);
        match work.product.iter().all(|v| v.is_finite()) {
            true => Status::Inaccurate,
            false => Status::evaluation_failure(&work.product),
        }
    }

    /// ‖G x‖ + ‖G x − H(x)‖: what cancels in H(x).
    fn scale(&mut self, x: &[f64]) -> f64 {
        let work = &mut *self.work;
        self.map.product(x, &mut work.product);
        norm2(&work.product) + distance(&work.product, &work.r)
    }

    /// Halves the step until the residual is finite and at most `bound` of the step length; the point is left in `trial`.
    fn search(&mut self, x: &[f64], bound: impl Fn(f64) -> f64) -> Option<f64> {
        let work = &mut *self.work;
        let shortest = match self.options.damping {
            Damping::Never => 1.0,
            _ => self.options.min_damping,
        };
        let mut t = 1.0;
        while t >= shortest {
            for ((trial, x), d) in work.trial.iter_mut().zip(x).zip(&work.d) {
                *trial = x + t * d;
            }
            self.map.residual(&work.trial, &mut work.trial_r);
            work.report.evaluations += 1;
            let norm = norm2(&work.trial_r);
            if norm.is_finite() && norm <= bound(t) {
                return Some(t);
            }
            t *= 0.5;
        }
        None
    }

    /// A step along −Gᵀ H, as long as the minimum of ‖H + G d‖ along it to begin with.
    fn steepest_descent(&mut self, x: &[f64], norm: f64) -> Option<f64> {
        let work = &mut *self.work;
        if !self.map.transpose_product(&work.r, &mut work.d) {
            return None;
        }
        self.map.product(&work.d, &mut work.product);
        let (gradient, curvature) = (norm2(&work.d), norm2(&work.product));
        let length = (gradient / curvature).powi(2);
        if !length.is_finite() {
            return None;
        }
        work.d.iter_mut().for_each(|d| *d *= -length);
        // The decrease of ½‖H + G d‖² along it.
        let slope = self.options.armijo * (gradient / curvature * (gradient / norm)).powi(2);
        self.search(x, |t| (1.0 - slope * t) * norm)
    }

    /// Whether the residual is no larger than the change made by moving each variable by two units in its last place.
    fn is_rounding(&mut self, x: &[f64], norm: f64) -> bool {
        const PATTERNS: [u64; 2] = [0x5555_5555_5555_5555, 0x6666_6666_6666_6666];
        let work = &mut *self.work;
        for pattern in PATTERNS {
            for (j, (trial, x)) in work.trial.iter_mut().zip(x).enumerate() {
                let up = pattern >> (j % 64) & 1 == 1;
                *trial = x * (1.0 + if up { 2.0 } else { -2.0 } * f64::EPSILON);
            }
            self.map.residual(&work.trial, &mut work.trial_r);
            work.report.evaluations += 1;
            if norm <= 2.0 * distance(&work.trial_r, &work.r) {
                return true;
            }
        }
        false
    }

    /// Records the last iterate; the observer's return value is ignored.
    fn end(
        &mut self,
        index: usize,
        norm: f64,
        outcome: Result<Convergence, Status>,
    ) -> Result<Convergence, Status> {
        let none = Taken {
            step: Step::None,
            length: 0.0,
            model: 1.0,
            linear_iterations: 0,
        };
        let _ = self.record(index, norm, 0.0, &none);
        outcome
    }

    fn record(&mut self, index: usize, residual_norm: f64, forcing: f64, taken: &Taken) -> ControlFlow<()> {
        let entry = Iteration {
            index,
            residual_norm,
            step_norm: match taken.step {
                Step::None => 0.0,
                _ => taken.length * norm2(&self.work.d),
            },
            damping: taken.length,
            sites_changed: 0,
            rcond: None,
            step: taken.step,
            linear_iterations: taken.linear_iterations,
            forcing,
        };
        self.work.report.history.push(entry);
        (self.observe)(&entry)
    }
}
