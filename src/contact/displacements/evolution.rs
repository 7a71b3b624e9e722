//! Histories of load levels in the displacements alone.

use std::ops::ControlFlow;

use super::{ReducedContact, ReducedObserver, ReducedProgress, ReducedReport};
use crate::contact::{ContactError, ContactSolution, ContactState, NodeLaw};
use crate::input::check_finite;

/// One level of [`ReducedContact::evolve`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReducedLevel {
    /// The load level α.
    pub level: f64,
    /// The solution and how it was found.
    pub report: ReducedReport,
    /// States and local quantities; slips are increments of this level.
    pub solution: ContactSolution,
    /// Number of nodes by state (open, stick, slip) at the level before and at this one: `changes[0][2]` went from open to slip;
    /// `changes[2][2]` counts slipping nodes whose traction along t₁ has changed its sign. Zeros in the first level. A node at the boundary
    /// of two states (traction at the bound and no slip since the level before, say) may count for either.
    pub changes: [[usize; 3]; 3],
    /// Displacements of the supports ([`ReducedBody::support_displacements`](super::ReducedBody::support_displacements)).
    pub supports: Vec<f64>,
    /// History variables at the end of the level, node by node.
    pub history: Vec<f64>,
}

impl ReducedLevel {
    /// Number of nodes whose state has changed.
    #[must_use]
    pub fn num_changes(&self) -> usize {
        self.changes.as_flattened().iter().sum()
    }
}

/// Open, stick or slip.
fn kind(state: ContactState) -> usize {
    match state {
        ContactState::Open => 0,
        ContactState::Stick => 1,
        ContactState::SlipPlus | ContactState::SlipMinus => 2,
    }
}

fn changes(before: &[ContactState], after: &[ContactState]) -> [[usize; 3]; 3] {
    let mut counts = [[0; 3]; 3];
    for (a, b) in before.iter().zip(after).filter(|(a, b)| a != b) {
        counts[kind(*a)][kind(*b)] += 1;
    }
    counts
}

impl<L: NodeLaw> ReducedContact<L> {
    /// Computes a history of load levels, the first one from the displacements `start` (zero if there is none). In each level the static
    /// law holds for the increments of slip since the level before; then the level is [ended](Self::end_level). Newton's method starts from
    /// the extrapolation of the last two levels, and from the last one where that fails. `observe` is called at each level and may stop.
    ///
    /// Unlike [`evolve`](crate::contact::evolve) it does not follow the branch between two levels: folds are not found and snap-through is
    /// not reported. Nodes that change their state and change it back within a level are not counted.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use semismooth::contact::{FrictionCoefficient, LoadPath, PlanarCoulomb, ReducedContact, ReducedOptions};
    /// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
    /// let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [16, 8])?;
    /// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277)?).fix("left").discretize()?;
    /// let load = LoadPath::affine(
    ///     system.traction("top", |_| [0.0, -0.01, 0.0])?,
    ///     system.traction("right", |_| [0.01, 0.0, 0.0])?,
    /// );
    /// let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    /// let body = semismooth::reduced_body(&system, &rows, load)?;
    /// let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.3)?);
    /// let mut problem = ReducedContact::new(body, law, ReducedOptions::default())?;
    /// let levels = problem.evolve(None, &[0.0, 0.5, 1.0], |_| ControlFlow::Continue(()))?;
    /// assert!(levels[1].num_changes() + levels[2].num_changes() > 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A law whose coefficients depend on the slip but has no history ([`ContactError::SlipOfLevels`]); those of
    /// [`solve`](Self::solve): `observe` has been called with the levels before, and the problem is left at the last of them.
    pub fn evolve(
        &mut self,
        start: Option<&[f64]>,
        levels: &[f64],
        observe: impl FnMut(&ReducedLevel) -> ControlFlow<()>,
    ) -> Result<Vec<ReducedLevel>, ContactError> {
        self.evolve_observed(start, levels, |_| ControlFlow::Continue(()), observe)
    }

    /// [`evolve`](Self::evolve) with a second observer, that of [`solve_observed`](Self::solve_observed), which may stop the search for the
    /// next level: the levels completed are returned, and the problem is left at the last of them.
    ///
    /// # Errors
    /// As [`evolve`](Self::evolve).
    pub fn evolve_observed(
        &mut self,
        start: Option<&[f64]>,
        levels: &[f64],
        mut search: impl FnMut(&ReducedProgress) -> ControlFlow<()> + Send,
        mut observe: impl FnMut(&ReducedLevel) -> ControlFlow<()>,
    ) -> Result<Vec<ReducedLevel>, ContactError> {
        if self.node_law().depends_on_slip() {
            return Err(ContactError::SlipOfLevels);
        }
        check_finite("the list of load levels", levels)?;
        let mut reached: Vec<ReducedLevel> = Vec::new();
        for &level in levels {
            let mut stopped = false;
            let mut each = |progress: &ReducedProgress| {
                let flow = search(progress);
                stopped |= flow.is_break();
                flow
            };
            let found = match reached.as_slice() {
                [] => self.solve_telling(level, start, &mut each),
                [.., last] => self.next_level(level, &reached, last, &mut each),
            };
            let report = match found {
                Err(ContactError::NotConverged { best }) if stopped && best.status.is_early() => break,
                found => found?,
            };
            let solution = self.solution(level, &report.displacements)?;
            self.end_at(&solution);
            let changes = match reached.last() {
                Some(last) => changes(&last.solution.states, &solution.states),
                None => [[0; 3]; 3],
            };
            reached.push(ReducedLevel {
                level,
                report,
                solution,
                changes,
                supports: self.body().support_displacements(level),
                history: self.history().to_vec(),
            });
            if reached.last().is_some_and(|level| observe(level).is_break()) {
                break;
            }
        }
        Ok(reached)
    }

    fn next_level(
        &mut self,
        level: f64,
        reached: &[ReducedLevel],
        last: &ReducedLevel,
        observe: &mut ReducedObserver<'_>,
    ) -> Result<ReducedReport, ContactError> {
        if let [.., before, _] = reached {
            let share = (level - last.level) / (last.level - before.level);
            let (old, new) = (&before.report.displacements, &last.report.displacements);
            let line: Vec<f64> = new.iter().zip(old).map(|(v, u)| v + share * (v - u)).collect();
            if line.iter().all(|u| u.is_finite()) {
                match self.solve_telling(level, Some(&line), observe) {
                    Err(ContactError::NotConverged { best }) if !best.status.is_early() => {}
                    Err(ContactError::StepFailed { .. }) => {}
                    found => return found,
                }
            }
        }
        self.solve_telling(level, Some(&last.report.displacements), observe)
    }
}

#[cfg(test)]
mod tests {
    use super::changes;
    use crate::contact::ContactState::{Open, SlipMinus, SlipPlus, Stick};

    #[test]
    fn changes_are_counted_by_where_they_lead() {
        let before = [Open, Open, Stick, SlipPlus, SlipPlus, Stick];
        let after = [Open, SlipMinus, SlipPlus, SlipMinus, SlipPlus, Open];
        assert_eq!(changes(&before, &after), [[0, 0, 1], [1, 0, 1], [0, 0, 1]]);
    }
}
