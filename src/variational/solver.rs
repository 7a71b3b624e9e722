use std::ops::ControlFlow;

use super::multipliers::Multipliers;
use super::projection::{Infeasibility, Projection};
use super::{Polyhedron, Vi};
use crate::complementarity::{
    ComplementarityError, McpFunction, McpIteration, McpOptions, McpReport, McpSolver,
};
use crate::run::Status;
use crate::sparse::{Matrix, max_abs};

/// Proof that an affine variational inequality has no solution: a recession direction v of C (A v ≤ 0, E v = 0, vⱼ ≥ 0 where lⱼ is finite,
/// vⱼ ≤ 0 where uⱼ is finite) with F(x)ᵀv ≤ value < 0 for all x in C, as Mᵀv = Aᵀy + Eᵀw − ρₗ + ρᵤ with y, ρₗ, ρᵤ ≥ 0 and
/// value = qᵀv + bᵀy + dᵀw − lᵀρₗ + uᵀρᵤ. At a solution x the point x + v of C would contradict F(x)ᵀ(y − x) ≥ 0.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Ray {
    /// v, length n.
    pub direction: Vec<f64>,
    /// y, w, ρₗ and ρᵤ.
    pub multipliers: Multipliers,
    /// The bound of F(x)ᵀv, negative.
    pub value: f64,
    /// As [`Infeasibility::radius`], for (x, multipliers).
    pub radius: f64,
}

/// Report on a solve, with the data of the point returned.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ViReport {
    /// How it ended. Of the statuses that claim a proof, [`EmptySet`](Status::EmptySet) is proven by `infeasibility`,
    /// [`NoSolution`](Status::NoSolution) by `ray` or, where there is none, by ruling out all active sets of a small affine problem.
    pub status: Status,
    /// ‖x − P(x − F(x))‖_∞ with the projection P on C, measured at the point returned; NaN where F is, or where the projection fails by
    /// rounding.
    pub residual: f64,
    /// λ, μ and, from F(x) + Aᵀλ + Eᵀμ = ρₗ − ρᵤ, the multipliers of the bounds.
    pub multipliers: Multipliers,
    /// Whether C is empty as stored, but not if its constants move by 2⁻⁵³ of themselves
    /// ([`Nearest::within_rounding`](super::Nearest::within_rounding)): x belongs to these.
    pub within_rounding: bool,
    /// The proof that C is empty.
    pub infeasibility: Option<Infeasibility>,
    /// The proof that there is no solution.
    pub ray: Option<Ray>,
    /// The run on the Karush–Kuhn–Tucker conditions, with strategies and history.
    pub mcp: McpReport,
}

impl ViReport {
    /// Whether the problem is solved.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status.is_solved()
    }
}

impl std::fmt::Display for ViReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        crate::words::ended(f, &self.status, self.mcp.iterations, self.residual)
    }
}

/// Solves variational inequalities over polyhedra.
///
/// The start is projected on C. Then [`McpSolver`] solves the conditions of [`Vi::kkt`]: semismooth Newton first, then among others
/// Josephy–Newton with linearised problems solved along piecewise linear paths (N. H. Josephy 1979; D. Ralph 1994), and a piecewise smooth
/// homotopy; [`McpOptions::strategies`] chooses. For affine F a certificate is sought where no strategy succeeds.
///
/// With [`McpStrategy::JosephyNewton`](crate::complementarity::McpStrategy::JosephyNewton) alone an affine problem is solved by one
/// piecewise linear path from the start, as by PATHAVI (Y. Kim, O. Huber, M. C. Ferris, Math. Program. 169 (2018)), though in the variables
/// (x, λ, μ): up to four times [`McpOptions::max_path_size`] of them and [`McpOptions::max_path_points`] kinks, on which some matrices of
/// that order are factored.
///
/// ```
/// use semismooth::complementarity::{AffineFunction, McpOptions, McpStrategy};
/// use semismooth::sparse::Matrix;
/// use semismooth::variational::{Polyhedron, Vi, ViSolver};
/// // The point of x₁ + x₂ ≤ 1, x ≥ 0 nearest to (1, 2).
/// let set = Polyhedron::boxed(vec![0.0; 2], vec![f64::INFINITY; 2])?
///     .with_inequalities(Matrix::from_rows(&[[1.0, 1.0]])?, vec![1.0])?;
/// let problem = Vi::new(AffineFunction::new(Matrix::identity(2), vec![-1.0, -2.0])?, set)?;
/// let path = McpOptions::default().with_strategies(vec![McpStrategy::JosephyNewton]);
/// let mut x = [0.0, 0.0];
/// let report = ViSolver::new(path).solve(&problem, &mut x)?;
/// assert!(report.is_solved() && x[0].abs() < 1e-9 && (x[1] - 1.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct ViSolver {
    mcp: McpSolver,
}

