//! Runs interrupted after any event resume as if uninterrupted.
#![cfg(feature = "serde")]

use crate::common;
use semismooth::InputError;
use semismooth::contact::read_folder;
use semismooth::continuation::{
    Continuation, ContinuationError, ContinuationOptions, Direction, Event, SavedRun, Termination,
};
use semismooth::piecewise::{MinMap, PiecewiseSmooth};

type Events = Vec<Result<Event, ContinuationError>>;

fn through_json(saved: &SavedRun) -> SavedRun {
    let text = serde_json::to_string(saved).unwrap();
    let back: SavedRun = serde_json::from_str(&text).unwrap();
    // PartialEq would take −0 for 0.
    assert_eq!(format!("{back:?}"), format!("{saved:?}"));
    back
}

/// Interrupts the run after each of its events.
fn check<P: PiecewiseSmooth>(
    map: &P,
    x: &[f64],
    direction: Direction,
    options: &ContinuationOptions,
) -> Events {
    let start = || Continuation::new(map, x, direction.clone(), options.clone()).unwrap();
    let mut whole = start();
    let events: Events = whole.by_ref().collect();
    assert!(events.len() > 1);
    for k in 0..=events.len() {
        let mut run = start();
        let before: Events = run.by_ref().take(k).collect();
        let saved = run.save().unwrap();
        assert_eq!(saved.x(), run.point().x);
        let mut resumed = Continuation::resume(map, &through_json(&saved)).unwrap();
        let mut counts = Vec::new();
        let after: Events = resumed.by_ref().collect();
        let rest: Events = run.by_ref().collect();
        // Debug prints every bit, the sign of zero included.
        assert_eq!(format!("{after:?}"), format!("{rest:?}"), "after {k} events");
        for r in [&run, &resumed] {
            counts.push((r.factorisations(), r.corrections(), r.termination()));
        }
        assert_eq!(counts[0], counts[1]);
        assert_eq!(counts[1].2, whole.termination());
        let joined: Events = before.into_iter().chain(after).collect();
        if map.is_piecewise_affine() {
            // Saving recomputes the factors: the same events, to rounding.
            assert_eq!(joined.len(), events.len(), "after {k} events");
            for (a, b) in joined.iter().zip(&events) {
                let (a, b) = (a.as_ref().unwrap(), b.as_ref().unwrap());
                assert_eq!(std::mem::discriminant(a), std::mem::discriminant(b));
                let far = a
                    .x()
                    .iter()
                    .zip(b.x())
                    .map(|(a, b)| (a - b).abs() / (1.0 + b.abs()));
                assert!(far.fold(0.0, f64::max) < 1e-11);
            }
        } else {
            assert_eq!(format!("{joined:?}"), format!("{events:?}"), "after {k} events");
        }
    }
    events
}

fn has(events: &Events, what: impl Fn(&Event) -> bool) -> bool {
    events.iter().any(|e| what(e.as_ref().unwrap()))
}

#[test]
fn the_printed_examples() {
    let mut transitions = 0;
    for name in [
        "p1_ex1",
        "p1_ex2",
        "p1_ex3",
        "p1_ex4",
        "p2_ex1",
        "p2_ex2",
        "deg_apex_pass",
    ] {
        let case = common::cases().into_iter().find(|c| c.name == name).unwrap();
        let options = ContinuationOptions::default()
            .with_parameter_range((-12.0, 12.0))
            .with_targets(vec![1.0, 5.0])
            .with_max_growth(1e3);
        let full = &case.problem;
        for start in [full.stick_start(8.0).ok(), None] {
            let Ok(x) = full.solve(8.0, start.as_deref()) else {
                continue;
            };
            let events = check(full, &x, Direction::Decreasing, &options);
            transitions += usize::from(has(&events, |e| matches!(e, Event::Transition(_))));
        }
        let map = case.problem.condensed().unwrap();
        let x = map.solve(8.0, Some(&map.stick_start(8.0).unwrap())).unwrap();
        check(&map, &x, Direction::Decreasing, &options);
    }
    assert!(transitions >= 7, "{transitions}");
}

/// Many kinks between affine pieces, whose factors are updated from one to the next.
#[cfg(feature = "json")]
#[test]
fn a_load_path() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/vee");
    let map = read_folder(folder).unwrap().condensed().unwrap();
    let x = map.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let events = check(&map, &x, Direction::Increasing, &options);
    assert!(events.len() > 40);
}

