//! The options determine which strategies are tried, and in which order.

use std::cell::Cell;

use semismooth::InputError;
use semismooth::complementarity::{
    BoundState, ComplementarityError, Mcp, McpFunction, McpOptions, McpSolver, McpStep, McpStrategy,
    WithJacobian,
};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::properties::known;
use crate::random::Random;
use crate::support::{INF, matrix, residual, scalar};

use McpStrategy::{
    Enumeration, FischerBurmeister, Homotopy, JosephyNewton, Newton, Proximal, Restart, Smoothing,
};

pub(crate) fn all() -> Vec<McpStrategy> {
    McpOptions::default().strategies
}

fn only(strategies: &[McpStrategy]) -> McpSolver {
    McpSolver::new(McpOptions::default().with_strategies(strategies.to_vec()))
}

#[test]
fn the_default_is_all_of_them_in_the_order_of_the_variants() {
    let all = all();
    assert!(all.len() >= 8 && all.windows(2).all(|w| w[0] < w[1]));
    let names: Vec<&str> = all.iter().map(|s| s.name()).collect();
    assert!(names.iter().all(|n| !n.is_empty()));
    assert_eq!(names[0], "Newton");
}

#[test]
fn each_strategy_solves_a_monotone_problem_alone() {
    let rows = [
        vec![3.0, 1.0, 0.0, -1.0],
        vec![0.0, 2.0, 1.0, 0.5],
        vec![1.0, -1.0, 4.0, 0.0],
        vec![1.0, 0.0, 0.0, 1.0],
    ];
    let (lower, upper) = (vec![0.0, -INF, -1.0, -2.0], vec![INF, INF, 0.25, INF]);
    let affine = Mcp::affine(matrix(&rows), vec![-4.0, 1.0, -3.0, 2.0], lower, upper).unwrap();
    for strategy in all() {
        let mut solver = only(&[strategy]);
        let mut x = [5.0, -3.0, 0.1, 7.0];
        let report = solver.solve(&affine, &mut x).unwrap();
        assert!(report.is_solved(), "{strategy}: {:?}", report.status);
        assert_eq!((report.strategy, report.fallbacks.len()), (strategy, 0));
        assert!(residual(&affine, &x) <= 1e-9, "{strategy}");
        if strategy == Enumeration {
            continue;
        }
        for seed in 1..12 {
            let (problem, exact) = known(seed, 7);
            let mut x: Vec<f64> = exact.iter().map(|x| x + 2.0).collect();
            let report = solver.solve(&problem, &mut x).unwrap();
            assert!(report.is_solved(), "{strategy}, seed {seed}: {:?}", report.status);
            assert!(
                x.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-7),
                "{strategy}"
            );
        }
    }
}

#[test]
fn strategies_are_tried_in_the_order_given() {
    let parabola = Mcp::equations(scalar(|x| x * x + 1.0, |x| 2.0 * x)).unwrap();
    for order in [
        vec![Homotopy, Smoothing, Newton],
        vec![Smoothing, FischerBurmeister],
        vec![Restart, Proximal],
    ] {
        let mut solver = only(&order);
        let report = solver.solve(&parabola, &mut [3.0]).unwrap();
        assert!(!report.is_solved());
        let mut tried: Vec<McpStrategy> = report.fallbacks.iter().map(|f| f.strategy).collect();
        tried.dedup();
        assert_eq!(tried, order);
        assert!(report.fallbacks.iter().all(|f| f.residual >= 1.0));
    }
    // Without fallbacks only the first of them is tried; a strategy that does not apply is passed over.
    let options = McpOptions::default()
        .with_strategies(vec![Smoothing, Newton])
        .with_fallbacks(false);
    let mut solver = McpSolver::new(options);
    let report = solver.solve(&parabola, &mut [3.0]).unwrap();
    assert_eq!(report.fallbacks.len(), 1);
    assert_eq!(report.fallbacks[0].strategy, Smoothing);
    assert!(
        only(&[Enumeration])
            .solve(&parabola, &mut [3.0])
            .unwrap()
            .fallbacks
            .is_empty()
    );
}

#[test]
fn enumeration_alone_rules_a_small_problem_out() {
    let problem = Mcp::affine(matrix(&[vec![-1.0]]), vec![-1.0], vec![0.0], vec![INF]).unwrap();
    let mut solver = only(&[Enumeration]);
    assert_eq!(
        solver.solve(&problem, &mut [1.0]).unwrap().status,
        Status::NoSolution
    );
}

