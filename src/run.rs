//! Words for runs: how they ended.
//!
//! Each solver's report says with one [`Status`] how it ended; what is special to a solver stands beside it in its report.
//!
//! | status | given by |
//! |---|---|
//! | [`Solved`] | all, of [`Bundle`] stationary in the sense of Clarke to the tolerance; [`Newton`] and [`NewtonKrylov`] return a [`Convergence`](crate::newton::Convergence) in its place, else an error with the status |
//! | [`AtRounding`] | [`McpSolver`], [`ViSolver`] |
//! | [`NoSolution`] | [`McpSolver`] (a vector, or all active sets ruled out), [`ViSolver`], [`ConeSolver`], [`Lemke`] (rays) |
//! | [`EmptySet`] | [`ViSolver`] (multipliers of Farkas' lemma) |
//! | [`Unbounded`] | [`McpSolver`], [`ViSolver`] |
//! | [`Ray`] | [`Lemke`] |
//! | [`Stationary`] | [`McpSolver`], [`ViSolver`], [`Newton`] |
//! | [`Stalled`] | [`McpSolver`], [`ViSolver`], [`ConeSolver`], [`DelassusSolver`], [`Newton`], [`NewtonKrylov`], [`Bundle`]; [`Krylov`] (GMRES between restarts) |
//! | [`Cycling`] | [`Newton`] (selections that come back) |
//! | [`Singular`] | [`Newton`], [`ActiveSetSolver`] (reduced matrices), [`Krylov`] (the matrix or the preconditioner) |
//! | [`FarOut`] | [`Newton`] |
//! | [`Inaccurate`] | [`Bundle`] (its quadratic programs), [`ActiveSetSolver`], [`Lemke`] (the basis), [`NewtonKrylov`] (the preconditioner is not finite) |
//! | [`Linear`] | [`NewtonKrylov`] |
//! | [`EvaluationFailure`] | [`Bundle`], [`McpSolver`], [`ViSolver`], [`ConeSolver`], [`Newton`], [`NewtonKrylov`] |
//! | [`IterationLimit`] | all; of [`DelassusSolver`] on factorisations, of [`Lemke`] on exchanges |
//! | [`TimeLimit`] | [`Bundle`], [`McpSolver`], [`ViSolver`], [`ConeSolver`], [`DelassusSolver`]; searches of [`contact`](crate::contact) |
//! | [`Interrupted`] | all but [`Krylov`] |
//!
//! [`Bundle`]: crate::optimise::Bundle
//! [`McpSolver`]: crate::complementarity::McpSolver
//! [`ViSolver`]: crate::variational::ViSolver
//! [`ConeSolver`]: crate::cones::ConeSolver
//! [`DelassusSolver`]: crate::contact::DelassusSolver
//! [`ActiveSetSolver`]: crate::complementarity::active_set::ActiveSetSolver
//! [`Lemke`]: crate::complementarity::pivoting::Lemke
//! [`Krylov`]: crate::linear::Krylov
//! [`Newton`]: crate::newton::Newton
//! [`NewtonKrylov`]: crate::newton::NewtonKrylov
//! [`Solved`]: Status::Solved
//! [`AtRounding`]: Status::AtRounding
//! [`NoSolution`]: Status::NoSolution
//! [`EmptySet`]: Status::EmptySet
//! [`Unbounded`]: Status::Unbounded
//! [`Ray`]: Status::Ray
//! [`Stationary`]: Status::Stationary
//! [`Stalled`]: Status::Stalled
//! [`Cycling`]: Status::Cycling
//! [`Singular`]: Status::Singular
//! [`FarOut`]: Status::FarOut
//! [`Inaccurate`]: Status::Inaccurate
//! [`Linear`]: Status::Linear
//! [`EvaluationFailure`]: Status::EvaluationFailure
//! [`IterationLimit`]: Status::IterationLimit
//! [`TimeLimit`]: Status::TimeLimit
//! [`Interrupted`]: Status::Interrupted

use std::fmt;

use crate::words::Size;

