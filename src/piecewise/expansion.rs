//! Taylor expansions of the pieces of a map along arcs: exact where the map gives them, else from differences of Jacobians.

use super::{PiecewiseSmooth, Selection, TestLayout};
use crate::sparse::Matrix;

/// Coefficients of an expansion: the orders 0 to 4.
pub(crate) const TERMS: usize = 5;

/// Taylor expansions of the pieces of a map along arcs.
///
/// Maps of formulas have them ([`Traced`](crate::piecewise::NonsmoothFunction)). A map of your own that knows its higher derivatives
/// returns this from [`expansions`](PiecewiseSmooth::expansions): where Jacobians are singular, the branches that meet are then found
/// from derivatives without errors of differences.
pub trait Expansions {
    /// Coefficients of H^(σ)(x(s)) and of the test functions along x(s) = Σ arc\[k\] sᵏ, k = 0 … 4, at s = 0; those of the selection where
    /// kinks are [nested](PiecewiseSmooth::has_nested_kinks). `arc` holds at most 5 vectors of length m, and those it lacks are zero.
    /// Entry 5 i + k of `residual` (length 5 n) and of `tests` (5 times the number of test functions) is the coefficient of sᵏ. What is
    /// undefined is NaN or infinite.
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]);
}

impl<E: Expansions + ?Sized> Expansions for &E {
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]) {
        (**self).along(selection, arc, residual, tests);
    }
}

/// How coefficients are known.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Exactness {
    /// To rounding.
    Exact,
    /// From differences; with estimates of the errors, in the order of the coefficients.
    Estimated { residual: Vec<f64>, tests: Vec<f64> },
}

/// As [`Expansions::along`], for any map. Without expansions, coefficients beyond the first come from differences of J(x(s)) x′(s) in s,
/// for which the arc should have about the speed 1 in variables whose typical size is 1.
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
    let mut slopes = Slopes::new(map, selection, arc);
    let values = slopes.values();
    let outputs = residual
        .chunks_exact_mut(TERMS)
        .chain(tests.chunks_exact_mut(TERMS));
    if map.is_piecewise_affine() {
        let base = slopes.point(0.0).0;
        let orders: Vec<Vec<f64>> = (0..TERMS)
            .map(|k| slopes.along(&base, arc.get(k).copied().unwrap_or(&[])))
            .collect();
        for (i, out) in outputs.enumerate() {
            out.iter_mut().zip(&orders).for_each(|(o, c)| *o = c[i]);
            out[0] = values[i];
        }
        return Exactness::Exact;
    }
    let base = slopes.point(0.0).0;
    let sizes = slopes.along(&base, &base);
    let start = slopes.at(0.0);
    let samples = LENGTHS.map(|k| {
        let s = 0.5_f64.powi(k);
        (s, slopes.at(s), slopes.at(-s))
    });
    let errors = outputs.enumerate().flat_map(|(i, out)| {
        let halves = samples.each_ref().map(|(s, plus, minus)| Halves {
            length: *s,
            odd: 0.5 * (plus[i] - minus[i]) / s,
            even: 0.5 * ((plus[i] - start[i]) + (minus[i] - start[i])) / (s * s),
        });
        let found = Derivatives::new(&halves);
        let [first, second, third] = found.values;
        out.copy_from_slice(&[values[i], start[i], first / 2.0, second / 3.0, third / 4.0]);
        let rounding = |terms: f64| f64::EPSILON * terms;
        let [first, second, third] = found.errors;
        [
            rounding(values[i].abs() + sizes[i].abs()),
            rounding(start[i].abs()) + found.noise,
            first / 2.0,
            second / 3.0,
            third / 4.0,
        ]
    });
    let mut residual: Vec<f64> = errors.collect();
    let tests = residual.split_off(TERMS * count);
    Exactness::Estimated { residual, tests }
}

/// Exponents k of the lengths 2⁻ᵏ at which slopes are taken, from a quarter of the typical size of a variable. Third differences of slopes
/// with noise ν and truncation h⁴ are best at h = ν^(1/7) ℓ, where ℓ is the length over which the map is smooth: 2^(−7.4) ℓ for slopes to
/// rounding, 2⁻⁵ ℓ for slopes that are central differences themselves; the list goes on to ℓ = 10⁻³. The length is chosen for each
/// coefficient by its own differences.
const LENGTHS: [i32; 16] = [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17];

/// The slopes J(x(s)) x′(s) of residuals and test functions.
struct Slopes<'a> {
    map: &'a dyn PiecewiseSmooth,
    selection: &'a Selection,
    arc: &'a [&'a [f64]],
    jac: Matrix,
    tests: usize,
}

impl<'a> Slopes<'a> {
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

    /// Residuals and test functions at the start.
    fn values(&self) -> Vec<f64> {
        let x = self.point(0.0).0;
        let mut out = vec![0.0; self.map.num_residuals() + self.tests];
        let (residual, tests) = out.split_at_mut(self.map.num_residuals());
        self.map.residual(self.selection, &x, residual);
        self.map.tests_of_selection(self.selection, &x, None, tests);
        out
    }

    /// Their derivatives at x in a direction, zero where it has no entries; NaN where the Jacobian does not fit its pattern.
    fn along(&mut self, x: &[f64], direction: &[f64]) -> Vec<f64> {
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

    fn at(&mut self, s: f64) -> Vec<f64> {
        let (x, direction) = self.point(s);
        self.along(&x, &direction)
    }
}

/// The odd and even parts of a slope g at ± a length s: (g(s) − g(−s)) / 2s and (g(s) − 2 g(0) + g(−s)) / 2s².
#[derive(Clone, Copy)]
struct Halves {
    length: f64,
    odd: f64,
    even: f64,
}

/// g′, g″/2 and g‴/6 at 0, with estimates of their errors and of the noise of g itself.
struct Derivatives {
    values: [f64; 3],
    errors: [f64; 3],
    noise: f64,
}

impl Derivatives {
    /// From lengths each of which is half the one before.
    fn new(halves: &[Halves]) -> Self {
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
        let best: [(f64, f64); 3] = std::array::from_fn(|k| best(&windows, k));
        // At the shortest lengths, second differences that g″ does not explain are noise.
        let even = best[1].0;
        let left = |h: &Halves| ((h.even - even) * h.length * h.length).abs();
        let noise = halves.iter().rev().take(4).map(left).fold(0.0, f64::max);
        Self {
            values: best.map(|b| b.0),
            errors: best.map(|b| b.1),
            noise,
        }
    }
}

/// Of the values of derivative k + 1 for shrinking lengths, the one with the smallest estimate of its error, and twice this estimate. It
/// bounds truncation by the distance from the value for the next larger length, which is 16 or 64 times less exact, and rounding by the
/// distances between the values for smaller lengths, where rounding grows with the power −(k + 1) of the length.
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
