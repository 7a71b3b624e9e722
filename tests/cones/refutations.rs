//! Proofs that there is no solution, in all units; and residuals that vanish at infinity only.

use semismooth::complementarity::AffineFunction;
use semismooth::cones::{Cone, ConeOptions, ConeProblem, ConeSolver};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::norm;
use crate::random::Random;

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
    assert_eq!(report.status, Status::NoSolution);
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

/// F(x) = (0, x₁ − 1, x₂) at points far along the axis of the cone: F is no smaller there than elsewhere, and neither is the reported
/// error.
#[test]
fn residuals_do_not_vanish_along_the_axis() {
    let matrix = Matrix::from_rows(&[[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
    let function = AffineFunction::new(matrix, vec![0.0, -1.0, 0.0]).unwrap();
    let problem = ConeProblem::new(function, vec![Cone::SecondOrder(3)]).unwrap();
    for length in [2.0, 1e4, 1e7, 1e10] {
        for limit in [3, 4, 5, 6, 100] {
            let mut x = [length, 2.0, 0.0];
            let options = ConeOptions::default().with_max_iterations(limit);
            let report = ConeSolver::new(options).solve(&problem, &mut x).unwrap();
            let (off, error) = ((x[1] - 1.0).abs(), report.error);
            // The error is evaluated in the last iterations only.
            let agrees = error == f64::INFINITY || error >= 0.1 * off - 1e-12 && error <= off + 1e-12;
            assert!(
                agrees && (limit < 100 || report.is_solved()),
                "{length:e}: {off:e} {error:e}"
            );
        }
    }
}

/// With skew M and v = (1, 1, 0) in K, vᵀF(x) = −½ for all x: a small relative residual far from the origin is no solution.
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
            Status::NoSolution,
            "{scale}: {x:?} {:e}",
            report.error
        );
        let v = report.ray.unwrap().direction;
        assert!((v[0] - v[1]).abs() < 1e-9 && v[2].abs() < 1e-6, "{v:?}");
    }
}

/// The same beside x₃ ≥ 0 ⟂ x₃ − 1 ≥ 0, which is decoupled from it and whose constant may be large compared with the others. The
/// certificate concerns the other rows alone.
#[test]
fn other_blocks_do_not_hide_what_vanishes_at_infinity() {
    let rows = [
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [-1.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    for own in [1.0, 1e-3, 1e6] {
        let q = vec![-1.0, 0.5, 0.0, -own];
        let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), q).unwrap();
        let cones = vec![Cone::SecondOrder(3), Cone::Nonnegative(1)];
        let problem = ConeProblem::new(function, cones).unwrap();
        for scale in [1.0, 1e8, 1e12, 1e16] {
            let mut x = [scale, scale, 0.0, own];
            let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
            let told = (own, scale, x, report.error);
            assert_eq!(report.status, Status::NoSolution, "{told:?}");
            let v = report.ray.unwrap().direction;
            assert!((v[0] - v[1]).abs() < 1e-9 && v[3] == 0.0, "{v:?}");
        }
    }
}

