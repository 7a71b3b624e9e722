//! Frictional contact in Delassus form: the small files in the data of the tests.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use semismooth::contact::{DelassusSolver, read_delassus};

fn delassus(c: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/friction");
    let solver = DelassusSolver::default();
    for name in [
        "Box_Stacks-i0122-82-5",
        "OneObject-i1028-138",
        "Spheres-i099-356-679",
        "fc2d_granularflowonwall_00667_00000",
    ] {
        let problem = read_delassus(folder.join(format!("{name}.json"))).expect(name);
        c.bench_function(name, |bench| {
            bench.iter(|| solver.solve(black_box(&problem)).expect(name));
        });
    }
}

criterion_group!(benches, delassus);
criterion_main!(benches);
