//! Reports against what holds at the point returned, and for equivalent formulations of one problem.

use semismooth::complementarity::{
    BoundState, Mcp, McpFunction, McpIteration, McpOptions, McpReport, McpSolver, McpStep, McpStrategy,
    WithJacobian,
};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::properties::mirrored;
use crate::random::Random;
use crate::strategies::{all, random_problem};
use crate::support::{INF, residual};

fn run<F: McpFunction>(options: &McpOptions, problem: &Mcp<F>, start: &[f64]) -> (Vec<f64>, McpReport) {
    let mut x = start.to_vec();
    let mut solver = McpSolver::new(options.clone());
    let report = solver.solve(problem, &mut x).unwrap().clone();
    (x, report)
}

/// Each strategy alone, and all of them.
fn choices() -> Vec<McpOptions> {
    let alone = all()
        .into_iter()
        .map(|s| McpOptions::default().with_strategies(vec![s]));
    alone.chain([McpOptions::default()]).collect()
}

fn starts(rng: &mut Random) -> Vec<f64> {
    (0..4).map(|_| 6.0 * rng.symmetric()).collect()
}

fn check_point<F: McpFunction>(problem: &Mcp<F>, x: &[f64], report: &McpReport) {
    let mut f = vec![0.0; x.len()];
    problem.function().value(x, &mut f);
    let (mut complementarity, mut feasibility) = (0.0_f64, 0.0_f64);
    for i in 0..x.len() {
        let (l, u) = (problem.lower()[i], problem.upper()[i]);
        feasibility = feasibility.max(l - x[i]).max(x[i] - u);
        let distance = if f[i] > 0.0 { x[i] - l } else { u - x[i] };
        complementarity = complementarity.max(distance.abs().min(f[i].abs()));
        let state = if x[i] == l && f[i] >= 0.0 {
            BoundState::Lower
        } else if x[i] == u && f[i] <= 0.0 {
            BoundState::Upper
        } else {
            BoundState::Interior
        };
        assert_eq!(report.states[i], state);
    }
    let size = 1.0 + x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    assert!((report.residual - residual(problem, x)).abs() <= 4.0 * f64::EPSILON * size);
    assert_eq!(
        (report.feasibility, report.complementarity),
        (feasibility, complementarity)
    );
    assert_eq!(report.is_solved(), report.status == Status::Solved);
    assert_eq!(report.certificate.is_empty(), report.status != Status::NoSolution);
}

/// Iterates are numbered by the steps made so far, including those of linearised problems and along paths; attempts follow one another,
/// each with its own smallest residual.
fn check_history(report: &McpReport, max_iterations: usize) {
    let mut steps = 0;
    let pivots = |i: &McpIteration| {
        matches!(
            i.strategy,
            McpStrategy::JosephyNewton | McpStrategy::Homotopy | McpStrategy::Restart
        )
    };
    let linearises = report.history.iter().any(pivots);
    for entry in &report.history {
        assert!(entry.index == steps || linearises && entry.index > steps);
        steps = entry.index + usize::from(entry.step != McpStep::None);
        assert_eq!(entry.step == McpStep::None, entry.damping == 0.0, "{entry:?}");
        assert!(
            entry.damping >= 0.0 && (entry.merit >= 0.0 || entry.merit.is_nan()) && entry.sites_changed <= 4
        );
    }
    assert_eq!(report.iterations, steps);
    assert!(steps <= max_iterations);
    let failed: usize = report.fallbacks.iter().map(|f| f.iterations).sum();
    assert!(failed <= steps);
    if !report.is_solved() {
        assert_eq!(failed, steps);
        assert!(report.fallbacks.iter().all(|f| f.outcome != Status::Solved));
    }
    // Of each attempt no iterate is better than its smallest residual.
    let mut from = 0;
    for attempt in &report.fallbacks {
        let to = from + attempt.iterations;
        let own = report
            .history
            .iter()
            .filter(|i| i.step != McpStep::None && (from..to).contains(&i.index));
        for entry in own {
            assert_eq!(entry.strategy, attempt.strategy);
            assert!(attempt.residual <= entry.residual, "{attempt:?} {entry:?}");
        }
        from = to;
    }
}

