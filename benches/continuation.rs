//! Continuation: steps, located transitions, and whole load paths.

mod timing;

use std::path::Path;

use semismooth::contact::{CondensedFriction, FrictionStart, HildRenard, first_point, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use timing::Bench;

fn steps(bench: &mut Bench) {
    let problem = HildRenard::new(1.5, 7.0, 1.0, 1.0).unwrap().problem().unwrap();
    let start = first_point(&problem, 10.0, &FrictionStart::Stick).unwrap();
    let run = |h: f64, lower: f64| {
        let options = ContinuationOptions::default()
            .with_parameter_range((lower, 11.0))
            .with_step(h)
            .with_max_step(h);
        Branch::follow(&problem, &start, Direction::Decreasing, options).unwrap()
    };
    let count = run(0.01, 5.0).points.len() as u64;
    bench.time_each("one contact node/step inside a piece", count, || run(0.01, 5.0));
    bench.time("one contact node/to a transition and 0.1 beyond", || {
        run(6.0, 4.56)
    });
}

fn load_path(bench: &mut Bench) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["tests/data/vee", "examples/data/block"] {
        let Ok(folder) = read_folder(root.join(name)) else {
            println!("{name}: not there, skipped");
            continue;
        };
        bench.time(&format!("load path of {name} with condensation"), || {
            let map = CondensedFriction::new(folder.problem.clone()).unwrap();
            let start = first_point(&map, 0.0, &FrictionStart::Zero).unwrap();
            let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
            Branch::follow(&map, &start, Direction::Increasing, options).unwrap()
        });
    }
}

fn main() {
    timing::run("continuation", &[steps, load_path]);
}
