//! Factorisations and solves.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use semismooth::linear::{Bordered, Cholesky, DenseLu, LinearSolver, SparseLu};
use semismooth::sparse::{Matrix, Pattern};

fn dense(m: usize, n: usize) -> Matrix {
    let values = (0..m * n)
        .map(|k| (k as f64 * 1.37).sin() + if k % (m + 1) == 0 { 3.0 } else { 0.0 })
        .collect();
    match Matrix::from_values(Pattern::full(m, n), values) {
        Ok(a) => a,
        Err(e) => panic!("{e}"),
    }
}

/// The five-point Laplacian on an m × m grid.
fn laplacian(m: usize) -> Matrix {
    let mut t = Vec::new();
    for k in 0..m * m {
        t.push((k, k, 4.0));
        if k % m > 0 {
            t.extend([(k, k - 1, -1.0), (k - 1, k, -1.0)]);
        }
        if k >= m {
            t.extend([(k, k - m, -1.0), (k - m, k, -1.0)]);
        }
    }
    match Matrix::from_triplets(m * m, m * m, &t) {
        Ok(a) => a,
        Err(e) => panic!("{e}"),
    }
}

fn run<S: LinearSolver>(c: &mut Criterion, name: &str, a: &Matrix, mut solver: S) {
    let n = a.nrows();
    solver.analyze(a.pattern().as_ref()).expect(name);
    let b: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
    let mut x = b.clone();
    let mut group = c.benchmark_group(name);
    if n > 1000 {
        group.sample_size(10);
    }
    group.bench_function("factor + solve", |bench| {
        bench.iter(|| {
            solver.factor(black_box(a.as_ref())).expect(name);
            x.copy_from_slice(&b);
            solver.solve_in_place(black_box(&mut x)).expect(name);
        });
    });
    group.bench_function("solve", |bench| {
        bench.iter(|| {
            x.copy_from_slice(&b);
            solver.solve_in_place(black_box(&mut x)).expect(name);
        });
    });
    group.bench_function("solve 32", |bench| {
        let block: Vec<f64> = b.repeat(32);
        bench.iter_batched(
            || block.clone(),
            |mut x| solver.solve_in_place(black_box(&mut x)).expect(name),
            BatchSize::LargeInput,
        );
    });
}

fn linear(c: &mut Criterion) {
    for n in [4, 20, 100, 200] {
        run(c, &format!("dense LU {n}"), &dense(n, n), DenseLu::new());
    }
    let h = dense(4, 5);
    let mut bordered = Bordered::new(h.pattern(), DenseLu::new()).expect("bordered");
    c.bench_function("bordered 4", |bench| {
        let (t, mut x) = ([0.1, 0.2, 0.3, 0.4, 0.5], [0.0; 5]);
        bench.iter(|| {
            bordered.factor(black_box(&h), Some(&t)).expect("bordered");
            bordered.solve(&[1.0; 4], &t, 0.0, &mut x).expect("bordered");
        });
    });
    for m in [14, 100, 316] {
        let a = laplacian(m);
        let n = m * m;
        run(c, &format!("sparse LU {n}"), &a, SparseLu::new());
        if m < 300 {
            let columns = SparseLu::with_determinants();
            run(c, &format!("sparse LU with determinants {n}"), &a, columns);
        }
        run(c, &format!("Cholesky {n}"), &a, Cholesky::new());
    }
    let a = laplacian(14);
    run(c, "dense LU of the Laplacian 196", &a, DenseLu::new());
}

criterion_group!(benches, linear);
criterion_main!(benches);
