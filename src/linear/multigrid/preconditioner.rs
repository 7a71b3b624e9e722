use std::sync::Arc;

use super::{Prolongation, Rows, TruncatedMultigrid, aggregation_hierarchy};
use crate::input::check_length;
use crate::linear::memory::{PatternMemory, check_finite};
use crate::linear::{LinearError, Preconditioner};
use crate::sparse::MatrixRef;

/// A symmetric V-cycle of multigrid, one Gauss–Seidel sweep before and after, as a [`Preconditioner`] for symmetric positive definite
/// matrices (W. L. Briggs, V. E. Henson, S. F. McCormick, A Multigrid Tutorial (2000)).
///
/// Coarse levels are given (nested grids) or found by smoothed aggregation (P. Vaněk, J. Mandel, M. Brezina, 1996). They belong to a
/// pattern: matrices with other values over it keep them, and only the coarse matrices are recomputed, without allocation.
///
/// The example of [`Krylov`](crate::linear::Krylov) uses it.
#[derive(Clone, Default)]
pub struct Multigrid {
    given: Option<Vec<Arc<Prolongation>>>,
    pattern: PatternMemory,
    cycle: Option<TruncatedMultigrid>,
}

impl Multigrid {
    /// Coarse levels by smoothed aggregation from the first matrix over a pattern.
    #[must_use]
    pub fn algebraic() -> Self {
        Self::default()
    }

    /// Coarse levels by the given prolongations, finest first; their offsets do not count.
    #[must_use]
    pub fn with_prolongations(prolongations: Vec<Prolongation>) -> Self {
        Self {
            given: Some(prolongations.into_iter().map(Arc::new).collect()),
            ..Self::algebraic()
        }
    }

    /// Number of unknowns of each level, finest first; empty before a matrix is known.
    #[must_use]
    pub fn levels(&self) -> Vec<usize> {
        let levels = self.cycle.as_ref().map(|c| &c.levels);
        levels.map_or_else(Vec::new, |l| l.iter().map(|l| l.b.len()).collect())
    }
}

impl std::fmt::Debug for Multigrid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Multigrid")
            .field("levels", &self.levels())
            .finish_non_exhaustive()
    }
}

impl Preconditioner for Multigrid {
    /// The symmetry of the matrix is not checked.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`] for a diagonal that is not positive, [`LinearError::NotFinite`], [`LinearError::NotSquare`],
    /// [`InputError::Length`](crate::InputError::Length) for prolongations that do not fit.
    fn prepare(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        let anew = self.pattern.learn(a.pattern)?;
        let kept = self.cycle.take().filter(|_| !anew);
        self.pattern.check(&a)?;
        check_finite(a.values, "the matrix")?;
        let cycle = match (kept, &self.given) {
            (Some(mut cycle), _) => {
                cycle.revalue(a.values);
                cycle
            }
            (None, Some(prolongations)) => TruncatedMultigrid::new(&[Rows::transposed(a)], prolongations)?,
            (None, None) => {
                let (prolongations, matrices) = aggregation_hierarchy(a)?;
                TruncatedMultigrid::new(&matrices, &prolongations)?
            }
        };
        if !cycle.has_positive_diagonal() {
            return Err(LinearError::NotPositiveDefinite);
        }
        self.cycle = Some(cycle);
        Ok(())
    }

    fn apply(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let cycle = self.cycle.as_mut().ok_or(LinearError::NotFactored)?;
        check_length("the right-hand side", b.len(), cycle.order())?;
        cycle.precondition(b);
        Ok(())
    }
}
