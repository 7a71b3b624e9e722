//! Points at which the kernel of ∇H^(σ) has three dimensions, to full accuracy.

use super::extension::{Extension, Frame};
use super::roots::solve3;
use super::search::DENSE;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout};
use crate::sparse::{distance, dot, norm};

/// Steps after which Newton's method, which converges quadratically, has converged or will not.
const LIMIT: usize = 15;
/// Dimension of the kernel: the largest whose arms are determined.
const KERNEL: usize = 3;

/// The point within reach of `guess` where two singular values of ∇H^(σ) vanish, if H vanishes there, too.
///
/// With orthonormal vectors e of the kernel, and u of that of the transpose, the entries uᵢᵀ∇H eⱼ vanish there: six equations for the three
/// coordinates of a displacement Σ cⱼ eⱼ, which Gauss and Newton's method solves together with the rest of H for the displacement across
/// the kernel. They are regular where the two quadratic forms uᵢᵀ∇²H determine a point, as equations that say no more than that ∇H is
/// singular are not.
pub(in crate::continuation) fn multiple_point(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    selection: &Selection,
    (guess, reach): (&[f64], f64),
) -> Result<Option<Vec<f64>>, PiecewiseError> {
    let Some(rank) = map.num_vars().checked_sub(KERNEL).filter(|_| map.num_residuals() <= DENSE) else {
        return Ok(None);
    };
    let (mut x, mut last) = (guess.to_vec(), f64::INFINITY);
    for _ in 0..LIMIT {
        let frame = Frame {
            map,
            x: &x,
            vanishing: &[],
            tests: layout.total(),
            met: &[],
            theta: &[],
        };
        let mut near = Extension::new(&frame, selection)?;
        let known = near.rank <= rank;
        near.rank = rank;
        let Some(step) = near.towards_multiple_point() else {
            return Ok(None);
        };
        let length = norm(&step);
        // Rounding ends a convergence that was quadratic.
        if known && (length <= f64::EPSILON || length >= 0.5 * last) {
            let on_curve = near.vanishes();
            return Ok(on_curve.then_some(x));
        }
        if length >= last {
            return Ok(None);
        }
        last = length;
        let moved = x.iter().zip(step.iter().zip(&near.units));
        x = moved.map(|(x, (s, unit))| x + s * unit).collect();
        if distance(&x, guess) > reach {
            return Ok(None);
        }
    }
    Ok(None)
}

impl Extension<'_> {
    /// The step of Gauss and Newton's method, in balanced units.
    fn towards_multiple_point(&self) -> Option<Vec<f64>> {
        let basis = self.kernel();
        let of = |v: &[f64], order: usize| self.along(0, &[v], order).residual;
        let each: Vec<Vec<Vec<f64>>> = basis.iter().map(|e| of(e, 2)).collect();
        let mut step = self.solve(0, each.first()?.first()?);
        let (mut rows, mut right) = ([[0.0; KERNEL]; KERNEL], [0.0; KERNEL]);
        for j in 0..KERNEL {
            let mixed = |k: usize| -> Vec<f64> {
                let both: Vec<f64> = basis[j].iter().zip(&basis[k]).map(|(a, b)| a + b).collect();
                let sum = of(&both, 2).swap_remove(2);
                let own = each[j][2].iter().zip(&each[k][2]);
                sum.iter().zip(own).map(|(s, (a, b))| s - a - b).collect()
            };
            let second: [Vec<f64>; KERNEL] = [0, 1, 2].map(mixed);
            for u in self.cokernel() {
                let (value, slopes) = (dot(u, &each[j][1]), second.each_ref().map(|s| dot(u, s)));
                for (a, row) in rows.iter_mut().enumerate() {
                    right[a] -= slopes[a] * value;
                    row.iter_mut().zip(slopes).for_each(|(r, s)| *r += slopes[a] * s);
                }
            }
        }
        for (e, c) in basis.iter().zip(solve3(rows, right)?) {
            step.iter_mut().zip(e).for_each(|(s, e)| *s += c * e);
        }
        Some(step)
    }
}
