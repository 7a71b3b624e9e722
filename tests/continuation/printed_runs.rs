//! The algorithm of Haslinger, Janovský and Ligurský (2012) with their settings reproduces their printed runs
//! and meets every transition of their examples.

use TransitionKind::{Fold, PassThrough, VerticalBegin, VerticalEnd};
use semismooth::contact::{
    ContactState, FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Direction, Event, StepRule, Termination, TransitionKind,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
use semismooth::sparse::Matrix;

/// Printed digits are truncated, not rounded.
fn truncated(v: f64) -> f64 {
    // A value that misses a printed digit by rounding counts as that digit.
    ((v + 1e-9 * v.signum()) * 1e4).trunc() / 1e4
}

#[test]
fn printed_run_of_example_1() {
    let problem = HildRenard::new(1.5, 7.0, 1.0, 1.0).unwrap().problem().unwrap();
    // The run was printed with r = 1.
    let problem = problem.with_r(1.0).unwrap();
    let start = problem.solve_from_states(10.0, &[ContactState::Stick]).unwrap();
    let options = ContinuationOptions::haslinger_janovsky_ligursky().with_parameter_range((0.5, 12.0));
    let curve = Continuation::new(&problem, &start, Direction::Decreasing, options).unwrap();
    let (mut before, mut after) = (Vec::new(), Vec::new());
    let mut transitions = 0;
    for event in curve {
        match event.unwrap() {
            Event::Transition(_) => transitions += 1,
            Event::Point(p) if transitions == 0 => before.push(problem.theta(&p.x)[0]),
            Event::Point(p) => after.push(problem.theta(&p.x)[0]),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(transitions, 1);
    assert_eq!(
        before.len(),
        25,
        "the transition is met at index 25, counted from 1"
    );
    let printed = [
        (before[11], [1.5, -3.7695, 17.7695]),
        (before[14], [1.5, -0.1754, 14.1754]),
        (before[24], [1.5, 0.0, 14.0]),
        (after[0], [1.5128, 0.0128, 13.9613]),
        (after[1], [1.5299, 0.0299, 13.9102]),
    ];
    for (theta, expected) in printed {
        for (t, e) in theta.iter().zip(expected) {
            assert!((truncated(*t) - e).abs() < 1e-9, "{theta:?} {expected:?}");
        }
    }
}

/// Their model with two contact nodes, λ = μ = 1, loads (f_ν1, f_t1, f_ν2, f_t2) and r = 1.
fn two_nodes(loads: [[f64; 4]; 2], friction: [f64; 2]) -> FullContact<PlanarCoulomb> {
    let a = [
        [0.5, 0.0, -0.5, -0.5],
        [0.0, 1.5, -0.5, -1.5],
        [-0.5, -0.5, 4.0, 0.0],
        [-0.5, -1.5, 0.0, 4.0],
    ];
    let pick = |k: usize| Matrix::from_rows(&[0, 2].map(|i| [0, 1, 2, 3].map(|j| f64::from(j == i + k))));
    FullContact::planar(
        Matrix::from_rows(&a).unwrap(),
        pick(0).unwrap(),
        pick(1).unwrap(),
        LoadPath::affine(loads[0].to_vec(), loads[1].to_vec()),
        FrictionCoefficient::affine(vec![friction[0]; 2], vec![friction[1]; 2]).unwrap(),
    )
    .unwrap()
    .with_r(1.0)
    .unwrap()
}

/// Follows the branch of `states` from 100 values of α from `first` on; each run must meet the transitions of
/// exact arithmetic and no others, and end at the bound of the window.
fn follow_from_everywhere(
    problem: &FullContact<PlanarCoulomb>,
    states: &[ContactState],
    first: f64,
    window: (f64, f64),
    expected: &[(f64, TransitionKind)],
) {
    let options = ContinuationOptions::haslinger_janovsky_ligursky().with_parameter_range(window);
    for k in 0..100 {
        let alpha = first + 0.1 * f64::from(k);
        let start = problem.solve_from_states(alpha, states).unwrap();
        let branch = Branch::follow(problem, &start, Direction::Decreasing, options.clone()).unwrap();
        let met: Vec<_> = branch
            .transitions
            .iter()
            .map(|t| (t.parameter(), t.kind))
            .collect();
        assert_eq!(met.len(), expected.len(), "from {alpha}: {met:?}");
        for ((at, kind), (exact, right)) in met.iter().zip(expected) {
            // The kink is met within the smallest step, 1e-5.
            assert!(
                (at - exact).abs() < 5e-5 && kind == right,
                "from {alpha}: {met:?}"
            );
        }
        assert_eq!(branch.termination, Termination::ParameterRange);
    }
}

#[test]
fn one_node_branches_are_followed_from_any_start() {
    use ContactState::{Open, Stick};
    let follow = |f: (f64, f64), state, expected: &[(f64, TransitionKind)]| {
        let problem = HildRenard::new(f.0, f.1, 1.0, 1.0).unwrap().problem().unwrap();
        let first = expected.first().map_or(2.0, |e| e.0) + 0.5;
        follow_from_everywhere(
            &problem.with_r(1.0).unwrap(),
            &[state],
            first,
            (0.2, 20.0),
            expected,
        );
    };
    follow((1.5, 7.0), Stick, &[(14.0 / 3.0, PassThrough)]);
    follow((1.5, -4.0), Stick, &[(8.0 / 3.0, Fold)]);
    follow((1.5, -4.0), Open, &[]);
    follow((1.0, -2.0), Stick, &[(2.0, VerticalBegin), (2.0, VerticalEnd)]);
    follow((1.0, -2.0), Open, &[]);
    follow((1.0 - 0.08, -2.0), Stick, &[(2.0 / 0.92, Fold)]);
    follow((1.0 - 0.08, -2.0), Open, &[]);
}

#[test]
fn two_node_branches_are_followed_from_any_start() {
    use ContactState::{Open, Stick};
    let first = two_nodes([[0.4, -2.1417, 1.3717, -2.1417], [0.0; 4]], [0.0, 1.0]);
    let expected = [
        (5.35425, PassThrough),
        (2.951_386, Fold),
        (8.857_254, PassThrough),
    ];
    follow_from_everywhere(&first, &[Stick; 2], 5.45, (0.2, 20.0), &expected);
    follow_from_everywhere(&first, &[Open; 2], 5.45, (0.2, 20.0), &[]);
    let second = two_nodes([[0.4, 0.2, 1.8, -0.1], [-0.1, 1.1, 0.2, 0.8]], [4.0, 0.0]);
    let expected = [
        (4.0, PassThrough),
        (14.0 / 15.0, PassThrough),
        (-18.0 / 7.0, PassThrough),
        (-3.494_845, Fold),
        (-1.959_016, PassThrough),
        (-1.841_463, Fold),
    ];
    follow_from_everywhere(&second, &[Open, Stick], 4.5, (-6.0, 20.0), &expected);
}

/// The vertical segment of p = 1, Example 3: the talk prints its indices 9 and 14, one more than the steps
/// since the kink.
#[test]
fn printed_run_of_example_3() {
    let problem = HildRenard::new(1.0, -2.0, 1.0, 1.0).unwrap().problem().unwrap();
    let problem = problem.with_r(1.0).unwrap();
    let start = problem.solve_from_states(10.0, &[ContactState::Stick]).unwrap();
    let options = ContinuationOptions::haslinger_janovsky_ligursky().with_parameter_range((0.5, 12.0));
    let branch = Branch::follow(&problem, &start, Direction::Decreasing, options).unwrap();
    let kink = branch.transitions[0].arclength;
    let after: Vec<_> = branch.points.iter().filter(|p| p.arclength > kink).collect();
    for (steps, expected) in [(8, [0.3669, -2.1007, -0.6331]), (13, [0.0001, -1.0004, -0.9999])] {
        let theta = problem.theta(&after[steps - 1].x)[0];
        for (t, e) in theta.iter().zip(expected) {
            assert!((truncated(*t) - e).abs() < 2e-4, "{theta:?} {expected:?}");
        }
    }
}

/// y² + α² = 1
struct Circle;

impl NonsmoothFunction for Circle {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
    }
}

/// The Moore–Penrose corrections of the point (1, h) towards the circle: the rate of the first two, and the
/// angle at which they end.
fn corrections_on_the_circle(h: f64) -> (f64, f64) {
    let (mut x, mut t) = ([1.0, h], [0.0, 1.0]);
    let mut steps = Vec::new();
    for _ in 0..8 {
        let value = x[0] * x[0] + x[1] * x[1] - 1.0;
        let det = 2.0 * (x[0] * t[1] - x[1] * t[0]);
        let d = [value * t[1] / det, -value * t[0] / det];
        let size = f64::hypot(x[0], x[1]);
        t = [-x[1] / size, x[0] / size];
        x = [x[0] - d[0], x[1] - d[1]];
        steps.push(d[0].hypot(d[1]));
    }
    (steps[1] / steps[0], x[1].atan2(x[0]))
}

/// On a circle all steps of one length converge at one rate: by `StepRule::Convergence` they tend to the
/// length at which it is ¼, and by `StepRule::Growth` they grow until corrections fail.
#[test]
fn steps_adapt_to_the_rate_of_convergence() {
    let chords = |rule, min_cos| {
        let options = ContinuationOptions::haslinger_janovsky_ligursky()
            .with_step_rule(rule)
            .with_min_cos(min_cos)
            .with_max_step(10.0)
            .with_max_arclength(60.0);
        let branch =
            Branch::follow(&Traced::new(Circle), &[1.0, 0.0], Direction::Increasing, options).unwrap();
        assert_eq!(branch.termination, Termination::ArclengthLimit);
        let chord =
            |w: &[semismooth::continuation::Point]| (w[0].x[0] - w[1].x[0]).hypot(w[0].x[1] - w[1].x[1]);
        branch.points.windows(2).map(chord).collect::<Vec<f64>>()
    };
    let (mut low, mut high) = (0.5, 2.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        match corrections_on_the_circle(middle).0 < 0.25 {
            true => low = middle,
            false => high = middle,
        }
    }
    let ideal = 2.0 * (0.5 * corrections_on_the_circle(low).1).sin();
    let found = chords(StepRule::Convergence, 0.1);
    for chord in &found[found.len() - 10..found.len() - 1] {
        assert!((chord - ideal).abs() < 1e-4, "{chord} {ideal}");
    }
    // Both grow by the same factor where corrections are fast.
    let grown = chords(StepRule::Growth, 0.1);
    assert!((grown[5] - found[5]).abs() < 1e-12, "{grown:?} {found:?}");
    assert!(grown.iter().any(|chord| *chord > 1.1 * ideal));
    // Where the angle between tangents allows less, steps are as long as it allows.
    let narrow = chords(StepRule::Convergence, 0.97);
    assert!(
        narrow
            .iter()
            .all(|chord| *chord <= 2.0 * (0.5 * 0.97_f64.acos()).sin() + 1e-6)
    );
}
