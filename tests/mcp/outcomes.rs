use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::InputError;
use semismooth::complementarity::{
    AffineFunction, BoundState, ComplementarityError, Mcp, McpIteration, McpOptions, McpSolver, McpStep,
    McpStrategy, WithJacobian,
};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

use crate::random::Random;
use crate::support::{INF, matrix, residual, scalar, solve};

fn parabola() -> Mcp<impl semismooth::complementarity::McpFunction> {
    Mcp::equations(scalar(|x| x * x + 1.0, |x| 2.0 * x)).unwrap()
}

#[test]
fn limits_and_observers_end_a_solve_with_its_best_iterate() {
    let problem = parabola();
    let mut x = [3.0];
    let mut solver = McpSolver::new(McpOptions::default().with_max_iterations(3));
    let report = solver.solve(&problem, &mut x).unwrap();
    assert_eq!(report.status, Status::IterationLimit);
    assert!(report.iterations == 3 && report.history.len() >= 3);
    let best = report.history.iter().map(|i| i.residual).fold(INF, f64::min);
    assert!((x[0] * x[0] + 1.0 - best).abs() < 1e-12);

    for calls in 1..4 {
        let (mut x, mut left) = ([3.0], calls);
        let observe = |_: &McpIteration| {
            left -= 1;
            match left {
                0 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        };
        let report = solver.solve_observed(&problem, &mut x, observe).unwrap();
        assert_eq!(report.status, Status::Interrupted);
        assert_eq!(left, 0);
    }

    let mut solver = McpSolver::new(McpOptions::default().with_max_time(Some(Duration::ZERO)));
    let mut x = [3.0];
    assert_eq!(solver.solve(&problem, &mut x).unwrap().status, Status::TimeLimit);
}

/// √(−1 − x²) is real nowhere: of a million perturbed starts each is reported, so that the observer can stop.
#[test]
fn observers_can_stop_where_the_function_is_nowhere_finite() {
    let mut finite = true;
    let sometimes = std::cell::Cell::new(0);
    let function = scalar(
        |x| {
            sometimes.set(sometimes.get() + 1);
            if sometimes.get() < 5 {
                x * x + 1.0
            } else {
                (-1.0 - x * x).sqrt()
            }
        },
        |x| 2.0 * x,
    );
    let problem = Mcp::equations(function).unwrap();
    let mut left = 1000;
    let observe = |iteration: &McpIteration| {
        finite &= iteration.residual.is_finite();
        left -= 1;
        match left {
            0 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    };
    let mut solver = McpSolver::new(McpOptions::default().with_restarts(1_000_000));
    let report = solver.solve_observed(&problem, &mut [3.0], observe).unwrap();
    assert_eq!(report.status, Status::Interrupted);
    assert!(left == 0 && !finite);
    assert!(report.history.iter().all(|i| i.residual.is_finite()));
}

/// A problem without a solution, for which all strategies are tried: options limit paths and enumeration, and without enough nodes the
/// proof of infeasibility is lost.
#[test]
fn paths_and_enumeration_keep_their_limits() {
    let m = Matrix::from_rows(&[[4.0, 2.0, -2.0], [3.0, -2.0, 3.0], [0.0, 3.0, 2.0]]).unwrap();
    let problem = Mcp::ncp(AffineFunction::new(m, vec![0.0, -4.0, 1.0]).unwrap()).unwrap();
    let spent = |options: McpOptions| {
        let mut solver = McpSolver::new(options);
        let report = solver.solve(&problem, &mut [0.5, 2.0, 1.0]).unwrap();
        let tried = report.fallbacks.iter();
        let paths = tried.filter(|f| f.strategy == McpStrategy::Homotopy);
        (report.status, paths.map(|f| f.iterations).sum::<usize>())
    };
    let options = McpOptions::default();
    let (status, whole) = spent(options.clone());
    assert_eq!(status, Status::NoSolution);
    let (_, short) = spent(options.clone().with_max_path_points(2));
    let (_, none) = spent(options.clone().with_max_path_points(0));
    assert!(none < short && short < whole, "{none} {short} {whole}");
    let (status, _) = spent(options.with_max_nodes(1));
    assert!(
        !matches!(status, Status::NoSolution | Status::Solved),
        "{status:?}"
    );
}

/// Each point of a path is told as it is counted, and a search of active sets goes on between calls; both end when the observer says so.
#[test]
fn observers_are_called_along_paths_and_during_enumeration() {
    let m = Matrix::from_rows(&[[4.0, 2.0, -2.0], [3.0, -2.0, 3.0], [0.0, 3.0, 2.0]]).unwrap();
    let small = Mcp::ncp(AffineFunction::new(m, vec![0.0, -4.0, 1.0]).unwrap()).unwrap();
    // Of the 2ⁿ active sets of xᵢ ≥ 0, xᵢ ≤ 1 + Σ xⱼ (j ≠ i) most are not excluded early.
    let n = 14;
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| if i == j { -1.0 } else { 1.0 }).collect())
        .collect();
    let m = Matrix::from_rows(&rows).unwrap();
    let large = Mcp::ncp(AffineFunction::new(m, vec![1.0; n]).unwrap()).unwrap();
    for (problem, strategy) in [
        (&small, McpStrategy::Homotopy),
        (&large, McpStrategy::Enumeration),
    ] {
        let options = McpOptions::default().with_strategies(vec![strategy]);
        let mut solver = McpSolver::new(options);
        let start = vec![2.0; problem.len()];
        let (mut between, mut steps) = (0, 0);
        let report = solver.solve_observed(problem, &mut start.clone(), |now| {
            assert_eq!(now.strategy, strategy);
            between += usize::from(now.residual.is_nan());
            steps += usize::from(now.step != McpStep::None);
            ControlFlow::Continue(())
        });
        let (status, iterations) = report.map(|r| (r.status, r.iterations)).unwrap();
        assert!(between > 0, "{strategy:?}: {status:?}");
        if strategy == McpStrategy::Homotopy {
            assert_eq!(iterations, between + steps);
        }
        for last in [1, between] {
            let mut calls = 0;
            let report = solver.solve_observed(problem, &mut start.clone(), |now| {
                calls += usize::from(now.residual.is_nan());
                match calls == last {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            });
            let report = report.unwrap();
            assert_eq!(calls, last);
            // Solutions found by then are returned.
            match report.status {
                Status::Solved => assert_eq!(strategy, McpStrategy::Enumeration),
                status => assert_eq!(status, Status::Interrupted),
            }
            assert!(last > 1 || report.iterations < iterations, "{iterations}");
        }
    }
}

#[test]
fn fallbacks_are_reported_in_order_and_can_be_switched_off() {
    let problem = parabola();
    let mut x = [3.0];
    let mut solver = McpSolver::new(McpOptions::default().with_fallbacks(false));
    let report = solver.solve(&problem, &mut x).unwrap();
    assert_eq!(report.fallbacks.len(), 1);
    assert_eq!(report.fallbacks[0].strategy, McpStrategy::Newton);
    let (_, report) = solve(&problem, &[3.0]);
    assert!(
        report
            .fallbacks
            .windows(2)
            .all(|w| w[0].strategy <= w[1].strategy)
    );
    let last = McpOptions::default().strategies.last().copied();
    assert_eq!(report.fallbacks.last().map(|f| f.strategy), last);
    assert!(report.fallbacks.iter().all(|f| f.residual >= 1.0));
}

#[test]
fn infeasible_affine_problems_come_with_a_certificate() {
    let mut rng = Random::new(7);
    for n in [1, 2, 5, 9] {
        // M = B Bᵀ with a zero first row and column, q₀ < 0: F₀ = q₀ < 0 for all x.
        let b = rng.square(n);
        let mut rows = vec![vec![0.0; n]; n];
        for i in 1..n {
            for j in 1..n {
                rows[i][j] = (0..n / 2).map(|k| b[i][k] * b[j][k]).sum();
            }
        }
        let mut q: Vec<f64> = (0..n).map(|_| rng.symmetric()).collect();
        q[0] = -0.3;
        let (lower, upper) = (vec![0.0; n], vec![INF; n]);
        let problem = Mcp::affine(matrix(&rows), q.clone(), lower, upper).unwrap();
        let (_, report) = solve(&problem, &vec![1.0; n]);
        assert_eq!(report.status, Status::NoSolution, "n = {n}");
        // v ≥ 0, Mᵀv ≤ 0, qᵀv < 0: no x ≥ 0 has M x + q ≥ 0.
        let v = &report.certificate;
        assert!(v.iter().all(|v| *v >= 0.0));
        for j in 0..n {
            let mv: f64 = (0..n).map(|i| rows[i][j] * v[i]).sum();
            assert!(mv <= 1e-9, "{mv}");
        }
        assert!(q.iter().zip(v).map(|(q, v)| q * v).sum::<f64>() < 0.0);
    }
}

#[test]
fn warm_starts_take_one_factorisation() {
    let n = 30_usize;
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| {
                    if i == j {
                        2.1
                    } else if usize::abs_diff(i, j) == 1 {
                        -1.0
                    } else {
                        0.0
                    }
                })
                .collect()
        })
        .collect();
    let load = |shift: f64| {
        (0..n)
            .map(|i| (i as f64 * 0.7).sin() + shift)
            .collect::<Vec<f64>>()
    };
    let problem = |shift| Mcp::affine(matrix(&rows), load(shift), vec![0.0; n], vec![INF; n]).unwrap();
    let mut solver = McpSolver::default();
    let mut x = vec![0.0; n];
    let report = solver.solve(&problem(0.0), &mut x).unwrap();
    assert!(report.is_solved() && report.factorisations > 1);
    let states = report.states.clone();

    let mut warm = x.clone();
    let report = solver.solve(&problem(1e-3), &mut warm).unwrap();
    assert!(report.is_solved());
    assert_eq!(report.factorisations, 1);

    let mut cold = vec![5.0; n];
    let report = solver
        .solve_from_states(&problem(1e-3), &mut cold, &states)
        .unwrap();
    assert!(report.is_solved());
    assert_eq!(report.factorisations, 1);
    for (a, b) in warm.iter().zip(&cold) {
        assert!((a - b).abs() < 1e-12);
    }
    let wrong = vec![BoundState::Upper; n];
    assert!(matches!(
        solver.solve_from_states(&problem(0.0), &mut cold, &wrong),
        Err(ComplementarityError::Bound { index: 0, .. })
    ));
}

