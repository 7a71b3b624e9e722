use std::time::Duration;

use crate::InputError;
use crate::input::{any, check_options, fraction, positive};
use crate::options::setters;

/// How a curve is followed through kinks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Strategy {
    /// Frozen selection between transitions, an exact stop at each, a choice of arm there.
    #[default]
    Located,
    /// The algorithm of Haslinger, Janovský and Ligurský (2012): the selection is that of the active set at
    /// each iterate; steps are halved down to `min_step` in front of a kink, then the vanishing test
    /// functions give a new selection. Transitions are accurate to `min_step` only, and the curve may jump to
    /// another branch; kept to reproduce published runs, with
    /// [`haslinger_janovsky_ligursky`](ContinuationOptions::haslinger_janovsky_ligursky), which says what the
    /// talk on it leaves open.
    Switching,
}

/// How [`Strategy::Switching`] chooses the length of the next step (Step 7: "according to the rate of
/// convergence of the corrections"). In both rules a step that had to be halved is followed by none
/// that is longer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StepRule {
    /// h · `growth`: whatever converges counts as fast. The printed runs are reproduced with it.
    #[default]
    Growth,
    /// h · √(¼/κ), at least h · `shrink` and at most h · `growth`, where κ = ‖X² − X¹‖/‖X¹ − X⁰‖ of the
    /// corrections (0 where one was enough). The rate κ of Newton's method is proportional to h² (Allgower,
    /// Georg (1990): *Numerical Continuation Methods*, section 6.1); with κ = ¼ it converges safely and fast
    /// (Deuflhard (2011): *Newton Methods for Nonlinear Problems*, section 5.1).
    Convergence,
}

/// Options of the continuation. The defaults suit most problems. Those on steps and corrections have no
/// effect where all pieces are affine
/// ([`PiecewiseSmooth::is_piecewise_affine`](crate::piecewise::PiecewiseSmooth::is_piecewise_affine)) and
/// kinks are located: curves go from kink to kink.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ContinuationOptions {
    /// How kinks are passed. Default [`Strategy::Located`].
    pub strategy: Strategy,
    /// First step length h, in arclength. Default 0.05.
    pub step: f64,
    /// Smallest step length h_min, shortened with the size of α where that is below 1; then at most `step` and `max_step`. Default 1e-8.
    pub min_step: f64,
    /// Largest step length h_max. Default 1.
    pub max_step: f64,
    /// Factor by which an easy step grows, at least 1. Default 1.3.
    pub growth: f64,
    /// How the next step follows from the last under [`Strategy::Switching`]. Default [`StepRule::Growth`].
    pub step_rule: StepRule,
    /// Factor by which a rejected step shrinks, in (0, 0.95]. Default 0.5.
    pub shrink: f64,
    /// ε: bound on ‖H‖₂ of a corrected point; absolute under [`Strategy::Switching`], relative to the size of the terms that
    /// cancel in H under [`Strategy::Located`]. Default 1e-11.
    pub residual_tolerance: f64,
    /// ε': bound on the last correction ‖X^k − X^(k−1)‖₂; absolute under [`Strategy::Switching`], relative to ‖x‖₂ + h under
    /// [`Strategy::Located`]. Where ∇H is nearly singular a correction as short as those that rounding errors of H make serves, too, if it is
    /// below 1e-6 (1 + ‖x‖₂). Default 1e-8.
    pub step_tolerance: f64,
    /// k_max: largest number of corrections. Default 10.
    pub max_corrections: usize,
    /// Smallest cosine between the tangents at both ends of an accepted step, in (0, 1). Default 0.97.
    pub min_cos: f64,
    /// Interval of the parameter α to stay in. Default (−∞, ∞).
    #[cfg_attr(feature = "serde", serde(with = "crate::extended::pair"))]
    pub parameter_range: (f64, f64),
    /// Parameter values at which a point is wanted exactly, in any order. Default none.
    pub targets: Vec<f64>,
    /// Largest number of points (of all kinds). Default 10 000. A [`Branch`](super::Branch) holds about 16 bytes a variable for each
    /// point; the iterator itself keeps none.
    pub max_points: usize,
    /// Largest arclength. Default ∞.
    #[cfg_attr(feature = "serde", serde(with = "crate::extended"))]
    pub max_arclength: f64,
    /// Largest ‖x‖₂ relative to 1 + ‖x⁰‖₂ (curves may tend to infinity at a pole). Default 1e6.
    #[cfg_attr(feature = "serde", serde(with = "crate::extended"))]
    pub max_growth: f64,
    /// Largest wall-clock time, checked before each step and, in searches of many arms, before each linear program and factorisation. A
    /// factorisation or a singular value decomposition at a degenerate point is not interrupted. Default none.
    pub max_time: Option<Duration>,
    /// Distance in x, relative to 1 + ‖x‖₂, within which a test function counts as vanishing at a start, at a branch point and where the
    /// selection is singular. At transitions met along a curve, the distance along the curve decides, to rounding. Default 1e-9.
    pub vanishing_distance: f64,
    /// Typical sizes of all variables (y, α), in their units: distances and angles are measured in the
    /// variables divided by them, arclength in that measure times the size of α, so that steps are changes of
    /// α where nothing else changes much. Default empty: the sizes given by the map
    /// ([`Description::typical_sizes`](crate::piecewise::Description::typical_sizes)), that of α at most the
    /// largest of 1 and the bounds of its range; where all pieces are affine, or their exact coefficients are
    /// affine in α, only if some are further than a factor of 10³ from 1.
    pub typical_sizes: Vec<f64>,
    /// Largest number of active selections examined at one point where all are tried in turn. Default 4096.
    pub max_selections: u64,
    /// Largest number of partial selections tried at one point where the search for arms is pruned. Default 1 000 000.
    pub max_nodes: u64,
    /// Where the search for arms reaches its limits, a local search starts from this number of random selections for either sign of α̇,
    /// with 80 linear solves for each (4 where there are more than 600 unknowns); it may find arms but never makes the list complete.
    /// Default 50.
    pub local_starts: usize,
}

