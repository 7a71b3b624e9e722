//! What Lemke's and the active-set method report as solved, in all units and from all starts.

use proptest::prelude::*;
use semismooth::complementarity::active_set::{
    ActiveSetOptions, ActiveSetSolver, DirectReduced, GmresReduced,
};
use semismooth::complementarity::pivoting::Lemke;
use semismooth::complementarity::{Lcp, Mcp, McpOptions, McpSolver, McpStrategy};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::random::Random;
use crate::support::{INF, matrix, residual};

/// The largest error relative to the terms of rows.
fn error(lcp: &Lcp, z: &[f64]) -> f64 {
    let n = z.len();
    let errors = (0..n).map(|i| {
        let terms = (0..n).map(|j| lcp.matrix().get(i, j) * z[j]).chain([lcp.q()[i]]);
        let (w, size) = terms.fold((0.0, 0.0), |(s, t), p: f64| (s + p, t + p.abs()));
        let (l, u) = (lcp.lower()[i], lcp.upper()[i]);
        assert!(l <= z[i] && z[i] <= u);
        match (z[i] == l && w >= 0.0) || (z[i] == u && w <= 0.0) || w == 0.0 {
            true => 0.0,
            false => w.abs() / size,
        }
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn a_start_far_out_leaves_no_rounding_in_the_solution() {
    // 3 z = 1; from 1e15 one step leads to 0.375.
    for lower in [0.0, -INF] {
        for start in [1e15, -1e15, 1e30, 1e200] {
            let lcp = Lcp::boxed(matrix(&[vec![3.0]]), vec![-1.0], vec![lower], vec![INF]).unwrap();
            let mut z = [start];
            let report = ActiveSetSolver::default().solve(&lcp, &mut z).unwrap();
            assert_eq!(report.status, Status::Solved);
            assert!((3.0 * z[0] - 1.0).abs() <= 1e-15, "{start:e}: {z:?}");
        }
    }
    // A large unknown next to a small one, decoupled from it: its rounding does not excuse the residual of the other.
    let m = matrix(&[vec![3.0, 0.0], vec![0.0, 3.0]]);
    let lcp = Lcp::boxed(m, vec![-1e14, -1.0], vec![-INF; 2], vec![INF; 2]).unwrap();
    for gmres in [false, true] {
        let mut z = [0.0, 1e9];
        let options = ActiveSetOptions::default();
        let report = match gmres {
            true => ActiveSetSolver::with_reduced(options, GmresReduced::default()).solve(&lcp, &mut z),
            false => ActiveSetSolver::with_reduced(options, DirectReduced::new()).solve(&lcp, &mut z),
        };
        let solved = report.unwrap().status == Status::Solved;
        assert!(!solved || (3.0 * z[1] - 1.0).abs() < 1e-10, "{z:?}");
        assert!(solved || gmres);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// Rows times 1e−12 … 1e12, unknowns times 1e−3 … 1e3: P matrices are solved, to the tolerance in the units of each row.
    #[test]
    fn rows_in_all_units_are_solved_to_the_tolerance(seed in 1_u64.., n in 1_usize..10, far in -1e3..1e3) {
        let mut rng = Random::new(seed);
        let (g, s) = (rng.square(n), rng.square(n));
        let row: Vec<f64> = (0..n).map(|_| 10_f64.powi((12.0 * rng.symmetric()) as i32)).collect();
        let col: Vec<f64> = (0..n).map(|_| 10_f64.powi((3.0 * rng.symmetric()) as i32)).collect();
        let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| {
            let dot: f64 = (0..n).map(|k| g[k][i] * g[k][j]).sum();
            row[i] * col[j] * (dot + if i == j { 0.1 } else { s[i][j] - s[j][i] })
        }).collect()).collect();
        let q = row.iter().map(|r| r * rng.symmetric()).collect();
        let lcp = Lcp::new(matrix(&rows), q).unwrap();
        let mut z = vec![0.0; n];
        prop_assert_eq!(Lemke::default().solve(&lcp, &mut z).unwrap().status, Status::Solved);
        prop_assert!(error(&lcp, &z) <= 1e-10, "{:e}", error(&lcp, &z));
        let mut y = vec![far; n];
        prop_assert_eq!(ActiveSetSolver::default().solve(&lcp, &mut y).unwrap().status, Status::Solved);
        prop_assert!(error(&lcp, &y) <= 1e-11, "{:e}", error(&lcp, &y));
        for (a, b) in z.iter().zip(&y) {
            prop_assert!((a - b).abs() <= 1e-8 * a.abs().max(1e-3), "{a} {b}");
        }
    }

    /// Infeasible for all z ≥ 0, in all units of rows: never solved, and a certificate is one in the units of each row.
    #[test]
    fn infeasible_rows_stay_infeasible(seed in 1_u64.., n in 2_usize..7) {
        let mut rng = Random::new(seed);
        let b = rng.square(n);
        let row: Vec<f64> = (0..n).map(|_| 10_f64.powi((12.0 * rng.symmetric()) as i32)).collect();
        // Row k requires −Σ |m_kj| z_j ≥ |q_k| > 0.
        let k = seed as usize % n;
        let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| row[i] * if i == k { -b[i][j].abs() } else { b[i][j] }).collect()).collect();
        let q = (0..n).map(|i| row[i] * if i == k { -0.1 - rng.symmetric().abs() } else { rng.symmetric() }).collect();
        let lcp = Lcp::new(matrix(&rows), q).unwrap();
        let mut z = vec![0.0; n];
        prop_assert_ne!(Lemke::default().solve(&lcp, &mut z).unwrap().status, Status::Solved);
        let mut y = vec![1.0; n];
        let options = ActiveSetOptions::default().with_max_iterations(100);
        prop_assert_ne!(ActiveSetSolver::new(options).solve(&lcp, &mut y).unwrap().status, Status::Solved);
    }

    /// A ray proves infeasibility only where there is no solution, whatever the units of rows.
    #[test]
    fn certificates_of_rays_are_not_forged_by_units(seed in 1_u64.., n in 1_usize..6) {
        let mut rng = Random::new(seed);
        let m = rng.square(n);
        let row: Vec<f64> = (0..n).map(|_| 10_f64.powi((12.0 * rng.symmetric()) as i32)).collect();
        // z = 1 is feasible: w = M z + q = s ≥ 0.
        let rows: Vec<Vec<f64>> = (0..n).map(|i| m[i].iter().map(|v| row[i] * v).collect()).collect();
        let q = (0..n).map(|i| row[i] * (rng.symmetric().abs() - m[i].iter().sum::<f64>())).collect();
        let lcp = Lcp::new(matrix(&rows), q).unwrap();
        let mut z = vec![0.0; n];
        let status = Lemke::default().solve(&lcp, &mut z).unwrap().status;
        prop_assert_ne!(status, Status::NoSolution);
    }
}