#[test]
fn no_strategy_is_no_choice() {
    let problem = Mcp::equations(scalar(|x| x, |_| 1.0)).unwrap();
    let refused = only(&[]).solve(&problem, &mut [1.0]).map(|r| r.status);
    match refused {
        Err(ComplementarityError::Input(InputError::Option { name, .. })) => assert_eq!(name, "strategies"),
        other => panic!("{other:?}"),
    }
}

/// F = (y − c, −x) with x free and y in a box: moving along x changes the row of y only, which proves nothing if c lies in the box; if c
/// lies outside, it proves that there is no solution.
#[test]
fn proximal_points_distinguish_solvable_problems() {
    let rows = [vec![0.0, 1.0], vec![-1.0, 0.0]];
    for (c, feasible) in [
        (5.0, true),
        (0.5, true),
        (9.5, true),
        (12.0, false),
        (-2.0, false),
    ] {
        let problem = Mcp::affine(matrix(&rows), vec![-c, 0.0], vec![-INF, 0.0], vec![INF, 10.0]).unwrap();
        for start in [[100.0, 3.0], [-50.0, 0.0], [7.0, 10.0]] {
            let mut x = start;
            let mut solver = only(&[Proximal]);
            let report = solver.solve(&problem, &mut x).unwrap();
            assert_eq!(
                report.is_solved(),
                feasible,
                "{c} from {start:?}: {:?}",
                report.status
            );
            if feasible {
                assert!(x[0].abs() < 1e-8 && (x[1] - c).abs() < 1e-8, "{x:?}");
            } else {
                assert_eq!(report.status, Status::NoSolution, "{c} from {start:?}");
                // vᵀF < 0 everywhere in the box: v = (±1, 0).
                assert_eq!(report.certificate, [if c > 10.0 { 1.0 } else { -1.0 }, 0.0]);
            }
        }
    }
}

/// The path of smoothed equations is followed before Newton's method ends at its solution.
#[test]
fn smoothing_stays_next_to_its_path() {
    for seed in 1..12 {
        let (problem, exact) = known(seed, 7);
        let mut x: Vec<f64> = exact.iter().map(|x| x + 2.0).collect();
        let mut solver = only(&[Smoothing]);
        let report = solver.solve(&problem, &mut x).unwrap();
        let smoothed = report
            .history
            .iter()
            .filter(|i| i.step == McpStep::Own && i.strategy == Smoothing);
        let merits: Vec<f64> = smoothed.map(|i| i.merit).collect();
        assert!(merits.len() >= 3, "seed {seed}: {}", merits.len());
        assert!(merits.last() < merits.first(), "seed {seed}: {merits:?}");
    }
}

/// A function that counts its calls.
struct Counting<F> {
    function: F,
    values: Cell<usize>,
    jacobians: Cell<usize>,
}

impl<F: McpFunction> McpFunction for Counting<F> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.values.set(self.values.get() + 1);
        self.function.value(x, out);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.jacobians.set(self.jacobians.get() + 1);
        self.function.jacobian(x, jac);
    }
}

/// x³ − 2 x + 1 + c y, y eˣ − 1 + d x: neither monotone nor affine, and some have no solution.
fn counted(seed: u64) -> Mcp<Counting<impl McpFunction>> {
    let (c, d) = (0.7 * (seed % 5) as f64 - 1.4, 0.9 * (seed % 7) as f64 - 2.7);
    let function = semismooth::complementarity::WithJacobian::new(
        2,
        move |x: &[f64], out: &mut [f64]| {
            out[0] = x[0].powi(3) - 2.0 * x[0] + 1.0 + c * x[1];
            out[1] = x[1] * x[0].exp() - 1.0 + d * x[0];
        },
        move |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 3.0 * x[0] * x[0] - 2.0);
            jac.add(0, 1, c);
            jac.add(1, 0, x[1] * x[0].exp() + d);
            jac.add(1, 1, x[0].exp());
        },
    );
    let counting = Counting {
        function,
        values: Cell::new(0),
        jacobians: Cell::new(0),
    };
    Mcp::new(counting, vec![-1.5, 0.0], vec![2.0, INF]).unwrap()
}

