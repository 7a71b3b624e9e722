//! Saved runs in which one value was changed: refused, or continued on the curve.
#![cfg(feature = "serde")]

use super::maps::Plane;
use crate::common;
use crate::random::Random;
use semismooth::continuation::{Continuation, ContinuationError, ContinuationOptions, Direction, SavedRun};
use semismooth::piecewise::{Facet, MinMap, PiecewiseSmooth, value};
use serde_json::{Value, json};

/// The places of all values except the pending events, which are records, and the options, which are the user's.
fn places(v: &Value, path: &str, out: &mut Vec<String>) {
    match v {
        Value::Object(o) => o
            .iter()
            .filter(|(k, _)| !["queue", "options"].contains(&k.as_str()))
            .for_each(|(k, v)| places(v, &format!("{path}/{k}"), out)),
        Value::Array(a) if !a.is_empty() => a
            .iter()
            .enumerate()
            .for_each(|(k, v)| places(v, &format!("{path}/{k}"), out)),
        _ => out.push(path.into()),
    }
}

fn altered(v: &Value, random: &mut Random) -> Value {
    match v {
        Value::Number(n) if n.is_f64() => {
            let v = n.as_f64().unwrap();
            let all = [
                v * 1.001,
                v + 1.0,
                -v,
                0.0,
                v * 1e3,
                1e300,
                1e-300,
                v + 1e-6,
                v * std::f64::consts::SQRT_2,
            ];
            json!(all[random.below(all.len())])
        }
        Value::Number(n) => {
            let v = n.as_i64().unwrap_or(0);
            let all = [
                json!(v + 1),
                json!(0),
                json!(-v),
                json!(u64::MAX),
                json!(u64::MAX - 1),
            ];
            all[random.below(all.len())].clone()
        }
        _ => {
            let all = [
                json!(1),
                json!("End"),
                json!("StepTooSmall"),
                Value::Null,
                json!([]),
                json!([1.0]),
            ];
            all[random.below(all.len())].clone()
        }
    }
}

/// Resumes `count` altered states; gives how many were refused on reading, by the check, and how many went on.
fn alter<P: PiecewiseSmooth>(map: &P, x: &[f64], direction: Direction, count: usize) -> [usize; 3] {
    const FOLLOWED: usize = 25;
    let options = ContinuationOptions::default().with_parameter_range((-20.0, 20.0));
    let mut random = Random::new(1);
    let mut states = Vec::new();
    for taken in 0..12 {
        let mut run = Continuation::new(map, x, direction.clone(), options.clone()).unwrap();
        run.by_ref().take(taken).for_each(drop);
        states.push(serde_json::to_value(run.save().unwrap()).unwrap());
    }
    let mut fates = [0; 3];
    let mut r = vec![0.0; map.num_residuals()];
    for k in 0..count {
        let mut state = states[k % states.len()].clone();
        let mut all = Vec::new();
        places(&state, "", &mut all);
        let path = &all[random.below(all.len())];
        let place = state.pointer_mut(path).unwrap();
        let (before, after) = (place.clone(), altered(place, &mut random));
        *place = after.clone();
        let Ok(saved) = serde_json::from_value::<SavedRun>(state.clone()) else {
            fates[0] += 1;
            continue;
        };
        let waiting = state["queue"].as_array().map_or(0, Vec::len);
        let mut run = match Continuation::resume(map, &saved) {
            Ok(run) => run,
            Err(e) => {
                assert!(!e.to_string().is_empty());
                fates[1] += 1;
                continue;
            }
        };
        fates[2] += 1;
        run.by_ref().take(waiting).for_each(drop);
        for event in run.by_ref().take(FOLLOWED) {
            let Ok(event) = event else { break };
            value(map, event.x(), &mut r);
            let size = 1.0 + event.x().iter().fold(0.0f64, |a, v| a.max(v.abs()));
            let off = r.iter().fold(0.0f64, |a, v| a.max(v.abs())) / size;
            assert!(
                off < 1e-7,
                "{path}: {before} became {after}; followed {off:e} off the curve at {:?}",
                event.x()
            );
        }
        let _ = (run.point(), run.factorisations(), run.corrections(), run.save());
    }
    fates
}

#[test]
fn altered_states_are_refused_or_harmless() {
    let mut sum = [0; 3];
    let mut add = |fates: [usize; 3]| sum.iter_mut().zip(fates).for_each(|(s, f)| *s += f);
    let common_cases = common::cases();
    for name in ["p1_ex1", "p2_ex1"] {
        let case = common_cases.iter().find(|c| c.name == name).unwrap();
        let x = case
            .problem
            .solve(10.0, Some(&case.problem.stick_start(10.0).unwrap()))
            .unwrap();
        add(alter(&case.problem, &x, Direction::Decreasing, 2000));
    }
    let pitchfork = Plane::smooth(|y, a| [y * y * y - a * y, 3.0 * y * y - a, -y]);
    add(alter(&pitchfork, &[0.0, -0.97], Direction::Increasing, 1500));
    let fold = Plane::two(
        |y, a| [y * y + a, 2.0 * y, 1.0],
        |y, a| [2.0 * y * y - y + a, 4.0 * y - 1.0, 1.0],
        |y, _| [y, 1.0, 0.0],
    );
    add(alter(&fold, &[1.0, -1.0], Direction::Increasing, 1500));
    let grazing = Plane {
        affine: false,
        pieces: vec![|y, a| [y - y * a, 1.0 - a, -y], |y, a| {
            [2.0 * y + y * a, 2.0 + a, y]
        }],
        tests: vec![|y, _| [y, 1.0, 0.0]],
        cells: vec![vec![Facet::positive(0)], vec![Facet::negative(0)]],
    };
    add(alter(&grazing, &[0.0, -1.5], Direction::Increasing, 1500));
    let kinks = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for i in 0..2 {
            a[i] = x[2] - x[i] * x[i] - 0.1 * x[1 - i];
            b[i] = x[2] + x[i] + 0.3 * x[1 - i] * x[1 - i];
        }
    });
    add(alter(&kinks, &[0.9, 0.9, 0.9], Direction::Decreasing, 1500));
    assert_eq!(sum.iter().sum::<usize>(), 10_000);
    assert!(sum.iter().all(|s| *s > 100), "{sum:?}");
}

