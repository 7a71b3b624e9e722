//! Newton's method for smoothed equations: φ_μ(a, b) = a + b − √((a − b)² + 4μ²) in place of 2 min(a, b), μ → 0 (Chen and Harker 1993,
//! Kanzow 1996, Smale 1987), along the curve of their solutions.

use crate::complementarity::fischer::Gap;
use crate::complementarity::solver::McpStep;
use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::Plan;
use crate::run::Status;
use crate::sparse::{max_abs, norm};
use crate::tolerances::ARMIJO;

/// Smoothing. `strategies::each_strategy_solves_a_monotone_problem_alone`.
struct Weights {
    /// Largest μ at the start.
    first: f64,
    /// Factor by which μ falls once ‖Φ_μ‖ is below `centred` μ, and its final value.
    shrink: f64,
    centred: f64,
    least: f64,
    /// Shortest step.
    shortest: f64,
    /// Iterations of Newton's method at the end.
    newton: usize,
}

const WEIGHTS: Weights = Weights {
    first: 1.0,
    shrink: 0.2,
    centred: 2.0,
    least: 1e-10,
    shortest: 1e-6,
    newton: 30,
};

/// φ_μ and its derivatives, without cancellation where a and b are positive.
fn smoothed(a: f64, b: f64, mu: f64) -> (f64, f64, f64) {
    let root = (a - b).hypot(2.0 * mu);
    if root == 0.0 {
        return (a + b, 1.0, 1.0);
    }
    let value = match a > 0.0 && b > 0.0 {
        true => 4.0 * (a.min(b) * (a.max(b) / (a + b + root)) - mu * (mu / (a + b + root))),
        false => a + b - root,
    };
    let slope = (a - b) / root;
    (value, 1.0 - slope, 1.0 + slope)
}

/// Φ_μ of one component and its derivatives with respect to x and to f, depending on which bounds are finite, nested as by Billups (1995).
fn component(gap: Gap, f: f64, mu: f64) -> (f64, f64, f64) {
    let (inner, by_x, by_f) = match gap.above < f64::INFINITY {
        true => {
            let (v, by_gap, by_f) = smoothed(gap.above, -f, mu);
            (-0.5 * v, 0.5 * by_gap, 0.5 * by_f)
        }
        false => (f, 0.0, 1.0),
    };
    match gap.below < f64::INFINITY {
        true => {
            let (v, by_gap, by_inner) = smoothed(gap.below, inner, mu);
            (0.5 * v, 0.5 * (by_gap + by_inner * by_x), 0.5 * by_inner * by_f)
        }
        false => (inner, by_x, by_f),
    }
}

