use super::{LinearError, Preconditioner};
use crate::sparse::Matrix;

/// A square matrix A known by its products, with a preconditioner.
///
/// The argument of [`Krylov`](super::Krylov) methods. A [`Matrix`] is one without a preconditioner, [`Preconditioned`] one with it.
///
/// ```
/// use semismooth::linear::{Krylov, LinearError, LinearOperator};
/// /// Second differences of n values between zeros: (A x)ᵢ = 2 xᵢ − xᵢ₋₁ − xᵢ₊₁.
/// struct Differences(usize);
/// impl LinearOperator for Differences {
///     fn order(&self) -> usize { self.0 }
///     fn product(&mut self, x: &[f64], y: &mut [f64]) {
///         let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
///         y.iter_mut().enumerate().for_each(|(i, y)| *y = 2.0 * at(i) - at(i.wrapping_sub(1)) - at(i + 1));
///     }
/// }
/// let mut b = [1.0; 9];
/// let report = Krylov::cg().solve(&mut Differences(9), &mut b, 1e-12)?;
/// assert!(report.is_solved() && report.iterations <= 9);
/// assert!((b[4] - 12.5).abs() < 1e-10);
/// # Ok::<(), LinearError>(())
/// ```
pub trait LinearOperator {
    /// Number n of rows and columns.
    fn order(&self) -> usize;

    /// `y = A x`, both of length n; the content of `y` before does not matter.
    fn product(&mut self, x: &[f64], y: &mut [f64]);

    /// `y = Aᵀ x`. `false`, with `y` unchanged, where such products are not available: the default.
    fn transpose_product(&mut self, _x: &[f64], _y: &mut [f64]) -> bool {
        false
    }

    /// Overwrites `b` (length n) by P⁻¹ b for a P near A. Default: P is the identity.
    ///
    /// CG and MINRES need a symmetric positive definite P, fixed during a solve; GMRES one that is fixed, flexible GMRES any.
    ///
    /// # Errors
    /// A failure of the solve, which ends the method with this error.
    fn precondition(&mut self, _b: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

impl LinearOperator for Matrix {
    fn order(&self) -> usize {
        self.nrows()
    }

    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        self.mul_vec(x, y);
    }

    fn transpose_product(&mut self, x: &[f64], y: &mut [f64]) -> bool {
        self.mul_transpose_vec(x, y);
        true
    }
}

/// A matrix with a [`Preconditioner`] that was prepared for it or for one near it.
///
/// ```
/// use semismooth::linear::{IncompleteLu, Krylov, Preconditioned, Preconditioner};
/// use semismooth::sparse::Matrix;
/// let a = Matrix::from_rows(&[[4.0, -1.0, 0.0], [-2.0, 4.0, -1.0], [0.0, -2.0, 4.0]])?;
/// let mut ilu = IncompleteLu::default();
/// ilu.prepare(a.as_ref())?;
/// let mut b = [3.0, 1.0, 2.0];
/// let report = Krylov::gmres(30).solve(&mut Preconditioned::new(&a, &mut ilu), &mut b, 1e-12)?;
/// // Nothing is left out of these factors.
/// assert_eq!(report.iterations, 1);
/// assert!(b.iter().all(|x| (x - 1.0).abs() < 1e-12));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Preconditioned<'a, P> {
    matrix: &'a Matrix,
    preconditioner: &'a mut P,
}

impl<'a, P: Preconditioner> Preconditioned<'a, P> {
    /// A square matrix, and a preconditioner prepared for it.
    #[must_use]
    pub fn new(matrix: &'a Matrix, preconditioner: &'a mut P) -> Self {
        Self {
            matrix,
            preconditioner,
        }
    }
}

impl<P: Preconditioner> LinearOperator for Preconditioned<'_, P> {
    fn order(&self) -> usize {
        self.matrix.nrows()
    }

    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        self.matrix.mul_vec(x, y);
    }

    fn transpose_product(&mut self, x: &[f64], y: &mut [f64]) -> bool {
        self.matrix.mul_transpose_vec(x, y);
        true
    }

    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.preconditioner.apply(b)
    }
}
