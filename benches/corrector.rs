//! Corrector: iterations on the one-node friction model, and the cost of an iteration on large sparse problems in
//! factorisations of the same matrix.

use std::borrow::Cow;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use semismooth::contact::HildRenard;
use semismooth::linear::{LinearSolver, SparseLu};
use semismooth::newton::Newton;
use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection, select};
use semismooth::sparse::{Matrix, Pattern};

fn one_node(c: &mut Criterion) {
    let problem = HildRenard::new(1.5, -4.0, 1.0, 1.0).unwrap().problem().unwrap();
    let start = [0.3, 0.2, 0.1, 4.0, 3.0];
    let mut newton = Newton::default();
    let mut x = start;
    newton.solve(&problem, &mut x).unwrap();
    let steps = newton.report().history.len() as u64 - 1;
    let mut group = c.benchmark_group("corrector, one contact node");
    group.throughput(Throughput::Elements(steps));
    group.bench_function(format!("{steps} iterations"), |b| {
        b.iter(|| {
            let mut x = black_box(start);
            newton.solve(&problem, &mut x).unwrap();
            x
        });
    });
    group.finish();
}

/// Membrane over an obstacle: min(−Δv − c, v − ψ) = 0 on m × m points.
struct Obstacle {
    m: usize,
    pattern: Pattern,
}

impl Obstacle {
    fn new(m: usize) -> Self {
        let n = m * m;
        let neighbours = move |k: usize| {
            let (i, j) = (k / m, k % m);
            let mut list = vec![k];
            if i > 0 {
                list.push(k - m);
            }
            if i + 1 < m {
                list.push(k + m);
            }
            if j > 0 {
                list.push(k - 1);
            }
            if j + 1 < m {
                list.push(k + 1);
            }
            list
        };
        let entries = (0..n).flat_map(|k| neighbours(k).into_iter().map(move |l| (k, l)));
        Self {
            m,
            pattern: Pattern::from_entries(n, n, entries).unwrap(),
        }
    }

    fn balance(&self, k: usize, v: &[f64]) -> f64 {
        let m = self.m;
        let (i, j) = (k / m, k % m);
        let at = |inside: bool, l: usize| if inside { v[l] } else { 0.0 };
        4.0 * v[k]
            - at(i > 0, k.wrapping_sub(m))
            - at(i + 1 < m, k + m)
            - at(j > 0, k.wrapping_sub(1))
            - at(j + 1 < m, k + 1)
            + 8.0 / ((m + 1) * (m + 1)) as f64
    }

    fn obstacle(&self, k: usize) -> f64 {
        let h = 1.0 / (self.m + 1) as f64;
        let (x, y) = ((k / self.m + 1) as f64 * h, (k % self.m + 1) as f64 * h);
        -0.2 + 0.1 * (9.0 * x).sin() * (7.0 * y).sin()
    }
}

impl PiecewiseSmooth for Obstacle {
    fn num_vars(&self) -> usize {
        self.m * self.m
    }
    fn num_residuals(&self) -> usize {
        self.m * self.m
    }
    fn num_sites(&self) -> usize {
        self.m * self.m
    }
    fn num_pieces(&self, _: usize) -> usize {
        2
    }
    fn num_tests(&self, _: usize) -> usize {
        1
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        const FREE: [Facet; 1] = [Facet::positive(0)];
        const CONTACT: [Facet; 1] = [Facet::negative(0)];
        if piece == 0 { &FREE } else { &CONTACT }
    }
    fn piece_name(&self, _: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(["free", "contact"][piece])
    }
    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for k in 0..x.len() {
            out[k] = x[k] - self.obstacle(k) - self.balance(k, x);
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for k in 0..x.len() {
            out[k] = if s.piece(k) == 0 {
                self.balance(k, x)
            } else {
                x[k] - self.obstacle(k)
            };
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let m = self.m;
        for k in 0..x.len() {
            if s.piece(k) == 1 {
                jac.add(k, k, 1.0);
                continue;
            }
            let (i, j) = (k / m, k % m);
            jac.add(k, k, 4.0);
            for (inside, l) in [
                (i > 0, k.wrapping_sub(m)),
                (i + 1 < m, k + m),
                (j > 0, k.wrapping_sub(1)),
                (j + 1 < m, k + 1),
            ] {
                if inside {
                    jac.add(k, l, -1.0);
                }
            }
        }
    }
}

fn sparse(c: &mut Criterion) {
    for m in [100, 316] {
        let map = Obstacle::new(m);
        let n = m * m;
        let mut x = vec![0.0; n];
        let mut newton = Newton::default();
        newton.solve(&map, &mut x).unwrap();
        let selection = select(&map, &x);
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, &x, &mut jac);
        let mut lu = SparseLu::default();
        lu.analyze(jac.pattern().as_ref()).unwrap();
        let mut group = c.benchmark_group(format!("sparse, {n} unknowns"));
        group.sample_size(10);
        group.bench_function("one factorisation", |b| {
            b.iter(|| lu.factor(jac.as_ref()).unwrap())
        });
        let solved = x.clone();
        let mut rounds = 0;
        // One iteration: from a point off the solution, all pieces right.
        group.bench_function("one corrector iteration", |b| {
            b.iter(|| {
                let mut x = solved.clone();
                x.iter_mut().for_each(|v| *v += 1e-9);
                newton.solve(&map, &mut x).unwrap();
                rounds = newton.report().factorisations;
            });
        });
        println!("factorisations a solve: {rounds}");
        group.finish();
    }
}

criterion_group!(benches, one_node, sparse);
criterion_main!(benches);
