//! One step: its direction and its length.

use super::convergence::equilibrate;
use super::iterate::{Mode, Run};
use super::system::Evaluation;
use super::{Damping, Step};
use crate::linear::LinearError;
use crate::run::Status;
use crate::sparse::Matrix;
use crate::sparse::norm as norm2;

/// Largest number of conjugate-gradient steps for the step at a singular Jacobian.
const LEAST_SQUARES: usize = 200;

/// An accepted step.
pub(super) struct Advance {
    pub(super) damping: f64,
    pub(super) evaluation: Evaluation,
    pub(super) norm: f64,
}

impl Run<'_> {
    /// Puts the Newton direction into `d`; reports a singular Jacobian, for which there is none.
    pub(super) fn newton_direction(&mut self, jac: &Matrix) -> Result<Step, LinearError> {
        let leading = jac.leading_columns(self.n);
        if !self.work.analyzed {
            self.solver.analyze(leading.pattern)?;
            self.work.analyzed = true;
        }
        self.work.report.factorisations += 1;
        let solved = self.solver.factor(leading).and_then(|()| {
            for (d, r) in self.work.d.iter_mut().zip(&self.work.r) {
                *d = -r;
            }
            self.solver.solve_in_place(&mut self.work.d)
        });
        match solved {
            Ok(()) if self.mode == Mode::LeastIndex => Ok(Step::LeastIndex),
            Ok(()) => Ok(Step::Newton),
            Err(LinearError::Singular { .. } | LinearError::Inaccurate { .. }) => Ok(Step::Gradient),
            Err(e) => Err(e),
        }
    }

    /// The root of the merit function: ‖H‖ with its rows weighted.
    pub(super) fn merit(&self, r: &[f64]) -> f64 {
        if !self.weighted {
            return norm2(r);
        }
        let pairs = r.iter().zip(&self.work.weight);
        pairs.map(|(r, w)| (r * w).powi(2)).sum::<f64>().sqrt()
    }

    /// Puts into `d` the result of up to `steps` conjugate-gradient steps for min ‖W (H + ∇H d)‖² with the weights W (one step: steepest
    /// descent with the optimal length; many: the shortest least-squares solution, also of a singular system). Returns ‖∇Hᵀ W² H‖ and the
    /// share of ‖W H‖² by which the linear model decreases.
    fn descent_direction(&mut self, jac: &Matrix, steps: usize) -> (f64, f64) {
        let a = jac.leading_columns(self.n);
        let work = &mut *self.work;
        let (d, g, p, q, s, w) = (
            &mut work.d,
            &mut work.gradient,
            &mut work.conjugate,
            &mut work.size,
            &mut work.trial_r,
            &work.weight,
        );
        d.fill(0.0);
        for i in 0..self.n {
            s[i] = -w[i] * work.r[i];
            q[i] = w[i] * s[i];
        }
        let start = norm2(s);
        g.fill(0.0);
        a.mul_transpose_add(1.0, q, g);
        p.copy_from_slice(g);
        let first = norm2(g);
        let mut gradient = first;
        for _ in 0..steps {
            q.fill(0.0);
            a.mul_add(1.0, p, q);
            q.iter_mut().zip(w).for_each(|(q, w)| *q *= w);
            let curvature = norm2(q);
            let length = (gradient / curvature).powi(2);
            if !length.is_finite() {
                break;
            }
            for i in 0..self.n {
                d[i] += length * p[i];
                s[i] -= length * q[i];
                q[i] = w[i] * s[i];
            }
            g.fill(0.0);
            a.mul_transpose_add(1.0, q, g);
            let next = norm2(g);
            if next <= 1e-10 * first {
                break;
            }
            let beta = (next / gradient).powi(2);
            for (p, g) in p.iter_mut().zip(&*g) {
                *p = g + beta * *p;
            }
            gradient = next;
        }
        (first, 1.0 - (norm2(s) / start).powi(2))
    }

    /// Finds the next iterate and leaves it in `trial`, its residual in `trial_r`.
    pub(super) fn advance(&mut self, jac: &Matrix, x: &[f64], step: &mut Step) -> Result<Advance, Status> {
        let singular = *step == Step::Gradient;
        let never = self.options.damping == Damping::Never;
        if never || self.mode == Mode::LeastIndex {
            if singular {
                return Err(Status::Singular);
            }
            let shortest = if never { 1.0 } else { self.options.min_damping };
            let found = self.search(x, |_| f64::INFINITY, shortest);
            return found.ok_or_else(|| Status::evaluation_failure(&self.work.trial_r));
        }
        // Steps are shortened here only to return to the domain of H.
        if !singular
            && self.mode == Mode::Full
            && let Some(found) = self.search(x, |_| f64::INFINITY, self.options.min_damping)
        {
            return Ok(found);
        }
        if !self.weighted {
            let work = &mut *self.work;
            let (row, col, max) = (&mut work.weight, &mut work.trial[..self.n], &mut work.gradient);
            equilibrate(jac.leading_columns(self.n), row, col, max);
            self.weighted = true;
        }
        let norm = self.merit(&self.work.r);
        let (armijo, shortest) = (self.options.armijo, self.options.min_damping);
        if !singular && let Some(found) = self.search(x, |t| (1.0 - armijo * t) * norm, shortest) {
            return Ok(found);
        }
        *step = Step::Gradient;
        let mut gradient = 0.0;
        for steps in [LEAST_SQUARES.min(2 * self.n), 1] {
            if !singular && steps > 1 {
                continue;
            }
            let slope;
            (gradient, slope) = self.descent_direction(jac, steps);
            if slope > 4.0 * f64::EPSILON
                && let Some(found) = self.search(x, |t| (1.0 - armijo * t * slope) * norm, shortest)
            {
                return Ok(found);
            }
        }
        let flat = 1e-14 * norm * jac.leading_columns(self.n).norm_1();
        if gradient <= flat {
            return Err(Status::Stationary {
                gradient_norm: gradient,
            });
        }
        Err(Status::Stalled)
    }

    /// Halves the step until the residual is finite and at most `bound` of the step length.
    fn search(&mut self, x: &[f64], bound: impl Fn(f64) -> f64, shortest: f64) -> Option<Advance> {
        self.work.trial.copy_from_slice(x);
        let mut t = 1.0;
        while t >= shortest {
            for i in 0..self.n {
                self.work.trial[i] = x[i] + t * self.work.d[i];
            }
            let evaluation = self.system.evaluate(&self.work.trial, &mut self.work.trial_r);
            self.work.report.evaluations += 1;
            let norm = norm2(&self.work.trial_r);
            if norm.is_finite() && self.merit(&self.work.trial_r) <= bound(t) {
                return Some(Advance {
                    damping: t,
                    evaluation,
                    norm,
                });
            }
            t *= 0.5;
        }
        None
    }
}