/// How a run ended. The [table](self) says which solver gives which.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Status {
    /// The point returned is a solution: it satisfies bounds or cones, and each row to the tolerance, as checked at that point.
    Solved,
    /// The residual is only the rounding error of its terms, which are so large (or x so far out) that it is not informative: x may be the
    /// best attainable point.
    AtRounding,
    /// There is no solution, which is proven: the report holds what proves it, unless all active sets of a small affine problem were ruled
    /// out.
    NoSolution,
    /// No point satisfies the constraints whatever F is, which is proven by what the report holds.
    EmptySet,
    /// Iterates or paths tend to infinity; a residual that tends to 0 there does not indicate a solution.
    Unbounded,
    /// The path ended on a ray, which decides nothing: there may be a solution.
    Ray,
    /// A stationary point of the merit function, half the square of a norm of the residual, that is no solution.
    Stationary {
        /// Size of the gradient there: of [`McpSolver`](crate::complementarity::McpSolver) the largest component of the projected gradient
        /// of the (scaled) merit function, of [`Newton`](crate::newton::Newton) ‖∇Hᵀ H‖₂.
        gradient_norm: f64,
    },
    /// Nothing that the solver knows made progress any more.
    Stalled,
    /// The same selections came back without progress.
    Cycling,
    /// A matrix that has to be regular (or, where the method needs that, positive definite) is not, and nothing leads on from there.
    Singular,
    /// So far out that the rounding of the terms of a row exceeds its constants, at a singular Jacobian: whether a solution is near cannot be
    /// seen there.
    FarOut {
        /// The row, from 0.
        row: usize,
    },
    /// Rounding, or linear systems that are not solved accurately enough, leave nothing to go on with.
    Inaccurate,
    /// The Krylov method did not get far enough for a step that decreases the residual: a preconditioner is missing, or the derivative is
    /// singular.
    Linear {
        /// ‖H + G d‖₂ / ‖H‖₂ it reached.
        residual: f64,
    },
    /// The function or its derivative is not finite at the start and at all points tried near it, or along every step from the best point.
    EvaluationFailure {
        /// First component, or row of the derivative, that is not finite or has no finite square, from 0.
        component: usize,
    },
    /// The limit on iterations, or on what the solver counts in place of them.
    IterationLimit,
    /// The limit on time.
    TimeLimit,
    /// The observer asked to stop.
    Interrupted,
}

impl Status {
    /// A few words: "solved" exactly if the problem is solved.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::AtRounding => "at rounding",
            Self::NoSolution => "no solution",
            Self::EmptySet => "empty set",
            Self::Unbounded => "unbounded",
            Self::Ray => "ray",
            Self::Stationary { .. } => "stationary",
            Self::Stalled => "stalled",
            Self::Cycling => "cycling",
            Self::Singular => "singular",
            Self::FarOut { .. } => "far out",
            Self::Inaccurate => "inaccurate",
            Self::Linear { .. } => "linear systems unsolved",
            Self::EvaluationFailure { .. } => "evaluation failure",
            Self::IterationLimit => "iteration limit",
            Self::TimeLimit => "time limit",
            Self::Interrupted => "interrupted",
        }
    }

    /// The end of a run at values that are not finite, or whose norm is not.
    pub(crate) fn evaluation_failure(values: &[f64]) -> Self {
        let component = values.iter().position(|v| !(v * v).is_finite());
        Self::EvaluationFailure {
            component: component.unwrap_or(0),
        }
    }

    /// Whether the run was ended from outside, by an observer or by the clock.
    pub(crate) const fn is_early(self) -> bool {
        matches!(self, Self::Interrupted | Self::TimeLimit)
    }

    /// Whether the point returned is a solution.
    #[must_use]
    pub const fn is_solved(self) -> bool {
        matches!(self, Self::Solved)
    }
}

impl fmt::Display for Status {
    /// A sentence, to which a report may add numbers.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stationary { gradient_norm } => {
                return write!(
                    f,
                    "a stationary point of the merit function (gradient {}) that is no solution",
                    Size(*gradient_norm)
                );
            }
            Self::EvaluationFailure { component } => {
                return write!(
                    f,
                    "component {component} of the function or its derivative cannot be evaluated: it is not finite"
                );
            }
            Self::FarOut { row } => {
                return write!(
                    f,
                    "equation {row} holds only because rounding of its terms hides its constants this far out; start nearer to the solution"
                );
            }
            Self::Linear { residual } => {
                return write!(
                    f,
                    "the Krylov method got no further than a relative residual of {residual:e}"
                );
            }
            Self::AtRounding => {
                "the residual is only the rounding error of terms too large for the tolerance"
            }
            Self::NoSolution => "there is no solution",
            Self::EmptySet => "no point satisfies the constraints",
            Self::Unbounded => "the iterates tend to infinity",
            Self::Ray => "the path ends on a ray, which does not decide whether there is a solution",
            Self::Stalled => "nothing that was tried makes progress any more",
            Self::Cycling => "the iteration cycles between selections",
            Self::Singular => "the Jacobian, or another matrix of the method, is singular or not definite",
            Self::Inaccurate => {
                "rounding, or linear systems not solved accurately enough, leave nothing to go on with"
            }
            Self::IterationLimit => "the limit on iterations was reached",
            Self::TimeLimit => "the limit on time was reached",
            Self::Solved => "solved",
            Self::Interrupted => "stopped by the observer",
        })
    }
}
