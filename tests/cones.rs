//! Cone complementarity problems built from their solutions, proofs that there is none, and bad data.

use std::ops::ControlFlow;

use proptest::prelude::*;
use semismooth::complementarity::{AffineFunction, McpFunction, WithJacobian};
use semismooth::cones::{Cone, ConeError, ConeOptions, ConeProblem, ConeSolver, ConeStatus};
use semismooth::sparse::Matrix;

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// A complementary pair of a cone with three variables: x and F inside, on the boundary, or 0.
fn pair(kind: usize, r: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let v = [r[0] + 1.5, r[1]];
    let length = norm(&v);
    let boundary = vec![length, v[0], v[1]];
    let opposite = vec![length, -v[0], -v[1]];
    let inside = vec![length + 1.0 + r[2], v[0], v[1]];
    let zero = vec![0.0; 3];
    match kind {
        0 => (inside, zero),
        1 => (zero, inside),
        2 => (boundary, opposite),
        3 => (boundary, zero),
        4 => (zero, boundary),
        _ => (zero.clone(), zero),
    }
}

/// M with Mᵀ + M positive definite, from 81 numbers.
fn monotone(r: &[f64]) -> Vec<Vec<f64>> {
    let entry = |i: usize, j: usize| {
        let gram: f64 = (0..9).map(|k| r[9 * k + i] * r[9 * k + j]).sum();
        let skew = if i < j { r[9 * i + j] } else { -r[9 * j + i] };
        gram + if i == j { 0.5 } else { skew }
    };
    (0..9).map(|i| (0..9).map(|j| entry(i, j)).collect()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Strongly monotone problems have one solution, the one they are built from, strictly complementary or not, in all units.
    #[test]
    fn problems_built_from_their_solution(
        kinds in prop::array::uniform3(0..6_usize),
        r in prop::collection::vec(-1.0..1.0, 81),
        start in prop::collection::vec(-10.0..10.0, 9),
        units in (-6..=6_i32, -6..=6_i32),
    ) {
        let pairs: Vec<_> = kinds.iter().enumerate().map(|(b, k)| pair(*k, &r[3 * b..])).collect();
        let x: Vec<f64> = pairs.iter().flat_map(|p| p.0.clone()).collect();
        let f: Vec<f64> = pairs.iter().flat_map(|p| p.1.clone()).collect();
        let (of_x, of_f) = (10_f64.powi(units.0), 10_f64.powi(units.1));
        let rows = monotone(&r);
        let q = (0..9).map(|i| of_f * (f[i] - (0..9).map(|j| rows[i][j] * x[j]).sum::<f64>())).collect();
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|v| of_f / of_x * v).collect()).collect();
        let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), q).unwrap();
        let problem = ConeProblem::new(&function, vec![Cone::SecondOrder(3); 3]).unwrap();
        let mut z: Vec<f64> = start.iter().map(|v| of_x * v).collect();
        let report = ConeSolver::default().solve(&problem, &mut z).unwrap();
        prop_assert!(report.is_solved(), "{:?} {:e}", report.status, report.error);
        let size = 1.0 + norm(&x);
        for (z, x) in z.iter().zip(&x) {
            prop_assert!((z / of_x - x).abs() <= 1e-7 * size, "{} {x}", z / of_x);
        }
        let mut room = vec![0.0; 9];
        prop_assert_eq!(problem.natural_residual(&z, &mut room).unwrap(), report.residual);
    }

    /// Projections are the nearest points: p ∈ K, p − z ∈ K*, pᵀ(p − z) = 0 (J. J. Moreau, 1962).
    #[test]
    fn projections_decompose(z in prop::collection::vec(-5.0..5.0, 1..6)) {
        let cone = Cone::SecondOrder(z.len());
        let mut p = z.clone();
        cone.project(&mut p);
        let d: Vec<f64> = p.iter().zip(&z).map(|(p, z)| p - z).collect();
        prop_assert!(p[0] >= norm(&p[1..]) - 1e-13 && d[0] >= norm(&d[1..]) - 1e-13);
        prop_assert!(p.iter().zip(&d).map(|(p, d)| p * d).sum::<f64>().abs() <= 1e-12);
    }
}

