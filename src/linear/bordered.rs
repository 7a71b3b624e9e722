use super::{AutoSolver, LinearError, LinearSolver};
use crate::sparse::{Matrix, Pattern};

/// The bordered systems of continuation, `[∇H; tᵀ] x = [r; c]` with ∇H of n rows and n + 1 columns, without a dense row ever
/// being stored.
///
/// One column k of ∇H is left out (its coordinate is *frozen*), the square rest is factored, and the solution is the
/// combination of a particular one with x_k = 0 and the kernel vector with v_k = 1.
#[derive(Debug, Clone)]
pub struct Bordered<L = AutoSolver> {
    solver: L,
}

impl<L: LinearSolver> Bordered<L> {
    /// A workspace for Jacobians over `pattern` (n rows, n + 1 columns).
    ///
    /// # Errors
    /// [`LinearError::Shape`] unless there is exactly one column more than rows; errors of `solver`.
    pub fn new(pattern: &Pattern, solver: L) -> Result<Self, LinearError> {
        let _ = pattern;
        Ok(Self { solver })
    }

    /// Factors ∇H. `hint` is an approximate tangent (length n + 1) from which the frozen coordinate is chosen.
    ///
    /// # Errors
    /// [`LinearError::Kernel`] when ∇H has not full rank, [`LinearError::NotFinite`], and errors of the solver.
    pub fn factor(&mut self, jacobian: &Matrix, hint: Option<&[f64]>) -> Result<(), LinearError> {
        let _ = (jacobian, hint);
        todo!()
    }

    /// The unit vector spanning the kernel of ∇H (length n + 1); its sign makes det [∇H; τᵀ] > 0 where the solver knows
    /// determinants, else it is that of the frozen coordinate.
    #[must_use]
    pub fn tangent(&self) -> &[f64] {
        todo!()
    }

    /// Solves `[∇H; tᵀ] x = [r; c]` (`r` of length n, `t` and `x` of length n + 1).
    ///
    /// # Errors
    /// [`LinearError::Singular`] when `t` is orthogonal to the kernel; errors of the solver.
    pub fn solve(&mut self, r: &[f64], t: &[f64], c: f64, x: &mut [f64]) -> Result<(), LinearError> {
        let _ = (r, t, c, x);
        todo!()
    }

    /// Sign of det [∇H; tᵀ], where the solver knows determinants.
    #[must_use]
    pub fn orientation(&self, t: &[f64]) -> Option<i8> {
        let _ = t;
        todo!()
    }

    /// Sign of det ∇_yH (∇H without its last column), where the solver knows determinants; 0 when it is singular.
    #[must_use]
    pub fn det_sign(&self) -> Option<i8> {
        todo!()
    }

    /// stub
    #[must_use]
    pub fn log_det(&self) -> Option<(i8, f64)> {
        todo!()
    }

    /// The frozen coordinate k of the last factorisation.
    #[must_use]
    pub fn frozen(&self) -> usize {
        todo!()
    }

    /// Number of numeric factorisations made so far.
    #[must_use]
    pub fn factorisations(&self) -> usize {
        todo!()
    }

    /// The solver behind the seam.
    #[must_use]
    pub fn solver(&self) -> &L {
        &self.solver
    }
}
