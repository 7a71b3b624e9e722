//! What is tried in turn to solve a contact problem at fixed α.

use std::collections::VecDeque;

use super::attempts::{ContactAttempt, ContactReport, ContactStrategy};
use super::lowering::{Lowering, LoweringEnd};
use super::reduced::ReducedNewton;
use super::tries::{Observer, Tries, timed};
use crate::clock::Deadline;
use crate::contact::law::{LocalValues, NodeLaw};
use crate::contact::tolerances::CONDENSED;
use crate::contact::{Contact, ContactError, ContactOptions};
use crate::input::{check_finite, check_vector};
use crate::interface::View;
use crate::piecewise::PiecewiseSmooth;

/// Augmentation parameters tried after the prescribed one, in units of the stiffness of a contact node.
const STIFFER: [f64; 3] = [1.0, 10.0, 1e3];

/// Bodies on springs that are tried, each on those that the one before has moved along: what they pull at falls by orders of magnitude.
const ROUNDS: usize = 8;

/// Points of a path until paths with other orders of touching nodes have been tried.
const SHORT: usize = 250;

/// Runs the strategies from `start` (α is set); `lower` lowers the body.
pub(in crate::contact) fn solve<V: View>(
    form: &Contact<V, &dyn NodeLaw>,
    alpha: f64,
    start: Option<&[f64]>,
    options: &ContactOptions,
    quick: &mut ReducedNewton,
    lower: &mut Lower<'_>,
    observe: &mut Observer<'_>,
) -> Result<ContactReport, ContactError> {
    options.validate()?;
    check_finite("the parameter", &[alpha])?;
    let zero = form.zero(alpha);
    for v in form.nodes(&zero) {
        form.node_law().check(&LocalValues { slip: [0.0; 2], ..v })?;
    }
    let mut first = zero.clone();
    if let Some(x) = start {
        check_vector("the start", x, zero.len())?;
        first.copy_from_slice(x);
        first[form.num_residuals()] = alpha;
    }
    let deadline = Deadline::after(options.max_time);
    let mut observe = timed(deadline, observe);
    let mut search = ContactSearch {
        form,
        options,
        tries: Tries::new(options, &mut observe),
        attempts: Vec::new(),
        deadline,
    };
    let found = search.newton_starts(alpha, &first, &zero, quick)?;
    let found = match found {
        None if !search.tries.interrupted => search.lowered(lower)?,
        found => found,
    };
    let found = match found {
        None if !search.tries.interrupted => search.on_springs(alpha)?,
        found => found,
    };
    match found {
        Some(x) => Ok(ContactReport {
            x,
            attempts: search.attempts,
        }),
        None => Err(search.tries.no_start(alpha, deadline.is_over())),
    }
}

