//! Linear solvers: every answer is checked by reconstruction.

use proptest::prelude::*;
use semismooth::linear::{
    AutoSolver, Cholesky, DENSE_LIMIT, DenseLu, LinearError, LinearSolver, SparseLu, null_space,
};
use semismooth::sparse::{Matrix, MatrixRef, Pattern, PatternRef};

/// A small generator, so that the tests need no crate for it: xorshift64*.
struct Rng(u64);

impl Rng {
    /// Uniform in [-1, 1).
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        bits as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vec(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
}

fn dense(n: usize, rng: &mut Rng) -> Matrix {
    Matrix::from_values(Pattern::full(n, n), rng.vec(n * n)).unwrap()
}

/// A random sparse matrix with a dominant or a merely full diagonal.
fn sparse(n: usize, per_column: usize, diagonal: f64, rng: &mut Rng) -> Matrix {
    let mut triplets: Vec<_> = (0..n).map(|j| (j, j, diagonal + rng.next())).collect();
    for j in 0..n {
        for _ in 0..per_column {
            let i = ((rng.next() + 1.0) / 2.0 * n as f64) as usize % n;
            triplets.push((i, j, rng.next()));
        }
    }
    Matrix::from_triplets(n, n, &triplets).unwrap()
}

/// The five-point Laplacian on an m × m grid; `neumann` makes it singular.
fn laplacian(m: usize, neumann: bool) -> Matrix {
    let mut t = Vec::new();
    for x in 0..m {
        for y in 0..m {
            let k = x * m + y;
            let mut degree = 0.0;
            let mut link = |there: bool, other: usize| {
                if there {
                    degree += 1.0;
                    t.push((k, other, -1.0));
                }
            };
            link(x > 0, k.wrapping_sub(m));
            link(x + 1 < m, k + m);
            link(y > 0, k.wrapping_sub(1));
            link(y + 1 < m, k + 1);
            t.push((k, k, if neumann { degree } else { 4.0 }));
        }
    }
    Matrix::from_triplets(m * m, m * m, &t).unwrap()
}

fn factored<S: LinearSolver>(mut solver: S, a: &Matrix) -> Result<S, LinearError> {
    solver.analyze(a.pattern().as_ref())?;
    solver.factor(a.as_ref())?;
    Ok(solver)
}

/// Norm-wise backward error of A x = b (or of the transposed system).
fn residual(a: &Matrix, x: &[f64], b: &[f64], transpose: bool) -> f64 {
    let mut r = vec![0.0; b.len()];
    if transpose {
        a.mul_transpose_vec(x, &mut r);
    } else {
        a.mul_vec(x, &mut r);
    }
    let max = |v: &[f64]| v.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let norm = if transpose {
        a.as_ref().norm_1()
    } else {
        a.transpose().as_ref().norm_1()
    };
    let d: Vec<f64> = r.iter().zip(b).map(|(r, b)| r - b).collect();
    max(&d) / (norm * max(x) + max(b) + f64::MIN_POSITIVE)
}

/// Solves with several right-hand sides, plain and transposed, and checks each.
fn check_solves(solver: &mut dyn LinearSolver, a: &Matrix, rhs: usize, rng: &mut Rng, tol: f64) {
    let n = a.nrows();
    for transpose in [false, true] {
        let b = rng.vec(n * rhs);
        let mut x = b.clone();
        if transpose {
            solver.solve_transpose_in_place(&mut x).unwrap();
        } else {
            solver.solve_in_place(&mut x).unwrap();
        }
        for (x, b) in x.chunks(n).zip(b.chunks(n)) {
            let r = residual(a, x, b, transpose);
            assert!(r < tol, "n = {n}, transpose {transpose}: residual {r:e}");
        }
    }
}

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

fn general_solvers() -> Vec<(&'static str, Box<dyn LinearSolver>)> {
    vec![
        ("dense", Box::new(DenseLu::new())),
        ("sparse", Box::new(SparseLu::new())),
        ("sparse, det", Box::new(SparseLu::with_determinants())),
        ("auto", Box::new(AutoSolver::new())),
    ]
}

#[test]
fn all_solvers_reconstruct_random_right_hand_sides() {
    let mut rng = Rng(7);
    for n in [1, 2, 3, 4, 5, 13, 49, 50, 51, 120, 230] {
        for a in [dense(n, &mut rng), sparse(n, 3, 4.0, &mut rng)] {
            for (name, solver) in general_solvers() {
                let mut solver = factored(solver, &a).unwrap_or_else(|e| panic!("{name} {n}: {e}"));
                check_solves(&mut solver, &a, 1, &mut rng, 1e-13);
                check_solves(&mut solver, &a, 37, &mut rng, 1e-13);
            }
        }
    }
}

#[test]
fn singular_matrices_are_named_singular() {
    let mut rng = Rng(3);
    for n in [2, 3, 4, 5, 10, 49, 50, 90] {
        for _ in 0..20 {
            // The product of n × (n - 1) and (n - 1) × n factors.
            let (p, q) = (rng.vec(n * (n - 1)), rng.vec(n * (n - 1)));
            let mut a = Matrix::zeros(Pattern::full(n, n));
            for i in 0..n {
                for j in 0..n {
                    for k in 0..n - 1 {
                        a.add(i, j, p[i * (n - 1) + k] * q[k * n + j]);
                    }
                }
            }
            for (name, solver) in general_solvers() {
                let e = factored(solver, &a).map(|_| ()).unwrap_err();
                let named = matches!(e, LinearError::Singular { rcond } if rcond < 1e-14);
                assert!(named, "{name} {n}: {e}");
            }
        }
    }
    for m in [2, 5, 12, 40] {
        let a = laplacian(m, true);
        for (name, solver) in general_solvers() {
            if m == 40 && name == "dense" {
                continue;
            }
            let e = factored(solver, &a).map(|_| ()).unwrap_err();
            assert!(matches!(e, LinearError::Singular { .. }), "{name} {m}: {e}");
        }
    }
}

#[test]
fn structurally_singular_matrices_are_named_singular() {
    let mut rng = Rng(11);
    for n in [3, 10, 60, 300] {
        // Two columns with one and the same single row.
        let mut t: Vec<_> = (0..n).map(|j| (j, j, 2.0 + rng.next())).collect();
        t[1] = (0, 1, 1.0);
        t.extend((2..n).map(|j| (1, j, rng.next())));
        t.extend((2..n).map(|j| ((j * 7) % n, j, rng.next())));
        let a = Matrix::from_triplets(n, n, &t).unwrap();
        for (name, solver) in general_solvers() {
            let e = factored(solver, &a).map(|_| ()).unwrap_err();
            assert!(matches!(e, LinearError::Singular { .. }), "{name} {n}: {e}");
        }
    }
}

#[test]
fn units_do_not_make_a_matrix_singular() {
    let mut rng = Rng(5);
    for n in [2, 4, 6, 60] {
        let base = sparse(n, 2, 3.0, &mut rng);
        let mut a = base.clone();
        // Small matrices in wild units, larger ones in two systems of them (GPa and m against Pa and nm).
        let mut units = |up: bool| match (n < 10, up) {
            (true, _) => 10_f64.powf(12.0 * rng.next()),
            (false, true) => 1e9,
            (false, false) => 1e-9,
        };
        let rows: Vec<f64> = (0..n).map(|i| units(i < n / 2)).collect();
        let cols: Vec<f64> = (0..n).map(|j| units(j % 2 == 0)).collect();
        let scaled: Vec<f64> = base
            .triplets()
            .map(|(i, j, v)| v * rows[i] * cols[j])
            .collect();
        a.values_mut().copy_from_slice(&scaled);
        for (name, solver) in general_solvers() {
            let mut solver = factored(solver, &a).unwrap_or_else(|e| panic!("{name} {n}: {e}"));
            assert!(solver.rcond().unwrap() > 1e-6);
            // In the unscaled unknowns the error is small entry by entry.
            let y = rng.vec(n);
            let mut b = vec![0.0; n];
            base.mul_vec(&y, &mut b);
            b.iter_mut().zip(&rows).for_each(|(b, r)| *b *= r);
            solver.solve_in_place(&mut b).unwrap();
            for i in 0..n {
                assert!((b[i] * cols[i] - y[i]).abs() < 1e-9, "{name} {n}");
            }
        }
    }
    let diagonal = Matrix::from_triplets(2, 2, &[(0, 0, 1.0), (1, 1, 1e-12)]).unwrap();
    assert!(factored(DenseLu::new(), &diagonal).is_ok());
    assert!(factored(Cholesky::new(), &diagonal).is_ok());
}

#[test]
fn hilbert_is_an_error_or_a_small_residual() {
    for n in [6, 9, 12, 14] {
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| 1.0 / (i + j + 1) as f64).collect())
            .collect();
        let a = Matrix::from_rows(&rows).unwrap();
        for (name, solver) in general_solvers() {
            match factored(solver, &a) {
                Ok(mut s) => {
                    let mut x = vec![1.0; n];
                    s.solve_in_place(&mut x).unwrap();
                    assert!(residual(&a, &x, &vec![1.0; n], false) < 1e-14, "{name} {n}");
                    assert!(s.rcond().unwrap() < 1e-5);
                }
                Err(LinearError::Singular { rcond }) => assert!(n >= 11 && rcond < 1e-14),
                Err(e) => panic!("{name} {n}: {e}"),
            }
        }
    }
}

