//! Rounding, scales, misuse and problems without solution.

use std::cell::Cell;

use semismooth::InputError;
use semismooth::linear::DenseLu;
use semismooth::newton::{Convergence, Damping, MoorePenrose, Newton, NewtonError, NewtonOptions};
use semismooth::piecewise::{MinMap, PiecewiseError, PiecewiseSmooth, Selection, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

use crate::maps::one_piece;
use crate::problems::{Lcp, Smooth, close, cycling, p_matrix, scalar};

#[test]
fn zero_tolerances_end_at_the_rounding_floor() {
    let options = NewtonOptions::default().with_tolerances(0.0, 0.0);
    let cube = scalar(|x| x * x * x - 2.0 * x - 5.0, |x| 3.0 * x * x - 2.0);
    let noisy = scalar(|x| (1e6 + x.exp()) - (1e6 + 3.0), f64::exp);
    let maps: [(&dyn PiecewiseSmooth, f64, f64); 2] = [
        (&cube, 2.094_551_481_542_326_6, 1e-14),
        (&noisy, 3.0_f64.ln(), 1e-9),
    ];
    for (map, root, accuracy) in maps {
        for damping in [Damping::OnTrouble, Damping::Always, Damping::Never] {
            let mut newton = Newton::new(options.clone().with_damping(damping));
            let mut x = [2.3];
            let end = newton.solve(map, &mut x);
            // A residual of exactly 0 is a solution by any tolerance.
            let exact = newton.report().residual_norm() == 0.0;
            let right = if exact {
                Convergence::Tolerance
            } else {
                Convergence::Rounding
            };
            assert_eq!(end, Ok(right), "{damping:?} {x:?}");
            assert!((x[0] - root).abs() < accuracy, "{x:?}");
        }
    }
    // 1/3 has no representation: 3 x − 1 with a detour cannot vanish to the last bit everywhere.
    let n = 6;
    let e: Vec<f64> = (0..n * n).map(|k| ((k * k + 3) as f64).sin()).collect();
    let lcp = Lcp::new(
        p_matrix(n, &e, 0.3),
        (0..n).map(|k| (k as f64 * 1.7).cos() / 3.0).collect(),
    );
    let mut x = vec![1.0; n];
    let mut newton = Newton::new(options);
    newton.solve(&lcp, &mut x).unwrap();
    assert!(close(&x, &lcp.enumerate()[0], 1e-12));
}

#[test]
fn small_rows_are_solved_too() {
    // The second row is nonlinear and 10¹⁵ times smaller than the first, which is exact after one step.
    let map = Smooth {
        n: 2,
        f: |x: &[f64], out: &mut [f64]| {
            out[0] = 1e9 * (x[0] - 3.0);
            out[1] = 1e-6 * (x[1].exp() - x[0]);
        },
        j: |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1e9);
            jac.add(1, 0, -1e-6);
            jac.add(1, 1, 1e-6 * x[1].exp());
        },
    };
    let mut x = [1.0, 4.0];
    Newton::default().solve(&map, &mut x).unwrap();
    assert!((x[1] - 3.0_f64.ln()).abs() < 1e-12, "{x:?}");
}

#[test]
fn tiny_and_huge_residuals_neither_vanish_nor_overflow() {
    for scale in [1e-200, 1e200] {
        let map = scalar(move |x| scale * (x * x - 2.0), move |x| scale * 2.0 * x);
        let mut x = [5.0];
        Newton::default().solve(&map, &mut x).unwrap();
        assert!((x[0] - 2.0_f64.sqrt()).abs() < 1e-13, "{x:?}");
    }
}

