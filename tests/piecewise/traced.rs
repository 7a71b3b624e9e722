//! Functions written once, generic over the scalar type.

use proptest::prelude::*;
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::piecewise::check::{CheckOptions, check};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection, select, value};
use semismooth::sparse::Matrix;

const N: usize = 19;

/// All kinds of kinks over 19 variables: three sweeps of eight.
struct Zoo;

impl NonsmoothFunction for Zoo {
    fn num_vars(&self) -> usize {
        N
    }
    fn num_residuals(&self) -> usize {
        N
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        for i in 0..N {
            let (a, b) = (x[i], x[(i + 11) % N]);
            out[i] = match i % 5 {
                0 => kinks.max(a * a, b),
                1 => kinks.min(a, b * 2.0),
                2 => kinks.abs(a - b),
                3 => kinks.positive_part(a * b),
                _ => kinks.project(b - 1.0, a * 3.0, b + 1.0),
            };
        }
    }
}

/// Gradient of row i of the selection with respect to (x_i, x_{i+11}).
fn by_hand(i: usize, piece: usize, a: f64, b: f64) -> [f64; 2] {
    match (i % 5, piece) {
        (0, 0) => [2.0 * a, 0.0],
        (0, _) => [0.0, 1.0],
        (1, 0) => [1.0, 0.0],
        (1, _) => [0.0, 2.0],
        (2, 0) => [1.0, -1.0],
        (2, _) => [-1.0, 1.0],
        (3, 0) => [b, a],
        (3, _) => [0.0, 0.0],
        (_, 1) => [3.0, 0.0],
        _ => [0.0, 1.0],
    }
}

#[test]
fn jacobians_are_exact_over_several_sweeps() {
    let map = Traced::new(Zoo);
    assert_eq!(map.num_sites(), N);
    let x: Vec<f64> = (0..N).map(|k| 1.7 * (k as f64 * 2.1 + 0.4).sin()).collect();
    let mut jac = Matrix::zeros(map.pattern());
    for shift in 0..3 {
        let pieces = (0..N).map(|s| (s + shift) % map.num_pieces(s));
        let selection = Selection::from_pieces(pieces);
        jac.clear();
        map.jacobian(&selection, &x, &mut jac);
        for i in 0..N {
            let j = (i + 11) % N;
            let hand = by_hand(i, selection.piece(i), x[i], x[j]);
            for k in 0..N {
                let expected = if k == i {
                    hand[0]
                } else if k == j {
                    hand[1]
                } else {
                    0.0
                };
                assert!(
                    (jac.get(i, k) - expected).abs() <= 1e-15 * expected.abs(),
                    "({i}, {k})"
                );
            }
        }
    }
}

#[test]
fn the_checker_passes_traced_functions() {
    let map = Traced::new(Zoo);
    let samples: Vec<Vec<f64>> = (0..6)
        .map(|k| (0..N).map(|j| 2.0 * ((k * 31 + j * 17) as f64).sin()).collect())
        .collect();
    let report = check(&map, &samples, &CheckOptions::default()).unwrap();
    assert!(report.boundaries > 20, "{report:?}");
}

#[test]
fn pieces_and_names_follow_the_values() {
    let map = Traced::new(Zoo);
    let mut x = vec![0.0; N];
    x[0] = 2.0; // a² = 4 > b = 0
    x[1] = 1.0; // a = 1 > 2 b = 0
    x[2] = -1.0; // a − b < 0
    x[3] = 1.0;
    x[14] = -1.0; // a b < 0
    x[4] = 1.0; // 3 a > b + 1
    let s = select(&map, &x);
    let names: Vec<String> = (0..5)
        .map(|i| map.piece_name(i, s.piece(i)).into_owned())
        .collect();
    assert_eq!(names, ["first", "second", "negative", "second", "upper"]);
    let mut h = vec![0.0; N];
    value(&map, &x, &mut h);
    assert_eq!(h[..5], [4.0, 0.0, 1.0, 0.0, 1.0]);
    x[4] = -1.0;
    assert_eq!(map.piece_name(4, select(&map, &x).piece(4)), "lower");
    x[4] = 0.1;
    assert_eq!(map.piece_name(4, select(&map, &x).piece(4)), "interior");
}

/// One elementary function per component, each of its own variable.
struct Elementary;

