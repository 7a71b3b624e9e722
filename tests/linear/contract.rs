//! The contract of linear solvers: determinants, reuse, misuse; Cholesky and kernels.

use crate::random::Random;
use crate::support::{check_solves, dense, factored, general_solvers, laplacian, sparse};
use semismooth::InputError;
use semismooth::linear::{
    AutoSolver, Cholesky, DENSE_LIMIT, DenseLu, LinearError, LinearSolver, SparseLu, null_space,
};
use semismooth::sparse::{Matrix, MatrixRef, Pattern, PatternRef};

/// Determinant by expansion along the first row.
fn cofactor_det(a: &[Vec<f64>]) -> f64 {
    if a.is_empty() {
        return 1.0;
    }
    (0..a.len())
        .map(|j| {
            let minor: Vec<Vec<f64>> = a[1..]
                .iter()
                .map(|r| (0..r.len()).filter(|c| *c != j).map(|c| r[c]).collect())
                .collect();
            (if j % 2 == 0 { 1.0 } else { -1.0 }) * a[0][j] * cofactor_det(&minor)
        })
        .sum()
}

fn rows_of(a: &Matrix) -> Vec<Vec<f64>> {
    (0..a.nrows())
        .map(|i| (0..a.ncols()).map(|j| a.get(i, j)).collect())
        .collect()
}

#[test]
fn determinants_match_cofactors() {
    let mut rng = Random::new(17);
    for n in 1..=5 {
        for round in 0..20 {
            let a = match round % 2 {
                0 => dense(n, &mut rng),
                _ => sparse(n, 2, 0.5, &mut rng),
            };
            let det = cofactor_det(&rows_of(&a));
            if det.abs() < 1e-6 {
                continue;
            }
            for solver in [
                &mut factored(DenseLu::new(), &a).unwrap() as &mut dyn LinearSolver,
                &mut factored(SparseLu::with_determinants(), &a).unwrap(),
            ] {
                let (sign, log) = solver.log_det().unwrap();
                assert_eq!(f64::from(sign), det.signum());
                assert!((log - det.abs().ln()).abs() < 1e-9, "{log} {det}");
            }
        }
    }
    // Larger: the two routes of dense LU, and sparse LU, against each other; a row exchange turns the sign.
    for n in [48, 60, 130] {
        let a = sparse(n, 3, 0.3, &mut rng);
        let mut rows = rows_of(&a);
        let (sign, log) = factored(DenseLu::new(), &a).unwrap().log_det().unwrap();
        let other = factored(SparseLu::with_determinants(), &a).unwrap();
        let (sparse_sign, sparse_log) = other.log_det().unwrap();
        assert_eq!(sign, sparse_sign);
        assert!((log - sparse_log).abs() < 1e-9);
        rows.swap(0, n / 2);
        let swapped = Matrix::from_rows(&rows).unwrap();
        let (other, other_log) = factored(DenseLu::new(), &swapped).unwrap().log_det().unwrap();
        assert_eq!(other, -sign);
        assert!((log - other_log).abs() < 1e-9);
    }
}

#[test]
fn cholesky_solves_and_refuses() {
    let mut rng = Random::new(29);
    for m in [1, 3, 8, 40] {
        let a = laplacian(m, false);
        let mut solver = factored(Cholesky::new(), &a).unwrap();
        check_solves(&mut solver, &a, 1, &mut rng, 1e-14);
        check_solves(&mut solver, &a, 70, &mut rng, 1e-14);
        let (sign, log) = solver.log_det().unwrap();
        let lu = factored(SparseLu::with_determinants(), &a).unwrap();
        let (lu_sign, lu_log) = lu.log_det().unwrap();
        assert_eq!((sign, lu_sign), (1, 1));
        assert!((log - lu_log).abs() < 1e-9 * log.abs().max(1.0));
        // Entries above the diagonal are not read.
        let mut b = a.clone();
        let values: Vec<f64> = a
            .triplets()
            .map(|(i, j, v)| if i < j { 99.0 } else { v })
            .collect();
        b.values_mut().copy_from_slice(&values);
        let other = factored(Cholesky::new(), &b).unwrap();
        assert_eq!(other.log_det().unwrap(), (sign, log));
    }
    // A dense one is eliminated by blocks.
    let n = 90;
    let half = dense(n, &mut rng);
    let mut a = Matrix::zeros(Pattern::full(n, n));
    for i in 0..n {
        for j in 0..n {
            let dot: f64 = (0..n).map(|k| half.get(i, k) * half.get(j, k)).sum();
            a.add(i, j, dot);
        }
    }
    let mut solver = factored(Cholesky::new(), &a).unwrap();
    check_solves(&mut solver, &a, 3, &mut rng, 1e-13);
    let log = factored(DenseLu::new(), &a).unwrap().log_det().unwrap().1;
    assert!((solver.log_det().unwrap().1 - log).abs() < 1e-8);

    let indefinite = Matrix::from_rows(&[[1.0, 2.0], [2.0, 1.0]]).unwrap();
    let no_diagonal = Matrix::from_triplets(2, 2, &[(0, 0, 1.0), (1, 0, 0.1)]).unwrap();
    for a in [indefinite, no_diagonal, laplacian(2, true), laplacian(20, true)] {
        let e = factored(Cholesky::new(), &a).map(|_| ()).unwrap_err();
        assert_eq!(e, LinearError::NotPositiveDefinite);
    }
}

