use std::sync::Arc;

use super::{
    ActiveSetIteration, ActiveSetOptions, ActiveSetReport, ActiveSetSolver, ActiveSetStatus, Activity,
    MultigridReduced,
};
use crate::complementarity::{ComplementarityError, Lcp};
use crate::linear::{LinearError, Prolongation, aggregation_hierarchy, coarse_problem};

/// A problem with coarser versions of it: solved on the coarsest first, each solution and its active set prolonged to the next.
///
/// The matrices must be symmetric positive definite. Reduced systems are solved by conjugate gradients, the coarser levels serving as
/// their multigrid preconditioner.
#[derive(Debug, Clone)]
pub struct Nested {
    /// Finest first.
    problems: Vec<Lcp>,
    prolongations: Vec<Arc<Prolongation>>,
}

/// Report on one level.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
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
pub struct NestedReport {
    /// Coarsest first.
    pub levels: Vec<LevelReport>,
    /// Sets of the finest level.
    pub activity: Vec<Activity>,
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
            problems: vec![finest],
            prolongations: Vec::new(),
        }
    }

    /// Adds a coarser level: the Galerkin problem Pᵀ M P, Pᵀ(M b + q), its bounds those at the representatives of the coarse unknowns.
    ///
    /// # Errors
    /// A prolongation whose fine unknowns are not those of the coarsest level so far.
    pub fn coarsen(self, prolongation: Prolongation) -> Result<Self, ComplementarityError> {
        self.check(&prolongation)?;
        let fine = &self.problems[self.problems.len() - 1];
        let (matrix, q) = coarse_problem(fine.matrix().as_ref(), fine.q(), &prolongation)?;
        let offset = prolongation.offset();
        let at = |bounds: &[f64]| -> Vec<f64> {
            let value = |&i: &usize| bounds[i] - offset.get(i).copied().unwrap_or(0.0);
            prolongation.representatives().iter().map(value).collect()
        };
        let coarse = Lcp::boxed(matrix, q, at(fine.lower()), at(fine.upper()))?;
        self.with_coarser(coarse, prolongation)
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
        if prolongation.num_coarse() != coarse.len() {
            return Err(ComplementarityError::Length {
                what: "the coarse problem",
                expected: prolongation.num_coarse(),
                found: coarse.len(),
            });
        }
        self.problems.push(coarse);
        self.prolongations.push(Arc::new(prolongation));
        Ok(self)
    }

    /// Coarser levels by smoothed aggregation, from the matrix alone.
    ///
    /// # Errors
    /// Matrices with a diagonal entry that is not positive are not coarsened; others do not fail.
    pub fn algebraic(finest: Lcp) -> Result<Self, ComplementarityError> {
        let hierarchy = aggregation_hierarchy(finest.matrix().as_ref(), Some(finest.q()))?;
        let mut nested = Self::new(finest);
        for p in hierarchy {
            nested = nested.coarsen(Arc::unwrap_or_clone(p))?;
        }
        Ok(nested)
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
        let mut levels = Vec::new();
        let mut activity = Vec::new();
        let mut coarse: Vec<f64> = Vec::new();
        for k in (0..self.problems.len()).rev() {
            let problem = &self.problems[k];
            let mut x = vec![0.0; problem.len()];
            let below = &self.prolongations[k..];
            let reduced = MultigridReduced::with_prolongations(below.to_vec());
            let mut solver = ActiveSetSolver::with_reduced(options.clone(), reduced);
            let report = match below.first() {
                None => {
                    for (x, (l, u)) in x.iter_mut().zip(problem.lower().iter().zip(problem.upper())) {
                        *x = f64::max(*x, *l).min(*u);
                    }
                    solver.solve(problem, &mut x)?
                }
                Some(p) => {
                    p.prolong(&coarse, &mut x);
                    let sets = prolong_activity(p, &activity);
                    solver.solve_from(problem, &mut x, &sets)?
                }
            };
            levels.push(LevelReport {
                unknowns: problem.len(),
                report,
                history: solver.history().to_vec(),
            });
            activity = solver.activity().to_vec();
            coarse = x;
        }
        if z.len() != coarse.len() {
            return Err(ComplementarityError::Length {
                what: "the point",
                expected: coarse.len(),
                found: z.len(),
            });
        }
        z.copy_from_slice(&coarse);
        Ok(NestedReport { levels, activity })
    }
}

/// A fine component rests at a bound where all coarse ones that it depends on do.
pub(super) fn prolong_activity(p: &Prolongation, coarse: &[Activity]) -> Vec<Activity> {
    (0..p.num_fine())
        .map(|i| {
            let mut parents = p.parents(i).map(|(c, _)| coarse[c]);
            match parents.next() {
                Some(first) if parents.all(|a| a == first) => first,
                _ => Activity::Inactive,
            }
        })
        .collect()
}