impl NonsmoothFunction for Elementary {
    fn num_vars(&self) -> usize {
        13
    }
    fn num_residuals(&self) -> usize {
        13
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0].sqrt();
        out[1] = x[1].exp();
        out[2] = x[2].ln();
        out[3] = x[3].sin();
        out[4] = x[4].cos();
        out[5] = x[5].tanh();
        out[6] = x[6].powi(-3);
        out[7] = x[7].powf(1.7);
        out[8] = T::from(2.0) / x[8] - x[8];
        out[9] = (x[9] * 0.4).tan();
        out[10] = x[10].atan();
        out[11] = x[11].sinh();
        out[12] = x[12].cosh();
    }
}

proptest! {
#![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn derivatives_of_elementary_functions(x in prop::collection::vec(0.2..3.0_f64, 13)) {
        let map = Traced::new(Elementary);
        let expected = [
            0.5 / x[0].sqrt(),
            x[1].exp(),
            1.0 / x[2],
            x[3].cos(),
            -x[4].sin(),
            1.0 - x[5].tanh().powi(2),
            -3.0 * x[6].powi(-4),
            1.7 * x[7].powf(0.7),
            -2.0 / (x[8] * x[8]) - 1.0,
            0.4 * (1.0 + (0.4 * x[9]).tan().powi(2)),
            1.0 / (1.0 + x[10] * x[10]),
            x[11].cosh(),
            x[12].sinh(),
        ];
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&Selection::default(), &x, &mut jac);
        let mut h = vec![0.0; 13];
        map.residual(&Selection::default(), &x, &mut h);
        let values = [x[7].powf(1.7), (0.4 * x[9]).tan(), x[10].atan(), x[11].sinh(), x[12].cosh()];
        for (i, value) in [7, 9, 10, 11, 12].into_iter().zip(values) {
            prop_assert!((h[i] - value).abs() < 1e-14 * value);
        }
        for i in 0..13 {
            for j in 0..13 {
                let e = if i == j { expected[i] } else { 0.0 };
                let size = if i == j { e.abs().max(1e-2) } else { 0.0 };
                prop_assert!((jac.get(i, j) - e).abs() <= 1e-13 * size);
            }
        }
    }
}

/// |max(y, 0) − 1| = α, declared affine, too: nested kinks.
struct Nested;

