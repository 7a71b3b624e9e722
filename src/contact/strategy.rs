//! What is tried in turn to solve a contact problem at fixed α.

use std::fmt;

use super::ContactError;
use super::approach::{Arrival, Observer};
use super::error::{check_finite, check_length};
use super::form::Form;
use super::node_law::{LocalValues, NodeLaw};
use crate::newton::{Failure, Newton, NewtonError, NewtonOptions};

/// Augmentation parameters tried after the one asked for, in units of the stiffness of a contact node.
const STIFFER: [f64; 3] = [1.0, 10.0, 1e3];

/// Number of paths tried, the nodes touching in another order each time.
const PATHS: usize = 6;

/// What is tried, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactStrategy {
    /// PS-Newton from the start given; from zero if there is none.
    Newton,
    /// PS-Newton from zero and from the problem with all nodes stuck.
    Restart,
    /// The same with larger augmentation parameters r: solutions do not depend on r, the way of Newton's method does.
    Stiffer,
    /// The body is lowered onto the foundation in increments, from where no node touches it, each solved by PS-Newton.
    Increments,
    /// The body is lowered onto the foundation, and the curve of solutions followed through kinks and folds.
    Path,
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
        }
    }
}

impl fmt::Display for ContactStrategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How far a search for a solution has come.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactProgress {
    /// What is being tried.
    pub strategy: ContactStrategy,
    /// Attempts of Newton's method so far; on the way down, increments or points of the path.
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
    /// Increments, or points of the path; 0 without.
    pub path_points: usize,
    /// Iterations of Newton's method (behind the path, if there is one).
    pub iterations: usize,
    /// ‖H‖₂ at the best iterate.
    pub residual_norm: f64,
    /// Why it failed; `None` for a solution, and for a linear solver that refused.
    pub failure: Option<Failure>,
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

/// Runs the strategies from `start` (α is set); `lower` makes the way down.
pub(super) fn solve<F: Form>(
    form: &F,
    alpha: f64,
    start: Option<&[f64]>,
    lower: &mut Lower<'_>,
    observe: &mut Observer<'_>,
) -> Result<ContactReport, ContactError> {
    check_finite("the parameter", &[alpha])?;
    let m = form.num_vars();
    let mut zero = vec![0.0; m];
    zero[m - 1] = alpha;
    for i in 0..form.num_sites() {
        form.law().check(&LocalValues {
            slip: [0.0; 2],
            ..form.values(i, &zero)
        })?;
    }
    let mut first = zero.clone();
    if let Some(x) = start {
        check_length("the start", x, m)?;
        first.copy_from_slice(x);
        first[m - 1] = alpha;
    }
    let mut search = Search {
        form,
        observe,
        newton: Newton::new(NewtonOptions::default()),
        attempts: Vec::new(),
        best: None,
        interrupted: false,
    };
    let found = search.newton_starts(alpha, &first, &zero)?;
    let found = match found {
        None if !search.interrupted => search.lowered(lower)?,
        found => found,
    };
    if let Some(x) = found {
        return Ok(ContactReport {
            x,
            attempts: search.attempts,
        });
    }
    let Some((_, mut source)) = search.best else {
        return Err(ContactError::Empty {
            what: "no start was tried",
        });
    };
    if let NewtonError::Failed(unsolved) = &mut source
        && search.interrupted
    {
        unsolved.reason = Failure::Interrupted;
    }
    Err(ContactError::NoStart {
        parameter: alpha,
        source: Box::new(source),
    })
}

/// The way down by a strategy, in the n-th order of the nodes.
pub(super) type Lower<'a> =
    dyn FnMut(ContactStrategy, usize, &mut Observer<'_>) -> Result<Option<Arrival>, ContactError> + 'a;

struct Search<'a, F> {
    form: &'a F,
    observe: &'a mut Observer<'a>,
    newton: Newton,
    attempts: Vec<ContactAttempt>,
    /// The failure with the smallest residual.
    best: Option<(f64, NewtonError)>,
    interrupted: bool,
}

impl<F: Form> Search<'_, F> {
    /// Newton's method from `first`, zero and stick, with several augmentation parameters.
    fn newton_starts(
        &mut self,
        alpha: f64,
        first: &[f64],
        zero: &[f64],
    ) -> Result<Option<Vec<f64>>, ContactError> {
        let own = self.form.augmentation();
        // Quick where it works: what Newton's method in general then makes of its result is one look.
        let mut quick = first.to_vec();
        if self.form.improve(&mut quick) {
            let found = self.attempt(ContactStrategy::Newton, own, &quick, 0)?;
            if found.is_some() || self.interrupted {
                return Ok(found);
            }
        }
        let stick = self.form.stick(alpha)?;
        let others = STIFFER.map(|f| f * self.form.stiffness());
        for r in std::iter::once(own).chain(others.into_iter().filter(|r| *r != own)) {
            let starts = [Some(first), Some(zero), stick.as_deref()];
            for (k, start) in starts.into_iter().enumerate() {
                let strategy = match (r == own, k) {
                    (true, 0) => ContactStrategy::Newton,
                    (true, _) => ContactStrategy::Restart,
                    _ => ContactStrategy::Stiffer,
                };
                let Some(start) = start.filter(|x| k != 1 || *x != first) else {
                    continue;
                };
                let found = self.attempt(strategy, r, start, 0)?;
                if found.is_some() || self.interrupted {
                    return Ok(found);
                }
            }
        }
        Ok(None)
    }

    /// Newton's method from where the ways down end.
    fn lowered(&mut self, lower: &mut Lower<'_>) -> Result<Option<Vec<f64>>, ContactError> {
        let paths = (0..PATHS).map(|trial| (ContactStrategy::Path, trial));
        for (strategy, trial) in std::iter::once((ContactStrategy::Increments, 0)).chain(paths) {
            let Some(end) = lower(strategy, trial, self.observe)? else {
                continue;
            };
            self.interrupted = end.interrupted;
            for factor in STIFFER {
                let r = factor * self.form.stiffness();
                let found = self.attempt(strategy, r, &end.x, end.points)?;
                if found.is_some() || self.interrupted {
                    return Ok(found);
                }
            }
        }
        Ok(None)
    }

    /// Newton's method from a start, booked.
    fn attempt(
        &mut self,
        strategy: ContactStrategy,
        r: f64,
        start: &[f64],
        path_points: usize,
    ) -> Result<Option<Vec<f64>>, ContactError> {
        let mut x = start.to_vec();
        let solved = if r == self.form.augmentation() {
            self.newton.solve(self.form, &mut x)
        } else {
            self.newton.solve(&self.form.under(self.form.law(), r), &mut x)
        };
        let report = self.newton.report();
        let mut attempt = ContactAttempt {
            strategy,
            r,
            path_points,
            iterations: report.history.len(),
            residual_norm: report.residual_norm(),
            failure: None,
        };
        let error = match solved {
            Ok(_) => {
                self.attempts.push(attempt);
                return Ok(Some(x));
            }
            Err(NewtonError::Map(e)) => return Err(e.into()),
            Err(error) => error,
        };
        if let NewtonError::Failed(unsolved) = &error {
            attempt.failure = Some(unsolved.reason);
            attempt.residual_norm = unsolved.residual_norm;
        }
        self.attempts.push(attempt);
        let norm = attempt.residual_norm;
        if self.best.as_ref().is_none_or(|(best, _)| norm < *best) {
            self.best = Some((norm, error));
        }
        let progress = ContactProgress {
            strategy,
            points: self.attempts.len(),
            level: 1.0,
        };
        self.interrupted |= (self.observe)(&progress).is_break();
        Ok(None)
    }
}