impl Default for ContinuationOptions {
    fn default() -> Self {
        Self {
            strategy: Strategy::Located,
            step: 0.05,
            min_step: 1e-8,
            max_step: 1.0,
            growth: 1.3,
            step_rule: StepRule::Growth,
            shrink: 0.5,
            residual_tolerance: 1e-11,
            step_tolerance: 1e-8,
            max_corrections: 10,
            min_cos: 0.97,
            parameter_range: (f64::NEG_INFINITY, f64::INFINITY),
            targets: Vec::new(),
            max_points: 10_000,
            max_arclength: f64::INFINITY,
            max_growth: 1e6,
            max_time: None,
            vanishing_distance: 1e-9,
            typical_sizes: Vec::new(),
            max_selections: 4096,
            max_nodes: 1_000_000,
            local_starts: 50,
        }
    }
}

impl ContinuationOptions {
    /// The algorithm of Haslinger, Janovský and Ligurský (2012), *Qualitative analysis of solutions to
    /// discrete static contact problems with Coulomb friction*, with the settings and the steps printed in
    /// their talk on it: ε = ε' = 1e-6, h_min = 1e-5, h = 0.05, k_max = 10.
    ///
    /// What is left open there is chosen here, so that the printed points come out at the printed indices:
    /// - Step 5 halves h, to h_min at least (`shrink`).
    /// - Step 7 multiplies h by 1.3 (`growth`), up to 1 (`max_step`), but not after a step that had to be
    ///   halved. [`StepRule::Convergence`] goes by the rate of convergence instead.
    /// - Step 6 takes test functions as vanishing that do so within 10 h_min along the tangent, and the first
    ///   active selection whose tangent, oriented by the sign of det \[∇H; τᵀ\], enters its own cell. The
    ///   point is corrected for the new selection, and h starts at 1.3 · 0.05.
    ///
    /// Corrections that converge are rejected, in Step 4, which is not printed either, where the tangents at
    /// both ends of the step are at an angle whose cosine is below `min_cos` = 0.97, where the new point is
    /// further from the old one than 3 h, and where the selection of the last iterate is another one and
    /// ‖H^(σ)‖ ≥ ε for the selection σ of the old point: each of them would pass a kink, or jump to another
    /// branch, unnoticed.
    #[must_use]
    pub fn haslinger_janovsky_ligursky() -> Self {
        Self {
            strategy: Strategy::Switching,
            min_step: 1e-5,
            residual_tolerance: 1e-6,
            step_tolerance: 1e-6,
            ..Self::default()
        }
    }

