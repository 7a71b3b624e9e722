//! Solutions of contact problems at fixed parameter.

use std::ops::ControlFlow;

use super::lowering::lower;
use super::reduced::ReducedNewton;
use super::strategy;
use super::tries::{Observer, newton_step};
use crate::contact::law::{LocalValues, NodeLaw};
use crate::contact::tolerances::CONDENSED;
use crate::contact::{
    CondensedContact, Contact, ContactError, ContactOptions, ContactProgress, ContactReport, ContactState,
    FullContact,
};
use crate::input::{check_finite, check_length};
use crate::interface::View;
use crate::newton::Newton;

impl<'a, V: View> Contact<V, &'a dyn NodeLaw> {
    /// The condensed form under the load at α.
    pub(super) fn condensed_at(&self, alpha: f64) -> Result<CondensedContact<&'a dyn NodeLaw>, ContactError> {
        let load = self.operator.load.frozen(&[alpha], self.num_displacements());
        let mut condensed = CondensedContact::of_supported(self.body().under(load)?, self.law.law)?;
        condensed.law.reference.clone_from(&self.law.reference);
        condensed.law.history.clone_from(&self.law.history);
        Ok(condensed)
    }
}

impl<V: View> Contact<V, &dyn NodeLaw> {
    /// The solution of the full form of a body on anchors, which knows more ways, or why there is none.
    fn solve_released(
        &self,
        alpha: f64,
        start: Option<&[f64]>,
        options: &ContactOptions,
        observe: &mut Observer<'_>,
    ) -> Result<ContactReport, ContactError> {
        let (body, q) = (self.body().released(), self.law.own_traces());
        let mut full = FullContact::new(body, self.law.law)?;
        full.law.reference.clone_from(&self.law.reference);
        full.law.history.clone_from(&self.law.history);
        let start = match start {
            Some(x) => Some([&self.displacements(x)?, &x[..q], &[alpha]].concat()),
            None => None,
        };
        let quick = &mut ReducedNewton::default();
        let found = full.solve_again(alpha, start.as_deref(), options, quick, observe)?;
        let u = full.displacements(&found.x)?;
        let x = self.body().point_of(&u, &found.x[u.len()..u.len() + q], alpha);
        Ok(ContactReport { x, ..found })
    }
}

impl<V: View, L: NodeLaw> Contact<V, L> {
    /// One Newton step from zero with the given states: the solution of the linear problem, where the law is affine in these states.
    ///
    /// # Errors
    /// A singular problem.
    pub fn start_with(&self, alpha: f64, states: &[ContactState]) -> Result<Vec<f64>, ContactError> {
        check_finite("the parameter", &[alpha])?;
        check_length("the list of states", states.len(), self.num_contacts())?;
        let step = newton_step(self, &self.selection_of(states), self.zero(alpha))?;
        step.ok_or(ContactError::SingularStart { parameter: alpha })
    }

    /// The start with all contact nodes sticking: the forces that keep them at u_ν = gap without slip.
    ///
    /// # Errors
    /// As [`start_with`](Self::start_with).
    pub fn stick_start(&self, alpha: f64) -> Result<Vec<f64>, ContactError> {
        self.start_with(alpha, &vec![ContactState::Stick; self.num_contacts()])
    }

    /// A solution at fixed α by PS-Newton from the linear problem with the given states (open nodes may have any coefficient of friction);
    /// where that fails, as by [`solve`](Self::solve) without a start.
    ///
    /// # Errors
    /// [`ContactError::NegativeFriction`] where F(α) < 0 at a node that is not to be open; those of [`solve`](Self::solve); another number
    /// of states than of nodes.
    pub fn solve_from_states(&self, alpha: f64, states: &[ContactState]) -> Result<Vec<f64>, ContactError> {
        let start = match self.start_with(alpha, states) {
            Err(ContactError::SingularStart { .. }) => return self.solve(alpha, None),
            start => start?,
        };
        let closed = |v: &LocalValues| states[v.node] != ContactState::Open;
        for v in self.nodes(&self.zero(alpha)).iter().filter(|v| closed(v)) {
            self.law.law.check(v)?;
        }
        let mut x = start;
        match Newton::default().solve(self, &mut x) {
            Ok(_) => Ok(x),
            Err(_) => self.solve(alpha, None),
        }
    }

