use std::ops::ControlFlow;

use super::cone::{natural_residual, tangential_norm};
use super::interior::Interior;
use super::local::solve_contact;
use super::newton::{Inner, Newton};
use super::report::{DelassusIteration, DelassusPhase, DelassusReport, DelassusStatus};
use super::scaled::{Scaled, Vector};
use super::{DelassusError, DelassusOptions, DelassusProblem};
use crate::clock::Deadline;
use crate::contact::ContactState;

/// Sweeps of the cheap first attempt.
const SWEEPS: usize = 30;

/// First weight of the proximal term, far from a solution and after interior points; its changes after success and failure.
const ALPHA: f64 = 1e-2;
const ALPHA_NEAR: f64 = 1e-5;
const SHRINK: f64 = 0.3;
const GROW: f64 = 4.0;
const LEAST_ALPHA: f64 = 1e-10;
const LARGEST_ALPHA: f64 = 1e6;

/// Newton iterations of one proximal step.
const INNER: usize = 60;

/// Factorisations without a gain of a factor 3 after which proximal steps are given up.
const PATIENCE: usize = 300;
const FIRST_PATIENCE: usize = 40;
/// Most proximal steps in a row without a factorisation: α is then at its least and nothing moves.
const MAX_IDLE: usize = 60;

/// Weight of velocities in Newton's residual where 1 has not done: with that contacts of packings go to and fro between open and
/// closed from one iteration to the next.
const HEAVY: f64 = 100.0;

/// Sweeps before each further attempt at proximal steps.
/// Sweeps after which the history is told.
const REPORTED: usize = 100;
const MORE_SWEEPS: [usize; 4] = [300, 1000, 3000, 10_000];

/// Residual from which proximal steps converge, as a rule.
const NEAR: f64 = 1e-6;

/// Largest violation of the law against q and u that a solution may have.
const VIOLATION: f64 = 1e-6;

/// Interior-point steps in one go.
const INTERIOR_STEPS: usize = 80;

/// What counts as no reaction and as no slip, relative to the largest entries in scaled variables.
const ZERO: f64 = 1e-9;

/// Break with a status ends the run.
type Outcome = Result<ControlFlow<DelassusStatus>, DelassusError>;

macro_rules! flow_value {
    ($flow:expr) => {
        match $flow {
            ControlFlow::Break(status) => return Ok(ControlFlow::Break(status)),
            ControlFlow::Continue(value) => value,
        }
    };
}

macro_rules! flow {
    ($flow:expr) => {
        if let ControlFlow::Break(status) = $flow {
            return Ok(status);
        }
    };
}

/// Solver of [`DelassusProblem`]s.
///
/// In turn, until the residual is met: nonsmooth Gauss–Seidel with exact one-contact solutions; interior points for the law with
/// De Saxcé's term, which cross the many near-degenerate contacts of stacks and packings and do not mind a singular M; semismooth
/// Newton (P. Alart, A. Curnier 1991) on proximal problems M + αI, q − α r_k, with α driven to 0, for the last digits; and the
/// same from more sweeps. Runs are deterministic. A large sparse M is factored by Cholesky with GMRES for De Saxcé's term, so
/// that memory is that of its factor; a small or mostly full one by LU.
///
/// Where M is singular, or friction is large, solutions need not be unique: one is found. Where there is none, the best iterate
/// is returned; a residual that is small only because reactions grow without bound is not taken for a solution.
///
/// M is taken to be semidefinite up to rounding. Errors that make its symmetric part indefinite by ε (entries known to a few digits
/// only, say) may leave a problem without a solution: runs then stall at a residual of about ε against M. Heaps of some hundred bodies
/// with many redundant contacts may stall too, at 1e-7, far above rounding.
#[derive(Debug, Clone, Default)]
pub struct DelassusSolver {
    options: DelassusOptions,
}

impl DelassusSolver {
    /// A solver with the given options, which are checked when it solves.
    #[must_use]
    pub fn new(options: DelassusOptions) -> Self {
        Self { options }
    }

    /// Solves from r = 0.
    ///
    /// # Errors
    /// [`DelassusError::Option`] names an option out of range. A failed run is told by the status of the report.
    pub fn solve(&self, problem: &DelassusProblem) -> Result<DelassusReport, DelassusError> {
        self.solve_observed(problem, None, |_| ControlFlow::Continue(()))
    }

    /// Solves from the reactions `start` (from 0 without them); `observe` sees every entry of the history and may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve), and [`DelassusError::Length`] and [`DelassusError::NotFinite`] for the start.
    pub fn solve_observed(
        &self,
        problem: &DelassusProblem,
        start: Option<&[f64]>,
        mut observe: impl FnMut(&DelassusIteration) -> ControlFlow<()>,
    ) -> Result<DelassusReport, DelassusError> {
        self.options.validate()?;
        let zero = vec![0.0; problem.q().len()];
        let start = start.unwrap_or(&zero);
        problem.velocities(start)?;
        match problem.dimension() {
            2 => Run::<2>::new(problem, &self.options, start, &mut observe).report(),
            _ => Run::<3>::new(problem, &self.options, start, &mut observe).report(),
        }
    }
}

