//! Transitions of every kind.

use super::curves::{StringOnPoints, follow, lens, near, parabola_and_line, two_arcs, within};
use super::maps::Plane;
use semismooth::contact::{ContactState, FrictionCoefficient, FullContact, LoadPath};
use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Direction, Event, Termination, TransitionKind, arms_at,
};
use semismooth::piecewise::{Facet, MinMap};
use semismooth::sparse::Matrix;

const STEPS: [f64; 5] = [1e-3, 1e-2, 0.05, 0.5, 5.0];

fn limited(range: (f64, f64), h: f64) -> ContinuationOptions {
    within(range)
        .with_max_step(h)
        .with_step(h.min(0.05))
        .with_max_points(100_000)
}

#[test]
fn curved_pieces_for_all_step_bounds() {
    let map = parabola_and_line();
    let root = |sign: f64| (1.0 + sign * 17f64.sqrt()) / 4.0;
    for h in STEPS {
        let branch = follow(&map, [2.5, 5.25], Direction::Decreasing, limited((-2.0, 6.0), h));
        let kinds: Vec<_> = branch.transitions.iter().map(|t| t.kind).collect();
        assert_eq!(
            kinds,
            [TransitionKind::PassThrough, TransitionKind::Fold],
            "h_max {h}"
        );
        for (t, sign) in branch.transitions.iter().zip([1.0, -1.0]) {
            let y = root(sign);
            assert!(near(&t.x, [y, 0.5 * y], 1e-12), "{:?}", t.x);
            assert!(t.test_functions[0].abs() < 1e-12 && t.complete);
        }
        let end = &branch.points.last().unwrap().x;
        assert!(near(end, [-(7f64.sqrt()), 6.0], 1e-9));
    }
}

#[test]
fn isolas_close_from_any_start() {
    let corner = 0.91f64.sqrt();
    let cases = [
        (
            lens(),
            [[0.0, 1.0], [0.0, -1.0]],
            vec![
                [1.0, 0.0],
                [-1.0, 0.0],
                [0.75, 0.5],
                [-0.19, -0.9],
                [0.0, 1.0],
                [0.0, -1.0],
            ],
        ),
        (
            two_arcs(),
            [[0.3, corner], [0.3, -corner]],
            vec![[1.0, 0.0], [0.6, 0.8], [0.6, -0.8], [0.3, corner]],
        ),
    ];
    for (map, kinks, starts) in cases {
        for start in starts {
            let list = arms_at(&map, &start, &ContinuationOptions::default()).unwrap();
            let (arms, complete) = (list.arms, !list.certainty.is_undecided());
            assert!(complete && arms.len() == 2);
            for (arm, h) in arms.iter().flat_map(|a| STEPS.map(|h| (a, h))) {
                let o = limited((-5.0, 5.0), h);
                let branch = Branch::follow_arm(&map, &start, arm, o).unwrap();
                assert_eq!(branch.termination, Termination::Closed, "{start:?} h_max {h}");
                let last = branch.polyline().last().unwrap().1.to_vec();
                assert!(near(&last, start, 1e-8), "{last:?}");
                for kink in kinks.iter().filter(|k| **k != start) {
                    let met: Vec<_> = branch
                        .transitions
                        .iter()
                        .filter(|t| near(&t.x, *kink, 1e-12))
                        .collect();
                    assert_eq!(met.len(), 1, "{start:?} h_max {h}");
                    assert_eq!(met[0].kind, TransitionKind::Fold);
                }
            }
        }
    }
}

#[test]
fn a_vertical_segment_begins_and_ends() {
    // α = y − mid(−1, y, 1).
    let map = Plane {
        affine: false,
        pieces: vec![|y, a| [y + 1.0 - a, 1.0, -1.0], |_, a| [-a, 0.0, -1.0], |y, a| {
            [y - 1.0 - a, 1.0, -1.0]
        }],
        tests: vec![|y, _| [y + 1.0, 1.0, 0.0], |y, _| [y - 1.0, 1.0, 0.0]],
        cells: vec![
            vec![Facet::negative(0)],
            vec![Facet::positive(0), Facet::negative(1)],
            vec![Facet::positive(1)],
        ],
    };
    for h in STEPS {
        let branch = follow(&map, [2.0, 1.0], Direction::Decreasing, limited((-1.0, 1.0), h));
        let kinds: Vec<_> = branch.transitions.iter().map(|t| t.kind).collect();
        assert_eq!(
            kinds,
            [TransitionKind::VerticalBegin, TransitionKind::VerticalEnd]
        );
        assert!(near(&branch.transitions[0].x, [1.0, 0.0], 1e-12));
        assert!(near(&branch.transitions[1].x, [-1.0, 0.0], 1e-12));
        let inside = branch.points.iter().filter(|p| p.x[0].abs() < 0.999);
        assert!(
            inside
                .clone()
                .all(|p| p.det_sign == Some(0) && p.x[1].abs() < 1e-12)
        );
    }
}

