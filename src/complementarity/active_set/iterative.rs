use std::sync::Arc;

use super::ReducedSolver;
use crate::complementarity::ComplementarityError;
use crate::linear::{LinearError, Prolongation, TruncatedMultigrid, aggregation_hierarchy};
use crate::sparse::Matrix;

/// Iterations after which conjugate gradients are given up.
const LIMIT: usize = 200;

/// Conjugate gradients with a multigrid cycle, for symmetric positive definite matrices.
///
/// Coarse levels come from given [`Prolongation`]s (nested grids) or by smoothed aggregation from the matrix alone. They are truncated
/// to the free components, and only what changes with a set is made anew.
#[derive(Debug, Clone)]
pub struct MultigridReduced {
    given: Option<Vec<Arc<Prolongation>>>,
    multigrid: Option<TruncatedMultigrid>,
}

impl MultigridReduced {
    /// Coarse levels by smoothed aggregation.
    #[must_use]
    pub fn algebraic() -> Self {
        Self {
            given: None,
            multigrid: None,
        }
    }

    /// Coarse levels by the given prolongations, finest first.
    #[must_use]
    pub fn with_prolongations(prolongations: Vec<Arc<Prolongation>>) -> Self {
        Self {
            given: Some(prolongations),
            multigrid: None,
        }
    }
}

impl ReducedSolver for MultigridReduced {
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        let found;
        let prolongations = match &self.given {
            Some(given) => given,
            None => {
                found = aggregation_hierarchy(matrix.as_ref(), None)?;
                &found
            }
        };
        self.multigrid = Some(TruncatedMultigrid::new(matrix.as_ref(), prolongations)?);
        Ok(())
    }

    fn select(&mut self, _matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError> {
        let multigrid = self.multigrid.as_mut().ok_or(LinearError::NotAnalyzed)?;
        multigrid.set_free(free);
        Ok(())
    }

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        let multigrid = self.multigrid.as_mut().ok_or(LinearError::NotAnalyzed)?;
        let iterations = multigrid.solve(r, d, tolerance, LIMIT)?;
        if iterations == LIMIT {
            return Err(LinearError::Inaccurate { residual: tolerance }.into());
        }
        Ok(iterations)
    }

    fn is_direct(&self) -> bool {
        false
    }
}
