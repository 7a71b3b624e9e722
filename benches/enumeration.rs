//! Enumeration: all solutions of random planar friction problems, all arms at a degenerate point.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use semismooth::contact::{
    CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb, read_folder,
};
use semismooth::enumeration::{EnumerationOptions, all_arms, all_solutions};
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sparse::Matrix;

/// Uniform in [-1, 1).
fn next(state: &mut u64) -> f64 {
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    let bits = state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
    bits as f64 / (1_u64 << 52) as f64 - 1.0
}

/// p contact nodes with two displacements each, a random positive definite stiffness, F = 1.
fn friction(p: usize, seed: u64) -> CondensedContact<PlanarCoulomb> {
    let (n, mut s) = (2 * p, seed);
    let g: Vec<f64> = (0..n * n).map(|_| next(&mut s)).collect();
    let entry = |i: usize, j: usize| {
        let dot: f64 = (0..n).map(|k| g[i * n + k] * g[j * n + k]).sum();
        dot / n as f64 + if i == j { 0.3 } else { 0.0 }
    };
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let pick = |offset: usize| -> Matrix {
        let rows: Vec<Vec<f64>> = (0..p)
            .map(|i| (0..n).map(|j| f64::from(j == 2 * i + offset)).collect())
            .collect();
        Matrix::from_rows(&rows).unwrap()
    };
    let load: Vec<f64> = (0..n).map(|_| 3.0 * next(&mut s)).collect();
    let problem = FullContact::planar(
        Matrix::from_rows(&rows).unwrap(),
        pick(0),
        pick(1),
        LoadPath::constant(load),
        FrictionCoefficient::nodal(vec![1.0; p]).unwrap(),
    );
    problem.unwrap().condensed().unwrap()
}

fn all(c: &mut Criterion) {
    let options = EnumerationOptions::default();
    let mut group = c.benchmark_group("all solutions, planar friction");
    group.sample_size(10);
    for p in [4, 8, 12] {
        let map = friction(p, 7);
        let set = all_solutions(&map, 0.0, &options).unwrap();
        println!(
            "p = {p}: {} solutions, {} nodes, {} pivots, {:?}",
            set.solutions.len(),
            set.nodes,
            set.pivots,
            set.completeness
        );
        group.bench_function(BenchmarkId::from_parameter(p), |b| {
            b.iter(|| all_solutions(&map, 0.0, &options).unwrap());
        });
    }
    group.finish();
}

fn arms(c: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/block_symmetric");
    let map = read_folder(folder).unwrap().problem.condensed().unwrap();
    let mut x = vec![0.0; map.num_vars()];
    x[map.num_vars() - 1] = 0.5;
    let options = EnumerationOptions::default();
    let found = all_arms(&map, &x, &options).unwrap();
    println!(
        "11 grazing nodes: {} arms, {} nodes",
        found.arms.len(),
        found.nodes
    );
    let mut group = c.benchmark_group("all arms");
    group.sample_size(10);
    group.bench_function("11 grazing nodes", |b| {
        b.iter(|| all_arms(&map, &x, &options).unwrap())
    });
    group.finish();
}

criterion_group!(benches, all, arms);
criterion_main!(benches);