#[test]
fn growth_of_pivots_is_no_silent_wrong_answer() {
    // Wilkinson's matrix: entries grow to 2^(n-1).
    for n in [45, 70] {
        let mut a = Matrix::zeros(Pattern::full(n, n));
        for i in 0..n {
            for j in 0..i {
                a.add(i, j, -1.0);
            }
            a.add(i, i, 1.0);
            if i + 1 < n {
                a.add(i, n - 1, 1.0);
            }
        }
        let mut rng = Rng(23);
        for (name, solver) in general_solvers() {
            let b = rng.vec(n);
            let mut x = b.clone();
            let done = factored(solver, &a).and_then(|mut s| s.solve_in_place(&mut x));
            let wrong = done.is_ok() && residual(&a, &x, &b, false) > 1e-9;
            assert!(!wrong, "{name} {n}");
        }
    }
}

#[test]
fn determinants_match_cofactors() {
    let mut rng = Rng(17);
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
        let (other, other_log) = factored(DenseLu::new(), &swapped)
            .unwrap()
            .log_det()
            .unwrap();
        assert_eq!(other, -sign);
        assert!((log - other_log).abs() < 1e-9);
    }
}

#[test]
fn cholesky_solves_and_refuses() {
    let mut rng = Rng(29);
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
        // What stands above the diagonal is not read.
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
    for a in [
        indefinite,
        no_diagonal,
        laplacian(2, true),
        laplacian(20, true),
    ] {
        let e = factored(Cholesky::new(), &a).map(|_| ()).unwrap_err();
        assert_eq!(e, LinearError::NotPositiveDefinite);
    }
}

