//! How a curve leaves a point along an arm: the selection to freeze, its orientation and its residual there.

use crate::continuation::engine::{Curve, row_sizes};
use crate::continuation::error::if_solved;
use crate::continuation::point::units::Units;
use crate::continuation::{Arm, ContinuationError};
use crate::piecewise::{Selection, Vanishing};
use crate::sparse::{dot, norm};
use crate::tolerances::SELECTIONS;

/// Share of the distance to a corrected point of an arm at which signs of determinants are taken: determinants grow with the distance from a
/// singular point, so that they are far above rounding there.
const NEAR: f64 = 1.0 / 64.0;

impl Curve<'_> {
    /// Leaves `here` along `arm`: freezes its selection and sets up its monitors.
    pub(in crate::continuation) fn adopt(
        &mut self,
        arm: &Arm,
        vanishing: &[Vanishing],
    ) -> Result<(), ContinuationError> {
        self.path.selection.copy_from(&arm.selection);
        self.here.t.copy_from_slice(&arm.tangent);
        self.path.grazing.clear();
        let mut units = Units::new(&self.map, &arm.selection, &self.here.x);
        self.path.grazing.extend(
            vanishing
                .iter()
                .filter(|v| arm.grazing.contains(&v.site))
                .map(|v| v.of_selection(&self.map, &self.setup.layout, &arm.selection, &self.here.x))
                .filter(|v| {
                    let rate = v.rate(&arm.tangent);
                    rate.abs() <= units.least_rate(v, rate, v.gradient_norm, &arm.tangent)
                }),
        );
        self.here.s = 0.0;
        self.here.heading = Some(arm.direction);
        self.here.order = arm.order;
        self.linearize_here()?;
        self.find_coactive()?;
        self.here.probe.clear();
        if !arm.probe.is_empty() && !self.map.is_piecewise_affine() {
            self.take_signs_at(&arm.probe)?;
            self.here.probe.extend_from_slice(&arm.probe);
        }
        Ok(())
    }

    /// Takes the signs of determinants from a point of the arm on which the curve leaves: at the point itself they may be rounding noise.
    fn take_signs_at(&mut self, probe: &[f64]) -> Result<(), ContinuationError> {
        let t = self.here.t.clone();
        // Before the next singular point, if that is not too near; along the parabola through the probe, as curves that touch lie on opposite
        // sides of the chord.
        let chord: Vec<f64> = probe.iter().zip(&self.here.x).map(|(p, x)| p - x).collect();
        let along = dot(&chord, &t);
        let bend = chord.iter().zip(&t).map(|(c, t)| c - along * t);
        let ahead = bend.zip(&t).map(|(b, t)| NEAR * (along * t + NEAR * b));
        let near: Vec<f64> = self.here.x.iter().zip(ahead).map(|(x, a)| x + a).collect();
        let probe = near.as_slice();
        for k in 0..self.path.coactive.len() {
            let selection = self.path.coactive[k].0.clone();
            self.path.coactive[k].1 = self.orientation_of(&selection, probe, &t)?;
        }
        let selection = self.path.selection.clone();
        if self.is_singular_here(&selection)? {
            self.here.decline = None;
        }
        let at = if_solved(self.corrector.linearize(&self.map, &selection, probe, Some(&t)))?;
        self.here.take_signs(at.as_ref());
        Ok(())
    }

    /// Orientation, determinant and residual at `here`; a singular Jacobian (a branch point) leaves the signs unknown.
    fn linearize_here(&mut self) -> Result<(), ContinuationError> {
        let (x, t) = (&self.here.x, &self.here.t);
        let (map, affine) = (&self.map, self.map.is_piecewise_affine());
        if !affine {
            // At a branch point ∇H may be zero: the terms of H a step ahead count, too.
            let ahead = self.here.ahead(self.pace.h);
            for place in [&ahead, x] {
                let jac = self.corrector.jacobian_at(&map, &self.path.selection, place)?;
                let tolerance = self.setup.options.residual_tolerance;
                row_sizes(jac, x, (self.pace.h, t), tolerance, &mut self.scale.rows);
            }
        }
        if !affine || self.told.points == 0 {
            // Steps on affine pieces have computed it, and H is continuous.
            map.residual(&self.path.selection, x, &mut self.buffers.residual);
            self.here.residual_norm = norm(&self.buffers.residual);
        }
        let at = if_solved((self.corrector).linearize_again(map, &self.path.selection, x, Some(t)))?;
        self.here.decline = None;
        let signs = at.as_ref().map(|at| (at.orientation(t), at.det_sign()));
        (self.here.orientation, self.here.det_sign) = signs.unwrap_or_default();
        if affine && self.scale.terms == 0.0 {
            // For affine pieces the terms grow with ‖x‖ alone; summing them at every kink would cost more
            // than the step.
            let sizes: Vec<f64> = (x.iter().zip(t))
                .map(|(x, t)| x.abs() + self.pace.h * t.abs())
                .collect();
            let mut sums = vec![0.0; map.num_residuals()];
            match at {
                Some(mut at) => at.add_term_sizes(&map, &sizes, &mut sums),
                None => {
                    let jac = self.corrector.jacobian_at(&map, &self.path.selection, x)?;
                    jac.as_ref().add_term_sizes(&sizes, &mut sums);
                }
            }
            self.scale.terms = norm(&sums);
        } else if let Some(at) = at.filter(|_| !affine) {
            let (decline, _) =
                (self.scale.regularity).decline(at, map, &self.scale.rows, &self.here, self.pace.h)?;
            self.here.decline = Some(decline).filter(|&d| !Self::is_within_rounding(d, &self.here.x));
        }
        Ok(())
    }

    /// Whether ∇H^(σ) is singular at (or within rounding of) `here`, so that the sign of its determinant is arbitrary. Equilibration
    /// hides this from the condition estimate of the solver.
    pub(in crate::continuation) fn is_singular_here(
        &mut self,
        selection: &Selection,
    ) -> Result<bool, ContinuationError> {
        // Where the Jacobian is constant, its factorisation has shown that already.
        let affine = self.map.is_piecewise_affine();
        Ok(!affine && self.search(&[]).is_singular(selection)?)
    }

    /// The same at `next`.
    pub(super) fn is_singular_next(&mut self, selection: &Selection) -> Result<bool, ContinuationError> {
        std::mem::swap(&mut self.here, &mut self.next);
        let singular = self.is_singular_here(selection);
        std::mem::swap(&mut self.here, &mut self.next);
        singular
    }

    /// Resets the orientation where a curve leaves a branch point along an arm on which no other point is known.
    pub(in crate::continuation) fn doubt_orientation(&mut self, arm: &Arm) -> Result<(), ContinuationError> {
        if arm.probe.is_empty() && self.is_singular_here(&self.path.selection.clone())? {
            self.here.forget_signs();
        }
        Ok(())
    }

    /// On curved pieces an arm may run in the boundary of a cell to first order only: drops facets from which the curve has bent away.
    pub(in crate::continuation) fn forget_facets_left(&mut self) -> Result<(), ContinuationError> {
        if self.map.is_piecewise_affine() {
            return Ok(());
        }
        let reach = self.setup.options.vanishing_distance * (1.0 + norm(&self.here.x));
        let is_near = |v: &Vanishing, theta: &[f64]| theta[v.index].abs() <= reach * v.gradient_norm;
        if self.path.grazing.iter().all(|v| is_near(v, &self.here.theta)) {
            return Ok(());
        }
        let mut grazing = std::mem::take(&mut self.path.grazing);
        let before = grazing.len();
        grazing
            .retain(|v| is_near(v, &self.here.theta) || is_near(&self.test_here(v.index), &self.here.theta));
        let left = grazing.len() < before;
        self.path.grazing = grazing;
        if left { self.find_coactive() } else { Ok(()) }
    }

    /// On a grazing curve the other active selections have their own Jacobians, whose singular points are branch points.
    fn find_coactive(&mut self) -> Result<(), ContinuationError> {
        self.path.coactive.clear();
        if self.path.grazing.is_empty() {
            return Ok(());
        }
        // Test functions that vanish at the transition just passed have no sign.
        let active = self.active_beside(&self.path.grazing);
        for selection in active.selections().take(SELECTIONS as usize) {
            if selection == self.path.selection {
                continue;
            }
            let (x, t) = (self.here.x.clone(), self.here.t.clone());
            let sign = self.orientation_of(&selection, &x, &t)?;
            let known = sign.is_some() && !self.is_singular_here(&selection)?;
            self.path.coactive.push((selection, sign.filter(|_| known)));
        }
        Ok(())
    }
}
