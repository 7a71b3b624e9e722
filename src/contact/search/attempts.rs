//! Words for searches: what is tried, how far it is, how it ended.

use std::fmt;

use crate::run::Status;
use crate::words::{Size, iterations, named};

/// Strategies for a first solution, in the order in which they are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactStrategy {
    /// PS-Newton from the start given; from zero if there is none.
    Newton,
    /// PS-Newton from zero and from the problem with all nodes stuck; where contact alone holds the body and
    /// all else has failed, from the body on soft springs, which are moved along until they pull at nothing.
    Restart,
    /// The same with larger augmentation parameters r: solutions do not depend on r, the iterates of Newton's
    /// method do.
    Stiffer,
    /// The body is lowered onto the foundation, from a height at which no node touches it, in increments,
    /// each solved by PS-Newton.
    Increments,
    /// The body is lowered onto the foundation, and the curve of solutions followed through kinks and folds.
    Path,
    /// In the displacements alone: the load in steps, each solved by semismooth Newton steps.
    LoadSteps,
    /// In the displacements alone: the strategies of the condensed form.
    Condensed,
}

impl ContactStrategy {
    /// The strategy in a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Newton => "Newton",
            Self::Restart => "restart",
            Self::Stiffer => "stiffer",
            Self::Increments => "increments",
            Self::Path => "path",
            Self::LoadSteps => "load steps",
            Self::Condensed => "condensed form",
        }
    }
}

named!(
    ContactStrategy,
    "strategy for a contact problem",
    [
        Self::Newton,
        Self::Restart,
        Self::Stiffer,
        Self::Increments,
        Self::Path,
        Self::LoadSteps,
        Self::Condensed
    ]
);

/// The progress of a search for a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactProgress {
    /// What is being tried.
    pub strategy: ContactStrategy,
    /// Attempts of Newton's method made so far; while the body is lowered, increments or points of the path.
    pub points: usize,
    /// How far the body is lowered, from 0 to 1; 1 where it is not.
    pub level: f64,
}

/// One attempt at a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactAttempt {
    /// What was tried.
    pub strategy: ContactStrategy,
    /// The augmentation parameter of Newton's method.
    pub r: f64,
    /// Number of increments, or of points of the path; 0 for other strategies.
    pub path_points: usize,
    /// Iterations of Newton's method (after the path, if there is one).
    pub iterations: usize,
    /// ‖H‖₂ at the best iterate.
    pub residual_norm: f64,
    /// Why it failed; `None` for a solution, and where the linear solver failed.
    pub failure: Option<Status>,
}

/// A solution and how it was found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactReport {
    /// The solution, in the variables of the form.
    pub x: Vec<f64>,
    /// All attempts; the last one found the solution.
    pub attempts: Vec<ContactAttempt>,
}

impl ContactReport {
    /// The strategy that found the solution.
    #[must_use]
    pub fn strategy(&self) -> ContactStrategy {
        self.attempts
            .last()
            .map_or(ContactStrategy::Newton, |a| a.strategy)
    }
}

/// "found by increments in attempt 3, after 5 iterations": in one line.
impl fmt::Display for ContactReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "found by {}", self.strategy())?;
        if self.attempts.len() > 1 {
            write!(f, " in attempt {}", self.attempts.len())?;
        }
        match self.attempts.last() {
            Some(last) => write!(
                f,
                " after {}, residual {}",
                iterations(last.iterations),
                Size(last.residual_norm)
            ),
            None => Ok(()),
        }
    }
}
