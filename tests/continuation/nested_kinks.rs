//! Kinks inside kinks, kinks that coincide, and test functions that vanish where others do: graphs g(y) = α, on which nothing branches.

use crate::random::Random;
use semismooth::continuation::{
    Branch, ContinuationOptions, Direction, Termination, TransitionKind, TransitionSet,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

type Graph = usize;

/// (y₁, y₂, α) with y₂ = h(y₁) and g(y₁, y₂) = α.
struct Nested(Graph);

impl NonsmoothFunction for Nested {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (y, z) = (x[0], x[1]);
        let zero = T::from(0.0);
        let (h, g) = match self.0 {
            // Three kinks at y = 1: on one side two of the arguments vanish identically.
            0 => {
                let first = kinks.positive_part(y - 1.0);
                let second = kinks.positive_part(first);
                let third = kinks.project(zero, first, T::from(0.1));
                (third + second + y * 2.0, z * 4.0)
            }
            // |y| − y vanishes for all y ≥ 0.
            1 => {
                let size = kinks.abs(y);
                let twice = kinks.max(size - y, zero);
                let same = kinks.min(size, y);
                (same + twice, y + z * 0.25)
            }
            // A test function that vanishes identically.
            2 => {
                let nothing = kinks.abs(y * 0.7 + y * -0.7);
                (kinks.abs(y - 1.0) + nothing, z * 0.5 + y)
            }
            // A kink at ½ in which 3 (2 y − 1)² touches that of another.
            3 => {
                let touching = kinks.abs((y * 2.0 - 1.0).powi(2) * 0.3);
                let near = kinks.max(y, T::from(0.5));
                (kinks.abs(touching) + near, z + y * 3.0)
            }
            // A site without effect beside a curve that becomes steep after a kink.
            _ => {
                let idle = kinks.min(y, y);
                let v = y * 2.0 - 0.85 + (idle - y);
                (kinks.positive_part(v) * -1.0 + v.sin(), z * 3.2 + z * z * 0.6)
            }
        };
        out[0] = z - h;
        out[1] = g - x[2];
    }
}

impl Nested {
    fn point(&self, y: f64) -> [f64; 3] {
        let positive = |v: f64| v.max(0.0);
        let (z, g): (f64, fn(f64, f64) -> f64) = match self.0 {
            0 => (
                positive(y - 1.0).min(0.1) + positive(y - 1.0) + 2.0 * y,
                |_, z| 4.0 * z,
            ),
            1 => (y.abs().min(y) + positive(y.abs() - y), |y, z| y + 0.25 * z),
            2 => ((y - 1.0).abs(), |y, z| 0.5 * z + y),
            3 => (0.3 * (2.0 * y - 1.0).powi(2) + y.max(0.5), |y, z| z + 3.0 * y),
            _ => {
                let v: f64 = 2.0 * y - 0.85;
                (v.sin() - positive(v), |_, z| 3.2 * z + 0.6 * z * z)
            }
        };
        [y, z, g(y, z)]
    }
}

/// Places on the graph at which some slope jumps.
const JUMPS: [&[f64]; 5] = [&[1.0, 1.1], &[0.0], &[1.0], &[0.5], &[0.425]];

#[test]
fn graphs_of_nested_kinks_are_followed_through() {
    for (graph, jumps) in JUMPS.iter().enumerate() {
        let own = Nested(graph);
        let map = Traced::new(Nested(graph));
        let (begin, end) = (-0.3, 1.6);
        for (from, to) in [(begin, end), (end, begin)] {
            let start = own.point(from);
            let slope = own.point(from + 1e-6 * (to - from))[2] - start[2];
            let direction = if slope > 0.0 {
                Direction::Increasing
            } else {
                Direction::Decreasing
            };
            let options = ContinuationOptions::default().with_max_arclength(40.0);
            let curve =
                semismooth::continuation::Continuation::new(&map, &start, direction, options).unwrap();
            let sign = f64::signum(to - from);
            let passed = curve.with_stop("end", move |x: &[f64]| sign * (x[0] - to));
            let branch = Branch::collect(passed, |_| std::ops::ControlFlow::Continue(())).unwrap();
            assert_eq!(branch.termination, Termination::Monitor, "{graph}");
            assert!(branch.branch_points.is_empty(), "{graph}");
            for (before, after) in branch.points.iter().zip(&branch.points[1..]) {
                let [_, z, alpha] = own.point(after.x[0]);
                assert!(
                    (after.x[1] - z).abs() + (after.x[2] - alpha).abs() < 1e-8,
                    "{graph}"
                );
                assert!(sign * (after.x[0] - before.x[0]) > -1e-9, "{graph}");
            }
            let mut met: Vec<f64> = branch.transitions.iter().map(|t| t.x[0]).collect();
            let kinds: Vec<_> = branch.transitions.iter().map(|t| t.kind).collect();
            assert!(
                !kinds.contains(&TransitionKind::Branching) && !kinds.contains(&TransitionKind::End),
                "{graph}: {kinds:?}"
            );
            met.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
            assert!(
                met.len() == branch.transitions.len() && met.len() < 5,
                "{graph}: {met:?}"
            );
            for jump in *jumps {
                assert!(met.iter().any(|y| (y - jump).abs() < 1e-9), "{graph}: {met:?}");
            }
        }
    }
}

