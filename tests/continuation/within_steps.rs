//! What happens inside one step and at its end: folds however slow α is, two events in one step, monitors that vanish together, curves that
//! close and curves that only come near.

use crate::random::Random;
use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Diagram, DiagramOptions, Direction, Event, Termination,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, PiecewiseSmooth, Real, Traced};
use std::ops::ControlFlow;

/// y³ − c y = α, in units: x is divided by `units`, the row multiplied by `row`.
struct Cubic {
    c: f64,
    units: [f64; 2],
    row: f64,
}

impl NonsmoothFunction for Cubic {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        let (y, a) = (x[0] * self.units[0], x[1] * self.units[1]);
        out[0] = (y * y * y - y * self.c - a) * self.row;
    }
}

fn within(lower: f64, upper: f64) -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range((lower, upper))
}

fn options_of(continuation: ContinuationOptions) -> DiagramOptions {
    let range = continuation.parameter_range;
    let mut options = DiagramOptions::default().with_parameter_range(range);
    options.continuation = continuation;
    options
}

fn follow<P: PiecewiseSmooth>(map: &P, x: &[f64], options: ContinuationOptions) -> Branch {
    Branch::follow(map, x, Direction::Increasing, options).unwrap()
}

/// Between two ends of the range the number of folds is even, and det ∇_yH, which is 3y² − c, changes its sign at each.
#[test]
fn folds_are_found_however_slow_the_parameter_is_between_them() {
    for k in 0..9 {
        for c in [1.0, 0.3, 0.1].map(|c| c * 0.1_f64.powi(k)) {
            let map = Traced::new(Cubic {
                c,
                units: [1.0; 2],
                row: 1.0,
            });
            let start = -1.2 - 0.01 * f64::from(k);
            let (from, to) = (start * start * start - c * start, 2.0);
            let o = within(from, to);
            let branch = follow(&map, &[start, from], o.clone());
            let folds: Vec<f64> = branch.smooth_folds.iter().map(|f| f.x[0]).collect();
            let exact = (c / 3.0).sqrt();
            assert_eq!(folds.len(), 2, "c {c:e}: {folds:?}");
            for (y, exact) in folds.iter().zip([-exact, exact]) {
                assert!(
                    (y - exact).abs() < 1e-6 * exact.abs() + 1e-14,
                    "c {c:e}: {y:e} {exact:e}"
                );
            }
            assert_eq!(branch.termination, Termination::ParameterRange);
            for p in branch
                .points
                .iter()
                .filter(|p| (3.0 * p.x[0] * p.x[0] - c).abs() > 1e-15)
            {
                let sign = (3.0 * p.x[0] * p.x[0] - c).signum() as i8;
                assert_eq!(p.det_sign, Some(sign), "c {c:e} at {:?}", p.x);
            }
            // Folds within 1e-10 of the range count as lying at the parameter asked for.
            if 2.0 * exact * c < 3e-9 {
                continue;
            }
            let diagram = Diagram::explore(&map, &[&[start, from]], &options_of(o));
            let found = diagram.unwrap().solutions_at(&map, 0.0).unwrap();
            assert_eq!(found.count(), Some(3), "c {c:e}");
        }
    }
}

/// The same decisions in other units of y, α and the row, where the options know the units.
#[test]
fn slow_folds_do_not_depend_on_units() {
    for (c, units, row) in [
        (1e-3, [1e8, 1.0], 1.0),
        (1e-3, [1e-8, 1.0], 1.0),
        (1e-3, [1.0, 1e8], 1.0),
        (1e-3, [1.0, 1e-8], 1.0),
        (1e-3, [1e-8, 1e-8], 1e8),
        (1e-3, [1.0, 1.0], 1e-8),
        (1e-5, [1.0, 1.0], 1e8),
    ] {
        let map = Traced::new(Cubic { c, units, row });
        let y = -1.2;
        let from = y * y * y - c * y;
        let sizes = units.map(|u: f64| u.recip());
        let o = within(from / units[1], 2.0 / units[1])
            .with_typical_sizes(sizes.to_vec())
            .with_step(0.05 / units[1])
            .with_max_step(1.0 / units[1])
            .with_min_step(1e-8 / units[1]);
        let branch = follow(&map, &[y / units[0], from / units[1]], o);
        assert_eq!(branch.smooth_folds.len(), 2, "{c} {units:?} {row}");
        assert_eq!(branch.termination, Termination::ParameterRange);
    }
}

