//! Taylor expansions of the pieces of a map along arcs: exact where the map gives them, else from differences
//! of Jacobians.

use super::{PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout};
use crate::sparse::Matrix;

/// Coefficients of an expansion: the orders 0 to 4.
pub(crate) const TERMS: usize = 5;

/// How coefficients are known.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Exactness {
    /// To rounding.
    Exact,
    /// From differences; with estimates of the errors, in the order of the coefficients.
    Estimated { residual: Vec<f64>, tests: Vec<f64> },
}

/// As [`Expansions::along`], for any map. Without expansions, coefficients beyond the first come from
/// differences of J(x(s)) x′(s) in s, for which the arc should have about the speed 1 in variables whose
/// typical size is 1.
pub(crate) fn along(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    arc: &[&[f64]],
    residual: &mut [f64],
    tests: &mut [f64],
) -> Exactness {
    if let Some(expansions) = map.expansions() {
        expansions.along(selection, arc, residual, tests);
        return Exactness::Exact;
    }
    let count = map.num_residuals();
    let mut curve = Curve::new(map, selection, arc);
    let (base, _) = curve.point(0.0);
    let outputs = residual
        .chunks_exact_mut(TERMS)
        .chain(tests.chunks_exact_mut(TERMS));
    if map.is_piecewise_affine() {
        let mut orders = vec![curve.values(&base)];
        orders.extend((1..TERMS).map(|k| curve.slopes(&base, arc.get(k).copied().unwrap_or(&[]))));
        for (i, out) in outputs.enumerate() {
            out.iter_mut().zip(&orders).for_each(|(o, c)| *o = c[i]);
        }
        return Exactness::Exact;
    }
    let sizes = curve.slopes(&base, &base);
    let [value, slope] = curve.at(0.0);
    let samples = LENGTHS.map(|k| {
        let s = 0.5_f64.powi(k);
        (s, curve.at(s), curve.at(-s))
    });
    let errors = outputs.enumerate().flat_map(|(i, out)| {
        let halves = |of: usize, start: f64| {
            samples.each_ref().map(|(s, plus, minus)| {
                let [plus, minus] = [plus, minus].map(|at| at[of][i]);
                Halves {
                    length: *s,
                    odd: 0.5 * (plus - minus) / s,
                    even: 0.5 * ((plus - start) + (minus - start)) / (s * s),
                }
            })
        };
        // Jacobians that are differences themselves may be less exact than the slope of values.
        let [(by_values, error), ..] = derivatives(&halves(0, value[i]));
        let [second, third, fourth] = derivatives(&halves(1, slope[i]));
        let rounding = f64::EPSILON * (value[i].abs() + sizes[i].abs());
        out.copy_from_slice(&[value[i], slope[i], second.0 / 2.0, third.0 / 3.0, fourth.0 / 4.0]);
        let first = (by_values - slope[i]).abs() + error;
        [rounding, first, second.1 / 2.0, third.1 / 3.0, fourth.1 / 4.0]
    });
    let mut residual: Vec<f64> = errors.collect();
    let tests = residual.split_off(TERMS * count);
    Exactness::Estimated { residual, tests }
}

/// Exponents k of the lengths 2⁻ᵏ at which slopes are taken, from a quarter of the typical size of a
/// variable. Third differences of slopes with noise ν and truncation h⁴ are best at h = ν^(1/7) ℓ, where ℓ is
/// the length over which the map is smooth: 2^(−7.4) ℓ for slopes to rounding, 2⁻⁵ ℓ for slopes that are
/// central differences themselves; the list goes on to ℓ = 10⁻³. The length is chosen for each coefficient by
/// its own differences.
const LENGTHS: [i32; 16] = [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17];

/// Residuals and test functions along the arc, and their slopes J(x(s)) x′(s).
struct Curve<'a> {
    map: &'a dyn PiecewiseSmooth,
    selection: &'a Selection,
    arc: &'a [&'a [f64]],
    jac: Matrix,
    tests: usize,
}

