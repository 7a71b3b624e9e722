//! Proofs that an affine problem has no solution, which are cheap beside the strategies that follow where
//! there is none: whether its conditions contradict each other, whatever the active set, which is a linear
//! program; and a short search of active sets.

use crate::clock::Deadline;
use crate::complementarity::solver::McpStrategy;
use crate::complementarity::solver::engine::Engine;
use crate::enumeration::refutation;
use crate::run::Status;
use crate::sparse::max_abs;
use crate::tolerances::GIGABYTE;

/// Nodes of the short search for each component, and numbers that all of its tables may hold: each node
/// writes one with three rows for a component. `infeasible::stocks_that_run_out_are_refuted_at_once` holds
/// their order.
const NODES: usize = 10;

impl Engine<'_> {
    /// Decides affine problems of a size at which paths are followed, but above that at which all active sets
    /// are searched.
    pub(super) fn prove(&mut self) -> Option<Status> {
        let n = self.n();
        if !self.affine || n > self.options.max_path_size {
            return None;
        }
        if self.refute() {
            return Some(Status::NoSolution);
        }
        let searched = self.options.strategies.contains(&McpStrategy::Enumeration);
        if !searched || self.is_enumerable() {
            return self.exhausted();
        }
        self.restart_at_start();
        let nodes = (NODES * n).min(GIGABYTE / (3 * n * n));
        self.attempt(McpStrategy::Enumeration, |e| {
            e.enumerate(e.options.max_nodes.min(nodes as u64))
        })
    }

    /// Whether the linear program is proven to have no point; its certificate is then in the report.
    fn refute(&mut self) -> bool {
        let Some(problem) = self.affine_problem() else {
            return false;
        };
        let deadline = Deadline::of(self.clock, self.options.max_time);
        let Some(found) = refutation(&problem, 0.0, deadline) else {
            return false;
        };
        // The first form of each site is F; the others are the distances from bounds.
        let mut v = vec![0.0; self.n()];
        found
            .iter()
            .filter(|f| f.1 == 0)
            .for_each(|&(i, _, factor)| v[i] = factor);
        let largest = max_abs(&v);
        v.iter_mut().for_each(|v| *v /= largest);
        let finite = v.iter().all(|v| v.is_finite());
        if finite {
            self.report.certificate = v;
        }
        finite
    }
}
