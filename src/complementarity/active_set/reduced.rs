use super::nested::algebraic_start;
use super::{ActiveSetOptions, DirectReduced, MultigridReduced};
use crate::InputError;
use crate::complementarity::{BoundState, ComplementarityError, Lcp};
use crate::linear::{LinearError, WORTH, aggregation_hierarchy};
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

/// Direct solves for small, full or unsymmetric matrices, conjugate gradients with multigrid for large sparse symmetric ones; should
/// these not converge, direct ones again.
#[derive(Debug, Clone, Default)]
pub struct AutoReduced {
    direct: DirectReduced,
    iterative: Option<Box<MultigridReduced>>,
    /// The set selected, should the direct solver have to take over.
    free: Vec<bool>,
    matrix: Option<Matrix>,
}

impl AutoReduced {
    /// A solver without a matrix.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

/// Whether multigrid serves a matrix: large, sparse, symmetric, its diagonal positive.
pub(super) fn suits_multigrid(matrix: &Matrix) -> bool {
    matrix.nrows() >= WORTH && is_sparse_and_positive(matrix)
}

/// Whether a matrix is sparse, symmetric and has a positive diagonal.
fn is_sparse_and_positive(matrix: &Matrix) -> bool {
    let n = matrix.nrows();
    matrix.values().len() < n * 60 && is_symmetric(matrix) && {
        let diagonal = |i| matrix.get(i, i);
        (0..n).all(|i| diagonal(i) > 0.0)
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

impl ReducedSolver for AutoReduced {
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        self.iterative = None;
        self.matrix = None;
        if suits_multigrid(matrix) {
            let mut iterative = MultigridReduced::algebraic();
            match iterative.load(matrix) {
                Ok(()) => {
                    self.iterative = Some(Box::new(iterative));
                    self.matrix = Some(matrix.clone());
                    return Ok(());
                }
                Err(ComplementarityError::Linear(LinearError::NotPositiveDefinite)) => {}
                Err(e) => return Err(e),
            }
        }
        self.direct.load(matrix)
    }

    fn select(&mut self, matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError> {
        match &mut self.iterative {
            Some(iterative) => {
                self.free.clear();
                self.free.extend_from_slice(free);
                iterative.select(matrix, free)
            }
            None => self.direct.select(matrix, free),
        }
    }

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        if let (Some(iterative), Some(matrix)) = (&mut self.iterative, &self.matrix) {
            let rhs = r.to_vec();
            match iterative.solve(r, d, tolerance) {
                Err(ComplementarityError::Linear(_)) => {
                    r.copy_from_slice(&rhs);
                    self.direct.load(matrix)?;
                    self.direct.select(matrix, &self.free)?;
                }
                result => return result,
            }
            self.iterative = None;
            self.matrix = None;
        }
        self.direct.solve(r, d, tolerance)
    }

    fn is_direct(&self) -> bool {
        self.iterative.is_none()
    }

    fn coarse_start(
        &mut self,
        lcp: &Lcp,
        options: &ActiveSetOptions,
    ) -> Result<Option<Start>, ComplementarityError> {
        match &mut self.iterative {
            Some(iterative) => iterative.coarse_start(lcp, options),
            None if is_sparse_and_positive(lcp.matrix()) => {
                // Coarser problems serve as a start only: where there are none, none is made.
                let Ok(found) = aggregation_hierarchy(lcp.matrix().as_ref()) else {
                    return Ok(None);
                };
                Ok(algebraic_start(lcp.into(), &found.0, &found.1, options).unwrap_or(None))
            }
            None => Ok(None),
        }
    }
}
