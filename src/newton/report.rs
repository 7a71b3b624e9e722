use std::fmt;

/// One iteration of the corrector.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Iteration {
    /// Number of the iteration, from 0; the entry with number k describes the step from iterate k.
    pub index: usize,
    /// ‖H‖₂ at the iterate.
    pub residual_norm: f64,
    /// ‖step‖₂, damping included; 0 in the last entry.
    pub step_norm: f64,
    /// Step length in (0, 1]; 0 in the last entry.
    pub damping: f64,
    /// Number of sites whose piece changed on arriving at the iterate.
    pub sites_changed: usize,
    /// Reciprocal condition estimate of the Jacobian, where the solver gives one.
    pub rcond: Option<f64>,
    /// How the step was found.
    pub step: Step,
}

/// How a step was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Step {
    /// Newton step of the selection at the iterate.
    Newton,
    /// Descent step for ½‖H‖²: the least-squares step where the Jacobian was singular, steepest descent where the Newton step gave
    /// no descent.
    Gradient,
    /// Newton step with only the first site that wants to change its piece doing so (least-index rule).
    LeastIndex,
    /// No step: the last iterate.
    None,
}

/// Why an iteration ended well.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Convergence {
    /// The tolerance was met.
    Tolerance,
    /// The residual reached the rounding error of its own evaluation; no further digit is to be had.
    Rounding,
}

/// Why an iteration ended without a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Failure {
    /// The limit on iterations was reached.
    MaxIterations,
    /// The same selections came back without progress, also under the least-index rule.
    Cycling,
    /// No step of acceptable length decreased the residual.
    Stagnation,
    /// A stationary point of ½‖H‖² that is no solution.
    Stationary {
        /// ‖∇Hᵀ H‖₂ there.
        gradient_norm: f64,
    },
    /// The Jacobian is singular at the last iterate, and so is every way round it.
    Singular,
    /// The map gave NaN or infinity, also for short steps.
    NotFinite,
    /// The observer asked to stop.
    Interrupted,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MaxIterations => f.write_str("the limit on iterations was reached"),
            Self::Cycling => f.write_str("the iteration cycles between selections"),
            Self::Stagnation => f.write_str("no step decreases the residual any more"),
            Self::Stationary { gradient_norm } => {
                write!(
                    f,
                    "a stationary point of the merit function (gradient {gradient_norm:e}) that is no solution"
                )
            }
            Self::Singular => f.write_str("the Jacobian is singular"),
            Self::NotFinite => f.write_str("the map is not finite along every step tried"),
            Self::Interrupted => f.write_str("the observer asked to stop"),
        }
    }
}

/// The history of a run.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Report {
    /// One entry an iterate, the last one included.
    pub history: Vec<Iteration>,
    /// Number of factorisations.
    pub factorisations: usize,
    /// Number of residual evaluations.
    pub evaluations: usize,
}

impl Report {
    /// ‖H‖₂ at the last iterate; NaN for an empty history.
    #[must_use]
    pub fn residual_norm(&self) -> f64 {
        self.history.last().map_or(f64::NAN, |i| i.residual_norm)
    }

    /// The observed order of convergence, log(r₃/r₂) / log(r₂/r₁), from the last three residual norms that still fell and lie
    /// above `floor` (rounding); `None` with fewer than three, or where a last step solved an affine piece exactly.
    #[must_use]
    pub fn observed_order(&self, floor: f64) -> Option<f64> {
        let norms: Vec<f64> = self
            .history
            .iter()
            .map(|i| i.residual_norm)
            .filter(|r| *r > floor)
            .collect();
        let [.., a, b, c] = norms.as_slice() else {
            return None;
        };
        let order = (c / b).ln() / (b / a).ln();
        (b < a && c < b && order.is_finite()).then_some(order)
    }
}
