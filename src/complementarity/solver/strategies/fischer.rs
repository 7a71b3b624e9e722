//! The penalised Fischer–Burmeister function, without equilibration.

use crate::complementarity::solver::McpStatus;
use crate::complementarity::solver::engine::{Engine, Plan};

impl Engine<'_> {
    pub(super) fn fischer(&mut self) -> McpStatus {
        self.descend(&Plan::fischer(self.options.max_attempt))
    }
}
