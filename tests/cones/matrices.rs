//! Semidefinite matrices: problems with known solutions, and programs without points.

use super::random::Random;
use super::{monotone_of, norm};
use semismooth::complementarity::AffineFunction;
use semismooth::cones::{Cone, ConeOptions, ConeProblem, ConeSolver, smat, svec};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

/// Matrices of order two are the second-order cone in three variables, ((a + b)/√2, (a − b)/√2, √2 c): both solvers find one solution.
#[test]
fn matrices_of_order_two_are_a_second_order_cone() {
    let s = std::f64::consts::FRAC_1_SQRT_2;
    // From (a, √2 c, b).
    let turn = |z: &[f64]| vec![s * (z[0] + z[2]), s * (z[0] - z[2]), z[1]];
    let back = |w: &[f64]| vec![s * (w[0] + w[1]), w[2], s * (w[0] - w[1])];
    let both = |f: &dyn Fn(&[f64]) -> Vec<f64>, z: &[f64]| [f(&z[..3]), f(&z[3..])].concat();
    let mut random = Random::new(3);
    for case in 0..100 {
        let rows = monotone_of(6, &mut random);
        let q = random.vector(6, 3.0);
        let matrix = Matrix::from_rows(&rows).unwrap();
        let first = AffineFunction::new(matrix, q.clone()).unwrap();
        // T M Tᵀ, column by column; T is orthogonal.
        let column = |j: usize| {
            let mut e = [0.0; 6];
            e[j] = 1.0;
            let e = both(&back, &e);
            let m: Vec<f64> = rows
                .iter()
                .map(|r| r.iter().zip(&e).map(|(r, e)| r * e).sum())
                .collect();
            both(&turn, &m)
        };
        let columns: Vec<Vec<f64>> = (0..6).map(column).collect();
        let turned: Vec<Vec<f64>> = (0..6).map(|i| columns.iter().map(|c| c[i]).collect()).collect();
        let second = AffineFunction::new(Matrix::from_rows(&turned).unwrap(), both(&turn, &q)).unwrap();
        let solve = |f: AffineFunction, cone: Cone| {
            let problem = ConeProblem::new(f, vec![cone; 2]).unwrap();
            let mut x = [0.0; 6];
            let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
            assert!(report.is_solved(), "{case}: {:?}", report.status);
            x
        };
        let x = solve(first, Cone::Semidefinite(2));
        let w = solve(second, Cone::SecondOrder(3));
        let same = both(&turn, &x).iter().zip(&w).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(same, "{case}: {x:?} {w:?}");
    }
}

/// Strongly monotone problems in matrices are solved at the pair (X, F) from which they are built, whether or not the ranks add up to the
/// order.
#[test]
fn matrix_problems_built_from_their_solution() {
    let mut random = Random::new(17);
    for case in 0..60 {
        let order = 2 + case % 5;
        let n = order * (order + 1) / 2;
        let rank = random.below(order + 1);
        let other = random.below(order + 1 - rank);
        // Orthonormal columns by Gram and Schmidt.
        let mut basis: Vec<Vec<f64>> = Vec::new();
        while basis.len() < order {
            let mut v = random.vector(order, 1.0);
            for b in &basis {
                let along: f64 = v.iter().zip(b).map(|(v, b)| v * b).sum();
                v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
            }
            let length = norm(&v);
            basis.push(v.iter().map(|v| v / length).collect());
        }
        let mut sum = |from: usize, to: usize| {
            let mut rows = vec![vec![0.0; order]; order];
            for b in &basis[from..to] {
                let value = random.between(0.5, 2.0);
                for i in 0..order {
                    (0..order).for_each(|j| rows[i][j] += value * b[i] * b[j]);
                }
            }
            svec(&rows).unwrap()
        };
        let (x, f) = (sum(0, rank), sum(rank, rank + other));
        let rows = monotone_of(n, &mut random);
        let image = |i: usize| rows[i].iter().zip(&x).map(|(r, x)| r * x).sum::<f64>();
        let q = (0..n).map(|i| f[i] - image(i)).collect();
        let function = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), q).unwrap();
        let problem = ConeProblem::new(function, vec![Cone::Semidefinite(order)]).unwrap();
        let mut found = random.vector(n, 5.0);
        let report = ConeSolver::default().solve(&problem, &mut found).unwrap();
        assert!(report.is_solved(), "{case}: {:?}", report.status);
        let far = found
            .iter()
            .zip(&x)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(far < 1e-9, "{case}: {far:e}");
    }
}

/// The conditions of min ⟨C, X⟩ with ⟨A_k, X⟩ = b_k, X semidefinite, in (y, X): ⟨A_k, X⟩ − b_k = 0 and C − Σ y_k A_k ⟂ X.
fn program(order: usize, cost: &[f64], rows: &[(Vec<f64>, f64)]) -> ConeProblem<AffineFunction> {
    let (k, n) = (rows.len(), order * (order + 1) / 2);
    let mut entries = Vec::new();
    for (r, (a, _)) in rows.iter().enumerate() {
        for (j, v) in a.iter().enumerate() {
            entries.extend([(r, k + j, *v), (k + j, r, -v)]);
        }
    }
    let q = rows.iter().map(|r| -r.1).chain(cost.iter().copied()).collect();
    let f = AffineFunction::new(Matrix::from_triplets(k + n, k + n, &entries).unwrap(), q).unwrap();
    ConeProblem::new(f, vec![Cone::Free(k), Cone::Semidefinite(order)]).unwrap()
}