#[test]
fn curved_pieces_folds_and_branch_points() {
    let range = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let kink = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0] * x[0] * (1.0 + x[0] / 3.0);
        b[0] = x[1] + x[0].sin();
    });
    check(&kink, &[0.5, 0.25], Direction::Decreasing, &range);
    let smooth = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1];
        b[0] = 1e9;
    });
    let events = check(&smooth, &[1.0, -1.0], Direction::Increasing, &range);
    assert!(has(&events, |e| matches!(e, Event::SmoothFold(_))));
    let pitchfork = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] * x[0] - x[1] * x[0];
        b[0] = 1e9;
    });
    let events = check(&pitchfork, &[0.0, -0.5], Direction::Increasing, &range);
    assert!(has(&events, |e| matches!(e, Event::BranchPoint(_))));
    let circle = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    });
    check(
        &circle,
        &[0.8, 0.6],
        Direction::Increasing,
        &ContinuationOptions::default(),
    );
}

#[test]
fn the_algorithm_that_switches() {
    let case = common::cases().into_iter().find(|c| c.name == "p1_ex1").unwrap();
    let x = case
        .problem
        .solve(10.0, Some(&case.problem.stick_start(10.0).unwrap()))
        .unwrap();
    let options = ContinuationOptions::haslinger_janovsky_ligursky().with_parameter_range((0.1, 10.0));
    check(&case.problem, &x, Direction::Decreasing, &options);
}

#[test]
fn limits_can_be_raised() {
    let circle = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    });
    let few = ContinuationOptions::default().with_max_points(7);
    let mut run = Continuation::new(&circle, &[0.8, 0.6], Direction::Increasing, few).unwrap();
    let mut events: Events = run.by_ref().collect();
    assert_eq!(run.termination(), Some(Termination::PointLimit));
    let saved = run.save().unwrap();
    assert_eq!(Continuation::resume(&circle, &saved).unwrap().count(), 0);
    // The state reports the last event.
    let last = events.last().unwrap().as_ref().unwrap();
    assert_eq!(
        (saved.x(), saved.parameter(), saved.arclength()),
        (last.x(), last.x()[1], last.arclength())
    );
    assert_eq!(saved.points(), 7);
    let mut more = saved.reopened();
    more.options_mut().max_points = 10_000;
    let mut resumed = Continuation::resume(&circle, &more).unwrap();
    events.extend(resumed.by_ref());
    assert_eq!(resumed.termination(), Some(Termination::Closed));
    let whole = Continuation::new(
        &circle,
        &[0.8, 0.6],
        Direction::Increasing,
        ContinuationOptions::default(),
    );
    assert_eq!(events, whole.unwrap().collect::<Events>());
}

#[test]
fn states_of_other_maps_are_refused() {
    let case = common::cases().into_iter().find(|c| c.name == "p1_ex1").unwrap();
    let x = case
        .problem
        .solve(10.0, Some(&case.problem.stick_start(10.0).unwrap()))
        .unwrap();
    let mut run = Continuation::new(
        &case.problem,
        &x,
        Direction::Decreasing,
        ContinuationOptions::default(),
    )
    .unwrap();
    let saved = run.save().unwrap();
    let other = common::cases().into_iter().find(|c| c.name == "p2_ex1").unwrap();
    assert!(matches!(
        Continuation::resume(&other.problem, &saved),
        Err(ContinuationError::Input(InputError::Length { .. }))
    ));
    // Damaged states: an invalid piece, lists of other lengths, an option out of range.
    let json = serde_json::to_value(&saved).unwrap();
    let damaged = |path: &[&str], value: serde_json::Value| {
        let mut json = json.clone();
        let place = path.iter().fold(&mut json, |v, key| match key.parse::<usize>() {
            Ok(index) => &mut v[index],
            Err(_) => &mut v[*key],
        });
        assert!(!place.is_null(), "{path:?}");
        *place = value;
        let state: SavedRun = serde_json::from_value(json).unwrap();
        Continuation::resume(&case.problem, &state)
            .expect_err("an error")
            .to_string()
    };
    for (path, value) in [
        (&["selection", "pieces", "0"][..], serde_json::json!(9)),
        (&["here", "x"], serde_json::json!([1.0])),
        (&["here", "theta"], serde_json::json!([])),
        (&["options", "step"], serde_json::json!(-1.0)),
    ] {
        assert!(!damaged(path, value).is_empty());
    }
    assert!(serde_json::from_value::<SavedRun>(serde_json::json!({})).is_err());
}

/// A circle that has been followed once around has no more points, even if limits are raised.
#[test]
fn curves_at_their_end_are_not_continued() {
    let circle = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    });
    let options = ContinuationOptions::default();
    let mut run = Continuation::new(&circle, &[0.8, 0.6], Direction::Increasing, options).unwrap();
    run.by_ref().for_each(|event| assert!(event.is_ok()));
    assert_eq!(run.termination(), Some(Termination::Closed));
    let again = run.save().unwrap().reopened();
    let mut resumed = Continuation::resume(&circle, &again).unwrap();
    assert_eq!(resumed.by_ref().count(), 0);
    assert_eq!(resumed.termination(), Some(Termination::Closed));
}
