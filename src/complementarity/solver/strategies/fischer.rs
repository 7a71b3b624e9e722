//! The penalised Fischer–Burmeister function, without equilibration.

use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::Plan;
use crate::run::Status;

impl Plan {
    /// The penalised Fischer–Burmeister function. `corpus::more_problems_of_the_literature_from_far_starts`.
    pub(super) const fn fischer(max_iterations: usize) -> Self {
        Self {
            natural: false,
            lambda: 0.9,
            scaled: false,
            memory: 8,
            credit: 8,
            ..Self::newton(max_iterations)
        }
    }
}

impl Engine<'_> {
    pub(super) fn fischer(&mut self) -> Status {
        self.descend(&Plan::fischer(self.options.max_attempt))
    }
}