/// |y| − y vanishes for all y > 0: the sites with this test function stay degenerate along the curve.
#[test]
fn sites_that_stay_degenerate_are_named() {
    let (map, own) = (Traced::new(Nested(1)), Nested(1));
    for (from, to) in [(-0.3, 1.6), (1.6, -0.3)] {
        let direction = match own.point(to)[2] > own.point(from)[2] {
            true => Direction::Increasing,
            false => Direction::Decreasing,
        };
        let options = ContinuationOptions::default().with_max_arclength(5.0);
        let branch = Branch::follow(&map, &own.point(from), direction, options).unwrap();
        let mut seen = [0, 0];
        for point in &branch.points {
            let expected: &[usize] = if point.x[0] > 0.0 { &[1, 2] } else { &[] };
            assert_eq!(point.grazing, expected, "{} from {from}", point.x[0]);
            seen[usize::from(point.x[0] > 0.0)] += 1;
        }
        assert!(seen[0] > 1 && seen[1] > 1, "{seen:?}");
    }
}

/// Random compositions of projections, absolute values, maxima and minima; `steps` name their operands among the earlier values.
struct Drawn(Vec<(usize, usize, usize, f64)>);

impl Drawn {
    fn new(seed: u64) -> Self {
        let mut rng = Random::new(seed);
        let step = |k: usize| {
            let half = f64::from(rng.below(9) as i32 - 4) / 2.0;
            (rng.below(6), rng.below(k + 2), rng.below(k + 2), half)
        };
        Self((0..7).map(step).collect())
    }

    fn plain(&self, y: f64) -> f64 {
        let mut list = vec![y, 1.0 - 2.0 * y];
        for &(kind, i, j, c) in &self.0 {
            let (a, b) = (list[i], list[j]);
            list.push(match kind {
                0 => a.abs(),
                1 => a.max(b),
                2 => a.min(b + c),
                3 => (a + c).max(0.0),
                4 => a.clamp(c, c + 1.0),
                _ => a - b * 0.5,
            });
        }
        list.iter().skip(2).sum()
    }
}

impl NonsmoothFunction for Drawn {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let mut list = vec![x[0], x[0] * -2.0 + 1.0];
        for &(kind, i, j, c) in &self.0 {
            let (a, b) = (list[i], list[j]);
            list.push(match kind {
                0 => kinks.abs(a),
                1 => kinks.max(a, b),
                2 => kinks.min(a, b + c),
                3 => kinks.positive_part(a + c),
                4 => kinks.project(T::from(c), a, T::from(c + 1.0)),
                _ => a - b * 0.5,
            });
        }
        out[0] = list.iter().skip(2).fold(x[1] * -1.0, |sum, v| sum + *v);
    }
}

/// A graph of [`Drawn`] whose steps are curved, so that slopes vary and rounding is everywhere.
struct Bent(Drawn);

impl Bent {
    fn plain(&self, y: f64) -> f64 {
        let mut list = vec![y, 1.0 - 2.0 * y];
        for &(kind, i, j, c) in &self.0.0 {
            let (a, b) = (list[i], list[j]);
            let v = match kind {
                0 => a.abs(),
                1 => a.max(b),
                2 => a.min(b + c),
                3 => (a + c).max(0.0),
                4 => a.clamp(c, c + 1.0),
                _ => a - b * 0.5,
            };
            list.push(0.7 * v + 0.3 * v.sin());
        }
        list.iter().skip(2).sum::<f64>() + 3.1 * y
    }
}

impl NonsmoothFunction for Bent {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let mut list = vec![x[0], x[0] * -2.0 + 1.0];
        for &(kind, i, j, c) in &self.0.0 {
            let (a, b) = (list[i], list[j]);
            let v = match kind {
                0 => kinks.abs(a),
                1 => kinks.max(a, b),
                2 => kinks.min(a, b + c),
                3 => kinks.positive_part(a + c),
                4 => kinks.project(T::from(c), a, T::from(c + 1.0)),
                _ => a - b * 0.5,
            };
            list.push(v * 0.7 + v.sin() * 0.3);
        }
        out[0] = list.iter().skip(2).fold(x[0] * 3.1 - x[1], |sum, v| sum + *v);
    }
}

