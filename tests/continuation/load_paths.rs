//! Load paths of problems assembled by another program, against breakpoints from exact arithmetic.
#![cfg(feature = "json")]

use std::path::{Path, PathBuf};

use semismooth::contact::{Contact, PlanarCoulomb, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::interface::View;
use serde_json::Value;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn check<V: View>(map: &Contact<V, PlanarCoulomb>, events: &[Value]) {
    let start = map.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(map, &start, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert_eq!(branch.transitions.len(), events.len());
    for (t, event) in branch.transitions.iter().zip(events) {
        let gamma = event["gamma"].as_f64().unwrap();
        assert!(
            (t.parameter() - gamma).abs() <= 1e-10,
            "{} {gamma}",
            t.parameter()
        );
        let change = t.sites[0];
        let number = |key: &str| event[key].as_u64().unwrap() as usize;
        assert_eq!(
            (change.site, change.from, change.to),
            (number("node"), number("old"), number("new"))
        );
        assert_eq!(t.is_fold(), event["fold"].as_bool().unwrap());
        assert!(t.complete);
    }
    let last = branch.points.last().unwrap();
    assert_eq!(last.parameter(), 1.0);
}

fn check_folder(name: &str, transitions: usize) {
    let folder = read_folder(data(name)).unwrap();
    let text = std::fs::read_to_string(data(name).join("breakpoints_exact.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let events = json["events"].as_array().unwrap();
    assert_eq!(events.len(), transitions);
    check(&folder.condensed().unwrap(), events);
    check(&folder, events);
}

#[test]
fn vee() {
    check_folder("tests/data/vee", 52);
}

#[test]
fn vee_folds() {
    let folder = read_folder(data("tests/data/vee")).unwrap();
    let map = folder.condensed().unwrap();
    let start = map.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &start, Direction::Increasing, options).unwrap();
    let folds = branch.folds();
    assert_eq!(folds.len(), 2);
    assert!((folds[0] - 0.4342114038349821).abs() < 1e-10);
    assert!((folds[1] - 0.3275188533060732).abs() < 1e-10);
}