struct Run<'a, const D: usize> {
    problem: &'a DelassusProblem,
    options: &'a DelassusOptions,
    observe: &'a mut dyn FnMut(&DelassusIteration) -> ControlFlow<()>,
    scaled: Scaled<D>,
    newton: Newton<D>,
    r: Vector<D>,
    u: Vector<D>,
    best: Vec<f64>,
    best_key: f64,
    plain: Vec<f64>,
    sweeps: usize,
    history: Vec<DelassusIteration>,
}

impl<'a, const D: usize> Run<'a, D> {
    fn new(
        problem: &'a DelassusProblem,
        options: &'a DelassusOptions,
        start: &[f64],
        observe: &'a mut dyn FnMut(&DelassusIteration) -> ControlFlow<()>,
    ) -> Self {
        let scaled = Scaled::new(problem);
        Self {
            newton: Newton::new(problem.contacts(), Deadline::after(options.max_time)),
            r: scaled.scale(start),
            u: vec![[0.0; D]; problem.contacts()],
            best: start.to_vec(),
            best_key: f64::INFINITY,
            plain: start.to_vec(),
            sweeps: 0,
            history: Vec::new(),
            problem,
            options,
            observe,
            scaled,
        }
    }

    /// The residual of the current iterate; the best one is kept.
    ///
    /// Where a problem has no solution, reactions that grow without bound make the law's violation small against themselves. An
    /// iterate counts only if the violation is small against q and u too.
    fn measure(&mut self) -> Result<f64, DelassusError> {
        self.scaled.unscale(&self.r, &mut self.plain);
        let residual = self.problem.residual(&self.plain)?;
        let violation = self.violation();
        let key = if violation <= VIOLATION {
            residual
        } else {
            violation
        };
        // A gain within rounding is no reason to move on.
        if key < 0.99 * self.best_key || (key < self.best_key && key <= self.options.tolerance) {
            self.best_key = key;
            self.best.copy_from_slice(&self.plain);
        }
        Ok(residual)
    }

    /// ‖r − P_K(r − û)‖ against ‖q‖ and ‖u‖, in scaled variables.
    fn violation(&mut self) -> f64 {
        let p = &self.scaled;
        p.velocities(&self.r, &mut self.u);
        let norm = |v: &[[f64; D]]| v.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        let sum: f64 = (0..self.r.len())
            .map(|i| natural_residual(p.friction[i], 1.0, &self.r[i], &self.u[i]))
            .sum();
        sum.sqrt() / norm(&p.q).max(norm(&self.u)).max(f64::MIN_POSITIVE)
    }

    fn record(
        &mut self,
        phase: DelassusPhase,
        alpha: f64,
        work: usize,
        success: bool,
    ) -> Result<ControlFlow<DelassusStatus, f64>, DelassusError> {
        let residual = self.measure()?;
        let entry = DelassusIteration {
            index: self.history.len(),
            phase,
            residual,
            alpha,
            work,
            success,
        };
        self.history.push(entry);
        if self.best_key <= self.options.tolerance {
            return Ok(ControlFlow::Break(DelassusStatus::Solved));
        }
        if (self.observe)(&entry).is_break() {
            return Ok(ControlFlow::Break(DelassusStatus::Interrupted));
        }
        Ok(ControlFlow::Continue(residual))
    }

    /// One sweep of nonsmooth Gauss–Seidel.
    fn sweep(&mut self, backward: bool) {
        let p = &self.scaled;
        let nc = p.contacts();
        for k in 0..nc {
            let i = if backward { nc - 1 - k } else { k };
            let mut b = p.q[i];
            let old = self.r[i];
            self.r[i] = [0.0; D];
            p.matrix.add_row(i, &self.r, &mut b);
            self.r[i] = old;
            self.r[i] = solve_contact(&p.matrix.diagonal[i], &b, p.friction[i]);
        }
        self.sweeps += 1;
    }

    fn run(&mut self) -> Result<DelassusStatus, DelassusError> {
        self.measure()?;
        if self.best_key <= self.options.tolerance {
            return Ok(DelassusStatus::Solved);
        }
        flow!(self.sweeps_of(SWEEPS)?);
        flow!(self.interior(false)?);
        if self.best_key > NEAR {
            self.restart();
            flow!(self.interior(true)?);
        }
        self.restart();
        flow!(self.proximal(ALPHA_NEAR, FIRST_PATIENCE)?);
        self.newton.rho = HEAVY;
        self.restart();
        flow!(self.proximal(ALPHA_NEAR, PATIENCE)?);
        for sweeps in MORE_SWEEPS {
            self.restart();
            flow!(self.sweeps_of(sweeps)?);
            flow!(self.proximal(ALPHA, PATIENCE)?);
        }
        Ok(DelassusStatus::Stalled)
    }