/// y = max(α² (1 + α/3), d), with kinks at about α = ±√d.
struct Bottom(f64);

impl NonsmoothFunction for Bottom {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let bowl = x[1] * x[1] * (x[1] / 3.0 + 1.0);
        out[0] = x[0] - kinks.max(bowl, T::from(self.0));
    }
}

/// Where d is as small as 1e-13, too.
#[test]
fn two_kinks_within_a_step_are_both_met() {
    for k in 1..14 {
        let d = 0.1_f64.powi(k);
        let map = Traced::new(Bottom(d));
        for from in [-1.5, -1.43, -1.36_f64] {
            let y = from * from * (1.0 + from / 3.0);
            let branch = follow(&map, &[y, from], within(from, 2.0));
            let met: Vec<f64> = branch.transitions.iter().map(|t| t.parameter()).collect();
            assert_eq!(met.len(), 2, "d {d:e} from {from}: {met:?}");
            for (alpha, side) in met.iter().zip([-1.0, 1.0]) {
                // The rounding of α times the largest rate of the test function over a step, which is at most 3.
                let off = (alpha * alpha * (1.0 + alpha / 3.0) - d).abs();
                assert!(off < 16.0 * f64::EPSILON * 3.0, "d {d:e} from {from}: {off:e}");
                assert!(alpha * side > 0.0);
            }
            assert_eq!(branch.termination, Termination::ParameterRange);
        }
    }
}

/// y = W₂ act(W₁ y + w α + b): every activation is tanh, a positive part, or one of both.
pub(crate) struct Network {
    n: usize,
    kinds: Vec<bool>,
    first: Vec<Vec<f64>>,
    second: Vec<Vec<f64>>,
    load: Vec<f64>,
    bias: Vec<f64>,
}

impl Network {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let n = 1 + random.below(6);
        let hidden = 1 + random.below(2 * n);
        let kind = random.below(3);
        let matrix = |random: &mut Random, rows: usize, cols: usize, size: f64| -> Vec<Vec<f64>> {
            (0..rows)
                .map(|_| (0..cols).map(|_| size * random.normal()).collect())
                .collect()
        };
        Self {
            n,
            kinds: (0..hidden)
                .map(|_| kind == 0 || kind == 2 && random.below(2) == 0)
                .collect(),
            first: matrix(&mut random, hidden, n, 1.5 / (n as f64).sqrt()),
            second: matrix(&mut random, n, hidden, 1.5 / (hidden as f64).sqrt()),
            load: (0..hidden).map(|_| random.normal()).collect(),
            bias: (0..hidden).map(|_| random.normal()).collect(),
        }
    }
}

impl NonsmoothFunction for Network {
    fn num_vars(&self) -> usize {
        self.n + 1
    }
    fn num_residuals(&self) -> usize {
        self.n
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let zero = T::from(0.0);
        let hidden: Vec<T> = (0..self.kinds.len())
            .map(|i| {
                let row = self.first[i].iter().zip(x);
                let sum = row.fold(x[self.n] * self.load[i] + self.bias[i], |sum, (w, y)| {
                    sum + *y * *w
                });
                if self.kinds[i] {
                    sum.tanh()
                } else {
                    kinks.max(sum, zero)
                }
            })
            .collect();
        for (i, out) in out.iter_mut().enumerate() {
            let row = self.second[i].iter().zip(&hidden);
            *out = row.fold(x[i], |sum, (w, h)| sum - *h * *w);
        }
    }
}

