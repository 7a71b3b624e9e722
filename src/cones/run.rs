//! The iteration: starts, the smoothing method and its tail, proximal points.

use std::ops::ControlFlow;

use super::equations::{Map, Part, mixed, owners, parts};
use super::ray::{Search, ray};
use super::{ConeIteration, ConeOptions, ConeProblem, ConeReport, ConeStrategy};
use crate::clock::Deadline;
use crate::complementarity::{ComplementarityError, McpFunction};
use crate::linear::{AutoSolver, LinearSolver};
use crate::run::Status;
use crate::sparse::{Matrix, Pattern, max_abs, pieces};
use crate::spread::Random;
use crate::tolerances::{ARMIJO, HALF_DIGITS, LOOSE};

/// The smoothing parameter follows the merit: μ ≤ NEARNESS ‖Φ‖, and falls at least by the factor FALL.
const NEARNESS: f64 = 0.1;
const FALL: f64 = 0.2;
/// Merit, relative to that of the start, from which on steps of the natural map are tried, and once more after each fall by TAIL.
pub(super) const TAIL: f64 = 0.1;
/// Most steps of the natural map in a row, and of these without progress.
const LONGEST: usize = 30;
const PATIENCE: usize = 2;
/// Most steps of one run of the smoothing method.
const STEPS: usize = 300;
/// Multiples of the identity added to ∇F where steps fail.
const PROXIMAL: [f64; 6] = [0.0, 1e-10, 1e-7, 1e-4, 1e-2, 1.0];
/// Proximal points: the first weight of x − x_k in units of F, and its changes after success and failure.
const WEIGHT: f64 = 0.1;
const LIGHTER: f64 = 0.3;
const HEAVIER: f64 = 5.0;
const OUTER: usize = 40;

/// One solve.
pub(super) struct Run<'a> {
    pub(super) problem: &'a ConeProblem<&'a dyn McpFunction>,
    pub(super) options: &'a ConeOptions,
    pub(super) observe: &'a mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    pub(super) deadline: Deadline<'static>,
    pub(super) solver: AutoSolver,
    /// ∇F, and the Jacobian of the equations.
    pub(super) jac: Matrix,
    pub(super) system: Matrix,
    pub(super) parts: Vec<Part>,
    /// The part of each row.
    pub(super) owner: Vec<usize>,
    /// The block of each part: those that entries of ∇F connect.
    pub(super) block: Vec<usize>,
    /// The largest |x| of each block.
    pub(super) blocks: Vec<f64>,
    /// The error of each part.
    pub(super) errors: Vec<f64>,
    pub(super) x: Vec<f64>,
    pub(super) f: Vec<f64>,
    pub(super) phi: Vec<f64>,
    pub(super) trial: Vec<f64>,
    pub(super) step: Vec<f64>,
    pub(super) best: Vec<f64>,
    pub(super) least: f64,
    /// F in units of each cone.
    pub(super) y: Vec<f64>,
    /// Derivatives of the equations by x in one cone, and by y in all of them.
    pub(super) by_x: Vec<f64>,
    pub(super) by_y: Vec<f64>,
    pub(super) attempt: usize,
    /// Centre and weight of a proximal problem; 0 for the problem itself.
    pub(super) centre: Vec<f64>,
    pub(super) weight: f64,
    /// F(0) of an affine F.
    pub(super) constant: Option<Vec<f64>>,
    /// x and F kept while something is tried.
    pub(super) kept_x: Vec<f64>,
    pub(super) kept_f: Vec<f64>,
    /// Terms of rows, and F − ∇F x.
    pub(super) terms: Vec<f64>,
    pub(super) rest: Vec<f64>,
    /// Buffers for one cone.
    pub(super) room: Vec<f64>,
    /// Whether this is the search for a certificate of another problem, which needs none itself.
    pub(super) inner: bool,
    pub(super) report: ConeReport,
}

/// What the observer is told between iterates.
pub(super) fn between(attempt: usize) -> ConeIteration {
    ConeIteration {
        attempt,
        merit: f64::NAN,
        mu: f64::NAN,
        damping: 0.0,
    }
}

