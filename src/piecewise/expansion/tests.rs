use super::*;
use crate::piecewise::{Derivatives, Facet, Kinks, MinMap, NonsmoothFunction, Real, Scaled, Traced};
use crate::spread::Random;

/// Random curved formulas with a kink inside another; `speed` is the inverse of the length over which they
/// are smooth.
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
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl<P: PiecewiseSmooth> Derivatives for Hidden<P> {
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
        assert!(PiecewiseSmoothExt::has_nested_kinks(&map));
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
        // The limits above, for values up to 10⁶ and 100ᵏ times faster changes.
        assert_estimates(&Hidden(&map), &map, &mut random, [1e-8, 1e-3, 1.0, 1e4, 1e8]);
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

/// Ends of enclosures: of Jacobians and gradients of the tests, or of coefficients.
type Ends = Vec<(f64, f64)>;

fn derivatives_within(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    [centre, radius, direction]: [&[f64]; 3],
) -> Option<[Ends; 4]> {
    let (m, n, t) = (map.num_vars(), map.num_residuals(), TestLayout::new(map).total());
    let ends = |count| vec![(f64::NAN, f64::NAN); count];
    let mut all = [ends(m * n), ends(m * t), ends(TERMS * n), ends(TERMS * t)];
    let [jacobian, gradients, residual, tests] = &mut all;
    let expansions = map.expansions()?;
    let first = expansions.jacobian_within(selection, centre, radius, jacobian, gradients);
    let higher = expansions.derivatives_within(selection, centre, radius, direction, residual, tests);
    assert_eq!(first, higher);
    first.then_some(all)
}

/// Jacobians, gradients and coefficients at points of a box lie in their enclosures, in scaled variables,
/// too.
#[test]
fn derivatives_lie_in_their_enclosures() {
    let mut random = Random::new(12);
    for case in 0..60 {
        let map = Traced::new(Curved::random(&mut random, 1.0));
        let sizes = if case % 2 == 0 {
            Vec::new()
        } else {
            vec![4.0, 0.25, 1.0]
        };
        let map = Scaled::with_divisors(map, sizes).unwrap();
        let selection = Selection::from_pieces([random.below(2), random.below(2)]);
        let [centre, direction] = [(); 2].map(|()| (0..3).map(|_| random.symmetric()).collect::<Vec<f64>>());
        let radius: Vec<f64> = (0..3).map(|k| 0.1_f64.powi(case % 8 + k)).collect();
        let enclosed = derivatives_within(&map, &selection, [&centre, &radius, &direction]).unwrap();
        for _ in 0..5 {
            let x: Vec<f64> = (0..3)
                .map(|j| centre[j] + radius[j] * random.symmetric())
                .collect();
            let (residual, tests, _) = expand(&map, &selection, &[x.clone(), direction.clone()]);
            let mut exact = [Vec::new(), Vec::new(), residual, tests];
            // Columns of Jacobians and gradients are first coefficients along the axes.
            let columns = (0..3).map(|j| {
                let axis = (0..3).map(|k| f64::from(u8::from(j == k))).collect();
                expand(&map, &selection, &[x.clone(), axis])
            });
            let columns: Vec<_> = columns.collect();
            for i in 0..2 {
                exact[0].extend(columns.iter().map(|c| c.0[TERMS * i + 1]));
                exact[1].extend(columns.iter().map(|c| c.1[TERMS * i + 1]));
            }
            for (found, ends) in exact.iter().flatten().zip(enclosed.iter().flatten()) {
                assert!(ends.0 <= *found && *found <= ends.1, "{found} {ends:?}");
            }
        }
        // The ends are near each other in small boxes.
        let widest = enclosed.iter().flatten().map(|e| e.1 - e.0).fold(0.0, f64::max);
        assert!(widest <= 1e3 * radius[0] + 1e-10, "{widest} {radius:?}");
    }
}

/// √(x − 1) and a branch at x = 0 that is no kink.
struct Partial;

impl NonsmoothFunction for Partial {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        let y = if x[1].value() > 0.0 { x[1] * 2.0 } else { x[1] };
        out[0] = (x[0] - 1.0).sqrt() + y;
    }
}

#[test]
fn nothing_is_enclosed_where_functions_are_undefined_or_branch() {
    let map = Traced::new(Partial);
    let none = Selection::from_pieces([]);
    let at = |x: [f64; 2], radius: [f64; 2]| derivatives_within(&map, &none, [&x, &radius, &[1.0, 1.0]]);
    let [jacobian, ..] = at([2.0, 1.0], [0.5, 0.0]).unwrap();
    assert!(jacobian[0].0 <= 0.5 / 1.5_f64.sqrt() && 0.5 / 0.5_f64.sqrt() <= jacobian[0].1);
    assert_eq!(jacobian[1], (2.0, 2.0));
    assert_eq!(at([2.0, -1.0], [0.5, 0.0]).unwrap()[0][1], (1.0, 1.0));
    assert!(at([2.0, 1.0], [1.5, 0.0]).is_none());
    assert!(at([2.0, 0.0], [0.5, 0.1]).is_none());
    assert!(at([2.0, 1.0], [f64::NAN, 0.0]).is_none());
    // Maps without expansions enclose nothing.
    assert!(derivatives_within(&Hidden(map), &none, [&[2.0, 1.0], &[0.0; 2], &[1.0; 2]]).is_none());
}
