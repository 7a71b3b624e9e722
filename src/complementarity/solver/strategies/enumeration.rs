//! Small affine problems: a pruned search of all active sets.

use std::cell::{Cell, RefCell};

use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::Plan;
use crate::complementarity::{AffineFunction, Mcp};
use crate::enumeration::{EnumerationOptions, all_solutions_until};
use crate::run::Status;

/// Affine problems up to this size are enumerated. `properties::arbitrary_small_problems_are_never_claimed_wrongly`.
const ENUMERABLE: usize = 24;

/// Iterations of Newton's method at an enumerated solution.
const POLISH: usize = 10;

impl Engine<'_> {
    pub(super) fn is_enumerable(&self) -> bool {
        self.affine && self.n() <= ENUMERABLE
    }

    /// The affine problem by its coefficients; `None` where they are not finite.
    pub(super) fn affine_problem(&mut self) -> Option<Mcp<AffineFunction>> {
        if !self.jacobian() {
            return None;
        }
        self.fresh = false;
        let w = &mut *self.work;
        w.trial.x.fill(0.0);
        self.function.value(&w.trial.x, &mut w.trial.f);
        self.report.evaluations += 1;
        let (matrix, q) = (w.lin.jac().clone(), w.trial.f.clone());
        Mcp::affine(matrix, q, self.lower.to_vec(), self.upper.to_vec()).ok()
    }

    /// Pruned search of all active sets of an affine problem.
    pub(super) fn enumerate(&mut self, most: u64) -> Status {
        let Some(problem) = self.affine_problem() else {
            return Status::Stalled;
        };
        let n = self.n();
        let left = self.options.max_time;
        let left = left.map(|t| t.saturating_sub(self.clock.elapsed()));
        // As many nodes as components count as an iteration.
        let iterations = self.options.max_iterations - self.report.iterations;
        let nodes = (iterations as u64).saturating_mul(n as u64);
        let options = EnumerationOptions::default()
            .with_max_nodes(most.min(nodes))
            .with_max_time(left);
        let now = self.between(self.strategy);
        let (observe, stopped) = (RefCell::new(&mut *self.observe), Cell::new(self.interrupted));
        let stop = || {
            // An observer that has asked to stop is not called again.
            stopped.set(stopped.get() || observe.borrow_mut()(&now).is_break());
            stopped.get()
        };
        let set = all_solutions_until(&problem, 0.0, &options, &stop);
        self.interrupted = stopped.get();
        let Ok(set) = set else {
            return Status::Stalled;
        };
        self.report.iterations += set.nodes as usize / n.max(1);
        let continua = set.continua.iter().flat_map(|c| c.ends.iter().chain([&c.point]));
        let points = set.solutions.iter().map(|s| &s.x).chain(continua);
        for y in points.filter(|y| !y.is_empty()) {
            self.work.here.x.copy_from_slice(&y[..n]);
            if self.descend(&Plan::newton(POLISH)) == Status::Solved {
                return Status::Solved;
            }
        }
        let none = set.solutions.is_empty() && set.continua.is_empty();
        match none && set.completeness.is_complete() {
            true => Status::NoSolution,
            false => Status::Stalled,
        }
    }
}
