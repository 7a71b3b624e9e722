//! Derivatives of the last state of a history of loading in parameters of all its levels.

use std::fmt;

use super::law::NodeLaw;
use super::{Contact, ContactChange, ContactError, ContactParameters, ContactSensitivity};
use crate::input::{check_length, check_vector};
use crate::interface::View;
use crate::piecewise::PiecewiseSmooth;
use crate::sensitivity::SensitivityError;

/// The states of a [history](super::evolve) as functions of parameters: made by [`Contact::history_sensitivity`].
///
/// A level depends on the one before by the tangential displacements from which its slips are measured. Derivatives go through the levels
/// forwards, gradients backwards, each with the factors of one level at a time: beside the states given, which are the checkpoints
/// (q + 1 numbers a level in condensed form, n + q + 1 in full form), memory does not grow with the number of levels.
///
/// ```
/// use std::ops::ControlFlow;
/// use semismooth::contact::{CondensedContact, ContactBody, EvolutionOptions, FrictionCoefficient, LoadPath, PlanarCoulomb, evolve};
/// use semismooth::sparse::Matrix;
/// // One node of stiffness 1, pressed by 1: pushed by 2, it slips by 2 − F; then it is pulled back to 0.
/// let [normal, tangential] = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]));
/// let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]);
/// let body = ContactBody::new(Matrix::identity(2), normal?, vec![tangential?], load)?;
/// let friction = FrictionCoefficient::constant(0.25)?;
/// let mut problem = CondensedContact::new(body, PlanarCoulomb::new(friction.clone()))?;
/// let mut states = vec![problem.solve(0.0, None)?];
/// let fresh = problem.clone();
/// let steps = evolve(&mut problem, &states[0], &[2.0, 0.0], &EvolutionOptions::default(), |_| ControlFlow::Continue(()))?;
/// states.extend(steps.into_iter().map(|step| step.x));
/// let law = PlanarCoulomb::new(friction.with_second(vec![1.0])?);
/// let one = fresh.parameters().with_law(law, &Matrix::identity(1))?;
/// let history = fresh.history_sensitivity(&states, &[one.clone(), one.clone(), one])?;
/// // Pulled back it slips again, to the position F: what friction holds.
/// assert!((history.jvp(&[1.0])?[2].displacements[1] - 1.0).abs() < 1e-12);
/// assert!((history.vjp(&[0.0, 1.0], &[0.0, 0.0])?[0] - 1.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct HistorySensitivity<V, L> {
    problem: Contact<V, L>,
    states: Vec<Vec<f64>>,
    parameters: Vec<ContactParameters>,
}

impl<V, L> fmt::Debug for HistorySensitivity<V, L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HistorySensitivity")
            .field("levels", &self.states.len())
            .finish_non_exhaustive()
    }
}

impl<V: View, L: NodeLaw + Clone + Send + Sync + 'static> Contact<V, L> {
    /// The states of a history as functions of parameters. This problem is as before the history: `states` are its start, a solution
    /// with the reference of slips that is set here, and the solutions at the ends of its levels, in turn
    /// ([`EvolutionStep::x`](super::EvolutionStep::x)); `parameters` is a list for each state, all of one length. Parameter j of all lists
    /// is one parameter, as the coefficient of friction; where it does not enter at some levels, as the load of one of them, its columns
    /// there are zeros.
    ///
    /// # Errors
    /// No states, states of another length; lists of another number or with other numbers of parameters; a law with history variables,
    /// whose rates laws do not tell.
    pub fn history_sensitivity(
        &self,
        states: &[Vec<f64>],
        parameters: &[ContactParameters],
    ) -> Result<HistorySensitivity<V, L>, ContactError> {
        if states.is_empty() {
            return Err(ContactError::Empty {
                what: "there are no states of the history",
            });
        }
        for x in states {
            check_vector("a state of the history", x, self.num_vars())?;
        }
        let lengths = [(states.len(), parameters.len())];
        let numbers = parameters.iter().map(|own| (parameters[0].len(), own.len()));
        for (expected, found) in lengths.into_iter().chain(numbers) {
            check_length(
                "the list of parameters of the levels, or one of them,",
                found,
                expected,
            )?;
        }
        let found = self.node_law().num_history();
        if found > 0 {
            return Err(ContactError::Law {
                what: "history variables",
                found,
                least: 0,
                most: 0,
            });
        }
        Ok(HistorySensitivity {
            problem: self.clone(),
            states: states.to_vec(),
            parameters: parameters.to_vec(),
        })
    }
}

