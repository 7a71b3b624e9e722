//! Complementarity: obstacle problems nested over grids and from a cold start, dense LCPs, exponential families, small LCPs.

#[path = "../examples/common/obstacles.rs"]
mod obstacles;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use obstacles::{Problem, nested};
use semismooth::complementarity::active_set::{ActiveSetOptions, ActiveSetSolver};
use semismooth::complementarity::pivoting::Lemke;
use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

/// Uniform in [-1, 1).
fn next(state: &mut u64) -> f64 {
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    let bits = state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
    bits as f64 / (1_u64 << 52) as f64 - 1.0
}

fn grids(c: &mut Criterion) {
    let options = ActiveSetOptions::default();
    let mut group = c.benchmark_group("obstacle");
    group.sample_size(10);
    for problem in [Problem::Mcplib, Problem::Hemisphere, Problem::Torsion] {
        for m in [100, 400, 800] {
            let nested = nested(problem, m).unwrap();
            let mut z = vec![0.0; m * m];
            let report = nested.solve(&options, &mut z).unwrap();
            assert_eq!(report.status(), Status::Solved);
            let most = report.levels.iter().map(|l| l.report.iterations).max();
            println!("{}, m = {m}: at most {most:?} iterations a level", problem.name());
            group.bench_function(BenchmarkId::new(format!("nested {}", problem.name()), m), |b| {
                b.iter(|| nested.solve(&options, &mut z).unwrap())
            });
        }
        for m in [100, 400] {
            let lcp = problem.lcp(m).unwrap();
            let start: Vec<f64> = lcp.lower().iter().map(|l| l.max(0.0)).collect();
            let mut solver = ActiveSetSolver::default();
            let mut z = start.clone();
            println!(
                "{}, m = {m}: {:?}",
                problem.name(),
                solver.solve(&lcp, &mut z).unwrap()
            );
            group.bench_function(
                BenchmarkId::new(format!("from max(0, lower) {}", problem.name()), m),
                |b| {
                    b.iter(|| {
                        z.copy_from_slice(&start);
                        solver.solve(&lcp, &mut z).unwrap()
                    });
                },
            );
            let mut general = McpSolver::default();
            group.bench_function(BenchmarkId::new(format!("general {}", problem.name()), m), |b| {
                b.iter(|| {
                    z.copy_from_slice(&start);
                    assert!(general.solve(lcp.mcp(), &mut z).unwrap().is_solved());
                });
            });
        }
    }
    group.finish();
}

/// AᵀA + B + D with A, B in [-5, 5], B skew, D in [0, 0.3], q in [-500, 500] (P. T. Harker, J.-S. Pang, 1990).
fn harker_pang(n: usize) -> Lcp {
    let mut s = 7;
    let a: Vec<f64> = (0..n * n).map(|_| 5.0 * next(&mut s)).collect();
    let mut m = vec![0.0; n * n];
    for (i, row) in a.chunks_exact(n).enumerate() {
        for (j, other) in a.chunks_exact(n).enumerate() {
            m[j * n + i] = row.iter().zip(other).map(|(x, y)| x * y).sum();
        }
    }
    for i in 0..n {
        for j in 0..i {
            let b = 5.0 * next(&mut s);
            m[j * n + i] += b;
            m[i * n + j] -= b;
        }
        m[i * n + i] += 0.15 * (next(&mut s) + 1.0);
    }
    let q = (0..n).map(|_| 500.0 * next(&mut s)).collect();
    Lcp::new(Matrix::from_values(Pattern::full(n, n), m).unwrap(), q).unwrap()
}

fn family(n: usize, entry: impl Fn(usize, usize) -> f64) -> Lcp {
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    Lcp::new(Matrix::from_rows(&rows).unwrap(), vec![-1.0; n]).unwrap()
}

fn dense(c: &mut Criterion) {
    let mut group = c.benchmark_group("dense");
    group.sample_size(10);
    let fathi = |i: usize, j: usize| 4.0 * i.min(j) as f64 + if i == j { 1.0 } else { 2.0 };
    let murty = |i: usize, j: usize| [0.0, 1.0, 2.0][usize::from(i >= j) + usize::from(i > j)];
    for (name, lcp) in [
        ("Harker-Pang 1000", harker_pang(1000)),
        ("Fathi 1000", family(1000, fathi)),
        ("Murty 40", family(40, murty)),
    ] {
        let mut z = vec![0.0; lcp.len()];
        let mut solver = ActiveSetSolver::default();
        let report = solver.solve(&lcp, &mut z).unwrap();
        assert_eq!(report.status, Status::Solved);
        println!("{name}: {report:?}");
        group.bench_function(BenchmarkId::new("active sets", name), |b| {
            b.iter(|| {
                z.fill(0.0);
                solver.solve(&lcp, &mut z).unwrap()
            });
        });
    }
    let lcp = harker_pang(1000);
    let mut z = vec![0.0; 1000];
    let mut lemke = Lemke::default();
    group.bench_function("Lemke/Harker-Pang 1000", |b| {
        b.iter(|| lemke.solve(&lcp, &mut z).unwrap())
    });
    group.finish();
}

fn small(c: &mut Criterion) {
    let mut group = c.benchmark_group("small, solver reused");
    for n in [5, 10, 20] {
        let lcp = harker_pang(n);
        let mut z = vec![0.0; n];
        let mut lemke = Lemke::default();
        assert_eq!(lemke.solve(&lcp, &mut z).unwrap().status, Status::Solved);
        group.bench_function(BenchmarkId::new("Lemke", n), |b| {
            b.iter(|| lemke.solve(&lcp, &mut z).unwrap())
        });
        let mut sets = ActiveSetSolver::default();
        group.bench_function(BenchmarkId::new("active sets", n), |b| {
            b.iter(|| {
                z.fill(0.0);
                sets.solve(&lcp, &mut z).unwrap()
            });
        });
        let mut newton = McpSolver::default();
        group.bench_function(BenchmarkId::new("McpSolver", n), |b| {
            b.iter(|| {
                z.fill(0.0);
                newton.solve(lcp.mcp(), &mut z).unwrap().is_solved()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, small, dense, grids);
criterion_main!(benches);