#[test]
fn a_wall_ends_the_branch() {
    let mut map = Plane::smooth(|y, a| [y * y - a, 2.0 * y, -1.0]);
    map.tests = vec![|y, _| [y - 0.5, 1.0, 0.0]];
    map.cells = vec![vec![Facet::positive(0).wall()]];
    for h in STEPS {
        let branch = follow(&map, [1.5, 2.25], Direction::Decreasing, limited((-1.0, 3.0), h));
        assert_eq!(branch.termination, Termination::End);
        assert_eq!(branch.transitions.len(), 1);
        let t = &branch.transitions[0];
        assert_eq!((t.kind, t.followed, t.arms.len()), (TransitionKind::End, None, 0));
        assert!(near(&t.x, [0.5, 0.25], 1e-12));
    }
}

#[test]
fn independent_sites_switch_at_once() {
    // y_i = k_i max(α − 1, 0).
    let map = MinMap::curve(3, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for (i, k) in [1.0, 2.0, -0.5].into_iter().enumerate() {
            let load = k * (x[3] - 1.0);
            (a[i], b[i]) = if k > 0.0 {
                (x[i], x[i] - load)
            } else {
                (-x[i], load - x[i])
            };
        }
    });
    let branch = Branch::follow(&map, &[0.0; 4], Direction::Increasing, within((0.0, 3.0))).unwrap();
    assert_eq!(branch.transitions.len(), 1);
    let t = &branch.transitions[0];
    assert!((t.parameter() - 1.0).abs() < 1e-12);
    assert_eq!(
        (t.kind, t.sites.len(), t.complete),
        (TransitionKind::PassThrough, 3, true)
    );
    assert!(t.sites.iter().all(|s| s.from != s.to));
    let end = &branch.points.last().unwrap().x;
    for (v, e) in end.iter().zip([2.0, 4.0, -1.0, 3.0]) {
        assert!((v - e).abs() < 1e-9, "{end:?}");
    }
}

/// f = α (f_ν, f_t) and constant F: at α = 0 all test functions vanish, θ¹ = θ² = θ³ = 0.
#[test]
fn the_apex_of_the_law() {
    for (f_t, contact) in [
        (1.0, ContactState::Stick),
        (-1.0, ContactState::Stick),
        (3.0, ContactState::SlipPlus),
        (-3.0, ContactState::SlipMinus),
    ] {
        let problem = FullContact::planar(
            Matrix::from_rows(&[[4.0, -1.0], [-1.0, 4.0]]).unwrap(),
            Matrix::from_rows(&[[1.0, 0.0]]).unwrap(),
            Matrix::from_rows(&[[0.0, 1.0]]).unwrap(),
            LoadPath::affine(vec![0.0, 0.0], vec![2.0, f_t]),
            FrictionCoefficient::nodal(vec![1.0]).unwrap(),
        )
        .unwrap();
        let start = problem.solve(1.0, None).unwrap();
        let branch = Branch::follow(&problem, &start, Direction::Decreasing, within((-1.0, 1.0))).unwrap();
        assert_eq!(branch.transitions.len(), 1, "f_t = {f_t}");
        let t = &branch.transitions[0];
        assert_eq!((t.kind, t.complete), (TransitionKind::PassThrough, true));
        assert!(t.x.iter().all(|v| v.abs() < 1e-12));
        assert_eq!(problem.states(&t.before), [contact]);
        assert_eq!(problem.states(&t.after), [ContactState::Open]);
        assert_eq!(branch.termination, Termination::ParameterRange);
    }
}

