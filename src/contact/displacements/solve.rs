//! The solve of one problem in the displacements alone: its data, its errors, and the agreement of all processes.

use std::ops::ControlFlow;

use thiserror::Error;

use super::newton::{Best, ReducedSearch};
use super::system::ReducedSystem;
use super::{ReducedOptions, ReducedProgress, ReducedReport};
use crate::InputError;
use crate::contact::law::{LocalValues, NodeLaw};
use crate::contact::{ContactError, ContactStrategy};
use crate::input::check_length;
use crate::run::Status;

/// What can go wrong in [`solve_reduced`].
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ReducedError<E> {
    /// An error in the problem, or no solution found.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// An error in the linear system.
    #[error("the linear system of a Newton step failed")]
    System {
        /// What went wrong.
        source: E,
        /// The best iterate before; residuals are infinite where only the start was available.
        best: Box<ReducedReport>,
    },
}

/// Called with the progress of a solve, which it may stop.
pub type ReducedObserver<'a> = dyn FnMut(&ReducedProgress) -> ControlFlow<()> + Send + 'a;

/// Reasons that end a search.
pub(super) enum Stop<E> {
    Contact(ContactError),
    /// A node, and the piece that does not determine its forces.
    Law(usize, String),
    Elsewhere,
    System(E),
}

pub(super) type Outcome<T, E> = Result<T, Stop<E>>;

impl<E> Stop<E> {
    /// In words for all solvers. Another process knows why it ends the search, or nothing was begun.
    pub(super) const fn status(&self) -> Status {
        match self {
            Self::Law(..) => Status::Singular,
            Self::System(_) => Status::Inaccurate,
            Self::Contact(_) | Self::Elsewhere => Status::Stalled,
        }
    }

    pub(super) fn with(self, best: ReducedReport) -> ReducedError<E> {
        let best = Box::new(best);
        match self {
            Self::Contact(e) => e.into(),
            Self::Law(node, piece) => ContactError::NotReducible { node, piece, best }.into(),
            Self::Elsewhere => ContactError::Elsewhere { best }.into(),
            Self::System(source) => ReducedError::System { source, best },
        }
    }
}

/// The contact nodes of this process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReducedNodes<'a> {
    /// The component along ν of each contact node; those along t₁[, t₂] follow it.
    pub components: &'a [usize],
    /// Global number of the first node of this process, which the law receives.
    pub first: usize,
    /// Initial gaps.
    pub gap: &'a [f64],
    /// Tangential displacements from which slips are measured, all along t₁, then t₂; empty: zeros.
    pub reference: &'a [f64],
    /// History variables, node by node.
    pub history: &'a [f64],
    /// The augmentation parameter.
    pub r: f64,
    /// α.
    pub parameter: f64,
}

impl ReducedNodes<'_> {
    /// The gap and the reference of the slips of node i.
    pub(super) fn offsets(&self, i: usize) -> [f64; 3] {
        let p = self.components.len();
        let rest = |d: usize| self.reference.get(d * p + i).copied().unwrap_or(0.0);
        [self.gap[i], rest(0), rest(1)]
    }

    /// The values that the law receives at node i of this process, from the displacements u and the contact forces `force`, both by
    /// component.
    pub(super) fn values(
        &self,
        law: &dyn NodeLaw,
        i: usize,
        u: &[f64],
        force: impl Fn(usize) -> f64,
    ) -> LocalValues {
        let (at, p) = (self.components[i], self.components.len());
        let mut v = LocalValues {
            node: self.first + i,
            penetration: u[at] - self.gap[i],
            pressure: force(at),
            parameter: self.parameter,
            r: self.r,
            ..LocalValues::default()
        };
        for d in 0..law.num_tangents() {
            let rest = self.reference.get(d * p + i).copied().unwrap_or(0.0);
            v.slip[d] = u[at + 1 + d] - rest;
            v.traction[d] = force(at + 1 + d);
        }
        let h = law.num_history();
        v.history[..h].copy_from_slice(&self.history[i * h..(i + 1) * h]);
        v
    }
}