#[test]
fn convergence_is_quadratic_at_regular_solutions() {
    let problem = Mcp::ncp(scalar(|x: f64| x.exp() - 20.0, f64::exp)).unwrap();
    let (_, report) = solve(&problem, &[4.0]);
    let order = report.observed_order(1e-14).unwrap();
    assert!((1.7..2.3).contains(&order), "{order}");
}

#[test]
fn misuse_is_named() {
    let one = || AffineFunction::new(Matrix::identity(2), vec![1.0, 1.0]).unwrap();
    let new = |l: [f64; 2], u: [f64; 2]| Mcp::new(one(), l.to_vec(), u.to_vec());
    assert!(new([0.0, -INF], [0.0, INF]).is_ok());
    assert!(matches!(
        new([0.0, 2.0], [1.0, 1.0]),
        Err(ComplementarityError::CrossedBounds { index: 1, .. })
    ));
    assert!(matches!(
        new([0.0, f64::NAN], [1.0, 1.0]),
        Err(ComplementarityError::Bound { index: 1, .. })
    ));
    assert!(matches!(
        new([INF, 0.0], [INF, 1.0]),
        Err(ComplementarityError::Bound { index: 0, .. })
    ));
    assert!(matches!(
        new([0.0, 0.0], [1.0, -INF]),
        Err(ComplementarityError::Bound { index: 1, .. })
    ));
    assert!(matches!(
        Mcp::new(one(), vec![0.0], vec![1.0, 1.0]),
        Err(ComplementarityError::Input(InputError::Length {
            expected: 2,
            found: 1,
            ..
        }))
    ));
    assert!(matches!(
        AffineFunction::new(Matrix::identity(0), Vec::new()),
        Err(ComplementarityError::Empty)
    ));
    assert!(matches!(
        AffineFunction::new(matrix(&[vec![f64::NAN]]), vec![1.0]),
        Err(ComplementarityError::Input(_))
    ));
    assert!(matches!(
        AffineFunction::new(Matrix::identity(1), vec![INF]),
        Err(ComplementarityError::Input(InputError::NotFinite {
            index: 0,
            ..
        }))
    ));

    let mut solver = McpSolver::default();
    let problem = Mcp::ncp(one()).unwrap();
    assert!(matches!(
        solver.solve(&problem, &mut [1.0]),
        Err(ComplementarityError::Input(InputError::Length { .. }))
    ));
    assert!(matches!(
        solver.solve(&problem, &mut [1.0, f64::NAN]),
        Err(ComplementarityError::Input(InputError::NotFinite {
            index: 1,
            ..
        }))
    ));
    for bad in [
        McpOptions::default().with_tolerance(0.0),
        McpOptions::default().with_tolerance(f64::NAN),
        McpOptions::default().with_max_iterations(0),
        McpOptions::default().with_max_attempt(0),
    ] {
        let solved = McpSolver::new(bad)
            .solve(&problem, &mut [1.0, 1.0])
            .map(|r| r.status);
        assert!(matches!(
            solved,
            Err(ComplementarityError::Input(InputError::Option { .. }))
        ));
    }
    let stray = WithJacobian::new(
        2,
        |x: &[f64], out: &mut [f64]| out.copy_from_slice(x),
        |_: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1.0);
            jac.add(0, 1, 1.0);
            jac.add(1, 1, 1.0);
        },
    )
    .with_pattern(Pattern::from_entries(2, 2, [(0, 0), (1, 1)]).unwrap());
    let solved = solver
        .solve(&Mcp::ncp(stray).unwrap(), &mut [1.0, 1.0])
        .map(|r| r.status);
    assert!(matches!(solved, Err(ComplementarityError::Map(_))), "{solved:?}");
}

