//! Plain cases, each with its solutions by hand: inputs on which an earlier version was wrong.

use std::ops::ControlFlow;

use semismooth::continuation::{
    Branch, Continuation, Diagram, DiagramOptions, Direction, Termination, TransitionKind,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, PiecewiseSmooth, Real, Traced};

use crate::answer::{Certainty, explore, options, run};

/// A map of `vars` variables, the parameter last, with a number p in its formula.
macro_rules! curve {
    ($p:expr, $vars:expr, |$q:ident, $x:ident, $kinks:ident, $out:ident| $body:expr) => {{
        struct Formula(f64);
        impl NonsmoothFunction for Formula {
            fn num_vars(&self) -> usize {
                $vars
            }
            fn num_residuals(&self) -> usize {
                $vars - 1
            }
            #[allow(unused_variables)]
            fn eval<T: Real>(&self, $x: &[T], $kinks: &mut Kinks<'_, T>, $out: &mut [T]) {
                let $q = self.0;
                $body
            }
        }
        Traced::new(Formula($p))
    }};
}

/// Explores from `start`: all of the known solutions (first unknown) are there at each α and no others, the diagram is complete, and its
/// folds are at the known parameters.
fn whole(
    map: &dyn PiecewiseSmooth,
    start: &[f64],
    range: (f64, f64),
    known: &[(f64, &[f64])],
    turns: Option<&[f64]>,
) {
    let diagram = explore(map, start, options(1.0, range, 1.0)).expect("a diagram");
    let said = diagram.diagram.completeness().to_string();
    for (alpha, values) in known {
        let (found, _) = diagram.solutions(map, *alpha).expect("solutions");
        let mut found: Vec<f64> = found.iter().map(|x| x[0]).collect();
        found.sort_by(f64::total_cmp);
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        let gap = values.windows(2).map(|w| w[1] - w[0]).fold(4e-8, f64::min) / 4.0;
        let same =
            found.len() == values.len() && found.iter().zip(&values).all(|(p, q)| (p - q).abs() <= gap);
        assert!(
            same,
            "from {start:?} at {alpha}: {found:?} instead of {values:?}; {said}"
        );
    }
    assert!(
        diagram.certainty != Certainty::Undecided,
        "from {start:?}: {said}"
    );
    if let Some(turns) = turns {
        let mut found: Vec<f64> = diagram.folds.iter().map(|x| x[x.len() - 1]).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(
            found.len(),
            turns.len(),
            "folds from {start:?}: {found:?} instead of {turns:?}"
        );
        assert!(
            found.iter().zip(turns).all(|(p, q)| (p - q).abs() < 1e-9),
            "{found:?}, not {turns:?}"
        );
    }
}

/// |x| = 1e-5 α.
#[test]
fn a_narrow_v_is_a_fold() {
    let map = curve!(1e-5, 2, |p, x, k, out| out[0] = k.abs(x[0]) - x[1] * p);
    whole(
        &map,
        &[1e-5, 1.0],
        (-3.0, 3.0),
        &[(1.0, &[-1e-5, 1e-5]), (-1.0, &[])],
        Some(&[0.0]),
    );
}

/// x (x − 0.01 α)
#[test]
fn two_lines_at_half_a_degree_are_two() {
    let map = curve!(0.01, 2, |p, x, k, out| out[0] = x[0] * (x[0] - x[1] * p));
    let known: &[(f64, &[f64])] = &[(1.0, &[0.0, 0.01]), (-2.0, &[-0.02, 0.0])];
    whole(&map, &[0.0, -3.0], (-3.0, 3.0), known, None);
}

/// min(x − 2 α + 4, 4 α − x + 14): two lines from their corner at α = −9, where the range ends or before.
#[test]
fn branches_that_meet_at_the_end_of_the_range_are_both_found() {
    let map = curve!(0.0, 2, |p, x, k, out| out[0] =
        k.min(x[0] - x[1] * 2.0 + 4.0, x[1] * 4.0 - x[0] + 14.0));
    whole(&map, &[-2.0, 1.0], (-9.0, 5.0), &[(-2.0, &[-8.0, 6.0])], None);
    // The other branch is not connected within this range: it may be missing, and nothing else may be there.
    let diagram = explore(&map, &[-2.0, 1.0], options(1.0, (-5.0, 5.0), 1.0)).expect("a diagram");
    let (found, _) = diagram.solutions(&map, -2.0).expect("solutions");
    assert!(found.iter().any(|x| (x[0] + 8.0).abs() < 1e-9), "{found:?}");
    assert!(
        found
            .iter()
            .all(|x| (x[0] + 8.0).abs() < 1e-9 || (x[0] - 6.0).abs() < 1e-9),
        "{found:?}"
    );
}

