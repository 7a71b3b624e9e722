//! Frictional contact in Delassus form: the small files that come with the tests.

mod timing;

use std::hint::black_box;
use std::path::Path;

use semismooth::contact::{DelassusSolver, read_delassus};
use timing::Bench;

fn delassus(bench: &mut Bench) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/friction");
    let solver = DelassusSolver::default();
    for name in [
        "Box_Stacks-i0122-82-5",
        "OneObject-i1028-138",
        "Spheres-i099-356-679",
        "fc2d_granularflowonwall_00667_00000",
    ] {
        let problem = read_delassus(folder.join(format!("{name}.json"))).expect(name);
        bench.time(name, || solver.solve(black_box(&problem)).expect(name));
    }
}

fn main() {
    timing::run("delassus", &[delassus]);
}