#[test]
fn refactoring_reuses_the_analysis() {
    let mut rng = Random::new(31);
    let a = laplacian(30, false);
    for mut solver in [
        Box::new(SparseLu::new()) as Box<dyn LinearSolver>,
        Box::new(Cholesky::new()),
        Box::new(AutoSolver::new()),
    ] {
        solver.analyze(a.pattern().as_ref()).unwrap();
        for scale in [1.0, 7.0, 1e-20] {
            let mut b = a.clone();
            b.values_mut().iter_mut().for_each(|v| *v *= scale);
            solver.analyze(b.pattern().as_ref()).unwrap();
            solver.factor(b.as_ref()).unwrap();
            check_solves(&mut solver, &b, 2, &mut rng, 1e-13);
        }
        // A failure leaves the solver usable, without old factors.
        let mut b = a.clone();
        b.values_mut()[3] = f64::NAN;
        let e = solver.factor(b.as_ref()).unwrap_err();
        assert!(matches!(e, LinearError::NotFinite { .. }));
        let mut x = vec![1.0; a.nrows()];
        assert_eq!(solver.solve_in_place(&mut x), Err(LinearError::NotFactored));
        solver.factor(a.as_ref()).unwrap();
        check_solves(&mut solver, &a, 1, &mut rng, 1e-13);
        // Another pattern.
        let c = laplacian(9, false);
        assert_eq!(solver.factor(c.as_ref()), Err(LinearError::NotAnalyzed));
        solver.analyze(c.pattern().as_ref()).unwrap();
        solver.factor(c.as_ref()).unwrap();
        check_solves(&mut solver, &c, 1, &mut rng, 1e-13);
    }
}

#[test]
fn auto_chooses_by_size_and_filling() {
    let mut solver = AutoSolver::new();
    let side = (DENSE_LIMIT as f64).sqrt() as usize + 1;
    for (a, dense) in [
        (laplacian(3, false), true),
        (laplacian(side, false), false),
        (
            Matrix::zeros(Pattern::full(DENSE_LIMIT + 1, DENSE_LIMIT + 1)),
            true,
        ),
        (Matrix::identity(DENSE_LIMIT), true),
    ] {
        solver.analyze(a.pattern().as_ref()).unwrap();
        assert_eq!(solver.is_dense(), dense, "n = {}", a.nrows());
    }
}

