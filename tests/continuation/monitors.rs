//! Functions of the user monitored along a curve: each zero is found once, where it is, and nothing else changes.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use proptest::prelude::*;
use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction, Event, Termination};
use semismooth::piecewise::{MinMap, PiecewiseSmooth};

type Rows = fn(&[f64], &mut [f64], &mut [f64]);

/// α = |y|: `MinMap` does not declare its pieces affine, so that the curve is followed by steps.
fn wedge() -> MinMap<Rows> {
    MinMap::curve(1, |x, a, b| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    })
}

fn circle() -> MinMap<Rows> {
    MinMap::curve(1, |x, a, b| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 1e9;
    })
}

fn plain(curve: Continuation<'_, impl PiecewiseSmooth>) -> Branch {
    Branch::collect(curve, |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn zeros_on_a_circle() {
    let map = circle();
    for value in [-0.9, -0.3, 0.2, 0.7] {
        let curve = Continuation::new(
            &map,
            &[1.0, 0.0],
            Direction::Increasing,
            ContinuationOptions::default(),
        )
        .unwrap();
        let branch = plain(curve.with_monitor("height", move |x| x[0] - value));
        assert_eq!(branch.termination, Termination::Closed);
        let met = &branch.monitor_crossings;
        assert_eq!(met.len(), 2, "{value}");
        for (m, sign) in met.iter().zip([1.0, -1.0]) {
            assert_eq!((m.monitor, m.name.as_str()), (0, "height"));
            assert!((m.point.x[0] - value).abs() < 1e-14);
            assert!((m.point.parameter() - sign * (1.0 - value * value).sqrt()).abs() < 1e-13);
        }
    }
}

#[test]
fn a_zero_at_a_kink_is_met_once() {
    let map = wedge();
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let curve = Continuation::new(&map, &[0.5, 0.5], Direction::Decreasing, options).unwrap();
    let branch = plain(curve.with_monitor("y", |x| x[0]));
    assert_eq!(branch.transitions.len(), 1);
    assert_eq!(branch.monitor_crossings.len(), 1);
    assert!(branch.monitor_crossings[0].point.x[0].abs() < 1e-13);
    assert_eq!(branch.termination, Termination::ParameterRange);
}

#[test]
fn the_first_zero_stops() {
    let map = circle();
    let curve = Continuation::new(
        &map,
        &[1.0, 0.0],
        Direction::Increasing,
        ContinuationOptions::default(),
    )
    .unwrap();
    let branch = plain(
        curve
            .with_monitor("never", |_| f64::NAN)
            .with_stop("bottom", |x| x[0] + 0.5),
    );
    assert_eq!(branch.termination, Termination::Monitor);
    let last = branch.monitor_crossings.last().unwrap();
    assert_eq!(branch.monitor_crossings.len(), 1);
    assert_eq!(last.monitor, 1);
    assert!((last.point.parameter() - 0.75f64.sqrt()).abs() < 1e-13);
    assert!(branch.points.iter().all(|p| p.arclength <= last.point.arclength));
}

#[test]
fn another_thread_may_cancel() {
    let map = circle();
    let cancelled = AtomicBool::new(false);
    let curve = Continuation::new(
        &map,
        &[1.0, 0.0],
        Direction::Increasing,
        ContinuationOptions::default(),
    )
    .unwrap();
    let mut seen = 0;
    let branch = std::thread::scope(|scope| {
        Branch::collect(curve, |_| {
            seen += 1;
            if seen == 3 {
                scope
                    .spawn(|| cancelled.store(true, Ordering::Relaxed))
                    .join()
                    .unwrap();
            }
            if cancelled.load(Ordering::Relaxed) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
    })
    .unwrap();
    assert_eq!(
        (branch.termination, branch.points.len()),
        (Termination::Interrupted, 3)
    );
}

#[cfg(feature = "json")]
mod polygons {
    use semismooth::contact::read_folder;

    use super::*;

    /// On affine pieces the curve from kink to kink is straight, and a nonlinear monitor may vanish anywhere on it.
    #[test]
    fn zeros_between_the_kinks_of_a_load_path() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/vee");
        let map = read_folder(folder).unwrap().condensed().unwrap();
        let x = map.solve(0.0, None).unwrap();
        let options = || ContinuationOptions::default().with_parameter_range((0.0, 1.0));
        let start = || Continuation::new(&map, &x, Direction::Increasing, options()).unwrap();
        let without = plain(start());
        let p = map.num_sites();
        // The sum of the squared pressures of the nodes.
        let pressure = move |x: &[f64]| x[..p].iter().map(|v| v * v).sum::<f64>();
        let value = 0.5 * pressure(&without.points.last().unwrap().x);
        let with = plain(start().with_monitor("pressure", move |x| pressure(x) - value));
        assert_eq!(with.transitions.len(), without.transitions.len());
        for (a, b) in with.transitions.iter().zip(&without.transitions) {
            assert!((a.parameter() - b.parameter()).abs() < 1e-11);
        }
        // As many zeros as a dense sampling of the polygon without monitors shows.
        let corners: Vec<&[f64]> = without.polyline().into_iter().map(|c| c.1).collect();
        let mut crossings = Vec::new();
        for ends in corners.windows(2) {
            let at = |s: f64| -> Vec<f64> {
                ends[0]
                    .iter()
                    .zip(ends[1])
                    .map(|(a, b)| a + s * (b - a))
                    .collect()
            };
            for k in 0..1000 {
                let (a, b) = (at(k as f64 / 1000.0), at((k + 1) as f64 / 1000.0));
                if (pressure(&a) - value) * (pressure(&b) - value) < 0.0 {
                    crossings.push((a[2 * p], b[2 * p]));
                }
            }
        }
        assert!(!crossings.is_empty());
        assert_eq!(crossings.len(), with.monitor_crossings.len());
        for (m, (a, b)) in with.monitor_crossings.iter().zip(crossings) {
            let alpha = m.point.parameter();
            assert!(alpha >= a.min(b) - 1e-12 && alpha <= a.max(b) + 1e-12);
            assert!((pressure(&m.point.x) - value).abs() < 1e-12 * value);
        }
    }
}

/// Interrupted at any event, also at the zero itself, a run resumes as if uninterrupted.
#[test]
fn resumed_runs_know_the_side() {
    let map = circle();
    let monitor = |x: &[f64]| x[0] * x[1] - 0.1;
    let start = || {
        Continuation::new(
            &map,
            &[1.0, 0.0],
            Direction::Increasing,
            ContinuationOptions::default(),
        )
        .unwrap()
        .with_monitor("product", monitor)
    };
    let events: Vec<Event> = start().map(Result::unwrap).collect();
    let count = |e: &[Event]| e.iter().filter(|e| matches!(e, Event::Monitor(_))).count();
    assert_eq!(count(&events), 4);
    for k in 1..events.len() {
        let mut run = start();
        let before: Vec<Event> = run.by_ref().take(k).map(Result::unwrap).collect();
        let saved = run.save().unwrap();
        let resumed = Continuation::resume(&map, &saved)
            .unwrap()
            .with_monitor("product", monitor);
        let after: Vec<Event> = resumed.map(Result::unwrap).collect();
        assert_eq!([before, after].concat(), events, "after {k}");
    }
}

proptest! {
    /// Lines through the unit circle in any direction are met twice or not at all.
    #[test]
    fn lines_meet_the_circle_twice(angle in 0.0..std::f64::consts::TAU, distance in 0.0..2.0f64) {
        prop_assume!((distance - 1.0).abs() > 0.05);
        let map = circle();
        let (s, c) = angle.sin_cos();
        let options = ContinuationOptions::default().with_max_step(0.1);
        let curve = Continuation::new(&map, &[1.0, 0.0], Direction::Increasing, options).unwrap();
        let branch = plain(curve.with_monitor("line", move |x| c * x[0] + s * x[1] - distance));
        prop_assert_eq!(branch.monitor_crossings.len(), if distance < 1.0 { 2 } else { 0 });
    }
}
