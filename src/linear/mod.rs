//! Linear solvers behind one trait. Only this module uses the linear-algebra crates; their types do not leave it.

mod aggregation;
mod auto;
mod block_diagonal;
mod bordered;
mod cholesky;
mod condensation;
mod condition;
#[cfg(any(
    feature = "convert-faer",
    feature = "convert-nalgebra",
    feature = "convert-nalgebra-sparse",
    feature = "convert-sprs"
))]
mod convert;
mod dense_lu;
mod dissection;
mod eigen;
mod error;
mod gmres;
mod hierarchical;
mod hierarchical_lu;
mod incomplete_lu;
mod kernel;
mod krylov;
mod memory;
mod multigrid;
mod operator;
mod ordering;
mod row_inverse;
mod row_updates;
mod scaling;
mod small_lu;
mod sparse_lu;
mod spectral;
mod supernodal;
mod updated_factors;

pub(crate) use aggregation::Aggregation;
pub(crate) use auto::prefers_dense;
pub use auto::{AutoSolver, DENSE_LIMIT};
pub use block_diagonal::BlockDiagonal;
pub use bordered::Bordered;
pub use cholesky::Cholesky;
pub use condensation::Condensation;
pub use dense_lu::DenseLu;
pub use eigen::{eigenvalues, generalized_eigenvalues, symmetric_eigenvalues};
pub use error::LinearError;
pub(crate) use gmres::Gmres;
pub(crate) use hierarchical::Hierarchical;
pub(crate) use hierarchical_lu::{CondensedRows, HierarchicalLu};
pub use incomplete_lu::{IncompleteLu, Preconditioner};
pub(crate) use kernel::{Decomposition, decompose, least_singular_value};
pub use kernel::{NullSpace, null_space};
pub use krylov::{Krylov, KrylovMethod, KrylovReport};
pub(crate) use memory::dense_zeros;
pub use multigrid::{Multigrid, Prolongation};
pub(crate) use multigrid::{
    Rows, RowsRef, TruncatedMultigrid, WORTH, affine_prolongation, aggregation_hierarchy, coarse_problem,
};
pub use operator::{LinearOperator, Preconditioned};
pub(crate) use row_updates::{RowSource, RowUpdates};
pub(crate) use scaling::Scaling;
pub(crate) use small_lu::SmallLu;
pub use sparse_lu::SparseLu;
pub(crate) use spectral::{ACCURACY, NEGLIGIBLE};

use crate::sparse::{MatrixRef, PatternRef};

/// A direct (or sufficiently exact) solver for square systems `A x = b`.
///
/// The life of a solver: [`analyze`](Self::analyze) once a pattern, [`factor`](Self::factor) once a matrix, then any number of
/// solves. Implement it to plug in a solver of your own (MUMPS, PARDISO, PETSc …).
///
/// **Contract.** `factor` and the solves never panic; a singular or non-finite matrix is an error of `factor` or of the following solve,
/// never a wrong result without an error. `analyze` with the pattern already analysed is cheap.
///
/// ```
/// use semismooth::linear::{LinearError, LinearSolver};
/// use semismooth::sparse::{Matrix, MatrixRef, Pattern, PatternRef};
///
/// /// Knows diagonal matrices only.
/// #[derive(Default)]
/// struct Diagonal(Vec<f64>);
///
/// impl LinearSolver for Diagonal {
///     fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
///         if pattern.nrows == pattern.ncols { Ok(()) } else {
///             Err(LinearError::NotSquare { nrows: pattern.nrows, ncols: pattern.ncols })
///         }
///     }
///     fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
///         self.0 = a.values.to_vec();
///         match self.0.iter().any(|d| *d == 0.0) {
///             true => Err(LinearError::Singular { rcond: 0.0 }),
///             false => Ok(()),
///         }
///     }
///     fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
///         let n = self.0.len();
///         b.iter_mut().enumerate().for_each(|(i, b)| *b /= self.0[i % n]);
///         Ok(())
///     }
///     fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
///         self.solve_in_place(b)
///     }
/// }
///
/// let a = Matrix::identity(3);
/// let mut solver = Diagonal::default();
/// solver.analyze(a.pattern().as_ref())?;
/// solver.factor(a.as_ref())?;
/// let mut x = [1.0, 2.0, 3.0];
/// solver.solve_in_place(&mut x)?;
/// assert_eq!(x, [1.0, 2.0, 3.0]);
/// # Ok::<(), LinearError>(())
/// ```
pub trait LinearSolver {
    /// Analyses the pattern of the matrices to come.
    ///
    /// # Errors
    /// [`LinearError::NotSquare`], or a pattern that the solver cannot handle.
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError>;

    /// Factors a matrix over the analysed pattern.
    ///
    /// # Errors
    /// [`LinearError::Singular`], [`LinearError::NotFinite`], [`LinearError::NotAnalyzed`] or [`InputError::Length`](crate::InputError::Length).
    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError>;

    /// Overwrites `b` (n × k, column-major: any number of right-hand sides) by `A⁻¹ b`.
    ///
    /// # Errors
    /// [`LinearError::NotFactored`], [`InputError::Length`](crate::InputError::Length), [`LinearError::Inaccurate`].
    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError>;

    /// Overwrites `b` (n × k, column-major) by `A⁻ᵀ b`.
    ///
    /// # Errors
    /// As [`solve_in_place`](Self::solve_in_place).
    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError>;

    /// An estimate of the reciprocal condition number in the 1-norm, in [0, 1], of the last factored matrix. It may be computed only when
    /// this is called, and then costs a few solves.
    fn rcond(&mut self) -> Option<f64> {
        None
    }

    /// Sign (−1, 0, +1) and natural logarithm of |det A|, where the solver computes them.
    fn log_det(&self) -> Option<(i8, f64)> {
        None
    }
}

impl<S: LinearSolver + ?Sized> LinearSolver for Box<S> {
    fn analyze(&mut self, pattern: PatternRef<'_>) -> Result<(), LinearError> {
        (**self).analyze(pattern)
    }
    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        (**self).factor(a)
    }
    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        (**self).solve_in_place(b)
    }
    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        (**self).solve_transpose_in_place(b)
    }
    fn rcond(&mut self) -> Option<f64> {
        (**self).rcond()
    }
    fn log_det(&self) -> Option<(i8, f64)> {
        (**self).log_det()
    }
}