#[test]
fn bad_input_is_an_error() {
    let a = Matrix::from_rows(&[[2.0, 1.0], [1.0, 3.0]]).unwrap();
    let wide = Pattern::full(2, 3);
    let empty = Matrix::zeros(Pattern::full(0, 0));
    let mut solvers = general_solvers();
    solvers.push(("cholesky", Box::new(Cholesky::new())));
    for (name, mut s) in solvers {
        assert_eq!(s.factor(a.as_ref()), Err(LinearError::NotAnalyzed), "{name}");
        assert_eq!(s.solve_in_place(&mut [1.0, 2.0]), Err(LinearError::NotFactored));
        assert_eq!(s.rcond(), None);
        assert_eq!(s.log_det(), None);
        let not_square = LinearError::NotSquare { nrows: 2, ncols: 3 };
        assert_eq!(s.analyze(wide.as_ref()), Err(not_square));
        let broken = PatternRef {
            nrows: 2,
            ncols: 2,
            col_ptr: &[0, 2, 4],
            row_idx: &[0, 1, 0, 5],
        };
        let e = s.analyze(broken).unwrap_err();
        assert!(matches!(e, LinearError::Solver { .. }), "{name}: {e}");
        assert_eq!(
            s.solve_transpose_in_place(&mut [1.0]),
            Err(LinearError::NotFactored)
        );

        s.analyze(a.pattern().as_ref()).unwrap();
        assert_eq!(s.solve_in_place(&mut [1.0, 2.0]), Err(LinearError::NotFactored));
        let short = MatrixRef {
            pattern: a.pattern().as_ref(),
            values: &[1.0],
        };
        assert!(
            matches!(
                s.factor(short),
                Err(LinearError::Input(InputError::Length { .. }))
            ),
            "{name}"
        );
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut b = a.clone();
            b.values_mut()[1] = value;
            let e = s.factor(b.as_ref()).unwrap_err();
            assert!(matches!(e, LinearError::NotFinite { .. }), "{name}: {e}");
        }
        s.factor(a.as_ref()).unwrap();
        let e = s.solve_in_place(&mut [1.0, 2.0, 3.0]).unwrap_err();
        assert!(
            matches!(e, LinearError::Input(InputError::Length { .. })),
            "{name}: {e}"
        );
        let e = s.solve_in_place(&mut [1.0, f64::NAN]).unwrap_err();
        assert!(matches!(e, LinearError::NotFinite { .. }), "{name}: {e}");
        let mut none: [f64; 0] = [];
        s.solve_in_place(&mut none).unwrap();
        // An overflow of the solution is an error, too.
        let mut tiny = a.clone();
        tiny.values_mut().iter_mut().for_each(|v| *v *= 1e-300);
        s.factor(tiny.as_ref()).unwrap();
        let e = s.solve_in_place(&mut [1e300, 1e300]).unwrap_err();
        assert!(matches!(e, LinearError::Inaccurate { .. }), "{name}: {e}");
        let zero = Matrix::zeros(Pattern::full(2, 2));
        let e = s.factor(zero.as_ref()).unwrap_err();
        let known = LinearError::Singular { rcond: 0.0 };
        assert!(e == known || e == LinearError::NotPositiveDefinite, "{name}: {e}");

        s.analyze(empty.pattern().as_ref()).unwrap();
        s.factor(empty.as_ref()).unwrap();
        s.solve_in_place(&mut none).unwrap();
        s.solve_transpose_in_place(&mut none).unwrap();
        assert_eq!(s.log_det().map(|d| d.0), Some(1), "{name}");
        assert!(s.solve_in_place(&mut [1.0]).is_err(), "{name}");
    }
}

#[test]
fn kernels_of_any_shape() {
    let mut rng = Random::new(41);
    for (m, n, rank) in [
        (3, 3, 2),
        (4, 5, 4),
        (5, 4, 4),
        (4, 6, 2),
        (7, 3, 1),
        (3, 4, 0),
        (6, 6, 6),
    ] {
        let (p, q) = (rng.vector(m * rank, 1.0), rng.vector(rank * n, 1.0));
        let mut a = Matrix::zeros(Pattern::full(m, n));
        for i in 0..m {
            for j in 0..n {
                a.add(i, j, (0..rank).map(|k| p[i * rank + k] * q[k * n + j]).sum());
            }
        }
        let space = null_space(&a, 1e-12).unwrap();
        assert_eq!(space.right.len(), n - rank, "{m} x {n}, rank {rank}");
        assert_eq!(space.left.len(), m - rank, "{m} x {n}, rank {rank}");
        assert_eq!(space.singular_values.len(), m.min(n));
        assert!(space.singular_values.is_sorted_by(|a, b| a >= b));
        for (basis, transpose) in [(&space.right, false), (&space.left, true)] {
            for (k, v) in basis.iter().enumerate() {
                assert_eq!(v.len(), if transpose { m } else { n });
                let mut image = vec![0.0; if transpose { n } else { m }];
                if transpose {
                    a.mul_transpose_vec(v, &mut image);
                } else {
                    a.mul_vec(v, &mut image);
                }
                assert!(image.iter().all(|y| y.abs() < 1e-13));
                for (l, w) in basis.iter().enumerate() {
                    let dot: f64 = v.iter().zip(w).map(|(a, b)| a * b).sum();
                    assert!((dot - f64::from(k == l)).abs() < 1e-13);
                }
            }
        }
    }
    let empty = null_space(&Matrix::zeros(Pattern::full(0, 2)), 1e-12).unwrap();
    assert_eq!((empty.right.len(), empty.left.len()), (2, 0));
    let mut bad = Matrix::identity(2);
    bad.values_mut()[0] = f64::NAN;
    assert!(null_space(&bad, 1e-12).is_err());
}