#[test]
fn reports_count_each_call_of_the_functions() {
    for strategy in all() {
        for seed in 0..35 {
            let problem = counted(seed);
            let mut x = [0.3 * (seed % 11) as f64 - 1.5, 0.5];
            let mut solver = only(&[strategy]);
            let report = solver.solve(&problem, &mut x).unwrap();
            let f = problem.function();
            assert_eq!(
                (report.evaluations, report.jacobians),
                (f.values.get(), f.jacobians.get()),
                "{strategy}, {seed}: {}",
                report.status
            );
        }
    }
}

/// The active set of a start is a guess: any one leads to the unique solution, the right one in one step.
#[test]
fn any_active_set_to_start_from_leads_to_the_solution() {
    for seed in 1..60 {
        let (problem, exact) = known(seed, 7);
        let mut rng = Random::new(seed);
        let guess = |i: usize, u: f64| match (problem.lower()[i].is_finite(), problem.upper()[i].is_finite())
        {
            (true, _) if u < -0.3 => BoundState::Lower,
            (_, true) if u > 0.3 => BoundState::Upper,
            _ => BoundState::Interior,
        };
        let states: Vec<BoundState> = (0..7).map(|i| guess(i, rng.symmetric())).collect();
        let mut solver = McpSolver::default();
        let mut x = vec![0.0; 7];
        let report = solver
            .solve_from_states(&problem, &mut x, &states)
            .unwrap()
            .clone();
        assert!(report.is_solved(), "{seed}: {}", report.status);
        let distance = x
            .iter()
            .zip(&exact)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-8, "{seed}: {distance:e}");
        // A restart from the solution: nothing changes any more.
        let again = solver
            .solve_from_states(&problem, &mut x, &report.states)
            .unwrap();
        assert!(
            again.is_solved() && again.iterations <= 2,
            "{seed}: {}",
            again.iterations
        );
    }
}

/// M is diagonally dominant with a negative off-diagonal part: from any active set full steps converge, and none returns to the start.
#[test]
fn full_steps_go_on_from_any_active_set() {
    let n = 12;
    for seed in 1..40 {
        let mut rng = Random::new(seed);
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let row: Vec<f64> = (0..n).map(|_| -rng.symmetric().abs()).collect();
                let sum: f64 = row.iter().map(|v| v.abs()).sum();
                (0..n).map(|j| if i == j { sum + 0.1 } else { row[j] }).collect()
            })
            .collect();
        let problem = Mcp::affine(matrix(&rows), rng.vector(n, 1.0), vec![0.0; n], vec![INF; n]).unwrap();
        let guess = |u: f64| {
            if u < 0.0 {
                BoundState::Lower
            } else {
                BoundState::Interior
            }
        };
        let states: Vec<BoundState> = (0..n).map(|_| guess(rng.symmetric())).collect();
        let mut solver = only(&[Newton]);
        let mut x = vec![0.0; n];
        let report = solver.solve_from_states(&problem, &mut x, &states).unwrap();
        assert!(
            report.is_solved() && residual(&problem, &x) <= 1e-9,
            "{seed}: {}",
            report.status
        );
        let first = report.history[0].residual;
        assert!(report.history[1..].iter().all(|i| i.residual != first), "{seed}");
    }
}

/// Where rounding leaves a residual above the tolerance, iterations end as soon as only rounding is left.
#[test]
fn large_units_of_a_row_cost_no_iterations() {
    for c in [2.0, 3.0, 5.0, 7.0, 11.0] {
        let iterations = |unit: f64| {
            let root = Mcp::equations(scalar(|x| unit * (x * x - c), |x| 2.0 * unit * x)).unwrap();
            let mut x = [2.2];
            let mut solver = only(&[Newton]);
            let report = solver.solve(&root, &mut x).unwrap();
            assert!(
                report.is_solved() && (x[0] - f64::sqrt(c)).abs() < 1e-14,
                "{unit:e}: {x:?}"
            );
            report.iterations
        };
        let usual = iterations(1.0);
        assert!(usual >= 3);
        for unit in [1e15, 1e60, 1e150] {
            assert!(
                iterations(unit) <= usual + 1,
                "{c}, {unit:e}: {} {usual}",
                iterations(unit)
            );
        }
    }
}

