use thiserror::Error;

use crate::InputError;
use crate::continuation::ContinuationError;
use crate::linear::LinearError;
use crate::piecewise::{LocalUniqueness, PiecewiseError, Selection, carries_maps};
use crate::words::Size;

/// Why a derivative of a solution is not given.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SensitivityError {
    /// The map has no variables besides those of the solution.
    #[error(
        "a map of {vars} variables and {residuals} residuals has no parameters; give one of the unknowns followed by the parameters"
    )]
    NoParameters {
        /// Number of variables.
        vars: usize,
        /// Number of residuals.
        residuals: usize,
    },
    /// The map does not fit.
    #[error(transparent)]
    Map(PiecewiseError),
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// No derivative of the map depends on a parameter.
    #[error("parameter {parameter} does not enter the equations; leave it out or correct the function")]
    NotEntering {
        /// Its number, from 0.
        parameter: usize,
    },
    /// The point is not near a solution at these parameters.
    #[error(
        "the point is no solution at these parameters (largest residual {residual:e}): Newton's method moves unknown {variable} by \
         {distance:e}; solve the problem first"
    )]
    NoSolution {
        /// The unknown that moves most against its size, from 0.
        variable: usize,
        /// How far it moves; infinite where Newton's method does not converge.
        distance: f64,
        /// Largest residual at the point.
        residual: f64,
    },
    /// The point lies in the cell of no piece at a site.
    #[error("the point lies outside the domain of the map at {site}; no piece is active there")]
    Outside {
        /// Name of the site.
        site: String,
    },
    /// The derivative of a selection in the unknowns is singular.
    #[error(
        "the solution is irregular: the derivative of the active pieces in the unknowns is singular (reciprocal condition {}{}); \
         follow the curve of solutions instead",
        Size(*rcond),
        singular_value.map(|s| format!(", least singular value {}", Size(s))).unwrap_or_default()
    )]
    Irregular {
        /// The selection.
        selection: Selection,
        /// Reciprocal condition, rows and columns equilibrated.
        rcond: f64,
        /// Least singular value in the units of the map; `None` with more than 500 rows.
        singular_value: Option<f64>,
    },
    /// At a kink, it is not certified that the solutions are one function of the parameters.
    #[error(
        "at this kink the solutions are not known to be one function of the parameters: {verdict}; `directional` lists the branches"
    )]
    NotUnique {
        /// What is known.
        verdict: Box<LocalUniqueness>,
    },
    /// The solution is not known to be differentiable.
    #[error(
        "the solution is not known to be differentiable here; use `directional` for one direction, `element` or `vjp` for methods that take generalised derivatives"
    )]
    NotDifferentiable,
    /// A parameter enters by its derivative at the solution alone.
    #[error(
        "the equations are known as a function of parameter {parameter} only to first order at this solution, which does not say how far its \
         piece holds; give a direction without it, or a family of problems to `valid_along`"
    )]
    AtSolution {
        /// Its number, from 0.
        parameter: usize,
    },
    /// Directions that do not span the parameters.
    #[error("the frame must consist of {expected} linearly independent directions")]
    Frame {
        /// Number of parameters.
        expected: usize,
    },
    /// Rounding hides into which cell a direction points.
    #[error("rounding hides on which side of a kink the solutions go on")]
    Rounding,
    /// The curve of solutions along a direction could not be followed.
    #[error(transparent)]
    Continuation(#[from] ContinuationError),
}

carries_maps!(SensitivityError);

impl From<LinearError> for SensitivityError {
    fn from(error: LinearError) -> Self {
        Self::Map(error.into())
    }
}
