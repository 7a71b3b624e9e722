//! A solver of complementarity problems that is reused allocates nothing. There is a single test, as all threads share the allocator.

use std::alloc::System;

use semismooth::complementarity::active_set::ActiveSetSolver;
use semismooth::complementarity::pivoting::Lemke;
use semismooth::complementarity::{Lcp, Mcp, McpSolver, McpStrategy, WithJacobian};
use semismooth::linear::{BlockDiagonal, IncompleteLu, KrylovMethod, Multigrid, Preconditioner};
use semismooth::newton::{Damping, NewtonKrylov, NewtonKrylovOptions};
use semismooth::piecewise::{Assembled, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations and reallocations by `run`: the least of three runs, as the main thread of the test harness may allocate meanwhile.
fn allocations(mut run: impl FnMut()) -> usize {
    let count = |_| {
        let region = Region::new(ALLOCATOR);
        run();
        let change = region.change();
        change.allocations + change.reallocations
    };
    (0..3).map(count).min().unwrap()
}

/// Strictly diagonally dominant with entries that change with `seed`, and a right-hand side of both signs.
fn lcp(n: usize, seed: usize) -> Lcp {
    let weyl = |k: usize| 2.0 * ((k + 31 * seed) as f64 * 0.618_033_988_749_895).fract() - 1.0;
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let entry = |j| if i == j { n as f64 } else { weyl(i * n + j) };
            (0..n).map(entry).collect()
        })
        .collect();
    let q = (0..n).map(|i| 10.0 * weyl(7 * i + 1)).collect();
    Lcp::new(Matrix::from_rows(&rows).unwrap(), q).unwrap()
}

/// (x − 1)² − 1.01 ≥ 0 ⟂ x ≥ 0: a solution at 1 + √1.01, a local minimum of every merit at 0 (S. C. Billups, 1995).
fn billups() -> Mcp<impl semismooth::complementarity::McpFunction> {
    Mcp::ncp(WithJacobian::new(
        1,
        |x: &[f64], out: &mut [f64]| out[0] = (x[0] - 1.0).powi(2) - 1.01,
        |x: &[f64], jac: &mut Matrix| jac.add(0, 0, 2.0 * (x[0] - 1.0)),
    ))
    .unwrap()
}

/// −Δu + 30 (u − 0.02)₊ = 8 on m × m points of the unit square, times h².
struct Membrane(usize);

impl Membrane {
    fn neighbours(&self, k: usize) -> [Option<usize>; 4] {
        let (m, i, j) = (self.0, k % self.0, k / self.0);
        [
            (i > 0).then(|| k - 1),
            (i + 1 < m).then(|| k + 1),
            (j > 0).then(|| k - m),
            (j + 1 < m).then(|| k + m),
        ]
    }
    fn h2(&self) -> f64 {
        1.0 / ((self.0 + 1) * (self.0 + 1)) as f64
    }
}

impl Semismooth for Membrane {
    fn num_vars(&self) -> usize {
        self.0 * self.0
    }
    fn pattern(&self) -> Pattern {
        let n = self.num_vars();
        let row = |k| {
            self.neighbours(k)
                .into_iter()
                .flatten()
                .chain([k])
                .map(move |l| (k, l))
        };
        Pattern::from_entries(n, n, (0..n).flat_map(row)).unwrap()
    }
    fn residual(&self, u: &[f64], out: &mut [f64]) {
        for k in 0..u.len() {
            let around: f64 = self.neighbours(k).into_iter().flatten().map(|l| u[l]).sum();
            out[k] = 4.0 * u[k] - around + self.h2() * (30.0 * (u[k] - 0.02).max(0.0) - 8.0);
        }
    }
    fn jacobian(&self, u: &[f64], jac: &mut Matrix) {
        for k in 0..u.len() {
            jac.add(k, k, 4.0 + if u[k] > 0.02 { 30.0 * self.h2() } else { 0.0 });
            for l in self.neighbours(k).into_iter().flatten() {
                jac.add(k, l, -1.0);
            }
        }
    }
}

/// Inexact Newton methods for −Δu + 30 (u − 0.02)₊ = 8, with full steps and line search.
fn inexact_newton_does_not_allocate<P: Preconditioner>(name: &str, preconditioner: impl Fn() -> P) {
    for method in [
        KrylovMethod::Cg,
        KrylovMethod::Minres,
        KrylovMethod::Gmres { directions: 5 },
        KrylovMethod::FlexibleGmres { directions: 5 },
    ] {
        for damping in [Damping::OnTrouble, Damping::Always] {
            let membrane = Membrane(12);
            let mut problem = Assembled::new(&membrane, preconditioner());
            let options = NewtonKrylovOptions::default()
                .with_method(method)
                .with_damping(damping);
            let mut newton = NewtonKrylov::new(options);
            let mut u = vec![0.0; 144];
            let mut run = || {
                u.fill(0.0);
                newton.solve(&mut problem, &mut u).unwrap();
            };
            run();
            assert_eq!(allocations(run), 0, "{name}, {method:?}, {damping:?}");
        }
    }
}

#[test]
fn reused_solvers_do_not_allocate() {
    // The counter itself works.
    assert!(allocations(|| drop(std::hint::black_box(vec![1_u8; 100]))) > 0);

    for n in [1, 5, 20, 40] {
        let problems: Vec<Lcp> = (0..10).map(|seed| lcp(n, seed)).collect();
        let mut z = vec![0.0; n];
        let (mut newton, mut lemke, mut sets) =
            (McpSolver::default(), Lemke::default(), ActiveSetSolver::default());
        let mut all = || {
            for p in &problems {
                z.fill(1.0);
                assert!(newton.solve(p.mcp(), &mut z).unwrap().is_solved());
                assert_eq!(lemke.solve(p, &mut z).unwrap().status, Status::Solved);
                z.fill(1.0);
                assert_eq!(sets.solve(p, &mut z).unwrap().status, Status::Solved);
            }
        };
        all();
        assert_eq!(allocations(all), 0, "n = {n}");
    }

    inexact_newton_does_not_allocate("multigrid", Multigrid::algebraic);
    inexact_newton_does_not_allocate("incomplete LU", IncompleteLu::default);
    inexact_newton_does_not_allocate("blocks", || {
        BlockDiagonal::new()
            .with_block(60, IncompleteLu::default())
            .with_block(84, Multigrid::algebraic())
    });

    // The same where fallback strategies are needed.
    let problem = billups();
    let mut solver = McpSolver::default();
    let mut last = McpStrategy::Newton;
    let mut run = || {
        for start in [0.0, 0.5, 1.0, 10.0, 0.0] {
            let report = solver.solve(&problem, &mut [start]).unwrap();
            assert!(report.is_solved());
            last = report.strategy;
        }
    };
    run();
    assert_eq!(allocations(run), 0);
    assert_eq!(last, McpStrategy::Proximal);
}
