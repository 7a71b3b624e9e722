use super::nested::algebraic_start;
use super::reduced::is_symmetric;
use super::{ActiveSetOptions, DirectReduced, MultigridReduced, ReducedSolver, Start};
use crate::complementarity::{ComplementarityError, Lcp};
use crate::linear::{LinearError, WORTH, aggregation_hierarchy};
use crate::sparse::Matrix;

/// Direct solves for small, full or unsymmetric matrices, conjugate gradients with multigrid for large sparse
/// symmetric ones; should these not converge, direct ones again.
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
