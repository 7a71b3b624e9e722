use std::sync::Arc;

use super::{
    ActiveSetIteration, ActiveSetOptions, ActiveSetReport, ActiveSetSolver, ActiveSetStatus,
    MultigridReduced, Start,
};
use crate::complementarity::{BoundState, ComplementarityError, Lcp};
use crate::linear::{LinearError, Prolongation, Rows, affine_prolongation, coarse_problem};
use crate::sparse::Matrix;

/// Tolerance on coarser levels, whose solutions are starts only.
const COARSE_TOLERANCE: f64 = 1e-6;

/// A problem with coarser versions of it: solved on the coarsest first, each solution and its active set prolonged to the next.
///
/// The matrices must be symmetric positive definite. Reduced systems are solved by conjugate gradients, the coarser levels serving as
/// their multigrid preconditioner.
#[derive(Debug, Clone)]
pub struct Nested {
    /// Finest first.
    problems: Vec<Lcp>,
    /// Their matrices by rows.
    matrices: Vec<Rows>,
    prolongations: Vec<Arc<Prolongation>>,
    /// Whether all coarser matrices are Galerkin products.
    galerkin: bool,
}

/// Report on one level.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LevelReport {
    /// Number of unknowns.
    pub unknowns: usize,
    /// How the level ended.
    pub report: ActiveSetReport,
    /// Its iterations.
    pub history: Vec<ActiveSetIteration>,
}

/// Report on all levels.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NestedReport {
    /// Coarsest first.
    pub levels: Vec<LevelReport>,
    /// Sets of the finest level.
    pub states: Vec<BoundState>,
}

impl NestedReport {
    /// How the finest level ended.
    #[must_use]
    pub fn status(&self) -> ActiveSetStatus {
        self.levels
            .last()
            .map_or(ActiveSetStatus::Inaccurate, |l| l.report.status)
    }
}

impl Nested {
    /// The problem to be solved, without coarser levels yet.
    #[must_use]
    pub fn new(finest: Lcp) -> Self {
        Self {
            matrices: vec![Rows::transposed(finest.matrix().as_ref())],
            problems: vec![finest],
            prolongations: Vec::new(),
            galerkin: true,
        }
    }

    /// Adds a coarser level: the Galerkin problem Pᵀ M P, Pᵀ(M b + q), its bounds those at the representatives of the coarse unknowns.
    ///
    /// # Errors
    /// A prolongation whose fine unknowns are not those of the coarsest level so far.
    pub fn coarsen(self, prolongation: Prolongation) -> Result<Self, ComplementarityError> {
        self.check(&prolongation)?;
        let fine = &self.problems[self.problems.len() - 1];
        let (matrix, q) = coarse_problem(&self.matrices[self.matrices.len() - 1], fine.q(), &prolongation);
        let coarse = coarse_lcp(fine, &prolongation, matrix.to_matrix()?, q)?;
        self.push(coarse, matrix, prolongation)
    }

    /// Adds a coarser level with a problem of your own (another discretisation).
    ///
    /// # Errors
    /// A prolongation that does not lead from the unknowns of `coarse` to those of the coarsest level so far.
    pub fn with_coarser(
        mut self,
        coarse: Lcp,
        prolongation: Prolongation,
    ) -> Result<Self, ComplementarityError> {
        self.check(&prolongation)?;
        self.galerkin = false;
        let matrix = Rows::transposed(coarse.matrix().as_ref());
        self.push(coarse, matrix, prolongation)
    }

    fn push(
        mut self,
        coarse: Lcp,
        matrix: Rows,
        prolongation: Prolongation,
    ) -> Result<Self, ComplementarityError> {
        if prolongation.num_coarse() != coarse.len() {
            return Err(ComplementarityError::Length {
                what: "the coarse problem",
                expected: prolongation.num_coarse(),
                found: coarse.len(),
            });
        }
        self.problems.push(coarse);
        self.matrices.push(matrix);
        self.prolongations.push(Arc::new(prolongation));
        Ok(self)
    }

    fn check(&self, prolongation: &Prolongation) -> Result<(), ComplementarityError> {
        let expected = self.problems[self.problems.len() - 1].len();
        if prolongation.num_fine() == expected {
            return Ok(());
        }
        Err(LinearError::Shape {
            what: "the prolongation (rows)",
            expected,
            found: prolongation.num_fine(),
        }
        .into())
    }

