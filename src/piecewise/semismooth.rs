use crate::sparse::{Matrix, Pattern};

/// A semismooth map H: ℝⁿ → ℝⁿ without a finite list of pieces (Fischer–Burmeister functions, projections on smooth cones).
///
/// Newton's method needs no more than an element of the generalized Jacobian; transitions cannot be located for such maps.
/// Where a map is piecewise smooth implement [`PiecewiseSmooth`](super::PiecewiseSmooth) instead.
///
/// ```
/// use semismooth::{newton::Newton, piecewise::Semismooth, sparse::Matrix};
/// /// Fischer–Burmeister: x + F − √(x² + F²) = 0 with F(x) = x − 2 says x ≥ 0, F ≥ 0, x F = 0.
/// struct Fb;
/// impl Semismooth for Fb {
///     fn num_vars(&self) -> usize { 1 }
///     fn residual(&self, x: &[f64], out: &mut [f64]) {
///         let f = x[0] - 2.0;
///         out[0] = x[0] + f - x[0].hypot(f);
///     }
///     fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
///         let f = x[0] - 2.0;
///         let n = x[0].hypot(f).max(f64::MIN_POSITIVE);
///         jac.add(0, 0, 2.0 - (x[0] + f) / n);
///     }
/// }
/// let mut x = [0.5];
/// Newton::default().solve_semismooth(&Fb, &mut x)?;
/// assert!((x[0] - 2.0).abs() < 1e-10);
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
pub trait Semismooth {
    /// Number n of variables and residuals.
    fn num_vars(&self) -> usize;

    /// The residual H(x), of length n.
    fn residual(&self, x: &[f64], out: &mut [f64]);

    /// Adds an element of the generalized (B- or Clarke) Jacobian at x to a zeroed matrix over [`pattern`](Self::pattern).
    fn jacobian(&self, x: &[f64], jac: &mut Matrix);

    /// All elements of the B-subdifferential ∂_B H(x), the limits of ∇H(x_k) along points x_k → x at which H is differentiable, each at least
    /// once and over the [pattern](Self::pattern), if they are finitely many. Arguments of kinks count as 0 up to `tolerance`, since at
    /// solutions they vanish only up to rounding.
    ///
    /// `None` where the map cannot give them, where they are infinitely many, and where they may be more than `cap`. Default: `None`.
    /// [`bd_regularity_semismooth`](super::bd_regularity_semismooth) has an example.
    fn b_subdifferential(&self, _x: &[f64], _tolerance: f64, _cap: u64) -> Option<Vec<Matrix>> {
        None
    }

    /// The sparsity pattern of Jacobians (n × n). Default: full.
    fn pattern(&self) -> Pattern {
        Pattern::full(self.num_vars(), self.num_vars())
    }
}

macro_rules! forward {
    () => {
        fn num_vars(&self) -> usize {
            (**self).num_vars()
        }
        fn residual(&self, x: &[f64], out: &mut [f64]) {
            (**self).residual(x, out);
        }
        fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
            (**self).jacobian(x, jac);
        }
        fn b_subdifferential(&self, x: &[f64], tolerance: f64, cap: u64) -> Option<Vec<Matrix>> {
            (**self).b_subdifferential(x, tolerance, cap)
        }
        fn pattern(&self) -> Pattern {
            (**self).pattern()
        }
    };
}

impl<S: Semismooth + ?Sized> Semismooth for &S {
    forward!();
}

impl<S: Semismooth + ?Sized> Semismooth for Box<S> {
    forward!();
}
