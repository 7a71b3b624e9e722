use crate::InputError;
use crate::input::{any, check_options, fraction, not_negative};
use crate::options::setters;
use crate::piecewise::RegularityOptions;

/// When Newton steps are shortened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Damping {
    /// Full steps; once a selection is met again without progress, a line search on ½‖H‖² with equilibrated rows.
    #[default]
    OnTrouble,
    /// A line search from the first step.
    Always,
    /// Full steps only.
    Never,
}

/// Options of the corrector. The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct NewtonOptions {
    /// Largest number of iterations. Default 100.
    pub max_iterations: usize,
    /// Absolute tolerance on ‖H(x)‖₂, in the units of the residual. Default 0: only the relative one counts.
    pub absolute_tolerance: f64,
    /// Tolerance on ‖H(x)‖₂ relative to the size of the terms that cancel in it, S = ‖(Σ_j |∂H_i/∂x_j| |x_j|)_i‖₂. Default 1e-13.
    pub relative_tolerance: f64,
    /// When steps are shortened.
    pub damping: Damping,
    /// Sufficient decrease of the line search, in (0, 1). Default 1e-4.
    pub armijo: f64,
    /// Smallest step length of the line search, in (0, 1). Default 1e-10.
    pub min_damping: f64,
    /// Whether, and how, the regularity of solutions is examined, for [`Report::regularity`](super::Report::regularity). Default `None`: it is
    /// not.
    pub regularity: Option<RegularityOptions>,
}

impl Default for NewtonOptions {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            absolute_tolerance: 0.0,
            relative_tolerance: 1e-13,
            damping: Damping::OnTrouble,
            armijo: 1e-4,
            min_damping: 1e-10,
            regularity: None,
        }
    }
}

impl NewtonOptions {
    setters! {
        /// Sets the largest number of iterations.
        with_max_iterations(max_iterations: usize);
        /// Sets the sufficient decrease of the line search.
        with_armijo(armijo: f64);
        /// Sets the smallest step length of the line search.
        with_min_damping(min_damping: f64);
        /// Sets when steps are shortened.
        with_damping(damping: Damping);
        /// Sets whether, and how, the regularity of solutions is examined.
        with_regularity(regularity: Option<RegularityOptions>);
    }

    /// Sets the absolute and the relative tolerance.
    #[must_use]
    pub fn with_tolerances(mut self, absolute: f64, relative: f64) -> Self {
        self.absolute_tolerance = absolute;
        self.relative_tolerance = relative;
        self
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[
            any("max_iterations", self.max_iterations as u64),
            not_negative("absolute_tolerance", self.absolute_tolerance),
            not_negative("relative_tolerance", self.relative_tolerance),
            fraction("armijo", self.armijo),
            fraction("min_damping", self.min_damping),
        ])?;
        self.regularity
            .as_ref()
            .map_or(Ok(()), RegularityOptions::validate)
    }
}