/// The parameters of all folds, the termination, and the kinds of all transitions.
fn outline(branch: &Branch) -> (Vec<f64>, Termination, usize, Vec<f64>) {
    let rest = branch.transitions.iter().filter(|t| !t.is_fold()).count();
    (
        branch.folds(),
        branch.termination,
        rest,
        branch.points.last().unwrap().x.clone(),
    )
}

/// The curves of random networks through a solution at α = −4, from −4 to 4: those at default steps, and at a twentieth of them.
fn differences(seeds: std::ops::Range<u64>) -> (Vec<String>, usize) {
    let (mut differ, mut compared) = (Vec::new(), 0);
    for seed in seeds {
        let map = Traced::new(Network::new(seed));
        let mut x = vec![0.0; map.num_vars()];
        *x.last_mut().unwrap() = -4.0;
        let o = within(-4.0, 4.0).with_max_arclength(200.0);
        let Ok(coarse) = Branch::follow(&map, &x, Direction::Increasing, o.clone()) else {
            continue;
        };
        let o = o.with_step(0.0025).with_max_step(0.05).with_max_points(400_000);
        let fine = Branch::follow(&map, &x, Direction::Increasing, o).unwrap();
        compared += 1;
        let (a, b) = (outline(&coarse), outline(&fine));
        let near =
            |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        let limited = a.1 == Termination::ArclengthLimit;
        if !(near(&a.0, &b.0) && a.1 == b.1 && a.2 == b.2 && (limited || near(&a.3, &b.3))) {
            differ.push(format!("{seed}: {a:?} {b:?}"));
        }
    }
    (differ, compared)
}

#[test]
fn folds_of_networks_do_not_depend_on_the_length_of_steps() {
    let (differ, compared) = differences(0..60);
    assert!(compared > 40, "{compared}");
    assert_eq!(differ, Vec::<String>::new());
}

/// As many as take a few minutes.
#[test]
#[ignore]
fn folds_of_many_networks_do_not_depend_on_the_length_of_steps() {
    let (from, to) = (
        60,
        60 + std::env::var("NETWORKS").map_or(2000, |n| n.parse().unwrap()),
    );
    let (differ, compared) = differences(from..to);
    println!("{compared} compared");
    assert_eq!(differ, Vec::<String>::new());
}

fn collect(curve: Continuation<'_, impl PiecewiseSmooth>) -> Branch {
    Branch::collect(curve, |_| ControlFlow::Continue(())).unwrap()
}

/// y = f(α), where f may have a kink.
struct Graph(fn(f64) -> f64, bool);

/// |cos α| or α.
impl NonsmoothFunction for Graph {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let value = if self.1 { kinks.abs(x[1].cos()) } else { x[1] };
        out[0] = x[0] - value;
    }
    fn is_piecewise_affine(&self) -> bool {
        !self.1 && self.0(0.0) == 1.0
    }
}

/// The line y = α, in steps or as a polygon.
fn line(affine: bool) -> Traced<Graph> {
    Traced::new(Graph(if affine { |_| 1.0 } else { |_| 0.0 }, false))
}

type Monitor = fn(&[f64]) -> f64;

fn crossings<P: PiecewiseSmooth>(
    map: &P,
    x: [f64; 2],
    to: f64,
    monitors: &[Monitor],
) -> (Vec<(usize, f64)>, Branch) {
    let mut curve = Continuation::new(map, &x, Direction::Increasing, within(x[1], to)).unwrap();
    for (k, m) in monitors.iter().enumerate() {
        curve = curve.with_monitor(format!("{k}"), *m);
    }
    let branch = collect(curve);
    assert_eq!(branch.termination, Termination::ParameterRange);
    let found = branch
        .monitor_crossings
        .iter()
        .map(|c| (c.monitor, c.point.parameter()))
        .collect();
    (found, branch)
}

