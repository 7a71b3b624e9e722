use super::Damping;
use crate::InputError;
use crate::input::{any, check_options, fraction, not_negative};
use crate::linear::KrylovMethod;
use crate::options::setters;

/// Accuracy to which a Newton step is computed: ‖H + G d‖₂ ≤ η ‖H‖₂ with the forcing term η of the iteration.
///
/// S. C. Eisenstat, H. F. Walker, SIAM J. Sci. Comput. 17 (1996). Both choices fall to zero where Newton's method converges, so that the
/// iteration converges superlinearly; far from a solution, where the linear model is poor, they save linear iterations. They are bounded
/// below in terms of the previous η as long as that bound is above 0.1 (the safeguards of the paper).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Forcing {
    /// The same η in (0, 1) in each iteration: linear convergence with about this factor.
    Constant(f64),
    /// Choice 1: η = |‖H‖ − ‖H₋ + G₋ d₋‖| / ‖H₋‖, how far the linear model was off in the step before; not below η₋^φ, φ = (1 + √5)/2.
    Model,
    /// Choice 2: η = γ (‖H‖ / ‖H₋‖)^α, the decrease in the step before; not below γ η₋^α.
    Decrease {
        /// γ in (0, 1].
        gamma: f64,
        /// α in (1, 2].
        alpha: f64,
    },
}

impl Default for Forcing {
    /// Choice 2 with γ = 0.9 and α = 2.
    fn default() -> Self {
        Self::Decrease {
            gamma: 0.9,
            alpha: 2.0,
        }
    }
}

/// Where safeguards hold.
const SAFEGUARD: f64 = 0.1;

/// Data of the previous step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Before {
    /// ‖H₋‖.
    pub(super) norm: f64,
    /// ‖H₋ + G₋ d₋‖ / ‖H₋‖ of the step taken.
    pub(super) model: f64,
    /// η₋.
    pub(super) forcing: f64,
}

impl Forcing {
    /// η for a residual of size `norm`; `goal` is the one at which the run ends.
    pub(super) fn next(
        self,
        options: &NewtonKrylovOptions,
        before: Option<Before>,
        norm: f64,
        goal: f64,
    ) -> f64 {
        let largest = options.max_forcing;
        let eta = match (self, before) {
            (Self::Constant(eta), _) => return eta,
            (_, None) => options.first_forcing,
            (Self::Model, Some(b)) => {
                let floor = b.forcing.powf(f64::midpoint(1.0, 5.0_f64.sqrt()));
                safeguarded((norm / b.norm - b.model).abs(), floor)
            }
            (Self::Decrease { gamma, alpha }, Some(b)) => {
                let floor = gamma * b.forcing.powf(alpha);
                safeguarded(gamma * (norm / b.norm).powf(alpha), floor)
            }
        };
        // A linear residual below the tolerance of the run is of no use (C. T. Kelley, 1995, (6.20)).
        eta.max(0.5 * goal / norm).min(largest)
    }
}

fn safeguarded(eta: f64, floor: f64) -> f64 {
    if floor > SAFEGUARD { eta.max(floor) } else { eta }
}

/// Options of [`NewtonKrylov`](super::NewtonKrylov).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct NewtonKrylovOptions {
    /// The method for the linear systems. Default: GMRES with 30 directions.
    pub method: KrylovMethod,
    /// Forcing terms: how accurately they are solved. Default: choice 2 of Eisenstat and Walker.
    pub forcing: Forcing,
    /// η of the first iteration, in (0, 1). Default 0.5.
    pub first_forcing: f64,
    /// Largest η, in (0, 1). Default 0.9.
    pub max_forcing: f64,
    /// Largest number of iterations of the Krylov method in one Newton step. Default 500.
    pub max_linear_iterations: usize,
    /// Largest number of Newton steps. Default 100.
    pub max_iterations: usize,
    /// Absolute tolerance on ‖H(x)‖₂, in the units of the residual. Default 0: only the relative one counts.
    pub absolute_tolerance: f64,
    /// Tolerance on ‖H(x)‖₂ relative to ‖G x‖₂ + ‖G x − H(x)‖₂, for H(x) = A x − b to ‖A x‖₂ + ‖b‖₂. Default 1e-10.
    pub relative_tolerance: f64,
    /// When steps are shortened: [`Damping::OnTrouble`] begins once five full steps have not brought the residual below nine tenths of its
    /// least value.
    pub damping: Damping,
    /// Sufficient decrease of the line search, in (0, 1). Default 1e-4.
    pub armijo: f64,
    /// Smallest step length of the line search, in (0, 1). Default 1e-10.
    pub min_damping: f64,
}

