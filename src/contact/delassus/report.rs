use std::fmt;

use super::DelassusProblem;
use crate::contact::{ContactError, ContactSolution, ContactState, LocalValues};
use crate::run::Status;
use crate::sparse::dot;
use crate::words::{Count, Size};

/// The kind of step that an entry of the history records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DelassusPhase {
    /// Sweeps of nonsmooth Gauss–Seidel.
    Sweeps,
    /// One step of the interior-point iteration.
    Interior,
    /// One linear system for the states found by sweeps.
    States,
    /// A proximal step by semismooth Newton.
    Proximal,
    /// A step along the central path of interior points, by arclength.
    Path,
}

/// One entry of the history.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DelassusIteration {
    /// Number of the entry, from 0.
    pub index: usize,
    /// What was done.
    pub phase: DelassusPhase,
    /// Residual after it ([`DelassusProblem::residual`](super::DelassusProblem::residual)).
    pub residual: f64,
    /// Weight of the proximal term, relative to a mean diagonal of 1, or, of interior points and the central path, the complementarity r·û
    /// per contact in scaled variables; 0 for sweeps and for known states.
    pub alpha: f64,
    /// Sweeps or factorisations.
    pub work: usize,
    /// Whether the inner problem was solved; of interior points, whether the step was not short.
    pub success: bool,
}

/// Result of [`DelassusSolver::solve`](super::DelassusSolver::solve): the solution or, failing that, the best iterate.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DelassusReport {
    /// How it ended.
    pub status: Status,
    /// Reactions, contact by contact (N, T1[, T2]).
    pub r: Vec<f64>,
    /// u = M r + q.
    pub u: Vec<f64>,
    /// The state of each contact; in space slip+ and slip− by the sign of −r_T1, of u_T1 where that
    /// vanishes.
    pub states: Vec<ContactState>,
    /// [`DelassusProblem::residual`](super::DelassusProblem::residual) at `r`.
    pub residual: f64,
    /// Systems of known states, Newton and interior-point iterations, one factorisation each.
    pub factorisations: usize,
    /// Evaluations of u = M r + q for all contacts, those of line searches and of the residuals in `history` included. Sweeps are not among
    /// them.
    pub evaluations: usize,
    /// Sweeps of Gauss–Seidel.
    pub sweeps: usize,
    /// What was done, in order.
    pub history: Vec<DelassusIteration>,
}

impl DelassusReport {
    /// Whether the residual is at most the tolerance.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status.is_solved()
    }

    /// Newton iterations and sweeps together.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.factorisations + self.sweeps
    }

    /// The solution in the type that all forms share: pressures r_N, tractions −r_T, penetrations −u_N, slips u_T.
    ///
    /// # Errors
    /// A problem of another size than the one solved.
    pub fn solution(&self, problem: &DelassusProblem) -> Result<ContactSolution, ContactError> {
        let (d, mean) = (problem.dimension(), problem.mean_diagonal());
        let image = problem.velocities(&self.r)?;
        let rate = if mean > 0.0 { mean.recip() } else { 1.0 };
        let nodes = self.r.chunks_exact(d).zip(image.chunks_exact(d)).enumerate();
        let nodes = nodes.map(|(node, (r, u))| {
            let second = |v: &[f64]| v.get(2).copied().unwrap_or(0.0);
            LocalValues {
                node,
                penetration: -u[0],
                slip: [u[1], second(u)],
                pressure: r[0],
                traction: [-r[1], -second(r)],
                r: rate,
                ..LocalValues::default()
            }
        });
        let load = -dot(problem.q(), &self.r);
        let stored = 0.5 * (dot(&image, &self.r) + load);
        Ok(ContactSolution::assemble(
            nodes.collect(),
            |v| {
                let mu = problem.friction()[v.node];
                let pressure = v.theta1().max(0.0);
                let z = [0, 1].map(|k| v.traction[k] + v.r * v.slip[k]);
                let size = z[0].hypot(z[1]);
                let factor = if size > mu * pressure {
                    mu * pressure / size
                } else {
                    1.0
                };
                let h = [0, 1].map(|k| v.traction[k] - factor * z[k]);
                (self.states[v.node], [v.pressure - pressure, h[0], h[1]])
            },
            |_| [0.0; 3],
            (stored, load, 0.0),
            0.0,
        ))
    }

    /// Number of open contacts.
    #[must_use]
    pub fn open(&self) -> usize {
        self.states.iter().filter(|s| **s == ContactState::Open).count()
    }

    /// Number of sticking contacts.
    #[must_use]
    pub fn stick(&self) -> usize {
        self.states.iter().filter(|s| **s == ContactState::Stick).count()
    }

    /// Number of slipping contacts.
    #[must_use]
    pub fn slip(&self) -> usize {
        self.states.iter().filter(|s| s.is_slip()).count()
    }
}

impl fmt::Display for DelassusPhase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sweeps => "sweeps",
            Self::Interior => "interior point",
            Self::States => "known states",
            Self::Proximal => "proximal step",
            Self::Path => "central path",
        })
    }
}

impl fmt::Display for DelassusReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} after {} and {}, residual {}",
            self.status,
            Count(self.factorisations, "factorisation", "factorisations"),
            Count(self.sweeps, "sweep", "sweeps"),
            Size(self.residual)
        )
    }
}
