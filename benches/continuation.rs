//! Continuation: steps, located transitions, and whole load paths.

use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use semismooth::contact::{HildRenard, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};

fn steps(c: &mut Criterion) {
    let problem = HildRenard::new(1.5, 7.0, 1.0, 1.0).unwrap().problem().unwrap();
    let start = problem
        .solve(10.0, Some(&problem.stick_start(10.0).unwrap()))
        .unwrap();
    let run = |h: f64, lower: f64| {
        let options = ContinuationOptions::default()
            .with_parameter_range((lower, 11.0))
            .with_step(h)
            .with_max_step(h);
        Branch::follow(&problem, &start, Direction::Decreasing, options).unwrap()
    };
    let mut group = c.benchmark_group("one contact node");
    let count = run(0.01, 5.0).points.len() as u64;
    group.throughput(Throughput::Elements(count));
    group.bench_function("steps inside a piece", |b| b.iter(|| run(0.01, 5.0)));
    group.throughput(Throughput::Elements(1));
    group.bench_function("to a transition and 0.1 beyond", |b| b.iter(|| run(6.0, 4.56)));
    group.finish();
}

fn load_path(c: &mut Criterion) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["tests/data/vee", "examples/data/block"] {
        let Ok(folder) = read_folder(root.join(name)) else {
            println!("{name}: not there, skipped");
            continue;
        };
        c.bench_function(&format!("load path of {name}, condensation included"), |b| {
            b.iter(|| {
                let map = folder.condensed().unwrap();
                let start = map.solve(0.0, None).unwrap();
                let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
                Branch::follow(&map, &start, Direction::Increasing, options).unwrap()
            });
        });
    }
}

criterion_group!(benches, steps, load_path);
criterion_main!(benches);
