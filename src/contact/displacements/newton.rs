//! Semismooth Newton in the displacements, with the law eliminated at each node.

use std::ops::ControlFlow;

use super::node::{ChangedRows, Node};
use super::solve::{Outcome, ReducedError, ReducedNodes, ReducedObserver, Stop};
use super::system::ReducedSystem;
use super::{ReducedIteration, ReducedOptions, ReducedProgress, ReducedReport, ReducedTimes};
use crate::clock::{Clock, Deadline};
use crate::contact::law::NodeLaw;
use crate::contact::rounding::size_of_forces;
use crate::contact::{ContactError, ContactResiduals, ContactState, ContactStrategy};
use crate::linear::KrylovReport;
use crate::run::Status;
use crate::tolerances::{ARMIJO, LOOSE, SIX_DIGITS};

/// Number of full steps that do not halve the best residual, after which steps are damped.
const PATIENCE: usize = 8;
/// Smallest step length.
const SHORTEST: f64 = 1.0 / 128.0;
/// Share of the reduction of the residual still needed to which a linear system is solved.
const SHARE: f64 = 0.3;
/// γ of Eisenstat and Walker's choice 2: η = γ (‖r‖ / ‖r of the step before‖)².
const GAMMA: f64 = 0.5;
/// A linear solve that leaves more than this of its residual has failed.
const USELESS: f64 = 0.5;
/// Load steps: the first one, the smallest, the largest number of Newton steps of each.
const FIRST_STEP: f64 = 0.125;
const SMALLEST_STEP: f64 = 1e-4;
const STEPS_ON_THE_WAY: usize = 25;

/// Residuals before the first evaluation.
const UNKNOWN: ContactResiduals = ContactResiduals {
    equilibrium: f64::INFINITY,
    normal: f64::INFINITY,
    tangential: f64::INFINITY,
};

#[derive(Debug, Clone, Copy, PartialEq)]
enum Ended {
    Solved,
    Stuck(Status),
    /// By the observer or at the limit on time, in any process.
    Early(Status),
}

/// Residuals at an iterate.
#[derive(Debug, Clone, Copy)]
struct State {
    residuals: ContactResiduals,
    /// ‖·‖₂ of equilibrium and of the laws.
    merit: f64,
    states: [usize; 3],
    /// Whether all nodes have the same piece as at the iterate before.
    settled: bool,
    /// Why the search ends here, if one process has reached its limit on time or been stopped by its observer.
    early: Option<Status>,
}

/// The best iterate under the full load.
#[derive(Debug)]
pub(super) struct Best {
    u: Vec<f64>,
    forces: Vec<f64>,
    residuals: ContactResiduals,
    states: [usize; 3],
    merit: f64,
}

impl Best {
    /// A start, not yet evaluated.
    pub(super) fn start(u: Vec<f64>, nodes: &ReducedNodes<'_>, law: &dyn NodeLaw) -> Self {
        Self {
            u,
            forces: vec![0.0; nodes.components.len() * (1 + law.num_tangents())],
            residuals: UNKNOWN,
            states: [0; 3],
            merit: f64::INFINITY,
        }
    }

    pub(super) fn report(self, strategy: ContactStrategy, status: Status) -> ReducedReport {
        ReducedReport {
            status,
            displacements: self.u,
            forces: self.forces,
            residuals: self.residuals,
            states: self.states,
            strategy,
            iterations: Vec::new(),
            times: ReducedTimes::default(),
        }
    }
}

pub(super) struct ReducedSearch<'a, S> {
    system: &'a mut S,
    nodes: &'a ReducedNodes<'a>,
    law: &'a dyn NodeLaw,
    full: &'a [f64],
    /// The share of the load applied.
    load: Vec<f64>,
    is_contact: Vec<bool>,
    options: &'a ReducedOptions,
    deadline: Deadline<'static>,
    observe: &'a mut ReducedObserver<'a>,
    /// Stopped by the observer or at the limit on time, in any process.
    early: Option<Status>,
    iterations: Vec<ReducedIteration>,
    times: ReducedTimes,
    best: Best,
    /// A u.
    image: Vec<f64>,
    other: Vec<f64>,
    direction: Vec<f64>,
    local: Vec<Node>,
    /// The pieces of the nodes at the iterate before.
    pieces: Vec<usize>,
    changed: ChangedRows,
}