fn assert_met(found: &[(usize, f64)], expected: &[(usize, f64)], what: &str) {
    let same = found.len() == expected.len()
        && found
            .iter()
            .zip(expected)
            .all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-9);
    assert!(same, "{what}: {found:?}");
}

const HALF: f64 = std::f64::consts::FRAC_PI_2;

#[test]
fn monitors_with_a_common_zero_are_met_once_each() {
    for affine in [false, true] {
        let map = line(affine);
        let (found, _) = crossings(&map, [0.0, 0.0], 3.0, &[|x| x[1].cos(), |x| x[1].cos()]);
        assert_met(&found, &[(0, HALF), (1, HALF)], "twice");
        let (found, _) = crossings(
            &map,
            [0.0, 0.0],
            7.0,
            &[
                |x| x[1].cos(),
                |x| 1e5 * x[0].cos(),
                |x| (x[1] - HALF) * 1e-9,
                |x| x[1] - 7.0,
            ],
        );
        let last = 3.0 * HALF;
        let expected = [(0, HALF), (1, HALF), (2, HALF), (0, last), (1, last), (3, 7.0)];
        assert_met(&found, &expected, "several");
    }
}

#[test]
fn a_zero_at_a_kink_or_a_target_is_met_once() {
    let map = Traced::new(Graph(|_| 0.0, true));
    let (found, branch) = crossings(
        &map,
        [1.0, 0.0],
        3.0,
        &[|x| x[1].cos(), |x| x[0], |x| x[1] - HALF],
    );
    assert_eq!(branch.transitions.len(), 1);
    // y touches 0 there.
    assert_met(&found, &[(0, HALF), (2, HALF)], "kink");
    for affine in [false, true] {
        let map = line(affine);
        let o = within(0.0, 3.0).with_targets(vec![0.5, 1.0]);
        let curve = Continuation::new(&map, &[0.0, 0.0], Direction::Increasing, o).unwrap();
        let branch = collect(
            curve
                .with_monitor("one", |x| x[1] - 1.0)
                .with_monitor("half", |x| 0.5 - x[0]),
        );
        let met: Vec<_> = branch
            .monitor_crossings
            .iter()
            .map(|c| (c.monitor, c.point.parameter()))
            .collect();
        assert_met(&met, &[(1, 0.5), (0, 1.0)], "targets");
        assert_eq!(branch.termination, Termination::ParameterRange);
    }
}

#[test]
fn poles_and_jumps_are_no_zeros() {
    for affine in [false, true] {
        let map = line(affine);
        let monitors: [Monitor; 5] = [
            |x| 1.0 / (x[1] - 1.7),
            |x| if x[1] < 1.3 { 1.0 } else { -2.0 },
            |x| x[1] - 2.0 + if x[1] < 1.9 { -1.0 } else { 1.0 },
            |x| (x[1] - 1.1).tan(),
            |x| (x[1] - 2.2).cbrt(),
        ];
        let (found, _) = crossings(&map, [0.0, 0.0], 3.0, &monitors);
        // The tangent has its pole at 1.1 + π/2.
        assert_met(&found, &[(3, 1.1), (4, 2.2)], "poles");
    }
}

#[test]
fn functions_that_stay_zero_are_met_where_they_vanish_first() {
    for affine in [false, true] {
        let map = line(affine);
        let monitors: [Monitor; 3] = [
            |x| (1.3 - x[1]).max(0.0),
            |x| (1.0 - x[1]).max(0.0) - (x[1] - 2.0).max(0.0),
            |x| 1e3 * (0.3 - x[0]).max(0.0) + 1e3 - 1e3,
        ];
        let (found, _) = crossings(&map, [0.0, 0.0], 3.0, &monitors);
        assert_met(&found, &[(2, 0.3), (1, 1.0), (0, 1.3)], "zero");
    }
}