#[test]
fn iterates_stay_inside_where_the_function_needs_it() {
    use std::cell::Cell;
    let lowest = Cell::new(INF);
    let f = WithJacobian::new(
        2,
        |x: &[f64], out: &mut [f64]| {
            lowest.set(lowest.get().min(x[0]).min(x[1]));
            out[0] = x[0].ln() + x[1] - 3.0;
            out[1] = x[1].sqrt() - x[0] + 2.0;
        },
        |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1.0 / x[0]);
            jac.add(0, 1, 1.0);
            jac.add(1, 0, -1.0);
            jac.add(1, 1, 0.5 / x[1].sqrt());
        },
    );
    let problem = Mcp::new(f, vec![1e-3, 0.0], vec![INF; 2]).unwrap();
    for start in [[0.0, 0.0], [1.0, 1.0], [100.0, 0.0], [-5.0, 1e4]] {
        lowest.set(INF);
        assert!(solve(&problem, &start).1.is_solved(), "{start:?}");
        assert!(lowest.get() >= 0.0);
    }
}

#[test]
fn leaving_the_bounds_on_the_way_is_an_option() {
    // F is defined everywhere; the solution has one active bound.
    let f = || {
        WithJacobian::new(
            2,
            |x: &[f64], out: &mut [f64]| {
                out[0] = x[0].powi(3) + x[1] - 9.0;
                out[1] = x[0] - x[1].powi(3) + 3.0;
            },
            |x: &[f64], jac: &mut Matrix| {
                jac.add(0, 0, 3.0 * x[0] * x[0]);
                jac.add(0, 1, 1.0);
                jac.add(1, 0, 1.0);
                jac.add(1, 1, -3.0 * x[1] * x[1]);
            },
        )
    };
    let problem = Mcp::new(f(), vec![0.0, 0.0], vec![INF, 1.5]).unwrap();
    let mut solver = McpSolver::new(McpOptions::default().with_stay_inside(false));
    for start in [[0.0, 0.0], [5.0, 1.0], [-10.0, 40.0]] {
        let mut x = start;
        let report = solver.solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{start:?}: {:?}", report.status);
        assert!((0.0..=1.5).contains(&x[1]) && x[0] >= 0.0);
        assert!(crate::support::residual(&problem, &x) <= 1e-9);
    }
}