/// A problem with one solution, the x at which F = 0, in units of each cone that are far apart: it is not refuted, as x is of ordinary size in
/// these units.
#[test]
fn solvable_problems_are_not_refuted_in_any_units() {
    let rows = [
        [2.0, 2.0, 1.0, 2.0, 2.0, 0.0],
        [2.0, 17.0, 6.0, -6.0, 0.0, -5.0],
        [1.0, 6.0, 17.0, -1.0, -2.0, 4.0],
        [2.0, -6.0, -1.0, 15.0, -1.0, 2.0],
        [2.0, 0.0, -2.0, -1.0, 6.0, 3.0],
        [0.0, -5.0, 4.0, 2.0, 3.0, 11.0],
    ];
    let solution = [2.0, 1.0, 5.0, 3.0, 4.0, 1.0];
    let mut random = Random::new(5);
    for k in 0..8 {
        let mut unit = || (26.0 * random.symmetric()).round().exp2();
        let mut of_x = [unit(), unit(), unit()];
        let of_f = if k % 2 == 0 {
            [1.0; 3]
        } else {
            [unit(), unit(), unit()]
        };
        if k == 0 {
            of_x = [-25, -24, 21].map(|e| f64::from(e).exp2());
        }
        let each = |units: [f64; 3]| [0, 0, 1, 1, 1, 2].map(|b: usize| units[b]);
        let (of_x, of_f) = (each(of_x), each(of_f));
        let scaled: Vec<Vec<f64>> = (0..6)
            .map(|i| (0..6).map(|j| rows[i][j] * of_f[i] * of_x[j]).collect())
            .collect();
        let q = (0..6).map(|i| -of_f[i] * (0..6).map(|j| rows[i][j] * solution[j]).sum::<f64>());
        let function = AffineFunction::new(Matrix::from_rows(&scaled).unwrap(), q.collect()).unwrap();
        let cones = vec![Cone::SecondOrder(2), Cone::SecondOrder(3), Cone::Semidefinite(1)];
        let problem = ConeProblem::new(function, cones).unwrap();
        let mut x = of_x.map(|unit| random.symmetric() / unit);
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        assert_ne!(
            report.status,
            Status::NoSolution,
            "{of_x:?} {of_f:?}: {:?}",
            report.ray
        );
        if report.is_solved() {
            let apart = (0..6).map(|i| (x[i] * of_x[i] - solution[i]).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-5, "{of_x:?} {of_f:?}: {x:?}");
        }
    }
}

/// F₁ = −x₂ − 1 is negative for all x in K, whatever the units of the two half-lines and of F are.
#[test]
fn infeasible_problems_are_refuted_in_any_units() {
    for (x, f) in [(0, 0), (-26, 0), (26, 13), (-20, 40), (30, -30)] {
        let (x, f) = (f64::from(x).exp2(), f64::from(f).exp2());
        let rows = [[0.0, -f / x], [x, 1.0]];
        let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![-f, 1.0]).unwrap();
        let problem = ConeProblem::new(function, vec![Cone::Nonnegative(2)]).unwrap();
        let report = ConeSolver::default()
            .solve(&problem, &mut [1.0 / x, 1.0])
            .unwrap();
        assert_eq!(report.status, Status::NoSolution, "{x:e} {f:e}");
        assert!(report.ray.unwrap().radius > 1e12, "{x:e} {f:e}");
    }
}

/// min cᵀx over A x = b in second-order cones and half-lines, with y planted such that −Aᵀy lies inside of
/// the cone and bᵀy > 0: no x in the cone has A x = b, by a margin. The unknowns are x, with F = c − Aᵀλ, and
/// λ, with F = A x − b.
fn strongly_infeasible(random: &mut Random, sizes: &[usize], rows: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
    let n: usize = sizes.iter().sum();
    let mut a: Vec<Vec<f64>> = (0..rows)
        .map(|_| (0..n).map(|_| random.normal()).collect())
        .collect();
    let mut y: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
    y[rows - 1] = 1.0 + random.unit();
    let mut inside = Vec::new();
    for &size in sizes {
        let tail: Vec<f64> = (1..size).map(|_| random.normal()).collect();
        inside.push(norm(&tail) + 0.1 + random.unit());
        inside.extend(tail);
    }
    for j in 0..n {
        let others: f64 = (0..rows - 1).map(|i| a[i][j] * y[i]).sum();
        a[rows - 1][j] = -(inside[j] + others) / y[rows - 1];
    }
    let mut b: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
    let others: f64 = (0..rows - 1).map(|i| b[i] * y[i]).sum();
    b[rows - 1] = (0.1 + random.unit() - others) / y[rows - 1];
    let mut m = vec![vec![0.0; n + rows]; n + rows];
    let mut q: Vec<f64> = (0..n).map(|_| random.normal()).collect();
    q.extend(b.iter().map(|b| -b));
    for (i, row) in a.iter().enumerate() {
        for (j, v) in row.iter().enumerate() {
            (m[n + i][j], m[j][n + i]) = (*v, -v);
        }
    }
    (m, q)
}

