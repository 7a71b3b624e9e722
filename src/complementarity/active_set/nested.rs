use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::engine::Engine;
use super::{ActiveSetIteration, ActiveSetOptions, ActiveSetReport, MultigridReduced, Start};
use crate::InputError;
use crate::complementarity::columns::BoxLcp;
use crate::complementarity::problem::check_bounds;
use crate::complementarity::{BoundState, ComplementarityError, Lcp};
use crate::input::{check_length, check_vector};
use crate::judge::Columns;
use crate::linear::{LinearError, Prolongation, Rows, affine_prolongation, coarse_problem};
use crate::run::Status;
use crate::tolerances::SIX_DIGITS;

/// A problem with coarser versions of it: solved on the coarsest first, each solution and its active set prolonged to the next.
///
/// The matrices must be symmetric positive definite. Reduced systems are solved by conjugate gradients, the coarser levels serving as
/// their multigrid preconditioner.
#[derive(Debug, Clone)]
pub struct Nested {
    /// Finest first.
    levels: Vec<Level>,
    /// Their matrices by rows.
    matrices: Vec<Rows>,
    prolongations: Vec<Arc<Prolongation>>,
    /// Whether all coarser matrices are Galerkin products.
    galerkin: bool,
}

/// The data of a problem without its matrix.
#[derive(Debug, Clone)]
struct Level {
    q: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
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
    pub fn status(&self) -> Status {
        self.levels.last().map_or(Status::Inaccurate, |l| l.report.status)
    }
}

/// "solved after 3 iterations, residual 1.0e-12, on the finest of 5 levels": in one line.
impl fmt::Display for NestedReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.levels.last() {
            Some(finest) => write!(f, "{}", finest.report)?,
            None => write!(f, "{}", self.status())?,
        }
        match self.levels.len() {
            1 => Ok(()),
            levels => write!(f, ", on the finest of {levels} levels"),
        }
    }
}

impl Nested {
    /// The problem to be solved, without coarser levels yet.
    #[must_use]
    pub fn new(finest: Lcp) -> Self {
        Self {
            matrices: vec![Rows::transposed(finest.matrix().as_ref())],
            levels: vec![Level::of(&finest)],
            prolongations: Vec::new(),
            galerkin: true,
        }
    }

    /// Adds a coarser level: the Galerkin problem Pᵀ M P, Pᵀ(M b + q), its bounds those at the representatives of the coarse unknowns.
    ///
    /// # Errors
    /// A prolongation whose fine unknowns are not those of the coarsest level so far, one that overflows, or bounds that leave no value.
    pub fn coarsen(self, prolongation: Prolongation) -> Result<Self, ComplementarityError> {
        self.check(&prolongation)?;
        let fine = self.coarsest();
        let (matrix, q) = coarse_problem(&self.matrices[self.matrices.len() - 1], fine.q, &prolongation);
        let coarse = Level::coarse(fine, &prolongation, &matrix, q)?;
        Ok(self.push(coarse, matrix, prolongation))
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
        check_length("the coarse problem", coarse.len(), prolongation.num_coarse())?;
        self.galerkin = false;
        let matrix = Rows::transposed(coarse.matrix().as_ref());
        Ok(self.push(Level::of(&coarse), matrix, prolongation))
    }

    fn push(mut self, coarse: Level, matrix: Rows, prolongation: Prolongation) -> Self {
        self.levels.push(coarse);
        self.matrices.push(matrix);
        self.prolongations.push(Arc::new(prolongation));
        self
    }

    fn check(&self, prolongation: &Prolongation) -> Result<(), ComplementarityError> {
        let expected = self.coarsest().len();
        if prolongation.num_fine() == expected {
            return Ok(());
        }
        Err(LinearError::Input(InputError::Length {
            what: "the prolongation (rows)",
            expected,
            found: prolongation.num_fine(),
        })
        .into())
    }

    /// Number of unknowns of each level, finest first.
    #[must_use]
    pub fn levels(&self) -> Vec<usize> {
        self.levels.iter().map(|l| l.q.len()).collect()
    }