impl NonsmoothFunction for Nested {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let ramp = kinks.positive_part(x[0]);
        out[0] = kinks.abs(ramp - 1.0) - x[1];
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

/// α = max(y, 2 y) · 10³, declared affine, with the typical size of y.
struct Ramp;

impl NonsmoothFunction for Ramp {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.max(x[0], x[0] * 2.0) * 1e3 - x[1];
    }
    fn typical_sizes(&self, sizes: &mut [f64]) {
        sizes[0] = 1e-3;
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

#[test]
fn what_a_function_declares_is_passed_on() {
    let map = Traced::new(Ramp);
    let mut sizes = [1.0; 2];
    map.typical_sizes(&mut sizes);
    assert_eq!(sizes, [1e-3, 1.0]);
    assert!(map.is_piecewise_affine() && !Traced::new(Nested).is_piecewise_affine());
    // From corner to corner: start, kink, end.
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let branch = Branch::follow(&map, &[-1e-3, -1.0], Direction::Increasing, options).unwrap();
    assert_eq!((branch.points.len(), branch.transitions.len()), (2, 1));
    assert_eq!(branch.transitions[0].x, [0.0, 0.0]);
}

/// A kink on one side of an `if` only: the side that does not contain x = 0 is outside the domain.
#[test]
fn kinks_that_come_and_go_are_noticed() {
    struct Sometimes(f64);
    impl NonsmoothFunction for Sometimes {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            let first = kinks.abs(x[1]);
            let second = if x[0].value() > self.0 {
                kinks.abs(x[0] - 1.0)
            } else {
                x[0]
            };
            out[0] = first + second;
        }
    }
    for side in [0.5, -0.5] {
        let map = Traced::new(Sometimes(side));
        let sites = if side > 0.0 { 1 } else { 2 };
        assert_eq!(map.num_sites(), sites);
        let mut out = [0.0];
        for x in [-2.0, 0.0, 2.0] {
            value(&map, &[x, 1.0], &mut out);
            assert_eq!(out[0].is_nan(), (x > side) != (0.0 > side), "{side} {x}");
        }
        let found = check(
            &map,
            &[vec![-2.0, 1.0], vec![0.0, 1.0], vec![2.0, 1.0]],
            &CheckOptions::default(),
        );
        assert!(found.is_err());
    }
}

/// Two contact nodes with friction, coupled by springs; the bound of friction is a kink inside another one where `nested`. x = (u_ν1, u_t1,
/// u_ν2, u_t2, λ_ν1, λ_t1, λ_ν2, λ_t2, α).
struct Nodes {
    nested: bool,
}

impl NonsmoothFunction for Nodes {
    fn num_vars(&self) -> usize {
        9
    }
    fn num_residuals(&self) -> usize {
        8
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let load = [0.4, 0.9, 0.8, 1.1];
        for i in 0..4 {
            let spring = x[i] * 2.0 - (x[(i + 1) % 4] + x[(i + 3) % 4]) * 0.5;
            out[i] = spring + x[4 + i] - x[8] * load[i];
        }
        for node in 0..2 {
            let (u, l) = (2 * node, 4 + 2 * node);
            let pressure = x[l] + x[u] - 0.1;
            out[l] = x[l] - kinks.positive_part(pressure);
            let bound = if self.nested {
                kinks.positive_part(pressure) * 0.3
            } else {
                x[l] * 0.3
            };
            out[l + 1] = x[l + 1] - kinks.project(-bound, x[l + 1] + x[u + 1], bound);
        }
    }
}

/// Entries that the Jacobians of all selections have at some points, by central differences.
fn seen<P: PiecewiseSmooth>(map: &P, points: &[Vec<f64>]) -> Vec<(usize, usize)> {
    let (n, m) = (map.num_residuals(), map.num_vars());
    let mut found = std::collections::BTreeSet::new();
    for x in points {
        for selection in semismooth::piecewise::Selections::all(map) {
            for j in 0..m {
                let at = |h: f64| {
                    let mut y = x.clone();
                    y[j] += h;
                    let mut r = vec![0.0; n];
                    map.residual(&selection, &y, &mut r);
                    r
                };
                let (plus, minus) = (at(1e-3), at(-1e-3));
                found.extend((0..n).filter(|&i| plus[i] != minus[i]).map(|i| (i, j)));
            }
        }
    }
    found.into_iter().collect()
}

#[test]
fn patterns_and_rows_of_sites_are_traced_over_all_pieces() {
    let points: Vec<Vec<f64>> = (0..3)
        .map(|k| (0..9).map(|i| ((i * 7 + k * 5) as f64).sin()).collect())
        .collect();
    for nested in [false, true] {
        let map = Traced::new(Nodes { nested });
        let pattern = map.pattern();
        let mut entries: Vec<(usize, usize)> = (0..9)
            .flat_map(|j| {
                let rows = &pattern.row_idx()[pattern.col_ptr()[j]..pattern.col_ptr()[j + 1]];
                rows.iter().map(move |&i| (i, j)).collect::<Vec<_>>()
            })
            .collect();
        entries.sort_unstable();
        // The bound appears in the pieces "lower" and "upper", the multiplier itself in neither: all of these entries count.
        assert_eq!(entries, seen(&map, &points), "nested: {nested}");
        let mut rows = Vec::new();
        for site in 0..map.num_sites() {
            map.site_rows(site, &mut rows);
            for x in &points {
                let of = |piece: usize| {
                    let mut selection = select(&map, x);
                    selection.set(site, piece);
                    let (mut r, mut jac) = (vec![0.0; 8], Matrix::zeros(map.pattern()));
                    map.residual(&selection, x, &mut r);
                    map.jacobian(&selection, x, &mut jac);
                    let mut part = Matrix::zeros(map.pattern());
                    assert!(map.site_jacobian(site, &selection, x, &mut part));
                    for (i, j, v) in jac.triplets() {
                        let wanted = if rows.contains(&i) { v } else { 0.0 };
                        assert_eq!(part.get(i, j), wanted, "site {site}, entry ({i}, {j})");
                    }
                    (r, jac)
                };
                let first = of(0);
                for piece in 1..map.num_pieces(site) {
                    let other = of(piece);
                    for i in (0..8).filter(|i| !rows.contains(i)) {
                        assert_eq!(first.0[i], other.0[i], "site {site} changes residual {i}");
                    }
                }
            }
            let friction = map.num_pieces(site) == 3;
            assert_eq!(rows.len(), 1, "site {site} (friction: {friction})");
        }
        check(&map, &points, &CheckOptions::default().with_max_findings(1)).map_or_else(
            // Without nesting the bound is negative off solutions, and the cells overlap.
            |e| assert!(!nested, "{e}"),
            |_| (),
        );
    }
}

#[test]
fn derivatives_of_traced_test_functions_are_exact() {
    let map = Traced::new(Zoo);
    let x: Vec<f64> = (0..N).map(|i| 0.3 + (i as f64 * 1.7).sin()).collect();
    let d: Vec<f64> = (0..N).map(|i| (i as f64 * 0.9).cos()).collect();
    let total: usize = (0..map.num_sites()).map(|s| map.num_tests(s)).sum();
    let (mut along, mut k) = (vec![0.0; total], 0);
    map.test_derivatives(&x, &d, &mut along);
    let at = |h: f64| {
        let y: Vec<f64> = x.iter().zip(&d).map(|(x, d)| x + h * d).collect();
        let mut theta = vec![0.0; total];
        map.test_functions(&y, &mut theta);
        theta
    };
    let (plus, minus) = (at(1e-6), at(-1e-6));
    for site in 0..map.num_sites() {
        for test in 0..map.num_tests(site) {
            let mut gradient = vec![0.0; N];
            map.test_gradient(site, test, &x, &mut gradient);
            let product: f64 = gradient.iter().zip(&d).map(|(g, d)| g * d).sum();
            assert!(
                (product - along[k]).abs() < 1e-13 * (1.0 + along[k].abs()),
                "{site}, {test}"
            );
            let quotient = (plus[k] - minus[k]) / 2e-6;
            assert!(
                (quotient - along[k]).abs() < 1e-7 * (1.0 + along[k].abs()),
                "{site}, {test}"
            );
            k += 1;
        }
    }
}

/// A pattern that lacks the entry (1, 3), whose column shares a colour with another one.
struct Lacking;

impl NonsmoothFunction for Lacking {
    fn num_vars(&self) -> usize {
        5
    }
    fn num_residuals(&self) -> usize {
        4
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        for i in 0..4 {
            out[i] = kinks.min(x[i], x[i] * 3.0 - 1.0 - x[4]);
        }
        // Vanishes with its derivative at 0.
        out[1] += x[3] * x[3];
    }
    fn pattern(&self) -> semismooth::sparse::Pattern {
        let entries = (0..4).flat_map(|i| [(i, i), (i, 4)]);
        semismooth::sparse::Pattern::from_entries(4, 5, entries).unwrap()
    }
}

#[test]
fn a_pattern_that_lacks_an_entry_is_refused_at_the_first_jacobian() {
    use semismooth::continuation::{Branch, ContinuationError, ContinuationOptions, Direction};
    use semismooth::newton::{Newton, NewtonError};
    use semismooth::piecewise::PiecewiseError;
    let map = Traced::new(Lacking);
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(&select(&map, &[0.0; 5]), &[0.0; 5], &mut jac);
    assert_eq!(jac.stray(), Some((1, 3)));
    let mut x = [0.5, 0.5, 0.5, 0.5, 0.0];
    let stray = PiecewiseError::StrayEntry { row: 1, col: 3 };
    let error = Newton::default().solve(&map, &mut x).unwrap_err();
    assert!(matches!(error, NewtonError::Map(e) if e == stray));
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let error = Branch::follow(&map, &[0.0; 5], Direction::Increasing, options).unwrap_err();
    assert_eq!(error, ContinuationError::Map(stray));
}

#[test]
fn entries_are_distinguished_beyond_one_window_of_labels() {
    /// Residual i couples x_i with x_{m − 1 − i}.
    struct Wide(usize, bool);
    impl NonsmoothFunction for Wide {
        fn num_vars(&self) -> usize {
            self.0
        }
        fn num_residuals(&self) -> usize {
            self.0
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            for i in 0..self.0 {
                out[i] = x[i] + kinks.abs(x[self.0 - 1 - i]);
            }
        }
        fn pattern(&self) -> semismooth::sparse::Pattern {
            let m = self.0;
            let lacks = |i: usize| self.1 && i == m - 3;
            let entries = (0..m).flat_map(|i| [(i, i), (i, if lacks(i) { i } else { m - 1 - i })]);
            semismooth::sparse::Pattern::from_entries(m, m, entries).unwrap()
        }
    }
    // 700: three windows; 20 000: shared labels find the row, windows the column.
    for m in [700, 20_000] {
        for lacks in [false, true] {
            let map = Traced::new(Wide(m, lacks));
            let mut jac = Matrix::zeros(map.pattern());
            map.jacobian(&Selection::uniform(m, 0), &vec![0.1; m], &mut jac);
            assert_eq!(jac.stray(), lacks.then_some((m - 3, 2)), "{m}");
            let mut rows = Vec::new();
            map.site_rows(m - 5, &mut rows);
            assert_eq!(rows, [m - 5]);
        }
    }
}

/// Elementary functions at one point, and a sum with a root that does not depend on the second variable.
struct AtBorders;

impl NonsmoothFunction for AtBorders {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        5
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0].tanh();
        out[1] = x[0].powf(1.5);
        out[2] = x[0].powf(0.999);
        out[3] = x[0].powf(0.5) + x[1];
        out[4] = x[0].sqrt() + x[1];
    }
}