/// y³ − c y = α has its folds at y = ±√(c/3).
#[test]
fn the_second_fold_is_found() {
    for c in [0.01_f64, 0.003, 0.001] {
        let map = curve!(c, 2, |p, x, k, out| out[0] = x[0] * x[0] * x[0] - x[0] * p - x[1]);
        let mut y = -3.0_f64.cbrt();
        for _ in 0..20 {
            y -= (y * y * y - c * y + 3.0) / (3.0 * y * y - c);
        }
        let start = [y, -3.0];
        let turn = 2.0 * (c / 3.0).powf(1.5);
        for share in [1.0, 0.05] {
            let found = run(&map, &start, true, options(1.0, (-3.0, 3.0), share))
                .expect("a branch")
                .folds;
            assert_eq!(found.len(), 2, "c = {c} at {share} of the default step");
        }
        let known: &[(f64, &[f64])] = &[(0.0, &[-c.sqrt(), 0.0, c.sqrt()])];
        whole(&map, &start, (-3.0, 3.0), known, Some(&[-turn, turn]));
    }
}

/// y⁴ − c y² = α has folds at 0 and at y = ±√(c/2): within one step, or two of them within the step that begins at the other.
#[test]
fn all_of_three_folds_are_found() {
    for k in 0..16 {
        let c = 0.001 * 1.3_f64.powi(k);
        let map = curve!(c, 2, |p, x, k, out| {
            let square = x[0] * x[0];
            out[0] = square * (square - p) - x[1];
        });
        let start = [0.9, 0.81 * (0.81 - c)];
        for share in [1.0, 0.05] {
            let found = run(&map, &start, false, options(1.0, (-1.0, 1.0), share))
                .expect("a branch")
                .folds;
            let mut places: Vec<f64> = found.iter().map(|x| x[0]).collect();
            places.sort_by(f64::total_cmp);
            let exact = [-(0.5 * c).sqrt(), 0.0, (0.5 * c).sqrt()];
            let same = places.len() == 3 && places.iter().zip(exact).all(|(p, q)| (p - q).abs() < 1e-9);
            assert!(same, "c = {c} at {share} of the default step: {places:?}");
        }
    }
}

/// Zeros of functions on a curve, by number of the function and α.
fn crossings(map: &dyn PiecewiseSmooth, start: &[f64], functions: &[fn(&[f64]) -> f64]) -> Vec<(usize, f64)> {
    let limits = options(1.0, (0.0, 3.0), 1.0);
    let mut curve = Continuation::new(map, start, Direction::Increasing, limits).expect("a curve");
    for function in functions {
        curve = curve.with_monitor("function", function);
    }
    let branch = Branch::collect(curve, |_| ControlFlow::Continue(())).expect("a branch");
    assert_eq!(branch.termination, Termination::ParameterRange, "{branch}");
    let met = branch.monitor_crossings.iter();
    met.map(|c| (c.monitor, c.point.parameter())).collect()
}

#[test]
fn a_zero_of_a_monitor_is_reported_once_and_passed() {
    let line = curve!(0.0, 2, |p, x, k, out| out[0] = x[0] - x[1]);
    let quarter = std::f64::consts::FRAC_PI_2;
    let met = crossings(&line, &[0.0, 0.0], &[|x| x[1].cos(), |x| x[1].cos()]);
    assert_eq!(met.len(), 2, "{met:?}");
    assert!(
        met[0].0 != met[1].0 && met.iter().all(|m| (m.1 - quarter).abs() < 1e-9),
        "{met:?}"
    );
    let kink = curve!(0.0, 2, |p, x, k, out| out[0] = x[0] - k.abs(x[1].cos()));
    let met = crossings(&kink, &[1.0, 0.0], &[|x| x[1].cos()]);
    assert!(met.len() == 1 && (met[0].1 - quarter).abs() < 1e-9, "{met:?}");
    let met = crossings(&line, &[0.0, 0.0], &[|x| 1.0 / (x[1] - 1.7)]);
    assert!(met.is_empty(), "a pole is no zero: {met:?}");
}

/// (x − 0.1)(|x − 0.1| + 2 α)
#[test]
fn a_pitchfork_at_a_kink_away_from_the_origin() {
    let map = curve!(0.1, 2, |p, x, k, out| {
        let y = x[0] - p;
        out[0] = y * (k.abs(y) + x[1] * 2.0);
    });
    let known: &[(f64, &[f64])] = &[(-0.5, &[-0.9, 0.1, 1.1]), (0.5, &[0.1])];
    for start in [[2.1, -1.0], [-1.9, -1.0], [0.1, -1.0], [0.1, 0.9]] {
        whole(&map, &start, (-2.0, 1.0), known, None);
    }
}

