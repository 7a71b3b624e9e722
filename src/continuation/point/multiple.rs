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
            norm(
                &scaled
                    .map(|((s, unit), size)| s * unit / size)
                    .collect::<Vec<_>>(),
            )
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

#[cfg(test)]
mod tests {
    use super::multiple_point;
    use crate::continuation::point::arc::Arc;
    use crate::continuation::point::extension::{Extension, Frame};
    use crate::continuation::point::reduced::Reduced;
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::{Selection, TestLayout};

    fn frame<'a>(map: &'a Plane, x: &'a [f64]) -> Frame<'a> {
        Frame {
            map,
            x,
            vanishing: &[],
            tests: 0,
            met: &[],
            theta: &[],
            off: 0.0,
        }
    }

    /// At (1, 2): a crossing, a cusp, curves that touch, three lines.
    const DEGENERATE: [(Function, f64); 4] = [
        (|y, a| product(y, a, 1.0, [0.5, -0.5, 0.0, 0.0], 2), 1.0),
        (
            |y, a| {
                let (y, a) = (y - 1.0, a - 2.0);
                [y * y - a * a * a, 2.0 * y, -3.0 * a * a]
            },
            1.5,
        ),
        (|y, a| product(y, a, 2.0, [0.75, -0.5, 0.0, 0.0], 2), 2.0),
        (|y, a| product(y, a, 1.0, [0.5, -0.75, 0.25, 0.0], 3), 2.0),
    ];

    /// The product of the first so many y − cₖ aᵖ, p = 1 or 2, about (1, 2), with its derivatives.
    fn product(y: f64, a: f64, power: f64, slopes: [f64; 4], number: usize) -> [f64; 3] {
        let (y, a) = (y - 1.0, a - 2.0);
        let term = |c: f64| if power == 1.0 { c * a } else { c * a * a };
        let rate = |c: f64| if power == 1.0 { c } else { 2.0 * c * a };
        let all = &slopes[..number];
        let others = |k: usize| -> f64 {
            let rest = all.iter().enumerate().filter(|(j, _)| *j != k);
            rest.map(|(_, &c)| y - term(c)).product()
        };
        let dy = (0..number).map(others).sum();
        let da = (0..number).map(|k| -rate(all[k]) * others(k)).sum();
        [all.iter().map(|&c| y - term(c)).product(), dy, da]
    }

    /// From 0.02 beside them all are located: crossings to rounding, others as well as their equations tell, and the error that is told
    /// covers what is left.
    #[test]
    fn degenerate_points_are_located_with_their_errors() {
        for (k, (function, _)) in DEGENERATE.into_iter().enumerate() {
            let map = Plane::smooth(function);
            let (layout, selection) = (TestLayout::new(&map), Selection::uniform(1, 0));
            let guess = [1.0 + 1e-3, 2.0 + 0.02];
            let x = multiple_point(&map, &layout, &selection, (&guess, 1.0), 2).unwrap();
            let x = x.unwrap_or_else(|| panic!("{k}"));
            let off = (x[0] - 1.0).hypot(x[1] - 2.0);
            assert!(off <= [4e-16, 1e-8, 1e-5, 1e-8][k], "{k}: {off}");
            let frame = frame(&map, &x);
            let mut here = Extension::new(&frame, &selection).unwrap();
            here.rank = 0;
            let told = here.location_error().unwrap();
            assert!(told + 1e-15 >= 0.2 * off && told <= 1e-4, "{k}: {told} for {off}");
        }
    }

    /// There is none beyond the reach, and none where H does not vanish.
    #[test]
    fn points_off_the_curve_or_beyond_the_reach_are_none() {
        let apart: Function = |y, a| [(y - 1.0) * (y - 1.0) - a * a + 1e-9, 2.0 * (y - 1.0), -2.0 * a];
        let map = Plane::smooth(apart);
        let (layout, selection) = (TestLayout::new(&map), Selection::uniform(1, 0));
        let at = |reach: f64, map: &Plane| {
            multiple_point(map, &layout, &selection, (&[1.01, 0.02], reach), 2).unwrap()
        };
        assert_eq!(at(1.0, &map), None);
        let crossing: Function = |y, a| [(y - 1.0) * (y - 1.0) - a * a, 2.0 * (y - 1.0), -2.0 * a];
        let map = Plane::smooth(crossing);
        assert!(at(1.0, &map).is_some());
        assert_eq!(at(0.02, &map), None);
    }

    /// On each arm the determinant grows with the power of the distance that is told.
    #[test]
    fn orders_of_arms_are_those_of_their_determinants() {
        for (function, order) in DEGENERATE {
            let map = Plane::smooth(function);
            let x = [1.0, 2.0];
            let frame = frame(&map, &x);
            let selection = Selection::uniform(1, 0);
            let here = Extension::new(&frame, &selection).unwrap();
            let Reduced::Arms(arms) = here.reduced() else {
                panic!("order {order}: no arms");
            };
            assert!(!arms.is_empty());
            for arcs in arms {
                assert_eq!(arcs[0].order, order);
                let arc: Arc = here.unscaled(&arcs[0]);
                let size = |s: f64| {
                    let d = arc.at(s);
                    let [_, dy, da] = function(1.0 + d[0], 2.0 + d[1]);
                    dy.hypot(da)
                };
                let power = (size(2e-3) / size(1e-3)).log2();
                assert!((power - order).abs() < 0.02, "{power} instead of {order}");
            }
        }
    }
}