/// M = 3/2, q = −3/2, which are units of their own: from 4 each component is at its bound for the natural map, and at the solution 1 none
/// is.
#[test]
fn changes_of_pieces_are_counted() {
    let n = 5;
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| 1.5 * f64::from(u8::from(i == j))).collect())
        .collect();
    let problem = Mcp::affine(matrix(&rows), vec![-1.5; n], vec![0.0; n], vec![INF; n]).unwrap();
    for (start, changes) in [(4.0, n), (0.25, 0)] {
        let mut x = vec![start; n];
        let mut solver = only(&[Newton]);
        let report = solver.solve(&problem, &mut x).unwrap();
        assert!(report.is_solved() && x.iter().all(|x| *x == 1.0));
        let counted: usize = report.history.iter().map(|i| i.sites_changed).sum();
        assert_eq!(counted, changes, "from {start}");
    }
}

/// q + A x + a nonlinear function of each component, in a box.
pub(crate) fn random_problem(rng: &mut Random, k: usize) -> Mcp<impl McpFunction + use<>> {
    let n = 4;
    let shift = [1.5, 0.0, 0.5, -0.3][k % 4];
    let a: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| rng.symmetric() + if i == j { shift } else { 0.0 })
                .collect()
        })
        .collect();
    let q: Vec<f64> = (0..n).map(|_| 3.0 * rng.symmetric()).collect();
    let c: Vec<f64> = (0..n).map(|_| rng.symmetric()).collect();
    let bend = move |c: f64, x: f64| match k / 4 % 3 {
        0 => (c.abs() * x.powi(3), 3.0 * c.abs() * x * x),
        1 => (c * (3.0 * x).sin(), 3.0 * c * (3.0 * x).cos()),
        _ => (5.0 * c * x.atan(), 5.0 * c / (1.0 + x * x)),
    };
    let (rows, slopes) = (a.clone(), c.clone());
    let function = WithJacobian::new(
        n,
        move |x: &[f64], out: &mut [f64]| {
            for i in 0..n {
                let row: f64 = a[i].iter().zip(x).map(|(a, x)| a * x).sum();
                out[i] = q[i] + row + bend(c[i], x[i]).0;
            }
        },
        move |x: &[f64], jac: &mut Matrix| {
            for i in 0..n {
                (0..n).for_each(|j| jac.add(i, j, rows[i][j]));
                jac.add(i, i, bend(slopes[i], x[i]).1);
            }
        },
    );
    let upper = [INF, 5.0][k % 2];
    Mcp::new(function, vec![0.0; n], vec![upper; n]).unwrap()
}

/// A path begins at the start, unaffected by earlier failures: it ends where it ends when tried alone, to the last bit.
#[test]
fn paths_do_not_depend_on_earlier_strategies() {
    let mut rng = Random::new(5);
    let mut compared = 0;
    for k in 0..120 {
        let problem = random_problem(&mut rng, k);
        let start: Vec<f64> = (0..4).map(|_| 10.0 * rng.symmetric().abs()).collect();
        let run = |strategies: &[McpStrategy]| {
            let mut x = start.clone();
            let mut solver = only(strategies);
            let report = solver.solve(&problem, &mut x).unwrap();
            (report.is_solved(), report.strategy, x)
        };
        let alone = run(&[Homotopy]);
        for first in [FischerBurmeister, Smoothing, JosephyNewton] {
            let after = run(&[first, Homotopy]);
            if alone.0 && after.1 == Homotopy {
                assert_eq!(after, alone, "{k}: {first:?}");
                compared += 1;
            }
        }
    }
    assert!(compared > 20, "{compared}");
}

/// Where the solutions of linearised problems overshoot, short steps are taken. Found by random tests.
#[test]
fn linearised_problems_take_short_steps() {
    const SLOPE: f64 = 0.475_290_168_629_312_95;
    const HEIGHT: f64 = 0.695_423_434_869_521;
    let function = scalar(
        |x| -1.126_642_065_369_050_5 + SLOPE * x + HEIGHT * (3.0 * x).sin(),
        |x| SLOPE + 3.0 * HEIGHT * (3.0 * x).cos(),
    );
    let problem = Mcp::new(function, vec![0.0], vec![INF]).unwrap();
    let mut x = [0.288_311_881_519_445_87];
    let mut solver = only(&[JosephyNewton]);
    assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
    assert!(residual(&problem, &x) < 1e-9);
}

