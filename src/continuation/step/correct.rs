//! The predictor along the tangent and the Moore–Penrose corrector, with the selection frozen.

use super::Accepted;
use super::judge::{Shape, tangent_noise};
use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, relative_residual, row_sizes};
use crate::continuation::error::if_solved;
use crate::sparse::norm;

/// Share of the curvature of the last step that is remembered through inflections.
const FADING: f64 = 0.5;
/// How much more than the last step a curve may turn over the last correction.
const SAFETY: f64 = 10.0;

impl Curve<'_> {
    /// Predicts, unless a point of the arm that is left along is known, and corrects; fills `next` if the corrected point is acceptable.
    pub(super) fn try_step(&mut self, h: f64) -> Result<Option<Accepted>, ContinuationError> {
        self.next.predict(&self.here, h);
        if !self.here.probe.is_empty() {
            self.next.x.copy_from_slice(&self.here.probe);
        }
        let o = &self.setup.options;
        let tolerances = (o.residual_tolerance, o.step_tolerance * (norm(&self.here.x) + h));
        let (map, sizes) = (&self.map, &self.scale.rows);
        let corrected = self.corrector.correct_measured(
            &map,
            &mut self.path.selection,
            &mut |_, _| {},
            &|r| relative_residual(r, sizes),
            &mut self.next.x,
            &mut self.next.t,
            (tolerances, o.max_corrections),
        );
        let Some(corrected) = if_solved(corrected)? else {
            return Ok(None);
        };
        let correction = corrected.correction;
        // The terms that cancel may have been smaller so far: zero on leaving a branch point at the origin.
        let (next, next_sizes) = (&mut self.next, &mut self.buffers.sizes);
        next_sizes.clear();
        row_sizes(
            corrected.jacobian(),
            &next.x,
            (h, &next.t),
            tolerances.0,
            next_sizes,
        );
        let fine = relative_residual(corrected.residual(), next_sizes) <= tolerances.0
            && correction.step_norm <= tolerances.1;
        if !(correction.converged || fine) {
            return Ok(None);
        }
        next.residual_norm = correction.residual_norm;
        next.s = self.here.progress_to(&next.x);
        let (decline, mut at) =
            (self.scale.regularity).decline(corrected.linearisation(), map, sizes, next, h)?;
        next.decline = Some(decline);
        next.take_signs(Some(&at));
        let Some(mut shape) = Shape::of(&self.here, next, h, o.min_cos) else {
            return Ok(None);
        };
        let flips = next.orientation != self.here.orientation;
        let (bend, regular) = (self.pace.curvature * h, self.here.decline.is_some());
        let mut noise = || tangent_noise(regular, at.rcond());
        // The point of an arm that is told apart from all others is no other curve's.
        if !flips
            && self.here.probe.is_empty()
            && shape.is_doubtful(bend, correction.iterations, &mut noise)
            && !self.holds_halfway(&shape)?
        {
            // The tangents may be those of the previous iterates.
            let (turn, noise) = self.sharpen_tangents()?;
            shape.turn = turn;
            let doubtful = shape.is_doubtful(bend, correction.iterations, || noise);
            if doubtful && !self.holds_halfway(&shape)? {
                return Ok(None);
            }
        }
        // The tangent is that of the previous iterate, which may lie on the other side of a fold.
        let blur = SAFETY * shape.turn / h * correction.step_norm;
        if self.next.t.last().is_some_and(|rate| rate.abs() <= blur) {
            self.sharpen_next()?;
        }
        for (size, next) in self.scale.rows.iter_mut().zip(&self.buffers.sizes) {
            *size = size.max(*next);
        }
        self.next.find_tests(&self.map, &self.path.selection);
        Ok(Some(Accepted {
            corrections: correction.iterations,
            curvature: (shape.turn / h).max(FADING * self.pace.curvature),
        }))
    }
}

#[cfg(test)]
mod tests {
    use crate::continuation::testing::Plane;

    /// y + 1 = e^α with a residual that never vanishes to the last bit, where the terms of H were zero so far.
    #[test]
    fn terms_that_grow_within_a_step_count() {
        let map = Plane::within(|y, a| [(y + 1.0) - a.exp(), 1.0, -a.exp()], &[]);
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        for k in 1..50 {
            curve.scale.rows = vec![0.0];
            let h = 1e-3 * f64::from(k);
            assert!(curve.try_step(h).unwrap().is_some(), "{h}");
            assert!((curve.next.x[0] - curve.next.x[1].exp_m1()).abs() < 1e-15);
        }
    }
}
