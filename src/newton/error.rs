use std::fmt;

use thiserror::Error;

use super::Report;
use crate::InputError;
use crate::linear::LinearError;
use crate::piecewise::{PiecewiseError, carries_maps};
use crate::run::Status;
use crate::words::Count;

/// What can go wrong in the corrector.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NewtonError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The map or the start is unusable.
    #[error(transparent)]
    Map(PiecewiseError),
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

carries_maps!(NewtonError);

/// The state at the end of a failed run. Its `Debug` leaves out vectors and history, so that a `main` which returns the error prints a line.
#[derive(Clone, PartialEq)]
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

impl fmt::Debug for Unsolved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Unsolved")
            .field("status", &self.status)
            .field("residual_norm", &self.residual_norm)
            .field("iterations", &self.report.history.len())
            .finish_non_exhaustive()
    }
}