/// Solves A u + Bᵀ λ = f with a law at each contact node by Newton's method in u alone, from the u given, and by load steps where that
/// fails; `load` and `u` hold all components of this process.
///
/// Each step solves the law at each node for its forces or prescribes its displacements; this leaves A with few rows changed, solved to a
/// loose tolerance as long as nodes change their piece, then to the tolerance of Eisenstat and Walker (SIAM J. Sci. Comput. 17 (1996),
/// choice 2). Full steps are taken as long as the residual falls; where it does not, steps are damped. Forces of the report are those of
/// this process, and so are its displacements: all components. An error in one process ends the solve in all of them, and so does the time
/// limit of one.
///
/// # Errors
/// Wrong lengths; all others with the best iterate and the history: those of the system, [`ContactError::NotReducible`] for laws that
/// cannot be eliminated, [`ContactError::NotConverged`], also at the limit on time, and [`ContactError::Elsewhere`] where another process found an error.
pub fn solve_reduced<S: ReducedSystem>(
    system: &mut S,
    nodes: &ReducedNodes<'_>,
    law: &dyn NodeLaw,
    load: &[f64],
    u: Vec<f64>,
    options: &ReducedOptions,
) -> Result<ReducedReport, ReducedError<S::Error>> {
    let observe = &mut |_: &ReducedProgress| ControlFlow::Continue(());
    solve_reduced_observed(system, nodes, law, load, u, options, observe)
}

/// [`solve_reduced`], calling `observe` before each Newton step and, where the system supports it, before each iteration of its linear
/// solves; it may stop. A stop in one process ends the solve in all of them.
///
/// # Errors
/// Those of [`solve_reduced`]; [`ContactError::NotConverged`] with the best iterate where the observer has stopped.
pub fn solve_reduced_observed<S: ReducedSystem>(
    system: &mut S,
    nodes: &ReducedNodes<'_>,
    law: &dyn NodeLaw,
    load: &[f64],
    u: Vec<f64>,
    options: &ReducedOptions,
    observe: &mut ReducedObserver<'_>,
) -> Result<ReducedReport, ReducedError<S::Error>> {
    let checked = check(system.len(), nodes, law, load, &u, options);
    let is_contact = match agreed(system, checked) {
        Ok(is_contact) => is_contact,
        Err(stop) => {
            let start = Best::start(u, nodes, law).report(ContactStrategy::Newton, stop.status());
            return Err(stop.with(start));
        }
    };
    ReducedSearch::new(system, nodes, law, (load, u), is_contact, options, observe).run()
}

/// Whether each component belongs to a contact node.
fn check(
    len: usize,
    nodes: &ReducedNodes<'_>,
    law: &dyn NodeLaw,
    load: &[f64],
    u: &[f64],
    options: &ReducedOptions,
) -> Result<Vec<bool>, ContactError> {
    options.validate()?;
    for (what, found, expected) in [
        ("the load", load.len(), len),
        ("the start", u.len(), len),
        ("the gap", nodes.gap.len(), nodes.components.len()),
        (
            "the list of history variables",
            nodes.history.len(),
            law.num_history() * nodes.components.len(),
        ),
    ] {
        check_length(what, found, expected)?;
    }
    let mut is_contact = vec![false; len];
    for c in nodes.components {
        let Some(own) = is_contact.get_mut(*c..c.saturating_add(1 + law.num_tangents())) else {
            return Err(ContactError::Input(InputError::Length {
                what: "the list of components",
                expected: c.saturating_add(1 + law.num_tangents()),
                found: len,
            }));
        };
        own.fill(true);
    }
    Ok(is_contact)
}

/// The result of this process, unless some process has found an error.
pub(super) fn agreed<S: ReducedSystem, T>(system: &S, own: Result<T, ContactError>) -> Outcome<T, S::Error> {
    let mut failed = [f64::from(u8::from(own.is_err()))];
    system.max(&mut failed).map_err(Stop::System)?;
    match own {
        Ok(_) if failed[0] > 0.0 => Err(Stop::Elsewhere),
        own => own.map_err(Stop::Contact),
    }
}
