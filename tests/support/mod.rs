//! Matrices and checks that the tests of linear solvers share.

use crate::random::Random;
use semismooth::linear::{AutoSolver, DenseLu, LinearError, LinearSolver, SparseLu};
use semismooth::sparse::{Matrix, Pattern};

pub(crate) fn dense(n: usize, rng: &mut Random) -> Matrix {
    Matrix::from_values(Pattern::full(n, n), rng.vector(n * n, 1.0)).unwrap()
}

/// A random sparse matrix with a dominant or merely a full diagonal.
pub(crate) fn sparse(n: usize, per_column: usize, diagonal: f64, rng: &mut Random) -> Matrix {
    let mut triplets: Vec<_> = (0..n).map(|j| (j, j, diagonal + rng.symmetric())).collect();
    for j in 0..n {
        for _ in 0..per_column {
            let i = ((rng.symmetric() + 1.0) / 2.0 * n as f64) as usize % n;
            triplets.push((i, j, rng.symmetric()));
        }
    }
    Matrix::from_triplets(n, n, &triplets).unwrap()
}

/// The five-point Laplacian on an m × m grid; `neumann` makes it singular.
pub(crate) fn laplacian(m: usize, neumann: bool) -> Matrix {
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

pub(crate) fn factored<S: LinearSolver>(mut solver: S, a: &Matrix) -> Result<S, LinearError> {
    solver.analyze(a.pattern().as_ref())?;
    solver.factor(a.as_ref())?;
    Ok(solver)
}

/// Norm-wise backward error of A x = b (or of the transposed system).
pub(crate) fn residual(a: &Matrix, x: &[f64], b: &[f64], transpose: bool) -> f64 {
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
pub(crate) fn check_solves(
    solver: &mut dyn LinearSolver,
    a: &Matrix,
    rhs: usize,
    rng: &mut Random,
    tol: f64,
) {
    let n = a.nrows();
    for transpose in [false, true] {
        let b = rng.vector(n * rhs, 1.0);
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

pub(crate) fn general_solvers() -> Vec<(&'static str, Box<dyn LinearSolver>)> {
    vec![
        ("dense", Box::new(DenseLu::new())),
        ("sparse", Box::new(SparseLu::new())),
        ("sparse, det", Box::new(SparseLu::with_determinants())),
        ("auto", Box::new(AutoSolver::new())),
    ]
}