impl<'a> Curve<'a> {
    fn new(map: &'a dyn PiecewiseSmooth, selection: &'a Selection, arc: &'a [&'a [f64]]) -> Self {
        Self {
            map,
            selection,
            arc: &arc[..arc.len().min(TERMS)],
            jac: Matrix::zeros(map.pattern()),
            tests: TestLayout::new(map).total(),
        }
    }

    /// x(s) and x′(s).
    fn point(&self, s: f64) -> (Vec<f64>, Vec<f64>) {
        let sum = |j: usize, derivative: bool| {
            let terms = self.arc.iter().enumerate().skip(usize::from(derivative)).rev();
            terms.fold(0.0, |sum, (k, a)| {
                let factor = if derivative { k as f64 } else { 1.0 };
                sum * s + factor * a.get(j).copied().unwrap_or(0.0)
            })
        };
        let all = |derivative| (0..self.map.num_vars()).map(|j| sum(j, derivative)).collect();
        (all(false), all(true))
    }

    fn values(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.map.num_residuals() + self.tests];
        let (residual, tests) = out.split_at_mut(self.map.num_residuals());
        self.map.residual(self.selection, x, residual);
        self.map.tests_of_selection(self.selection, x, None, tests);
        out
    }

    /// Their derivatives at x in a direction, zero where it has no entries; NaN where the Jacobian does not
    /// fit its pattern.
    fn slopes(&mut self, x: &[f64], direction: &[f64]) -> Vec<f64> {
        let n = self.map.num_residuals();
        let mut out = vec![0.0; n + self.tests];
        if direction.iter().all(|d| *d == 0.0) {
            return out;
        }
        self.jac.clear();
        self.map.jacobian(self.selection, x, &mut self.jac);
        if self.jac.stray().is_some() {
            out.fill(f64::NAN);
            return out;
        }
        let (residual, tests) = out.split_at_mut(n);
        self.jac.mul_vec(direction, residual);
        self.map
            .tests_of_selection(self.selection, x, Some(direction), tests);
        out
    }

    fn at(&mut self, s: f64) -> [Vec<f64>; 2] {
        let (x, direction) = self.point(s);
        [self.values(&x), self.slopes(&x, &direction)]
    }
}

/// The odd and even parts of a function g at ± a length s: (g(s) − g(−s)) / 2s and (g(s) − 2 g(0) + g(−s)) /
/// 2s².
#[derive(Clone, Copy)]
struct Halves {
    length: f64,
    odd: f64,
    even: f64,
}

/// g′, g″/2 and g‴/6 at 0, with estimates of their errors, from lengths each of which is half the one before.
fn derivatives(halves: &[Halves]) -> [(f64, f64); 3] {
    let windows = halves.windows(3).map(|w| {
        // Interpolation in t = s² at t, 4 t and 16 t: its value and slope at t = 0.
        let [coarse, middle, fine] = [w[0], w[1], w[2]];
        let at_zero = |coarse: f64, middle: f64, fine: f64| {
            let first = (middle - fine) / 3.0;
            let second = ((coarse - middle) / 12.0 - first) / 15.0;
            [fine - first + 4.0 * second, first - 5.0 * second]
        };
        let [odd, cubic] = at_zero(coarse.odd, middle.odd, fine.odd);
        let [even, _] = at_zero(coarse.even, middle.even, fine.even);
        [odd, even, cubic / (fine.length * fine.length)]
    });
    let windows: Vec<[f64; 3]> = windows.collect();
    std::array::from_fn(|k| best(&windows, k))
}

/// Of the values of derivative k + 1 for shrinking lengths, the one with the smallest estimate of its error,
/// and twice this estimate. It bounds truncation by the distance from the value for the next larger length,
/// which is 16 or 64 times less exact, and rounding by the distances between the values for smaller lengths,
/// where rounding grows with the power −(k + 1) of the length.
fn best(windows: &[[f64; 3]], k: usize) -> (f64, f64) {
    let growth = 0.5_f64.powi(k as i32 + 1);
    let mut noise = 0.0_f64;
    let mut found = (f64::NAN, f64::INFINITY);
    for w in windows.windows(3).rev() {
        let [coarse, here, fine] = [w[0][k], w[1][k], w[2][k]];
        noise = (noise * growth).max((here - fine).abs());
        let error = 2.0 * noise.max((here - coarse).abs()) + f64::EPSILON * here.abs();
        // False where a value is not a number.
        if (here - coarse).is_finite() && error < found.1 {
            found = (here, error);
        }
    }
    found
}

#[cfg(all(test, feature = "autodiff"))]
mod tests;