fn unit_matrix(order: usize, i: usize, j: usize) -> Vec<f64> {
    let mut rows = vec![vec![0.0; order]; order];
    rows[i][j] = 1.0;
    rows[j][i] = 1.0;
    svec(&rows).unwrap()
}

/// Lovász (1979): ϑ of a circle of n vertices, n odd, is n cos(π/n)/(1 + cos(π/n)), √5 for five.
#[test]
fn lovasz_numbers_of_circles() {
    for n in [3, 5, 7] {
        let identity: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
            .collect();
        let mut rows = vec![(svec(&identity).unwrap(), 1.0)];
        rows.extend((0..n).map(|i| (unit_matrix(n, i, (i + 1) % n), 0.0)));
        let cost = svec(&vec![vec![-1.0; n]; n]).unwrap();
        let problem = program(n, &cost, &rows);
        let mut x = vec![0.0; problem.len()];
        let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{n}: {:?}", report.status);
        let value: f64 = x[rows.len()..].iter().zip(&cost).map(|(x, c)| -x * c).sum();
        let cos = (std::f64::consts::PI / n as f64).cos();
        assert!(
            (value - n as f64 * cos / (1.0 + cos)).abs() < 1e-8,
            "{n}: {value}"
        );
    }
}

/// X₁₁ = −1 has no semidefinite X, and neither have X₁₁ = 0, X₁₂ = 1.
#[test]
fn semidefinite_programs_without_points() {
    let problem = program(2, &[1.0, 0.0, 1.0], &[(unit_matrix(2, 0, 0), -1.0)]);
    let mut x = vec![0.0; problem.len()];
    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
    assert_eq!(report.status, Status::NoSolution);
    let ray = report.ray.unwrap();
    // v = (y, X): y X₁₁ = 1, and −Mᵀv in K*.
    assert!((ray.value + 1.0).abs() < 1e-9 && ray.radius > 1e12, "{ray:?}");
    let rows = [(unit_matrix(2, 0, 0), 0.0), (unit_matrix(2, 0, 1), 2.0)];
    let problem = program(2, &[1.0, 0.0, 1.0], &rows);
    let mut x = vec![0.0; problem.len()];
    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
    assert!(!report.is_solved(), "{report:?}");
    // All conditions hold here except X₁₁ = ε, which is rounding compared with X₂₂ = 1/ε, but not compared with the data.
    let e = 1e-8;
    let mut x = [1.0 - 1.0 / (e * e), 1.0 / e, e, std::f64::consts::SQRT_2, 1.0 / e];
    let few = ConeOptions::default().with_max_iterations(1).with_restarts(0);
    let report = ConeSolver::new(few).solve(&problem, &mut x).unwrap();
    assert!(!report.is_solved(), "{report:?}");
}

/// N. Higham (2002): the correlation matrix nearest to a tridiagonal one, against alternating projections with Dykstra's correction.
#[test]
fn nearest_correlation_matrices() {
    let order = 4;
    let entry = |i: usize, j: usize| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    };
    let rows: Vec<Vec<f64>> = (0..order)
        .map(|i| (0..order).map(|j| entry(i, j)).collect())
        .collect();
    let given = svec(&rows).unwrap();
    // F = (diag X − e, X − A − Diag y).
    let (n, mut entries) = (given.len(), Vec::new());
    for j in 0..n {
        entries.push((order + j, order + j, 1.0));
    }
    for (k, place) in [0, 2, 5, 9].into_iter().enumerate() {
        entries.extend([(k, order + place, 1.0), (order + place, k, -1.0)]);
    }
    let q = [vec![-1.0; order], given.iter().map(|v| -v).collect()].concat();
    let f = AffineFunction::new(Matrix::from_triplets(order + n, order + n, &entries).unwrap(), q).unwrap();
    let problem = ConeProblem::new(f, vec![Cone::Free(order), Cone::Semidefinite(order)]).unwrap();
    let mut x = vec![0.0; order + n];
    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
    assert!(report.is_solved());
    let found = smat(&x[order..]).unwrap();
    let (mut y, mut correction) = (given, vec![0.0; n]);
    for _ in 0..3000 {
        let mut r: Vec<f64> = y.iter().zip(&correction).map(|(y, c)| y - c).collect();
        let before = r.clone();
        Cone::Semidefinite(order).project(&mut r);
        correction
            .iter_mut()
            .zip(r.iter().zip(&before))
            .for_each(|(c, (r, b))| *c = r - b);
        y = r;
        [0, 2, 5, 9].into_iter().for_each(|k| y[k] = 1.0);
    }
    assert!(y.iter().zip(&x[order..]).all(|(a, b)| (a - b).abs() < 1e-9));
    // As printed by Higham, section 4.
    for (i, j, v) in [(0, 1, -0.8084), (0, 2, 0.1916), (0, 3, 0.1068), (1, 2, -0.6562)] {
        assert!((found[i][j] - v).abs() < 5e-5, "{found:?}");
    }
}