impl ViSolver {
    /// A solver with the given options.
    #[must_use]
    pub fn new(options: McpOptions) -> Self {
        Self {
            mcp: McpSolver::new(options),
        }
    }

    /// Solves from the start `x`, which is overwritten by the solution or the best point; the start may lie outside of C.
    ///
    /// # Errors
    /// Misuse: a parametric problem, a start of the wrong length or not finite, options out of range; a projection that fails by rounding
    /// ([`ComplementarityError::Unresolved`]).
    pub fn solve<F: McpFunction>(
        &mut self,
        problem: &Vi<F>,
        x: &mut [f64],
    ) -> Result<ViReport, ComplementarityError> {
        self.solve_observed(problem, x, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting to `observe` as [`McpSolver::solve_observed`] does; `observe` may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_observed<F: McpFunction>(
        &mut self,
        problem: &Vi<F>,
        x: &mut [f64],
        observe: impl FnMut(&McpIteration) -> ControlFlow<()>,
    ) -> Result<ViReport, ComplementarityError> {
        let set = problem.set();
        let mut report = ViReport {
            status: Status::EmptySet,
            residual: f64::NAN,
            multipliers: Multipliers::default(),
            within_rounding: false,
            infeasibility: None,
            ray: None,
            mcp: McpReport::default(),
        };
        match set.project(x)? {
            Projection::Nearest(nearest) => {
                x.copy_from_slice(&nearest.x);
                report.within_rounding = nearest.within_rounding;
            }
            Projection::Empty(certificate) => {
                report.infeasibility = Some(certificate);
                return Ok(report);
            }
        }
        let conditions = problem.kkt()?;
        let n = x.len();
        let mut z = x.to_vec();
        z.resize(conditions.len(), 0.0);
        report.mcp = self.mcp.solve_observed(&conditions, &mut z, observe)?.clone();
        x.copy_from_slice(&z[..n]);
        report.status = report.mcp.status;
        let mut f = vec![0.0; conditions.len()];
        conditions.function().value(&z, &mut f);
        let m = set.num_inequalities();
        report.multipliers = Multipliers {
            inequalities: z[n..n + m].to_vec(),
            equations: z[n + m..].to_vec(),
            lower: (0..n)
                .map(|i| if x[i] == set.lower[i] { f[i].max(0.0) } else { 0.0 })
                .collect(),
            upper: (0..n)
                .map(|i| {
                    if x[i] == set.upper[i] {
                        (-f[i]).max(0.0)
                    } else {
                        0.0
                    }
                })
                .collect(),
        };
        match natural_residual(problem, x)? {
            Ok(residual) => report.residual = residual,
            Err(certificate) => {
                // Projected from another point, the contradiction exceeds rounding.
                report.status = Status::EmptySet;
                report.infeasibility = Some(certificate);
                return Ok(report);
            }
        }
        let ended = matches!(
            report.status,
            Status::Solved | Status::Interrupted | Status::TimeLimit
        );
        if !ended && problem.function().is_affine() {
            let mut matrix = Matrix::zeros(problem.function().pattern());
            problem.function().jacobian(x, &mut matrix);
            let mut q = vec![0.0; n];
            problem.function().value(&vec![0.0; n], &mut q);
            report.ray = ray(set, &matrix, &q)?;
            if report.ray.is_some() {
                report.status = Status::NoSolution;
            }
        }
        Ok(report)
    }
}

/// ‖x − P(x − F(x))‖_∞, or the proof that there is no P.
fn natural_residual<F: McpFunction>(
    problem: &Vi<F>,
    x: &[f64],
) -> Result<Result<f64, Infeasibility>, ComplementarityError> {
    let mut moved = vec![0.0; x.len()];
    problem.function().value(x, &mut moved);
    moved.iter_mut().zip(x).for_each(|(f, x)| *f = x - *f);
    if moved.iter().any(|v| !v.is_finite()) {
        return Ok(Ok(f64::NAN));
    }
    match problem.set().project(&moved) {
        Ok(Projection::Nearest(nearest)) => {
            let apart: Vec<f64> = nearest.x.iter().zip(x).map(|(p, x)| p - x).collect();
            Ok(Ok(max_abs(&apart)))
        }
        Ok(Projection::Empty(certificate)) => Ok(Err(certificate)),
        Err(ComplementarityError::Unresolved { .. }) => Ok(Ok(f64::NAN)),
        Err(e) => Err(e),
    }
}

/// A ray, if x ∈ C and M x + q + Aᵀλ + Eᵀμ − ρₗ + ρᵤ = 0 with λ, ρ ≥ 0 have no common solution: what every solution satisfies.
fn ray(set: &Polyhedron, matrix: &Matrix, q: &[f64]) -> Result<Option<Ray>, ComplementarityError> {
    let n = set.dimension();
    let (m, k) = (set.a.len(), set.e.len());
    let bounded = |bounds: &[f64]| (0..n).filter(|&j| bounds[j].is_finite()).collect::<Vec<_>>();
    let (below, above) = (bounded(&set.lower), bounded(&set.upper));
    let total = n + m + k + below.len() + above.len();
    let mut inequalities = Vec::new();
    for (j, i, v) in set.a.transposed.triplets() {
        inequalities.push((i, j, v));
    }
    let mut equations: Vec<_> = set
        .e
        .transposed
        .triplets()
        .map(|(j, i, v)| (n + i, j, v))
        .collect();
    equations.extend(matrix.triplets());
    equations.extend(set.a.transposed.triplets().map(|(j, i, v)| (j, n + i, v)));
    equations.extend(set.e.transposed.triplets().map(|(j, i, v)| (j, n + m + i, v)));
    let first = n + m + k;
    equations.extend(below.iter().enumerate().map(|(c, &j)| (j, first + c, -1.0)));
    let second = first + below.len();
    equations.extend(above.iter().enumerate().map(|(c, &j)| (j, second + c, 1.0)));
    let right: Vec<f64> = q.iter().map(|q| -q).chain(set.e.right.iter().copied()).collect();
    let mut lower = set.lower.clone();
    lower.resize(n + m, 0.0);
    lower.resize(n + m + k, f64::NEG_INFINITY);
    lower.resize(total, 0.0);
    let mut upper = set.upper.clone();
    upper.resize(total, f64::INFINITY);
    let conditions = Polyhedron::boxed(lower, upper)?
        .with_inequalities(
            Matrix::from_triplets(m, total, &inequalities)?,
            set.a.right.clone(),
        )?
        .with_equations(Matrix::from_triplets(n + k, total, &equations)?, right)?;
    let certificate = match conditions.project(&vec![0.0; total]) {
        Ok(Projection::Empty(certificate)) => certificate,
        Ok(Projection::Nearest(_)) | Err(ComplementarityError::Unresolved { .. }) => return Ok(None),
        Err(e) => return Err(e),
    };
    let found = certificate.multipliers;
    Ok(Some(Ray {
        direction: found.equations[..n].iter().map(|v| -v).collect(),
        multipliers: Multipliers {
            inequalities: found.inequalities,
            equations: found.equations[n..].to_vec(),
            lower: found.lower[..n].to_vec(),
            upper: found.upper[..n].to_vec(),
        },
        value: certificate.value,
        radius: certificate.radius,
    }))
}
