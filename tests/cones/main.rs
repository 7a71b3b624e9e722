//! Cone complementarity problems: solutions known by construction, limits, all strategies.

mod maps;
mod matrices;
mod memory;
#[path = "../common/random.rs"]
mod random;
mod refutations;

use std::ops::ControlFlow;

use proptest::prelude::*;
use random::Random;
use semismooth::complementarity::{AffineFunction, McpFunction, WithJacobian};
use semismooth::cones::{Cone, ConeOptions, ConeProblem, ConeSolver, ConeStrategy};
use semismooth::run::Status;
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

    /// Projections are nearest points: p ∈ K, p − z ∈ K*, pᵀ(p − z) = 0 (J. J. Moreau, 1962).
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
    assert_eq!((report.status, seen), (Status::Interrupted, 1));
    let options = ConeOptions::default().with_max_time(Some(std::time::Duration::ZERO));
    let report = ConeSolver::new(options).solve(&problem, &mut x).unwrap();
    assert_eq!(report.status, Status::TimeLimit);
    // A problem without solution, so that all methods and starts are tried.
    let matrix = Matrix::from_rows(&[[-2.0, 1.0, 0.0], [1.0, 1.0, -2.0], [0.0, 2.0, -1.0]]).unwrap();
    let function = AffineFunction::new(matrix, vec![-3.0, 1.0, 2.0]).unwrap();
    let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
    for limit in [0, 1, 2, 3, 10, 30, 100, 150, 400] {
        let options = ConeOptions::default().with_max_iterations(limit);
        let report = ConeSolver::new(options).solve(&problem, &mut x).unwrap();
        assert_eq!(
            (report.iterations, report.history.len()),
            (limit, limit),
            "{report}"
        );
        assert!(matches!(
            report.status,
            Status::IterationLimit | Status::NoSolution
        ));
    }
}