/// |y| = (α)₊: the arm y = 0, α < 0 runs inside the boundary of both cells of |y|.
#[test]
fn branching_with_a_grazing_arm() {
    let map = Plane {
        affine: false,
        pieces: vec![
            |y, a| [y - a, 1.0, -1.0],
            |y, a| [-y - a, -1.0, -1.0],
            |y, _| [y, 1.0, 0.0],
            |y, _| [-y, -1.0, 0.0],
        ],
        tests: vec![|y, _| [y, 1.0, 0.0], |_, a| [a, 0.0, 1.0]],
        cells: vec![
            vec![Facet::positive(0), Facet::positive(1)],
            vec![Facet::negative(0), Facet::positive(1)],
            vec![Facet::positive(0), Facet::negative(1)],
            vec![Facet::negative(0), Facet::negative(1)],
        ],
    };
    let branch = follow(&map, [0.7, 0.7], Direction::Decreasing, within((-1.0, 1.0)));
    assert_eq!(branch.termination, Termination::Branching);
    let t = &branch.transitions[0];
    assert_eq!(
        (t.kind, t.arms.len(), t.followed),
        (TransitionKind::Branching, 2, None)
    );
    assert!(near(&t.x, [0.0, 0.0], 1e-12));
    let mut ends = Vec::new();
    for arm in &t.arms {
        let branch = Branch::follow_arm(&map, &t.x, arm, within((-1.0, 1.0))).unwrap();
        assert_eq!(branch.termination, Termination::ParameterRange);
        let end = branch.points.last().unwrap();
        assert_eq!(end.grazing.is_empty(), end.x[1] > 0.0);
        ends.push(end.x.clone());
    }
    assert!(ends.iter().any(|x| near(x, [-1.0, 1.0], 1e-12)));
    assert!(ends.iter().any(|x| near(x, [0.0, -1.0], 1e-12)));
    // From the grazing side both arms are found, and none is straight.
    let branch = follow(&map, [0.0, -0.7], Direction::Increasing, within((-1.0, 1.0)));
    assert_eq!(branch.termination, Termination::Branching);
    assert_eq!(branch.transitions.last().unwrap().arms.len(), 2);
}

/// |y| = |α|: four rays, of which one goes straight on.
#[test]
fn a_crossing_is_passed_straight_on() {
    let map = Plane {
        affine: false,
        pieces: vec![
            |y, a| [y - a, 1.0, -1.0],
            |y, a| [-y - a, -1.0, -1.0],
            |y, a| [y + a, 1.0, 1.0],
            |y, a| [-y + a, -1.0, 1.0],
        ],
        tests: vec![|y, _| [y, 1.0, 0.0], |_, a| [a, 0.0, 1.0]],
        cells: vec![
            vec![Facet::positive(0), Facet::positive(1)],
            vec![Facet::negative(0), Facet::positive(1)],
            vec![Facet::positive(0), Facet::negative(1)],
            vec![Facet::negative(0), Facet::negative(1)],
        ],
    };
    let branch = follow(&map, [0.7, 0.7], Direction::Decreasing, within((-1.0, 1.0)));
    assert_eq!(branch.transitions.len(), 1);
    let t = &branch.transitions[0];
    assert_eq!((t.kind, t.arms.len()), (TransitionKind::Branching, 3));
    assert!(near(&branch.points.last().unwrap().x, [-1.0, -1.0], 1e-9));
    let mut ends: Vec<(i32, i32)> = Vec::new();
    for arm in &t.arms {
        let branch = Branch::follow_arm(&map, &t.x, arm, within((-1.0, 1.0))).unwrap();
        let end = &branch.points.last().unwrap().x;
        ends.push((end[0].round() as i32, end[1].round() as i32));
    }
    ends.sort_unstable();
    assert_eq!(ends, [(-1, -1), (-1, 1), (1, -1)]);
}

/// A curve that touches a facet without crossing it goes on as it is.
#[test]
fn touching_a_facet_is_no_change() {
    // y = α²; the facet y = 0 is touched at 0, and both pieces agree there.
    let map = Plane::two(
        |y, a| [y - a * a, 1.0, -2.0 * a],
        |y, a| [3.0 * y - a * a, 3.0, -2.0 * a],
        |y, _| [y, 1.0, 0.0],
    );
    for h in STEPS {
        let branch = follow(&map, [1.0, -1.0], Direction::Increasing, limited((-1.0, 1.5), h));
        assert!(
            near(&branch.points.last().unwrap().x, [2.25, 1.5], 1e-9),
            "h_max {h}: {}",
            branch.termination
        );
        assert!(branch.points.iter().all(|p| p.selection.piece(0) == 0));
    }
}