#[test]
fn reports_describe_the_point_returned() {
    let mut rng = Random::new(11);
    let mut ended = [0; 2];
    for k in 0..24 {
        let problem = random_problem(&mut rng, k);
        let start = starts(&mut rng);
        for options in choices() {
            for limit in [3, 500] {
                let options = options.clone().with_max_iterations(limit);
                let (x, report) = run(&options, &problem, &start);
                check_point(&problem, &x, &report);
                check_history(&report, limit);
                ended[usize::from(report.is_solved())] += 1;
            }
        }
    }
    assert!(ended.iter().all(|n| *n > 50), "{ended:?}");
}

/// All parts of an entry; entries along paths have no merit.
fn parts(i: &McpIteration) -> (usize, McpStep, [u64; 3], usize) {
    let bits = [i.residual, i.merit, i.damping].map(|v| if v.is_nan() { u64::MAX } else { v.to_bits() });
    (i.index, i.step, bits, i.sites_changed)
}

/// In the mirrored problem each number has the opposite sign, to the last bit, and lower bounds are upper bounds.
#[test]
fn histories_in_a_mirror_are_the_same_in_every_bit() {
    let mut rng = Random::new(3);
    for k in 0..24 {
        let problem = random_problem(&mut rng, 2 * k);
        let other = mirrored(problem.function(), &problem);
        let start = starts(&mut rng);
        let turned: Vec<f64> = start.iter().map(|v| -v).collect();
        for strategy in all() {
            // Random starts and the order of pivots are not mirrored.
            if matches!(strategy, McpStrategy::Restart | McpStrategy::JosephyNewton) {
                continue;
            }
            let options = McpOptions::default().with_strategies(vec![strategy]);
            let (x, report) = run(&options, &problem, &start);
            let (z, again) = run(&options, &other, &turned);
            assert!(
                report
                    .history
                    .iter()
                    .map(parts)
                    .eq(again.history.iter().map(parts)),
                "{k} {strategy}"
            );
            assert!(x.iter().zip(&z).all(|(x, z)| *x == -z), "{k} {strategy}");
            assert_eq!(
                (report.error, report.factorisations),
                (again.error, again.factorisations)
            );
            for (a, b) in report.states.iter().zip(&again.states) {
                let mirrored = match a {
                    BoundState::Lower => BoundState::Upper,
                    BoundState::Upper => BoundState::Lower,
                    other => *other,
                };
                assert_eq!(*b, mirrored);
            }
        }
    }
}

/// 0 ≤ x ⟂ F ≥ 0 with F = x − c, in a box: the solution is the nearest point, found in one step.
#[test]
fn projections_take_one_step() {
    for (c, state, solution) in [
        (0.5, BoundState::Interior, 0.5),
        (-2.0, BoundState::Lower, 0.0),
        (3.0, BoundState::Upper, 1.0),
    ] {
        let function = WithJacobian::new(
            1,
            move |x: &[f64], out: &mut [f64]| out[0] = x[0] - c,
            |_: &[f64], jac: &mut Matrix| jac.add(0, 0, 1.0),
        );
        for upper in [1.0, INF] {
            if c > 1.0 && upper == INF {
                continue;
            }
            let problem = Mcp::new(&function, vec![0.0], vec![upper]).unwrap();
            for start in [-4.0, 0.25, 9.0] {
                let (x, report) = run(&McpOptions::default(), &problem, &[start]);
                assert!(report.is_solved());
                assert_eq!((x[0], report.states[0]), (solution, state));
                assert!(report.iterations <= 1, "{c} {start} {}", report.iterations);
                assert_eq!(
                    (report.residual, report.complementarity, report.feasibility),
                    (0.0, 0.0, 0.0)
                );
                assert_eq!(report.strategy, McpStrategy::Newton);
            }
        }
    }
}