impl<'a, S: ReducedSystem> ReducedSearch<'a, S> {
    /// A search from u under `load`; `is_contact` says which components belong to contact nodes.
    pub(super) fn new(
        system: &'a mut S,
        nodes: &'a ReducedNodes<'a>,
        law: &'a dyn NodeLaw,
        (load, u): (&'a [f64], Vec<f64>),
        is_contact: Vec<bool>,
        options: &'a ReducedOptions,
        observe: &'a mut ReducedObserver<'a>,
    ) -> Self {
        let len = is_contact.len();
        Self {
            system,
            nodes,
            law,
            full: load,
            load: load.to_vec(),
            is_contact,
            options,
            deadline: Deadline::after(options.max_time),
            observe,
            early: None,
            iterations: Vec::new(),
            times: ReducedTimes::default(),
            best: Best::start(u, nodes, law),
            image: vec![0.0; len],
            other: vec![0.0; len],
            direction: vec![0.0; len],
            local: Vec::with_capacity(nodes.components.len()),
            pieces: vec![usize::MAX; nodes.components.len()],
            changed: ChangedRows::default(),
        }
    }

    /// The solution, or an error with the best iterate.
    pub(super) fn run(mut self) -> Result<ReducedReport, ReducedError<S::Error>> {
        let clock = Clock::start();
        let ended = self.solve();
        self.times.rest = clock
            .elapsed()
            .saturating_sub(self.times.select + self.times.krylov);
        let (strategy, status) = match &ended {
            Ok((strategy, status)) => (*strategy, *status),
            Err(stop) => (ContactStrategy::Newton, stop.status()),
        };
        let report = ReducedReport {
            iterations: self.iterations,
            times: self.times,
            ..self.best.report(strategy, status)
        };
        match ended {
            Ok(_) if status.is_solved() => Ok(report),
            Ok(_) => Err(ContactError::NotConverged {
                best: Box::new(report),
            }
            .into()),
            Err(stop) => Err(stop.with(report)),
        }
    }

    /// Newton's method from the start, then load steps; returns the strategy that led to `best`, which is the solution if there is one, and
    /// how the search ended.
    fn solve(&mut self) -> Outcome<(ContactStrategy, Status), S::Error> {
        let options = self.options;
        let start = self.best.u.clone();
        let (mut found, mut u) = self.iterate(1.0, start, options.tolerance, options.max_iterations)?;
        let mut strategy = ContactStrategy::Newton;
        if matches!(found, Ended::Stuck(_)) && options.max_load_steps > 0 {
            let (again, other) = self.load_steps()?;
            if !matches!(again, Ended::Stuck(_)) {
                (strategy, u) = (ContactStrategy::LoadSteps, other);
            }
            found = again;
        }
        let (Ended::Stuck(status) | Ended::Early(status)) = found else {
            return Ok((strategy, Status::Solved));
        };
        self.set_load(1.0);
        let state = self.evaluate(&u)?;
        if state.merit <= self.best.merit || state.residuals.largest() <= options.tolerance {
            self.keep(&u, &state);
        }
        let solved = self.best.residuals.largest() <= options.tolerance;
        Ok((strategy, if solved { Status::Solved } else { status }))
    }

    /// Keeps an iterate that has just been evaluated as the best one.
    fn keep(&mut self, u: &[f64], state: &State) {
        let p = self.nodes.components.len();
        let best = &mut self.best;
        best.u.copy_from_slice(u);
        for (i, node) in self.local.iter().enumerate() {
            for d in 0..=self.law.num_tangents() {
                best.forces[d * p + i] = node.force[d];
            }
        }
        (best.residuals, best.states, best.merit) = (state.residuals, state.states, state.merit);
    }

    fn set_load(&mut self, share: f64) {
        for (own, full) in self.load.iter_mut().zip(self.full) {
            *own = share * full;
        }
    }

    /// Newton's method from u under a share of the load; the last iterate if it converged, else the best.
    fn iterate(
        &mut self,
        share: f64,
        mut u: Vec<f64>,
        tolerance: f64,
        limit: usize,
    ) -> Outcome<(Ended, Vec<f64>), S::Error> {
        self.set_load(share);
        let (mut best, mut since) = ((f64::INFINITY, Vec::new()), 0);
        let (mut before, mut damped) = (f64::INFINITY, false);
        let mut stuck = Status::Stalled;
        for taken in 0..=limit {
            self.tell(share);
            let state = self.evaluate(&u)?;
            let error = state.residuals.largest();
            if error <= tolerance {
                if share == 1.0 {
                    self.keep(&u, &state);
                }
                return Ok((Ended::Solved, u));
            }
            if !state.merit.is_finite() {
                break;
            }
            since += 1;
            if state.merit < 0.5 * best.0 || damped && state.merit < best.0 {
                if state.merit < 0.5 * best.0 {
                    since = 0;
                }
                best.0 = state.merit;
                best.1.clone_from(&u);
                if share == 1.0 && state.merit < self.best.merit {
                    self.keep(&u, &state);
                }
            }
            if let Some(status) = state.early {
                self.early = state.early;
                return Ok((Ended::Early(status), best.1));
            }
            if taken == limit {
                stuck = Status::IterationLimit;
                break;
            }
            if since >= PATIENCE {
                if damped {
                    break;
                }
                (damped, since) = (true, 0);
                u.clone_from(&best.1);
                before = f64::INFINITY;
                continue;
            }
            let forcing = match state.settled {
                true => self.forcing(error, before, tolerance),
                // The next system will have other rows changed, so that accuracy in this one is wasted.
                false => self.options.forcing,
            };
            before = error;
            self.iterations.push(ReducedIteration {
                load: share,
                residuals: state.residuals,
                states: state.states,
                forcing,
                krylov: 0,
                step: 0.0,
            });
            let old = damped.then(|| (u.clone(), self.image.clone()));
            let outcome = self.step(&mut u, forcing)?;
            let mut taken = if outcome.residual <= USELESS { 1.0 } else { 0.0 };
            if let Some((from, image)) = old
                && taken > 0.0
            {
                taken = self.damp(&from, image, &mut u, state.merit)?;
            }
            if let Some(last) = self.iterations.last_mut() {
                (last.krylov, last.step) = (outcome.iterations, taken);
            }
            if taken == 0.0 && self.early.is_none() {
                break;
            }
        }
        let u = if best.1.is_empty() { u } else { best.1 };
        Ok((Ended::Stuck(stuck), u))
    }

    /// The relative tolerance of the next linear system, from the current error and that of the step before (infinite in the first one).
    fn forcing(&self, error: f64, before: f64, tolerance: f64) -> f64 {
        let largest = self.options.forcing;
        if before.is_infinite() {
            return largest;
        }
        let ratio = error / before;
        let wanted = (GAMMA * ratio * ratio).max(LOOSE).max(SHARE * tolerance / error);
        wanted.min(largest)
    }

    /// The progress of the search, without the linear solve under way.
    fn progress(&self, load: f64) -> ReducedProgress {
        ReducedProgress {
            load,
            newton: self.iterations.len(),
            krylov: 0,
            residual: self
                .iterations
                .last()
                .map_or(f64::INFINITY, |i| i.residuals.largest()),
        }
    }

    fn tell(&mut self, load: f64) {
        if self.early.is_none() {
            let progress = self.progress(load);
            let stopped = (self.observe)(&progress).is_break();
            self.early = stopped.then_some(Status::Interrupted);
        }
    }

    /// Load steps, from no load.
    fn load_steps(&mut self) -> Outcome<(Ended, Vec<f64>), S::Error> {
        let mut u = vec![0.0; self.full.len()];
        let (mut share, mut step) = (0.0f64, FIRST_STEP);
        for _ in 0..self.options.max_load_steps {
            let next = (share + step).min(1.0);
            let (tolerance, limit) = if next < 1.0 {
                (self.options.tolerance.max(SIX_DIGITS), STEPS_ON_THE_WAY)
            } else {
                (self.options.tolerance, self.options.max_iterations)
            };
            // Extrapolation along the secant through the unloaded body, u = 0.
            let start = if share > 0.0 {
                u.iter().map(|v| v * next / share).collect()
            } else {
                u.clone()
            };
            match self.iterate(next, start, tolerance, limit)? {
                (Ended::Solved, found) => {
                    (u, share) = (found, next);
                    step *= 2.0;
                    if share == 1.0 {
                        return Ok((Ended::Solved, u));
                    }
                }
                (early @ Ended::Early(_), found) => return Ok((early, found)),
                (Ended::Stuck(_), _) => {
                    step *= 0.25;
                    if step < SMALLEST_STEP {
                        return Ok((Ended::Stuck(Status::Stalled), u));
                    }
                }
            }
        }
        Ok((Ended::Stuck(Status::IterationLimit), u))
    }

    /// A u into `image`, the laws at u into `local`.
    fn evaluate(&mut self, u: &[f64]) -> Outcome<State, S::Error> {
        let mut image = std::mem::take(&mut self.image);
        let product = self.system.mul(u, &mut image).map_err(Stop::System);
        let mut local = std::mem::take(&mut self.local);
        local.clear();
        let state = self.judge(u, &image, Some(&mut local));
        for (piece, node) in self.pieces.iter_mut().zip(&local) {
            *piece = node.piece;
        }
        (self.image, self.local) = (image, local);
        product?;
        state
    }

    /// Residuals at u with the image A u.
    fn judge(&self, u: &[f64], image: &[f64], mut keep: Option<&mut Vec<Node>>) -> Outcome<State, S::Error> {
        let mut squares = 0.0;
        let (mut balance, mut weight) = (0.0f64, f64::MIN_POSITIVE);
        for ((f, a), contact) in self.load.iter().zip(image).zip(&self.is_contact) {
            let rest = f - a;
            weight = weight.max(f.abs()).max(a.abs());
            if *contact {
                weight = weight.max(rest.abs());
            } else {
                squares += rest * rest;
                balance = balance.max(rest.abs());
            }
        }
        let (mut normal, mut tangential, mut size) = (0.0f64, 0.0f64, f64::MIN_POSITIVE);
        let (mut counts, mut moved, mut failure) = ([0.0; 3], 0.0, None);
        for i in 0..self.nodes.components.len() {
            let v = self.nodes.values(self.law, i, u, |k| self.load[k] - image[k]);
            let node = match Node::new(self.law, &v) {
                Ok(node) => node,
                Err(piece) => {
                    failure = Some(Stop::Law(v.node, piece));
                    break;
                }
            };
            let h = &node.h;
            squares += h
                .iter()
                .take(1 + self.law.num_tangents())
                .map(|h| h * h)
                .sum::<f64>();
            normal = normal.max(h[0].abs());
            tangential = tangential.max(h[1].abs()).max(h[2].abs());
            size = size.max(size_of_forces(&v, self.nodes.offsets(i)));
            counts[match self.law.state(node.piece, &v) {
                ContactState::Open => 0,
                ContactState::Stick => 1,
                _ => 2,
            }] += 1.0;
            if node.piece != self.pieces[i] {
                moved = 1.0;
            }
            if let Some(list) = keep.as_deref_mut() {
                list.push(node);
            }
        }
        let mut sums = [squares, counts[0], counts[1], counts[2]];
        // The largest of all processes: an observer counts more than a limit on time.
        let early = match self.early {
            Some(Status::Interrupted) => 2.0,
            None if !self.deadline.is_over() => 0.0,
            _ => 1.0,
        };
        let failed = f64::from(u8::from(failure.is_some()));
        let mut largest = [balance, weight, normal, tangential, size, moved, early, failed];
        self.system.sum(&mut sums).map_err(Stop::System)?;
        self.system.max(&mut largest).map_err(Stop::System)?;
        let [balance, weight, normal, tangential, size, moved, early, failed] = largest;
        if failed > 0.0 {
            return Err(failure.unwrap_or(Stop::Elsewhere));
        }
        // Maxima ignore NaN, and any residual is small relative to an infinite force.
        let known = !sums[0].is_nan() && weight.is_finite() && size.is_finite();
        let residuals = ContactResiduals {
            equilibrium: balance / weight,
            normal: normal / size,
            tangential: tangential / size,
        };
        Ok(State {
            residuals: if known { residuals } else { UNKNOWN },
            merit: sums[0].sqrt(),
            states: [sums[1], sums[2], sums[3]].map(|c| c as usize),
            settled: moved == 0.0,
            early: match early {
                0.0 => None,
                1.0 => Some(Status::TimeLimit),
                _ => Some(Status::Interrupted),
            },
        })
    }

    /// A full Newton step from the u at which the laws were evaluated.
    fn step(&mut self, u: &mut [f64], forcing: f64) -> Outcome<KrylovReport, S::Error> {
        let clock = Clock::start();
        self.linearise(u);
        self.system.select(&self.changed.step()).map_err(Stop::System)?;
        self.times.select += clock.elapsed();
        // Prescribed changes are already in u: the remaining equations are evaluated at this u.
        self.system.mul(u, &mut self.other).map_err(Stop::System)?;
        for (k, v) in self.other.iter_mut().enumerate() {
            *v = self.load[k] - *v;
        }
        for (node, &at) in self.local.iter().zip(self.nodes.components) {
            let pressure_change = self.other[at] - node.force[0];
            for d in 0..=self.law.num_tangents() {
                self.other[at + d] = if node.prescribed[d].is_some() {
                    0.0
                } else {
                    self.other[at + d] - node.force[d] - node.constant[d] - node.coupling[d] * pressure_change
                };
            }
        }
        let progress = self.progress(self.iterations.last().map_or(1.0, |i| i.load));
        let (clock, left) = (Clock::start(), self.deadline.left());
        let (observe, early) = (&mut *self.observe, &mut self.early);
        let mut each = |krylov: usize| {
            if early.is_none() && left.is_some_and(|left| clock.elapsed() >= left) {
                *early = Some(Status::TimeLimit);
            } else if early.is_none() && observe(&ReducedProgress { krylov, ..progress }).is_break() {
                *early = Some(Status::Interrupted);
            }
            match early {
                Some(_) => ControlFlow::Break(()),
                None => ControlFlow::Continue(()),
            }
        };
        let (rest, direction) = (&self.other, &mut self.direction);
        let solved = self.system.solve_observed(rest, direction, forcing, &mut each);
        self.times.krylov += clock.elapsed();
        let outcome = solved.map_err(Stop::System)?;
        u.iter_mut().zip(&self.direction).for_each(|(u, d)| *u += d);
        Ok(outcome)
    }

    /// The matrix of the step; prescribed changes are added to u.
    fn linearise(&mut self, u: &mut [f64]) {
        self.changed.clear();
        for (node, &at) in self.local.iter().zip(self.nodes.components) {
            for (d, change) in node.prescribed.iter().enumerate() {
                if let Some(change) = change {
                    u[at + d] += change;
                }
            }
            self.changed.add(node, at, self.law.num_tangents());
        }
    }

    /// The largest step length from `from` towards u, by halving, for which the residual decreases; u is set to that point. 0 if there is
    /// none; u is then undefined.
    fn damp(&mut self, from: &[f64], image: Vec<f64>, u: &mut [f64], merit: f64) -> Outcome<f64, S::Error> {
        self.system.mul(u, &mut self.other).map_err(Stop::System)?;
        let step: Vec<f64> = u.iter().zip(from).map(|(u, v)| u - v).collect();
        let change: Vec<f64> = self.other.iter().zip(&image).map(|(b, a)| b - a).collect();
        let mut part = 1.0;
        let mut trial = image.clone();
        while part >= SHORTEST {
            for k in 0..u.len() {
                u[k] = from[k] + part * step[k];
                trial[k] = image[k] + part * change[k];
            }
            if self.judge(u, &trial, None)?.merit <= (1.0 - ARMIJO * part) * merit {
                return Ok(part);
            }
            part *= 0.5;
        }
        Ok(0.0)
    }
}