/// Half-lines, a cone and a free variable with a curved monotone F, gradient of a convex function: the least value is 0 at x̂.
#[test]
fn curved_functions_and_mixed_cones() {
    let goal = [0.0, 2.0, 1.2, -0.9, 0.7, -3.0];
    let value = move |x: &[f64], out: &mut [f64]| {
        for i in 0..6 {
            out[i] = (x[i] - goal[i]).exp() - 1.0 + (x[i] - goal[i]);
        }
        out[0] += 1.0;
    };
    let jacobian = move |x: &[f64], jac: &mut Matrix| {
        for i in 0..6 {
            jac.add(i, i, (x[i] - goal[i]).exp() + 1.0);
        }
    };
    let cones = vec![
        Cone::Nonnegative(1),
        Cone::SecondOrder(3),
        Cone::Nonnegative(1),
        Cone::Free(1),
    ];
    let problem = ConeProblem::new(WithJacobian::new(6, value, jacobian), cones).unwrap();
    for far in [0.0, 3.0, -20.0] {
        let mut x = [far; 6];
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{far}: {:?}", report.status);
        assert!(x.iter().zip(&goal).all(|(a, b)| (a - b).abs() < 1e-12), "{x:?}");
        let last = report.history.last().unwrap();
        assert_eq!(last.mu, 0.0);
    }
}

/// F(x) = M x + q with skew M and x in K: v proves that F(x) in K* has no solution.
#[test]
fn infeasible_problems_are_refuted() {
    // The first component of F is −1 whatever x is.
    let rows = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let q = vec![-1.0, 0.3, 0.2];
    let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), q.clone()).unwrap();
    let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
    let mut x = [1.0, 0.0, 0.0];
    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
    assert_eq!(report.status, ConeStatus::NoSolution);
    let ray = report.ray.unwrap();
    let v = &ray.direction;
    assert!(v[0] >= norm(&v[1..]) - 1e-14);
    let back: Vec<f64> = (0..3)
        .map(|j| -(0..3).map(|i| rows[i][j] * v[i]).sum::<f64>())
        .collect();
    assert!(back[0] >= norm(&back[1..]) - 1e-9);
    let value: f64 = q.iter().zip(v).map(|(q, v)| q * v).sum();
    assert!((value + 1.0).abs() < 1e-9 && ray.radius > 1e6);
}

/// With skew M and v = (1, 1, 0) in K, vᵀF(x) = −½ for all x: far out a small relative residual is no solution.
#[test]
fn residuals_that_vanish_at_infinity_are_no_solutions() {
    let rows = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-1.0, 1.0, 0.0]];
    let q = vec![-1.0, 0.5, 0.0];
    let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), q).unwrap();
    let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
    for scale in [1.0, 1e8, 1e12, 1e16] {
        let mut x = [scale, scale, 0.0];
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        assert_eq!(
            report.status,
            ConeStatus::NoSolution,
            "{scale}: {x:?} {:e}",
            report.error
        );
        let v = report.ray.unwrap().direction;
        assert!((v[0] - v[1]).abs() < 1e-9 && v[2].abs() < 1e-6, "{v:?}");
    }
}

#[test]
fn limits_and_observers_stop_the_run() {
    let function = AffineFunction::new(Matrix::identity(3), vec![1.0, -3.0, -4.0]).unwrap();
    let problem = ConeProblem::new(&function, vec![Cone::SecondOrder(3)]).unwrap();
    let mut x = [5.0, 1.0, 2.0];
    let mut seen = 0;
    let stop = |_: &semismooth::cones::ConeIteration| {
        seen += 1;
        ControlFlow::Break(())
    };
    let report = ConeSolver::default()
        .solve_observed(&problem, &mut x, stop)
        .unwrap();
    assert_eq!((report.status, seen), (ConeStatus::Interrupted, 1));
    let options = ConeOptions::default().with_max_time(Some(std::time::Duration::ZERO));
    let report = ConeSolver::new(options).solve(&problem, &mut x).unwrap();
    assert_eq!(report.status, ConeStatus::TimeLimit);
}