    setters! {
        /// Sets how kinks are passed.
        with_strategy(strategy: Strategy);
        /// Sets the first step length.
        with_step(step: f64);
        /// Sets the smallest step length.
        with_min_step(min_step: f64);
        /// Sets the largest step length.
        with_max_step(max_step: f64);
        /// Sets the factor by which an easy step grows.
        with_growth(growth: f64);
        /// Sets how the next step follows from the last under [`Strategy::Switching`].
        with_step_rule(step_rule: StepRule);
        /// Sets the factor by which a rejected step shrinks.
        with_shrink(shrink: f64);
        /// Sets the bound on ‖H‖₂ of a corrected point.
        with_residual_tolerance(residual_tolerance: f64);
        /// Sets the bound on the last correction.
        with_step_tolerance(step_tolerance: f64);
        /// Sets the largest number of corrections.
        with_max_corrections(max_corrections: usize);
        /// Sets the smallest cosine between neighbouring tangents.
        with_min_cos(min_cos: f64);
        /// Sets the interval of the parameter.
        with_parameter_range(parameter_range: (f64, f64));
        /// Sets the parameter values to be hit exactly.
        with_targets(targets: Vec<f64>);
        /// Sets the distance within which a test function counts as vanishing.
        with_vanishing_distance(vanishing_distance: f64);
        /// Sets the typical sizes of the variables.
        with_typical_sizes(typical_sizes: Vec<f64>);
        /// Sets the largest number of points.
        with_max_points(max_points: usize);
        /// Sets the largest arclength.
        with_max_arclength(max_arclength: f64);
        /// Sets the largest number of active selections examined at one point where all are tried in turn.
        with_max_selections(max_selections: u64);
        /// Sets the largest number of partial selections tried at one point.
        with_max_nodes(max_nodes: u64);
        /// Sets the number of starts of the local search for arms.
        with_local_starts(local_starts: usize);
        /// Sets the largest growth of ‖x‖.
        with_max_growth(max_growth: f64);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        let size = self.typical_sizes.last().copied().unwrap_or(1.0);
        let (lower, upper) = self.parameter_range;
        check_options(&[
            positive("step", self.step),
            positive("min_step", self.min_step),
            positive("max_step", self.max_step),
            (
                "min_step",
                self.min_step,
                self.min_step * size.min(1.0) <= self.step.min(self.max_step),
                "at most step and max_step (times the typical size of α, where one below 1 is given)",
            ),
            (
                "growth",
                self.growth,
                self.growth >= 1.0 && self.growth.is_finite(),
                "at least 1",
            ),
            (
                "shrink",
                self.shrink,
                self.shrink > 0.0 && self.shrink <= 0.95,
                "in (0, 0.95]",
            ),
            positive("residual_tolerance", self.residual_tolerance),
            positive("step_tolerance", self.step_tolerance),
            any("max_corrections", self.max_corrections as u64),
            fraction("min_cos", self.min_cos),
            (
                "parameter_range",
                lower,
                lower < upper,
                "an interval (lower, upper) with lower < upper",
            ),
            any("max_points", self.max_points as u64),
            (
                "max_arclength",
                self.max_arclength,
                self.max_arclength > 0.0,
                "positive",
            ),
            ("max_growth", self.max_growth, self.max_growth > 0.0, "positive"),
            fraction("vanishing_distance", self.vanishing_distance),
            any("max_selections", self.max_selections),
            any("max_nodes", self.max_nodes),
        ])?;
        let targets = self
            .targets
            .iter()
            .map(|&t| ("targets", t, t.is_finite(), "finite"));
        check_options(&targets.collect::<Vec<_>>())
    }
}
