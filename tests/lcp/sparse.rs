//! Sparse problems of many unknowns, through the solver for all complementarity problems.

use std::ops::ControlFlow;

use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

/// −u″ + b u′ ≥ f over an obstacle on (0, 1) by upwind differences, as an LCP for u − ψ; symmetric for b = 0.
fn string(n: usize, wind: f64) -> Lcp {
    let h = 1.0 / (n + 1) as f64;
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, 2.0 + wind * h));
        if i > 0 {
            entries.push((i, i - 1, -1.0 - wind * h));
        }
        if i + 1 < n {
            entries.push((i, i + 1, -1.0));
        }
    }
    let obstacle = |i: usize| 0.3 - 4.0 * ((i + 1) as f64 * h - 0.5).powi(2);
    let mut q = vec![0.0; n];
    entries.iter().for_each(|&(i, j, v)| q[i] += v * obstacle(j));
    Lcp::new(Matrix::from_triplets(n, n, &entries).unwrap(), q).unwrap()
}

/// The straight parts are tangents from the ends, which touch ψ(t) = 0.3 − 4(t − ½)² where ψ(t) = t ψ′(t): at 4t² = 0.7.
#[test]
fn a_string_over_a_parabola_needs_few_iterations() {
    let touch = (0.7_f64 / 4.0).sqrt();
    for n in [400, 2_000, 20_000] {
        let lcp = string(n, 0.0);
        let mut z = vec![0.0; n];
        let mut solver = McpSolver::default();
        let report = solver.solve(lcp.mcp(), &mut z).unwrap();
        assert!(report.is_solved(), "{n}: {report}");
        assert!(report.iterations <= 40, "{n}: {report}");
        let first = z.iter().position(|z| *z == 0.0).unwrap();
        let last = z.iter().rposition(|z| *z == 0.0).unwrap();
        let h = 1.0 / (n + 1) as f64;
        for (found, exact) in [
            ((first + 1) as f64 * h, touch),
            ((last + 1) as f64 * h, 1.0 - touch),
        ] {
            assert!((found - exact).abs() <= 2.0 * h, "{n}: {found} {exact}");
        }
    }
}

/// With wind the matrix is not symmetric; every law holds row by row.
#[test]
fn matrices_that_are_not_symmetric_are_solved_as_well() {
    let n = 3_000;
    let lcp = string(n, 7.0);
    let mut z = vec![0.0; n];
    let mut solver = McpSolver::default();
    assert!(solver.solve(lcp.mcp(), &mut z).unwrap().is_solved());
    let mut w = lcp.q().to_vec();
    lcp.matrix().as_ref().mul_add(1.0, &z, &mut w);
    for (z, w) in z.iter().zip(&w) {
        assert!(*z >= 0.0 && *w >= -1e-14 && z.min(w.abs()) <= 1e-14, "{z} {w}");
    }
    assert!(z.contains(&0.0) && z.iter().any(|z| *z > 0.1));
}

/// An observer that asks to stop is obeyed at once, and not asked again.
#[test]
fn large_problems_can_be_stopped() {
    let lcp = string(1_000, 0.0);
    for most in [1, 3] {
        let (mut calls, mut solver, mut z) = (0, McpSolver::default(), vec![0.0; 1_000]);
        let stop = |_: &_| {
            calls += 1;
            if calls == most {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let report = solver.solve_observed(lcp.mcp(), &mut z, stop).unwrap();
        assert_eq!(report.status, Status::Interrupted);
        assert_eq!((calls, z.len()), (most, 1_000));
    }
}
