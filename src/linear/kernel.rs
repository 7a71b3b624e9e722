use nalgebra::DMatrix;

use super::LinearError;
use super::memory::check_finite;
use crate::sparse::Matrix;

/// Most sweeps of the singular value iteration for each row of the matrix; convergence takes a handful.
const SWEEPS: usize = 100;

/// Orthonormal bases of the kernels of a matrix and of its transpose.
#[derive(Debug, Clone, PartialEq)]
pub struct NullSpace {
    /// Basis of {v : A v = 0}; each vector has one entry a column of A.
    pub right: Vec<Vec<f64>>,
    /// Basis of {w : Aᵀ w = 0}; each vector has one entry a row of A.
    pub left: Vec<Vec<f64>>,
    /// Singular values, largest first; as many as the shorter side of A.
    pub singular_values: Vec<f64>,
}

/// Kernels of `a` by singular values, those at most `rtol` times the largest counting as zero. Dense: O(n³).
///
/// # Errors
/// [`LinearError::NotFinite`]; [`LinearError::Solver`] should the iteration not converge.
pub fn null_space(a: &Matrix, rtol: f64) -> Result<NullSpace, LinearError> {
    check_finite(a.values(), "the matrix")?;
    let mut dense = DMatrix::zeros(a.nrows(), a.ncols());
    for (i, j, v) in a.triplets() {
        dense[(i, j)] = v;
    }
    let (left, _) = right_kernel(dense.transpose(), rtol)?;
    let (right, singular_values) = right_kernel(dense, rtol)?;
    Ok(NullSpace {
        right,
        left,
        singular_values,
    })
}

/// Basis of {v : A v = 0} and the singular values.
fn right_kernel(a: DMatrix<f64>, rtol: f64) -> Result<(Vec<Vec<f64>>, Vec<f64>), LinearError> {
    let (m, n) = a.shape();
    let short = m.min(n);
    if short == 0 {
        let unit = |k| (0..n).map(|i| f64::from(i == k)).collect();
        return Ok(((0..n).map(unit).collect(), Vec::new()));
    }
    // Thin factors of a wide matrix leave out part of its kernel: zero rows complete them.
    let padded = a.resize_vertically(m.max(n), 0.0);
    let failed = || LinearError::Solver {
        what: "the singular value iteration did not converge".to_owned(),
    };
    let svd = padded
        .try_svd(false, true, 5.0 * f64::EPSILON, SWEEPS * n)
        .ok_or_else(failed)?;
    let v_t = svd.v_t.ok_or_else(failed)?;
    let sigma = svd.singular_values;
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&p, &q| sigma[q].total_cmp(&sigma[p]));
    let limit = rtol * sigma[order[0]];
    let kernel = (order.iter().enumerate())
        // The values that padding added are zero whatever rounding says.
        .filter(|&(position, &k)| position >= short || sigma[k] <= limit)
        .map(|(_, &k)| v_t.row(k).iter().copied().collect())
        .collect();
    Ok((kernel, order[..short].iter().map(|&k| sigma[k]).collect()))
}
