//! Singular values and eigenvalues through nalgebra, whose iterations divide zeros where numbers underflow and panic over the NaN that
//! follows: arguments are made finite and of moderate size, results are checked.

use nalgebra::{DMatrix, DVector};

use super::LinearError;
use super::memory::{check_finite, dense_zeros};
use crate::sparse::Matrix;
use crate::spread::golden;
use crate::tolerances::STEPS;

/// Entries below this part of the largest one are zero: their squares underflow.
pub(crate) const NEGLIGIBLE: f64 = 1e-140;

/// Accuracy of the iterations.
pub(crate) const ACCURACY: f64 = 5.0 * f64::EPSILON;

/// A full matrix with entries below 4, and the power of two by whose square it was divided.
pub(super) struct ScaledMatrix {
    pub(super) entries: DMatrix<f64>,
    pub(super) unit: f64,
}

/// `a` in `rows` rows, at least its own; those added are zero.
pub(super) fn scaled(a: &Matrix, rows: usize) -> Result<ScaledMatrix, LinearError> {
    check_finite(a.values(), "the matrix")?;
    let zeros = dense_zeros(rows, a.ncols())?;
    let mut entries = DMatrix::from_vec(rows, a.ncols(), zeros);
    let largest = a.values().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    // Halved exponents, as 2¹⁰²³ has no reciprocal.
    let half = if largest > 0.0 {
        (largest.log2() / 2.0).floor()
    } else {
        0.0
    };
    let (down, least) = ((-half).exp2(), NEGLIGIBLE * largest);
    for (i, j, v) in a.triplets() {
        if v.abs() > least {
            entries[(i, j)] = v * down * down;
        }
    }
    Ok(ScaledMatrix {
        entries,
        unit: half.exp2(),
    })
}

fn failed(what: &str) -> LinearError {
    LinearError::Solver {
        what: format!("the iteration for {what} did not converge"),
    }
}

/// Singular values in no order and the rows of Vᵀ that belong to them.
pub(super) fn singular_values(m: DMatrix<f64>) -> Result<(Vec<f64>, DMatrix<f64>), LinearError> {
    let what = "singular values";
    // A handful of sweeps a row suffices, as below.
    let sweeps = STEPS * m.ncols();
    let svd = m
        .try_svd_unordered(false, true, ACCURACY, sweeps)
        .ok_or_else(|| failed(what))?;
    let v_t = svd.v_t.ok_or_else(|| failed(what))?;
    let sigma = svd.singular_values.as_slice().to_vec();
    check_finite(&sigma, what).map_err(|_| failed(what))?;
    check_finite(v_t.as_slice(), what).map_err(|_| failed(what))?;
    Ok((sigma, v_t))
}

/// Eigenvalues of a symmetric matrix, whose lower triangle is read, in no order.
pub(super) fn symmetric(m: DMatrix<f64>) -> Result<Vec<f64>, LinearError> {
    let sweeps = STEPS * m.nrows();
    if m.nrows() == 0 {
        return Ok(Vec::new());
    }
    let found = m.try_symmetric_eigen(ACCURACY, sweeps);
    let values = found.map(|e| e.eigenvalues.as_slice().to_vec());
    values
        .filter(|v| v.iter().all(|v| v.is_finite()))
        .ok_or_else(|| failed("eigenvalues"))
}

/// Eigenvalues of a square matrix (real part, imaginary part), in no order.
pub(super) fn any(m: DMatrix<f64>) -> Result<Vec<(f64, f64)>, LinearError> {
    let sweeps = STEPS * m.nrows();
    if m.nrows() == 0 {
        return Ok(Vec::new());
    }
    let values = |m: DMatrix<f64>, shift: f64| -> Option<Vec<(f64, f64)>> {
        let all = m.try_schur(ACCURACY, sweeps)?.complex_eigenvalues();
        let all: Vec<_> = all.iter().map(|z| (z.re - shift, z.im)).collect();
        let finite = all.iter().all(|z| z.0.is_finite() && z.1.is_finite());
        finite.then_some(all)
    };
    // The shifts of the iteration leave some matrices unchanged, cyclic permutations among them, and its test for convergence is too strict
    // between entries that vanish on the diagonal: another basis, with the diagonal moved away from 0, avoids both.
    let elsewhere = || {
        let shift = 2.0 * m.norm();
        let mut other = reflected(&m);
        (0..m.nrows()).for_each(|i| other[(i, i)] += shift);
        values(other, shift)
    };
    values(m.clone(), 0.0)
        .or_else(elsewhere)
        .ok_or_else(|| failed("eigenvalues"))
}

