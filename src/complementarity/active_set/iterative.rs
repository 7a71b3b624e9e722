use std::sync::Arc;

use super::engine::Systems;
use super::nested::algebraic_start;
use super::reduced::{check_order, check_square};
use super::{ActiveSetOptions, ReducedSolver, Start};
use crate::complementarity::{ComplementarityError, Lcp};
use crate::linear::{LinearError, Prolongation, Rows, TruncatedMultigrid, aggregation_hierarchy};
use crate::sparse::Matrix;

/// Conjugate gradients with a multigrid cycle, for symmetric positive definite matrices.
///
/// Coarse levels come from given [`Prolongation`]s (nested grids) or by smoothed aggregation from the matrix alone. They are truncated to
/// the free components, and only what changes with a set is recomputed.
#[derive(Debug, Clone)]
pub struct MultigridReduced {
    given: Option<Vec<Arc<Prolongation>>>,
    multigrid: Option<TruncatedMultigrid>,
    max_iterations: usize,
    /// Results of aggregation: prolongations, the matrix and its Galerkin products.
    found: (Vec<Arc<Prolongation>>, Vec<Rows>),
}

impl MultigridReduced {
    /// Coarse levels by smoothed aggregation.
    #[must_use]
    pub fn algebraic() -> Self {
        Self {
            given: None,
            multigrid: None,
            max_iterations: 200,
            found: Default::default(),
        }
    }

    /// Sets the number of iterations after which a solve is given up. 200 unless set.
    #[must_use]
    pub fn with_max_iterations(mut self, max_iterations: usize) -> Self {
        self.max_iterations = max_iterations;
        self
    }

    /// Coarse levels by the given prolongations, finest first.
    #[must_use]
    pub fn with_prolongations(prolongations: Vec<Arc<Prolongation>>) -> Self {
        Self {
            given: Some(prolongations),
            multigrid: None,
            max_iterations: 200,
            found: Default::default(),
        }
    }

    /// For a matrix given by rows, with its Galerkin products as far as they are known.
    pub(super) fn with_matrices(
        prolongations: &[Arc<Prolongation>],
        matrices: &[Rows],
    ) -> Result<Self, ComplementarityError> {
        Ok(Self {
            multigrid: Some(TruncatedMultigrid::new(matrices, prolongations)?),
            ..Self::algebraic()
        })
    }
}

impl Systems for MultigridReduced {
    /// The matrix was given at construction.
    fn load(&mut self) -> Result<(), ComplementarityError> {
        Ok(())
    }

    fn select(&mut self, free: &[bool]) -> Result<(), ComplementarityError> {
        let multigrid = self.multigrid.as_mut().ok_or(LinearError::NotAnalyzed)?;
        check_order(multigrid.order(), &[("the set of free components", free.len())])?;
        multigrid.set_free(free);
        Ok(())
    }

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        let multigrid = self.multigrid.as_mut().ok_or(LinearError::NotAnalyzed)?;
        check_order(multigrid.order(), &[("r", r.len()), ("d", d.len())])?;
        let iterations = multigrid.solve(r, d, tolerance, self.max_iterations)?;
        if iterations >= self.max_iterations {
            return Err(LinearError::Inaccurate { residual: tolerance }.into());
        }
        Ok(iterations)
    }

    fn is_direct(&self) -> bool {
        false
    }

    fn coarse_start(&mut self, _options: &ActiveSetOptions) -> Result<Option<Start>, ComplementarityError> {
        Ok(None)
    }
}

impl ReducedSolver for MultigridReduced {
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        check_square(matrix)?;
        self.multigrid = Some(match &self.given {
            Some(prolongations) => {
                TruncatedMultigrid::new(&[Rows::transposed(matrix.as_ref())], prolongations)?
            }
            None => {
                self.found = aggregation_hierarchy(matrix.as_ref())?;
                TruncatedMultigrid::new(&self.found.1, &self.found.0)?
            }
        });
        Ok(())
    }

    fn select(&mut self, _matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError> {
        Systems::select(self, free)
    }

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        Systems::solve(self, r, d, tolerance)
    }

    fn is_direct(&self) -> bool {
        false
    }

    fn coarse_start(
        &mut self,
        lcp: &Lcp,
        options: &ActiveSetOptions,
    ) -> Result<Option<Start>, ComplementarityError> {
        if self.given.is_some() || self.found.0.is_empty() {
            return Ok(None);
        }
        algebraic_start(lcp.into(), &self.found.0, &self.found.1, options)
    }
}