#[test]
fn misuse_is_named() {
    let lcp = Lcp::new(vec![vec![1.0, 0.0], vec![0.0, 1.0]], vec![-1.0, -1.0]);
    let wide = MinMap::new(0, |_: &[f64], _: &mut [f64], _: &mut [f64]| {});
    struct Shape(usize, usize, usize, usize);
    impl PiecewiseSmooth for Shape {
        one_piece!(self, self.0, self.1);
        fn residual(&self, _: &Selection, _: &[f64], out: &mut [f64]) {
            out.fill(1.0);
        }
        fn jacobian(&self, _: &Selection, _: &[f64], jac: &mut Matrix) {
            jac.add(0, 0, 1.0);
            jac.add(1, 1, 1.0);
        }
        fn pattern(&self) -> Pattern {
            Pattern::full(self.2, self.3)
        }
    }
    let zero = NewtonOptions::default().with_max_iterations(0);
    let negative = NewtonOptions::default().with_tolerances(-1.0, 0.0);
    let nan = NewtonOptions::default().with_tolerances(0.0, f64::NAN);
    let plain = NewtonOptions::default();
    let diagonal = Pattern::from_entries(2, 2, [(0, 0)]).unwrap();
    struct Thin(Lcp, Pattern);
    impl Semismooth for Thin {
        fn num_vars(&self) -> usize {
            2
        }
        fn residual(&self, x: &[f64], out: &mut [f64]) {
            out.copy_from_slice(x);
            out[0] -= self.0.q[0];
        }
        fn jacobian(&self, _: &[f64], jac: &mut Matrix) {
            jac.add(0, 0, 1.0);
            jac.add(1, 1, 1.0);
        }
        fn pattern(&self) -> Pattern {
            self.1.clone()
        }
    }
    type Case<'a> = (&'a str, &'a dyn PiecewiseSmooth, NewtonOptions, Vec<f64>, &'a str);
    let cases: Vec<Case<'_>> = vec![
        (
            "NaN",
            &lcp,
            plain.clone(),
            vec![1.0, f64::NAN],
            "the start x[1] = NaN is not finite",
        ),
        (
            "inf",
            &lcp,
            plain.clone(),
            vec![f64::INFINITY, 0.0],
            "the start x[0] = inf is not finite",
        ),
        (
            "short",
            &lcp,
            plain.clone(),
            vec![1.0],
            "the start x has length 1, expected 2",
        ),
        (
            "empty",
            &wide,
            plain.clone(),
            vec![],
            "a map of 0 variables and 0 residuals",
        ),
        (
            "wide",
            &Shape(4, 2, 2, 4),
            plain.clone(),
            vec![0.0; 4],
            "a map of 4 variables and 2 residuals",
        ),
        (
            "tall",
            &Shape(2, 3, 3, 2),
            plain.clone(),
            vec![0.0; 2],
            "a map of 2 variables and 3 residuals",
        ),
        (
            "rows",
            &Shape(2, 2, 3, 2),
            plain.clone(),
            vec![0.0; 2],
            "the rows of the declared pattern has length 3",
        ),
        (
            "columns",
            &Shape(2, 2, 2, 3),
            plain.clone(),
            vec![0.0; 2],
            "the columns of the declared pattern has length 3",
        ),
        ("zero", &lcp, zero, vec![0.0; 2], "option max_iterations = 0"),
        (
            "negative",
            &lcp,
            negative,
            vec![0.0; 2],
            "option absolute_tolerance = -1",
        ),
        ("nan", &lcp, nan, vec![0.0; 2], "option relative_tolerance = NaN"),
    ];
    for (name, map, options, mut x, message) in cases {
        let error = Newton::new(options).solve(map, &mut x).unwrap_err();
        assert!(error.to_string().starts_with(message), "{name}: {error}");
    }
    for (rows, columns) in [(1, 3), (2, 2), (3, 3), (3, 2)] {
        let found = MoorePenrose::new(&Shape(3, 2, rows, columns), DenseLu::new());
        match found.map(|_| ()) {
            Err(PiecewiseError::Input(InputError::Length { what, .. })) => {
                assert!(what.contains("declared pattern"))
            }
            other => panic!("{rows} x {columns}: {other:?}"),
        }
    }
    let stray = Newton::default().solve_semismooth(&Thin(lcp, diagonal), &mut [5.0, 5.0]);
    let expected = PiecewiseError::StrayEntry { row: 1, col: 1 };
    assert_eq!(stray, Err(NewtonError::Map(expected)));
}

#[test]
fn maps_that_are_not_finite_fail_by_name() {
    let log = scalar(|x| x.ln() + 5.0, |x| 1.0 / x);
    // From 10 the full step leads to a negative argument; shortened it does not.
    let mut x = [10.0];
    Newton::default().solve(&log, &mut x).unwrap();
    assert!((x[0] - (-5.0_f64).exp()).abs() < 1e-14);
    let reason = |map: &dyn PiecewiseSmooth, start: f64| match Newton::default().solve(map, &mut [start]) {
        Err(NewtonError::Failed(u)) => u.status,
        other => panic!("{other:?}"),
    };
    let told = Status::EvaluationFailure { component: 0 };
    assert_eq!(reason(&log, -1.0), told);
    assert_eq!(reason(&scalar(|x| x - 1.0, |_| f64::NAN), 0.0), told);
}

