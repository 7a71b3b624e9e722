//! Arms at points where H is not piecewise smooth: a node in space without pressure, traction and slip is at the tip of a cone, where the
//! derivatives of its selections mean nothing. A solution beside the point gives the arm.

use super::Arms;
use crate::continuation::engine::Curve;
use crate::continuation::{Arm, ContinuationError};
use crate::newton::{Newton, NewtonOptions};
use crate::piecewise::{PiecewiseSmoothExt, select};
use crate::sparse::{Matrix, distance, norm};

/// How far beside a point a solution is sought, relative to 1 + |α|: its square is far above rounding, and far below the step.
const BESIDE: f64 = 1e-6;

impl Curve<'_> {
    /// Whether H vanishes to first order along an arm: where H is not piecewise smooth at the point, derivatives of its selections there
    /// mean nothing.
    pub(in crate::continuation) fn is_tangent(&self, arm: &Arm) -> bool {
        /// A residual below this share of the terms of the step is of second order.
        const SECOND_ORDER: f64 = 1e-2;
        /// Rounding errors of H, relative to its terms.
        const ROUNDING: f64 = 64.0 * f64::EPSILON;
        if self.map.is_piecewise_affine() {
            return true;
        }
        let x = &self.here.x;
        let step = 0.1 * BESIDE * (1.0 + norm(x));
        let ahead: Vec<f64> = (x.iter().zip(&arm.tangent)).map(|(x, t)| x + step * t).collect();
        // The selection that is active there, which need not be that of the arm.
        let selection = select(&self.map, &ahead);
        let mut jac = Matrix::zeros(self.map.pattern());
        self.map.jacobian(&selection, &ahead, &mut jac);
        let mut r = vec![0.0; jac.nrows()];
        self.map.residual(&selection, &ahead, &mut r);
        let terms = |v: &[f64], scale: f64| {
            let lengths: Vec<f64> = v.iter().map(|v| scale * v.abs()).collect();
            let mut sums = vec![0.0; jac.nrows()];
            jac.as_ref().add_term_sizes(&lengths, &mut sums);
            sums
        };
        let (moved, rounding) = (terms(&arm.tangent, SECOND_ORDER * step), terms(x, ROUNDING));
        let mut rows = r.iter().zip(moved.iter().zip(&rounding));
        rows.all(|(r, (moved, rounding))| r.abs() <= moved + rounding)
    }

    /// Leaves a point where derivatives mean nothing from a solution on the arm beside it.
    pub(in crate::continuation) fn leave_from_beside(
        &mut self,
        arm: &Arm,
        beside: Vec<f64>,
    ) -> Result<(), ContinuationError> {
        self.path.selection.copy_from(&arm.selection);
        self.here.t.copy_from_slice(&arm.tangent);
        self.emit_start();
        self.pace.arclength = distance(&self.here.x, &beside);
        self.here.x = beside;
        (self.map).tests_of_selection(&self.path.selection, &self.here.x, None, &mut self.here.theta);
        self.adopt(arm, &[])?;
        self.doubt_orientation(arm)
    }

    /// An arm by a solution beside the point, and that solution: where H is not piecewise smooth at it (a node in space without pressure, traction and slip),
    /// its directional derivative is no linear function in any cell.
    pub(in crate::continuation) fn arm_beside(
        &mut self,
        rate: f64,
        arms: &Arms,
    ) -> Result<Option<(Arm, Vec<f64>)>, ContinuationError> {
        if self.map.is_piecewise_affine() {
            return Ok(None);
        }
        let (lower, upper) = self.setup.options.parameter_range;
        let x = &self.here.x;
        let Some(&alpha) = x.last() else { return Ok(None) };
        let room = if rate > 0.0 { upper - alpha } else { alpha - lower };
        let step = (BESIDE * (1.0 + alpha.abs())).min(0.5 * room);
        let mut newton = Newton::new(NewtonOptions::default()).in_own_scale();
        // What was found with the derivatives of selections may be near.
        let towards = |t: &Vec<f64>| {
            let speed = t.last().map_or(0.0, |t| t.abs());
            x.iter().zip(t).map(|(x, t)| x + step / speed * t).collect()
        };
        let guesses = arms.list.iter().map(|a| &a.tangent);
        let guesses = guesses.filter(|t| t.last().is_some_and(|t| t * rate > 0.0));
        for mut beside in guesses.map(towards).chain([x.clone()]) {
            if let Some(last) = beside.last_mut() {
                *last = alpha + rate * step;
            }
            if newton.solve(&self.map, &mut beside).is_err() {
                continue;
            }
            let mut tangent: Vec<f64> = beside.iter().zip(x).map(|(b, x)| b - x).collect();
            let length = norm(&tangent);
            tangent.iter_mut().for_each(|t| *t /= length);
            let arm = Arm::along(select(&self.map, &beside), tangent, Vec::new(), None);
            // A solution of another curve, or one beyond a kink near by, is not joined to the point by a line of solutions.
            if self.is_tangent(&arm) {
                return Ok(Some((arm, beside)));
            }
        }
        Ok(None)
    }
}
