//! Step lengths in cases where they are known, and what a step must not pass over.

use super::curves::{follow, within};
use super::maps::Plane;
use semismooth::continuation::{
    Branch, ContinuationOptions, Diagram, DiagramOptions, Direction, PointKind, Termination, arms_at,
};
use semismooth::piecewise::MinMap;

fn lengths(branch: &Branch) -> Vec<f64> {
    branch
        .points
        .windows(2)
        .map(|p| p[1].arclength - p[0].arclength)
        .collect()
}

/// y = 0, declared as curved: each step grows by the given factor, up to the longest step.
#[test]
fn steps_grow_along_a_line() {
    let map = Plane::smooth(|y, _| [y, 1.0, 0.0]);
    for (step, growth, longest) in [(0.25, 1.5, 1.0), (0.125, 2.0, 0.5), (0.5, 1.0, 4.0)] {
        let o = within((0.0, 8.0))
            .with_step(step)
            .with_growth(growth)
            .with_max_step(longest);
        let branch = follow(&map, [0.0, 0.0], Direction::Increasing, o);
        assert_eq!(branch.termination, Termination::ParameterRange);
        assert_eq!(branch.points[0].kind, PointKind::Start);
        let made = lengths(&branch);
        let (last, regular) = made.split_last().unwrap();
        let mut expected: f64 = step;
        for h in regular {
            assert!((h - expected).abs() < 1e-14, "{h} {expected}");
            expected = (expected * growth).min(longest);
        }
        assert!(*last > 0.0 && *last <= expected + 1e-14);
        assert!((branch.arclength() - 8.0).abs() < 1e-13, "{}", branch.arclength());
        for p in &branch.points {
            assert_eq!((p.tangent.as_slice(), p.det_sign), (&[0.0, 1.0][..], Some(1)));
            assert!((p.arclength - p.x[1]).abs() < 1e-14 && p.residual_norm == 0.0);
        }
    }
}

/// y² + α² = R²: between two points the tangent turns by the angle between them, at most by the allowed angle, and not by much less.
#[test]
fn tangents_turn_no_more_than_allowed() {
    for radius in [1.0, 0.25] {
        let map = match radius {
            1.0 => Plane::smooth(|y, a| [y * y + a * a - 1.0, 2.0 * y, 2.0 * a]),
            _ => Plane::smooth(|y, a| [y * y + a * a - 0.0625, 2.0 * y, 2.0 * a]),
        };
        for degrees in [2.0_f64, 5.0, 10.0] {
            let limit = degrees.to_radians();
            let o = ContinuationOptions::default()
                .with_min_cos(limit.cos())
                .with_max_step(10.0);
            let branch = follow(&map, [0.6 * radius, 0.8 * radius], Direction::Increasing, o);
            assert_eq!(
                (branch.termination, branch.smooth_folds.len()),
                (Termination::Closed, 2)
            );
            let mut turned = 0.0;
            let mut widest = 0.0_f64;
            let folds = branch.smooth_folds.iter();
            let mut points: Vec<_> = branch.points.iter().chain(folds).collect();
            points.sort_by(|p, q| p.arclength.total_cmp(&q.arclength));
            for p in points.windows(2) {
                let angle = (p[0].tangent[0] * p[1].tangent[1] - p[0].tangent[1] * p[1].tangent[0])
                    .atan2(p[0].tangent[0] * p[1].tangent[0] + p[0].tangent[1] * p[1].tangent[1])
                    .abs();
                assert!(angle <= limit * (1.0 + 1e-9), "{angle} {limit}");
                let chord = (p[0].x[0] - p[1].x[0]).hypot(p[0].x[1] - p[1].x[1]);
                assert!((chord - 2.0 * radius * (0.5 * angle).sin()).abs() < 1e-9 * radius);
                assert!((p[1].arclength - p[0].arclength - chord).abs() < 1e-12);
                turned += angle;
                widest = widest.max(angle);
            }
            assert!((turned - std::f64::consts::TAU).abs() < 1e-6, "{turned}");
            assert!(widest > 0.5 * limit, "{widest} {limit}");
            for p in &branch.points {
                let (y, alpha) = (p.x[0], p.x[1]);
                assert!((y.hypot(alpha) - radius).abs() < 1e-12 * radius);
                assert!((p.tangent[0] * y + p.tangent[1] * alpha).abs() < 1e-9);
                assert!(y.abs() < 1e-6 || p.det_sign == Some(if y > 0.0 { 1 } else { -1 }));
            }
        }
    }
}

/// A curve that leaves the range at its start, on a bound, consists of this point.
#[test]
fn a_start_on_the_bound_that_is_left_ends_there() {
    let curved = Plane::smooth(|y, a| [y - a * a, 1.0, -2.0 * a]);
    let o = within((-1.0, 2.0)).with_step(0.5);
    for (alpha, direction) in [(2.0, Direction::Increasing), (-1.0, Direction::Decreasing)] {
        let branch = follow(&curved, [alpha * alpha, alpha], direction, o.clone());
        assert_eq!(branch.termination, Termination::ParameterRange);
        assert_eq!(branch.arclength(), 0.0);
        assert!(branch.points.iter().all(|p| p.x == [alpha * alpha, alpha]));
    }
}

/// A circle and the line y = 0 through it: there are closed branches, but none is disconnected from the rest.
#[test]
fn a_circle_that_is_crossed_is_no_isola() {
    let map = Plane::smooth(|y, a| {
        let c = y * y + a * a - 1.0;
        [c * y, 2.0 * y * y + c, 2.0 * a * y]
    });
    let options = DiagramOptions::default().with_parameter_range((-2.0, 2.0));
    let diagram = Diagram::explore(&map, &[[0.8, 0.6], [0.0, -1.5]], &options).unwrap();
    assert!(!diagram.completeness().is_limited(), "{diagram}");
    assert_eq!(diagram.components().len(), 1);
    assert!(diagram.branches().iter().any(|b| b.closed));
    assert!(diagram.isolas().is_empty(), "{diagram}");
    assert_eq!(diagram.solutions_at(&map, 0.5).unwrap().count(), Some(3));
}

/// α = |y| with a limit of one selection: the other arm is found by the local search, and the list is not called complete.
#[test]
fn what_the_limit_on_selections_leaves_out_is_searched_for() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    let options = ContinuationOptions::default();
    for (limit, complete) in [(1, false), (2, true), (4096, true)] {
        let list = arms_at(&map, &[0.0, 0.0], &options.clone().with_max_selections(limit)).unwrap();
        let (arms, found) = (list.arms, !list.certainty.is_undecided());
        assert_eq!((arms.len(), found), (2, complete), "{limit}");
        for arm in &arms {
            assert!((arm.tangent[1] - arm.tangent[0].abs()).abs() < 1e-15);
        }
    }
}
