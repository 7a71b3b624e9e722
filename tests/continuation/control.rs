//! Targets, limits and the iterator.

use std::ops::ControlFlow;

use super::curves::{follow, lens, near, parabola_and_line, two_arcs, within};
use super::maps::Plane;
use crate::squares;
use semismooth::InputError;
use semismooth::continuation::{
    Branch, Continuation, ContinuationError, ContinuationOptions, Diagram, DiagramOptions, Direction, Event,
    FoldSet, PointKind, Termination, arms_at,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

#[test]
fn targets_and_bounds_are_hit_exactly() {
    let map = parabola_and_line();
    let targets = vec![1.0 / 3.0, 5.0, 0.1, -0.2, 0.7, 1e-9];
    let o = within((-2.0, 5.7)).with_targets(targets.clone());
    let branch = follow(&map, [2.4, 4.76], Direction::Decreasing, o);
    let hits: Vec<f64> = branch
        .points
        .iter()
        .filter(|p| p.kind == PointKind::Target)
        .map(|p| p.x[1])
        .collect();
    // Down to the fold at α = (1 − √17)/8 and up again, bit for bit; 5 lies above the start.
    let expected = [
        0.7,
        1.0 / 3.0,
        0.1,
        1e-9,
        -0.2,
        -0.2,
        1e-9,
        0.1,
        1.0 / 3.0,
        0.7,
        5.0,
        5.7,
    ];
    assert_eq!(hits, expected);
    assert_eq!(branch.termination, Termination::ParameterRange);
    for p in &branch.points {
        assert!(map.value(&p.x).abs() < 1e-14);
    }
}

#[test]
fn a_start_on_the_bound_walks_inwards() {
    let branch = follow(&lens(), [0.75, 0.5], Direction::Decreasing, within((-0.5, 0.5)));
    assert_eq!(branch.points.last().unwrap().x[1], -0.5);
    let branch = follow(&lens(), [0.75, 0.5], Direction::Increasing, within((-0.5, 0.5)));
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert!(branch.transitions.is_empty());
}

#[test]
fn limits_end_a_branch() {
    let map = parabola_and_line();
    let start = [2.4, 4.76];
    let o = within((-2.0, 6.0));
    let branch = follow(&map, start, Direction::Decreasing, o.clone().with_max_points(7));
    assert_eq!(branch.termination, Termination::PointLimit);
    assert_eq!(branch.points.len() + branch.transitions.len(), 7);
    let branch = follow(
        &map,
        start,
        Direction::Decreasing,
        o.clone().with_max_arclength(1.25),
    );
    assert_eq!(branch.termination, Termination::ArclengthLimit);
    let length = branch.arclength();
    assert!((1.25 - 1e-6..1.26).contains(&length), "{length}");
    let o = within((-2.0, 1e9)).with_max_growth(10.0);
    let branch = follow(&map, start, Direction::Increasing, o);
    assert_eq!(branch.termination, Termination::Unbounded);
}

#[test]
fn the_iterator_can_be_inspected() {
    let map = parabola_and_line();
    let mut curve =
        Continuation::new(&map, &[2.4, 4.76], Direction::Decreasing, within((-2.0, 6.0))).unwrap();
    let first = curve.next().unwrap().unwrap();
    assert!(matches!(&first, Event::Point(p) if p.kind == PointKind::Start));
    let mut arclength = -1.0;
    for _ in 0..5 {
        let event = curve.next().unwrap().unwrap();
        let point = curve.point();
        assert_eq!(point.x, event.x());
        assert!((point.tangent[0].hypot(point.tangent[1]) - 1.0).abs() < 1e-12);
        assert_eq!((point.selection.len(), curve.termination()), (1, None));
        assert!(event.arclength() > arclength);
        arclength = event.arclength();
    }
    curve.stop();
    assert!(curve.next().is_none());
    assert_eq!(curve.termination(), Some(Termination::Interrupted));
    // The rest of a curve can be collected.
    let mut curve =
        Continuation::new(&map, &[2.4, 4.76], Direction::Decreasing, within((-2.0, 6.0))).unwrap();
    curve.next().unwrap().unwrap();
    let rest = Branch::collect(curve, |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(
        (rest.transitions.len(), rest.termination),
        (2, Termination::ParameterRange)
    );
}

#[test]
fn an_observer_stops_at_the_first_transition() {
    let map = parabola_and_line();
    let curve = Continuation::new(&map, &[2.4, 4.76], Direction::Decreasing, within((-2.0, 6.0))).unwrap();
    let branch = Branch::collect(curve, |event| match event {
        Event::Transition(_) => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    })
    .unwrap();
    assert_eq!(
        (branch.transitions.len(), branch.termination),
        (1, Termination::Interrupted)
    );
    assert!(
        branch
            .points
            .iter()
            .all(|p| p.x[1] >= branch.transitions[0].parameter())
    );
}

#[test]
fn a_start_off_the_curve_is_corrected_at_its_parameter() {
    let branch = follow(
        &lens(),
        [0.9, 0.5],
        Direction::Increasing,
        within((-2.0, 2.0)).with_max_points(3),
    );
    assert!(near(&branch.points[0].x, [0.75, 0.5], 1e-12));
}

#[test]
fn two_runs_agree_in_every_bit() {
    for map in [parabola_and_line(), lens(), two_arcs()] {
        let run = || {
            let start = [[2.4, 4.76], [0.75, 0.5], [0.6, 0.8]];
            let x = start.into_iter().find(|x| map.value(x).abs() < 1e-12).unwrap();
            follow(&map, x, Direction::Decreasing, within((-2.0, 6.0)))
        };
        assert_eq!(run(), run());
    }
}

/// From a start outside the range no curve leads back to the bound: all functions that follow a curve refuse it.
#[test]
fn starts_outside_the_range_are_refused() {
    let map = parabola_and_line();
    let x = [2.4, 4.76];
    for range in [(-2.0, 4.0), (4.77, 9.0)] {
        for direction in [Direction::Increasing, Direction::Decreasing] {
            let error = Branch::follow(&map, &x, direction, within(range)).unwrap_err();
            assert!(
                matches!(
                    error,
                    ContinuationError::Input(InputError::Option {
                        name: "start",
                        value: 4.76,
                        ..
                    })
                ),
                "{error}"
            );
        }
        assert!(arms_at(&map, &x, &within(range)).is_err());
    }
    // The bound itself is inside.
    let branch = follow(&map, x, Direction::Decreasing, within((-2.0, 4.76)));
    assert!(branch.points.len() > 2 && branch.points.iter().all(|p| map.value(&p.x).abs() < 1e-14));
}

/// A start beyond a bound by rounding is on it, for curves with affine and with curved pieces and for diagrams: no point lies outside.
#[test]
fn starts_beyond_a_bound_by_rounding_are_on_it() {
    let line: [fn(f64, f64) -> [f64; 3]; 2] = [|y, a| [y - 2.0 * a, 1.0, -2.0]; 2];
    for mut map in [
        Plane::smooth(line[0]),
        Plane::two(line[0], line[1], |y, _| [y - 0.5, 1.0, 0.0]),
    ] {
        for affine in [false, true] {
            map.affine = affine;
            let options = within((-1.0, 1.0));
            for (begin, bound) in [(1.0 + 5e-11, 1.0), (-1.0 - 5e-11, -1.0)] {
                let start = [2.0 * begin, begin];
                for direction in [Direction::Increasing, Direction::Decreasing] {
                    let outwards = (direction == Direction::Increasing) == (bound > 0.0);
                    let branch = Branch::follow(&map, &start, direction, options.clone()).unwrap();
                    assert_eq!(branch.termination, Termination::ParameterRange);
                    assert_eq!(branch.points[0].x, [2.0 * bound, bound]);
                    let end = branch.points.last().unwrap().x[1];
                    assert_eq!(end, if outwards { bound } else { -bound });
                }
                let explored = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
                let diagram = Diagram::explore(&map, &[start], &explored).unwrap();
                assert_eq!(diagram.vertices()[0].x, [2.0 * bound, bound]);
                assert!(diagram.vertices().iter().all(|v| v.x[1].abs() <= 1.0));
                assert!(Diagram::explore(&map, &[[2.2, 1.1]], &explored).is_err());
            }
        }
    }
}

/// y = min(θ, 0) with θ = (α − 0.4)(α − 0.6)(0.8 − α): one step from 0 to 1 ends in θ < 0, at bounds and targets before 0.8 in θ > 0, and
/// the two kinks in between are found.
#[test]
fn a_facet_is_crossed_twice_before_a_bound() {
    fn theta(_: f64, a: f64) -> [f64; 3] {
        let factors = [a - 0.4, a - 0.6, 0.8 - a];
        let [p, q, r] = factors;
        [p * q * r, 0.0, q * r + p * r - p * q]
    }
    fn below(y: f64, a: f64) -> [f64; 3] {
        let [value, _, rate] = theta(y, a);
        [y - value, 1.0, -rate]
    }
    let map = Plane::two(|y, _| [y, 1.0, 0.0], below, theta);
    for (bound, targets) in [(0.7, vec![]), (0.9, vec![0.7]), (0.7, vec![0.3, 0.65])] {
        let options = within((0.0, bound)).with_step(1.0).with_targets(targets);
        let branch = follow(&map, [0.0, 0.0], Direction::Increasing, options);
        let kinks: Vec<f64> = branch.transitions.iter().map(|t| t.parameter()).collect();
        let expected = [0.4, 0.6, 0.8];
        let expected = &expected[..if bound > 0.8 { 3 } else { 2 }];
        assert_eq!(kinks.len(), expected.len(), "{kinks:?}");
        assert!(
            kinks.iter().zip(expected).all(|(k, e)| (k - e).abs() < 1e-12),
            "{kinks:?}"
        );
    }
}

/// y = 0, declared as curved: steps along it end at multiples of h exactly, and so do targets.
#[test]
fn a_target_at_the_end_of_a_step_is_hit_once() {
    let map = Plane::smooth(|y, _| [y, 1.0, 0.0]);
    let o = within((-1.0, 5.0)).with_step(0.25).with_max_step(0.25);
    let targets = vec![0.25, 0.5, 1.75];
    let branch = follow(
        &map,
        [0.0, 0.0],
        Direction::Increasing,
        o.with_targets(targets.clone()),
    );
    let hit = branch.points.iter().filter(|p| p.kind == PointKind::Target);
    let hit: Vec<f64> = hit.map(|p| p.x[1]).collect();
    assert_eq!(hit[..3], targets);
    // The bound is the last.
    assert_eq!(hit[3..], [5.0]);
}

/// A row that changes its sign from one piece to the next is not continuous: det [∇H; tᵀ] detects this where the curve passes.
#[test]
fn a_row_of_the_other_sign_is_an_error() {
    let map = Plane::two(
        |y, a| [y - a, 1.0, -1.0],
        |y, a| [a - y, -1.0, 1.0],
        |y, _| [y, 1.0, 0.0],
    );
    let found = Branch::follow(&map, &[-1.0, -1.0], Direction::Increasing, within((-2.0, 2.0)));
    match found {
        Err(ContinuationError::Orientation { parameter, .. }) => assert!(parameter.abs() < 1e-12),
        other => panic!("{other:?}"),
    }
}

/// Transitions within rounding of a bound may lie on either side of it; the curve ends on the bound in both cases.
#[test]
fn curves_end_on_bounds_next_to_transitions() {
    let problem = squares::pushed_block(4, 0.4).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let follow =
        |upper| Branch::follow(&problem, &start, Direction::Increasing, within((0.0, upper))).unwrap();
    let transitions = follow(1.0).transitions;
    assert_eq!(transitions.len(), 6);
    for at in transitions.iter().map(|t| t.parameter()) {
        for ulps in -8..=8 {
            let upper = at + f64::from(ulps) * (at.next_up() - at);
            let branch = follow(upper);
            assert_eq!(branch.termination, Termination::ParameterRange);
            assert_eq!(branch.points.last().unwrap().parameter(), upper);
        }
    }
}

/// b = 3 y² along the folds of y³ − b y + a = 0: the bound 0 is touched at the cusp, and the curve goes on to the other fold.
#[test]
fn a_bound_that_is_touched_is_not_left() {
    struct Cusp;
    impl NonsmoothFunction for Cusp {
        fn num_vars(&self) -> usize {
            3
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
            out[0] = x[0] * x[0] * x[0] - x[2] * x[0] + x[1];
        }
    }
    for (largest, targets) in [
        (0.05, vec![]),
        (0.1, vec![]),
        (0.3, vec![]),
        (0.1, vec![0.75]),
        (0.1, vec![0.5, 1.25]),
    ] {
        let (folds, start) = FoldSet::new(Traced::new(Cusp), &[1.0, 2.0, 3.0]).unwrap();
        let options = ContinuationOptions::default()
            .with_parameter_range((0.0, 3.0))
            .with_targets(targets)
            .with_max_step(largest);
        let curve = Branch::follow(&folds, &start, Direction::Decreasing, options).unwrap();
        let end = folds.family_point(&curve.points.last().unwrap().x);
        assert!(
            (end[0] + 1.0).abs() < 1e-8 && (end[2] - 3.0).abs() < 1e-8,
            "{end:?}"
        );
    }
}