/// x (|x| + α) from its side branch; |x| (|x| + α) in long steps.
#[test]
fn side_branches_arrive_at_a_branching_kink() {
    let map = curve!(0.0, 2, |p, x, k, out| out[0] = x[0] * (k.abs(x[0]) + x[1]));
    let limits = options(1.0, (-1.5, 1.0), 1.0);
    let branch = Branch::follow(&map, &[0.9, -0.9], Direction::Increasing, limits).expect("a branch");
    let vertex = &branch.transitions[0];
    assert_eq!(vertex.kind, TransitionKind::Branching, "{vertex}");
    let half = 0.5_f64.sqrt();
    for arm in [[0.0, 1.0], [0.0, -1.0], [-half, -half]] {
        let near = |t: &[f64]| (t[0] - arm[0]).hypot(t[1] - arm[1]) < 1e-9;
        assert_eq!(
            vertex.arms.iter().filter(|a| near(&a.tangent)).count(),
            1,
            "{arm:?} of {:?}",
            vertex.arms
        );
    }
    assert_eq!(vertex.arms.len(), 3);
    let known: &[(f64, &[f64])] = &[(-0.5, &[-0.5, 0.0, 0.5]), (0.5, &[0.0])];
    whole(&map, &[0.9, -0.9], (-1.5, 1.0), known, None);
    let map = curve!(0.0, 2, |p, x, k, out| {
        let size = k.abs(x[0]);
        out[0] = size * (size + x[1]);
    });
    let limits = options(1.0, (-1.5, 1.0), 1.0).with_step(0.5);
    Branch::follow(&map, &[1.0, -1.0], Direction::Increasing, limits).expect("the map is continuous");
    whole(&map, &[1.0, -1.0], (-1.5, 1.0), known, None);
}

/// y ((y² + s a) with y and a moved: from the side branch.
#[test]
fn a_smooth_pitchfork_from_its_side_branch() {
    const AT: f64 = -0.055_065_951_044_939_165;
    const ALPHA: f64 = 0.644_932_315_164_943_8;
    let s = 0.767_614_436_162_515_f64;
    let map = curve!(s, 2, |p, x, k, out| {
        let (y, a) = (x[0] - AT, x[1] - ALPHA);
        out[0] = y * (y * y + a * p);
    });
    let height = (0.5 * s).sqrt();
    let known: &[(f64, &[f64])] = &[
        (ALPHA - 0.5, &[AT - height, AT, AT + height]),
        (ALPHA + 0.5, &[AT]),
    ];
    whole(
        &map,
        &[AT + s.sqrt(), ALPHA - 1.0],
        (ALPHA - 2.0, ALPHA + 1.0),
        known,
        None,
    );
}

/// min(y, 0)² + max(y, 0) = α: a half parabola meets a line in a fold, and there is no vertical segment.
#[test]
fn a_half_parabola_meets_a_line() {
    let map = curve!(0.0, 2, |p, x, k, out| {
        let below = k.min(x[0], T::from(0.0));
        out[0] = below * below + k.positive_part(x[0]) - x[1];
    });
    for start in [[-1.0, 1.0], [1.0, 1.0]] {
        let limits = options(1.0, (-1.0, 2.0), 1.0);
        let branch = Branch::follow(&map, &start, Direction::Decreasing, limits).expect("a branch");
        assert_eq!(branch.folds().len(), 1, "{branch}");
        assert!(
            branch.transitions.iter().all(|t| {
                t.kind != TransitionKind::VerticalBegin && t.kind != TransitionKind::VerticalEnd
            })
        );
        let end = branch.points.last().expect("points");
        let other = if start[0] < 0.0 { 2.0 } else { -2.0_f64.sqrt() };
        assert!((end.x[0] - other).abs() < 1e-9 && end.x[1] == 2.0, "{end}");
        whole(
            &map,
            &start,
            (-1.0, 2.0),
            &[(1.0, &[-1.0, 1.0]), (-0.5, &[])],
            Some(&[0.0]),
        );
        whole(&map, &start, (0.0, 2.0), &[(1.0, &[-1.0, 1.0])], None);
    }
}

