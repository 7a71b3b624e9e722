//! Whether a point is a solution.

use super::engine::Engine;
use super::plan::Plan;
use crate::complementarity::problem::natural;
use crate::judge::{Columns, Point, Verdict};
use crate::run::Status;
use crate::sparse::max_abs;
use crate::tolerances::HALF_DIGITS;

/// Part of x by which another point differs where derivatives are compared.
const BESIDE: f64 = 1.0 / 1024.0;

impl Engine<'_> {
    /// The verdict on `work.here.x`, where F and ∇F have just been evaluated.
    pub(super) fn measure(&mut self, tolerance: f64) -> Verdict {
        let w = &mut *self.work;
        let point = Point {
            x: &w.here.x,
            f: &w.here.f,
            jac: Columns::Long(w.lin.jac().as_ref()),
            rest: self.affine.then_some(w.constants.as_slice()),
            start: &w.start,
            typical: &[],
            sizes: None,
            lower: self.lower,
            upper: self.upper,
        };
        let mut verdict = w
            .judge
            .verdict_with(&point, tolerance, tolerance.min(self.options.tolerance));
        if !self.affine && !self.is_straight_nearby() {
            verdict.error = verdict.strict;
        }
        self.report.error = verdict.error;
        verdict
    }

    /// Whether the judged point, where F and ∇F have just been evaluated, is a solution. Where iterates of a curved F went to infinity, a
    /// flat row is one that has underflowed; near a singularity terms are large at x only; and far out only straight rows are determined
    /// by a regular ∇F. What is hidden has to be within the tolerance of the options even where a larger error is acceptable.
    pub(super) fn accepts(&mut self, verdict: Verdict, tolerance: f64) -> bool {
        verdict.is_solved(tolerance)
            && verdict.hidden <= self.options.tolerance
            && (self.affine
                || !(verdict.flat && self.asymptotic)
                    && self.terms_last(2.0 * verdict.error)
                    && (!verdict.needs_straight(tolerance) || self.is_straight()))
    }

    /// Whether rows that vanish with all their terms have the same derivatives a little inside.
    fn is_straight_nearby(&mut self) -> bool {
        let bounds = self.lower.iter().zip(self.upper);
        let w = &mut *self.work;
        let rows = w.judge.homogeneous_rows();
        let inside = |(&x, (&l, &u)): (&f64, (&f64, &f64))| (x - BESIDE * x).max(l).min(u);
        rows.is_empty() || {
            self.report.jacobians += 1;
            let there = w.here.x.iter().zip(bounds).map(inside);
            w.lin.is_same_at(self.function, there, rows)
        }
    }

    /// Whether the rows that have to be straight have the same derivatives at the start, or, from there, a little inside.
    fn is_straight(&mut self) -> bool {
        let bounds = self.lower.iter().zip(self.upper);
        let w = &mut *self.work;
        let moved = w.start != w.here.x;
        let inside = |((&s, &x), (&l, &u)): ((&f64, &f64), (&f64, &f64))| match moved {
            true => s,
            false => (x - BESIDE * x).max(l).min(u),
        };
        let there = w.start.iter().zip(&w.here.x).zip(bounds).map(inside);
        self.report.jacobians += 1;
        w.lin.is_same_at(self.function, there, w.judge.distant_rows())
    }

    /// Whether the terms of rows that count as solved only by the size of their terms stay the same, up to a factor of two, when the
    /// components of x change by the relative amount `part`, on at least one side of x.
    fn terms_last(&mut self, part: f64) -> bool {
        [part, -part].into_iter().any(|part| {
            let bounds = self.lower.iter().zip(self.upper);
            let beside = |(&x, (&l, &u)): (&f64, (&f64, &f64))| (x + part * x).max(l).min(u);
            let w = &mut *self.work;
            let x = w.here.x.iter().zip(bounds).map(beside);
            if x.clone().eq(w.here.x.iter().copied()) {
                return true;
            }
            self.report.jacobians += 1;
            let open = |i: usize| {
                let (x, f) = (w.here.x[i], w.here.f[i]);
                f != 0.0 && !(x == self.lower[i] && f > 0.0) && !(x == self.upper[i] && f < 0.0)
            };
            w.lin
                .terms_beside(self.function, &w.here.x, x)
                .iter()
                .enumerate()
                .all(|(i, [here, there])| !open(i) || (0.5 * here..=2.0 * here).contains(there))
        })
    }

    /// Whether `work.here.x` is a solution that need not be improved: where the natural residual is still above the tolerance further steps
    /// are worthwhile.
    pub(super) fn is_solution(&mut self, residual: f64) -> bool {
        let verdict = self.measure(self.options.tolerance);
        self.note_nearest(verdict);
        self.open = verdict.is_open();
        self.accepts(verdict, self.options.tolerance)
            && (residual <= self.options.tolerance || verdict.is_rounding())
    }

    /// Moves `work.here.x` into the bounds and evaluates F and ∇F there; `false` where they are not finite.
    pub(super) fn clamp_all(&mut self) -> bool {
        for i in 0..self.n() {
            self.work.here.x[i] = self.clamp(i, self.work.here.x[i]);
        }
        self.evaluate() && self.jacobian()
    }

    /// Moves components of `work.here.x` near zeros or bounds to these; if the result is a solution it becomes `work.here.x`. Where all
    /// terms of a row vanish at a solution, its residual never gets small relative to them.
    pub(super) fn round_off(&mut self) -> bool {
        let n = self.n();
        let near = HALF_DIGITS * (1.0 + max_abs(&self.work.here.x));
        let mut moved = false;
        self.work.trial.x.copy_from_slice(&self.work.here.x);
        for i in 0..n {
            let (l, u, x) = (self.lower[i], self.upper[i], self.work.here.x[i]);
            let to = match () {
                () if (x - l).abs() <= near => l,
                () if (x - u).abs() <= near => u,
                () if x.abs() <= near => self.clamp(i, 0.0),
                () => continue,
            };
            moved |= to != x;
            self.work.trial.x[i] = to;
        }
        if !moved || !self.evaluate_trial() {
            return false;
        }
        self.accept_trial();
        let residual = self.residual();
        if self.jacobian() && self.is_solution(residual) {
            self.note_best(residual);
            return true;
        }
        self.accept_trial();
        self.jacobian();
        false
    }

    pub(super) fn is_inside(&self) -> bool {
        (0..self.n()).all(|i| self.work.here.x[i] == self.clamp(i, self.work.here.x[i]))
    }

    /// Natural residual of the proximal problem, scaled.
    pub(super) fn proximal_residual(&self) -> f64 {
        let w = &*self.work;
        (0..w.n).fold(0.0, |m: f64, i| {
            let c = w.lin.col()[i];
            let r = natural(
                w.here.x[i] / c,
                self.lower[i] / c,
                self.upper[i] / c,
                w.equations.scaled[i],
            );
            m.max(r.abs())
        })
    }

    /// No step helps: a solution, a stationary point, or neither.
    pub(super) fn settle(&mut self, plan: &Plan, psi: f64) -> Status {
        if plan.proximal == 0.0 && self.is_inside() {
            let verdict = self.measure(self.options.tolerance);
            if self.accepts(verdict, self.options.tolerance) {
                return Status::Solved;
            }
            if self.round_off() {
                return Status::Solved;
            }
        }
        if plan.natural {
            self.prepare_fischer(plan, 0.0);
        }
        let w = &*self.work;
        let projected = (0..w.n).fold(0.0, |m: f64, i| {
            let x = w.here.x[i] / w.lin.col()[i];
            let y = (x - w.equations.gradient[i])
                .max(self.lower[i] / w.lin.col()[i])
                .min(self.upper[i] / w.lin.col()[i]);
            m.max((x - y).abs())
        });
        if projected <= 1e-4 * (2.0 * psi).sqrt() {
            Status::Stationary {
                gradient_norm: projected,
            }
        } else {
            Status::Stalled
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parts::Parts;
    use super::*;
    use crate::clock::Clock;
    use crate::complementarity::solver::work::Work;
    use crate::complementarity::{Mcp, McpOptions, McpReport};
    use crate::sparse::Matrix;
    use std::ops::ControlFlow;

    /// x ≥ 0 with F = x − 1 beside its bound, where F pushes x off it: next to x there is no solution, although moving there changes next
    /// to nothing in the row.
    #[test]
    fn a_point_beside_a_bound_is_judged_at_the_bound() {
        let problem = Mcp::affine(Matrix::identity(1), vec![-1.0], vec![0.0], vec![f64::INFINITY]).unwrap();
        let options = McpOptions::default();
        for (x, is_solution) in [
            (-1e-17, false),
            (-1e-15, false),
            (1.0, true),
            (1.0 + f64::EPSILON, true),
        ] {
            for settle in [false, true] {
                let mut work = Work::new(problem.jacobian_pattern()).unwrap();
                let (mut report, mut observe) = (McpReport::default(), |_: &_| ControlFlow::Continue(()));
                let mut engine = Engine::new(
                    &Parts::of(&problem),
                    &options,
                    &mut work,
                    &mut report,
                    &mut observe,
                    Clock::start(),
                );
                engine.work.here.x[0] = x;
                assert!(engine.evaluate() && engine.jacobian());
                let plan = Plan::newton(10);
                engine.equilibrate(&plan);
                let found = if settle {
                    let psi = engine.merit(&plan);
                    engine.settle(&plan, psi) == Status::Solved
                } else {
                    let residual = engine.residual();
                    engine.arrives(residual, false)
                };
                assert_eq!(found, is_solution, "{x:e}");
            }
        }
    }
}