/// Lowers the body by one homotopy.
pub(in crate::contact) type Lower<'a> =
    dyn FnMut(Lowering, &mut Observer<'_>) -> Result<Option<LoweringEnd>, ContactError> + 'a;

struct ContactSearch<'a, 'o, V> {
    form: &'a Contact<V, &'a dyn NodeLaw>,
    options: &'a ContactOptions,
    tries: Tries<'a, 'o>,
    attempts: Vec<ContactAttempt>,
    deadline: Deadline<'static>,
}

impl<V: View> ContactSearch<'_, '_, V> {
    /// Newton's method from `first`, zero and stick, with several augmentation parameters.
    fn newton_starts(
        &mut self,
        alpha: f64,
        first: &[f64],
        zero: &[f64],
        reduced: &mut ReducedNewton,
    ) -> Result<Option<Vec<f64>>, ContactError> {
        let own = self.form.r();
        // Fast where it works: the general Newton method then only verifies its result.
        let mut quick = first.to_vec();
        let mut look = || self.tries.look(ContactStrategy::Newton);
        let ready = reduced.run(
            self.form,
            &mut quick,
            self.options.newton.max_iterations,
            &mut look,
        );
        if ready || self.tries.interrupted {
            let found = self.attempt(ContactStrategy::Newton, own, &quick, 0)?;
            if found.is_some() || self.tries.interrupted {
                return Ok(found);
            }
        }
        let stick = self.form.stick_start(alpha).ok();
        let others = STIFFER.map(|f| f * self.form.law().stiffness);
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
                if found.is_some() || self.tries.interrupted {
                    return Ok(found);
                }
            }
        }
        Ok(None)
    }

    /// Newton's method from the ends of the homotopies.
    fn lowered(&mut self, lower: &mut Lower<'_>) -> Result<Option<Vec<f64>>, ContactError> {
        let most = self.options.max_points;
        let increments = (self.options.max_increments > 0).then_some(Lowering {
            strategy: ContactStrategy::Increments,
            trial: 0,
            points: most,
            left: None,
        });
        // Where one path is long, that of another order of touching nodes may be short: none is followed far before all have been tried.
        let paths = (0..self.options.max_paths).map(|trial| Lowering {
            strategy: ContactStrategy::Path,
            trial,
            points: SHORT.min(most),
            left: None,
        });
        let mut lowerings = increments.into_iter().chain(paths);
        let mut cut_off = VecDeque::new();
        while let Some(lowering) = lowerings.next().or_else(|| cut_off.pop_front()) {
            let left = self.deadline.left();
            let Some(end) = lower(Lowering { left, ..lowering }, self.tries.observer())? else {
                continue;
            };
            if end.interrupted {
                self.tries.interrupted = true;
                return Ok(None);
            }
            for factor in STIFFER {
                let r = factor * self.form.law().stiffness;
                let found = self.attempt(lowering.strategy, r, &end.x, end.points)?;
                if found.is_some() || self.tries.interrupted {
                    return Ok(found);
                }
            }
            if lowering.strategy == ContactStrategy::Path
                && end.points >= lowering.points
                && lowering.points < most
            {
                cut_off.push_back(Lowering {
                    points: most,
                    ..lowering
                });
            }
        }
        Ok(None)
    }

    /// Newton's method from the body on soft springs, where contact alone holds it.
    fn on_springs(&mut self, alpha: f64) -> Result<Option<Vec<f64>>, ContactError> {
        let form = self.form;
        let floats = form.view.reduced().is_none()
            && form.num_traces() <= CONDENSED
            && form.condensed_at(alpha).is_err()
            && form.unbalanced(alpha).is_none();
        if !floats {
            return Ok(None);
        }
        let mut on = form.on_springs(alpha)?;
        for _ in 0..ROUNDS {
            let options = ContactOptions {
                max_time: self.deadline.left(),
                ..self.options.clone()
            };
            let Ok(start) = form.next_on(&mut on, alpha, &options, self.tries.observer()) else {
                return Ok(None);
            };
            let found = self.attempt(ContactStrategy::Restart, form.r(), &start, 0)?;
            if found.is_some() || self.tries.interrupted {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// Newton's method from a start, recorded in the report.
    fn attempt(
        &mut self,
        strategy: ContactStrategy,
        r: f64,
        start: &[f64],
        path_points: usize,
    ) -> Result<Option<Vec<f64>>, ContactError> {
        let mut x = start.to_vec();
        let own = self.form.law().scale;
        let mut outcome = if r == self.form.r() {
            self.tries.run(self.form, &mut x, strategy)?
        } else {
            self.tries.run(&self.form.at_r(r), &mut x, strategy)?
        };
        if outcome.solved && r != own {
            // With r far from the stiffness, a residual of rounding size may be no solution: the residual is checked in the scale of the
            // problem.
            let checked = self.tries.run(&self.form.at_r(own), &mut x, strategy)?;
            if !checked.solved {
                outcome = checked;
            }
        }
        // Newton's method judges rows by what it sees of their terms: displacements of the body that cancel in gaps and forces are no part
        // of that.
        if !outcome.solved && !self.tries.interrupted && self.form.is_rounding(&x) {
            (outcome.solved, outcome.failure) = (true, None);
        }
        self.attempts.push(ContactAttempt {
            strategy,
            r,
            path_points,
            iterations: outcome.iterations,
            residual_norm: outcome.residual_norm,
            failure: outcome.failure,
        });
        Ok(outcome.solved.then_some(x))
    }
}