/// |y| = α, y² = α, y² + max(y, 0)² = α.
#[test]
fn folds_on_the_bound_of_the_range() {
    let map = curve!(0.0, 2, |p, x, k, out| out[0] = k.abs(x[0]) - x[1]);
    whole(&map, &[1.0, 1.0], (0.0, 2.0), &[(1.0, &[-1.0, 1.0])], None);
    let map = curve!(0.0, 2, |p, x, k, out| out[0] = x[0] * x[0] - x[1]);
    whole(&map, &[1.0, 1.0], (0.0, 2.0), &[(1.0, &[-1.0, 1.0])], None);
    let map = curve!(0.0, 2, |p, x, k, out| {
        let above = k.positive_part(x[0]);
        out[0] = x[0] * x[0] + above * above - x[1];
    });
    let known: &[(f64, &[f64])] = &[(1.0, &[-1.0, 0.5_f64.sqrt()])];
    whole(&map, &[-1.0, 1.0], (0.0, 2.0), known, None);
    whole(&map, &[-1.0, 1.0], (-1.0, 2.0), known, Some(&[0.0]));
}

/// |x| + |y| = α, x = 2 y
#[test]
fn a_corner_of_two_sites_is_a_fold() {
    let map = curve!(0.0, 3, |p, x, k, out| {
        out[0] = k.abs(x[0]) + k.abs(x[1]) - x[2];
        out[1] = x[0] - x[1] * 2.0;
    });
    let known: &[(f64, &[f64])] = &[(1.0, &[-2.0 / 3.0, 2.0 / 3.0]), (-0.5, &[])];
    whole(
        &map,
        &[2.0 / 3.0, 1.0 / 3.0, 1.0],
        (-1.0, 2.0),
        known,
        Some(&[0.0]),
    );
}

/// |y| y − α y and y (α − |y|)
#[test]
fn pitchforks_at_kinks_from_the_main_branch() {
    let known: &[(f64, &[f64])] = &[(0.5, &[-0.5, 0.0, 0.5]), (-0.5, &[0.0])];
    let map = curve!(0.0, 2, |p, x, k, out| out[0] = k.abs(x[0]) * x[0] - x[1] * x[0]);
    whole(&map, &[0.0, -0.5], (-1.0, 1.0), known, None);
    let map = curve!(0.0, 2, |p, x, k, out| out[0] = x[0] * (x[1] - k.abs(x[0])));
    whole(&map, &[0.0, -0.5], (-1.0, 1.0), known, None);
}

/// |y| + |α| = 1 and max(|y|, |α|) = 1.
#[test]
fn closed_polygons() {
    let map = curve!(0.0, 2, |p, x, k, out| out[0] = k.abs(x[0]) + k.abs(x[1]) - 1.0);
    whole(
        &map,
        &[1.0, 0.0],
        (-2.0, 2.0),
        &[(0.5, &[-0.5, 0.5])],
        Some(&[-1.0, 1.0]),
    );
    let map = curve!(0.0, 2, |p, x, k, out| {
        let (y, a) = (k.abs(x[0]), k.abs(x[1]));
        out[0] = k.max(y, a) - 1.0;
    });
    whole(
        &map,
        &[1.0, 0.0],
        (-2.0, 2.0),
        &[(0.5, &[-1.0, 1.0]), (1.5, &[])],
        None,
    );
    let diagram = explore(&map, &[1.0, 0.0], options(1.0, (-2.0, 2.0), 1.0)).expect("a diagram");
    for side in [-1.0, 1.0] {
        let (_, continua) = diagram.solutions(&map, side).expect("solutions");
        assert!(continua > 0, "the side at {side} is a continuum of solutions");
    }
}

/// y (1 − y) = α min(y, 0.3): a smooth fold at α = 5/6, a fold at the kink at 0.7, a crossing at 1.
#[test]
fn harvest_with_a_limit() {
    let map = curve!(0.3, 2, |p, x, k, out| {
        out[0] = x[0] * (-x[0] + 1.0) - x[1] * k.min(x[0], T::from(p));
    });
    let upper = (1.0 + 0.4_f64.sqrt()) / 2.0;
    let known: &[(f64, &[f64])] = &[
        (0.8, &[0.0, 0.2, 0.4, 0.6]),
        (0.5, &[0.0, upper]),
        (1.5, &[-0.5, 0.0]),
    ];
    whole(&map, &[1.0, 0.0], (0.0, 2.0), known, Some(&[0.7, 5.0 / 6.0]));
}

/// min(|y|, |y − 1|) = α
#[test]
fn a_saw_has_three_folds() {
    let map = curve!(0.0, 2, |p, x, k, out| {
        let (first, second) = (k.abs(x[0]), k.abs(x[0] - 1.0));
        out[0] = k.min(first, second) - x[1];
    });
    let known: &[(f64, &[f64])] = &[
        (0.25, &[-0.25, 0.25, 0.75, 1.25]),
        (1.0, &[-1.0, 2.0]),
        (-0.5, &[]),
    ];
    whole(&map, &[2.0, 1.0], (-1.0, 2.0), known, Some(&[0.0, 0.0, 0.5]));
}

