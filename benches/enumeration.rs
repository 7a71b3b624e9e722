//! Enumeration: all solutions of random planar friction problems, all arms at a degenerate point.

use std::path::Path;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use semismooth::complementarity::Lcp;
use semismooth::contact::{
    CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb, read_folder,
};
use semismooth::enumeration::{EnumerationOptions, all_arms, all_solutions};
use semismooth::piecewise::PiecewiseSmooth;
#[cfg(feature = "autodiff")]
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
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

/// A linear complementarity problem of any kind, every third one between bounds.
fn complementarity(seed: u64) -> Lcp {
    let mut s = seed;
    let n = 1 + (seed % 8) as usize;
    let rows: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| next(&mut s)).collect()).collect();
    let q: Vec<f64> = (0..n).map(|_| next(&mut s)).collect();
    let m = Matrix::from_rows(&rows).unwrap();
    match seed % 3 {
        0 => Lcp::boxed(m, q, vec![-1.0; n], vec![1.0; n]).unwrap(),
        _ => Lcp::new(m, q).unwrap(),
    }
}

/// k tunnel diodes in series, from their formula: i = G(v), the sum of the voltages 1 + 3 k / 4.
#[cfg(feature = "autodiff")]
struct Diodes(usize);

#[cfg(feature = "autodiff")]
impl NonsmoothFunction for Diodes {
    fn num_vars(&self) -> usize {
        self.0 + 1
    }
    fn num_residuals(&self) -> usize {
        self.0 + 1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let k = self.0;
        let mut sum = x[k] - (1.0 + 0.75 * k as f64);
        for (d, row) in out.iter_mut().take(k).enumerate() {
            let peak = kinks.positive_part(x[d] - 1.0);
            let valley = kinks.positive_part(x[d] - 3.0);
            let scale = 1.0 + 0.05 * d as f64;
            *row = x[k] - (x[d] * 2.0 - peak * 2.75 + valley * 1.75) * scale;
            sum += x[d];
        }
        out[k] = sum;
    }
}

/// Many lists, each computed once: a line of figures, and their total time.
fn lists(c: &mut Criterion, name: &str, maps: &[Box<dyn PiecewiseSmooth>]) {
    let options = EnumerationOptions::default();
    let (mut solutions, mut complete, mut slowest) = (0, 0, Duration::ZERO);
    let begun = Instant::now();
    for map in maps {
        let own = Instant::now();
        let set = all_solutions(map.as_ref(), 0.0, &options).unwrap();
        slowest = slowest.max(own.elapsed());
        solutions += set.solutions.len();
        complete += usize::from(set.completeness.is_complete());
    }
    let time = begun.elapsed();
    println!(
        "{name}: {} lists, {complete} complete, {solutions} solutions, {time:.1?} in all, slowest {slowest:.2?}",
        maps.len()
    );
    let mut group = c.benchmark_group("lists");
    group.sample_size(10);
    group.bench_function(name, |b| {
        b.iter(|| {
            let lists = maps
                .iter()
                .map(|m| all_solutions(m.as_ref(), 0.0, &options).unwrap().solutions.len());
            lists.sum::<usize>()
        });
    });
    group.finish();
}

fn many(c: &mut Criterion) {
    let nodes: Vec<Box<dyn PiecewiseSmooth>> = (1..=308)
        .map(|s| Box::new(friction(1 + s as usize % 3, 1000 + s)) as Box<dyn PiecewiseSmooth>)
        .collect();
    lists(c, "friction, 1 to 3 nodes", &nodes);
    let problems: Vec<Box<dyn PiecewiseSmooth>> = (1..=137)
        .map(|s| Box::new(complementarity(s).mcp().clone()) as Box<dyn PiecewiseSmooth>)
        .collect();
    lists(c, "complementarity, n up to 8", &problems);
    #[cfg(feature = "autodiff")]
    {
        let chains: Vec<Box<dyn PiecewiseSmooth>> = (1..=8)
            .map(|k| Box::new(Traced::new(Diodes(k))) as Box<dyn PiecewiseSmooth>)
            .collect();
        lists(c, "diodes in series, 1 to 8", &chains);
    }
}

fn arms(c: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/block_symmetric");
    let map = read_folder(folder).unwrap().condensed().unwrap();
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

criterion_group!(benches, all, many, arms);
criterion_main!(benches);