    /// The problems, finest first.
    #[must_use]
    pub fn problems(&self) -> &[Lcp] {
        &self.problems
    }

    /// Solves from the coarsest level to the finest, whose solution is written to `z`.
    ///
    /// # Errors
    /// `z` of the wrong length, options out of range.
    pub fn solve(
        &self,
        options: &ActiveSetOptions,
        z: &mut [f64],
    ) -> Result<NestedReport, ComplementarityError> {
        if z.len() != self.problems[0].len() {
            return Err(ComplementarityError::Length {
                what: "the point",
                expected: self.problems[0].len(),
                found: z.len(),
            });
        }
        let mut levels = Vec::new();
        let mut states = Vec::new();
        let mut coarse: Vec<f64> = Vec::new();
        for k in (0..self.problems.len()).rev() {
            let problem = &self.problems[k];
            let mut x = vec![0.0; problem.len()];
            let below = &self.prolongations[k..];
            let known = if self.galerkin {
                k..self.matrices.len()
            } else {
                k..k + 1
            };
            let reduced = MultigridReduced::with_matrices(below.to_vec(), self.matrices[known].to_vec());
            let mut options = options.clone();
            if k > 0 {
                options.tolerance = options.tolerance.max(COARSE_TOLERANCE);
            }
            let mut solver = ActiveSetSolver::with_reduced(options, reduced);
            let report = match below.first() {
                None => {
                    for (x, (l, u)) in x.iter_mut().zip(problem.lower().iter().zip(problem.upper())) {
                        *x = f64::max(*x, *l).min(*u);
                    }
                    solver.solve(problem, &mut x)?
                }
                Some(p) => {
                    p.prolong(&coarse, &mut x);
                    let sets = p.inherit(&states, BoundState::Interior);
                    solver.solve_from_states(problem, &mut x, &sets)?
                }
            };
            levels.push(LevelReport {
                unknowns: problem.len(),
                report,
                history: solver.history().to_vec(),
            });
            states = solver.states().to_vec();
            coarse = x;
        }
        z.copy_from_slice(&coarse);
        Ok(NestedReport { levels, states })
    }
}

/// The coarse problem with bounds read at the representatives.
fn coarse_lcp(
    fine: &Lcp,
    p: &Prolongation,
    matrix: Matrix,
    q: Vec<f64>,
) -> Result<Lcp, ComplementarityError> {
    let at = |bounds: &[f64]| -> Vec<f64> {
        let value = |&i: &usize| bounds[i] - p.offset().get(i).copied().unwrap_or(0.0);
        p.representatives().iter().map(value).collect()
    };
    Lcp::boxed(matrix, q, at(fine.lower()), at(fine.upper()))
}

/// A start for a problem from the levels that aggregation found for its matrix, `matrices[0]`.
pub(super) fn algebraic_start(
    lcp: &Lcp,
    hierarchy: &[Arc<Prolongation>],
    matrices: &[Rows],
    options: &ActiveSetOptions,
) -> Result<Option<Start>, ComplementarityError> {
    let mut first = None;
    let mut nested: Option<Nested> = None;
    for (p, pair) in hierarchy.iter().zip(matrices.windows(2)) {
        let fine = nested.as_ref().map_or(lcp, |n| &n.problems[n.problems.len() - 1]);
        let (p, q) = affine_prolongation(&pair[0], fine.q(), p)?;
        let coarse = coarse_lcp(fine, &p, pair[1].to_matrix()?, q)?;
        nested = Some(match nested {
            None => {
                first = Some(p);
                Nested::new(coarse)
            }
            Some(n) => n.push(coarse, pair[1].clone(), p)?,
        });
    }
    let (Some(first), Some(nested)) = (first, nested) else {
        return Ok(None);
    };
    let options = options
        .clone()
        .with_tolerance(options.tolerance.max(COARSE_TOLERANCE));
    let mut coarse = vec![0.0; first.num_coarse()];
    let report = nested.solve(&options, &mut coarse)?;
    let mut z = vec![0.0; lcp.len()];
    first.prolong(&coarse, &mut z);
    let states = first.inherit(&report.states, BoundState::Interior);
    Ok(Some(Start { z, states }))
}