impl<'a> Run<'a> {
    pub(super) fn new(
        problem: &'a ConeProblem<&'a dyn McpFunction>,
        options: &'a ConeOptions,
        deadline: Deadline<'static>,
        observe: &'a mut dyn FnMut(&ConeIteration) -> ControlFlow<()>,
    ) -> Result<Self, ComplementarityError> {
        let n = problem.len();
        let jac = Matrix::zeros(problem.function().pattern());
        let (parts, at, widest) = parts(problem);
        let owner = owners(&parts);
        let entries = mixed(&parts, jac.transpose().pattern());
        let system = Matrix::zeros(Pattern::from_entries(n, n, entries)?);
        let mut solver = AutoSolver::new();
        solver.analyze(system.pattern().as_ref())?;
        let constant = problem.function().is_affine().then(|| {
            let mut q = vec![0.0; n];
            problem.function().value(&vec![0.0; n], &mut q);
            q
        });
        // The blocks that entries of ∇F connect; stored entries of a constant ∇F may be zero.
        let mut slopes = jac.clone();
        if constant.is_some() {
            problem.function().jacobian(&vec![0.0; n], &mut slopes);
        }
        let connects = |v: f64| constant.is_none() || v != 0.0;
        let block = pieces(parts.len(), |join| {
            for (i, j, _) in slopes.triplets().filter(|e| connects(e.2)) {
                join(&mut [owner[i], owner[j]].into_iter());
            }
        });
        Ok(Self {
            blocks: vec![0.0; parts.len()],
            errors: vec![0.0; parts.len()],
            block,
            centre: vec![0.0; n],
            weight: 0.0,
            constant,
            kept_x: vec![0.0; n],
            kept_f: vec![0.0; n],
            terms: vec![0.0; n],
            rest: vec![0.0; n],
            room: vec![0.0; 3 * n],
            inner: false,
            deadline,
            problem,
            options,
            observe,
            solver,
            jac,
            system,
            parts,
            owner,
            x: vec![0.0; n],
            f: vec![0.0; n],
            phi: vec![0.0; n],
            trial: vec![0.0; n],
            step: vec![0.0; n],
            best: vec![0.0; n],
            least: f64::INFINITY,
            y: vec![0.0; n],
            by_x: vec![0.0; widest],
            by_y: vec![0.0; at],
            attempt: 0,
            report: ConeReport {
                status: Status::Stalled,
                residual: f64::NAN,
                error: f64::NAN,
                iterations: 0,
                evaluations: 0,
                factorisations: 0,
                history: Vec::new(),
                ray: None,
            },
        })
    }

    pub(super) fn all_starts(&mut self, start: &[f64]) -> Result<Status, ComplementarityError> {
        self.best.copy_from_slice(start);
        self.problem.project(&mut self.best)?;
        let mut random = Random::new(1);
        let size = 1.0 + max_abs(start);
        let mut status = Status::Stalled;
        for attempt in 0..=self.options.restarts {
            self.attempt = attempt;
            self.x.copy_from_slice(start);
            if attempt > 0 {
                // Far and near ones in turn.
                let width = size * 10_f64.powi(attempt as i32 % 4 - 1);
                self.x.iter_mut().for_each(|x| *x += width * random.symmetric());
            }
            let outcome = match attempt {
                0 => self.first_start(start)?,
                _ => self.descend()?,
            };
            match outcome {
                Status::Stalled | Status::IterationLimit => status = outcome,
                Status::EvaluationFailure { .. } if attempt > 0 => {
                    if (self.observe)(&between(attempt)).is_break() {
                        return Ok(Status::Interrupted);
                    }
                }
                _ => return Ok(outcome),
            }
            if let Some(limit) = self.exhausted() {
                return Ok(limit);
            }
        }
        Ok(status)
    }

    /// All strategies from the start, one after the other.
    fn first_start(&mut self, start: &[f64]) -> Result<Status, ComplementarityError> {
        let monotone = self.evaluate()? && self.is_monotone()?;
        let mut outcome = Status::Stalled;
        for strategy in &self.options.strategies {
            self.x.copy_from_slice(start);
            let ended = match strategy {
                ConeStrategy::Newton => Some(self.newton()?),
                ConeStrategy::Smoothing => Some(self.descend()?),
                ConeStrategy::InteriorPoints if monotone => self.interior_points(start)?,
                ConeStrategy::CentralPath if !monotone => self.interior_points(start)?,
                ConeStrategy::ProximalPoints => Some(self.proximal_points(start)?),
                ConeStrategy::InteriorPoints | ConeStrategy::CentralPath => None,
            };
            outcome = ended.unwrap_or(outcome);
            if ended.is_none() && *strategy == ConeStrategy::InteriorPoints && monotone {
                outcome = self.refute(start)?;
            }
            let fails = matches!(outcome, Status::Stalled | Status::IterationLimit);
            if !fails || self.exhausted().is_some() {
                break;
            }
        }
        Ok(outcome)
    }

