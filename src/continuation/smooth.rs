//! Smooth branch points to full accuracy.

use super::ContinuationError;
use super::engine::{Curve, MAX_DENSE};
use super::locate::Monitor;
use crate::linear::{DenseLu, LinearSolver, null_space};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth};
use crate::sparse::{Matrix, Pattern};
use crate::sparse::{distance, norm};

/// Distance to a facet, relative to 1 + ‖x‖, up to which a curve that is stuck is taken to have crept up to it.
const CREEP: f64 = 1e-6;

impl Curve<'_> {
    /// Moves `here` onto the branch point near it, where that can be found to full accuracy.
    pub(super) fn polish_branch_point(&mut self) -> Result<(), ContinuationError> {
        let guess = self.here.x.clone();
        let reach = 1e-2 * (self.h + self.options.min_step);
        if let Some(x) = self.branch_point_near(&guess, reach)? {
            self.here.x = x;
            self.map.test_functions(&self.here.x, &mut self.here.theta);
        }
        Ok(())
    }

    /// The branch point of the followed selection within `reach` of `guess`, by Newton's method on the extended system of a
    /// simple branch point (Griewank–Reddien 1984): H(x) + β w = 0, ∇H(x)ᵀ w = 0, wᵀw = 1, which is regular there. Anything
    /// that solves with ∇H stops at the square root of the rounding unit. Dense: `None` for large problems.
    fn branch_point_near(
        &mut self,
        guess: &[f64],
        reach: f64,
    ) -> Result<Option<Vec<f64>>, ContinuationError> {
        let (n, m) = (self.map.num_residuals(), self.map.num_vars());
        if n > MAX_DENSE {
            return Ok(None);
        }
        self.corrector.assemble(&self.map, &self.selection, guess)?;
        let mut jac = self.corrector.jacobian().clone();
        let kernels = null_space(&jac, 1.0).map_err(PiecewiseError::from)?;
        let Some(mut w) = kernels.left.last().cloned() else {
            return Ok(None);
        };
        let mut x = guess.to_vec();
        let mut beta = 0.0;
        let order = n + m + 1;
        let mut system = Matrix::zeros(Pattern::full(order, order));
        let mut solver = DenseLu::default();
        solver
            .analyze(system.pattern().as_ref())
            .map_err(PiecewiseError::from)?;
        let mut rhs = vec![0.0; order];
        for _ in 0..12 {
            self.assemble_extended(&x, beta, &w, &mut jac, &mut system, &mut rhs);
            if solver.factor(system.as_ref()).is_err() || solver.solve_in_place(&mut rhs).is_err() {
                return Ok(None);
            }
            x.iter_mut().zip(&rhs).for_each(|(x, d)| *x -= d);
            beta -= rhs[m];
            w.iter_mut().zip(&rhs[m + 1..]).for_each(|(w, d)| *w -= d);
            if norm(&rhs) <= 1e-14 * (1.0 + norm(&x)) {
                break;
            }
        }
        let settled = norm(&rhs) <= 1e-9 * (1.0 + norm(&x)) && beta.abs() <= 1e-9;
        Ok((settled && distance(&x, guess) <= reach).then_some(x))
    }

    /// Replaces `next`, an event found next to a branch point of the frozen selection, by that branch point.
    pub(super) fn sharpen_at_branch_point(&mut self) -> Result<(), ContinuationError> {
        let guess = self.next.x.clone();
        if let Some(x) = self.branch_point_near(&guess, 1e-6 * (1.0 + norm(&guess)))? {
            self.next.x = x;
            self.map.test_functions(&self.next.x, &mut self.next.theta);
        }
        Ok(())
    }

    /// Moves `next` to a branch point of the followed selection between `here` and `next`, where the corrector converges too badly
    /// near it for a bracket to close (at a pitchfork, say). False where there is none.
    pub(super) fn jump_to_branch_point(&mut self) -> Result<bool, ContinuationError> {
        let chord: Vec<f64> = self.next.x.iter().zip(&self.here.x).map(|(b, a)| b - a).collect();
        let middle: Vec<f64> = self.here.x.iter().zip(&chord).map(|(x, c)| x + 0.5 * c).collect();
        let Some(x) = self.branch_point_near(&middle, 0.5 * norm(&chord))? else {
            return Ok(false);
        };
        let s: f64 = x
            .iter()
            .zip(&self.here.x)
            .zip(&self.here.t)
            .map(|((x, x0), t)| t * (x - x0))
            .sum();
        if !(s > 0.0 && s < self.next.s) {
            return Ok(false);
        }
        let share = s / self.next.s;
        for (t1, t0) in self.next.t.iter_mut().zip(&self.here.t) {
            *t1 = (1.0 - share) * t0 + share * *t1;
        }
        let length = norm(&self.next.t);
        self.next.t.iter_mut().for_each(|t| *t /= length);
        let mut r = vec![0.0; self.map.num_residuals()];
        self.map.residual(&self.selection, &x, &mut r);
        self.map.test_functions(&x, &mut self.next.theta);
        self.next.x = x;
        self.next.s = s;
        self.next.orientation = None;
        self.next.det_sign = Some(0);
        self.next.residual_norm = norm(&r);
        Ok(true)
    }

    /// The next facet, where it is met at a branch point of the frozen selection: there its corrector fails on both sides. The
    /// point is extrapolated along the tangent and found by the extended system.
    pub(super) fn event_at_branch_point(&mut self, h: f64) -> Result<Option<Monitor>, ContinuationError> {
        let mut rates = vec![0.0; self.layout.total()];
        self.map.test_derivatives(&self.here.x, &self.here.t, &mut rates);
        let mut nearest: Option<(f64, Monitor)> = None;
        for site in 0..self.layout.num_sites() {
            let first = self.layout.range(site).start;
            for &facet in self.map.cell(site, self.selection.piece(site)) {
                let index = first + facet.test();
                let s = -self.here.theta[index] / rates[index];
                let ahead = facet.sign() * rates[index] < 0.0 && s >= 0.0;
                if ahead && nearest.is_none_or(|n| s < n.0) {
                    nearest = Some((s, Monitor::Facet { index, facet }));
                }
            }
        }
        // Steps that crept up to the point are much shorter than what is left to it.
        let far = 2.0 * h.max(CREEP * (1.0 + norm(&self.here.x)));
        let Some((s, monitor)) = nearest.filter(|n| n.0 <= far) else {
            return Ok(None);
        };
        let guess: Vec<f64> = self
            .here
            .x
            .iter()
            .zip(&self.here.t)
            .map(|(x, t)| x + s * t)
            .collect();
        let reach = 0.1 * s + 10.0 * self.options.vanishing_distance * (1.0 + norm(&guess));
        let Some(x) = self.branch_point_near(&guess, reach)? else {
            return Ok(None);
        };
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(&x, &mut theta);
        let tiny = self.options.vanishing_distance * (1.0 + norm(&x));
        let Monitor::Facet { index, .. } = monitor else {
            return Ok(None);
        };
        if theta[index].abs() > tiny * rates[index].abs() {
            return Ok(None);
        }
        let chord: Vec<f64> = x.iter().zip(&self.here.x).map(|(a, b)| a - b).collect();
        let length = norm(&chord);
        if length == 0.0 {
            return Ok(None);
        }
        // On an arc of a circle the tangents at both ends mirror each other in the chord.
        let along = chord.iter().zip(&self.here.t).map(|(c, t)| c * t).sum::<f64>() / (length * length);
        for (i, t) in self.next.t.iter_mut().enumerate() {
            *t = 2.0 * along * chord[i] - self.here.t[i];
        }
        let mut r = vec![0.0; self.map.num_residuals()];
        self.map.residual(&self.selection, &x, &mut r);
        self.next.x = x;
        self.next.theta = theta;
        self.next.s = length;
        self.next.orientation = None;
        self.next.det_sign = Some(0);
        self.next.residual_norm = norm(&r);
        Ok(Some(monitor))
    }

    fn assemble_extended(
        &self,
        x: &[f64],
        beta: f64,
        w: &[f64],
        jac: &mut Matrix,
        system: &mut Matrix,
        rhs: &mut [f64],
    ) {
        let (n, m) = (w.len(), x.len());
        system.clear();
        // d(∇Hᵀw)/dx by differences: it only drives Newton's method, the residual below is exact.
        let mut y = x.to_vec();
        let mut products = [vec![0.0; m], vec![0.0; m]];
        for j in 0..m {
            let h = 6e-6 * (1.0 + x[j].abs());
            for (product, shift) in products.iter_mut().zip([h, -h]) {
                y[j] = x[j] + shift;
                jac.clear();
                self.map.jacobian(&self.selection, &y, jac);
                jac.mul_transpose_vec(w, product);
            }
            y[j] = x[j];
            for i in 0..m {
                system.add(n + i, j, (products[0][i] - products[1][i]) / (2.0 * h));
            }
        }
        jac.clear();
        self.map.jacobian(&self.selection, x, jac);
        for (i, j, v) in jac.triplets() {
            system.add(i, j, v);
            system.add(n + j, m + 1 + i, v);
        }
        for i in 0..n {
            system.add(i, m, w[i]);
            system.add(i, m + 1 + i, beta);
            system.add(n + m, m + 1 + i, 2.0 * w[i]);
        }
        self.map.residual(&self.selection, x, &mut rhs[..n]);
        for i in 0..n {
            rhs[i] += beta * w[i];
        }
        jac.mul_transpose_vec(w, &mut rhs[n..n + m]);
        rhs[n + m] = w.iter().map(|v| v * v).sum::<f64>() - 1.0;
    }
}
