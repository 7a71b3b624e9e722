//! Defects observed in other solvers.

use semismooth::complementarity::{FischerBurmeister, Mcp, WithJacobian};
use semismooth::piecewise::Semismooth;
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::support::{INF, matrix, residual, scalar, solve};

#[test]
fn logarithm_with_a_free_variable_is_not_solved_outside_its_domain() {
    let problem = Mcp::equations(scalar(f64::ln, |x: f64| 1.0 / x)).unwrap();
    for start in [5.0, 1e3, 0.1, -3.0, 0.0] {
        let (x, report) = solve(&problem, &[start]);
        assert!(report.is_solved(), "{start}: {:?}", report.status);
        assert!((x[0] - 1.0).abs() < 1e-9, "{start}: {x:?}");
    }
}

/// exp x = 8 from starts at which exp x is a number and its terms x exp x are not.
#[test]
fn terms_that_overflow_hide_no_residual() {
    let problem = Mcp::equations(scalar(|x| x.exp() - 8.0, f64::exp)).unwrap();
    for start in [705.0, 709.5] {
        let (x, report) = solve(&problem, &[start]);
        assert!(
            !report.is_solved() || (x[0].exp() - 8.0).abs() < 1e-8,
            "{start}: {x:?}"
        );
    }
}

#[test]
fn nan_is_no_solution() {
    let never = Mcp::ncp(WithJacobian::new(
        3,
        |x: &[f64], out: &mut [f64]| {
            out.copy_from_slice(x);
            out[1] = f64::NAN;
        },
        |_: &[f64], jac: &mut Matrix| (0..3).for_each(|i| jac.add(i, i, 1.0)),
    ))
    .unwrap();
    let (_, report) = solve(&never, &[1.0, 2.0, 3.0]);
    assert_eq!(report.status, Status::EvaluationFailure { component: 1 });
    assert!(report.residual.is_nan());

    // Powers of prices from far starts, where intermediate values overflow or leave the domain.
    let powers = Mcp::ncp(scalar(
        |x| x.powf(1.5) * (x - 50.0).exp() - 1.0,
        |x| (1.5 * x.sqrt() + x.powf(1.5)) * (x - 50.0).exp(),
    ))
    .unwrap();
    for start in [0.0, 1.0, 700.0, 2000.0] {
        let (x, report) = solve(&powers, &[start]);
        assert!(report.is_solved(), "{start}: {:?} at {x:?}", report.status);
    }
}

#[test]
fn bounds_hold_exactly_where_the_plain_formula_cancels() {
    // At x = −1e-4 with F = 1e13 the formula a + b − √(a² + b²) is 0 in floating-point numbers.
    let problem = Mcp::ncp(scalar(|x: f64| 1e13 + x, |_| 1.0)).unwrap();
    let fb = FischerBurmeister::new(&problem).unwrap();
    let mut out = [0.0];
    fb.residual(&[-1e-4], &mut out);
    assert!(out[0] <= -1e-4);
    fb.residual(&[1e-4], &mut out);
    assert!((out[0] - 1e-4).abs() < 1e-12);
    let (x, report) = solve(&problem, &[1e-4]);
    assert!(report.is_solved() && x[0] == 0.0);
}

#[test]
fn stationary_points_are_not_reported_as_solutions() {
    let none = [Mcp::equations(scalar(|x: f64| x * x + 1.0, |x: f64| 2.0 * x)).unwrap()];
    for problem in &none {
        for start in [0.0, 1.0, 10.0, -100.0] {
            let (x, report) = solve(problem, &[start]);
            match report.status {
                Status::Stationary { gradient_norm } => assert!(gradient_norm < 1e-3),
                other => panic!("{start}: {other:?} at {x:?}"),
            }
            assert!(residual(problem, &x) >= 1.0);
        }
    }
    // A local minimum of the merit function at the start, but a solution elsewhere (Billups 1995).
    let billups = Mcp::ncp(scalar(
        |x: f64| (x - 1.0).powi(2) - 1.01,
        |x: f64| 2.0 * (x - 1.0),
    ))
    .unwrap();
    for start in [0.0, 0.01, 0.5] {
        let (x, report) = solve(&billups, &[start]);
        assert!(report.is_solved() && (x[0] - 1.0 - 1.01_f64.sqrt()).abs() < 1e-9);
        assert!(!report.fallbacks.is_empty());
    }
}