/// 0 ≤ y ⟂ y² − 2 y + α ≥ 0
#[test]
fn a_fold_at_a_bound_of_the_unknown() {
    let map = curve!(0.0, 2, |p, x, k, out| {
        out[0] = k.min(x[0], x[0] * x[0] - x[0] * 2.0 + x[1]);
    });
    let (half, far) = (0.5_f64.sqrt(), 1.5_f64.sqrt());
    let known: &[(f64, &[f64])] = &[
        (0.5, &[0.0, 1.0 - half, 1.0 + half]),
        (-0.5, &[1.0 + far]),
        (1.5, &[0.0]),
    ];
    whole(&map, &[0.0, 1.0], (-1.0, 2.0), known, Some(&[0.0, 1.0]));
}

/// |x| + y² = α, max(x, y) = α / 2, the vertex on the bound of the range or inside.
#[test]
fn a_corner_on_the_bound_of_the_range() {
    let map = curve!(0.5, 3, |p, x, k, out| {
        out[0] = k.abs(x[0]) + x[1] * x[1] - x[2];
        out[1] = k.max(x[0], x[1]) - x[2] * p;
    });
    for low in [0.0, -1.0, -0.5] {
        for start in [[0.5, -0.5_f64.sqrt(), 1.0], [-0.75, 0.5, 1.0]] {
            let turns: Option<&[f64]> = if low < 0.0 { Some(&[0.0]) } else { None };
            whole(
                &map,
                &start,
                (low, 3.0),
                &[(1.0, &[-0.75, 0.5]), (1.9, &[-0.9975, 0.95])],
                turns,
            );
        }
    }
}

/// A circle of radius 1e-7 has two folds, if it is resolved at all; a helix of pitch 6e-9 is not closed.
#[test]
fn small_curves_are_what_they_are() {
    let map = curve!(1e-14, 2, |p, x, k, out| out[0] = x[0] * x[0] + x[1] * x[1] - p);
    let diagram = explore(&map, &[1e-7, 0.0], options(1.0, (-1.0, 1.0), 1.0)).expect("a diagram");
    let two = diagram.folds.len() == 2;
    assert!(
        two || diagram.certainty == Certainty::Undecided,
        "{} folds",
        diagram.folds.len()
    );
    let map = curve!(6e-9, 3, |p, x, k, out| {
        out[0] = x[0] - (x[2] / p).cos();
        out[1] = x[1] - (x[2] / p).sin();
    });
    let limits = options(1.0, (-1.0, 1.0), 1.0).with_max_arclength(30.0);
    let branch = Branch::follow(
        &map,
        &[1.0, 0.0, 0.0],
        Direction::Along(vec![0.0, 1.0, 6e-9]),
        limits,
    );
    assert!(branch.expect("a branch").termination != Termination::Closed);
}

/// |y| = c: two curves 2 c apart; |y| = 1e-5 α: two solutions next to the fold.
#[test]
fn solutions_nearer_than_a_ten_millionth_are_told_apart() {
    let map = curve!(1e-8, 2, |p, x, k, out| out[0] = k.abs(x[0]) - p);
    let limits = options(1.0, (0.0, 1.0), 1.0);
    let both = DiagramOptions::default().with_continuation(limits);
    let starts = [[1e-8, 0.5], [-1e-8, 0.5], [1e-8, 0.25]];
    let diagram = Diagram::explore(&map, &starts, &both).expect("a diagram");
    for alpha in [0.0, 0.3, 0.5, 1.0] {
        let found = diagram.solutions_at(&map, alpha).expect("solutions");
        let mut y: Vec<f64> = found.points.iter().map(|p| p.x[0]).collect();
        y.sort_by(f64::total_cmp);
        assert_eq!(y, [-1e-8, 1e-8], "at {alpha}");
    }
    let map = curve!(1e-5, 2, |p, x, k, out| out[0] = k.abs(x[0]) - x[1] * p);
    let known: &[(f64, &[f64])] = &[(1e-3, &[-1e-8, 1e-8]), (1e-6, &[-1e-11, 1e-11])];
    let diagram = explore(&map, &[1e-5, 1.0], options(1.0, (-3.0, 3.0), 1.0)).expect("a diagram");
    for (alpha, values) in known {
        let (found, _) = diagram.solutions(&map, *alpha).expect("solutions");
        assert_eq!(found.len(), values.len(), "at {alpha}: {found:?}");
    }
}
