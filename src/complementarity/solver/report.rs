use std::fmt;
use std::time::Duration;

use super::McpStrategy;
use crate::newton::{Tail, observed_order};
use crate::piecewise::RegularityReport;
use crate::run::Status;

/// An attempt that failed, so that another one followed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Fallback {
    /// What was tried.
    pub strategy: McpStrategy,
    /// How it ended.
    pub outcome: Status,
    /// Smallest natural residual of its iterates; infinite if there was none.
    pub residual: f64,
    /// Iterations spent.
    pub iterations: usize,
}

/// How a step was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum McpStep {
    /// Newton step of the natural map with the active set at the iterate.
    Natural,
    /// Newton step of the Fischer–Burmeister function.
    FischerBurmeister,
    /// Regularised least-squares step (Levenberg–Marquardt).
    Regularised,
    /// Projected steepest descent.
    Gradient,
    /// Solution of the linearised complementarity problem.
    Linearised,
    /// A step of another kind, see [`McpIteration::strategy`]: a Newton step of smoothed equations, the end of a path.
    Own,
    /// None: the last iterate of an attempt.
    None,
}

/// One iterate, and the step from it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct McpIteration {
    /// Number of the iteration, from 0, over all attempts.
    pub index: usize,
    /// The attempt it belongs to.
    pub strategy: McpStrategy,
    /// Natural residual at the iterate.
    pub residual: f64,
    /// The (scaled) merit function ½‖Φ‖² at the iterate.
    pub merit: f64,
    /// How the step from it was found.
    pub step: McpStep,
    /// Its length, 1 for a full step.
    pub damping: f64,
    /// Number of components whose piece of the natural map (x − F below, within or above the bounds) differs from that at the iterate
    /// before; 0 at the first iterate.
    pub sites_changed: usize,
}

/// Position of a component with respect to its bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BoundState {
    /// At its lower bound, F ≥ 0.
    Lower,
    /// F = 0.
    Interior,
    /// At its upper bound, F ≤ 0.
    Upper,
}

/// Report on a solve. The solver keeps it, so that its memory is reused.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct McpReport {
    /// How it ended.
    pub status: Status,
    /// Natural residual max |xᵢ − mid(lᵢ, uᵢ, xᵢ − Fᵢ)| at the x returned; NaN where F could not be evaluated at all.
    pub residual: f64,
    /// Largest error of a component at the x returned relative to the terms of its row ([accuracy](crate::complementarity#accuracy)); NaN
    /// where F or its Jacobian could not be evaluated.
    pub error: f64,
    /// Largest violation of a bound by x; 0 unless x could not be evaluated.
    pub feasibility: f64,
    /// Complementarity max min(|xᵢ − bound|, |Fᵢ|) over the bounds that should be active by the sign of Fᵢ.
    pub complementarity: f64,
    /// Iterations, over all attempts.
    pub iterations: usize,
    /// Evaluations of F.
    pub evaluations: usize,
    /// Evaluations of its Jacobian.
    pub jacobians: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// The strategy that finished (the last one tried).
    pub strategy: McpStrategy,
    /// The attempts before it, in order, with their outcomes.
    pub fallbacks: Vec<Fallback>,
    /// The iterates.
    pub history: Vec<McpIteration>,
    /// Where each component is.
    pub states: Vec<BoundState>,
    /// For [`Status::NoSolution`] the vector v that proves it: v is a recession direction of the box [l, u], so that every solution has
    /// vᵀF(x) ≥ 0, yet sup vᵀF(x) < 0 over the box, up to the rounding of v. Empty where enumeration proved it, and for any other status.
    pub certificate: Vec<f64>,
    /// The regularity of the solution at the x returned, as a zero of the natural map and in Robinson's sense, where
    /// [`McpOptions::regularity`](super::McpOptions::regularity) asks for it; `None` unless the problem is solved.
    ///
    /// ```
    /// use semismooth::complementarity::{Mcp, McpOptions, McpSolver};
    /// use semismooth::piecewise::RegularityOptions;
    /// use semismooth::sparse::Matrix;
    /// // 0 ≤ x ⟂ M x ≥ 0 at its solution 0, where all components are degenerate; det M = −3 and M₁₁ > 0.
    /// let m = Matrix::from_rows(&[[1.0, 2.0], [2.0, 1.0]])?;
    /// let problem = Mcp::affine(m, vec![0.0; 2], vec![0.0; 2], vec![f64::INFINITY; 2])?;
    /// let wanted = McpOptions::default().with_regularity(Some(RegularityOptions::default()));
    /// let mut solver = McpSolver::new(wanted);
    /// let report = solver.solve(&problem, &mut [1.0, 1.0])?;
    /// let found = report.regularity.as_ref().expect("asked for and solved");
    /// assert!(found.bd.is_regular() && found.cd.fails());
    /// assert!(found.strong.as_ref().is_some_and(|s| s.fails()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub regularity: Option<RegularityReport>,
    /// Wall-clock time.
    pub time: Duration,
}

