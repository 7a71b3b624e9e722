//! Sweeps give what single runs give, in the order of the inputs, whatever the number of threads.

use semismooth::complementarity::{AffineFunction, Mcp, McpSolver};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::piecewise::MinMap;
use semismooth::sparse::Matrix;
use semismooth::sweep::sweep;

/// A tridiagonal LCP from a start of its own: the bits of the solution.
fn solve(start: &f64) -> Vec<u64> {
    const N: usize = 12;
    let entries = (0..N).flat_map(|i| {
        let beside = if i + 1 < N {
            vec![(i, i + 1, -1.0), (i + 1, i, -1.0)]
        } else {
            Vec::new()
        };
        [vec![(i, i, 2.1)], beside].concat()
    });
    let m = Matrix::from_triplets(N, N, &entries.collect::<Vec<_>>()).unwrap();
    let q: Vec<f64> = (0..N).map(|i| (i as f64 + start).sin()).collect();
    let f = AffineFunction::new(m, q).unwrap();
    let problem = Mcp::ncp(f).unwrap();
    let mut x = vec![*start; N];
    let mut solver = McpSolver::default();
    assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
    x.iter().map(|v| v.to_bits()).collect()
}

/// The corners of a followed curve, as bits.
fn follow(start: &f64) -> Vec<u64> {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
        b[0] = 2.0 - x[0] - x[1] * 1.5;
    });
    let x = [(1.0 - start * start).sqrt(), *start];
    let branch = Branch::follow(&map, &x, Direction::Increasing, ContinuationOptions::default()).unwrap();
    branch
        .polyline()
        .iter()
        .flat_map(|p| p.1)
        .map(|v| v.to_bits())
        .collect()
}

#[test]
fn sweeps_are_single_runs() {
    let starts: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.02 - 0.4).collect();
    let alone: Vec<_> = starts.iter().map(solve).collect();
    assert_eq!(sweep(&starts, solve), alone);
    let curves: Vec<_> = starts.iter().map(follow).collect();
    assert_eq!(sweep(&starts, follow), curves);
    // Twice the same bits.
    assert_eq!(sweep(&starts, follow), curves);
    assert!(sweep(&[] as &[f64], solve).is_empty());
}

#[cfg(feature = "rayon")]
#[test]
fn the_number_of_threads_changes_nothing() {
    let starts: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.02 - 0.4).collect();
    let alone: Vec<_> = starts.iter().map(solve).collect();
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        assert_eq!(pool.install(|| sweep(&starts, solve)), alone);
    }
}
