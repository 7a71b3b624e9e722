//! Displacements, forces and energies of the whole body at a solution.

use super::law::NodeLaw;
use super::rounding::blurred_load;
use super::solution::{imbalance, judge};
use super::{Contact, ContactError, ContactSolution};
use crate::input::check_vector;
use crate::interface::{SupportState, View};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::{Matrix, dot};

impl<V: View, L: NodeLaw> Contact<V, L> {
    /// States, local quantities, energies and residuals at x.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError> {
        check_vector("the solution x", x, self.num_vars())?;
        let state = BodyState::at(self, x)?;
        let mut reaction = vec![0.0; state.u.len()];
        let forces = &x[self.leading()..self.num_residuals()];
        Matrix::as_ref(&self.operator.b_t).mul_add(1.0, forces, &mut reaction);
        let cases = self
            .operator
            .load
            .terms(&x[self.num_residuals()..], state.u.len());
        let mut solution = ContactSolution::assemble(
            self.nodes_in_own_scale(x),
            |v| judge(&self.law.law, v),
            |i| offsets(&self.law.body.gap, &self.law.reference, i),
            (
                state.stored(),
                state.load_energy(),
                imbalance(&state.stiff, &reaction, &state.load, &cases),
            ),
            blurred_load(&state.load, &cases),
        );
        solution.nodes.iter_mut().for_each(|v| v.r = self.law.r);
        Ok(solution)
    }
}

/// u_ν − penetration and u_t − slip of node i.
pub(super) fn offsets(gap: &[f64], reference: &[f64], i: usize) -> [f64; 3] {
    let p = gap.len();
    let at = |d: usize| reference.get(d * p + i).copied().unwrap_or(0.0);
    [gap[i], at(0), at(1)]
}

/// Displacements of the whole body at a solution, and the forces on it.
pub(super) struct BodyState {
    pub(super) u: Vec<f64>,
    stiff: Vec<f64>,
    /// All forces on u.
    load: Vec<f64>,
    supports: SupportState,
    /// The energy of springs at contact nodes.
    springs: f64,
}

impl BodyState {
    pub(super) fn at<V: View, L: NodeLaw>(problem: &Contact<V, L>, x: &[f64]) -> Result<Self, ContactError> {
        let u = problem.displacements(x)?;
        let parameters = &x[problem.num_residuals()..];
        let mut stiff = vec![0.0; u.len()];
        problem.operator.a.mul_vec(&u, &mut stiff);
        let load = problem.operator.load_at(parameters);
        let forces = &x[problem.leading()..problem.num_residuals()];
        let springs = problem.operator.yielding.iter().zip(forces);
        Ok(Self {
            springs: springs.map(|(d, l)| 0.5 * d * l * l).sum(),
            ..Self::of(u, stiff, load, problem.operator.load.support_state(parameters))
        })
    }

    /// From displacements u, A u, all forces on u, and the contribution of the supports.
    pub(super) fn of(u: Vec<f64>, stiff: Vec<f64>, load: Vec<f64>, supports: SupportState) -> Self {
        Self {
            u,
            stiff,
            load,
            supports,
            springs: 0.0,
        }
    }

    /// A u − f.
    pub(super) fn imbalances(&self) -> Vec<f64> {
        let rows = self.stiff.iter().zip(&self.load);
        rows.map(|(a, f)| a - f).collect()
    }

    /// The elastic energy of the whole body, supports and springs of contact nodes included.
    pub(super) fn stored(&self) -> f64 {
        let supports = 0.5 * self.supports.pairing(&self.supports) - self.supports.force_work(&self.u);
        0.5 * dot(&self.u, &self.stiff) + supports + self.springs
    }

    /// Applied forces times displacements, and reactions times those of the supports.
    pub(super) fn load_energy(&self) -> f64 {
        self.work_on(self)
    }

    /// Forces and reactions of this state times the displacements of another.
    fn work_on(&self, other: &Self) -> f64 {
        let applied = dot(&self.load, &other.u) - self.supports.force_work(&other.u);
        let reactions = self.supports.pairing(&other.supports) - other.supports.force_work(&self.u);
        applied + reactions
    }

    /// Work of loads and reactions from another state to this one, by the trapezoidal rule: exact where they change linearly.
    pub(super) fn work_from(&self, before: &Self) -> f64 {
        let sum = |state: &Self| state.work_on(self) - state.work_on(before);
        0.5 * (sum(self) + sum(before))
    }
}
