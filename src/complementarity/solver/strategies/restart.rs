//! Perturbed starts.

use crate::complementarity::solver::McpStrategy;
use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::{Plan, spread};
use crate::run::Status;

/// Half widths of the perturbed starts, used cyclically. `corpus::more_problems_of_the_literature_from_far_starts`.
const RESTART_WIDTHS: [f64; 12] = [1.0, 0.1, 10.0, 1.0, 100.0, 10.0, 0.01, 3.0, 30.0, 1e3, 0.3, 1.0];

/// Perturbed starts from which paths are followed, too. `corpus::more_problems_of_the_literature_from_far_starts`.
const RESTART_PATHS: usize = 6;

/// Steps into the domain of F. `defects::logarithm_with_a_free_variable_is_not_solved_outside_its_domain`.
const DOMAIN_STEPS: [f64; 5] = [1e-6, 1e-4, 1e-2, 0.1, 1.0];

/// Numbers in [0, 1), different for each perturbed start: as `spread`, with another irrational number.
fn spread_runs(k: usize) -> f64 {
    const SILVER: f64 = 0.414_213_562_373_095;
    ((k + 1) as f64 * SILVER).fract()
}

impl Engine<'_> {
    /// Newton's method from perturbed starts, and paths from the first of them.
    pub(super) fn restarts(&mut self) -> Option<Status> {
        let limit = self.options.max_attempt / 2;
        for k in 0..self.options.restarts {
            for path in [false, true] {
                if let Some(status) = self.exhausted() {
                    return Some(status);
                }
                if path && (k >= RESTART_PATHS || self.n() > self.options.max_path_size / 3) {
                    continue;
                }
                self.candidate(k);
                if !self.evaluate() {
                    self.tell(McpStrategy::Restart);
                    continue;
                }
                let ended = self.attempt(McpStrategy::Restart, |e| {
                    if path {
                        return e.homotopy();
                    }
                    let status = e.descend(&Plan::newton(limit));
                    if status == Status::Solved {
                        return status;
                    }
                    e.candidate(k);
                    e.descend(&Plan::fischer(limit))
                });
                if ended.is_some() {
                    return ended;
                }
            }
        }
        None
    }

    /// Moves `work.here.x` to a point near the start at which F is finite, and makes it the start.
    pub(super) fn find_domain(&mut self) -> bool {
        let found = (0..40).any(|k| {
            if k < 10 {
                let w = &mut *self.work;
                for i in 0..w.n {
                    let h = DOMAIN_STEPS[k % 5];
                    let (l, u, x) = (self.lower[i], self.upper[i], w.start[i]);
                    // Away from a bound, or towards positive numbers: domains of logarithms and powers.
                    let y = match (x - h < l, x + h > u) {
                        (true, true) => 0.5 * (l + u),
                        (true, false) => x + h,
                        (false, true) => x - h,
                        (false, false) if k >= 5 && x <= 0.0 => -x + h,
                        (false, false) => x,
                    };
                    w.here.x[i] = y.max(l).min(u);
                }
            } else {
                self.candidate(k - 10);
            }
            self.evaluate()
        });
        if found {
            let w = &mut *self.work;
            w.start.copy_from_slice(&w.here.x);
        }
        found
    }

    /// The k-th of the perturbed starts, into `work.here.x`.
    fn candidate(&mut self, k: usize) {
        self.fresh = false;
        let w = &mut *self.work;
        for i in 0..w.n {
            let (l, u, x) = (self.lower[i], self.upper[i], w.start[i]);
            let r = (spread(i) + spread_runs(k)).fract();
            let width = RESTART_WIDTHS[k % 12];
            let moved = match k {
                0 => 1.0,
                // About the start, or out from the bounds.
                _ if k % 2 == 1 => x + width * (2.0 * r - 1.0),
                _ => match (l.is_finite(), u.is_finite()) {
                    (true, _) => l + width * (0.1 + r),
                    (false, true) => u - width * (0.1 + r),
                    (false, false) => width * (2.0 * r - 1.0),
                },
            };
            let inner = match (l.is_finite(), u.is_finite()) {
                (true, true) if moved <= l || moved >= u => l + (u - l) * r,
                (true, false) if moved <= l => l + (l - moved).max(1e-3 * r),
                (false, true) if moved >= u => u - (moved - u).max(1e-3 * r),
                _ => moved,
            };
            w.here.x[i] = inner.max(l).min(u);
        }
    }
}