#[test]
fn two_zeros_within_a_step_are_met() {
    for affine in [false, true] {
        let map = line(affine);
        for width in [0.2, 0.05, 0.01] {
            let o = within(0.0, 20.0).with_step(1.0);
            let curve = Continuation::new(&map, &[0.0, 0.0], Direction::Increasing, o).unwrap();
            let branch =
                collect(curve.with_monitor("parabola", move |x| (x[1] - 7.3).powi(2) - width * width));
            let met: Vec<_> = branch
                .monitor_crossings
                .iter()
                .map(|c| (0, c.point.parameter()))
                .collect();
            assert_met(&met, &[(0, 7.3 - width), (0, 7.3 + width)], "parabola");
        }
    }
}

/// y₁ = R cos kα, y₂ = R sin kα beside a third variable; or the circle y² + α² = R².
enum Round {
    Helix(f64),
    Circle { radius: f64, centre: [f64; 2] },
}

impl NonsmoothFunction for Round {
    fn num_vars(&self) -> usize {
        match self {
            Self::Helix(_) => 3,
            Self::Circle { .. } => 2,
        }
    }
    fn num_residuals(&self) -> usize {
        self.num_vars() - 1
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        match self {
            Self::Helix(pitch) => {
                let angle = x[2] * (std::f64::consts::TAU / pitch);
                (out[0], out[1]) = (x[0] - angle.cos(), x[1] - angle.sin());
            }
            Self::Circle { radius, centre } => {
                let (y, a) = (x[0] - centre[0], x[1] - centre[1]);
                out[0] = y * y + a * a - radius * radius;
            }
        }
    }
}

#[test]
fn a_helix_is_not_closed() {
    for pitch in [1e-2, 1e-6, 6e-9, 1e-9] {
        let map = Traced::new(Round::Helix(pitch));
        let o = ContinuationOptions::default().with_max_arclength(30.0);
        let branch = follow(&map, &[1.0, 0.0, 0.0], o);
        assert_eq!(branch.termination, Termination::ArclengthLimit, "{pitch:e}");
    }
}

#[test]
fn circles_have_two_folds_whatever_their_size() {
    for centre in [[0.0, 0.0], [0.3, -0.2]] {
        for k in 0..8 {
            let radius = 0.1_f64.powi(k);
            if centre[0] != 0.0 && k > 4 {
                // The rounding of y² + α² hides the circle.
                continue;
            }
            let map = Traced::new(Round::Circle { radius, centre });
            for angle in [0.0f64, 0.5, 2.0, 4.0] {
                let start = [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()];
                let direction = Direction::Along(vec![-angle.sin(), angle.cos()]);
                let branch = Branch::follow(&map, &start, direction, ContinuationOptions::default()).unwrap();
                assert_eq!(branch.termination, Termination::Closed, "{radius:e} {angle}");
                assert_eq!(branch.smooth_folds.len(), 2, "{radius:e} {angle}");
                let length = branch.arclength() / (std::f64::consts::TAU * radius);
                assert!((0.9..1.001).contains(&length), "{radius:e} {angle}: {length}");
            }
        }
    }
}

/// Every event of a run is one of the same run with monitors.
#[test]
fn monitors_change_nothing_else() {
    let map = Traced::new(Graph(|_| 0.0, true));
    let run = |monitored: bool| {
        let mut curve =
            Continuation::new(&map, &[1.0, 0.0], Direction::Increasing, within(0.0, 9.0)).unwrap();
        if monitored {
            curve = curve
                .with_monitor("cos", |x| x[1].cos())
                .with_monitor("y", |x| x[0] - 0.5);
        }
        let events: Vec<Event> = curve.map(Result::unwrap).collect();
        let count = |f: fn(&Event) -> bool| events.iter().filter(|e| f(e)).count();
        (
            count(|e| matches!(e, Event::Transition(_))),
            count(|e| matches!(e, Event::Monitor(_))),
        )
    };
    assert_eq!((run(false), run(true)), ((3, 0), (3, 3 + 6)));
}
