//! Problems assembled by this crate against those assembled by GetFEM.
#![cfg(feature = "json")]

use std::path::{Path, PathBuf};

use semismooth::contact::{FullContact, PlanarCoulomb, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use serde_json::Value;

#[path = "../../examples/common/families.rs"]
mod families;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn follow(problem: FullContact<PlanarCoulomb>) -> Branch {
    let map = problem.condensed().unwrap();
    let start = map.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &start, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    branch
}

/// Sorted diagonal of A, sorted loads and gaps do not depend on the numbering; nor do the transitions of the load path.
fn agrees(ours: FullContact<PlanarCoulomb>, folder: &str) {
    let theirs = read_folder(data(folder)).unwrap();
    assert_eq!(ours.num_displacements(), theirs.num_displacements());
    assert_eq!(ours.num_contacts(), theirs.num_contacts());
    let sorted = |mut v: Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v
    };
    let close = |a: Vec<f64>, b: Vec<f64>| {
        let scale = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for (x, y) in sorted(a).iter().zip(&sorted(b)) {
            assert!((x - y).abs() <= 1e-12 * scale, "{x} {y}");
        }
    };
    let diagonal = |p: &FullContact<PlanarCoulomb>| -> Vec<f64> {
        (0..p.num_displacements())
            .map(|i| p.operator().get(i, i))
            .collect()
    };
    close(diagonal(&ours), diagonal(&theirs));
    for gamma in [0.0, 1.0] {
        close(ours.body().load_at(gamma), theirs.body().load_at(gamma));
    }
    let text = std::fs::read_to_string(data(folder).join("breakpoints_exact.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let events = json["events"].as_array().unwrap();
    let branch = follow(ours);
    assert_eq!(branch.transitions.len(), events.len());
    for (t, event) in branch.transitions.iter().zip(events) {
        let gamma = event["gamma"].as_f64().unwrap();
        assert!((t.parameter() - gamma).abs() <= 1e-9, "{} {gamma}", t.parameter());
        assert_eq!(t.is_fold(), event["fold"].as_bool().unwrap());
        let number = |key: &str| event[key].as_u64().unwrap() as usize;
        assert_eq!((t.sites[0].from, t.sites[0].to), (number("old"), number("new")));
    }
}

#[test]
fn vee() {
    agrees(families::vee(0).unwrap(), "tests/data/vee");
}

#[test]
fn block() {
    agrees(
        families::block([10, 20]).unwrap(),
        "examples/data/block_linear_10x20_F0.5",
    );
}

#[test]
fn refined_vee() {
    let problem = families::vee(2).unwrap();
    assert_eq!((problem.num_displacements(), problem.num_contacts()), (9170, 53));
    assert_eq!(follow(problem).transitions.len(), 206);
}

/// Changes of state of single nodes.
fn changes(branch: &Branch) -> usize {
    let sites = branch.transitions.iter().flat_map(|t| &t.sites);
    sites.filter(|c| c.from != c.to).count()
}

/// The numbers of an independent event-driven code. On the finer mesh two transitions coincide to rounding, and others are so close to
/// facets nearly parallel to the curve that these must not be treated as vanishing.
#[test]
fn refined_block() {
    for (n, free, contacts, expected) in [([40, 80], 6560, 41, 133), ([160, 64], 20608, 161, 532)] {
        let problem = families::block(n).unwrap();
        assert_eq!(
            (problem.num_displacements(), problem.num_contacts()),
            (free, contacts)
        );
        assert_eq!(changes(&follow(problem)), expected);
    }
}

#[test]
fn vee_refined_thrice() {
    let problem = families::vee(3).unwrap();
    assert_eq!(
        (problem.num_displacements(), problem.num_contacts()),
        (36102, 105)
    );
    assert_eq!(follow(problem).transitions.len(), 410);
}
