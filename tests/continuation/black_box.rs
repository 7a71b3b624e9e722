//! Curves whose pieces are not known, against closed forms and the same curves with their pieces.

use std::ops::ControlFlow;

use semismooth::InputError;
use semismooth::continuation::{
    BlackBoxCurve, Branch, ContinuationError, ContinuationOptions, Direction, Termination,
};
use semismooth::piecewise::{Expression, Formula, MinMap, PiecewiseSmooth, Traced, value};

use crate::random::Random;

fn options(lower: f64, upper: f64) -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range((lower, upper))
}

fn traced<F>(m: usize, equations: F) -> Traced<Formula>
where
    F: for<'a> FnOnce(&[Expression<'a>]) -> Vec<Expression<'a>>,
{
    Traced::new(Formula::new(m, equations))
}

/// y − 1.25 max(y − 1, 0) + 10 max(y − 3, 0) = α.
fn beam() -> Traced<Formula> {
    traced(2, |x| {
        vec![x[0] - 1.25 * (x[0] - 1.0).max(0.0) + 10.0 * (x[0] - 3.0).max(0.0) - x[1]]
    })
}

fn assert_on(map: &impl PiecewiseSmooth, branch: &Branch) {
    let mut h = vec![0.0; map.num_residuals()];
    for vertex in branch.vertices() {
        value(map, vertex.x, &mut h);
        let largest = h.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        assert!(largest < 1e-9, "{largest:e} at {:?}", vertex.x);
    }
    let lengths: Vec<f64> = branch.vertices().iter().map(|v| v.arclength).collect();
    assert!(lengths.is_sorted());
    assert!(branch.is_black_box && branch.transitions.is_empty() && branch.branch_points.is_empty());
}

#[test]
fn folds_at_kinks_are_found_without_the_kinks() {
    let map = beam();
    let branch = BlackBoxCurve::new(&map, &[0.0, 0.0], Direction::Increasing, options(0.0, 2.0))
        .follow()
        .unwrap();
    assert_on(&map, &branch);
    let folds = branch.folds();
    assert_eq!(folds.len(), 2, "{folds:?}");
    assert!(
        (folds[0] - 1.0).abs() < 1e-11 && (folds[1] - 0.5).abs() < 1e-11,
        "{folds:?}"
    );
    assert_eq!(branch.termination, Termination::ParameterRange);
    let end = branch.points.last().unwrap();
    // On the last piece 9.75 y − 28.75 = α.
    assert!((end.x[0] - 30.75 / 9.75).abs() < 1e-11 && end.parameter() == 2.0);
    // The corners are points of the curve: no chord cuts them.
    for corner in [[1.0, 1.0], [3.0, 0.5]] {
        let met = |v: &[f64]| v.iter().zip(corner).all(|(a, b)| (a - b).abs() < 1e-11);
        assert!(branch.vertices().iter().any(|v| met(v.x)));
    }
}

#[test]
fn corners_of_any_angle_but_reversals_are_passed() {
    // α = s |y|: the curve turns by 2 atan(s), from 6° to 179°.
    for slope in [0.05, 0.3, 1.0, 3.0, 10.0, 100.0] {
        let map = traced(2, |x| vec![slope * x[0].abs() - x[1]]);
        let top = slope.max(1.0);
        let branch = BlackBoxCurve::new(&map, &[1.0, slope], Direction::Decreasing, options(-1.0, top))
            .follow()
            .unwrap();
        assert_on(&map, &branch);
        let end = branch.points.last().unwrap();
        assert!((end.x[0] + top / slope).abs() < 1e-9, "{slope}: {branch}");
        assert_eq!(branch.turns.len(), 1, "{slope}");
        assert!(branch.turns[0].parameter().abs() < 1e-9, "{slope}");
    }
}

#[test]
fn a_smooth_curve_closes() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    });
    let branch = BlackBoxCurve::new(
        &map,
        &[1.0, 0.0],
        Direction::Increasing,
        ContinuationOptions::default(),
    )
    .with_monitor("diagonal", |x| x[0] - x[1])
    .follow()
    .unwrap();
    assert_eq!(branch.termination, Termination::Closed);
    let turns: Vec<f64> = branch.folds();
    assert!((turns[0] - 1.0).abs() < 1e-12 && (turns[1] + 1.0).abs() < 1e-12 && turns.len() == 2);
    let met: Vec<f64> = branch.monitor_crossings.iter().map(|m| m.point.x[0]).collect();
    let root = 0.5_f64.sqrt();
    assert!((met[0] - root).abs() < 1e-11 && (met[1] + root).abs() < 1e-11 && met.len() == 2);
    assert!(
        (branch.arclength() - std::f64::consts::TAU).abs() < 1e-4,
        "{}",
        branch.arclength()
    );
}