/// Observers are called, with merit NaN, during the search for a proof that there is no solution, and for starts at which F is not finite;
/// they end the run there, and are not called again.
#[test]
fn observers_are_called_between_iterates() {
    let matrix = Matrix::from_rows(&[[-2.0, 1.0, 0.0], [1.0, 1.0, -2.0], [0.0, 2.0, -1.0]]).unwrap();
    let none = AffineFunction::new(matrix, vec![-3.0, 1.0, 2.0]).unwrap();
    let start = [3.0, 1.0, -2.0];
    let nowhere = WithJacobian::new(
        3,
        |x: &[f64], f: &mut [f64]| {
            let near = (0..3).all(|i| (x[i] - start[i]).abs() < 0.05);
            let factor = if near { 1.0 } else { f64::NAN };
            (0..3).for_each(|i| f[i] = factor * (-1.0 - x[i] * x[i]));
        },
        |x: &[f64], jac: &mut Matrix| (0..3).for_each(|i| jac.add(i, i, -2.0 * x[i])),
    );
    let functions: [(&dyn McpFunction, usize); 2] = [(&none, 0), (&nowhere, 1_000_000)];
    for (function, restarts) in functions {
        let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
        let solver = ConeSolver::new(ConeOptions::default().with_restarts(restarts));
        let mut between = 0;
        let report = solver.solve_observed(&problem, &mut start.clone(), |now| {
            between += usize::from(now.merit.is_nan());
            match between {
                0 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        });
        let report = report.unwrap();
        // What has been found by then may be the proof.
        let proven = report.status == Status::NoSolution && report.ray.is_some();
        assert!(proven || report.status == Status::Interrupted, "{report}");
        assert_eq!(between, 1);
        assert!(report.history.iter().all(|now| now.merit.is_finite()));
    }
}

/// F with derivative 0: a constant F inside the cone has the solution 0, on the boundary a ray of solutions, outside none.
#[test]
fn functions_that_are_singular_everywhere() {
    for (q, status) in [
        ([0.0, 0.0, 0.0], Status::Solved),
        ([2.0, 1.0, 0.0], Status::Solved),
        ([1.0, 0.6, -0.8], Status::Solved),
        ([0.5, 0.6, -0.8], Status::NoSolution),
        ([-1.0, 0.0, 0.0], Status::NoSolution),
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

/// Outside their domain functions return NaN: steps stay inside it, and a start outside is reported.
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
    assert_eq!(report.status, Status::EvaluationFailure { component: 0 });
    assert_eq!(x[1..], [0.0, 0.0]);
}

/// The reported evaluations of F are those that F itself counts, on every route to a solution and where there is none.
#[test]
fn evaluations_are_counted() {
    for (slope, q) in [(1.0, -1.0), (0.0, -1.0), (-0.5, 1.0)] {
        let (calls, q) = (std::cell::Cell::new(0), [q, 0.8, 0.9]);
        let value = |x: &[f64], out: &mut [f64]| {
            calls.set(calls.get() + 1);
            (0..3).for_each(|i| out[i] = slope * (x[i] + 0.1 * x[i].powi(3)) + q[i]);
        };
        let jacobian = |x: &[f64], jac: &mut Matrix| {
            (0..3).for_each(|i| jac.add(i, i, slope * (1.0 + 0.3 * x[i] * x[i])));
        };
        let function = WithJacobian::new(3, value, jacobian);
        let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
        let report = ConeSolver::default()
            .solve(&problem, &mut [3.0, 1.0, -2.0])
            .unwrap();
        assert_eq!(report.evaluations, calls.get());
        assert!(report.evaluations > report.iterations);
    }
}

/// M as in [`monotone`], of any size.
fn monotone_of(n: usize, random: &mut Random) -> Vec<Vec<f64>> {
    let r: Vec<Vec<f64>> = random.square(n);
    let entry = |i: usize, j: usize| {
        let gram: f64 = (0..n).map(|k| r[k][i] * r[k][j]).sum();
        let skew = if i < j { r[i][j] } else { -r[j][i] };
        gram + if i == j { 0.5 } else { skew }
    };
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

/// The point nearest to (1, 3, 4) in rotated axes, with the second entry of v, in the original axes, fixed at 0 by an equation: the entry
/// is rounding, and so are all terms of that row.
#[test]
fn equations_for_what_is_rounding_are_solved() {
    for angle in [0.3_f64, 1.1, 2.0] {
        let (sin, cos) = angle.sin_cos();
        // x = (t, v₁, v₂) in rotated axes; cos v₁ + sin v₂ = 0 with the multiplier y.
        let rows = [
            [0.0, 0.0, cos, sin],
            [0.0, 1.0, 0.0, 0.0],
            [-cos, 0.0, 1.0, 0.0],
            [-sin, 0.0, 0.0, 1.0],
        ];
        let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![0.0, -1.0, -3.0, -4.0]).unwrap();
        let problem = ConeProblem::new(f, vec![Cone::Free(1), Cone::SecondOrder(3)]).unwrap();
        let mut x = [0.0; 4];
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        // The point of the plane t ≥ |w| nearest to (1, w), w = −3 sin + 4 cos.
        let w = 4.0 * cos - 3.0 * sin;
        let t = if w.abs() > 1.0 { 0.5 * (1.0 + w.abs()) } else { 1.0 };
        assert!(
            report.is_solved() && (x[1] - t).abs() < 1e-9,
            "{angle}: {report:?} {x:?}"
        );
        assert!(report.iterations < 40, "{angle}: {}", report.iterations);
    }
}

/// F(x) = |a|² x − a aᵀx, not declared affine, vanishes on the ray of a, on the boundary of the cone: what is left of F beside its
/// derivative is rounding, and no sign of a solution at infinity.
#[test]
fn rays_of_solutions_of_homogeneous_functions_are_found() {
    let a = [5.0, 3.0, -4.0];
    let value = |x: &[f64], out: &mut [f64]| {
        let along: f64 = a.iter().zip(x).map(|(a, x)| a * x).sum();
        (0..3).for_each(|i| out[i] = 50.0 * x[i] - along * a[i]);
    };
    let jacobian = |_: &[f64], jac: &mut Matrix| {
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            jac.add(i, j, if i == j { 50.0 } else { 0.0 } - a[i] * a[j]);
        }
    };
    let function = WithJacobian::new(3, value, jacobian);
    let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
    let options = ConeOptions::default()
        .with_strategies(vec![ConeStrategy::Newton])
        .with_restarts(0);
    let (solver, mut random) = (ConeSolver::new(options), Random::new(12));
    for case in 0..40 {
        let mut x = random.vector(3, 0.1);
        x.iter_mut().zip(a).for_each(|(x, a)| *x += a);
        let report = solver.solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{case}: {report}");
        let along = x[0] / a[0];
        assert!(
            x.iter().zip(a).all(|(x, a)| (x - along * a).abs() < 1e-6),
            "{case}: {x:?}"
        );
    }
}

/// Each strategy alone finds the one solution of a strongly monotone problem; a strategy that does not apply does nothing.
#[test]
fn strategies_alone_agree() {
    let mut random = Random::new(33);
    for case in 0..30 {
        let matrix = Matrix::from_rows(&monotone_of(6, &mut random)).unwrap();
        let q = random.vector(6, 3.0);
        // The same values, declared affine or not.
        let affine = case % 2 == 0;
        let solve = |strategy: ConeStrategy| {
            let cones = vec![Cone::SecondOrder(3), Cone::SecondOrder(2), Cone::Nonnegative(1)];
            let options = ConeOptions::default()
                .with_strategies(vec![strategy])
                .with_restarts(0);
            let (solver, mut x) = (ConeSolver::new(options), vec![0.0; 6]);
            let function = AffineFunction::new(matrix.clone(), q.clone()).unwrap();
            let report = match affine {
                true => solver.solve(&ConeProblem::new(function, cones).unwrap(), &mut x),
                false => {
                    let value = |x: &[f64], out: &mut [f64]| function.value(x, out);
                    let slope = |x: &[f64], jac: &mut Matrix| function.jacobian(x, jac);
                    solver.solve(
                        &ConeProblem::new(WithJacobian::new(6, value, slope), cones).unwrap(),
                        &mut x,
                    )
                }
            };
            (report.unwrap(), x)
        };
        let suited = |of: ConeStrategy, other: ConeStrategy| if affine { (of, other) } else { (other, of) };
        let (interior, unsuited) = suited(ConeStrategy::InteriorPoints, ConeStrategy::CentralPath);
        let (report, expected) = solve(interior);
        assert!(report.is_solved(), "{case}: {report}");
        for strategy in [ConeStrategy::Smoothing, ConeStrategy::ProximalPoints] {
            let (report, x) = solve(strategy);
            assert!(report.is_solved(), "{case}, {strategy}: {report}");
            assert!(
                x.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-7),
                "{case}: {x:?}"
            );
        }
        let (report, x) = solve(ConeStrategy::Newton);
        if report.is_solved() {
            assert!(
                x.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-7),
                "{case}: {x:?}"
            );
            assert!(report.history.iter().all(|i| i.mu == 0.0));
        }
        let (report, _) = solve(unsuited);
        assert_eq!((report.status, report.iterations), (Status::Stalled, 0));
    }
}