/// Every one of these programs is refuted, by a v in K with −Mᵀv in K* and qᵀv < 0.
#[test]
fn strongly_infeasible_programs_are_refuted() {
    let mut random = Random::new(11);
    for sizes in [&[3][..], &[5], &[10], &[3, 4], &[1, 1, 6, 2], &[30]] {
        let n: usize = sizes.iter().sum();
        for k in 0..60 {
            let rows = 1 + k % n.min(6);
            let (m, q) = strongly_infeasible(&mut random, sizes, rows);
            let mut cones: Vec<Cone> = sizes.iter().map(|&s| Cone::SecondOrder(s)).collect();
            cones.push(Cone::Free(rows));
            let function = AffineFunction::new(Matrix::from_rows(&m).unwrap(), q.clone()).unwrap();
            let problem = ConeProblem::new(function, cones).unwrap();
            let mut x = vec![0.0; n + rows];
            let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
            assert_eq!(report.status, Status::NoSolution, "{sizes:?} {k}: {report:?}");
            let v = &report.ray.as_ref().unwrap().direction;
            let value: f64 = q.iter().zip(v).map(|(q, v)| q * v).sum();
            let back = |j: usize| -(0..n + rows).map(|i| m[i][j] * v[i]).sum::<f64>();
            let mut at = 0;
            for &size in sizes {
                let image: Vec<f64> = (at..at + size).map(back).collect();
                assert!(
                    image[0] >= norm(&image[1..]) && v[at] >= norm(&v[at + 1..at + size]),
                    "{sizes:?} {k}"
                );
                at += size;
            }
            let left: f64 = (n..n + rows).map(|j| back(j).abs()).fold(0.0, f64::max);
            assert!(
                value < 0.0 && left <= 1e-12 * norm(v),
                "{sizes:?} {k}: {value} {left:e}"
            );
        }
    }
}

/// Equations that contradict each other, and a cone that they leave: x₀ − x₁ = −1, x₂ = 1 with x₀ ≥ ‖(x₁, x₂)‖.
#[test]
fn points_far_out_solve_no_contradiction() {
    let rows = [[1.0, -1.0, 1.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let matrix = Matrix::from_rows(&rows).unwrap();
    let equations = AffineFunction::new(matrix, vec![-2.0, -1.0, -1.0]).unwrap();
    let skew = [
        (3, 0, 1.0),
        (3, 1, -1.0),
        (0, 3, -1.0),
        (1, 3, 1.0),
        (4, 2, 1.0),
        (2, 4, -1.0),
    ];
    let matrix = Matrix::from_triplets(5, 5, &skew).unwrap();
    let cone = AffineFunction::new(matrix, vec![0.0, 0.0, 0.0, 1.0, -1.0]).unwrap();
    for (function, cones) in [
        (equations, vec![Cone::Free(3)]),
        (cone, vec![Cone::SecondOrder(3), Cone::Free(2)]),
    ] {
        let n = function.q().len();
        let problem = ConeProblem::new(function, cones).unwrap();
        for start in [0.0, 1.0, 1e8] {
            let mut x = vec![start; n];
            let options = ConeOptions::default().with_restarts(0).with_max_iterations(400);
            let report = ConeSolver::new(options).solve(&problem, &mut x).unwrap();
            assert_ne!(report.status, Status::Solved, "{start:e}: {x:?}");
        }
    }
}

/// M = (a, b; b, a) with a, b = (1 ± d)/2 is regular, so that there is a solution, 1/d far out; where d is not above rounding nothing is
/// claimed that a point contradicts.
#[test]
fn what_has_a_solution_is_not_refuted() {
    for d in [1e-2, 1e-8, 1e-12, 1e-14, 1e-15] {
        let (a, b) = (0.5 + 0.5 * d, 0.5 - 0.5 * d);
        let matrix = Matrix::from_rows(&[[a, b], [b, a]]).unwrap();
        let function = AffineFunction::new(matrix, vec![-0.5, 0.5]).unwrap();
        let problem = ConeProblem::new(function, vec![Cone::SecondOrder(2)]).unwrap();
        let mut x = [0.0; 2];
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        let is_claimed = report.status == Status::NoSolution;
        assert!(!is_claimed, "{d:e} {x:?} {:?}", report.ray);
    }
}
