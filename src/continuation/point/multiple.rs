//! Points at which the kernel of ∇H^(σ) has two or three dimensions, degenerate ones among them.

use super::extension::{Extension, Frame};
use super::roots::solve3;
use super::search::DENSE;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout};
use crate::sparse::{distance, dot, norm};

/// Steps of Newton's method: each takes at least half of the distance that is left at points up to a double root of its equations, which
/// rounding ends after as many steps as numbers have binary digits.
const LIMIT: usize = f64::MANTISSA_DIGITS as usize + 7;
/// Least ratio of successive steps of linear convergence: half of that at double roots.
const LINEAR: f64 = 0.25;
/// The largest dimension of a kernel whose arms are determined.
pub(in crate::continuation) const LARGEST: usize = 3;

/// The point within reach of `guess` where ∇H^(σ) has a kernel of a given dimension, 2 or 3, if H vanishes there, too.
///
/// With orthonormal vectors e of the kernel, and u of that of the transpose, the entries uᵢᵀ∇H eⱼ vanish there: two equations for the two
/// coordinates of a displacement Σ cⱼ eⱼ, or six for three, which Gauss and Newton's method solves together with the rest of H for the
/// displacement across the kernel. They are regular where the quadratic forms uᵢᵀ∇²H determine a point. Where they do not, as at a cusp,
/// convergence is linear and ends among rounding errors.
pub(in crate::continuation) fn multiple_point(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    selection: &Selection,
    (guess, reach): (&[f64], f64),
    dimension: usize,
) -> Result<Option<Vec<f64>>, PiecewiseError> {
    let rank = map.num_vars().checked_sub(dimension);
    let Some(rank) = rank.filter(|_| map.num_residuals() <= DENSE) else {
        return Ok(None);
    };
    let (mut x, mut last, mut units) = (guess.to_vec(), f64::INFINITY, None);
    for _ in 0..LIMIT {
        let frame = Frame {
            map,
            x: &x,
            vanishing: &[],
            tests: layout.total(),
            met: &[],
            theta: &[],
            off: 0.0,
        };
        let mut near = Extension::new(&frame, selection)?;
        let known = near.rank <= rank;
        near.rank = rank;
        let step = near.towards_singular_point();
        // In the same units throughout, as those of variables in which H is homogeneous change on the way.
        let sizes = units.get_or_insert_with(|| near.units.clone());
        let length = step.as_ref().map_or(0.0, |step| {
            let scaled = step.iter().zip(&near.units).zip(&*sizes);
            norm(&scaled.map(|((s, unit), size)| s * unit / size).collect::<Vec<_>>())
        });
        let rate = length / last;
        // Convergence is quadratic until rounding ends it, or linear, where the steps that are left are a geometric series: its sum is known
        // better as long as no step is among rounding errors.
        let linear = rate >= LINEAR;
        let done = known && (linear || length <= f64::EPSILON);
        let on_curve = done && near.vanishes();
        let Some(step) = step.filter(|_| rate < 1.0) else {
            return Ok(on_curve.then_some(x));
        };
        let share = if done && linear { (1.0 - rate).recip() } else { 1.0 };
        let moved = x.iter().zip(step.iter().zip(&near.units)).zip(&*sizes);
        x = moved
            .map(|((x, (s, unit)), size)| match x + share * s * unit {
                // Below rounding in these units it is not known.
                next if next.abs() <= f64::EPSILON * size => 0.0,
                next => next,
            })
            .collect();
        if done {
            return Ok(on_curve.then_some(x));
        }
        last = length;
        if distance(&x, guess) > reach {
            return Ok(None);
        }
    }
    Ok(None)
}

impl Extension<'_> {
    /// The step of Gauss and Newton's method to the point where the kernel has the dimension that it is taken to have, in balanced units;
    /// `None` where nothing tells where that is.
    pub(super) fn towards_singular_point(&self) -> Option<Vec<f64>> {
        let basis = self.kernel();
        let of = |v: &[f64], order: usize| self.along(0, &[v], order).residual;
        let each: Vec<Vec<Vec<f64>>> = basis.iter().map(|e| of(e, 2)).collect();
        let mut step = self.solve(0, each.first()?.first()?);
        // The coordinates that there are not are 0.
        let (mut rows, mut right) = ([[0.0; LARGEST]; LARGEST], [0.0; LARGEST]);
        (basis.len()..LARGEST).for_each(|k| rows[k][k] = 1.0);
        for j in 0..basis.len() {
            let mixed = |k: usize| -> Vec<f64> {
                let both: Vec<f64> = basis[j].iter().zip(&basis[k]).map(|(a, b)| a + b).collect();
                let sum = of(&both, 2).swap_remove(2);
                let own = each[j][2].iter().zip(&each[k][2]);
                sum.iter().zip(own).map(|(s, (a, b))| s - a - b).collect()
            };
            let second: Vec<Vec<f64>> = (0..basis.len()).map(mixed).collect();
            for u in self.cokernel() {
                let value = dot(u, &each[j][1]);
                let slopes: Vec<f64> = second.iter().map(|s| dot(u, s)).collect();
                if basis.len() < LARGEST {
                    // As many equations as unknowns: their normal equations would lose half of the digits.
                    rows[j][..slopes.len()].copy_from_slice(&slopes);
                    right[j] = -value;
                    continue;
                }
                for (a, row) in rows.iter_mut().enumerate() {
                    right[a] -= slopes[a] * value;
                    row.iter_mut().zip(&slopes).for_each(|(r, s)| *r += slopes[a] * s);
                }
            }
        }
        for (e, c) in basis.iter().zip(solve3(rows, right)?) {
            step.iter_mut().zip(e).for_each(|(s, e)| *s += c * e);
        }
        Some(step)
    }
}