    fn problem(&self, k: usize) -> BoxLcp<'_> {
        let Level { q, lower, upper } = &self.levels[k];
        BoxLcp {
            matrix: Columns::Short(self.matrices[k].view()),
            q,
            lower,
            upper,
        }
    }

    fn coarsest(&self) -> BoxLcp<'_> {
        self.problem(self.levels.len() - 1)
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
        check_length("the point", z.len(), self.levels[0].q.len())?;
        let mut levels = Vec::new();
        let mut states = Vec::new();
        let mut coarse: Vec<f64> = Vec::new();
        for k in (0..self.levels.len()).rev() {
            let problem = self.problem(k);
            let below = &self.prolongations[k..];
            let known = if self.galerkin {
                k..self.matrices.len()
            } else {
                k..k + 1
            };
            let mut systems = MultigridReduced::with_matrices(below, &self.matrices[known])?;
            let mut options = options.clone();
            // Solutions of coarser levels are starts only.
            if k > 0 {
                options.tolerance = options.tolerance.max(SIX_DIGITS);
            }
            let mut engine = Engine::new(options);
            let mut own = if k > 0 {
                vec![0.0; problem.len()]
            } else {
                Vec::new()
            };
            let x = if k > 0 { &mut own[..] } else { &mut *z };
            let sets = below.first().map(|p| {
                p.prolong(&coarse, x);
                p.inherit(&states, BoundState::Interior)
            });
            coarse.clear();
            if sets.is_none() {
                problem.nearest_to_zero(x);
            }
            let observe = &mut |_: &_| ControlFlow::Continue(());
            let report = engine.solve(problem, &mut systems, x, sets.as_deref(), observe)?;
            levels.push(LevelReport {
                unknowns: problem.len(),
                report,
                history: engine.history().to_vec(),
            });
            states = engine.states().to_vec();
            coarse = own;
        }
        Ok(NestedReport { levels, states })
    }
}

impl Level {
    fn of(lcp: &Lcp) -> Self {
        Self {
            q: lcp.q().to_vec(),
            lower: lcp.lower().to_vec(),
            upper: lcp.upper().to_vec(),
        }
    }

    /// With bounds read at the representatives.
    fn coarse(
        fine: BoxLcp<'_>,
        p: &Prolongation,
        matrix: &Rows,
        q: Vec<f64>,
    ) -> Result<Self, ComplementarityError> {
        let at = |bounds: &[f64]| -> Vec<f64> {
            let value = |&i: &usize| bounds[i] - p.offset().get(i).copied().unwrap_or(0.0);
            p.representatives().iter().map(value).collect()
        };
        let (lower, upper) = (at(fine.lower), at(fine.upper));
        check_bounds(&lower, &upper, q.len())?;
        check_vector("q", &q, q.len())?;
        let values = matrix.view().value;
        check_vector("the values of the matrix", values, values.len())?;
        Ok(Self { q, lower, upper })
    }
}

/// A start for a problem from the levels that aggregation found for its matrix, `matrices[0]`.
pub(super) fn algebraic_start(
    lcp: BoxLcp<'_>,
    hierarchy: &[Arc<Prolongation>],
    matrices: &[Rows],
    options: &ActiveSetOptions,
) -> Result<Option<Start>, ComplementarityError> {
    let mut first = None;
    let mut nested: Option<Nested> = None;
    for (p, pair) in hierarchy.iter().zip(matrices.windows(2)) {
        let fine = nested.as_ref().map_or(lcp, Nested::coarsest);
        let (p, q) = affine_prolongation(&pair[0], fine.q, p)?;
        let coarse = Level::coarse(fine, &p, &pair[1], q)?;
        nested = Some(match nested {
            None => {
                first = Some(p);
                Nested {
                    levels: vec![coarse],
                    matrices: vec![pair[1].clone()],
                    prolongations: Vec::new(),
                    galerkin: true,
                }
            }
            Some(n) => n.push(coarse, pair[1].clone(), p),
        });
    }
    let (Some(first), Some(nested)) = (first, nested) else {
        return Ok(None);
    };
    let options = options.clone().with_tolerance(options.tolerance.max(SIX_DIGITS));
    let mut coarse = vec![0.0; first.num_coarse()];
    let report = nested.solve(&options, &mut coarse)?;
    let mut z = vec![0.0; lcp.len()];
    first.prolong(&coarse, &mut z);
    let states = first.inherit(&report.states, BoundState::Interior);
    Ok(Some(Start { z, states }))
}
