//! Smooth branch points to full accuracy.

use super::ContinuationError;
use super::engine::Continuation;
use super::step::distance;
use crate::linear::{DenseLu, LinearSolver, null_space};
use crate::newton::norm;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth};
use crate::sparse::{Matrix, Pattern};

/// Largest number of residuals for which the dense extended system is solved.
const MAX_DENSE: usize = 120;

impl<P: PiecewiseSmooth + ?Sized, L: LinearSolver> Continuation<'_, P, L> {
    /// Moves `here` onto the branch point near it by Newton's method on the extended system of a simple branch point
    /// (Griewank–Reddien 1984): H(x) + β w = 0, ∇H(x)ᵀ w = 0, wᵀw = 1, which is regular there. Bisection alone stops at the
    /// square root of the rounding unit, as the corrector's matrix is singular at the very point. Large problems keep the
    /// bisected point.
    pub(super) fn polish_branch_point(&mut self) -> Result<(), ContinuationError> {
        let (n, m) = (self.map.num_residuals(), self.map.num_vars());
        if n > MAX_DENSE {
            return Ok(());
        }
        self.corrector.assemble(self.map, &self.selection, &self.here.x)?;
        let mut jac = self.corrector.jacobian().clone();
        let Some(mut w) = null_space(&jac, 1e-4).map_err(PiecewiseError::from)?.left.pop() else {
            return Ok(());
        };
        let mut x = self.here.x.clone();
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
                return Ok(());
            }
            x.iter_mut().zip(&rhs).for_each(|(x, d)| *x -= d);
            beta -= rhs[m];
            w.iter_mut().zip(&rhs[m + 1..]).for_each(|(w, d)| *w -= d);
            if norm(&rhs) <= 1e-14 * (1.0 + norm(&x)) {
                break;
            }
        }
        let settled = norm(&rhs) <= 1e-9 * (1.0 + norm(&x));
        let moved = distance(&x, &self.here.x);
        if settled && beta.abs() <= 1e-9 && moved <= 1e-2 * (self.h + self.options.min_step) {
            self.here.x = x;
            self.map.test_functions(&self.here.x, &mut self.here.theta);
        }
        Ok(())
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