#[test]
fn residuals_that_vanish_at_infinity_are_no_solutions() {
    let decay = Mcp::equations(scalar(|x: f64| (-x).exp(), |x: f64| -(-x).exp())).unwrap();
    for start in [0.0, 5.0, 25.0, 30.0] {
        let (_, report) = solve(&decay, &[start]);
        assert_eq!(report.status, Status::Unbounded, "{start}");
    }
    let hyperbola = Mcp::ncp(scalar(|x: f64| -1.0 / (1.0 + x), |x: f64| (1.0 + x).powi(-2))).unwrap();
    for start in [0.0, 1e3, 1e12] {
        assert!(!solve(&hyperbola, &[start]).1.is_solved(), "{start}");
    }
    // x y = 1, y = 0: each row nearly vanishes somewhere, but not both at once.
    let both = Mcp::equations(WithJacobian::new(
        2,
        |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] * x[1] - 1.0;
            out[1] = x[1];
        },
        |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, x[1]);
            jac.add(0, 1, x[0]);
            jac.add(1, 1, 1.0);
        },
    ))
    .unwrap();
    for start in [[0.0, 0.0], [1.0, 1.0], [1e3, 1e3], [1e11, 1e-11]] {
        assert!(!solve(&both, &start).1.is_solved(), "{start:?}");
    }
}

#[test]
fn the_element_at_the_origin_is_a_limit_of_gradients_in_any_units() {
    // Both components are degenerate at 0; F = c M x. Row i is (1 − a, …) with a² + b² = 1 for the limit (a, b) of unit vectors
    // along (1, c (M z)_i), so the element must be near the Jacobian at small multiples of the direction z = (1, 1).
    for c in [1e-6, 1.0, 1e6] {
        let m = [[2.0, 1.0], [-1.0, 3.0]];
        let f = WithJacobian::new(
            2,
            move |x: &[f64], out: &mut [f64]| {
                for i in 0..2 {
                    out[i] = c * (m[i][0] * x[0] + m[i][1] * x[1]);
                }
            },
            move |_: &[f64], jac: &mut Matrix| {
                for i in 0..2 {
                    for j in 0..2 {
                        jac.add(i, j, c * m[i][j]);
                    }
                }
            },
        );
        let problem = Mcp::ncp(f).unwrap();
        let fb = FischerBurmeister::new(&problem).unwrap();
        let mut element = Matrix::zeros(fb.pattern());
        let mut nearby = Matrix::zeros(fb.pattern());
        fb.jacobian(&[0.0, 0.0], &mut element);
        fb.jacobian(&[1e-9, 1e-9], &mut nearby);
        for (e, v) in element.values().iter().zip(nearby.values()) {
            assert!((e - v).abs() <= 1e-9 * (1.0 + v.abs()), "{c}: {e} {v}");
        }
    }
}

#[test]
fn problems_of_one_variable() {
    for m in [-2.0, -1.0, 0.0, 0.5, 3.0] {
        for q in [-4.0, -1.0, 0.0, 2.0] {
            let problem = Mcp::affine(matrix(&[vec![m]]), vec![q], vec![0.0], vec![INF]).unwrap();
            // 0 ≤ x ⟂ m x + q ≥ 0 has a solution unless q < 0 and m ≤ 0.
            let solvable = q >= 0.0 || m > 0.0;
            for start in [0.0, 1.0, 100.0] {
                let (x, report) = solve(&problem, &[start]);
                assert_eq!(
                    report.is_solved(),
                    solvable,
                    "m = {m}, q = {q}, from {start}: {x:?}"
                );
                if !solvable {
                    assert_eq!(
                        report.status,
                        Status::NoSolution,
                        "m = {m}, q = {q}, from {start}"
                    );
                }
            }
        }
    }
}