#[test]
fn derivatives_at_borders_of_domains_and_far_out_are_limits() {
    let map = Traced::new(AtBorders);
    let derivatives = |x: f64| {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&Selection::uniform(0, 0), &[x, 1.0], &mut jac);
        assert_eq!((jac.get(3, 1), jac.get(4, 1)), (1.0, 1.0), "{x}");
        [0, 1, 2, 3, 4].map(|row| jac.get(row, 0))
    };
    let infinite = f64::INFINITY;
    assert_eq!(derivatives(0.0), [1.0, 0.0, infinite, infinite, infinite]);
    for x in [1e-200_f64, 0.3, 400.0, 1e200] {
        let slopes = [
            1.5 * x.sqrt(),
            0.999 * x.powf(-0.001),
            0.5 / x.sqrt(),
            0.5 / x.sqrt(),
        ];
        let found = derivatives(x);
        let tanh = 1.0 - x.tanh().powi(2);
        assert!((found[0] - tanh).abs() <= 1e-15, "{x}: {found:?}");
        for (found, slope) in found[1..].iter().zip(slopes) {
            assert!(
                (found - slope).abs() <= 1e-14 * slope,
                "{x}: {found} is not {slope}"
            );
        }
    }
}

/// One kink of each kind over (x, y), with ln x among its operands, and powers with the exponent 0.
struct Undefined;