    /// Where interior points of a monotone problem have found no solution, a proof that there is none takes
    /// no longer than they did.
    fn refute(&mut self, start: &[f64]) -> Result<Status, ComplementarityError> {
        if self.inner {
            return Ok(Status::Stalled);
        }
        let (attempt, mut stopped) = (self.attempt, false);
        let mut tell = |_: &ConeIteration| {
            let flow = match stopped {
                true => ControlFlow::Break(()),
                false => (self.observe)(&between(attempt)),
            };
            stopped = flow.is_break();
            flow
        };
        let mut search = Search {
            options: self.options,
            deadline: self.deadline,
            observe: &mut tell,
            inner_only: true,
        };
        self.report.ray = ray(self.problem, &mut search, (&self.parts, &self.block), start)?;
        Ok(match (&self.report.ray, stopped) {
            (Some(_), _) => Status::NoSolution,
            (None, true) => Status::Interrupted,
            (None, false) => Status::Stalled,
        })
    }

    /// Steps of the natural map from x.
    fn newton(&mut self) -> Result<Status, ComplementarityError> {
        if !self.evaluate()? {
            return Ok(self.not_finite());
        }
        self.choose_units();
        Ok(match self.tail()? {
            Some(ControlFlow::Continue(())) => Status::Solved,
            Some(ControlFlow::Break(())) => Status::Interrupted,
            None => Status::Stalled,
        })
    }

    /// F and ∇F at x; `false` where they are not finite.
    pub(super) fn evaluate(&mut self) -> Result<bool, ComplementarityError> {
        self.problem.function().value(&self.x, &mut self.f);
        self.add_proximal(false);
        self.differentiate()
    }

    /// ∇F at x, where F has been evaluated.
    fn differentiate(&mut self) -> Result<bool, ComplementarityError> {
        self.jac.clear();
        self.problem.function().jacobian(&self.x, &mut self.jac);
        if let Some((row, col)) = self.jac.stray() {
            return Err(ComplementarityError::OutsidePattern { row, col });
        }
        Ok(self.f.iter().chain(self.jac.values()).all(|v| v.is_finite()))
    }

    /// The first component of F, or row of ∇F, that is not finite.
    fn not_finite(&self) -> Status {
        let of_function = self.f.iter().position(|v| !v.is_finite());
        let row = || {
            self.jac
                .triplets()
                .filter(|(.., v)| !v.is_finite())
                .map(|(i, ..)| i)
                .min()
        };
        Status::EvaluationFailure {
            component: of_function.or_else(row).unwrap_or(0),
        }
    }

    /// Adds the proximal term at the trial point or at x to F.
    fn add_proximal(&mut self, at_trial: bool) {
        if self.weight == 0.0 {
            return;
        }
        let x = if at_trial { &self.trial } else { &self.x };
        for part in &self.parts {
            for i in part.range.clone() {
                self.f[i] += self.weight / part.unit * (x[i] - self.centre[i]);
            }
        }
    }

    /// Solutions of F(x) + w (x − x_k) one after the other, w → 0.
    fn proximal_points(&mut self, start: &[f64]) -> Result<Status, ComplementarityError> {
        self.x.copy_from_slice(start);
        let mut weight = WEIGHT;
        for _ in 0..OUTER {
            self.centre.copy_from_slice(&self.x);
            self.weight = weight;
            let outcome = self.descend();
            self.weight = 0.0;
            let status = outcome?;
            if !matches!(status, Status::Solved | Status::Stalled | Status::IterationLimit) {
                return Ok(status);
            }
            if status == Status::Solved {
                weight *= LIGHTER;
                if !self.evaluate()? {
                    return Ok(Status::Stalled);
                }
                match self.tail()? {
                    Some(ControlFlow::Continue(())) => return Ok(Status::Solved),
                    Some(ControlFlow::Break(())) => return Ok(Status::Interrupted),
                    None => {}
                }
            } else if let Some(limit) = self.exhausted() {
                return Ok(limit);
            } else {
                weight *= HEAVIER;
                self.x.copy_from_slice(&self.centre);
            }
        }
        Ok(Status::Stalled)
    }

    /// A reason to stop altogether.
    pub(super) fn exhausted(&self) -> Option<Status> {
        if self.deadline.is_over() {
            Some(Status::TimeLimit)
        } else if self.report.iterations >= self.options.max_iterations {
            Some(Status::IterationLimit)
        } else {
            None
        }
    }

    pub(super) fn record(&mut self, merit: f64, map: Map, damping: f64) -> ControlFlow<()> {
        let iteration = ConeIteration {
            attempt: self.attempt,
            merit,
            mu: match map {
                Map::Smoothed(mu) => mu,
                Map::Natural => 0.0,
            },
            damping,
        };
        self.report.history.push(iteration);
        self.report.iterations += 1;
        (self.observe)(&iteration)
    }