#[test]
fn an_unsolvable_problem_keeps_its_best_iterate_and_history() {
    // x² + 1 = 0: the best is x = 0.
    let map = scalar(|x| x * x + 1.0, |x| 2.0 * x);
    let mut x = [3.0];
    let Err(NewtonError::Failed(failed)) = Newton::default().solve(&map, &mut x) else {
        panic!("x² + 1 = 0 was solved by {x:?}")
    };
    assert_eq!(failed.x, x);
    assert!(failed.residual_norm <= 1.0 + 1e-6, "{failed:?}");
    assert!(failed.report.history.len() > 2);
    assert_eq!(failed.report.history[0].residual_norm, 10.0);
    // max(x, 0) + 1 = 0 has slope 0 on one side.
    let flat = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = -x[0] - 1.0;
        b[0] = -1.0;
    });
    let mut x = [2.0];
    match Newton::default().solve(&flat, &mut x) {
        Err(NewtonError::Failed(u)) => {
            assert!((u.residual_norm - 1.0).abs() < 1e-9);
            assert!(matches!(u.status, Status::Stationary { .. }), "{:?}", u.status);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn iterations_are_limited() {
    let map = scalar(|x| x.powi(11) - 1.0, |x| 11.0 * x.powi(10));
    let options = NewtonOptions::default().with_max_iterations(5);
    match Newton::new(options).solve(&map, &mut [100.0]) {
        Err(NewtonError::Failed(u)) => {
            assert_eq!(u.status, Status::IterationLimit);
            assert_eq!(u.report.history.len(), 6);
        }
        other => panic!("{other:?}"),
    }
    for k in [1, 3, 10] {
        let options = NewtonOptions::default().with_max_iterations(k);
        let mut newton = Newton::new(options);
        let _ = newton.solve(&cycling(), &mut [2.0, 0.0, 0.0]);
        assert!(newton.report().history.len() <= k + 1);
    }
}

/// x₁ = 1e14 next to −1e-8 (1 + x₂) ≥ 0 and x₂ ≥ 0, which has no solution: a large row that shares no unknown with a small one is no scale
/// for it, nor is its rounding.
#[test]
fn a_large_row_does_not_excuse_a_small_one() {
    for (size, c) in [(1e8, -1e-8), (1e14, -1e-8), (1e18, -1e-4), (1e18, -1.0)] {
        let map = MinMap::new(2, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] - size;
            b[0] = x[0] - size;
            a[1] = x[1];
            b[1] = c * (1.0 + x[1]);
        });
        for start in [[0.0, 0.0], [size, 1.0], [0.5 * size, 0.0]] {
            let mut x = start;
            let outcome = Newton::default().solve(&map, &mut x);
            assert!(
                outcome.is_err(),
                "{size:e} {c:e} from {start:?}: {outcome:?} at {x:?}"
            );
        }
    }
}

/// e^y = 3 next to x = X, coupled by a coefficient c: rounding of x changes it by c X ε only.
#[test]
fn a_large_row_does_not_excuse_one_weakly_coupled_to_it() {
    for (size, c) in [(1e10, 1e-8), (1e12, 1e-10), (1e13, 1e-12), (1e15, 1e-15)] {
        let map = Smooth {
            n: 2,
            f: |x: &[f64], out: &mut [f64]| {
                out[0] = x[0] - size;
                out[1] = x[1].exp() - 3.0 + c * (x[0] - size);
            },
            j: |x: &[f64], jac: &mut Matrix| {
                jac.add(0, 0, 1.0);
                jac.add(1, 0, c);
                jac.add(1, 1, x[1].exp());
            },
        };
        for start in [4.0, 2.0, 1.2, 0.5] {
            let mut x = [0.5 * size, start];
            Newton::default().solve(&map, &mut x).unwrap();
            let error = (x[1] - 3.0_f64.ln()).abs();
            assert!(error < 1e-10, "{size:e} {c:e} from {start}: {error:e}");
        }
    }
}

