//! Steps of the natural map, globalised; for affine problems full steps from active set to active set first.

use crate::complementarity::solver::McpStep;
use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::Plan;
use crate::run::Status;

impl Engine<'_> {
    pub(super) fn newton(&mut self) -> Status {
        let plan = Plan::newton(self.options.max_attempt);
        if self.affine {
            let status = self.affine_newton(&plan);
            if status != Status::Stalled {
                return status;
            }
            self.restart_at_start();
        }
        self.descend(&plan)
    }

    /// Full steps of the natural map for affine F, where each active set has one step: ends at a solution, or where a set recurs.
    pub(super) fn affine_newton(&mut self, plan: &Plan) -> Status {
        let limit = (50 + self.n() / 2).min(plan.max_iterations);
        self.work.visited.clear();
        if !self.evaluate() || !self.jacobian() {
            return Status::EvaluationFailure {
                component: self.bad_component.unwrap_or(0),
            };
        }
        self.equilibrate(plan);
        self.work.lin.rescale(plan.proximal);
        let mut unchanged = false;
        for k in 0..=limit {
            if let Some(status) = self.exhausted() {
                return status;
            }
            let merit = self.merit(plan);
            let residual = self.residual();
            if unchanged || self.is_solution(residual) {
                if !self.clamp_all() {
                    break;
                }
                let residual = self.residual();
                let measure = self.measure(self.options.tolerance);
                self.note_nearest(measure);
                self.note_best(residual);
                if plan.proximal > 0.0 || measure.is_solved(self.options.tolerance) {
                    self.record(residual, merit, McpStep::None, 0.0);
                    return Status::Solved;
                }
                break;
            }
            if (0..self.n()).all(|i| self.work.here.x[i] == self.clamp(i, self.work.here.x[i])) {
                self.note_best(residual);
            }
            let given = self.given_active && k == 0;
            unchanged = !given && self.update_active() && k > 0;
            if unchanged {
                continue;
            }
            let mark = hash(&self.work.system.active);
            if k == limit || self.work.visited.contains(&mark) {
                break;
            }
            self.work.visited.push(mark);
            if !self.natural_step() {
                break;
            }
            self.record(residual, merit, McpStep::Natural, 1.0);
            self.make_trial(1.0, false);
            for i in 0..self.n() {
                match self.work.system.active[i] {
                    -1 => self.work.trial.x[i] = self.lower[i],
                    1 => self.work.trial.x[i] = self.upper[i],
                    _ => {}
                }
            }
            if !self.evaluate_trial() {
                break;
            }
            self.accept_trial();
        }
        Status::Stalled
    }
}

/// FNV-1a.
fn hash(active: &[i8]) -> u64 {
    active.iter().fold(0xcbf2_9ce4_8422_2325, |h, a| {
        (h ^ u64::from(a.cast_unsigned())).wrapping_mul(0x0100_0000_01b3)
    })
}
