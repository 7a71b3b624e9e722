//! The examples of Haslinger, Janovský and Ligurský (2012) against exact rational arithmetic: every branch,
//! from both ends, for step bounds over four decades.

use crate::common;
use crate::common::{Case, Link, Vertex, cases};
use semismooth::contact::{Contact, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination, TransitionKind};
use semismooth::interface::View;

const WINDOW: (f64, f64) = (-12.0, 25.0);

/// A parameter inside the first piece of a chain, and the direction towards the end at which the chain leaves
/// it.
fn start_of(chain: &[Link], vertices: &[Vertex]) -> (f64, Direction) {
    let first = &chain[0];
    let (lo, hi) = first.interval;
    let inside = match (lo.is_finite(), hi.is_finite()) {
        (true, true) => 0.5 * (lo + hi),
        (true, false) => (lo + 4.0).min(WINDOW.1 - 1.0),
        (false, true) => hi - 4.0,
        (false, false) => 1.0,
    };
    let falling = match first.leave {
        Some(v) => vertices[v].alpha <= inside,
        None => hi.is_finite(),
    };
    let direction = if falling {
        Direction::Decreasing
    } else {
        Direction::Increasing
    };
    (inside, direction)
}

fn check_chain<V: View>(map: &Contact<V, PlanarCoulomb>, case: &Case, chain: &[Link], h_max: f64) {
    let vertices = case.vertices();
    if chain[0].vertical {
        return;
    }
    let (alpha, direction) = start_of(chain, &vertices);
    let start = map
        .solve_from_states(alpha, &chain[0].states)
        .unwrap_or_else(|e| panic!("{}: {e}", case.name));
    let options = ContinuationOptions::default()
        .with_parameter_range(WINDOW)
        .with_max_step(h_max)
        .with_step(h_max.min(0.05))
        .with_max_points(200_000)
        .with_max_growth(30.0);
    let branch = Branch::follow(map, &start, direction, options).unwrap();
    let expected: Vec<usize> = chain.iter().filter_map(|l| l.leave).collect();
    let context = format!("{} h_max {h_max}", case.name);
    assert_eq!(
        branch.transitions.len(),
        expected.len(),
        "{context}: {:?}",
        branch.termination
    );
    for (k, (t, &v)) in branch.transitions.iter().zip(&expected).enumerate() {
        let vertex = &vertices[v];
        let scale = 1.0 + vertex.alpha.abs();
        assert!(
            (t.parameter() - vertex.alpha).abs() <= 1e-10 * scale,
            "{context}: {}",
            t.parameter()
        );
        for (theta, exact) in map.theta(&t.x).iter().zip(&vertex.theta) {
            for (a, b) in theta.iter().zip(exact) {
                assert!(
                    (a - b).abs() <= 1e-10 * (1.0 + b.abs()),
                    "{context}: {theta:?} {exact:?}"
                );
            }
        }
        let u = map.displacements(&t.x).unwrap();
        for (a, b) in u.iter().zip(&vertex.u) {
            assert!((a - b).abs() <= 1e-10 * (1.0 + b.abs()), "{context}");
        }
        assert_eq!(map.states(&t.before), chain[k].states, "{context}");
        let vertical_next = chain.get(k + 1).map(|l| l.vertical);
        let kind = match (vertex.kind.as_str(), vertex.fold, vertical_next) {
            ("end", ..) => TransitionKind::End,
            ("branching", ..) => TransitionKind::Branching,
            (_, _, Some(true)) => TransitionKind::VerticalBegin,
            (_, true, _) => TransitionKind::Fold,
            _ => TransitionKind::PassThrough,
        };
        assert_eq!(t.kind, kind, "{context}");
        if let Some(next) = chain.get(k + 1) {
            assert_eq!(map.states(&t.after), next.states, "{context}");
            assert_eq!(t.det_sign.map(i64::from), Some(next.det_sign), "{context}");
        }
    }
    let last = chain.last().unwrap();
    let ends = match last.leave.map(|v| vertices[v].kind.as_str()) {
        Some("end") => vec![Termination::End],
        Some("branching") => vec![Termination::Branching],
        _ => vec![Termination::ParameterRange, Termination::Unbounded],
    };
    assert!(
        ends.contains(&branch.termination),
        "{context}: {}",
        branch.termination
    );
    for point in &branch.points {
        if let Some(sign) = point.det_sign {
            let states = map.states(&point.selection);
            let known = chain.iter().find(|l| l.states == states).expect(&context);
            assert_eq!(i64::from(sign), known.det_sign, "{context}");
        }
    }
}

#[test]
fn every_branch_from_both_ends_for_all_step_bounds() {
    for case in cases() {
        let degenerate = case.name.starts_with("deg_");
        for reverse in [false, true] {
            for chain in case.chains(reverse) {
                for h_max in [1e-3, 1e-2, 0.05, 0.5, 5.0] {
                    if degenerate && h_max < 0.05 {
                        continue;
                    }
                    check_chain(&case.problem, &case, &chain, h_max);
                }
                let condensed = case.problem.condensed().unwrap();
                check_chain(&condensed, &case, &chain, 0.5);
            }
        }
    }
}

/// The tables printed for p = 2, Example 1 (its printed load is rounded, hence the tolerance).
#[test]
fn printed_classification_of_the_transition_points() {
    let case = cases().into_iter().find(|c| c.name == "p2_ex1").unwrap();
    let stick = common::states("KK");
    let start = case.problem.solve_from_states(8.0, &stick).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 12.0));
    let branch = Branch::follow(&case.problem, &start, Direction::Decreasing, options).unwrap();
    let printed = [
        ([[0.4, -4.2834, 0.0], [1.3717, -9.4859, 5.2025]], ["KK", "-K"]),
        ([[0.4, -3.0019, -0.6407], [1.0513, -6.2056, 0.0]], ["-K", "--"]),
        ([[0.0, -2.2278, -2.2278], [0.2578, -5.3667, -0.8]], ["--", "O-"]),
    ];
    assert_eq!(branch.transitions.len(), printed.len());
    for (t, (theta, names)) in branch.transitions.iter().zip(&printed) {
        for (node, expected) in case.problem.theta(&t.x).iter().zip(theta) {
            for (a, b) in node.iter().zip(expected) {
                assert!((a - b).abs() <= 2.5e-4, "{node:?} {expected:?}");
            }
        }
        assert_eq!(case.problem.states(&t.before), common::states(names[0]));
        assert_eq!(case.problem.states(&t.after), common::states(names[1]));
    }
}