    /// One run from x.
    fn descend(&mut self) -> Result<Status, ComplementarityError> {
        if !self.evaluate()? {
            return Ok(self.not_finite());
        }
        self.choose_units();
        let first = self.map(Map::Natural, false);
        let mut mu = NEARNESS * first.max(f64::MIN_POSITIVE);
        let mut merit = self.map(Map::Smoothed(mu), false);
        let mut next_tail = f64::INFINITY;
        let mut damping = 1.0;
        for k in 0..=STEPS {
            if let Some(status) = self.exhausted() {
                return Ok(status);
            }
            if self.record(merit, Map::Smoothed(mu), damping).is_break() {
                return Ok(Status::Interrupted);
            }
            if self.weight > 0.0 && merit.max(mu) <= LOOSE * first {
                return Ok(Status::Solved);
            }
            if self.weight == 0.0 && merit <= next_tail {
                next_tail = TAIL * merit;
                match self.tail()? {
                    Some(ControlFlow::Continue(())) => return Ok(Status::Solved),
                    Some(ControlFlow::Break(())) => return Ok(Status::Interrupted),
                    None => {}
                }
            }
            if k == STEPS {
                break;
            }
            let step = match merit > 0.0 {
                true => self.search(&mut merit, mu)?,
                false => None,
            };
            let Some(length) = step else {
                return Ok(self.exhausted().unwrap_or(Status::Stalled));
            };
            damping = length;
            // A smaller μ as soon as its equations are nearly met.
            if merit <= mu {
                mu = (FALL * mu).min(NEARNESS * merit).max(f64::MIN_POSITIVE);
                merit = self.map(Map::Smoothed(mu), false);
            }
        }
        Ok(Status::IterationLimit)
    }

    /// A step that reduces ‖Φ_μ‖, by line search along Newton directions with more and more regularisation; returns its length.
    fn search(&mut self, merit: &mut f64, mu: f64) -> Result<Option<f64>, ComplementarityError> {
        let map = Map::Smoothed(mu);
        self.kept_f.copy_from_slice(&self.f);
        for proximal in PROXIMAL {
            if self.deadline.is_over() {
                break;
            }
            if !self.newton_step(map, proximal + self.weight)? {
                continue;
            }
            let mut damping = 1.0;
            while damping >= HALF_DIGITS {
                for (t, (x, d)) in self.trial.iter_mut().zip(self.x.iter().zip(&self.step)) {
                    *t = x + damping * d;
                }
                self.problem.function().value(&self.trial, &mut self.f);
                self.add_proximal(true);
                let value = self.map(map, true);
                if value <= (1.0 - ARMIJO * damping) * *merit {
                    std::mem::swap(&mut self.x, &mut self.trial);
                    if self.differentiate()? {
                        *merit = value;
                        return Ok(Some(damping));
                    }
                    std::mem::swap(&mut self.x, &mut self.trial);
                    self.evaluate()?;
                }
                damping *= 0.5;
            }
            self.f.copy_from_slice(&self.kept_f);
        }
        Ok(None)
    }

    /// Full steps of the natural map from x, as long as they converge; `None`, with x restored, where they do not.
    pub(super) fn tail(&mut self) -> Result<Option<ControlFlow<()>>, ComplementarityError> {
        self.kept_x.copy_from_slice(&self.x);
        let (mut last, mut least) = (f64::INFINITY, f64::INFINITY);
        let mut worse = 0;
        for _ in 0..LONGEST {
            if self.exhausted().is_some() {
                break;
            }
            let merit = self.map(Map::Natural, false);
            let flow = self.record(merit, Map::Natural, 1.0);
            if self.judge()? && (merit >= 0.5 * last || merit == 0.0) {
                return Ok(Some(ControlFlow::Continue(())));
            }
            if flow.is_break() {
                return Ok(Some(flow));
            }
            // Against the least so far: far from a solution merits may oscillate for ever.
            worse = if merit < least { 0 } else { worse + 1 };
            (last, least) = (merit, least.min(merit));
            if worse > PATIENCE {
                break;
            }
            // Singular where solutions are not unique.
            let mut stepped = false;
            for proximal in &PROXIMAL[..3] {
                stepped = stepped || self.newton_step(Map::Natural, *proximal)?;
            }
            if !stepped {
                break;
            }
            for (x, d) in self.x.iter_mut().zip(&self.step) {
                *x += d;
            }
            if !self.evaluate()? {
                break;
            }
        }
        if self.least <= self.options.tolerance {
            return Ok(Some(ControlFlow::Continue(())));
        }
        self.x.copy_from_slice(&self.kept_x);
        self.evaluate()?;
        Ok(None)
    }
}