impl NonsmoothFunction for Undefined {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        9
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (log, y) = (x[0].ln(), x[1]);
        out[0] = kinks.max(log, y);
        out[1] = kinks.max(y, log);
        out[2] = kinks.min(log, y);
        out[3] = kinks.min(y, log);
        out[4] = kinks.abs(log);
        out[5] = kinks.project(T::from(-1.0), log, T::from(1.0));
        out[6] = kinks.project(T::from(-1.0), y, log + 100.0);
        out[7] = log.powi(0);
        out[8] = log.powf(0.0);
    }
}

#[test]
fn kinks_with_an_undefined_operand_are_undefined_in_every_selection() {
    let map = Traced::new(Undefined);
    let mut out = vec![0.0; 9];
    for y in [-3.0, 0.0, 5.0] {
        value(&map, &[-1.0, y], &mut out);
        assert!(out.iter().all(|v| v.is_nan()), "{out:?}");
        for piece in 0..3 {
            let pieces = (0..map.num_sites()).map(|s| piece % map.num_pieces(s));
            map.residual(&Selection::from_pieces(pieces), &[-1.0, y], &mut out);
            assert!(out.iter().all(|v| v.is_nan()), "{piece}: {out:?}");
        }
        value(&map, &[2.0, y], &mut out);
        assert!(out.iter().all(|v| v.is_finite()), "{out:?}");
    }
}

/// x² for x ≥ 0 beside 1 and ln x for x < 0: the other formula counts where the test vanishes only.
struct Chosen;

impl NonsmoothFunction for Chosen {
    fn num_vars(&self) -> usize {
        1
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.switch(x[0] - 1.0, x[0] * x[0], (-x[0]).ln());
        out[1] = kinks.switch((-x[0]).ln(), x[0], x[0]);
    }
}

#[test]
fn a_switch_is_as_defined_as_its_test_and_the_formula_it_selects() {
    let map = Traced::new(Chosen);
    let at = |x: f64| {
        let mut out = [0.0; 2];
        value(&map, &[x], &mut out);
        out.map(f64::is_nan)
    };
    assert_eq!(at(2.0), [false, true]);
    assert_eq!(at(0.5), [true, true]);
    assert_eq!(at(1.0), [true, true]);
    assert_eq!(at(-0.5), [false, false]);
}

/// xⁿ has the derivative n xⁿ⁻¹ as long as that is a number.
#[test]
fn derivatives_of_powers_are_right_at_extremes() {
    struct Powers;
    impl NonsmoothFunction for Powers {
        fn num_vars(&self) -> usize {
            1
        }
        fn num_residuals(&self) -> usize {
            3
        }
        fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
            out[0] = x[0].powi(-2);
            out[1] = x[0].powi(-1);
            out[2] = x[0].powi(3);
        }
    }
    let map = Traced::new(Powers);
    for (row, x, expected) in [(0, 1e-70, -2e210), (1, 1e110, -1e-220), (2, 1e-120, 3e-240)] {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&select(&map, &[x]), &[x], &mut jac);
        let found = jac.get(row, 0);
        assert!((found / expected - 1.0).abs() < 1e-14, "{found:e}");
    }
}