/// There arms run in the boundaries of cells to first order, and curve away from them.
#[test]
fn bent_graphs_of_nested_kinks_are_followed_to_their_end() {
    let seeds = std::env::var("SEEDS").map_or(400, |s| s.parse().unwrap());
    for seed in 0..seeds {
        let graph = Bent(Drawn::new(seed));
        let start = -3.0 - 1.0 / 1024.0;
        let direction = match graph.plain(start + 1e-6) > graph.plain(start) {
            true => Direction::Increasing,
            false => Direction::Decreasing,
        };
        let options = ContinuationOptions::default().with_max_arclength(9.0);
        let x = [start, graph.plain(start)];
        let branch = Branch::follow(&Traced::new(Bent(Drawn::new(seed))), &x, direction, options).unwrap();
        assert_eq!(branch.termination, Termination::ArclengthLimit, "{seed}");
        let kinds: Vec<_> = branch.transitions.iter().map(|t| t.kind).collect();
        assert!(
            !kinds.contains(&TransitionKind::Branching) && branch.branch_points.is_empty(),
            "{seed}: {kinds:?}"
        );
        assert!(
            branch.transitions.len() < 30,
            "{seed}: {}",
            branch.transitions.len()
        );
        for pair in branch.vertices().windows(2) {
            assert!(pair[1].x[0] > pair[0].x[0] - 1e-9, "{seed}");
        }
        let last = branch.points.last().unwrap();
        assert!((graph.plain(last.x[0]) - last.x[1]).abs() < 1e-9, "{seed}");
    }
}

/// A graph of [`Drawn`] plus 6.1 y.
struct Rising(Drawn);

impl NonsmoothFunction for Rising {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        self.0.eval(x, kinks, out);
        out[0] += x[0] * 6.1;
    }
}

/// Along these graphs some test function vanishes up to rounding, which is no reason to leave a piece.
#[test]
fn rounding_of_test_functions_that_vanish_is_no_kink() {
    for seed in [1098, 1715, 1838, 1881, 2071, 2931, 3794, 4717, 4762, 4985, 5607].map(|k| 7919 * k) {
        let start = -3.0 - 1.0 / 1024.0;
        let x = [start, Drawn::new(seed).plain(start) + 6.1 * start];
        let ahead = start + 1e-6;
        let direction = match Drawn::new(seed).plain(ahead) + 6.1 * ahead > x[1] {
            true => Direction::Increasing,
            false => Direction::Decreasing,
        };
        let options = ContinuationOptions::default()
            .with_max_arclength(9.0)
            .with_max_points(300);
        let branch = Branch::follow(&Traced::new(Rising(Drawn::new(seed))), &x, direction, options).unwrap();
        assert_eq!(branch.termination, Termination::ArclengthLimit, "{seed}");
        assert!(
            branch.transitions.len() < 40 && branch.branch_points.is_empty(),
            "{seed}"
        );
    }
}

/// All numbers are multiples of a power of ½, so that difference quotients between kinks are exact.
#[test]
fn graphs_of_random_nested_kinks_have_their_jumps_and_nothing_else() {
    let mut followed = 0;
    for seed in 0..150 {
        let graph = Drawn::new(seed);
        let start = -3.0 - 1.0 / 1024.0;
        let slope = (graph.plain(start + 1.0 / 4096.0) - graph.plain(start)) * 4096.0;
        if slope == 0.0 {
            continue;
        }
        let direction = if slope > 0.0 {
            Direction::Increasing
        } else {
            Direction::Decreasing
        };
        let options = ContinuationOptions::default().with_max_arclength(9.0);
        let x = [start, graph.plain(start)];
        let branch = Branch::follow(&Traced::new(Drawn::new(seed)), &x, direction, options).unwrap();
        assert_eq!(branch.termination, Termination::ArclengthLimit, "{seed}");
        let flat = branch
            .transitions
            .iter()
            .filter(|t| t.kind == TransitionKind::Branching);
        assert_eq!((flat.count(), branch.branch_points.len()), (0, 0), "{seed}");
        let last = branch.points.last().unwrap();
        assert!((graph.plain(last.x[0]) - last.x[1]).abs() < 1e-9, "{seed}");
        assert!(last.x[0] > start + 1e-3, "{seed}");
        for (a, b) in branch.transitions.iter().zip(branch.transitions.iter().skip(1)) {
            assert!(b.x[0] > a.x[0] + 1e-9, "{seed}: {} {}", a.x[0], b.x[0]);
        }
        // Where slopes on both sides of a place differ, there is a transition.
        let h = 1.0 / 512.0;
        let mut y = start;
        while y + h < last.x[0] {
            let slopes =
                [0.0, 0.25, 0.5, 0.75].map(|s| graph.plain(y + (s + 0.25) * h) - graph.plain(y + s * h));
            if slopes.iter().any(|s| (s - slopes[0]).abs() > 1e-9) {
                let met = branch
                    .transitions
                    .iter()
                    .any(|t| t.x[0] > y - 1e-9 && t.x[0] < y + h + 1e-9);
                assert!(met, "{seed}: {y}");
            }
            y += h;
        }
        followed += 1;
    }
    assert!(followed > 60, "{followed}");
}