/// A row whose rounding never decreases, next to a large unknown: neither excuses the row that still converges.
#[test]
fn a_noisy_row_does_not_end_the_others() {
    let map = Smooth {
        n: 3,
        f: |x: &[f64], out: &mut [f64]| {
            // Never 0: the sum is a multiple of 2⁻³³, and 3.3 is not.
            out[0] = 1e9 * (((1e6 + x[0].exp()) - 1e6) - 3.3);
            out[1] = x[1].exp() - 3.0;
            out[2] = x[2] - 1e4;
        },
        j: |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1e9 * x[0].exp());
            jac.add(1, 1, x[1].exp());
            jac.add(2, 2, 1.0);
        },
    };
    for k in 0..40 {
        let start = 1.2 + 0.05 * f64::from(k);
        let mut x = [3.3_f64.ln(), start, 1e4];
        // Stagnation of the first row is no success, and may be reported as a failure.
        let outcome = Newton::default().solve(&map, &mut x);
        let right = (x[1] - 3.0_f64.ln()).abs() < 1e-10;
        assert!(outcome.is_err() || right, "from {start}: {x:?}");
    }
}

/// x − 1 + c sign(x − 1) jumps across 0: the difference between neighbouring points is not rounding.
#[test]
fn a_small_jump_is_no_solution() {
    for c in [1e-2, 1e-3, 1e-4, 1e-5] {
        let sign = |x: f64| if x >= 1.0 { 1.0 } else { -1.0 };
        let map = scalar(move |x| x - 1.0 + c * sign(x), |_| 1.0);
        for start in [1.0, 1.0 + c, 2.0, 0.0] {
            let mut x = [start];
            let outcome = Newton::default().solve(&map, &mut x);
            assert!(outcome.is_err(), "{c:e} from {start}: {outcome:?} at {x:?}");
        }
    }
}

/// Iterations go on while residuals decrease: a start within the rounding floor of the terms, but not within that of x, is improved.
#[test]
fn zero_tolerances_give_the_last_digits() {
    let options = NewtonOptions::default().with_tolerances(0.0, 0.0);
    let cube = scalar(|x| x * x * x - 2.0 * x - 5.0, |x| 3.0 * x * x - 2.0);
    for shift in [1e-14, -1e-14, 6e-15, -6e-15] {
        let mut x = [2.094_551_481_542_326_6 + shift];
        Newton::new(options.clone()).solve(&cube, &mut x).unwrap();
        let error = (x[0] - 2.094_551_481_542_326_6).abs();
        assert!(error <= 1e-15, "{shift:e}: {error:e}");
    }
}

/// e^y = 3 beside z + y = X + ln 3, whose terms are large: its rounding affects z alone, since y is determined by the other row.
#[test]
fn a_row_with_large_terms_does_not_excuse_one_that_cancels() {
    for size in [1e6, 1e8, 1e10, 1e12, 1e14, 1e15] {
        for unit in [1e-6, 1.0, 1e6] {
            let map = Smooth {
                n: 2,
                f: |x: &[f64], out: &mut [f64]| {
                    out[0] = (x[0] - size) + (x[1] - 3.0_f64.ln());
                    out[1] = unit * (x[1].exp() - 3.0);
                },
                j: |x: &[f64], jac: &mut Matrix| {
                    jac.add(0, 0, 1.0);
                    jac.add(0, 1, 1.0);
                    jac.add(1, 1, unit * x[1].exp());
                },
            };
            for k in 0..40 {
                for z in [0.5, 1.0] {
                    let mut x = [z * size, -1.8 + 0.15 * f64::from(k)];
                    let solved = Newton::default().solve(&map, &mut x).is_ok();
                    let error = (x[1] - 3.0_f64.ln()).abs();
                    assert!(!solved || error < 1e-12, "{size:e} {unit:e} {k}: {error:e}");
                    // Beyond, the rounding of the large row hides the other from line searches.
                    assert!(solved || size * 1e-16 > unit, "{size:e} {unit:e} {k}");
                }
            }
        }
    }
}