/// M = g gᵀ + δ: for δ = 0 some v ≥ 0 has Mᵀv = 0 and qᵀv < 0, for δ > 0 there is a solution (of size 1/δ), however small δ.
#[test]
fn what_has_a_solution_far_out_is_not_called_infeasible() {
    for (g, q) in [
        ([2.0, 3.0, -2.0], [2.0, -1.0, 0.0]),
        ([1.0, 3.0, -2.0], [0.0, -1.0, -1.0]),
    ] {
        for delta in [36, 40, 44].map(|k| 2_f64.powi(-k)).into_iter().chain([0.0]) {
            let entry = |i: usize, j: usize| g[i] * g[j] + if i == j { delta } else { 0.0 };
            let rows: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|j| entry(i, j)).collect()).collect();
            let lcp = Lcp::new(matrix(&rows), q.to_vec()).unwrap();
            let status = Lemke::default().solve(&lcp, &mut [0.0; 3]).unwrap().status;
            assert_eq!(status == Status::NoSolution, delta == 0.0, "{delta:e}");
            for strategies in [McpOptions::default().strategies, vec![McpStrategy::Proximal]] {
                let mut solver = McpSolver::new(McpOptions::default().with_strategies(strategies));
                let status = solver.solve(lcp.mcp(), &mut [0.0; 3]).unwrap().status;
                assert_eq!(status == Status::NoSolution, delta == 0.0, "{delta:e}: {status}");
            }
        }
    }
}