impl Engine<'_> {
    pub(super) fn smoothing(&mut self) -> Status {
        let plan = Plan::newton(WEIGHTS.newton);
        if !self.clamp_all() {
            return Status::Stalled;
        }
        self.equilibrate(&plan);
        self.merit(&plan);
        let mut mu = WEIGHTS
            .first
            .min(max_abs(&self.work.equations.phi))
            .max(WEIGHTS.least);
        for k in 0..self.options.max_attempt {
            let residual = self.residual();
            self.note_best(residual);
            if let Some(status) = self.exhausted() {
                return status;
            }
            if (k > 0 && !self.jacobian()) || mu < WEIGHTS.least || self.is_solution(residual) {
                break;
            }
            self.work.lin.rescale(0.0);
            self.merit(&plan);
            let size = self.linearise_smoothed(mu);
            if size <= WEIGHTS.centred * mu {
                mu *= WEIGHTS.shrink;
                continue;
            }
            self.report.factorisations += 1;
            if !self.work.system.solve() {
                break;
            }
            let Some(t) = self.shorten(&plan, mu, size) else {
                // No further decrease at this μ.
                mu *= WEIGHTS.shrink;
                continue;
            };
            self.record(residual, 0.5 * size * size, McpStep::Own, t);
            self.accept_trial();
        }
        self.descend(&plan)
    }

    /// Φ_μ at `work.here.x` and its Jacobian in `work.system`, the right-hand side in `work.system.d`; returns ‖Φ_μ‖.
    fn linearise_smoothed(&mut self, mu: f64) -> f64 {
        for i in 0..self.n() {
            let gap = self.gap(i, self.work.here.x[i]);
            let (phi, by_x, by_f) = component(gap, self.work.equations.scaled[i], mu);
            let w = &mut *self.work;
            (
                w.equations.phi[i],
                w.equations.by_x[i],
                w.equations.by_f[i],
                w.system.d[i],
            ) = (phi, by_x, by_f, -phi);
        }
        self.work.build_fischer(0.0);
        norm(&self.work.equations.phi)
    }

    /// The longest of the steps 1, ½, … along `work.system.d` with sufficient decrease of ‖Φ_μ‖, left in `work.trial.x`.
    fn shorten(&mut self, plan: &Plan, mu: f64, size: f64) -> Option<f64> {
        let mut t = 1.0;
        self.work.system.active.fill(0);
        while t >= WEIGHTS.shortest && !self.is_over_time() {
            self.make_trial(t, true);
            if self.step_length() > 0.0 && self.evaluate_trial() {
                let square = (0..self.n()).map(|i| {
                    let x = self.work.trial.x[i];
                    let f = self.scaled_value(plan, i, x, self.work.trial.f[i]);
                    component(self.gap(i, x), f, mu).0.powi(2)
                });
                if square.sum::<f64>().sqrt() <= (1.0 - ARMIJO * t) * size {
                    return Some(t);
                }
            }
            t *= 0.5;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothed_functions_have_their_derivatives_and_tend_to_the_minimum() {
        for (a, b) in [
            (1.0_f64, 2.0_f64),
            (0.3, 0.3),
            (-1.0, 4.0),
            (2.0, -3.0),
            (1e8, 1e-8),
            (-2.0, -1.0),
        ] {
            for mu in [1.0, 1e-2] {
                let h = 1e-6 * f64::max(1.0, a.abs().max(b.abs()));
                let (_, by_a, by_b) = smoothed(a, b, mu);
                let da = (smoothed(a + h, b, mu).0 - smoothed(a - h, b, mu).0) / (2.0 * h);
                let db = (smoothed(a, b + h, mu).0 - smoothed(a, b - h, mu).0) / (2.0 * h);
                assert!(
                    (by_a - da).abs() < 1e-4 && (by_b - db).abs() < 1e-4,
                    "{a} {b} {mu}"
                );
            }
            // |2 min − φ_μ| ≤ 2μ, and a few roundings of a and b.
            let rounding = 8.0 * f64::EPSILON * (a.abs() + b.abs());
            for mu in [1e-3, 1e-9] {
                assert!((smoothed(a, b, mu).0 - 2.0 * a.min(b)).abs() <= 2.0 * mu + rounding);
            }
        }
    }

    /// 2ab/(a + b + r) − 2μ²/(a + b + r) for arguments from 1e-4 to 1e13, where a + b − r has no digit.
    #[test]
    fn positive_arguments_do_not_cancel() {
        for (a, b) in [(1e-4, 1e13), (1e13, 1e-4), (0.25, 1e17)] {
            let small = f64::min(a, b);
            assert!(
                (smoothed(a, b, 1e-9).0 - 2.0 * small).abs() <= 1e-14 * small,
                "{a} {b}"
            );
        }
        let root = 5.0_f64.sqrt();
        assert!((smoothed(2.0, 1.0, 1.0).0 - (3.0 - root)).abs() < 1e-15);
        assert!((smoothed(-2.0, -3.0, 1.0).0 + 5.0 + root).abs() < 1e-15);
    }

    #[test]
    fn components_tend_to_the_natural_map() {
        for (below, above, f) in [
            (1.0, 2.0, 0.5),
            (1.0, 2.0, 3.0),
            (1.0, 2.0, -5.0),
            (1.0, f64::INFINITY, 2.0),
            (f64::INFINITY, 1.0, -2.0),
        ] {
            let (phi, _, _) = component(Gap { below, above }, f, 1e-12);
            // x − mid(l, u, x − f).
            let exact = f.min(below).max(-above);
            assert!((phi - exact).abs() < 1e-11, "{below} {above} {f}: {phi} {exact}");
        }
    }
}