/// y + sin y = 0 and y + y² = 0 beside z + y = X: as above, but all terms of the row vanish at the solution.
#[test]
fn a_row_whose_terms_vanish_is_solved_beside_one_with_large_terms() {
    type Row = (fn(f64) -> f64, fn(f64) -> f64);
    let rows: [Row; 3] = [
        (|y| y + y.sin(), |y| 1.0 + y.cos()),
        (|y| y + y * y, |y| 1.0 + 2.0 * y),
        (|y| 3.0 * y, |_| 3.0),
    ];
    for size in [1e6, 1e10, 1e12, 1e14] {
        for (f, df) in rows {
            let map = Smooth {
                n: 2,
                f: |x: &[f64], out: &mut [f64]| {
                    out[0] = (x[0] - size) + x[1];
                    out[1] = f(x[1]);
                },
                j: |x: &[f64], jac: &mut Matrix| {
                    jac.add(0, 0, 1.0);
                    jac.add(0, 1, 1.0);
                    jac.add(1, 1, df(x[1]));
                },
            };
            for k in 0..40 {
                for z in [0.5, 1.0] {
                    let mut x = [z * size, 0.75 - 0.03 * f64::from(k)];
                    Newton::default().solve(&map, &mut x).unwrap();
                    let error = f(x[1]).abs();
                    assert!(error < 1e-12, "{size:e} {k}: {error:e} at {x:?}");
                }
            }
        }
    }
}

/// c_k y_k = 0 beside z + Σ y_k = 1: each step may leave a rounding error of y_k, so that its row decreases by 10¹⁶ each time without
/// stagnating.
#[test]
fn rows_that_vanish_with_their_unknowns_take_one_step() {
    const N: usize = 60;
    let map = Smooth {
        n: N,
        f: |x: &[f64], out: &mut [f64]| {
            out[0] = (x[0] - 1.0) + x[1..].iter().sum::<f64>();
            (1..N).for_each(|k| out[k] = (1.1 + 0.037 * k as f64) * x[k]);
        },
        j: |_: &[f64], jac: &mut Matrix| {
            (0..N).for_each(|k| jac.add(0, k, 1.0));
            (1..N).for_each(|k| jac.add(k, k, 1.1 + 0.037 * k as f64));
        },
    };
    let mut x = [1e-19; N];
    x[0] = 1.0;
    let mut newton = Newton::default();
    newton.solve(&map, &mut x).unwrap();
    assert!(x[1..].iter().all(|y| y.abs() <= 1e-34), "{x:?}");
    assert!(
        newton.report().evaluations <= 4,
        "{}",
        newton.report().evaluations
    );
}

/// x³ − 2 x − 5 = 0 in a unit in which no rounded residual is exactly 0; counts its evaluations.
struct Counted {
    unit: f64,
    evaluations: Cell<usize>,
}

impl Semismooth for Counted {
    fn num_vars(&self) -> usize {
        1
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        self.evaluations.set(self.evaluations.get() + 1);
        out[0] = self.unit * ((x[0] * x[0] - 2.0) * x[0] - 5.0 + 3.0_f64.sqrt() * (x[0] - 2.0).abs());
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        jac.add(
            0,
            0,
            self.unit * (3.0 * x[0] * x[0] - 2.0 + 3.0_f64.sqrt() * (x[0] - 2.0).signum()),
        );
    }
}

#[test]
fn reports_count_each_evaluation() {
    let mut floors = 0;
    for damping in [Damping::OnTrouble, Damping::Always, Damping::Never] {
        for k in 0..40 {
            let map = Counted {
                unit: 1.0 + 0.1 * f64::from(k),
                evaluations: Cell::new(0),
            };
            let options = NewtonOptions::default()
                .with_tolerances(0.0, 0.0)
                .with_damping(damping);
            let mut newton = Newton::new(options);
            let mut x = [-3.0 + 0.21 * f64::from(k)];
            let end = newton.solve_semismooth(&map, &mut x);
            floors += usize::from(end == Ok(Convergence::Rounding));
            assert_eq!(
                newton.report().evaluations,
                map.evaluations.get(),
                "{damping:?} {k} {end:?}"
            );
        }
    }
    assert!(floors > 20);
}

/// x² − 2 is exactly ¼ at 1.5: no larger than a tolerance of ¼, so that no step is taken.
#[test]
fn residuals_as_large_as_the_tolerance_are_solutions() {
    let map = scalar(|x| x * x - 2.0, |x| 2.0 * x);
    for (tolerance, steps) in [(0.25, 0), (0.249, 1)] {
        let mut newton = Newton::new(NewtonOptions::default().with_tolerances(tolerance, 0.0));
        let mut x = [1.5];
        assert_eq!(newton.solve(&map, &mut x), Ok(Convergence::Tolerance));
        assert_eq!(newton.report().history.len() - 1, steps);
        assert_eq!(x[0] == 1.5, steps == 0);
    }
}