#[test]
fn rounding_does_not_excuse_residuals_far_out() {
    // x − y + 1 = 0 and y − x = 0 have no solution, but at 1e17 both vanish in floating-point numbers.
    let f = AffineFunction::new(matrix(&[vec![1.0, -1.0], vec![-1.0, 1.0]]), vec![1.0, 0.0]).unwrap();
    let problem = Mcp::equations(f).unwrap();
    for start in [0.0, 1.0, 1e6, 1e9] {
        let (x, report) = solve(&problem, &[start, start]);
        assert!(!report.is_solved(), "{start}: {x:?}");
    }
}

/// Functions that decrease to zero at infinity, and finally underflow, have no zero there.
#[test]
fn what_underflows_at_infinity_is_no_solution() {
    type Function = fn(f64) -> f64;
    let functions: [(Function, Function); 4] = [
        (|x| (-x).exp(), |x| -(-x).exp()),
        (|x| (-x * x).exp(), |x| -2.0 * x * (-x * x).exp()),
        (
            |x| (1.0 + x * x) * (-x).exp(),
            |x| (2.0 * x - 1.0 - x * x) * (-x).exp(),
        ),
        (|x| x.exp(), |x| x.exp()),
    ];
    for (k, (f, derivative)) in functions.into_iter().enumerate() {
        let problem = Mcp::equations(scalar(f, derivative)).unwrap();
        let starts = [-3.0, 0.5, 2.0, 20.0, 300.0];
        for start in starts.into_iter().filter(|s| f(*s) > 0.0) {
            let (x, report) = solve(&problem, &[start]);
            assert!(!report.is_solved(), "{k} from {start}: {x:?}");
        }
    }
}

