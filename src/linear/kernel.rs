use super::{LinearError, spectral};
use crate::sparse::Matrix;

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

/// Kernels of `a` by singular values, those at most `rtol` times the largest counting as zero.
///
/// # Complexity
/// Dense: O(n³) operations and 8 n² bytes, n the longer side.
///
/// # Errors
/// [`LinearError::NotFinite`]; [`LinearError::TooLarge`]; [`LinearError::Solver`] should the iteration not converge.
pub fn null_space(a: &Matrix, rtol: f64) -> Result<NullSpace, LinearError> {
    let (left, _) = right_kernel(&a.transpose(), rtol)?;
    let (right, singular_values) = right_kernel(a, rtol)?;
    Ok(NullSpace {
        right,
        left,
        singular_values,
    })
}

/// The least singular value of a matrix that is not empty, and a unit vector v with ‖A v‖₂ equal to it; dense, O(n³).
pub(crate) fn least_singular_value(a: &Matrix) -> Result<(f64, Vec<f64>), LinearError> {
    let (mut vectors, values) = right_kernel(a, 1.0)?;
    let vector = vectors.pop().unwrap_or_default();
    Ok((values.last().copied().unwrap_or(0.0), vector))
}

/// The singular value decomposition of a matrix.
pub(crate) struct Decomposition {
    /// All right singular vectors, those of the largest singular values first; the last ones span the kernel.
    pub(crate) right: Vec<Vec<f64>>,
    /// All left singular vectors, in the same order. Those of equal singular values need not be the images of the right ones.
    pub(crate) left: Vec<Vec<f64>>,
    /// Singular values, largest first; as many as the shorter side.
    pub(crate) values: Vec<f64>,
}

/// The singular value decomposition of `a`; dense, O(n³) operations, n the longer side.
///
/// # Errors
/// As [`null_space`].
pub(crate) fn decompose(a: &Matrix) -> Result<Decomposition, LinearError> {
    let (left, _) = right_kernel(&a.transpose(), 1.0)?;
    let (right, values) = right_kernel(a, 1.0)?;
    Ok(Decomposition { right, left, values })
}

/// Basis of {v : A v = 0} and the singular values.
fn right_kernel(a: &Matrix, rtol: f64) -> Result<(Vec<Vec<f64>>, Vec<f64>), LinearError> {
    let (m, n) = (a.nrows(), a.ncols());
    let short = m.min(n);
    let rows = m.max(n);
    if short == 0 {
        let unit = |k| (0..n).map(|i| f64::from(i == k)).collect();
        return Ok(((0..n).map(unit).collect(), Vec::new()));
    }
    // Thin factors of a wide matrix leave out part of its kernel: zero rows complete them.
    let padded = spectral::scaled(a, rows)?;
    let unit = padded.unit;
    let (sigma, v_t) = spectral::singular_values(padded.entries)?;
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&p, &q| sigma[q].total_cmp(&sigma[p]));
    let limit = rtol * sigma[order[0]];
    let kernel = (order.iter().enumerate())
        // Singular values added by padding count as zero, though rounding may change them.
        .filter(|&(position, &k)| position >= short || sigma[k] <= limit)
        .map(|(_, &k)| v_t.row(k).iter().copied().collect())
        .collect();
    Ok((
        kernel,
        order[..short].iter().map(|&k| sigma[k] * unit * unit).collect(),
    ))
}