/// H m H for a generic reflection H.
fn reflected(m: &DMatrix<f64>) -> DMatrix<f64> {
    let w = DVector::from_fn(m.nrows(), |i, _| 1.0 + golden(i + 1)).normalize();
    let rows = m - &w * (w.transpose() * m) * 2.0;
    &rows - (&rows * &w) * w.transpose() * 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{eigenvalues, generalized_eigenvalues, null_space, symmetric_eigenvalues};

    /// Finite matrices of all sizes of entries, with zeros, equal rows and numbers near the ends of the range, lead to finite numbers or
    /// an error, never to a panic.
    #[test]
    fn finite_matrices_do_not_panic() {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        for case in 0..3000_u32 {
            let n = 1 + (next() % 7) as usize;
            let reach = [0, 3, 40, 160, 300][case as usize % 5];
            let mut entry = || match next() % 8 {
                0..3 => 0.0,
                3 => 1.0,
                4 => [f64::MAX, f64::MIN_POSITIVE, 5e-324][next() as usize % 3] * 0.9,
                _ => {
                    let exponent = (next() % (2 * reach + 1)) as i32 - reach as i32;
                    (1.0 + (next() % 1000) as f64 / 500.0) * 10_f64.powi(exponent)
                }
            };
            let mut rows: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| entry()).collect()).collect();
            if case % 3 == 0 {
                rows[n - 1] = rows[0].clone();
            }
            let a = Matrix::from_rows(&rows).unwrap();
            if let Ok(found) = null_space(&a, 1e-12) {
                let mut all = found.right.iter().chain(&found.left).flatten();
                assert!(all.all(|v| v.is_finite()), "{rows:?}");
                assert!(found.singular_values.windows(2).all(|w| w[0] >= w[1]));
            }
            if let Ok(values) = eigenvalues(&a) {
                assert_eq!(values.len(), n);
            }
            let _ = symmetric_eigenvalues(&a);
            let _ = generalized_eigenvalues(&a, &a);
        }
    }

    /// Cyclic permutations, which the usual shifts leave unchanged, have the roots of unity as eigenvalues.
    #[test]
    fn eigenvalues_of_cycles_are_roots_of_unity() {
        for n in 3..9 {
            let cycle: Vec<_> = (0..n).map(|i| (i, (i + 1) % n, 1.0)).collect();
            let values = eigenvalues(&Matrix::from_triplets(n, n, &cycle).unwrap()).unwrap();
            for k in 0..n {
                let (im, re) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
                let near = values.iter().filter(|z| (z.0 - re).hypot(z.1 - im) < 1e-13);
                assert_eq!(near.count(), 1, "{n}: {values:?}");
            }
        }
    }

    /// The kernel does not depend on the units, over the whole range of numbers.
    #[test]
    fn kernels_do_not_depend_on_units() {
        let rows = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.5], [-1.0, -2.0, 1.0]];
        for unit in [1.0, 2_f64.powi(1000), 2_f64.powi(-1000)] {
            let scaled = rows.map(|r| r.map(|v| v * unit));
            let found = null_space(&Matrix::from_rows(&scaled).unwrap(), 1e-12).unwrap();
            assert_eq!(found.right.len(), 1);
            let v = &found.right[0];
            assert!((v[0] + 2.0 * v[1]).abs() < 1e-14 && v[2].abs() < 1e-14 && v[0].abs() > 0.8);
            assert!((found.singular_values[0] / unit - 8.744_3).abs() < 1e-3);
        }
    }
}
