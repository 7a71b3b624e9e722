//! The seed's own algorithm with the seed's settings reproduces the seed's printed run of p = 1, Example 1.

use semismooth::contact::{ContactState, FrictionMap, FrictionStart, HildRenard, first_point};
use semismooth::continuation::{Continuation, ContinuationOptions, Direction, Event};

/// Printed digits are truncated, not rounded.
fn truncated(v: f64) -> f64 {
    // Values a rounding error below a printed digit belong to it.
    ((v + 1e-9 * v.signum()) * 1e4).trunc() / 1e4
}

#[test]
fn printed_run_of_example_1() {
    let problem = HildRenard::new(1.5, 7.0, 1.0, 1.0).unwrap().problem().unwrap();
    // The run was printed with r = 1.
    let problem = problem.with_r(1.0).unwrap();
    let start = first_point(&problem, 10.0, &FrictionStart::States(vec![ContactState::Stick])).unwrap();
    let options = ContinuationOptions::seed().with_parameter_range((0.5, 12.0));
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