#[test]
fn singular_jacobians_at_solutions_need_no_help() {
    let power = |p: i32| {
        Mcp::ncp(scalar(
            move |x| (x - 1.0).powi(p),
            move |x: f64| f64::from(p) * (x - 1.0).powi(p - 1),
        ))
        .unwrap()
    };
    for p in [2_i32, 3, 4] {
        for start in [0.0, 3.0, 50.0] {
            let (_, report) = solve(&power(p), &[start]);
            assert!(report.is_solved(), "p = {p} from {start}: {:?}", report.status);
        }
    }
    // Powell's singular function, of rank 2 at its solution.
    let (a, b) = (5.0_f64.sqrt(), 10.0_f64.sqrt());
    let powell = Mcp::equations(WithJacobian::new(
        4,
        move |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] + 10.0 * x[1];
            out[1] = a * (x[2] - x[3]);
            out[2] = (x[1] - 2.0 * x[2]).powi(2);
            out[3] = b * (x[0] - x[3]).powi(2);
        },
        move |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1.0);
            jac.add(0, 1, 10.0);
            jac.add(1, 2, a);
            jac.add(1, 3, -a);
            let (u, v) = (2.0 * (x[1] - 2.0 * x[2]), 2.0 * b * (x[0] - x[3]));
            jac.add(2, 1, u);
            jac.add(2, 2, -2.0 * u);
            jac.add(3, 0, v);
            jac.add(3, 3, -v);
        },
    ))
    .unwrap();
    for start in [[3.0, -1.0, 0.0, 1.0], [300.0, -100.0, 0.0, 100.0]] {
        assert!(solve(&powell, &start).1.is_solved());
    }
}

#[test]
fn rank_deficient_monotone_problems_take_few_iterations() {
    // M = b bᵀ + skew part, q from a known solution with degenerate components.
    let n = 40;
    let b: Vec<f64> = (0..n).map(|i| ((i * 7 + 3) % 11) as f64 - 5.0).collect();
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| {
                    b[i] * b[j] + ((i as f64) - (j as f64)) * 0.1 * f64::from(u8::from((i + j) % 3 == 0))
                })
                .collect()
        })
        .collect();
    let known: Vec<f64> = (0..n).map(|i| if i % 3 == 0 { i as f64 } else { 0.0 }).collect();
    let q: Vec<f64> = (0..n)
        .map(|i| {
            let mx: f64 = rows[i].iter().zip(&known).map(|(m, x)| m * x).sum();
            if i % 3 == 1 { 1.0 - mx } else { -mx }
        })
        .collect();
    let problem = Mcp::affine(matrix(&rows), q, vec![0.0; n], vec![INF; n]).unwrap();
    for start in [0.0, 1.0, 100.0] {
        let (_, report) = solve(&problem, &vec![start; n]);
        assert!(report.is_solved(), "{:?}", report.status);
        assert!(report.iterations <= 1000, "{}", report.iterations);
    }
}

#[test]
fn cycles_of_the_min_map_are_left() {
    // Newton's method for the min map cycles on circulant P-matrices (Ben Gharbia and Gilbert 2012).
    for alpha in [1.5, 2.0, 5.0] {
        for n in [3, 5, 7] {
            let rows: Vec<Vec<f64>> = (0..n)
                .map(|i| {
                    let mut row = vec![0.0; n];
                    row[i] = 1.0;
                    row[(i + n - 1) % n] = alpha;
                    row
                })
                .collect();
            let problem = Mcp::affine(matrix(&rows), vec![-1.0; n], vec![0.0; n], vec![INF; n]).unwrap();
            for k in 0..n {
                let mut start = vec![0.0; n];
                start[k] = 1.0;
                assert!(
                    solve(&problem, &start).1.is_solved(),
                    "α = {alpha}, n = {n}, k = {k}"
                );
            }
        }
    }
}

#[cfg(feature = "autodiff")]
mod patterns {
    use semismooth::complementarity::{
        Autodiff, ComplementarityError, Differenced, Mcp, McpFunction, McpSolver, SmoothFunction,
        check_jacobian,
    };
    use semismooth::piecewise::{PiecewiseError, Real};
    use semismooth::sparse::Pattern;

    /// A chain, and one entry far from it whose derivative vanishes at 0.
    struct Net;

