//! Taylor expansions of the pieces of a map along arcs: exact where the map gives them, else from differences of Jacobians.

use super::{PiecewiseSmooth, Selection, TestLayout};
use crate::sparse::Matrix;

/// Coefficients of an expansion: the orders 0 to 4.
pub(crate) const TERMS: usize = 5;

/// Taylor expansions of the pieces of a map along arcs.
///
/// Maps of formulas (`Traced`) have them. A map of your own that knows its higher derivatives
/// returns this from [`expansions`](PiecewiseSmooth::expansions): where Jacobians are singular, the branches that meet are then found
/// from derivatives without errors of differences.
pub trait Expansions {
    /// Coefficients of H^(σ)(x(s)) and of the test functions along x(s) = Σ arc\[k\] sᵏ, k = 0 … 4, at s = 0; those of the selection where
    /// kinks are [nested](PiecewiseSmooth::has_nested_kinks). `arc` holds at most 5 vectors of length m, and those it lacks are zero.
    /// Entry 5 i + k of `residual` (length 5 n) and of `tests` (5 times the number of test functions) is the coefficient of sᵏ. What is
    /// undefined is NaN or infinite.
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]);

    /// Enclosures (lower and upper ends, rounding included) of ∇H^(σ) and of the gradients of the test functions at all points of the box
    /// |x − centre| ≤ radius, component by component: entry m i + j belongs to row i and column j. Returns whether there are such
    /// enclosures: not where a function is undefined at a point of the box. Default: `false`.
    fn jacobian_within(
        &self,
        _selection: &Selection,
        _centre: &[f64],
        _radius: &[f64],
        _jacobian: &mut [(f64, f64)],
        _tests: &mut [(f64, f64)],
    ) -> bool {
        false
    }

    /// Enclosures of the coefficients that [`along`](Self::along) gives for the lines x + s·direction through all points x of the box
    /// |x − centre| ≤ radius: entry 5 i + k encloses the values, for k = 0, or the k-th derivatives divided by k!. Returns whether there
    /// are such enclosures. Default: `false`.
    fn derivatives_within(
        &self,
        _selection: &Selection,
        _centre: &[f64],
        _radius: &[f64],
        _direction: &[f64],
        _residual: &mut [(f64, f64)],
        _tests: &mut [(f64, f64)],
    ) -> bool {
        false
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

/// Exponents k of the lengths 2⁻ᵏ at which slopes are taken, from a quarter of the typical size of a variable. Third differences of slopes
/// with noise ν and truncation h⁴ are best at h = ν^(1/7) ℓ, where ℓ is the length over which the map is smooth: 2^(−7.4) ℓ for slopes to
/// rounding, 2⁻⁵ ℓ for slopes that are central differences themselves; the list goes on to ℓ = 10⁻³. The length is chosen for each
/// coefficient by its own differences.
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

    /// Their derivatives at x in a direction, zero where it has no entries; NaN where the Jacobian does not fit its pattern.
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

/// The odd and even parts of a function g at ± a length s: (g(s) − g(−s)) / 2s and (g(s) − 2 g(0) + g(−s)) / 2s².
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

#[cfg(all(test, feature = "autodiff"))]
mod tests {
    use super::*;
    use crate::piecewise::{Facet, Kinks, MinMap, NonsmoothFunction, Real, Scaled, Traced};
    use crate::spread::Random;

    /// Random curved formulas with a kink inside another; `speed` is the inverse of the length over which they are smooth.
    struct Curved {
        c: [f64; 8],
        speed: f64,
    }

    impl Curved {
        fn random(random: &mut Random, speed: f64) -> Self {
            let c = std::array::from_fn(|_| random.symmetric());
            Self { c, speed }
        }

        fn curves<T: Real>(&self, x: &[T]) -> [T; 3] {
            let c = &self.c;
            let z = (x[0] * c[0] + x[1] * c[1] + x[2] * c[2]) * self.speed;
            let w = (x[1] * c[3] - x[2] * c[4]) * self.speed;
            [
                z.sin() + w * z,
                w.sin().exp() + z * c[5],
                (z * z + 1.0).sqrt() / (w.cos() + 3.0) + c[6],
            ]
        }
    }

    impl NonsmoothFunction for Curved {
        fn num_vars(&self) -> usize {
            3
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            let [a, b, c] = self.curves(x);
            let inner = kinks.max(a, b);
            out[0] = kinks.abs(inner - c) + x[0] * self.c[7];
            out[1] = a * b - c;
        }
    }

    /// A map without its expansions.
    struct Hidden<P>(P);

    impl<P: PiecewiseSmooth> PiecewiseSmooth for Hidden<P> {
        fn num_vars(&self) -> usize {
            self.0.num_vars()
        }
        fn num_residuals(&self) -> usize {
            self.0.num_residuals()
        }
        fn num_sites(&self) -> usize {
            self.0.num_sites()
        }
        fn num_pieces(&self, site: usize) -> usize {
            self.0.num_pieces(site)
        }
        fn num_tests(&self, site: usize) -> usize {
            self.0.num_tests(site)
        }
        fn cell(&self, site: usize, piece: usize) -> &[Facet] {
            self.0.cell(site, piece)
        }
        fn test_functions(&self, x: &[f64], out: &mut [f64]) {
            self.0.test_functions(x, out);
        }
        fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
            self.0.residual(selection, x, out);
        }
        fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
            self.0.jacobian(selection, x, jac);
        }
        fn is_piecewise_affine(&self) -> bool {
            self.0.is_piecewise_affine()
        }
        fn tests_of_selection(&self, s: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
            self.0.tests_of_selection(s, x, d, out);
        }
    }

    /// Random vectors, the second of length 1.
    fn arc(random: &mut Random, m: usize) -> Vec<Vec<f64>> {
        let mut arc: Vec<Vec<f64>> = (0..TERMS)
            .map(|_| (0..m).map(|_| random.symmetric()).collect())
            .collect();
        let length = crate::sparse::norm(&arc[1]);
        arc[1].iter_mut().for_each(|v| *v /= length);
        arc
    }

    /// Coefficients of residuals and tests, and how they are known.
    fn expand(
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        arc: &[Vec<f64>],
    ) -> (Vec<f64>, Vec<f64>, Exactness) {
        let arc: Vec<&[f64]> = arc.iter().map(Vec::as_slice).collect();
        let mut residual = vec![f64::NAN; TERMS * map.num_residuals()];
        let mut tests = vec![f64::NAN; TERMS * TestLayout::new(map).total()];
        let exactness = along(map, selection, &arc, &mut residual, &mut tests);
        (residual, tests, exactness)
    }

    /// Whether estimates are within their own errors, and these within `limits` for each order.
    fn assert_estimates(
        map: &dyn PiecewiseSmooth,
        exact: &dyn PiecewiseSmooth,
        random: &mut Random,
        limits: [f64; 5],
    ) {
        let selection = Selection::from_pieces((0..map.num_sites()).map(|_| random.below(2)));
        let arc = arc(random, map.num_vars());
        let (
            residual,
            tests,
            Exactness::Estimated {
                residual: re,
                tests: te,
            },
        ) = expand(map, &selection, &arc)
        else {
            unreachable!("the map has no expansions");
        };
        let (r, t, exactness) = expand(exact, &selection, &arc);
        assert_eq!(exactness, Exactness::Exact);
        for (found, errors, exact) in [(residual, re, r), (tests, te, t)] {
            assert!(errors.len() == found.len() && exact.len() == found.len());
            for k in 0..found.len() {
                let difference = (found[k] - exact[k]).abs();
                let rounding = 8.0 * f64::EPSILON * (1.0 + exact[k].abs());
                assert!(
                    difference <= errors[k] + rounding,
                    "{k}: {difference:e} > {:e}",
                    errors[k]
                );
                assert!(errors[k] <= limits[k % TERMS], "{k}: error {:e}", errors[k]);
            }
        }
    }

    #[test]
    fn series_agree_with_differences_within_their_errors() {
        let mut random = Random::new(3);
        for _ in 0..60 {
            let function = Curved::random(&mut random, 1.0);
            let map = Traced::new(function);
            assert!(map.has_nested_kinks());
            assert_estimates(
                &Hidden(&map),
                &map,
                &mut random,
                [1e-14, 1e-11, 1e-10, 1e-8, 1e-6],
            );
        }
    }

    #[test]
    fn maps_that_vary_over_short_lengths_too() {
        let mut random = Random::new(4);
        for _ in 0..20 {
            let map = Traced::new(Curved::random(&mut random, 100.0));
            assert_estimates(&Hidden(&map), &map, &mut random, [1e-9, 1e-6, 1e-4, 1e-1, 1e2]);
        }
    }

    /// min(a, b) of the first two curves, and of the second and the third.
    struct Minima(Curved);

    impl NonsmoothFunction for Minima {
        fn num_vars(&self) -> usize {
            3
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            let [a, b, c] = self.0.curves(x);
            out[0] = kinks.min(a, b);
            out[1] = kinks.min(b, c);
        }
    }

    #[test]
    fn jacobians_by_differences_have_larger_errors_that_are_known() {
        let mut random = Random::new(5);
        for _ in 0..40 {
            let map = Traced::new(Minima(Curved::random(&mut random, 1.0)));
            let differences = MinMap::curve(2, |x: &[f64], first: &mut [f64], second: &mut [f64]| {
                let [a, b, c] = map.function().0.curves(x);
                first.copy_from_slice(&[a, b]);
                second.copy_from_slice(&[b, c]);
            });
            assert_estimates(&differences, &map, &mut random, [1e-14, 1e-8, 1e-7, 1e-5, 1e-3]);
        }
    }

    /// (y − α²) |y| + α⁴ and y³ − max(y, α).
    struct Quartic;

    impl NonsmoothFunction for Quartic {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            out[0] = (x[0] - x[1] * x[1]) * kinks.abs(x[0]) + x[1].powi(4);
            out[1] = x[0].powi(3) - kinks.max(x[0], x[1]);
        }
    }

    #[test]
    fn polynomials_are_exact() {
        // y = 2 s − s², α = 1 + s; |y| = −y, max = α.
        let arc = [vec![0.0, 1.0], vec![2.0, 1.0], vec![-1.0, 0.0]];
        let selection = Selection::from_pieces([1, 1]);
        let (residual, tests, exactness) = expand(&Traced::new(Quartic), &selection, &arc);
        assert_eq!(exactness, Exactness::Exact);
        // (2 s − s² − (1 + s)²)(s² − 2 s) + (1 + s)⁴, (2 s − s²)³ − 1 − s.
        let expected = [[1.0, 6.0, 5.0, 8.0, -1.0], [-1.0, -1.0, 0.0, 8.0, -12.0]];
        assert_eq!(residual, expected.concat());
        // y and y − α.
        assert_eq!(
            tests,
            [[0.0, 2.0, -1.0, 0.0, 0.0], [-1.0, 1.0, -1.0, 0.0, 0.0]].concat()
        );
    }

    /// |x + 3 y| − 2 y, by `is_piecewise_affine`.
    struct Affine;

    impl NonsmoothFunction for Affine {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            out[0] = kinks.abs(x[0] + x[1] * 3.0) - x[1] * 2.0 + 1.0;
        }
        fn is_piecewise_affine(&self) -> bool {
            true
        }
    }

    #[test]
    fn affine_pieces_are_exact_without_series() {
        let arc = [
            vec![1.0, 2.0],
            vec![1.0, 0.0],
            vec![0.0, 1.0],
            vec![],
            vec![0.5, 0.0],
        ];
        let selection = Selection::from_pieces([1]);
        for map in [
            &Traced::new(Affine) as &dyn PiecewiseSmooth,
            &Hidden(Traced::new(Affine)),
        ] {
            let (residual, tests, exactness) = expand(map, &selection, &arc);
            assert_eq!(exactness, Exactness::Exact);
            assert_eq!(residual, [-10.0, -1.0, -5.0, 0.0, -0.5]);
            assert_eq!(tests, [7.0, 1.0, 3.0, 0.0, 0.5]);
        }
    }

    /// Arcs in scaled variables are those of the map in its own.
    #[test]
    fn scaled_maps_scale_arcs() {
        let mut random = Random::new(6);
        let map = Traced::new(Curved::random(&mut random, 1.0));
        let sizes = [1024.0, 1.0, 0.125];
        let own = arc(&mut random, 3);
        let divided = |a: &Vec<f64>| a.iter().zip(sizes).map(|(v, s)| v / s).collect();
        let scaled: Vec<Vec<f64>> = own.iter().map(divided).collect();
        let selection = Selection::from_pieces([1, 0]);
        let expected = expand(&map, &selection, &own);
        let with_sizes = Scaled::with_divisors(&map, sizes.to_vec()).unwrap();
        assert_eq!(expand(&with_sizes, &selection, &scaled), expected);
        let without = Scaled::with_divisors(&map, Vec::new()).unwrap();
        assert_eq!(expand(&without, &selection, &own), expected);
    }
}