impl Default for NewtonKrylovOptions {
    fn default() -> Self {
        Self {
            method: KrylovMethod::Gmres { directions: 30 },
            forcing: Forcing::default(),
            first_forcing: 0.5,
            max_forcing: 0.9,
            max_linear_iterations: 500,
            max_iterations: 100,
            absolute_tolerance: 0.0,
            relative_tolerance: 1e-10,
            damping: Damping::OnTrouble,
            armijo: 1e-4,
            min_damping: 1e-10,
        }
    }
}

impl NewtonKrylovOptions {
    setters! {
        /// Sets the method for the linear systems.
        with_method(method: KrylovMethod);
        /// Sets the forcing terms.
        with_forcing(forcing: Forcing);
        /// Sets η of the first iteration.
        with_first_forcing(first_forcing: f64);
        /// Sets the largest number of iterations of the Krylov method in one Newton step.
        with_max_linear_iterations(max_linear_iterations: usize);
        /// Sets the largest number of Newton steps.
        with_max_iterations(max_iterations: usize);
        /// Sets when steps are shortened.
        with_damping(damping: Damping);
        /// Sets the largest η.
        with_max_forcing(max_forcing: f64);
        /// Sets the absolute tolerance.
        with_absolute_tolerance(absolute_tolerance: f64);
        /// Sets the relative tolerance.
        with_relative_tolerance(relative_tolerance: f64);
        /// Sets the sufficient decrease of the line search.
        with_armijo(armijo: f64);
        /// Sets the smallest step length of the line search.
        with_min_damping(min_damping: f64);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        let (gamma, alpha, constant) = match self.forcing {
            Forcing::Decrease { gamma, alpha } => (gamma, alpha, 0.5),
            Forcing::Constant(eta) => (0.9, 2.0, eta),
            Forcing::Model => (0.9, 2.0, 0.5),
        };
        let directions = match self.method {
            KrylovMethod::Gmres { directions } | KrylovMethod::FlexibleGmres { directions } => directions,
            _ => 1,
        };
        let is_constant = constant > 0.0 && constant < 1.0;
        check_options(&[
            fraction("first_forcing", self.first_forcing),
            fraction("max_forcing", self.max_forcing),
            (
                "forcing",
                constant,
                is_constant,
                "a number in (0, 1) where it is constant",
            ),
            ("forcing.gamma", gamma, gamma > 0.0 && gamma <= 1.0, "in (0, 1]"),
            ("forcing.alpha", alpha, alpha > 1.0 && alpha <= 2.0, "in (1, 2]"),
            any("method.directions", directions as u64),
            any("max_linear_iterations", self.max_linear_iterations as u64),
            any("max_iterations", self.max_iterations as u64),
            not_negative("absolute_tolerance", self.absolute_tolerance),
            not_negative("relative_tolerance", self.relative_tolerance),
            fraction("armijo", self.armijo),
            fraction("min_damping", self.min_damping),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// S. C. Eisenstat, H. F. Walker, SIAM J. Sci. Comput. 17 (1996), (2.2), (2.6) and the safeguards that follow them, by hand.
    #[test]
    fn forcing_terms_by_hand() {
        let options = NewtonKrylovOptions::default();
        let eta = |forcing: Forcing, before: f64, norm: f64, goal: f64| {
            let before = Before {
                norm: 1.0,
                model: 0.3,
                forcing: before,
            };
            forcing.next(&options, Some(before), norm, goal)
        };
        let is = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        let decrease = Forcing::default();
        is(eta(decrease, 0.2, 0.1, 0.0), 0.9 * 0.01);
        is(eta(decrease, 0.5, 0.1, 0.0), 0.9 * 0.25);
        is(eta(decrease, 0.2, 2.0, 0.0), 0.9);
        is(eta(Forcing::Model, 0.2, 0.1, 0.0), 0.2);
        is(
            eta(Forcing::Model, 0.5, 0.1, 0.0),
            0.5_f64.powf((1.0 + 5.0_f64.sqrt()) / 2.0),
        );
        // Half of the tolerance of the run.
        is(eta(decrease, 0.2, 0.1, 0.08), 0.4);
        is(eta(decrease, 0.2, 0.1, 0.3), 0.9);
        is(decrease.next(&options, None, 1.0, 0.0), 0.5);
        is(eta(Forcing::Constant(0.01), 0.5, 0.1, 0.08), 0.01);
    }
}