#[test]
fn monitors_targets_and_stops() {
    let map = beam();
    let curve = |options| BlackBoxCurve::new(&map, &[0.0, 0.0], Direction::Increasing, options);
    let branch = curve(options(0.0, 2.0).with_targets(vec![0.75]))
        .with_monitor("two", |x| x[0] - 2.0)
        .with_monitor("corner", |x| x[0] - 1.0)
        // A jump is no zero.
        .with_monitor("jump", |x| if x[0] < 2.5 { -1.0 } else { 1.0 })
        .follow()
        .unwrap();
    let met: Vec<_> = branch
        .monitor_crossings
        .iter()
        .map(|m| (m.name.as_str(), m.point.x[0]))
        .collect();
    assert_eq!(met.len(), 2, "{met:?}");
    assert!(met[0].0 == "corner" && (met[0].1 - 1.0).abs() < 1e-9);
    assert!(met[1].0 == "two" && (met[1].1 - 2.0).abs() < 1e-11);
    // α = 0.75 on each of the three arms.
    let at: Vec<f64> = branch
        .points
        .iter()
        .filter(|p| p.parameter() == 0.75)
        .map(|p| p.x[0])
        .collect();
    assert_eq!(at.len(), 3, "{at:?}");
    for (found, exact) in at.iter().zip([0.75, 2.0, 29.5 / 9.75]) {
        assert!((found - exact).abs() < 1e-10);
    }
    let stopped = curve(options(0.0, 2.0))
        .with_stop("two", |x| x[0] - 2.0)
        .follow()
        .unwrap();
    assert_eq!(stopped.termination, Termination::Monitor);
    let mut seen = 0;
    let told = curve(options(0.0, 2.0))
        .follow_observed(|_| {
            seen += 1;
            if seen == 3 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .unwrap();
    assert_eq!(
        (told.termination, told.vertices().len()),
        (Termination::Interrupted, 3)
    );
    let over = curve(options(0.0, 2.0)).until(|| true).follow().unwrap();
    assert_eq!(over.termination, Termination::Interrupted);
}

#[test]
fn polygons_in_space_are_those_of_their_pieces() {
    // y + A |y| = c α + d.
    let (mut random, n) = (Random::new(45), 5);
    let (mut all, mut same, mut folded) = (0, 0, 0);
    while all < 40 {
        let (a, c, d) = (random.square(n), random.vector(n, 1.0), random.vector(n, 1.0));
        let map = traced(n + 1, |x| {
            let row = |i: usize| {
                let terms = (0..n).map(|j| 0.6 * a[i][j] * x[j].abs());
                terms.fold(x[i] - c[i] * x[n] - d[i], |sum, term| sum + term)
            };
            (0..n).map(row).collect()
        });
        let mut start = vec![0.0; n + 1];
        start[n] = -4.0;
        let range = options(-4.0, 4.0).with_max_step(0.1).with_max_arclength(60.0);
        let Ok(known) = Branch::follow(&map, &start, Direction::Increasing, range.clone()) else {
            continue;
        };
        all += 1;
        let start = known.points[0].x.clone();
        let found = BlackBoxCurve::new(&map, &start, Direction::Increasing, range)
            .follow()
            .unwrap();
        assert_on(&map, &found);
        let (a, b) = (known.folds(), found.folds());
        let ends = [&known, &found].map(|b| b.vertices().last().unwrap().x.to_vec());
        let equal = a.len() == b.len()
            && a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-8)
            && (known.termination != Termination::ParameterRange
                || ends[0].iter().zip(&ends[1]).all(|(a, b)| (a - b).abs() < 1e-8));
        same += usize::from(equal);
        folded += usize::from(!a.is_empty());
    }
    assert!(folded >= 8, "{folded}");
    assert_eq!(same, all);
}

#[test]
fn what_cannot_be_followed_is_said() {
    let map = beam();
    let refused = |x: &[f64], direction| {
        BlackBoxCurve::new(&map, x, direction, options(0.0, 2.0))
            .follow()
            .unwrap_err()
    };
    let short = refused(&[0.0], Direction::Increasing);
    assert!(
        matches!(short, ContinuationError::Input(InputError::Length { .. })),
        "{short}"
    );
    let zero = refused(&[0.0, 0.0], Direction::Along(vec![0.0, 0.0]));
    assert!(matches!(zero, ContinuationError::UndecidedArms { .. }), "{zero}");
    // The circle's tangent at (0, 1) has no part in α.
    let circle = traced(2, |x| vec![x[0] * x[0] + x[1] * x[1] - 1.0]);
    let start = BlackBoxCurve::new(&circle, &[0.0, 1.0], Direction::Increasing, options(-2.0, 2.0)).follow();
    assert!(matches!(start, Err(ContinuationError::UndecidedArms { .. })));
}
