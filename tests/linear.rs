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
        let scaled: Vec<f64> = base.triplets().map(|(i, j, v)| v * rows[i] * cols[j]).collect();
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