/// Counters next to the largest integer neither overflow nor matter.
#[test]
fn counters_that_are_full() {
    let map = Plane::smooth(|y, a| [y * y + a, 2.0 * y, 1.0]);
    let start = || {
        let options = ContinuationOptions::default().with_max_points(usize::MAX);
        Continuation::new(&map, &[1.0, -1.0], Direction::Increasing, options).unwrap()
    };
    let saved = serde_json::to_value(start().save().unwrap()).unwrap();
    let expected: Vec<_> = start().skip(1).take(30).map(Result::unwrap).collect();
    for name in ["creeping", "factorisations", "corrections"] {
        for full in [u64::MAX, u64::MAX - 1, u64::MAX - 20] {
            let mut state = saved.clone();
            state[name] = json!(full);
            let state: SavedRun = serde_json::from_value(state).unwrap();
            let mut run = Continuation::resume(&map, &state).unwrap();
            let found: Vec<_> = run.by_ref().skip(1).take(30).map(Result::unwrap).collect();
            assert_eq!(found, expected, "{name}");
            assert!(run.factorisations() > 0 && run.corrections() > 0);
        }
    }
}

/// y = 0 whatever the unit of y: no other value of the state contradicts a changed size; but sizes must be powers of two.
#[test]
fn a_typical_size_that_is_no_power_of_two() {
    let map = Plane::smooth(|y, _| [y, 1.0, 0.0]);
    let options = ContinuationOptions::default().with_typical_sizes(vec![1024.0, 1.0]);
    let mut run = Continuation::new(&map, &[0.0, 0.0], Direction::Increasing, options).unwrap();
    let saved = serde_json::to_value(run.save().unwrap()).unwrap();
    for size in [0.0, -2.0, 3.0] {
        let mut state = saved.clone();
        *state.pointer_mut("/sizes/0").unwrap() = json!(size);
        let state: SavedRun = serde_json::from_value(state).unwrap();
        match Continuation::resume(&map, &state) {
            Err(ContinuationError::Saved { what, .. }) => assert_eq!(what, "a typical size"),
            other => panic!("{size}: {:?}", other.map(|_| ())),
        }
    }
}

/// A tangent that is too long would lead off the affine pieces.
#[test]
fn a_tangent_that_is_too_long() {
    let case = common::cases().into_iter().find(|c| c.name == "p1_ex1").unwrap();
    let x = case
        .problem
        .solve(10.0, Some(&case.problem.stick_start(10.0).unwrap()))
        .unwrap();
    let options = ContinuationOptions::default();
    let mut run = Continuation::new(&case.problem, &x, Direction::Decreasing, options).unwrap();
    let saved = serde_json::to_value(run.save().unwrap()).unwrap();
    let refused = |path: &str, change: &dyn Fn(f64) -> f64| {
        let mut state = saved.clone();
        let place = state.pointer_mut(path).unwrap();
        let value = change(place.as_f64().unwrap());
        *place = if place.is_i64() {
            json!(value as i64)
        } else {
            json!(value)
        };
        let state: SavedRun = serde_json::from_value(state).unwrap();
        match Continuation::resume(&case.problem, &state) {
            Err(ContinuationError::Saved { what, .. }) => what,
            other => panic!("{path}: {:?}", other.map(|_| ())),
        }
    };
    // A point off the curve, in both kinds of variables.
    let mut state = saved.clone();
    for place in ["/x/0", "/here/x/0"] {
        let value = state.pointer(place).unwrap().as_f64().unwrap();
        *state.pointer_mut(place).unwrap() = json!(value + 1e-3 * (1.0 + value.abs()));
    }
    let state: SavedRun = serde_json::from_value(state).unwrap();
    match Continuation::resume(&case.problem, &state) {
        Err(ContinuationError::Saved { what, .. }) => assert_eq!(what, "the point"),
        other => panic!("{:?}", other.map(|_| ())),
    }
    let last = case.problem.num_vars() - 1;
    assert_eq!(
        refused(&format!("/here/t/{last}"), &|v| v + 1.0),
        "the length of the tangent"
    );
    assert_eq!(
        refused(&format!("/here/x/{last}"), &|v| v + 0.1),
        "the point in scaled variables"
    );
    assert_eq!(refused("/here/orientation", &|v| -v), "an orientation");
    assert_eq!(refused("/here/theta/0", &|v| v + 0.1), "a test function");
    assert_eq!(
        refused(&format!("/start/{last}"), &|v| v + 0.1),
        "the size of the start"
    );
}