impl Default for McpReport {
    fn default() -> Self {
        Self {
            status: Status::Stalled,
            residual: f64::NAN,
            error: f64::NAN,
            feasibility: 0.0,
            complementarity: f64::NAN,
            iterations: 0,
            evaluations: 0,
            jacobians: 0,
            factorisations: 0,
            strategy: McpStrategy::Newton,
            fallbacks: Vec::new(),
            history: Vec::new(),
            states: Vec::new(),
            certificate: Vec::new(),
            regularity: None,
            time: Duration::ZERO,
        }
    }
}

impl McpReport {
    /// Whether the problem is solved.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status.is_solved()
    }

    /// The observed order of convergence, log(r₃/r₂) / log(r₂/r₁), from the last three natural residuals of the attempt that finished
    /// that lie above `floor` (rounding) and fell by full Newton steps on one active set; `None` with fewer than three since the last
    /// component came to another bound or left one, by the rule of [`Report::observed_order`](crate::newton::Report::observed_order).
    #[must_use]
    pub fn observed_order(&self, floor: f64) -> Option<f64> {
        let attempt = self.history.iter().rev();
        let attempt = attempt.take_while(|i| i.strategy == self.strategy);
        let newton = |step| {
            matches!(
                step,
                McpStep::Natural | McpStep::FischerBurmeister | McpStep::Linearised
            )
        };
        let entry = |i: &McpIteration| Tail {
            residual: i.residual,
            switched: i.sites_changed > 0,
            full: newton(i.step) && i.damping == 1.0,
        };
        observed_order(attempt.map(entry), floor)
    }

    /// Empties the report, keeping its memory.
    pub(super) fn clear(&mut self) {
        let mut kept = std::mem::take(self);
        kept.fallbacks.clear();
        kept.history.clear();
        kept.states.clear();
        kept.certificate.clear();
        *self = Self {
            fallbacks: kept.fallbacks,
            history: kept.history,
            states: kept.states,
            certificate: kept.certificate,
            ..Self::default()
        };
    }
}

impl fmt::Display for McpStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Natural => "natural map",
            Self::FischerBurmeister => "Fischer-Burmeister",
            Self::Regularised => "Levenberg-Marquardt",
            Self::Gradient => "projected gradient",
            Self::Linearised => "linearised problem",
            Self::Own => "step of the strategy",
            Self::None => "none",
        })
    }
}

impl fmt::Display for BoundState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lower => "at the lower bound",
            Self::Interior => "between the bounds",
            Self::Upper => "at the upper bound",
        })
    }
}

impl fmt::Display for McpReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        crate::words::ended(f, &self.status, self.iterations, self.residual)?;
        match &self.regularity {
            Some(regularity) => write!(f, "; {regularity}"),
            None => Ok(()),
        }
    }
}
