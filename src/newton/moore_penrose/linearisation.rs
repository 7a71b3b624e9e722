use super::{Correction, Held, MoorePenrose};
use crate::input::check_length;
use crate::linear::{LinearError, LinearSolver};
use crate::piecewise::Selection;
use crate::sparse::Matrix;

/// The factored Jacobian ∇H^(σ) (n rows, n + 1 columns) of a selection at a point of a curve, its tangent and
/// what its determinants tell.
///
/// It borrows the [`MoorePenrose`] corrector that holds the factors, which therefore cannot factor anything
/// else as long as the linearisation is in use.
///
/// ```
/// use semismooth::{linear::AutoSolver, newton::MoorePenrose, piecewise::{MinMap, Selection}};
/// // y² = α, as the first piece of min(y² − α, 9).
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     (a[0], b[0]) = (x[0] * x[0] - x[1], 9.0);
/// });
/// let mut corrector = MoorePenrose::new(&map, AutoSolver::new())?;
/// let mut at = corrector.linearize(&map, &Selection::uniform(1, 0), &[1.0, 1.0], None)?;
/// assert_eq!((at.det_sign(), at.orientation(&[0.0, -1.0])), (Some(1), Some(-1))); // ∂H/∂y = 2
/// let mut moved = [0.0; 2]; // where H changes by 1 at fixed α
/// at.solve(&[1.0], &[0.0, 1.0], &mut moved)?;
/// assert!((moved[0] - 0.5).abs() < 1e-6 && moved[1].abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Linearisation<'c, L> {
    pub(in crate::newton) held: &'c mut MoorePenrose<L>,
}

impl<'c, L: LinearSolver> Linearisation<'c, L> {
    pub(in crate::newton) fn of(held: &'c mut MoorePenrose<L>) -> Self {
        Self { held }
    }

    /// The selection σ.
    #[must_use]
    pub fn selection(&self) -> &Selection {
        &self.held.selection
    }

    /// The point whose Jacobian is factored (length n + 1). `None` where
    /// [`linearize`](MoorePenrose::linearize) found an affine piece, whose Jacobian is the same at every
    /// point, and after chord steps, which leave the factors of a point nearby.
    #[must_use]
    pub fn point(&self) -> Option<&[f64]> {
        (self.held.held == Held::Point).then_some(self.held.point.as_slice())
    }

    /// The unit vector in the kernel of ∇H (length n + 1), with det [∇H; τᵀ] > 0 where the solver computes
    /// determinants and no rows have been replaced, else of either sign. After chord steps it is that at the
    /// corrected point.
    #[must_use]
    pub fn tangent(&self) -> &[f64] {
        match self.held.at_hand() {
            Some(updated) => updated.tangent(),
            None => self.held.bordered.tangent(),
        }
    }

    /// Sign of det [∇H; tᵀ] (`t` of length n + 1) of the factored Jacobian; 0 where `t` is orthogonal to the
    /// tangent, `None` where the solver computes no determinants or `t` is no direction.
    #[must_use]
    pub fn orientation(&self, t: &[f64]) -> Option<i8> {
        match self.held.at_hand() {
            Some(updated) => (t.len() == updated.tangent().len()).then(|| updated.orientation(t)),
            None => self.held.bordered.orientation(t),
        }
    }

    /// Sign of det ∇_yH (∇H without its last column) of the factored Jacobian; 0 at folds, `None` where the
    /// solver computes no determinants.
    #[must_use]
    pub fn det_sign(&self) -> Option<i8> {
        match self.held.at_hand() {
            Some(updated) => {
                let rate = updated.tangent().last().copied().filter(|rate| *rate != 0.0);
                let sign = updated.orientation(updated.tangent());
                Some(rate.map_or(0, |rate| sign * rate.signum() as i8))
            }
            None => self.held.bordered.det_sign(),
        }
    }

    /// Natural logarithm of |det [∇H; τᵀ]| of the factored Jacobian, τ its tangent; `None` where the solver
    /// computes no determinants.
    #[must_use]
    pub fn log_det(&self) -> Option<f64> {
        match self.held.at_hand() {
            Some(updated) => Some(updated.log_det()),
            None => self.held.bordered.log_det().map(|d| d.1),
        }
    }

    /// Reciprocal condition number of the matrix that is factored (∇H without one column), as the solver
    /// [estimates](LinearSolver::rcond) it; `None` where it does not, and for affine pieces that are held as
    /// changes of other factors, or by blocks.
    #[must_use]
    pub fn rcond(&mut self) -> Option<f64> {
        let replaced = self.held.held == Held::Updates;
        (!replaced).then(|| self.held.bordered.rcond()).flatten()
    }

    /// Solves ∇H x = r with t·x = 0 by the factors (`r` of length n, `t` and `x` of length n + 1).
    ///
    /// # Errors
    /// [`LinearError::Singular`] where `t` is orthogonal to the tangent; vectors of other lengths or not
    /// finite; errors of the solver.
    pub fn solve(&mut self, r: &[f64], t: &[f64], x: &mut [f64]) -> Result<(), LinearError> {
        check_length("the right-hand side", r.len(), self.held.r.len())?;
        check_length("the last row", t.len(), self.held.dx.len())?;
        check_length("the solution", x.len(), self.held.dx.len())?;
        self.held.r.copy_from_slice(r);
        self.solve_across(t)?;
        x.copy_from_slice(&self.held.dx);
        Ok(())
    }

    /// ∇H dx = r with dx normal to t, for the vectors of the corrector.
    pub(in crate::newton) fn solve_across(&mut self, t: &[f64]) -> Result<(), LinearError> {
        let held = &mut *self.held;
        match &mut held.updated {
            Some((_, updated)) if held.held == Held::Updates => match held.condensed.base() {
                Some(base) => updated.solve_across(&held.r, t, &mut held.dx, base),
                None => updated.solve_across(&held.r, t, &mut held.dx, &mut held.bordered),
            },
            _ => held.bordered.solve(&held.r, t, 0.0, &mut held.dx),
        }
    }

    /// y ← the solution of ∇Hᵀ y + s t = g; `None` where it cannot be found, and for affine pieces that are
    /// held as changes of other factors, or by blocks.
    pub(in crate::newton) fn solve_transpose(&mut self, g: &[f64], t: &[f64], y: &mut [f64]) -> Option<()> {
        let replaced = self.held.held == Held::Updates;
        let solved = (!replaced).then(|| self.held.bordered.solve_transpose(g, t, y))?;
        solved.ok().map(drop)
    }
}

/// A correction that has just ended, with the residual and the Jacobian that were computed last.
pub(crate) struct Corrected<'c, L> {
    pub(crate) correction: Correction,
    at: Linearisation<'c, L>,
}

impl<'c, L: LinearSolver> Corrected<'c, L> {
    pub(super) fn of(correction: Correction, held: &'c mut MoorePenrose<L>) -> Self {
        let at = Linearisation::of(held);
        Self { correction, at }
    }

    /// H at the corrected point.
    pub(crate) fn residual(&self) -> &[f64] {
        &self.at.held.r
    }

    /// ∇H at the corrected point after chord steps, else at the iterate before it.
    pub(crate) fn jacobian(&self) -> &Matrix {
        &self.at.held.jac
    }

    pub(crate) fn linearisation(self) -> Linearisation<'c, L> {
        self.at
    }
}