    /// Goes back to the best iterate.
    fn restart(&mut self) {
        self.r = self.scaled.scale(&self.best);
    }

    /// At most n sweeps, fewer where time is over.
    fn sweeps_of(&mut self, n: usize) -> Outcome {
        let n = n.min(self.options.max_sweeps);
        let mut done = 0;
        while done < n {
            let end = n.min(done + REPORTED);
            let begun = done;
            while done < end && !self.newton.deadline.is_over() {
                self.sweep(done % 2 == 1);
                done += 1;
            }
            if let ControlFlow::Break(status) = self.record(DelassusPhase::Sweeps, 0.0, done - begun, true)? {
                return Ok(ControlFlow::Break(status));
            }
            if done < end {
                break;
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Interior points from the iterate; leaves the last iterate.
    fn interior(&mut self, may_freeze: bool) -> Outcome {
        let mut interior = Interior::new(&self.scaled);
        interior.start(&self.scaled, &self.r, may_freeze);
        let (mut best, mut since, mut stuck) = (f64::INFINITY, 0, 0);
        for _ in 0..INTERIOR_STEPS {
            let over = self.newton.deadline.is_over();
            if over || self.newton.factorisations >= self.options.max_factorisations {
                return Ok(ControlFlow::Break(DelassusStatus::Limit));
            }
            let Some(length) = interior.step(&self.scaled) else {
                break;
            };
            self.newton.factorisations += 1;
            interior.reactions(&self.scaled, &mut self.r);
            let gap = interior.gap();
            let residual = flow_value!(self.record(DelassusPhase::Interior, gap, 1, length > 0.1)?);
            if residual < 0.7 * best {
                (best, since) = (residual, 0);
            } else {
                since += 1;
            }
            stuck = if length < 0.02 { stuck + 1 } else { 0 };
            if gap < 1e-13 || since > 10 || stuck > 4 {
                break;
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Proximal steps from the iterate until they no longer pay.
    fn proximal(&mut self, mut alpha: f64, patience: usize) -> Outcome {
        let mut centre = self.r.clone();
        let (mut mark, mut mark_at) = (f64::INFINITY, self.newton.factorisations);
        // The violation at the centre, once that is known.
        let mut at_centre = f64::INFINITY;
        // Steps in a row that needed no factorisation, which no other limit counts.
        let mut idle = 0;
        loop {
            let before = self.newton.factorisations;
            if self.newton.deadline.is_over() || before >= self.options.max_factorisations {
                return Ok(ControlFlow::Break(DelassusStatus::Limit));
            }
            let left = self.options.max_factorisations - before;
            centre.copy_from_slice(&self.r);
            let scale = self.r.iter().flatten().fold(1.0_f64, |a, b| a.max(b.abs()));
            let tolerance = 1e-14 * scale;
            let inner = self.newton.solve(
                &self.scaled,
                &mut self.r,
                alpha,
                &centre,
                tolerance,
                left.min(INNER),
            );
            let work = self.newton.factorisations - before;
            let converged = inner == Inner::Converged;
            idle = if work == 0 { idle + 1 } else { 0 };
            if idle > MAX_IDLE {
                return Ok(ControlFlow::Continue(()));
            }
            let residual = flow_value!(self.record(DelassusPhase::Proximal, alpha, work, converged)?);
            if converged {
                alpha = (alpha * SHRINK).max(LEAST_ALPHA);
                at_centre = residual;
            } else {
                alpha *= GROW;
                // What a failed iteration has gained is kept.
                if residual < at_centre {
                    at_centre = residual;
                } else {
                    self.r.copy_from_slice(&centre);
                }
            }
            if residual < 0.3 * mark {
                (mark, mark_at) = (residual, self.newton.factorisations);
            }
            if self.newton.factorisations - mark_at > patience || alpha > LARGEST_ALPHA {
                return Ok(ControlFlow::Continue(()));
            }
        }
    }

    fn report(mut self) -> Result<DelassusReport, DelassusError> {
        let status = self.run()?;
        let u = self.problem.velocities(&self.best)?;
        let r = self.scaled.scale(&self.best);
        let mut v = vec![[0.0; D]; r.len()];
        self.scaled.velocities(&r, &mut v);
        let size = r.iter().flatten().fold(1.0_f64, |a, b| a.max(b.abs()));
        let states = (0..r.len()).map(|i| state(&r[i], &v[i], size)).collect();
        Ok(DelassusReport {
            status,
            residual: self.problem.residual(&self.best)?,
            r: self.best,
            u,
            states,
            factorisations: self.newton.factorisations,
            sweeps: self.sweeps,
            history: self.history,
        })
    }
}

/// The state of a contact of a solution in scaled variables, whose largest entry is about `size`.
fn state<const D: usize>(r: &[f64; D], u: &[f64; D], size: f64) -> ContactState {
    if r[0] <= ZERO * size {
        ContactState::Open
    } else if tangential_norm(u) <= ZERO * size {
        ContactState::Stick
    } else {
        ContactState::slipping(-r[1])
    }
}
