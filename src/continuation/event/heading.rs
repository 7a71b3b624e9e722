//! The sign of α̇, as far as rounding leaves it known.

use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, SINGULAR, State};
use crate::continuation::error::if_solved;
use crate::continuation::point::coincidence::SAFETY;
use crate::continuation::step::judge::ARMS;

impl Curve<'_> {
    /// Sets the sign of α̇ on the curve beyond `here`, if it is not known.
    pub(in crate::continuation) fn find_heading(&mut self) -> Result<(), ContinuationError> {
        if self.here.heading.is_none() {
            let here = std::mem::take(&mut self.here);
            let heading = self.heading_at(&here, 0);
            self.here = here;
            self.here.heading = Some(heading?);
        }
        Ok(())
    }

    /// The same, and at `next`.
    pub(super) fn find_headings(&mut self) -> Result<(), ContinuationError> {
        self.find_heading()?;
        let before = self.here.heading.unwrap_or(0);
        let next = std::mem::take(&mut self.next);
        let heading = self.heading_at(&next, before);
        self.next = next;
        self.next.heading = Some(heading?);
        Ok(())
    }

    /// The sign of α̇ at a state where it exceeds its rounding error, else that `before` it.
    fn heading_at(&mut self, state: &State, before: i8) -> Result<i8, ContinuationError> {
        let rate = state.t.last().copied().unwrap_or(0.0);
        // Points of a vertical segment are corrected to a tolerance: α does not move as long as it moves no more than these allow.
        let vertical = before == 0 && self.here.heading == Some(0) && rate.abs() <= SINGULAR;
        if rate == 0.0 || rate.is_nan() || rate.signum() == f64::from(before) || vertical {
            return Ok(before);
        }
        let (rate, rounding) = match state.orientation {
            // Beside undefined values the rounding is unknown; whether there is a fold is then decided where it is located.
            Some(_) => self.rate_of_parameter(state)?.unwrap_or((rate, 0.0)),
            // At a singular point only the accuracy of the arms is known.
            None => (rate, ARMS),
        };
        Ok(if rate.abs() > rounding {
            rate.signum() as i8
        } else {
            before
        })
    }

    /// α̇ at a regular state, and a bound of its rounding error.
    pub(super) fn rate_of_parameter(
        &mut self,
        state: &State,
    ) -> Result<Option<(f64, f64)>, ContinuationError> {
        let State { x, t, .. } = state;
        // The point was computed from the one before, and has its rounding errors where it is itself near zero.
        let other = if self.here.x.len() == x.len() {
            &self.here.x
        } else {
            &self.next.x
        };
        let sizes: Vec<f64> = x.iter().zip(other).map(|(x, o)| x.abs().max(o.abs())).collect();
        let at = (self.corrector).linearize_again(&self.map, &self.path.selection, x, Some(t));
        let Some(mut at) = if_solved(at)? else {
            return Ok(None);
        };
        let Some(moves) = if_solved(at.noise(&self.map, (x, &sizes), t))? else {
            return Ok(None);
        };
        let found = at.entry_of_tangent(&self.map, (x, t), x.len() - 1, &moves)?;
        Ok(found.map(|(rate, rounding)| (rate, SAFETY * rounding)))
    }
}

#[cfg(test)]
mod tests {
    use crate::continuation::testing::Plane;

    /// Beyond rounding α̇ has a sign, however small it is; where α̇ is rounding the sign is that of the points before.
    #[test]
    fn signs_of_rates_above_rounding_are_known() {
        let slow = Plane::within(|y, a| [1e-20 * y - a, 1e-20, -1.0], &[]);
        let vertical = Plane::within(
            |y, a| [(1.0 + y * y) * (a - 0.3), 2.0 * y * (a - 0.3), 1.0 + y * y],
            &[],
        );
        for (map, x, expected) in [(&slow, [0.5, 5e-21], [1, 1]), (&vertical, [0.5, 0.3], [0, -1])] {
            let mut run = map.curve_along(x, [1.0, 0.0]);
            let curve = run.curve.erased_mut();
            for (before, sign) in [0, -1].into_iter().zip(expected) {
                let mut state = curve.here.clone();
                assert_eq!(curve.heading_at(&state, before).unwrap(), sign);
                // At 0.3 + 5e-17, as far as the next number is.
                state.t[1] = if sign == before { 4e-17 } else { 1e-20 };
                assert_eq!(curve.heading_at(&state, before).unwrap(), sign);
            }
        }
    }
}
