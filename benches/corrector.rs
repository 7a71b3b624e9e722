//! Corrector: time to 1e-12 by class of problem and method, and the cost of an iteration compared with that of its parts (evaluation,
//! factorisation, solve), dense with 2 to 500 unknowns and sparse with 1 000 to 1 000 000.

// Modules of the examples, included with their dependencies.
#![allow(clippy::duplicate_mod)]

#[macro_use]
#[path = "../examples/common/mod.rs"]
mod common;
#[path = "../examples/common/classes.rs"]
#[allow(dead_code)]
mod classes;
#[path = "../examples/common/cones.rs"]
mod cones;
#[path = "../examples/common/contenders.rs"]
#[allow(dead_code)]
mod contenders;
#[path = "../examples/common/equations.rs"]
mod equations;
#[path = "../examples/common/expressions.rs"]
mod expressions;
#[path = "../examples/common/inequalities.rs"]
mod inequalities;
#[path = "../examples/common/obstacles.rs"]
mod obstacles;
#[path = "../examples/common/textbook.rs"]
mod textbook;

use std::cell::Cell;
use std::hint::black_box;
use std::time::{Duration, Instant};

use classes::{Sizes, classes, complementarity, variational};
use common::Random;
use contenders::Run;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::contact::HildRenard;
use semismooth::linear::{AutoSolver, LinearError, LinearSolver};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
use semismooth::sparse::{Matrix, MatrixRef, Pattern, PatternRef};

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

/// Residual, relative to that of the start, at which a method counts as converged.
const ARRIVED: f64 = 1e-12;

/// Runs that take longer are timed once, in seconds.
const SLOW: f64 = 0.1;

const SIZES: Sizes = Sizes {
    files: false,
    linear: 4,
    orders: &[20],
    grids: &[31],
    friction: [6, 6],
    bar: 20,
    contacts: 30,
    states: &[31],
    controls: &[63],
    pixels: &[32],
    pipes: &[3],
    plastic: &[1],
};

/// Prefixes of the names of the problems that represent their kind.
const CHOSEN: [&str; 20] = [
    "skew",
    "monotone",
    "triangular",
    "indefinite",
    "obstacle hemisphere",
    "obstacle torsion",
    "kojshin",
    "vi_obstacle_string20",
    "one node of Hild and Renard, at 4",
    "elastic block, at 0.5",
    "bar whose friction weakens, at 1.5",
    "random body 5",
    "state constraint 31 x 31, gamma = 1e4",
    "plastic strip, mesh 1, load 1",
    "sparse control",
    "paste in a pipe, mesh 3, gamma = 1e3",
    "picture 32 x 32, threshold 1e-2",
    "soc_size12_public",
    "OneObject",
    "random contacts 5",
];

/// Time of a run in milliseconds, if it converges.
fn milliseconds(run: &Run) -> Option<f64> {
    (run.residual <= ARRIVED * run.first).then_some(1e3 * run.seconds)
}

fn to_solution(c: &mut Criterion) {
    let (problems, inequalities) = (complementarity(&SIZES).unwrap(), variational().unwrap());
    let mut table = Vec::new();
    for class in classes(&SIZES, &problems, &inequalities).unwrap() {
        for prefix in CHOSEN {
            let Some((name, run)) = class.problems.iter().find(|p| p.0.starts_with(prefix)) else {
                continue;
            };
            let mut group = c.benchmark_group(format!("to 1e-12, {}: {name}", class.title));
            group.sample_size(10).measurement_time(Duration::from_millis(300));
            group.warm_up_time(Duration::from_millis(50));
            let mut times = Vec::new();
            for (k, method) in class.methods.iter().enumerate() {
                let best = (0..3).filter_map(|_| milliseconds(&run(k).unwrap()));
                let best = best.reduce(f64::min);
                times.push(best);
                if best.is_some_and(|t| t < 1e3 * SLOW) {
                    group.bench_function(*method, |b| {
                        b.iter_custom(|rounds| {
                            let seconds: f64 = (0..rounds).map(|_| run(k).unwrap().seconds).sum();
                            Duration::from_secs_f64(seconds)
                        });
                    });
                }
            }
            group.finish();
            let usual = class.methods.iter().position(|m| *m == class.usual);
            let quickest = (0..times.len())
                .filter(|k| times[*k].is_some())
                .min_by(|a, b| times[*a].partial_cmp(&times[*b]).unwrap());
            let cell = |k: Option<usize>| match k.and_then(|k| times[k].map(|t| (t, class.methods[k]))) {
                Some((t, method)) => format!("{t:9.3}  {method}"),
                None => "        -".to_owned(),
            };
            let arrived = times.iter().flatten().count();
            table.push(format!(
                "{name:42} {:2} of {:2} {:56} {}",
                arrived,
                times.len(),
                cell(quickest),
                cell(usual)
            ));
        }
    }
    println!(
        "\nmilliseconds to 1e-12, the least of three: how many methods converge, the fastest, the default"
    );
    table.iter().for_each(|line| println!("{line}"));
}

