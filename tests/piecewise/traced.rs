//! Functions written once over a scalar.

use proptest::prelude::*;
use semismooth::piecewise::check::{CheckOptions, check};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
use semismooth::piecewise::{PiecewiseSmooth, Selection, select, value};
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

/// One elementary function a component, each of its own variable.
struct Elementary;

impl NonsmoothFunction for Elementary {
    fn num_vars(&self) -> usize {
        9
    }
    fn num_residuals(&self) -> usize {
        9
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
    }
}

proptest! {
#![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn derivatives_of_elementary_functions(x in prop::collection::vec(0.2..3.0_f64, 9)) {
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
        ];
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&Selection::default(), &x, &mut jac);
        let mut h = vec![0.0; 9];
        map.residual(&Selection::default(), &x, &mut h);
        prop_assert!((h[7] - x[7].powf(1.7)).abs() < 1e-14 * h[7]);
        for i in 0..9 {
            for j in 0..9 {
                let e = if i == j { expected[i] } else { 0.0 };
                let size = if i == j { e.abs().max(1e-2) } else { 0.0 };
                prop_assert!((jac.get(i, j) - e).abs() <= 1e-13 * size);
            }
        }
    }
}

/// A kink on one side of an `if` only: the other side is out of the domain, whichever side x = 0 is on.
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