#[test]
fn refactoring_reuses_the_analysis() {
    let mut rng = Rng(31);
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
        // A failure leaves the solver usable, and no old factors behind.
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
        assert_eq!(
            s.factor(a.as_ref()),
            Err(LinearError::NotAnalyzed),
            "{name}"
        );
        assert_eq!(
            s.solve_in_place(&mut [1.0, 2.0]),
            Err(LinearError::NotFactored)
        );
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
        assert_eq!(
            s.solve_in_place(&mut [1.0, 2.0]),
            Err(LinearError::NotFactored)
        );
        let short = MatrixRef {
            pattern: a.pattern().as_ref(),
            values: &[1.0],
        };
        assert!(
            matches!(s.factor(short), Err(LinearError::Shape { .. })),
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
        assert!(matches!(e, LinearError::Shape { .. }), "{name}: {e}");
        let e = s.solve_in_place(&mut [1.0, f64::NAN]).unwrap_err();
        assert!(matches!(e, LinearError::NotFinite { .. }), "{name}: {e}");
        let mut none: [f64; 0] = [];
        s.solve_in_place(&mut none).unwrap();
        // Overflow of the solution is no answer either.
        let mut tiny = a.clone();
        tiny.values_mut().iter_mut().for_each(|v| *v *= 1e-300);
        s.factor(tiny.as_ref()).unwrap();
        let e = s.solve_in_place(&mut [1e300, 1e300]).unwrap_err();
        assert!(matches!(e, LinearError::Inaccurate { .. }), "{name}: {e}");
        let zero = Matrix::zeros(Pattern::full(2, 2));
        let e = s.factor(zero.as_ref()).unwrap_err();
        let known = LinearError::Singular { rcond: 0.0 };
        assert!(
            e == known || e == LinearError::NotPositiveDefinite,
            "{name}: {e}"
        );

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
    let mut rng = Rng(41);
    for (m, n, rank) in [
        (3, 3, 2),
        (4, 5, 4),
        (5, 4, 4),
        (4, 6, 2),
        (7, 3, 1),
        (3, 4, 0),
        (6, 6, 6),
    ] {
        let (p, q) = (rng.vec(m * rank), rng.vec(rank * n));
        let mut a = Matrix::zeros(Pattern::full(m, n));
        for i in 0..m {
            for j in 0..n {
                a.add(
                    i,
                    j,
                    (0..rank).map(|k| p[i * rank + k] * q[k * n + j]).sum(),
                );
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn solvers_agree_under_permutations(seed in 1_u64..u64::MAX, n in 1_usize..30) {
        let mut rng = Rng(seed);
        let a = sparse(n, 2, 3.5, &mut rng);
        // Reversing rows and rotating columns permutes right-hand side and solution.
        let triplets: Vec<_> = a
            .triplets()
            .map(|(i, j, v)| (n - 1 - i, (j + 1) % n, v))
            .collect();
        let p = Matrix::from_triplets(n, n, &triplets).unwrap();
        let b = rng.vec(n);
        let reversed: Vec<f64> = b.iter().rev().copied().collect();
        for (_, solver) in general_solvers() {
            let mut x = b.clone();
            let mut y = reversed.clone();
            factored(solver, &a).unwrap().solve_in_place(&mut x).unwrap();
            factored(DenseLu::new(), &p).unwrap().solve_in_place(&mut y).unwrap();
            for j in 0..n {
                prop_assert!((x[j] - y[(j + 1) % n]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn no_matrix_makes_a_solver_panic(
        n in 1_usize..12,
        entries in prop::collection::vec((0_usize..12, 0_usize..12, prop::num::f64::ANY), 0..60),
    ) {
        let entries: Vec<_> = entries.into_iter().map(|(i, j, v)| (i % n, j % n, v)).collect();
        let a = Matrix::from_triplets(n, n, &entries).unwrap();
        let mut solvers = general_solvers();
        solvers.push(("cholesky", Box::new(Cholesky::new())));
        for (name, solver) in solvers {
            let mut x = vec![1.0; n];
            if let Ok(mut solver) = factored(solver, &a)
                && name != "cholesky"
                && solver.solve_in_place(&mut x).is_ok()
            {
                let finite = x.iter().all(|v| v.is_finite());
                prop_assert!(finite, "{name}");
            }
        }
    }
}

#[test]
fn blocked_elimination_meets_structural_singularity_and_nan() {
    let mut rng = Rng(53);
    for round in 0..60 {
        let n = 20 + round;
        // A few columns share too few rows; the rest is dense enough to be eliminated by blocks.
        let (crowd, rows) = (2 + round % 7, 1 + round % 5);
        let crowd = crowd.max(rows + 1);
        let mut t = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let inside = if j % 3 == 0 && j / 3 < crowd {
                    i % 11 < 1 && i / 11 < rows
                } else {
                    rng.next() > -0.4
                };
                if inside {
                    t.push((i, j, rng.next()));
                }
            }
        }
        let a = Matrix::from_triplets(n, n, &t).unwrap();
        for solver in [SparseLu::new(), SparseLu::with_determinants()] {
            let e = factored(solver, &a).map(|_| ()).unwrap_err();
            assert!(matches!(e, LinearError::Singular { .. }), "{n}: {e}");
        }
    }
    // By blocks the determinant is unknown, unless asked for.
    let a = dense(300, &mut rng);
    assert_eq!(factored(SparseLu::new(), &a).unwrap().log_det(), None);
    assert!(
        factored(SparseLu::with_determinants(), &a)
            .unwrap()
            .log_det()
            .is_some()
    );
    let mut bad = a.clone();
    bad.values_mut()[777] = f64::NAN;
    let e = factored(SparseLu::new(), &bad).map(|_| ()).unwrap_err();
    assert!(matches!(e, LinearError::NotFinite { .. }));
}