/// Accumulated time of one part of an iteration.
#[derive(Default)]
struct Watch(Cell<Duration>);

impl Watch {
    fn time<T>(&self, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = work();
        self.0.set(self.0.get() + begun.elapsed());
        result
    }
}

/// A map with timed evaluations.
struct TimedMap<'w, P> {
    map: P,
    watch: &'w Watch,
}

impl<P: PiecewiseSmooth> PiecewiseSmooth for TimedMap<'_, P> {
    fn num_vars(&self) -> usize {
        self.map.num_vars()
    }
    fn num_residuals(&self) -> usize {
        self.map.num_residuals()
    }
    fn num_sites(&self) -> usize {
        self.map.num_sites()
    }
    fn num_pieces(&self, site: usize) -> usize {
        self.map.num_pieces(site)
    }
    fn num_tests(&self, site: usize) -> usize {
        self.map.num_tests(site)
    }
    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.map.cell(site, piece)
    }
    fn pattern(&self) -> Pattern {
        self.map.pattern()
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.watch.time(|| self.map.test_functions(x, out));
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        self.watch.time(|| self.map.residual(s, x, out));
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        self.watch.time(|| self.map.jacobian(s, x, jac));
    }
}

struct TimedSolver<'w> {
    solver: AutoSolver,
    factorisation: &'w Watch,
    solve: &'w Watch,
}

impl LinearSolver for TimedSolver<'_> {
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
        self.solver.analyze(pattern)
    }
    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        self.factorisation.time(|| self.solver.factor(a))
    }
    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve.time(|| self.solver.solve_in_place(b))
    }
    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solver.solve_transpose_in_place(b)
    }
}

/// A linear complementarity problem z ≥ 0, M z + q ≥ 0 with a solution at which about half of the components vanish, and a point near it.
struct Sample {
    name: String,
    map: Mcp<AffineFunction>,
    start: Vec<f64>,
}

/// M positive definite and full.
fn dense(n: usize) -> Sample {
    let mut random = Random::new(n as u64);
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|_| (0..n).map(|_| random.symmetric()).collect())
        .collect();
    (0..n).for_each(|i| rows[i][i] += 2.0 * (n as f64).sqrt());
    sample(
        format!("dense, n = {n}"),
        Matrix::from_rows(&rows).unwrap(),
        &mut random,
    )
}

/// Five-point differences on a grid.
fn sparse(width: usize, length: usize) -> Sample {
    let n = width * length;
    let mut entries = Vec::with_capacity(5 * n);
    for k in 0..n {
        entries.push((k, k, 4.01));
        for (inside, other) in [(k % width + 1 < width, k + 1), (k + width < n, k + width)] {
            if inside {
                entries.extend([(k, other, -1.0), (other, k, -1.0)]);
            }
        }
    }
    let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
    sample(
        format!("sparse, n = {n} ({width} x {length})"),
        matrix,
        &mut Random::new(n as u64),
    )
}