    impl SmoothFunction for Net {
        fn num_vars(&self) -> usize {
            5
        }
        fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
            for i in 0..5 {
                out[i] = x[i] * 3.0 - 2.0 + x[i] * x[i] * x[i];
                if i > 0 {
                    out[i] += x[i - 1] * 1.5;
                }
            }
            out[0] += x[3] * x[3] * 4.0;
        }
    }

    /// The same with a pattern that lacks the entry (0, 3).
    struct Lacking;

    impl SmoothFunction for Lacking {
        fn num_vars(&self) -> usize {
            5
        }
        fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
            Net.eval(x, out);
        }
        fn pattern(&self) -> Pattern {
            let chain = (0..5usize).flat_map(|i| [(i, i), (i, i.saturating_sub(1))]);
            Pattern::from_entries(5, 5, chain).unwrap()
        }
    }

    #[test]
    fn patterns_are_found_by_tracing() {
        let function = Autodiff::new(Net);
        let chain = (0..5usize).flat_map(|i| [(i, i), (i, i.saturating_sub(1))]);
        let wanted = Pattern::from_entries(5, 5, chain.chain([(0, 3)])).unwrap();
        assert_eq!(function.pattern(), wanted);
        check_jacobian(&function, &[0.5, 0.6, 0.7, 0.8, 0.9], 1e-6).unwrap();
    }

    #[test]
    fn a_pattern_that_lacks_an_entry_is_an_error() {
        let problem = Mcp::new(Autodiff::new(Lacking), vec![0.0; 5], vec![f64::INFINITY; 5]).unwrap();
        let error = McpSolver::default().solve(&problem, &mut [0.0; 5]).unwrap_err();
        let stray = PiecewiseError::StrayEntry { row: 0, col: 3 };
        assert!(matches!(error, ComplementarityError::Map(e) if e == stray));
    }

    struct WithoutDiagonal;

    impl SmoothFunction for WithoutDiagonal {
        fn num_vars(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
            out[0] = x[0] + x[1] - 1.0;
            out[1] = x[0] - x[1] + 3.0;
        }
        fn pattern(&self) -> Pattern {
            Pattern::from_entries(2, 2, [(0, 0), (0, 1), (1, 0)]).unwrap()
        }
    }

    /// Solvers store the diagonal in any case; this does not hide the error.
    #[test]
    fn a_lacking_diagonal_is_an_error() {
        let problem = Mcp::ncp(Autodiff::new(WithoutDiagonal)).unwrap();
        let error = McpSolver::default().solve(&problem, &mut [1.0; 2]).unwrap_err();
        let stray = PiecewiseError::StrayEntry { row: 1, col: 1 };
        assert!(matches!(error, ComplementarityError::Map(e) if e == stray));
    }

    /// As `Lacking`, and a chain without its diagonal, which solvers store in any case.
    #[test]
    fn a_lacking_entry_is_an_error_for_differences_too() {
        let net = |x: &[f64], out: &mut [f64]| Net.eval(x, out);
        let chain = |i: usize| [(i, i), (i, i.saturating_sub(1))];
        let all: Vec<_> = (0..5).flat_map(chain).chain([(0, 3)]).collect();
        for (row, col) in all.iter().copied().filter(|(i, j)| i > j || *j == 3 || *i == 1) {
            let pattern = all.iter().copied().filter(|e| *e != (row, col));
            let pattern = Pattern::from_entries(5, 5, pattern).unwrap();
            let function = Differenced::new(5, net).with_pattern(pattern);
            let problem = Mcp::new(function, vec![0.0; 5], vec![f64::INFINITY; 5]).unwrap();
            let error = McpSolver::default().solve(&problem, &mut [0.5; 5]).unwrap_err();
            let stray = PiecewiseError::StrayEntry { row, col };
            assert!(
                matches!(error, ComplementarityError::Map(e) if e == stray),
                "{row} {col}"
            );
        }
        let pattern = Pattern::from_entries(5, 5, all).unwrap();
        let function = Differenced::new(5, net).with_pattern(pattern);
        check_jacobian(&function, &[0.5, 0.6, 0.7, 0.8, 0.9], 1e-6).unwrap();
    }
}