/// F without derivative: constant F inside of the cone has the solution 0, on the boundary a ray of them, outside none.
#[test]
fn functions_that_are_singular_everywhere() {
    for (q, status) in [
        ([0.0, 0.0, 0.0], ConeStatus::Solved),
        ([2.0, 1.0, 0.0], ConeStatus::Solved),
        ([1.0, 0.6, -0.8], ConeStatus::Solved),
        ([0.5, 0.6, -0.8], ConeStatus::NoSolution),
        ([-1.0, 0.0, 0.0], ConeStatus::NoSolution),
    ] {
        for start in [[0.0; 3], [3.0, 1.0, -2.0], [-1e6, 2e6, 0.0]] {
            let function =
                AffineFunction::new(Matrix::from_rows(&[[0.0; 3]; 3]).unwrap(), q.to_vec()).unwrap();
            let problem = ConeProblem::new(&function, vec![Cone::SecondOrder(3)]).unwrap();
            let mut x = start;
            let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
            assert_eq!(report.status, status, "{q:?} from {start:?}: {x:?}");
            let product: f64 = x.iter().zip(&q).map(|(x, q)| x * q).sum();
            assert!(!report.is_solved() || product.abs() <= 1e-9 * norm(&x), "{x:?}");
        }
    }
}

/// Outside of their domain functions say NaN: steps end inside of it, and a start outside is told.
#[test]
fn functions_with_a_domain() {
    // 1/(t + 1) + t − 2 vanishes where t² − t − 1 does; there t > ‖v‖.
    let value = |x: &[f64], out: &mut [f64]| {
        out[0] = if x[0] > -1.0 && x[0] < 50.0 {
            1.0 / (x[0] + 1.0) + x[0] - 2.0
        } else {
            f64::NAN
        };
        out[1] = x[1] - 0.3;
        out[2] = x[2] + 0.4;
    };
    let jacobian = |x: &[f64], jac: &mut Matrix| {
        jac.add(0, 0, 1.0 - (x[0] + 1.0).powi(-2));
        jac.add(1, 1, 1.0);
        jac.add(2, 2, 1.0);
    };
    let problem =
        ConeProblem::new(WithJacobian::new(3, value, jacobian), vec![Cone::SecondOrder(3)]).unwrap();
    for start in [0.5, 10.0, 49.0] {
        let mut x = [start, 0.0, 0.0];
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{start}: {:?}", report.status);
        assert!((x[0] - 0.5 * (1.0 + 5_f64.sqrt())).abs() < 1e-9, "{x:?}");
    }
    let mut x = [60.0, 0.0, 0.0];
    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
    assert_eq!(report.status, ConeStatus::EvaluationFailure);
    assert_eq!(x[1..], [0.0, 0.0]);
}

#[test]
fn bad_data_is_refused_by_name() {
    let function = AffineFunction::new(Matrix::identity(3), vec![0.0; 3]).unwrap();
    assert_eq!(ConeProblem::new(&function, vec![]).unwrap_err(), ConeError::Empty);
    let cones = vec![Cone::SecondOrder(3), Cone::SecondOrder(0)];
    assert_eq!(
        ConeProblem::new(&function, cones).unwrap_err(),
        ConeError::NoVariables { index: 1 }
    );
    let wrong = ConeProblem::new(&function, vec![Cone::Nonnegative(2)]).unwrap_err();
    assert_eq!(wrong.to_string(), "F has length 3, expected 2");
    let problem = ConeProblem::new(&function, vec![Cone::SecondOrder(3)]).unwrap();
    let solver = ConeSolver::default();
    assert!(matches!(
        solver.solve(&problem, &mut [0.0; 2]),
        Err(ConeError::Length { .. })
    ));
    let nan = solver.solve(&problem, &mut [0.0, f64::NAN, 0.0]);
    assert!(matches!(nan, Err(ConeError::NotFinite { index: 1, .. })));
    let solver = ConeSolver::new(ConeOptions::default().with_tolerance(0.0));
    assert!(matches!(
        solver.solve(&problem, &mut [0.0; 3]),
        Err(ConeError::Option { .. })
    ));
    let nan = WithJacobian::new(
        1,
        |_: &[f64], out: &mut [f64]| out[0] = f64::NAN,
        |_: &[f64], _: &mut Matrix| {},
    );
    assert_eq!(nan.num_vars(), 1);
    let problem = ConeProblem::new(nan, vec![Cone::Free(1)]).unwrap();
    let report = ConeSolver::default().solve(&problem, &mut [0.0]).unwrap();
    assert_eq!(report.status, ConeStatus::EvaluationFailure);
}