/// Where F is defined is unknown before it is evaluated, perhaps not on the bounds: no point tried lies on one.
#[test]
fn points_tried_for_a_domain_lie_inside_the_bounds() {
    for (lower, upper) in [(0.0, INF), (-INF, 2.0), (0.0, 2.0)] {
        let (tried, inside) = (Cell::new(0), Cell::new(0));
        let nowhere = WithJacobian::new(
            2,
            |x: &[f64], out: &mut [f64]| {
                tried.set(tried.get() + 1);
                inside.set(inside.get() + usize::from(x.iter().all(|x| lower < *x && *x < upper)));
                out.fill(f64::NAN);
            },
            |_: &[f64], _: &mut Matrix| {},
        );
        let problem = Mcp::new(nowhere, vec![lower; 2], vec![upper; 2]).unwrap();
        let mut solver = McpSolver::default();
        let report = solver.solve(&problem, &mut [1.0; 2]).unwrap();
        assert!(matches!(report.status, Status::EvaluationFailure { .. }));
        assert!(tried.get() > 30, "{}", tried.get());
        assert_eq!(inside.get(), tried.get(), "{lower} {upper}");
    }
}

/// (x − 1)ᵖ at the bound 1, lower or upper: it vanishes there with all its terms, so flatly that only the bound itself is a solution to the
/// last digit.
#[test]
fn solutions_where_all_terms_vanish_are_on_their_bounds() {
    for (lower, upper, side) in [
        (1.0, INF, 1.0),
        (1.0, 5.0, 1.0),
        (-INF, 1.0, -1.0),
        (-3.0, 1.0, -1.0),
    ] {
        for power in 3..6 {
            let f = scalar(
                move |x| side * (side * (x - 1.0)).powi(power),
                move |x| f64::from(power) * (side * (x - 1.0)).powi(power - 1),
            );
            let problem = Mcp::new(f, vec![lower], vec![upper]).unwrap();
            let mut x = [1.0 + 2.0 * side];
            let mut solver = McpSolver::default();
            let report = solver.solve(&problem, &mut x).unwrap();
            assert!(report.is_solved() && x == [1.0], "{power} {side}: {x:?}");
        }
    }
}

/// Perturbed starts are other points than the start.
#[test]
fn restarts_begin_elsewhere() {
    let problem = Mcp::equations(scalar(|x| x * x + 1.0, |x| 2.0 * x)).unwrap();
    for start in [3.0, -0.5, 20.0] {
        let mut solver = only(&[McpStrategy::Restart]);
        let report = solver.solve(&problem, &mut [start]).unwrap();
        assert!(!report.is_solved());
        let here = residual(&problem, &[start]);
        assert!(report.history.iter().all(|i| i.residual != here), "{start}");
    }
}

/// 1 + √x has no root, and is not defined at the start: each strategy starts where F is defined.
#[test]
fn strategies_begin_where_a_domain_was_entered() {
    let function = scalar(|x| 1.0 + x.sqrt(), |x| 0.5 / x.sqrt());
    let problem = Mcp::equations(function).unwrap();
    let mut solver = only(&[Newton, FischerBurmeister, Proximal, Smoothing]);
    let report = solver.solve(&problem, &mut [-0.5]).unwrap();
    assert!(!report.is_solved());
    assert_eq!(report.fallbacks.len(), 4);
    for tried in &report.fallbacks {
        assert!(tried.residual.is_finite(), "{}", tried.strategy);
    }
}

/// Nothing is known of a domain that is small and far from the start: the arbitrary value 1 is tried, too.
#[test]
fn domains_about_one_are_found_from_anywhere() {
    let inside = |x: f64| {
        if (x - 1.0).abs() < 1e-3 {
            x - 1.0005
        } else {
            f64::NAN
        }
    };
    let function = WithJacobian::new(
        2,
        move |x: &[f64], out: &mut [f64]| out.iter_mut().zip(x).for_each(|(f, x)| *f = inside(*x)),
        |_: &[f64], jac: &mut Matrix| (0..2).for_each(|i| jac.add(i, i, 1.0)),
    );
    let problem = Mcp::equations(function).unwrap();
    for start in [[300.0, -7.0], [-40.0, 0.2], [3e5, 2e4]] {
        let mut x = start;
        let mut solver = McpSolver::default();
        let report = solver.solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{start:?}: {}", report.status);
        assert!(x.iter().all(|x| (x - 1.0005).abs() < 1e-12));
    }
}
