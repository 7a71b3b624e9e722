//! Zeros along a step.

use super::system::{State, System};
use crate::sparse::norm;
use crate::tolerances::{HALVINGS, RESULT, SIX_DIGITS};

/// A part of a step from `from`: how far its ends are, and the points there.
#[derive(Clone, Copy)]
pub(super) struct Stretch<'s> {
    pub(super) from: &'s State,
    pub(super) ends: [(f64, &'s State); 2],
}

impl System<'_> {
    /// Where a function of the point changes its sign on a stretch, between values of opposite signs at its ends; `None` where no point
    /// between was found.
    pub(super) fn zero(
        &mut self,
        stretch: Stretch<'_>,
        value: &dyn Fn(&State) -> f64,
        mut values: [f64; 2],
    ) -> Option<(f64, State)> {
        let [(mut lo, a), (mut hi, b)] = stretch.ends;
        let tolerance = RESULT * (norm(&b.z) + hi);
        let mut best = match values[0].abs() <= values[1].abs() {
            true => (values[0].abs(), lo, a.clone()),
            false => (values[1].abs(), hi, b.clone()),
        };
        for k in 0..2 * HALVINGS {
            if hi - lo <= tolerance {
                break;
            }
            // Secants are fast for smooth functions, halving ends with all others.
            let secant = lo + (hi - lo) * values[0] / (values[0] - values[1]);
            let h = match k % 3 {
                2 => f64::midpoint(lo, hi),
                _ => secant.clamp(lo + 0.25 * tolerance, hi - 0.25 * tolerance),
            };
            let state = self.attempt(stretch.from, h)?;
            let v = value(&state);
            if v.is_nan() {
                return None;
            }
            if v.abs() <= best.0 {
                best = (v.abs(), h, state);
            }
            if v == 0.0 {
                break;
            }
            match v.signum() == values[0].signum() {
                true => (lo, values[0]) = (h, v),
                false => (hi, values[1]) = (h, v),
            }
        }
        Some((best.1, best.2))
    }

    /// [`zero`](Self::zero) of a function that is continuous: at jumps and poles there is none.
    pub(super) fn root(
        &mut self,
        stretch: Stretch<'_>,
        value: &dyn Fn(&State) -> f64,
        values: [f64; 2],
    ) -> Option<(f64, State)> {
        let found = self.zero(stretch, value, values)?;
        let largest = values[0].abs().max(values[1].abs());
        (value(&found.1).abs() <= SIX_DIGITS * largest).then_some(found)
    }
}
