//! The order of attempts, and what a solve reports in the end.

use super::engine::{Engine, Plan};
use super::{BoundState, Fallback, McpStatus, McpStrategy};
use crate::complementarity::Mcp;
use crate::enumeration::{EnumerationOptions, all_solutions};
use crate::sparse::max_abs;

/// Affine problems up to this size are searched by enumeration of active sets.
const ENUMERABLE: usize = 24;

impl Plan {
    pub(super) fn newton(max_iterations: usize) -> Self {
        Self {
            natural: true,
            lambda: 0.95,
            scaled: true,
            memory: 4,
            credit: 6,
            proximal: 0.0,
            loose: 0.0,
            max_iterations,
        }
    }

    fn fischer(max_iterations: usize) -> Self {
        Self {
            natural: false,
            lambda: 0.9,
            scaled: false,
            memory: 8,
            credit: 8,
            proximal: 0.0,
            loose: 0.0,
            max_iterations,
        }
    }

    fn proximal(epsilon: f64, max_iterations: usize) -> Self {
        Self {
            scaled: false,
            proximal: epsilon,
            loose: 1e-8,
            credit: 6,
            ..Self::newton(max_iterations)
        }
    }
}

impl Engine<'_> {
    /// Runs one attempt from `work.x` and books it; `Some` ends the solve.
    pub(super) fn attempt(
        &mut self,
        strategy: McpStrategy,
        run: impl FnOnce(&mut Self) -> McpStatus,
    ) -> Option<McpStatus> {
        self.strategy = strategy;
        self.attempt_best = f64::INFINITY;
        let before = self.report.iterations;
        let outcome = run(self);
        if outcome == McpStatus::Solved {
            return Some(outcome);
        }
        self.report.fallbacks.push(Fallback {
            strategy,
            outcome,
            residual: self.attempt_best,
            iterations: self.report.iterations - before,
        });
        match outcome {
            McpStatus::Infeasible => Some(outcome),
            _ => self.exhausted(),
        }
    }

    pub(super) fn restart_at_start(&mut self) {
        let w = &mut *self.work;
        w.x.copy_from_slice(&w.start);
    }

    pub(super) fn solve(&mut self, states: Option<&[BoundState]>) -> McpStatus {
        self.restart_at_start();
        if let Some(states) = states {
            for (i, s) in states.iter().enumerate() {
                let (active, x) = match s {
                    BoundState::Lower => (-1, self.lower[i]),
                    BoundState::Upper => (1, self.upper[i]),
                    BoundState::Interior => (0, self.work.x[i]),
                };
                self.work.active[i] = active;
                self.work.x[i] = x;
            }
        }
        if !self.evaluate() && !self.find_domain() {
            return McpStatus::EvaluationFailure {
                component: self.bad_component.unwrap_or(0),
            };
        }
        // The first attempt begins here.
        self.fresh = true;
        let limit = self.options.max_attempt;
        let ended = self.attempt(McpStrategy::Newton, |e| {
            if e.affine {
                let status = e.affine_newton(&Plan::newton(limit));
                if status != McpStatus::Stalled {
                    return status;
                }
                e.restart_at_start();
            }
            e.descend(&Plan::newton(limit))
        });
        if let Some(status) = ended {
            return status;
        }
        if !self.options.fallbacks {
            return self.verdict();
        }
        self.restart_at_start();
        if let Some(status) = self.attempt(McpStrategy::FischerBurmeister, |e| {
            e.descend(&Plan::fischer(limit))
        }) {
            return status;
        }
        self.restart_at_start();
        if let Some(status) = self.attempt(McpStrategy::Proximal, Self::proximal_points) {
            return status;
        }
        let paths = self.n() <= self.options.max_path_size;
        if paths {
            self.restart_at_start();
            if let Some(status) = self.attempt(McpStrategy::JosephyNewton, Self::josephy) {
                return status;
            }
            self.restart_at_start();
            if let Some(status) = self.attempt(McpStrategy::Homotopy, Self::homotopy) {
                return status;
            }
        }
        if self.affine && self.n() <= ENUMERABLE {
            self.restart_at_start();
            if let Some(status) = self.attempt(McpStrategy::Enumeration, Self::enumerate) {
                return status;
            }
        }
        for k in 0..self.options.restarts {
            for path in [false, true] {
                if let Some(status) = self.exhausted() {
                    return status;
                }
                if path && (k >= 6 || self.n() > self.options.max_path_size / 3) {
                    continue;
                }
                self.candidate(k);
                if !self.evaluate() {
                    continue;
                }
                let ended = self.attempt(McpStrategy::Restart, |e| {
                    if path {
                        return e.homotopy();
                    }
                    let status = e.descend(&Plan::newton(limit / 2));
                    if status == McpStatus::Solved {
                        return status;
                    }
                    e.candidate(k);
                    e.descend(&Plan::fischer(limit / 2))
                });
                if let Some(status) = ended {
                    return status;
                }
            }
        }
        self.verdict()
    }

    /// The reason of the attempt that came nearest.
    fn verdict(&self) -> McpStatus {
        if self.asymptotic {
            return McpStatus::Unbounded;
        }
        let nearest = self
            .report
            .fallbacks
            .iter()
            .min_by(|a, b| a.residual.total_cmp(&b.residual));
        match nearest.map(|f| f.outcome) {
            Some(McpStatus::IterationLimit) | None => McpStatus::Stalled,
            Some(outcome) => outcome,
        }
    }

    /// Moves `work.x` to a point near the start at which F is finite, and makes it the start.
    fn find_domain(&mut self) -> bool {
        let found = (0..40).any(|k| {
            if k < 10 {
                let w = &mut *self.work;
                for i in 0..w.n {
                    let h = [1e-6, 1e-4, 1e-2, 0.1, 1.0][k % 5];
                    let (l, u, x) = (self.lower[i], self.upper[i], w.start[i]);
                    // Away from a bound, or towards positive numbers: domains of logarithms and powers.
                    let y = match (x - h < l, x + h > u) {
                        (true, true) => 0.5 * (l + u),
                        (true, false) => x + h,
                        (false, true) => x - h,
                        (false, false) if k >= 5 && x <= 0.0 => -x + h,
                        (false, false) => x,
                    };
                    w.x[i] = y.max(l).min(u);
                }
            } else {
                self.candidate(k - 10);
            }
            self.evaluate()
        });
        if found {
            let w = &mut *self.work;
            w.start.copy_from_slice(&w.x);
        }
        found
    }

    /// The k-th of the perturbed starts, into `work.x`.
    pub(super) fn candidate(&mut self, k: usize) {
        // Weyl sequence: deterministic, spread evenly, different in each component.
        let random = |i: usize| {
            ((i + 1) as f64 * 0.618_033_988_749_895 + (k + 1) as f64 * 0.414_213_562_373_095).fract()
        };
        let w = &mut *self.work;
        for i in 0..w.n {
            let (l, u, x) = (self.lower[i], self.upper[i], w.start[i]);
            let r = random(i);
            let width = [1.0, 0.1, 10.0, 1.0, 100.0, 10.0, 0.01, 3.0, 30.0, 1e3, 0.3, 1.0][k % 12];
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
            w.x[i] = inner.max(l).min(u);
        }
    }

    /// Proximal points with ε → 0, the centre moving along.
    fn proximal_points(&mut self) -> McpStatus {
        if !self.evaluate() || !self.jacobian() {
            return McpStatus::Stalled;
        }
        let size = max_abs(self.work.lin.jac().values()).clamp(1e-6, 1e6);
        let mut epsilon = size;
        let mut outcome = McpStatus::Stalled;
        let mut last = f64::INFINITY;
        let (rounds, shrink, least) = if self.affine {
            (40, 0.1, 1e-7)
        } else {
            (24, 0.2, 1e-9)
        };
        for k in 0..rounds {
            let w = &mut *self.work;
            w.centre.copy_from_slice(&w.x);
            let plan = Plan::proximal(epsilon, 40);
            outcome = McpStatus::Stalled;
            if self.affine {
                outcome = self.affine_newton(&plan);
                if outcome != McpStatus::Solved {
                    let w = &mut *self.work;
                    w.x.copy_from_slice(&w.centre);
                    if self.affine_path(&plan) {
                        outcome = McpStatus::Solved;
                    }
                }
            }
            if outcome != McpStatus::Solved {
                outcome = self.descend(&plan);
            }
            if let Some(status) = self.exhausted() {
                return status;
            }
            if outcome != McpStatus::Solved {
                // Too little regularisation, or a centre too far away.
                let w = &mut *self.work;
                w.x.copy_from_slice(&w.centre);
                epsilon *= 30.0;
                if epsilon > 1e4 * size {
                    return outcome;
                }
                continue;
            }
            let residual = self.residual();
            if self.affine && self.certify() {
                return McpStatus::Infeasible;
            }
            if residual <= 0.1 * last || k % 4 == 3 {
                let w = &mut *self.work;
                w.centre.copy_from_slice(&w.x);
                if self.descend(&Plan::newton(15)) == McpStatus::Solved {
                    return McpStatus::Solved;
                }
                let w = &mut *self.work;
                w.x.copy_from_slice(&w.centre);
            }
            last = last.min(residual);
            epsilon = (epsilon * shrink).max(least * size);
        }
        match outcome {
            McpStatus::Solved => McpStatus::Stalled,
            other => other,
        }
    }

    /// Pruned search of all active sets of a small affine problem.
    fn enumerate(&mut self) -> McpStatus {
        if !self.jacobian() {
            return McpStatus::Stalled;
        }
        let n = self.n();
        let w = &mut *self.work;
        w.trial_x.fill(0.0);
        self.function.value(&w.trial_x, &mut w.trial_f);
        self.report.evaluations += 1;
        let problem = Mcp::affine(
            w.lin.jac().clone(),
            w.trial_f.clone(),
            self.lower.to_vec(),
            self.upper.to_vec(),
        );
        let left = self.options.max_time;
        let left = left.map(|t| t.saturating_sub(self.clock.elapsed()));
        let options = EnumerationOptions::default()
            .with_max_nodes(self.options.max_nodes)
            .with_max_time(left);
        let set = match problem.map(|p| all_solutions(&p, 0.0, &options)) {
            Ok(Ok(set)) => set,
            _ => return McpStatus::Stalled,
        };
        self.report.iterations += set.nodes as usize / n.max(1);
        let ends = set.continua.iter().flat_map(|c| &c.ends);
        for y in set.solutions.iter().map(|s| &s.x).chain(ends) {
            self.work.x.copy_from_slice(&y[..n]);
            if self.descend(&Plan::newton(10)) == McpStatus::Solved {
                return McpStatus::Solved;
            }
        }
        let none = set.solutions.is_empty() && set.continua.is_empty();
        match none && set.completeness.is_complete() {
            true => McpStatus::Infeasible,
            false => McpStatus::Stalled,
        }
    }

    /// Whether x − centre proves an affine problem infeasible: v along no finite bound, so that vᵀF ≥ 0 at solutions, and
    /// sup (Mᵀv)ᵀx + qᵀv < 0 over the bounds.
    fn certify(&mut self) -> bool {
        let n = self.n();
        let mut v: Vec<f64> = (0..n)
            .map(|i| {
                let d = self.work.x[i] - self.work.centre[i];
                match (self.lower[i].is_finite(), self.upper[i].is_finite()) {
                    (true, true) => 0.0,
                    (true, false) => d.max(0.0),
                    (false, true) => d.min(0.0),
                    (false, false) => d,
                }
            })
            .collect();
        let norm = max_abs(&v);
        if norm <= 1e-6 * (1.0 + max_abs(&self.work.x)) || norm.is_nan() {
            return false;
        }
        for v in &mut v {
            *v /= norm;
            if v.abs() < 1e-12 {
                *v = 0.0;
            }
        }
        if !self.jacobian() {
            return false;
        }
        let w = &mut *self.work;
        // q = F(0), as M x + q would lose it far out.
        w.trial_x.fill(0.0);
        self.function.value(&w.trial_x, &mut w.trial_f);
        self.report.evaluations += 1;
        let jac = w.lin.jac();
        let mut sum: f64 = w.trial_f.iter().zip(&v).map(|(q, v)| q * v).sum();
        let mut size: f64 = w.trial_f.iter().zip(&v).map(|(q, v)| (q * v).abs()).sum();
        let pattern = jac.pattern();
        for j in 0..n {
            let span = pattern.col_ptr()[j]..pattern.col_ptr()[j + 1];
            let terms = pattern.row_idx()[span.clone()].iter().zip(&jac.values()[span]);
            let (s, terms) = terms.fold((0.0, 0.0), |(s, t), (&i, a)| (s + a * v[i], t + (a * v[i]).abs()));
            let bound = if s > 0.0 { self.upper[j] } else { self.lower[j] };
            if bound.is_finite() {
                sum += s * bound;
                size += terms * bound.abs();
            } else if s.abs() > 1e-10 * terms {
                return false;
            }
        }
        let proven = sum < -1e-7 * size;
        if proven {
            self.report.certificate = v;
        }
        proven
    }

    /// What is said in the end of the point nearest to a solution, where no strategy reached the tolerance.
    fn last_word(&mut self, status: McpStatus) -> McpStatus {
        let proven = matches!(status, McpStatus::Infeasible | McpStatus::Interrupted);
        if proven || self.least_error == f64::INFINITY {
            return status;
        }
        let w = &mut *self.work;
        w.trial_x.copy_from_slice(&w.x);
        w.x.copy_from_slice(&w.nearest);
        if self.evaluate() && self.jacobian() {
            let measure = self.measure();
            if self.accepts(measure, self.options.acceptable.max(self.options.tolerance)) {
                return McpStatus::Solved;
            }
            if measure.is_rounding() {
                return McpStatus::AtRounding;
            }
        }
        let w = &mut *self.work;
        w.x.copy_from_slice(&w.trial_x);
        status
    }

    /// Writes the best point to `x` and completes the report.
    pub(super) fn finish(&mut self, mut status: McpStatus, x: &mut [f64]) {
        self.fresh = false;
        if status != McpStatus::Solved {
            let w = &mut *self.work;
            match self.best < f64::INFINITY {
                true => w.x.copy_from_slice(&w.best),
                false => w.x.copy_from_slice(&w.start),
            }
            status = self.last_word(status);
        }
        x.copy_from_slice(&self.work.x);
        // Evaluated at what is returned, whatever was known before.
        let finite = self.evaluate();
        if status != McpStatus::Solved {
            self.report.error = f64::NAN;
            if finite && self.jacobian() {
                self.measure();
            }
        }
        self.report.status = status;
        self.report.residual = self.residual();
        self.report.strategy = self.strategy;
        let mut complementarity = 0.0_f64;
        let mut feasibility = 0.0_f64;
        for i in 0..x.len() {
            let (l, u, f) = (self.lower[i], self.upper[i], self.work.f[i]);
            feasibility = feasibility.max(l - x[i]).max(x[i] - u);
            let gap = if f > 0.0 { x[i] - l } else { u - x[i] };
            complementarity = complementarity.max(gap.abs().min(f.abs()));
            self.report.states.push(match (x[i] == l, x[i] == u) {
                (true, _) if f >= 0.0 || l == u => BoundState::Lower,
                (_, true) if f <= 0.0 => BoundState::Upper,
                _ => BoundState::Interior,
            });
        }
        self.report.feasibility = feasibility;
        self.report.complementarity = if finite { complementarity } else { f64::NAN };
    }
}
