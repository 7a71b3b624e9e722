use crate::piecewise::RegularityReport;
use std::fmt;

use crate::words::{Count, Size, iterations};

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
    /// Iterations of the Krylov method that solved for the step; 0 where a factorisation did.
    pub linear_iterations: usize,
    /// Factor by which the linear residual was to fall, the forcing term; 0 where a factorisation solved.
    pub forcing: f64,
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

/// Why an iteration ended with a solution: of both ways, one is not less a solution than the other, unlike
/// [`Status::AtRounding`](crate::run::Status::AtRounding), which is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Convergence {
    /// The tolerance was met.
    Tolerance,
    /// The residual reached the rounding error of its own evaluation; no further digit can be gained.
    Rounding,
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
    /// The regularity of the solution at the point returned, where [`NewtonOptions::regularity`](super::NewtonOptions::regularity) asks for
    /// it; `None` without a solution.
    pub regularity: Option<RegularityReport>,
}

impl Report {
    /// ‖H‖₂ at the last iterate; NaN for an empty history.
    #[must_use]
    pub fn residual_norm(&self) -> f64 {
        self.history.last().map_or(f64::NAN, |i| i.residual_norm)
    }

    /// The observed order of convergence, log(r₃/r₂) / log(r₂/r₁), from the last three residual norms that lie above `floor` (rounding)
    /// and fell by full Newton steps on one selection.
    ///
    /// `None` with fewer than three since the last site changed its piece: the decrease while pieces change defines no order, nor does a
    /// last step that solves an affine piece exactly. `None` also for an order below ¾: residuals fall at least linearly, of order 1,
    /// unless they are rounding errors.
    #[must_use]
    pub fn observed_order(&self, floor: f64) -> Option<f64> {
        let entry = |i: &Iteration| Tail {
            residual: i.residual_norm,
            switched: i.sites_changed > 0,
            full: i.step == Step::Newton && i.damping == 1.0,
        };
        observed_order(self.history.iter().rev().map(entry), floor)
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Newton => "Newton",
            Self::Gradient => "descent",
            Self::LeastIndex => "least index",
            Self::None => "none",
        })
    }
}

impl fmt::Display for Convergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tolerance => "tolerance met",
            Self::Rounding => "at the rounding of the residual",
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}, residual {}",
            iterations(self.history.len().saturating_sub(1)),
            Count(self.factorisations, "factorisation", "factorisations"),
            Size(self.residual_norm())
        )?;
        match &self.regularity {
            Some(regularity) => write!(f, "; {regularity}"),
            None => Ok(()),
        }
    }
}

/// Orders below it are those of rounding; linear convergence, of order 1, is seen with some scatter.
const SLOWEST: f64 = 0.75;

/// The data of a history's entry that determine the order of convergence.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tail {
    pub(crate) residual: f64,
    /// Whether a site changed its piece on the way to this iterate.
    pub(crate) switched: bool,
    /// Whether a full Newton step leads on from it.
    pub(crate) full: bool,
}

/// [`Report::observed_order`] of any history, taken from its end.
pub(crate) fn observed_order(history: impl Iterator<Item = Tail>, floor: f64) -> Option<f64> {
    // The last three above the floor, the last of them first; none above it may come after one that is not.
    let mut last: [Option<Tail>; 3] = [None; 3];
    for entry in history {
        if entry.residual > floor {
            if last[2].is_none()
                && let Some(slot) = last.iter_mut().find(|slot| slot.is_none())
            {
                *slot = Some(entry);
            }
        } else {
            last = [None; 3];
        }
        if entry.switched {
            break;
        }
    }
    let [Some(c), Some(b), Some(a)] = last else {
        return None;
    };
    let order = (c.residual / b.residual).ln() / (b.residual / a.residual).ln();
    let falls = b.residual < a.residual && c.residual < b.residual;
    (a.full && b.full && falls && order >= SLOWEST && order.is_finite()).then_some(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(list: &[(f64, usize, f64)]) -> Report {
        let entry =
            |(index, &(residual_norm, sites_changed, damping)): (usize, &(f64, usize, f64))| Iteration {
                index,
                residual_norm,
                step_norm: 1.0,
                damping,
                sites_changed,
                rcond: None,
                step: Step::Newton,
                linear_iterations: 0,
                forcing: 0.0,
            };
        Report {
            history: list.iter().enumerate().map(entry).collect(),
            ..Report::default()
        }
    }

    #[test]
    fn orders_are_those_of_one_selection() {
        let order = |list: &[(f64, usize, f64)]| history(list).observed_order(1e-13);
        let quadratic = [
            (1e-1, 1, 1.0),
            (1e-2, 0, 1.0),
            (1e-4, 0, 1.0),
            (1e-8, 0, 1.0),
            (1e-15, 0, 0.0),
        ];
        assert!((order(&quadratic).unwrap() - 2.0).abs() < 1e-12);
        // A site that changes on arriving at the second last residual leaves two.
        let mut late = quadratic;
        late[2].1 = 1;
        assert_eq!(order(&late), None);
        late[2].1 = 0;
        late[1].1 = 1;
        assert!((order(&late).unwrap() - 2.0).abs() < 1e-12);
        // A shortened step is no Newton step.
        let mut short = quadratic;
        short[2].2 = 0.5;
        assert_eq!(order(&short), None);
        short[2].2 = 1.0;
        short[1].2 = 0.5;
        assert_eq!(order(&short), None);
        // Nor is one along the gradient, long as it may be.
        let mut other = history(&quadratic);
        other.history[2].step = Step::Gradient;
        assert_eq!(other.observed_order(1e-13), None);
        assert_eq!(order(&quadratic[..2]), None);
        assert_eq!(order(&[(1e-1, 0, 1.0), (1e-2, 0, 1.0), (2e-2, 0, 1.0)]), None);
        // A floor below rounding.
        assert_eq!(order(&[(7e-5, 1, 1.0), (2e-11, 0, 1.0), (5e-13, 0, 0.0)]), None);
        // Linear convergence with some scatter.
        let linear = [(1e-1, 0, 1.0), (4.8e-2, 0, 1.0), (2.5e-2, 0, 1.0)];
        assert!((order(&linear).unwrap() - 1.0).abs() < 0.15);
    }
}
