//! Newton's method from several starts in turn.

use std::ops::ControlFlow;

use crate::clock::Deadline;
use crate::contact::{ContactError, ContactOptions, ContactProgress, ContactStrategy};
use crate::linear::{AutoSolver, LinearSolver};
use crate::newton::{Newton, NewtonError};
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::run::Status;
use crate::sparse::Matrix;

pub(in crate::contact) type Observer<'a> = dyn FnMut(&ContactProgress) -> ControlFlow<()> + 'a;

/// Runs of Newton's method; of the failed ones that with the smallest residual is kept.
pub(in crate::contact) struct Tries<'a, 'o> {
    newton: Newton,
    observe: &'a mut Observer<'o>,
    count: usize,
    /// The failure with the smallest residual.
    best: Option<(f64, NewtonError)>,
    /// Stopped by the observer, or out of time.
    pub(in crate::contact) interrupted: bool,
}

/// The result of a run.
pub(in crate::contact) struct Outcome {
    pub(in crate::contact) solved: bool,
    pub(in crate::contact) iterations: usize,
    pub(in crate::contact) residual_norm: f64,
    /// `None` for a solution, and where the linear solver failed.
    pub(in crate::contact) failure: Option<Status>,
}

impl<'a, 'o> Tries<'a, 'o> {
    /// `observe` must check the deadline itself.
    pub(in crate::contact) fn new(options: &ContactOptions, observe: &'a mut Observer<'o>) -> Self {
        Self {
            newton: Newton::new(options.newton.clone()),
            observe,
            count: 0,
            best: None,
            interrupted: false,
        }
    }

    pub(in crate::contact) fn observer(&mut self) -> &mut Observer<'o> {
        self.observe
    }

    /// Calls the observer during an attempt.
    pub(in crate::contact) fn look(&mut self, strategy: ContactStrategy) -> ControlFlow<()> {
        let flow = (self.observe)(&progress(strategy, self.count));
        self.interrupted |= flow.is_break();
        flow
    }

    /// Newton's method from x.
    pub(in crate::contact) fn run(
        &mut self,
        map: &dyn PiecewiseSmooth,
        x: &mut [f64],
        strategy: ContactStrategy,
    ) -> Result<Outcome, ContactError> {
        let Self {
            newton,
            observe,
            count,
            interrupted,
            ..
        } = self;
        let now = progress(strategy, *count);
        let solved = newton.solve_observed(map, x, |_| {
            *interrupted = *interrupted || observe(&now).is_break();
            match *interrupted {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        *count += 1;
        let report = newton.report();
        let mut outcome = Outcome {
            solved: solved.is_ok(),
            iterations: report.history.len(),
            residual_norm: report.residual_norm(),
            failure: None,
        };
        let error = match solved {
            Ok(_) => return Ok(outcome),
            Err(NewtonError::Map(e)) => return Err(e.into()),
            Err(error) => error,
        };
        if let NewtonError::Failed(unsolved) = &error {
            outcome.failure = Some(unsolved.status);
            outcome.residual_norm = unsolved.residual_norm;
        }
        let norm = outcome.residual_norm;
        if self
            .best
            .as_ref()
            .is_none_or(|(best, _)| norm.total_cmp(best).is_lt())
        {
            self.best = Some((norm, error));
        }
        if !self.interrupted {
            let _ = self.look(strategy);
        }
        Ok(outcome)
    }

    /// The error when all attempts have failed, or were stopped: by the deadline if it is `late`.
    pub(in crate::contact) fn no_start(self, parameter: f64, late: bool) -> ContactError {
        let Some((_, mut source)) = self.best else {
            return ContactError::Empty {
                what: "no start was tried",
            };
        };
        if let NewtonError::Failed(unsolved) = &mut source
            && self.interrupted
        {
            unsolved.status = if late {
                Status::TimeLimit
            } else {
                Status::Interrupted
            };
        }
        ContactError::NoStart {
            parameter,
            source: Box::new(source),
        }
    }
}

/// Progress after so many attempts.
fn progress(strategy: ContactStrategy, points: usize) -> ContactProgress {
    ContactProgress {
        strategy,
        points,
        level: 1.0,
    }
}

/// The observer, which also stops at the deadline.
pub(in crate::contact) fn timed<'a>(
    deadline: Deadline<'static>,
    observe: &'a mut Observer<'_>,
) -> impl FnMut(&ContactProgress) -> ControlFlow<()> + 'a {
    move |progress| match observe(progress) {
        ControlFlow::Continue(()) => deadline.flow(),
        stop => stop,
    }
}

/// One Newton step of a selection from x, `None` where its Jacobian is singular.
pub(in crate::contact) fn newton_step(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    mut x: Vec<f64>,
) -> Result<Option<Vec<f64>>, ContactError> {
    let n = map.num_residuals();
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(selection, &x, &mut jac);
    let mut r = vec![0.0; n];
    map.residual(selection, &x, &mut r);
    let mut solver = AutoSolver::default();
    solver.analyze(jac.leading_columns(n).pattern)?;
    if solver.factor(jac.leading_columns(n)).is_err() || solver.solve_in_place(&mut r).is_err() {
        return Ok(None);
    }
    for (x, d) in x.iter_mut().zip(&r) {
        *x -= d;
    }
    Ok(Some(x))
}