/// z_k ≥ z_{k+1} around a circle, once with a margin of 1: the sum of all is 0 ≥ 1. In this size v = (1, …, 1) itself is verified.
#[test]
fn large_infeasible_problems_are_proven_by_a_simple_certificate() {
    let n = 90;
    let entries: Vec<_> = (0..n)
        .flat_map(|i| [(i, i, 1.0), (i, (i + 1) % n, -1.0)])
        .collect();
    for (total, infeasible) in [(1.0, true), (-1.0, false)] {
        let mut q = vec![0.0; n];
        q[n / 2] = -total;
        let lcp = Lcp::new(Matrix::from_triplets(n, n, &entries).unwrap(), q).unwrap();
        let status = Lemke::default().solve(&lcp, &mut vec![0.0; n]).unwrap().status;
        assert_eq!(status == Status::NoSolution, infeasible, "{status}");
        let mut solver = McpSolver::default();
        let status = solver.solve(lcp.mcp(), &mut vec![0.0; n]).unwrap().status;
        assert_eq!(status == Status::NoSolution, infeasible, "{status}");
    }
}

/// An elastic string pushed back and forth between two walls: apart from the rows of free components, linear systems contain only rows with
/// the distances of the other components from their bounds. Newton's method ends one step after the active set is right.
#[test]
fn large_systems_are_those_of_the_free_components() {
    let n = 300;
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, 2.1));
        if i + 1 < n {
            entries.extend([(i, i + 1, -1.0), (i + 1, i, -1.0)]);
        }
    }
    let q: Vec<f64> = (0..n).map(|i| 0.4 * (i as f64 * 0.1).sin()).collect();
    let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
    let problem = Mcp::affine(matrix, q, vec![-1.0; n], vec![0.5; n]).unwrap();
    let options = McpOptions::default().with_strategies(vec![McpStrategy::Newton]);
    for start in [0.5, -1.0, 0.0] {
        let mut x = vec![start; n];
        let mut solver = McpSolver::new(options.clone());
        let report = solver.solve(&problem, &mut x).unwrap();
        let at = |v: f64| x.iter().filter(|x| **x == v).count();
        assert!(report.is_solved() && residual(&problem, &x) < 1e-12);
        assert!(at(-1.0) > 30 && at(0.5) > 30 && at(-1.0) + at(0.5) < n - 30);
        assert!(report.iterations <= 12, "{}", report.iterations);
    }
}

/// Non-negative least squares, AᵀA z ≥ Aᵀb, of 20 equations in 30 unknowns, in other units of A and b: by powers of two the run is the same
/// to the last bit, by powers of ten it ends with the same status at the same objective.
#[test]
fn least_squares_do_not_depend_on_units() {
    for seed in 1..4 {
        let mut rng = Random::new(seed);
        let (rows, n) = (20, 30);
        let a: Vec<Vec<f64>> = (0..rows)
            .map(|_| (0..n).map(|_| rng.symmetric()).collect())
            .collect();
        let b: Vec<f64> = (0..rows).map(|_| rng.symmetric()).collect();
        let run = |sa: f64, sb: f64| {
            let dot = |i: usize, j: usize| (0..rows).map(|k| a[k][i] * a[k][j]).sum::<f64>();
            let m: Vec<Vec<f64>> = (0..n)
                .map(|i| (0..n).map(|j| sa * sa * dot(i, j)).collect())
                .collect();
            let q = (0..n)
                .map(|i| -sa * sb * (0..rows).map(|k| a[k][i] * b[k]).sum::<f64>())
                .collect();
            let lcp = Lcp::new(matrix(&m), q).unwrap();
            let mut z = vec![0.0; n];
            let report = McpSolver::default().solve(lcp.mcp(), &mut z).unwrap().clone();
            z.iter_mut().for_each(|z| *z *= sa / sb);
            let left = (0..rows).map(|k| (0..n).map(|j| a[k][j] * z[j]).sum::<f64>() - b[k]);
            let objective = left.map(|r| r * r).sum::<f64>().sqrt();
            (z, objective, report)
        };
        let (plain, best, first) = run(1.0, 1.0);
        assert!(first.is_solved(), "{:?}", first.status);
        for (sa, sb) in [(1, 40), (-70, -27), (-35, 12), (20, -90)] {
            let (z, _, report) = run(2.0_f64.powi(sa), 2.0_f64.powi(sb));
            assert_eq!(
                (z, &report.history),
                (plain.clone(), &first.history),
                "2^{sa}, 2^{sb}"
            );
        }
        for (sa, sb) in [(0, 12), (-21, -8), (-21, -30), (9, -12)] {
            let (_, objective, report) = run(10.0_f64.powi(sa), 10.0_f64.powi(sb));
            assert!(report.is_solved(), "1e{sa}, 1e{sb}: {:?}", report.status);
            assert!(
                (objective - best).abs() <= 1e-9 * best,
                "1e{sa}, 1e{sb}: {objective} {best}"
            );
        }
    }
}