/// Iterates far from the start, with a row all of whose terms vanish there, that nevertheless converge: stationary points on a circle (BT1
/// of P. Boggs and J. Tolle), f = −x + 10 (x² + y² − 1) under x² + y² = 1, at (±1, 0).
#[test]
fn iterates_that_come_to_rest_far_away_are_solutions() {
    let lagrangian = WithJacobian::new(
        3,
        |x: &[f64], out: &mut [f64]| {
            out[0] = -1.0 + 20.0 * x[0] - 2.0 * x[2] * x[0];
            out[1] = 20.0 * x[1] - 2.0 * x[2] * x[1];
            out[2] = x[0] * x[0] + x[1] * x[1] - 1.0;
        },
        |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 20.0 - 2.0 * x[2]);
            jac.add(0, 2, -2.0 * x[0]);
            jac.add(1, 1, 20.0 - 2.0 * x[2]);
            jac.add(1, 2, -2.0 * x[1]);
            jac.add(2, 0, 2.0 * x[0]);
            jac.add(2, 1, 2.0 * x[1]);
        },
    );
    let problem = Mcp::equations(lagrangian).unwrap();
    for start in [[0.08, 0.06, 0.0], [0.08, -0.06, 0.0], [-0.05, 0.06, 1.0]] {
        let (x, report) = solve(&problem, &start);
        assert_eq!(report.status, Status::Solved, "{start:?}: {x:?}");
        assert!(
            (x[0].abs() - 1.0).abs() <= 1e-9 && x[1].abs() <= 1e-9,
            "{start:?}: {x:?}"
        );
    }
}

/// Iterates may leave the box on the way; the point returned lies in it, however the run ends.
#[test]
fn a_run_cut_short_returns_a_point_of_the_box() {
    let mut rng = Random::new(11);
    for k in 0..40 {
        let n = 1 + k % 4;
        let b = rng.square(n);
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| b[i][j] + if i == j { 1.5 } else { 0.0 }).collect())
            .collect();
        let q: Vec<f64> = (0..n).map(|_| 2.0 * rng.symmetric()).collect();
        let cubes = WithJacobian::new(
            n,
            |x: &[f64], out: &mut [f64]| {
                for i in 0..n {
                    let row: f64 = rows[i].iter().zip(x).map(|(a, x)| a * x).sum();
                    out[i] = row + x[i].powi(3) + q[i];
                }
            },
            |x: &[f64], jac: &mut Matrix| {
                for i in 0..n {
                    (0..n).for_each(|j| jac.add(i, j, rows[i][j]));
                    jac.add(i, i, 3.0 * x[i] * x[i]);
                }
            },
        );
        let problem = Mcp::new(cubes, vec![0.0; n], vec![0.5 + (k % 3) as f64; n]).unwrap();
        for limit in 1..8 {
            for (strategy, stay_inside) in [
                (McpStrategy::Newton, true),
                (McpStrategy::Newton, false),
                (McpStrategy::FischerBurmeister, false),
                (McpStrategy::Smoothing, true),
                (McpStrategy::Restart, false),
            ] {
                let options = McpOptions::default()
                    .with_max_iterations(limit)
                    .with_stay_inside(stay_inside)
                    .with_strategies(vec![strategy]);
                let mut x = vec![0.4; n];
                let mut solver = McpSolver::new(options);
                let report = solver.solve(&problem, &mut x).unwrap();
                assert_eq!(report.feasibility, 0.0, "{k} {limit} {strategy:?}: {x:?}");
                assert!((report.residual - residual(&problem, &x)).abs() <= 1e-15);
            }
        }
    }
}