/// The equation y + y²/5 = β of a family in (y, α, β), and beside it an outer kink where |y + y²/10| = α.
struct OuterKink;

impl NonsmoothFunction for OuterKink {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let size = kinks.abs(x[0] + x[0] * x[0] * 0.1);
        let outer = kinks.positive_part(size - x[1]);
        out[0] = x[0] + x[0] * x[0] * 0.2 - x[2] + outer * 0.5;
    }
}

#[test]
fn transition_sets_of_outer_kinks_bend_where_the_inner_ones_are() {
    for (from, to) in [(-0.9, 1.2), (1.2, -0.9)] {
        let set = TransitionSet::new(Traced::new(OuterKink), 1, 0).unwrap();
        let point = |y: f64| [y, (y + 0.1 * y * y).abs(), y + 0.2 * y * y];
        let options = ContinuationOptions::default().with_parameter_range((point(-0.9)[2], point(1.2)[2]));
        let direction = if to > from {
            Direction::Increasing
        } else {
            Direction::Decreasing
        };
        let curve = Branch::follow(&set, &point(from), direction, options).unwrap();
        assert_eq!(curve.termination, Termination::ParameterRange);
        for p in &curve.points {
            let expected = point(p.x[0]);
            let far = p.x.iter().zip(expected).any(|(a, b)| (a - b).abs() > 1e-10);
            assert!(!far, "{:?}", p.x);
        }
        let met: Vec<f64> = curve.transitions.iter().map(|t| t.x[0]).collect();
        assert!(met.len() == 1 && met[0].abs() < 1e-12, "{met:?}");
        assert_eq!(curve.transitions[0].kind, TransitionKind::PassThrough);
        assert!((curve.points.last().unwrap().x[0] - to).abs() < 1e-9);
    }
}

/// Three kinks, each inside the next, where y = 0, and a square.
struct Three;

impl NonsmoothFunction for Three {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let y = x[0];
        let inner = kinks.abs(y);
        let middle = kinks.abs(inner - y * 0.5);
        let outer = kinks.max(middle, y * 2.0);
        out[0] = y * 9.0 + inner + middle + outer + y * y - x[1];
    }
}

#[test]
fn a_list_of_arms_cut_off_by_the_limit_is_not_called_complete() {
    for (limit, complete) in [(2, false), (8, true)] {
        let options = ContinuationOptions::default()
            .with_parameter_range((-4.0, 3.0))
            .with_max_selections(limit);
        let branch =
            Branch::follow(&Traced::new(Three), &[-1.0, -4.0], Direction::Increasing, options).unwrap();
        assert_eq!(branch.termination, Termination::ParameterRange);
        let met: Vec<_> = branch.transitions.iter().map(|t| (t.x[0], t.complete)).collect();
        assert!(
            matches!(met.as_slice(), [(y, told)] if y.abs() < 1e-12 && *told == complete),
            "{limit}: {met:?}"
        );
    }
}

/// Where the limit leaves no selection to continue with, the point is not known to be an end.
#[test]
fn a_curve_whose_arms_were_not_all_examined_has_no_known_end() {
    let options = ContinuationOptions::default()
        .with_parameter_range((-4.0, 3.0))
        .with_max_selections(1)
        .with_local_starts(0);
    let mut kept = 0;
    for (x, direction) in [
        ([-1.0, -4.0], Direction::Increasing),
        ([0.2, 2.54], Direction::Decreasing),
    ] {
        let branch = Branch::follow(&Traced::new(Three), &x, direction, options.clone()).unwrap();
        let told = branch.transitions.last().unwrap();
        match branch.termination {
            Termination::Undecided => assert!(!told.complete && told.kind == TransitionKind::Undecided),
            Termination::ParameterRange => kept += 1,
            other => panic!("{other:?}"),
        }
    }
    // The first selection in the list belongs to one of the sides.
    assert!(kept < 2, "{kept}");
}