impl<V: View, L: NodeLaw + Clone + Send + Sync + 'static> HistorySensitivity<V, L> {
    /// Number of states, the start included.
    #[must_use]
    pub fn num_states(&self) -> usize {
        self.states.len()
    }

    /// Number of parameters.
    #[must_use]
    pub fn num_parameters(&self) -> usize {
        self.parameters[0].len()
    }

    /// Whether the last state is a differentiable function of the parameters: `Some(true)` where the states of all levels are
    /// differentiable in the parameters and in the state before. `None` where that is not known of some level: what is not differentiable
    /// there may be so in the end.
    ///
    /// # Errors
    /// As [`jvp`](Self::jvp).
    pub fn differentiable(&self) -> Result<Option<bool>, ContactError> {
        for level in 0..self.states.len() {
            if self.level(level)?.differentiable()?.known() != Some(true) {
                return Ok(None);
            }
        }
        Ok(Some(true))
    }

    /// The changes of all states along a change δ of the parameters: directional derivatives, at kinks one-sided.
    ///
    /// # Errors
    /// A wrong length, values that are not finite; states that are no solutions, irregular ones, and those of
    /// [`ContactSensitivity::jvp`], of the first level that has one.
    pub fn jvp(&self, delta: &[f64]) -> Result<Vec<ContactChange>, ContactError> {
        let checked = check_vector("the change of the parameters", delta, self.num_parameters());
        checked.map_err(SensitivityError::from)?;
        let mut changes = Vec::with_capacity(self.states.len());
        let mut before = vec![0.0; self.num_references()];
        for level in 0..self.states.len() {
            let all: Vec<f64> = delta.iter().chain(&before).copied().collect();
            let change = self.level(level)?.jvp(&all)?;
            before = self.references(&change);
            changes.push(change);
        }
        Ok(changes)
    }

    /// The gradient in the parameters of a function of the last state, from its gradients in the displacements and in the contact forces.
    ///
    /// # Errors
    /// As [`jvp`](Self::jvp); [`SensitivityError::NotDifferentiable`] where a level is not known to be differentiable: elements of the
    /// generalised derivatives of levels do not combine to one of the history.
    pub fn vjp(&self, displacements: &[f64], forces: &[f64]) -> Result<Vec<f64>, ContactError> {
        let (mut of_u, mut of_forces) = (displacements.to_vec(), forces.to_vec());
        let k = self.num_parameters();
        let mut gradient = vec![0.0; k];
        for level in (0..self.states.len()).rev() {
            let mut own = self.level(level)?;
            if own.differentiable()?.known() != Some(true) {
                return Err(SensitivityError::NotDifferentiable.into());
            }
            let all = own.vjp(&of_u, &of_forces)?;
            gradient.iter_mut().zip(&all).for_each(|(g, own)| *g += own);
            (of_u, of_forces) = self.pulled(&all[k..]);
        }
        Ok(gradient)
    }

    /// A level with the references of its slips as further parameters.
    fn level(&self, level: usize) -> Result<ContactSensitivity<V>, ContactError> {
        let mut problem = self.problem.clone();
        if level > 0 {
            let traces = problem.traces(&self.states[level - 1])?;
            let reference = problem.tangential(&traces).to_vec();
            problem.set_reference_slip(&reference)?;
        }
        let parameters = self.parameters[level].with_references();
        problem.sensitivity(&self.states[level], &parameters)
    }

    fn num_references(&self) -> usize {
        self.problem.law().own_traces() - self.problem.num_contacts()
    }

    /// Changes of the tangential traces.
    fn references(&self, change: &ContactChange) -> Vec<f64> {
        let (n, p) = (self.problem.num_displacements(), self.problem.num_contacts());
        let mut traces = vec![0.0; self.problem.num_traces()];
        let operator = &self.problem.operator;
        (operator.b_t.as_ref().as_ref()).mul_transpose_add(1.0, &change.displacements[..n], &mut traces);
        for ((trace, d), force) in traces.iter_mut().zip(&operator.yielding).zip(&change.forces) {
            *trace -= d * force;
        }
        traces.truncate(p + self.num_references());
        traces.split_off(p)
    }

    /// The gradients in a state of a function of its tangential traces.
    fn pulled(&self, references: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (n, p) = (self.problem.num_displacements(), self.problem.num_contacts());
        let mut traces = vec![0.0; self.problem.num_traces()];
        traces[p..p + references.len()].copy_from_slice(references);
        let operator = &self.problem.operator;
        let mut displacements = vec![0.0; n];
        (operator.b_t.as_ref().as_ref()).mul_add(1.0, &traces, &mut displacements);
        let mut forces = vec![0.0; p + references.len()];
        for ((force, d), trace) in forces.iter_mut().zip(&operator.yielding).zip(&traces) {
            *force -= d * trace;
        }
        (displacements, forces)
    }
}
