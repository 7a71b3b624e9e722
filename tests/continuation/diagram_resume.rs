//! Explorations that are stopped anywhere and resumed give the diagram of an uninterrupted one.

use std::ops::ControlFlow;

use crate::common;

use semismooth::InputError;
use semismooth::continuation::{ContinuationError, Diagram, DiagramOptions, Termination, VertexKind};
use semismooth::enumeration::EnumerationOptions;
use semismooth::piecewise::{MinMap, PiecewiseSmooth};

const NONE: [[f64; 1]; 0] = [];

/// Written to a file format and read back, if there is one.
fn stored(diagram: Diagram) -> Diagram {
    #[cfg(feature = "serde")]
    {
        let text = serde_json::to_string(&diagram).unwrap();
        let back: Diagram = serde_json::from_str(&text).unwrap();
        assert_eq!(format!("{back:?}"), format!("{diagram:?}"));
        back
    }
    #[cfg(not(feature = "serde"))]
    diagram
}

/// Compares what does not depend on where curves were cut.
fn compare<P: PiecewiseSmooth>(map: &P, found: &Diagram, whole: &Diagram, context: &str) {
    assert!(!found.completeness().is_limited(), "{context}: {found}");
    assert_eq!(
        found.components().len(),
        whole.components().len(),
        "{context}: {found}"
    );
    assert_eq!(
        found.branches().len(),
        whole.branches().len(),
        "{context}: {found}"
    );
    assert_eq!(found.isolas().len(), whole.isolas().len(), "{context}: {found}");
    assert_eq!(found.folds().len(), whole.folds().len(), "{context}: {found}");
    let kinks = |d: &Diagram| -> Vec<(VertexKind, f64)> {
        let all = d.vertices().iter().filter(|v| v.kind != VertexKind::Start);
        let mut list: Vec<_> = all.map(|v| (v.kind, v.parameter())).collect();
        list.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.name().cmp(b.0.name())));
        list
    };
    let (a, b) = (kinks(found), kinks(whole));
    assert_eq!(a.len(), b.len(), "{context}: {found}");
    for (a, b) in a.iter().zip(&b) {
        assert!((a.1 - b.1).abs() < 1e-7, "{context}");
    }
    let (lower, upper) = whole.parameter_range();
    for k in 1..30 {
        let alpha = lower.max(-3.0) + f64::from(k) / 30.0 * (upper.min(9.0) - lower.max(-3.0)) + 1e-4;
        let (a, b) = (
            found.solutions_at(map, alpha).unwrap(),
            whole.solutions_at(map, alpha).unwrap(),
        );
        assert_eq!(a.count(), b.count(), "{context} at {alpha}");
        assert_eq!(a.index_sum(), b.index_sum(), "{context} at {alpha}");
    }
}

/// Stops after every `stride`-th event and resumes, repeatedly.
fn check<P: PiecewiseSmooth>(map: &P, starts: &[Vec<f64>], options: &DiagramOptions, stride: usize) {
    let mut events = 0;
    let whole = Diagram::explore_observed(map, starts, options, |_| {
        events += 1;
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(!whole.completeness().is_limited(), "{whole}");
    let stop_after = |limit: usize| {
        let mut left = limit;
        move |_: &semismooth::continuation::Progress<'_>| {
            left -= 1;
            if left == 0 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        }
    };
    for k in (1..=events).step_by(stride) {
        let part = Diagram::explore_observed(map, starts, options, stop_after(k)).unwrap();
        assert!(part.completeness().is_limited());
        // All starts but the first may be missing: given again they are recognised.
        let resumed = stored(part).resume(map, starts, options).unwrap();
        compare(map, &resumed, &whole, &format!("stopped after {k}"));
    }
    // In slices.
    let mut diagram = Diagram::explore_observed(map, starts, options, stop_after(3)).unwrap();
    let mut rounds = 0;
    while diagram.completeness().is_limited() {
        diagram = stored(diagram)
            .resume_observed(map, starts, options, stop_after(120))
            .unwrap();
        rounds += 1;
        assert!(rounds < events, "no progress");
    }
    compare(map, &diagram, &whole, "in slices");
    // A complete diagram stays as it is.
    let again = diagram.clone().resume(map, &NONE, options).unwrap();
    assert_eq!(again, diagram);
}

#[test]
fn the_printed_examples() {
    for (name, states) in [
        ("p1_ex2", ["K", "O"]),
        ("p1_ex3", ["K", "O"]),
        ("p2_ex1", ["KK", "OO"]),
    ] {
        let case = common::cases().into_iter().find(|c| c.name == name).unwrap();
        let starts: Vec<Vec<f64>> = states
            .iter()
            .map(|s| case.problem.solve_from_states(8.0, &common::states(s)).unwrap())
            .collect();
        let mut options = DiagramOptions::default().with_parameter_range((-12.0, 25.0));
        options.continuation.max_growth = 1e3;
        check(&case.problem, &starts, &options, 7);
    }
}

#[test]
fn affine_pieces() {
    let case = common::cases().into_iter().find(|c| c.name == "p2_ex2").unwrap();
    let map = case.problem.condensed().unwrap();
    let options = DiagramOptions::default().with_parameter_range((-12.0, 25.0));
    let sections = EnumerationOptions::default();
    let all = Diagram::explore_sections(&map, &[0.0, 3.0], &options, &sections).unwrap();
    let starts: Vec<Vec<f64>> = all
        .vertices()
        .iter()
        .filter(|v| v.is_start)
        .map(|v| v.x.clone())
        .collect();
    check(&map, &starts, &options, 1);
}

#[test]
fn smooth_curves() {
    let map = |f: fn(f64, f64) -> f64| {
        MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = f(x[0], x[1]);
            b[0] = 1e9;
        })
    };
    let options = DiagramOptions::default().with_parameter_range((-1.5, 1.5));
    check(&map(|y, a| y * y + a * a - 1.0), &[vec![0.8, 0.6]], &options, 1);
    check(&map(|y, a| y * y * y - a * y), &[vec![0.0, -0.5]], &options, 3);
}

#[test]
fn limits_on_points_are_lifted_and_others_refused() {
    let circle = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    });
    let few = DiagramOptions::default().with_max_points(8);
    let part = Diagram::explore(&circle, &[[0.8, 0.6]], &few).unwrap();
    let limited = |d: &Diagram| {
        d.vertices()
            .iter()
            .any(|v| v.kind == VertexKind::Limit(Termination::PointLimit))
    };
    assert!(limited(&part), "{part}");
    // The same limit again: nothing can be added.
    let same = part.clone().resume(&circle, &NONE, &few).unwrap();
    assert!(same.completeness().is_limited());
    let whole = part
        .clone()
        .resume(&circle, &NONE, &DiagramOptions::default())
        .unwrap();
    assert!(
        !whole.completeness().is_limited() && whole.isolas().len() == 1,
        "{whole}"
    );
    let other_range = DiagramOptions::default().with_parameter_range((-2.0, 2.0));
    let refused = part.clone().resume(&circle, &NONE, &other_range);
    assert!(matches!(
        refused,
        Err(ContinuationError::Input(InputError::Option { .. }))
    ));
    let other_map = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a.copy_from_slice(&x[..2]);
        b.fill(1e9);
    });
    assert!(matches!(
        part.resume(&other_map, &NONE, &DiagramOptions::default()),
        Err(ContinuationError::Input(InputError::Length { .. }))
    ));
}
