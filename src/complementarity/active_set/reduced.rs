use super::ActiveSetOptions;
use crate::InputError;
use crate::complementarity::{BoundState, ComplementarityError, Lcp};
use crate::linear::LinearError;
use crate::sparse::Matrix;

/// A start for an active-set method.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The point.
    pub z: Vec<f64>,
    /// The state of each component.
    pub states: Vec<BoundState>,
}

/// A solver for the reduced systems M_FF d_F = r_F of an active-set method; F are the free components.
///
/// Implement it to bring a preconditioner or a solver of your own. `load` comes first, then `select` before each `solve`
/// with another set; lengths that do not fit the matrix loaded are errors.
pub trait ReducedSolver {
    /// Receives the matrix of a problem.
    ///
    /// # Errors
    /// A matrix that the solver cannot handle.
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError>;

    /// Chooses the free components, one entry an unknown, and factors or prepares what is needed. `matrix` is the one that was
    /// loaded.
    ///
    /// # Errors
    /// [`LinearError::Singular`] or [`LinearError::NotPositiveDefinite`], wrapped, for a matrix that cannot be solved with.
    fn select(&mut self, matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError>;

    /// Overwrites `d` by the solution, 0 outside F; `r` (arbitrary outside F) may be overwritten. An iterative solver may stop when a norm
    /// of the residual has fallen by the factor `tolerance`; returns the number of iterations, 0 for a direct solver.
    ///
    /// # Errors
    /// As [`select`](Self::select).
    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError>;

    /// Whether solutions are exact up to rounding whatever the tolerance.
    fn is_direct(&self) -> bool;

    /// A start, point and sets, from coarser versions of the problem, if the solver has any. Called when nothing is known about the
    /// solution. Default: none.
    ///
    /// # Errors
    /// Those of the solves on coarser levels.
    fn coarse_start(
        &mut self,
        _lcp: &Lcp,
        _options: &ActiveSetOptions,
    ) -> Result<Option<Start>, ComplementarityError> {
        Ok(None)
    }
}

pub(super) fn check_square(matrix: &Matrix) -> Result<(), ComplementarityError> {
    let (nrows, ncols) = (matrix.nrows(), matrix.ncols());
    match nrows == ncols {
        true => Ok(()),
        false => Err(LinearError::NotSquare { nrows, ncols }.into()),
    }
}

/// Checks lengths against the order of the matrix that was loaded.
pub(super) fn check_order(order: usize, found: &[(&'static str, usize)]) -> Result<(), ComplementarityError> {
    match found.iter().find(|f| f.1 != order) {
        None => Ok(()),
        Some(&(what, found)) => Err(ComplementarityError::Input(InputError::Length {
            what,
            expected: order,
            found,
        })),
    }
}

/// Symmetry up to rounding.
pub(super) fn is_symmetric(matrix: &Matrix) -> bool {
    let other = matrix.transpose();
    matrix.pattern().col_ptr() == other.pattern().col_ptr()
        && matrix.pattern().row_idx() == other.pattern().row_idx()
        && (matrix.values().iter().zip(other.values()))
            .all(|(a, b)| (a - b).abs() <= 1e-12 * a.abs().max(b.abs()))
}