/// A large sparse problem: the contacts of a string with point obstacles, against the parabolas between its supports.
#[test]
fn a_sparse_string() {
    for n in [35, 2999] {
        let node = |s: f64| (s * (n as f64 + 1.0)) as usize - 1;
        let map = StringOnPoints {
            n,
            sites: vec![
                (node(0.25), 0.3),
                (node(0.5), 0.33),
                (node(0.75), 0.4),
                (node(1.0 / 3.0), 0.6),
            ],
        };
        let expected = map.contacts();
        let range = (0.0, expected.last().unwrap().0 + 5.0);
        let start = vec![0.0; n + 1];
        let branch = Branch::follow(&map, &start, Direction::Increasing, within(range)).unwrap();
        assert_eq!(branch.termination, Termination::ParameterRange);
        assert_eq!(branch.transitions.len(), expected.len());
        for (t, (alpha, site)) in branch.transitions.iter().zip(&expected) {
            // Rounding is amplified by the condition number of K, (2n/π)².
            let tolerance = 10.0 * f64::EPSILON * (n as f64).powi(2);
            assert!(
                (t.parameter() - alpha).abs() <= tolerance * alpha,
                "n = {n}: {} {alpha}",
                t.parameter()
            );
            assert_eq!(
                (t.kind, t.sites.len(), t.sites[0].site),
                (TransitionKind::PassThrough, 1, *site)
            );
        }
    }
}

/// At a kink rows are replaced by updating the existing factors, also for sparse matrices.
#[test]
fn kinks_of_sparse_maps_need_no_new_factors() {
    for n in [99, 299, 999] {
        let sites = (1..8)
            .map(|k| (k * (n + 1) / 8 - 1, 0.3 + 0.02 * k as f64))
            .collect();
        let map = StringOnPoints { n, sites };
        let expected = map.contacts();
        let range = (0.0, expected.last().unwrap().0 + 5.0);
        let start = vec![0.0; n + 1];
        let mut curve = Continuation::new(&map, &start, Direction::Increasing, within(range)).unwrap();
        let events: Result<Vec<_>, _> = curve.by_ref().collect();
        let transitions = events
            .unwrap()
            .iter()
            .filter(|e| matches!(e, Event::Transition(_)))
            .count();
        assert_eq!(
            (transitions, curve.updates()),
            (expected.len(), expected.len()),
            "{n}"
        );
        assert_eq!(curve.factorisations(), 1, "{n}");
    }
}

/// Two lines cross on the facet at which the piece changes: there a corrector is accurate to half the digits only, the extended system of
/// the branch point to all.
#[test]
fn facets_met_at_branch_points_are_located_to_rounding() {
    fn crossing(y: f64, alpha: f64) -> [f64; 3] {
        let (u, v) = (y - 1.0, alpha - 2.0);
        let (f, g) = (u - v, u + 1.5 * v);
        [f * g, f + g, 1.5 * f - g]
    }
    fn facet(y: f64, alpha: f64) -> [f64; 3] {
        [alpha - 2.0 + 0.5 * (y - 1.0), 0.5, 1.0]
    }
    fn beyond(y: f64, alpha: f64) -> [f64; 3] {
        let ([c, cy, ca], [t, ty, ta]) = (crossing(y, alpha), facet(y, alpha));
        let u = 0.3 * (y - 1.0);
        [c + u * t, cy + u * ty + 0.3 * t, ca + u * ta]
    }
    let map = Plane::two(beyond, crossing, facet);
    for h in STEPS {
        let range = limited((0.0, 4.0), h);
        let branch = follow(&map, [0.1, 1.1], Direction::Increasing, range);
        let met = &branch.transitions[0];
        assert!(near(&met.x, [1.0, 2.0], 1e-13), "h_max {h}: {:?}", met.x);
        assert!(met.test_functions[0].abs() < 1e-13, "h_max {h}: {met:?}");
        assert_eq!(met.kind, TransitionKind::Branching, "h_max {h}");
    }
}

/// y = 3/2 α² above α² and y = α²/2 below it touch one another, and the kink y = α², at 0. Each curve goes on with its own piece.
#[test]
fn curves_that_touch_a_kink_and_another_curve_go_on() {
    let map = || {
        semismooth::piecewise::Traced::new(semismooth::piecewise::Formula::new(2, |x| {
            let square = x[1] * x[1];
            vec![x[0] - 1.5 * square - 2.0 * (x[0] - square).min(0.0)]
        }))
    };
    for height in [1.5, 0.5] {
        let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
        let branch = Branch::follow(&map(), &[height, -1.0], Direction::Increasing, options).unwrap();
        let end = &branch.points.last().unwrap().x;
        assert!(
            (end[0] - height).abs() < 1e-9 && end[1] == 1.0,
            "{height}: {end:?}"
        );
        let kinds: Vec<_> = branch.transitions.iter().map(|t| t.kind).collect();
        assert_eq!(kinds, [TransitionKind::Branching], "{height}");
        assert_eq!(branch.transitions[0].arms.len(), 3);
    }
}
