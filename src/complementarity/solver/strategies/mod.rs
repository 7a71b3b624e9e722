//! The strategies. Each has a file here, with its numbers, and in this file a variant of [`McpStrategy`] and a line of the table.

mod enumeration;
mod fischer;
mod homotopy;
mod josephy;
mod newton;
mod path;
mod proximal;
mod refutation;
mod restart;
mod smoothing;

use super::engine::Engine;
use super::{BoundState, Fallback, McpStrategy};
use crate::run::Status;

/// A line of the table.
struct Strategy {
    is: McpStrategy,
    /// Whether the strategy applies to the problem.
    suits: fn(&Engine<'_>) -> bool,
    run: Run,
}

enum Run {
    /// One attempt, from the start in `work.here.x`.
    Attempt(fn(&mut Engine<'_>) -> Status),
    /// Several attempts, which record themselves.
    Attempts(fn(&mut Engine<'_>) -> Option<Status>),
}

impl Strategy {
    const fn attempt(is: McpStrategy, run: fn(&mut Engine<'_>) -> Status) -> Self {
        Self {
            is,
            suits: |_| true,
            run: Run::Attempt(run),
        }
    }

    const fn only_if(self, suits: fn(&Engine<'_>) -> bool) -> Self {
        Self { suits, ..self }
    }
}

/// How each strategy is run, and when.
static TABLE: &[Strategy] = &[
    Strategy::attempt(McpStrategy::Newton, |e| e.newton()),
    Strategy::attempt(McpStrategy::FischerBurmeister, |e| e.fischer()),
    Strategy::attempt(McpStrategy::Proximal, |e| e.proximal_points()),
    Strategy::attempt(McpStrategy::JosephyNewton, |e| e.josephy()).only_if(|e| e.has_affine_paths()),
    Strategy::attempt(McpStrategy::Homotopy, |e| e.homotopy()).only_if(|e| e.has_paths()),
    Strategy::attempt(McpStrategy::Enumeration, |e| e.enumerate(e.options.max_nodes))
        .only_if(|e| e.is_enumerable()),
    Strategy::attempt(McpStrategy::Smoothing, |e| e.smoothing()),
    Strategy {
        is: McpStrategy::Restart,
        suits: |_| true,
        run: Run::Attempts(|e| e.restarts()),
    },
];

/// By how much piecewise linear paths of affine problems may be larger than others.
const AFFINE: usize = 4;

/// Strategies that are tried before a proof that there is no solution: those that take no longer than it.
const BEFORE_PROOF: usize = 2;

impl Engine<'_> {
    /// Tries one strategy after the other.
    pub(super) fn solve(&mut self, states: Option<&[BoundState]>) -> Status {
        self.restart_at_start();
        self.take_states(states.unwrap_or_default());
        if !self.evaluate() && !self.find_domain() {
            return Status::EvaluationFailure {
                component: self.bad_component.unwrap_or(0),
            };
        }
        // The first attempt begins here.
        self.fresh = true;
        let most = if self.options.fallbacks { usize::MAX } else { 1 };
        let mut tried = 0;
        for (k, wanted) in self.options.strategies.iter().take(most).enumerate() {
            let Some(strategy) = TABLE.iter().find(|s| s.is == *wanted && (s.suits)(self)) else {
                continue;
            };
            if k > 0 {
                self.restart_at_start();
            }
            let ended = match strategy.run {
                Run::Attempt(run) => self.attempt(strategy.is, run),
                Run::Attempts(run) => run(self),
            };
            if let Some(status) = ended {
                return status;
            }
            tried += 1;
            if tried == BEFORE_PROOF
                && let Some(status) = self.prove()
            {
                return status;
            }
        }
        self.verdict()
    }

    fn take_states(&mut self, states: &[BoundState]) {
        for (i, s) in states.iter().enumerate() {
            let (active, x) = match s {
                BoundState::Lower => (-1, self.lower[i]),
                BoundState::Upper => (1, self.upper[i]),
                BoundState::Interior => (0, self.work.here.x[i]),
            };
            self.work.system.active[i] = active;
            self.work.here.x[i] = x;
        }
    }

    /// Whether paths are followed at this size.
    fn has_paths(&self) -> bool {
        self.n() <= self.options.max_path_size
    }

    /// Whether piecewise linear paths are followed at this size: where F is affine one of them may be the whole solve, and at kinks the
    /// factors are updated for the rows that change.
    fn has_affine_paths(&self) -> bool {
        let larger = if self.function.is_affine() { AFFINE } else { 1 };
        self.n() <= self.options.max_path_size.saturating_mul(larger)
    }

    /// Runs one attempt from `work.here.x` and records it; `Some` ends the solve.
    fn attempt(&mut self, strategy: McpStrategy, run: impl FnOnce(&mut Self) -> Status) -> Option<Status> {
        self.strategy = strategy;
        self.attempt_best = f64::INFINITY;
        let before = self.report.iterations;
        let outcome = run(self);
        if outcome == Status::Solved {
            return Some(outcome);
        }
        self.report.fallbacks.push(Fallback {
            strategy,
            outcome,
            residual: self.attempt_best,
            iterations: self.report.iterations - before,
        });
        match outcome {
            Status::NoSolution => Some(outcome),
            _ => self.exhausted(),
        }
    }

    fn restart_at_start(&mut self) {
        let w = &mut *self.work;
        w.here.x.copy_from_slice(&w.start);
    }
}
