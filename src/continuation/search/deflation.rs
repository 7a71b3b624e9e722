//! Newton steps at fixed α: with the selection frozen, and with known solutions deflated.

use crate::linear::{AutoSolver, LinearSolver};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout, select_pieces};
use crate::sparse::Matrix;
use crate::sparse::norm;
use crate::tolerances::RESULT;

/// Largest number of deflated steps.
const STEPS: usize = 60;
/// Reduction of the residual, relative to the terms of H at the start of the run, from which on the corrector takes over.
const CLOSE: f64 = 1e-6;

/// Workspace of a map for steps at fixed parameter.
pub(super) struct Steps<'a> {
    map: &'a dyn PiecewiseSmooth,
    layout: TestLayout,
    theta: Vec<f64>,
    jac: Matrix,
    solver: AutoSolver,
    step: Vec<f64>,
}

impl<'a> Steps<'a> {
    pub(super) fn new(map: &'a dyn PiecewiseSmooth) -> Result<Self, PiecewiseError> {
        let n = map.num_residuals();
        let layout = TestLayout::new(map);
        let jac = Matrix::zeros(map.pattern());
        let mut solver = AutoSolver::default();
        solver.analyze(jac.leading_columns(n).pattern)?;
        Ok(Self {
            map,
            theta: vec![0.0; layout.total()],
            layout,
            jac,
            solver,
            step: vec![0.0; n],
        })
    }

    fn factor(&mut self, selection: &Selection, x: &[f64]) -> bool {
        self.jac.clear();
        self.map.jacobian(selection, x, &mut self.jac);
        let n = self.map.num_residuals();
        self.solver.factor(self.jac.leading_columns(n)).is_ok()
    }

    /// Fills `step` with −(∇_yH^(σ))⁻¹ H^(σ) and gives ‖H^(σ)‖; `None` where that is singular.
    fn newton_step(&mut self, selection: &Selection, x: &[f64]) -> Option<f64> {
        self.map.residual(selection, x, &mut self.step);
        let size = norm(&self.step);
        if !size.is_finite() || !self.factor(selection, x) {
            return None;
        }
        self.solver.solve_in_place(&mut self.step).ok()?;
        self.step.iter_mut().for_each(|s| *s = -*s);
        self.step.iter().all(|s| s.is_finite()).then_some(size)
    }

    /// A few Newton steps on H^(σ), whatever cell x lies in; `false` where a Jacobian is singular.
    pub(super) fn towards(&mut self, selection: &Selection, x: &mut [f64]) -> bool {
        let steps = if self.map.is_piecewise_affine() { 1 } else { 3 };
        (0..steps).all(|_| {
            let fine = self.newton_step(selection, x).is_some();
            if fine {
                x.iter_mut().zip(&self.step).for_each(|(x, s)| *x += s);
            }
            fine
        })
    }

    /// Newton's method on M(y) H(y), M = Π (1/‖y − y_k‖² + 1) over the known solutions, lengths relative to `unit` (Farrell,
    /// Birkisson and Funke 2015). Its step is that of H times 1/(1 − ∇log M · d) (Sherman–Morrison). `true` where H has become
    /// small.
    pub(super) fn deflated(&mut self, known: &[&[f64]], unit: f64, x: &mut [f64]) -> bool {
        let n = self.map.num_residuals();
        let mut selection = Selection::uniform(self.layout.num_sites(), 0);
        let mut first = None;
        for k in 0..STEPS {
            self.map.test_functions(x, &mut self.theta);
            select_pieces(self.map, &self.layout, &self.theta, k > 0, 0.0, &mut selection);
            let Some(size) = self.newton_step(&selection, x) else {
                return false;
            };
            let from = *first.get_or_insert(size);
            if size <= CLOSE * from {
                return true;
            }
            let mut slope = 0.0;
            for y in known {
                let distance2 = (0..n).map(|i| ((x[i] - y[i]) / unit).powi(2)).sum::<f64>();
                let along: f64 = (0..n).map(|i| (x[i] - y[i]) * self.step[i]).sum::<f64>() / (unit * unit);
                slope -= 2.0 * along / (distance2 * (1.0 + distance2)).max(f64::MIN_POSITIVE);
            }
            let length = norm(&self.step).max(f64::MIN_POSITIVE);
            let longest = 10.0 * unit / length;
            let factor = 1.0 / (1.0 - slope);
            if factor.is_nan() {
                return false;
            }
            let factor = factor.clamp(-longest, longest);
            x.iter_mut().zip(&self.step).for_each(|(x, s)| *x += factor * s);
        }
        false
    }

    /// Sign of det ∇_yH^(σ), 0 where singular.
    pub(super) fn det_sign(&mut self, selection: &Selection, x: &[f64]) -> Option<i8> {
        if !self.factor(selection, x) || self.solver.rcond().is_some_and(|r| r < RESULT) {
            return Some(0);
        }
        self.solver.log_det().map(|d| d.0)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::piecewise::MinMap;

    /// y = 0 is deflated: at y = ±1 the factor of the step has a pole, next to which steps end ten units away.
    #[test]
    fn deflated_steps_are_of_limited_length() {
        let seen = RefCell::new(Vec::new());
        let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            seen.borrow_mut().push(x[0]);
            (a[0], b[0]) = (x[0], 1e9);
        });
        for off in [1e-8, -1e-8] {
            seen.borrow_mut().clear();
            let mut steps = Steps::new(&map).unwrap();
            let known = [0.0, 0.0];
            steps.deflated(&[&known], 1.0, &mut [1.0 + off, 0.0]);
            let seen = seen.borrow();
            let longest = seen.windows(2).fold(0.0_f64, |m, y| m.max((y[1] - y[0]).abs()));
            assert!((longest - 10.0).abs() < 1e-3, "{off:e} {longest}");
        }
    }
}
