//! Corners: points where the curve turns within no length, and the arm by which it goes on.

use super::system::{State, System, along};
use crate::sparse::{distance, dot, norm};
use crate::spread::Random;
use crate::tolerances::{CENTRAL, HALF_DIGITS, RESULT};

/// Length, relative to 1 + ‖x‖, within which a corner is crossed: four steps of central differences, which do not see on which side of a
/// kink they are.
const CORNER: f64 = 4.0 * CENTRAL;
/// Points around a corner at which pieces are looked for beside the one straight ahead: sixteen sites with two pieces each that meet there
/// alone are found by chance with half of them.
const PROBES: usize = 64;
/// Share of the length across a corner within which the tangents before and behind it meet, if it is one corner.
const MEET: f64 = 1e-3;

/// A step across a corner.
pub(super) struct Crossing {
    /// The last point before it.
    pub(super) before: Option<State>,
    /// The corner, with the tangent of departure, where the tangents on both sides meet in a point of the curve.
    pub(super) corner: Option<State>,
    /// The first point behind it.
    pub(super) behind: State,
}

/// Why a corner is not crossed.
pub(super) enum Blocked {
    /// No arm was found.
    Nowhere,
    /// Several arms were found.
    Several,
}

impl System<'_> {
    /// The step of length `h` from `a` that was refused, across the first corner on its way, if there is one.
    pub(super) fn cross(&mut self, a: &State, h: f64, min_step: f64) -> Result<Crossing, Blocked> {
        let size = 1.0 + norm(&a.z);
        let fine = (HALF_DIGITS * size).max(min_step).min(h);
        let coarse = (CORNER * size).max(fine);
        let mut bracket = (0.0, h);
        self.halve(a, &mut bracket, coarse);
        // Differences see the corner from some way off, and tangents next to it are none of either side.
        let back = bracket.0 - coarse;
        let before = (back > 0.0).then(|| self.step(a, back)).flatten();
        let far = self.leave(before.as_ref().unwrap_or(a), 2.0 * coarse);
        let far = far.map(|behind| self.joined(a, before, behind, 2.0 * coarse));
        if fine >= coarse || far.as_ref().is_ok_and(|crossing| crossing.corner.is_some()) {
            return far;
        }
        // Bent arms meet in a point of the curve if it is met from near; and there may be several corners within the length above.
        let before = self.halve(a, &mut bracket, fine);
        match (self.leave(before.as_ref().unwrap_or(a), fine), far) {
            (Ok(behind), far) => {
                let near = self.joined(a, before, behind, fine);
                Ok(far.ok().filter(|_| near.corner.is_none()).unwrap_or(near))
            }
            (Err(_), Ok(far)) => Ok(far),
            (Err(blocked), Err(_)) => Err(blocked),
        }
    }

    /// Halves a bracket of the longest step from `a`, down to the width; returns the last point found.
    fn halve(&mut self, a: &State, (lo, hi): &mut (f64, f64), width: f64) -> Option<State> {
        let mut last = None;
        while *hi - *lo > width {
            let middle = f64::midpoint(*lo, *hi);
            if middle <= *lo || middle >= *hi {
                break;
            }
            match self.step(a, middle) {
                Some(state) => (*lo, last) = (middle, Some(state)),
                None => *hi = middle,
            }
        }
        last.or_else(|| (*lo > 0.0).then(|| self.step(a, *lo)).flatten())
    }

    fn joined(&mut self, a: &State, before: Option<State>, behind: State, width: f64) -> Crossing {
        let corner = self.corner(before.as_ref().unwrap_or(a), &behind, width);
        Crossing {
            before,
            corner,
            behind,
        }
    }

    /// The one arm that leaves a corner at most `width` ahead of `a`.
    fn leave(&mut self, a: &State, width: f64) -> Result<State, Blocked> {
        let mut random = Random::new(1);
        let mut arms: Vec<State> = Vec::new();
        for probe in 0..=PROBES {
            let mut towards = a.tangent.clone();
            if probe > 0 {
                let aside: Vec<f64> = towards.iter().map(|_| random.symmetric()).collect();
                let length = norm(&aside);
                for (t, s) in towards.iter_mut().zip(&aside) {
                    *t += s / length;
                }
            }
            // Behind the corner, wherever within the width it is.
            let at = along(&a.z, 2.0 * width, &towards);
            let Some(tangent) = self.kernel(&at, &a.tangent) else {
                continue;
            };
            for sign in [1.0, -1.0] {
                let ahead: Vec<f64> = tangent.iter().map(|t| sign * t).collect();
                if let Some(arm) = self.arm(a, &at, &ahead, width)
                    && arms.iter().all(|known| distance(&known.z, &arm.z) > width)
                {
                    arms.push(arm);
                }
            }
            // Straight ahead there is the piece into which the curve goes, as a rule.
            if probe == 0 && arms.len() == 1 {
                break;
            }
        }
        match (arms.pop(), arms.is_empty()) {
            (Some(arm), true) => Ok(arm),
            (None, _) => Err(Blocked::Nowhere),
            _ => Err(Blocked::Several),
        }
    }

    /// The arm in a direction, if it is one, and not that on which the curve arrives: in the cell of the point `at`.
    fn arm(&mut self, a: &State, at: &[f64], ahead: &[f64], width: f64) -> Option<State> {
        // From a corner at most `width` ahead of a it reaches this plane: it is within four widths of that point, at either side.
        let q = along(at, 4.0 * width, ahead);
        let found = self.correct(&q, ahead, width)?;
        let cos = dot(&found.tangent, ahead);
        let away = distance(&found.z, &a.z);
        let near = distance(&found.z, &q) <= 5.0 * width && away >= width;
        if !near || cos.abs() < self.min_cos {
            return None;
        }
        // On a curve that turns back the arm behind a corner lies beside the one before it.
        let ahead: f64 = found
            .z
            .iter()
            .zip(&a.z)
            .zip(&a.tangent)
            .map(|((z, a), t)| (z - a) * t)
            .sum();
        if ahead < 0.0 {
            let q = along(&a.z, ahead, &a.tangent);
            let back = self.correct(&q, &a.tangent, width)?;
            if distance(&back.z, &found.z) <= MEET * width {
                return None;
            }
        }
        Some(found.turned(cos > 0.0))
    }

    /// The point where the tangents before and behind a corner meet, if it is on the curve.
    fn corner(&mut self, a: &State, b: &State, width: f64) -> Option<State> {
        let chord: Vec<f64> = b.z.iter().zip(&a.z).map(|(b, a)| b - a).collect();
        let (cos, u, v) = (
            dot(&a.tangent, &b.tangent),
            dot(&a.tangent, &chord),
            dot(&b.tangent, &chord),
        );
        let sine = 1.0 - cos * cos;
        let (ahead, behind) = ((u - cos * v) / sine, (v - cos * u) / sine);
        let (k, l) = (along(&a.z, ahead, &a.tangent), along(&b.z, -behind, &b.tangent));
        let between = ahead >= -MEET * width && behind > 0.0;
        if !(between && distance(&k, &l) <= MEET * width) {
            return None;
        }
        // On bent arms it is off the curve by the square of the width.
        let (residual, terms) = self.error(&k, &b.tangent, width)?;
        (residual <= RESULT * terms).then(|| State {
            z: k,
            tangent: b.tangent.clone(),
            residual,
            corrections: 0,
        })
    }
}