fn sample(name: String, matrix: Matrix, random: &mut Random) -> Sample {
    let n = matrix.nrows();
    let z: Vec<f64> = (0..n).map(|_| random.symmetric().max(0.0)).collect();
    let mut q = vec![0.0; n];
    matrix.as_ref().mul_add(-1.0, &z, &mut q);
    for (q, z) in q.iter_mut().zip(&z) {
        *q += if *z > 0.0 { 0.0 } else { 1.0 };
    }
    let start = z.iter().map(|z| z + 0.3 * random.symmetric()).collect();
    let map = Mcp::new(
        AffineFunction::new(matrix, q).unwrap(),
        vec![0.0; n],
        vec![f64::INFINITY; n],
    )
    .unwrap();
    Sample { name, map, start }
}

/// Mean time of an iteration of one solve, and of its parts: evaluation of the map and its Jacobian, factorisation, solve.
fn times_of<P: PiecewiseSmooth>(newton: &mut Timed<'_, P>, start: &[f64]) -> [Duration; 4] {
    for watch in newton.watches {
        watch.0.set(Duration::ZERO);
    }
    let mut x = start.to_vec();
    let begun = Instant::now();
    newton.newton.solve(&newton.map, &mut x).unwrap();
    let whole = begun.elapsed();
    let iterations = newton.newton.report().history.len() as u32 - 1;
    let [a, b, c] = newton.watches.map(|w| w.0.get());
    [whole, a, b, c].map(|t| t / iterations.max(1))
}

struct Timed<'w, P> {
    newton: Newton<TimedSolver<'w>>,
    map: TimedMap<'w, P>,
    watches: [&'w Watch; 3],
}

/// Unknowns beyond which a solve takes seconds.
const LONG: usize = 50_000;
const PARTS: [&str; 4] = ["iteration", "evaluation", "factorisation", "solve"];

fn iterations(c: &mut Criterion) {
    let mut table = Vec::new();
    let dense =
        [2, 5, 10, 20, 50, 100, 200, 500].map(|n| -> Box<dyn Fn() -> Sample> { Box::new(move || dense(n)) });
    let grids = [(32, 32), (100, 100), (316, 316), (10, 100_000)];
    let grids = grids.map(|(w, l)| -> Box<dyn Fn() -> Sample> { Box::new(move || sparse(w, l)) });
    for make in dense.into_iter().chain(grids) {
        let Sample { name, map, start } = make();
        let watches = [Watch::default(), Watch::default(), Watch::default()];
        let [evaluation, factorisation, solve] = &watches;
        let solver = TimedSolver {
            solver: AutoSolver::new(),
            factorisation,
            solve,
        };
        let mut timed = Timed {
            newton: Newton::with_solver(NewtonOptions::default(), solver),
            map: TimedMap {
                map,
                watch: evaluation,
            },
            watches: [evaluation, factorisation, solve],
        };
        // The first solve allocates memory and computes the elimination order.
        times_of(&mut timed, &start);
        let mut group = c.benchmark_group(format!("an iteration: {name}"));
        group.sample_size(10).measurement_time(Duration::from_millis(500));
        group.warm_up_time(Duration::from_millis(100));
        // With solves that take seconds a sample would take a minute: these are only in the table.
        let shown = if start.len() > LONG { 0 } else { PARTS.len() };
        for (k, part) in PARTS[..shown].iter().enumerate() {
            group.bench_function(BenchmarkId::from_parameter(part), |b| {
                b.iter_custom(|rounds| (0..rounds).map(|_| times_of(&mut timed, &start)[k]).sum());
            });
        }
        group.finish();
        let solves = if start.len() > LONG { 3 } else { 15 };
        let mut runs: Vec<_> = (0..solves)
            .map(|_| times_of(&mut timed, &start).map(|t| t.as_secs_f64()))
            .collect();
        let ratio = |t: &[f64; 4]| t[0] / (t[1] + t[2] + t[3]);
        runs.sort_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        table.push((name, runs[solves / 2]));
    }
    println!(
        "\nmicroseconds per iteration, its parts, and the iteration over their sum (of the solve with the median of it)"
    );
    for (name, [whole, a, b, c]) in table {
        let ratio = whole / (a + b + c);
        let [whole, a, b, c] = [whole, a, b, c].map(|t| 1e6 * t);
        println!("{name:32} {whole:12.2} = {a:10.2} + {b:12.2} + {c:10.2} x {ratio:.3}");
    }
}

criterion_group!(benches, one_node, to_solution, iterations);
criterion_main!(benches);
