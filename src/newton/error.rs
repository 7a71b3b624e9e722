use thiserror::Error;

use super::Report;
use crate::linear::LinearError;
use crate::piecewise::PiecewiseError;
use crate::run::Status;
use crate::words::Count;

/// What can go wrong in the corrector.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NewtonError {
    /// An option is out of its range.
    #[error("option {name} = {value} is out of range; it must be {range}")]
    Option {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        range: &'static str,
    },
    /// The map or the start is unusable.
    #[error(transparent)]
    Map(#[from] PiecewiseError),
    /// The linear solver refused the problem.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// No solution was found. The best iterate and the history are kept.
    #[error(
        "no solution found after {}: {}; best residual {:e}",
        Count(.0.report.history.len(), "iteration", "iterations"), .0.status, .0.residual_norm
    )]
    Failed(Box<Unsolved>),
}

/// The state at the end of a failed run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Unsolved {
    /// How it ended: not [`Solved`](Status::Solved).
    pub status: Status,
    /// The iterate with the smallest residual.
    pub x: Vec<f64>,
    /// ‖H(x)‖₂ there.
    pub residual_norm: f64,
    /// The history.
    pub report: Report,
}
