//! Saved runs in which one value was changed, or that are resumed with another map: refused.
#![cfg(feature = "serde")]

use super::maps::Plane;
use crate::common;
use crate::random::Random;
use semismooth::continuation::{Continuation, ContinuationError, ContinuationOptions, Direction, SavedRun};
use semismooth::piecewise::PiecewiseSmooth;
use serde_json::{Value, json};

/// The places of all values except the options, which are the user's.
fn places(v: &Value, path: &str, out: &mut Vec<String>) {
    match v {
        Value::Object(o) => o
            .iter()
            .filter(|(k, _)| *k != "options")
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
            let all = [v * (1.0 + f64::EPSILON), v + 1.0, -v, 0.0, 1e300, 1e-300];
            json!(all[random.below(all.len())])
        }
        Value::Number(n) => {
            let v = n.as_i64().unwrap_or(0);
            let all = [json!(v + 1), json!(0), json!(-v), json!(u64::MAX)];
            all[random.below(all.len())].clone()
        }
        _ => {
            let all = [json!(1), json!("End"), Value::Null, json!([]), json!([1.0])];
            all[random.below(all.len())].clone()
        }
    }
}

/// States after each of the first events of a run.
fn states<P: PiecewiseSmooth>(map: &P, x: &[f64], direction: &Direction) -> Vec<Value> {
    let options = ContinuationOptions::default().with_parameter_range((-20.0, 20.0));
    let state = |taken: usize| {
        let mut run = Continuation::new(map, x, direction.clone(), options.clone()).unwrap();
        run.by_ref().take(taken).for_each(drop);
        serde_json::to_value(run.save().unwrap()).unwrap()
    };
    (0..12).map(state).collect()
}

#[test]
fn altered_states_are_refused() {
    let mut random = Random::new(1);
    let case = common::cases().into_iter().find(|c| c.name == "p2_ex1").unwrap();
    let stick = case.problem.stick_start(10.0).unwrap();
    let x = case.problem.solve(10.0, Some(&stick)).unwrap();
    let states = states(&case.problem, &x, &Direction::Decreasing);
    let mut read = 0;
    for k in 0..2000 {
        let mut state = states[k % states.len()].clone();
        let original: SavedRun = serde_json::from_value(state.clone()).unwrap();
        assert!(k >= states.len() || Continuation::resume(&case.problem, &original).is_ok());
        let mut all = Vec::new();
        places(&state, "", &mut all);
        let place = state.pointer_mut(&all[random.below(all.len())]).unwrap();
        *place = altered(place, &mut random);
        if let Ok(saved) = serde_json::from_value::<SavedRun>(state)
            && saved != original
        {
            read += 1;
            let resumed = Continuation::resume(&case.problem, &saved);
            assert!(matches!(resumed, Err(ContinuationError::Saved)));
        }
    }
    assert!(read > 500, "{read}");
}

/// The same pieces, sites and numbers of variables, but another curve.
#[test]
fn states_of_another_map_are_refused() {
    let map = Plane::smooth(|y, a| [y * y * y - a * y, 3.0 * y * y - a, -y]);
    let other = Plane::smooth(|y, a| [y * y * y - a * y + 1e-2, 3.0 * y * y - a, -y]);
    for state in states(&map, &[0.0, -0.97], &Direction::Increasing) {
        let state: SavedRun = serde_json::from_value(state).unwrap();
        assert!(Continuation::resume(&map, &state).is_ok());
        assert!(matches!(
            Continuation::resume(&other, &state),
            Err(ContinuationError::OtherMap { .. })
        ));
    }
}