    /// A solution at fixed α: by PS-Newton from `start` (α is set; zero if there is none) and, where that fails, by the other
    /// strategies of [`ContactStrategy`](crate::contact::ContactStrategy).
    ///
    /// A body that is supported without contact has a solution under every law of this crate whose coefficients are continuous and
    /// bounded; it need not be unique.
    ///
    /// # Complexity
    /// In condensed form a step of Newton's method costs O(q² + k³) operations, where k ≤ q counts the unknowns left after elimination at
    /// each node (none at open nodes, one at nodes that slip in the plane); in full form one sparse factorisation. The number of steps
    /// hardly grows with the mesh; a lowering, where it is needed, takes as many as there are transitions on its path.
    ///
    /// # Errors
    /// Coefficients of friction that are negative or not finite; [`ContactError::NoStart`], with the best iterate and its history, when no
    /// strategy finds a solution; of bodies without supports [`ContactError::Unbalanced`] where the reason is that the load moves the body in
    /// a direction that neither stiffness nor contact resists.
    pub fn solve(&self, alpha: f64, start: Option<&[f64]>) -> Result<Vec<f64>, ContactError> {
        Ok(self.solve_reported(alpha, start)?.x)
    }

    /// [`solve`](Self::solve) with a report of all attempts.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_reported(&self, alpha: f64, start: Option<&[f64]>) -> Result<ContactReport, ContactError> {
        self.solve_observed(alpha, start, &ContactOptions::default(), |_| {
            ControlFlow::Continue(())
        })
    }

    /// [`solve_reported`](Self::solve_reported) with options; `observe` is called at each iteration of Newton's method, each attempt and
    /// each point of a path, and may stop the search.
    ///
    /// # Errors
    /// As [`solve`](Self::solve), and options out of range; a search stopped by `observe` or by `max_time` is a
    /// [`ContactError::NoStart`] with [`Status::Interrupted`](crate::run::Status::Interrupted) or
    /// [`TimeLimit`](crate::run::Status::TimeLimit).
    pub fn solve_observed(
        &self,
        alpha: f64,
        start: Option<&[f64]>,
        options: &ContactOptions,
        mut observe: impl FnMut(&ContactProgress) -> ControlFlow<()>,
    ) -> Result<ContactReport, ContactError> {
        self.solve_again(alpha, start, options, &mut ReducedNewton::default(), &mut observe)
    }

    /// [`solve_observed`](Self::solve_observed) with the factorisation of an earlier solve of this body.
    pub(in crate::contact) fn solve_again(
        &self,
        alpha: f64,
        start: Option<&[f64]>,
        options: &ContactOptions,
        quick: &mut ReducedNewton,
        observe: &mut Observer<'_>,
    ) -> Result<ContactReport, ContactError> {
        // The search is compiled once for all laws.
        let own: Contact<V, &dyn NodeLaw> = self.borrowed();
        let mut condensed = None;
        let floats = !own.body().anchors().is_empty();
        let mut descend = |lowering, see: &mut Observer<'_>| {
            // Without supports there is no solution far above the foundation.
            if floats {
                return Ok(None);
            }
            // The lowering is computed in condensed form where the body can be condensed.
            if own.view.reduced().is_none() && own.num_traces() <= CONDENSED {
                let condensed = condensed.get_or_insert_with(|| own.condensed_at(alpha).ok());
                if let Some(condensed) = &*condensed {
                    let mut end = lower(condensed, alpha, lowering, options, see)?;
                    if let Some(end) = &mut end {
                        end.x = condensed.expand(&end.x)?;
                    }
                    return Ok(end);
                }
            }
            lower(&own, alpha, lowering, options, see)
        };
        let found = strategy::solve(&own, alpha, start, options, quick, &mut descend, observe);
        match found {
            // A body that is supported without contact is always in balance.
            Err(e @ ContactError::NoStart { .. })
                if (floats || own.view.reduced().is_none()) && !e.is_stopped() =>
            {
                match own.unbalanced(alpha) {
                    Some(reason) => Err(reason),
                    None if floats && !e.is_interrupted() => {
                        own.solve_released(alpha, start, options, observe)
                    }
                    None => Err(e),
                }
            }
            found => found,
        }
    }

    /// The same problem with its law borrowed.
    fn borrowed(&self) -> Contact<V, &dyn NodeLaw> {
        let law: &dyn NodeLaw = &self.law.law;
        let mut own = self.under(law);
        own.law.history.clone_from(&self.law.history);
        own
    }
}
