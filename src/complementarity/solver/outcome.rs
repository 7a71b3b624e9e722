//! The report of a solve.

use super::BoundState;
use super::engine::Engine;
use super::units::measure;
use crate::run::Status;

impl Engine<'_> {
    /// The reason of the attempt that came nearest.
    pub(super) fn verdict(&self) -> Status {
        if self.asymptotic {
            return Status::Unbounded;
        }
        let nearest = self
            .report
            .fallbacks
            .iter()
            .min_by(|a, b| a.residual.total_cmp(&b.residual));
        match nearest.map(|f| f.outcome) {
            Some(Status::IterationLimit) | None => Status::Stalled,
            Some(outcome) => outcome,
        }
    }

    /// The status reported for the point nearest to a solution, where no strategy reached the tolerance.
    fn last_word(&mut self, status: Status) -> Status {
        let proven = matches!(status, Status::NoSolution | Status::Interrupted);
        if proven || self.least_error == f64::INFINITY {
            return status;
        }
        let w = &mut *self.work;
        w.trial.x.copy_from_slice(&w.here.x);
        w.here.x.copy_from_slice(&w.seen.nearest);
        if self.evaluate() && self.jacobian() {
            let tolerance = self.options.acceptable.max(self.options.tolerance);
            let verdict = self.measure(tolerance);
            if self.accepts(verdict, tolerance) {
                return Status::Solved;
            }
            if verdict.is_rounding() {
                return Status::AtRounding;
            }
        }
        let w = &mut *self.work;
        w.here.x.copy_from_slice(&w.trial.x);
        status
    }

    /// Writes the best point to `x` and completes the report.
    pub(super) fn finish(&mut self, mut status: Status, x: &mut [f64]) {
        self.fresh = false;
        if status != Status::Solved {
            let w = &mut *self.work;
            match self.best < f64::INFINITY {
                true => w.here.x.copy_from_slice(&w.seen.best),
                false => w.here.x.copy_from_slice(&w.start),
            }
            status = self.last_word(status);
        }
        x.copy_from_slice(&self.work.here.x);
        // Evaluated once more, at the point returned.
        let finite = self.evaluate();
        if status != Status::Solved {
            self.report.error = f64::NAN;
            if finite && self.jacobian() {
                self.measure(self.options.tolerance);
            }
        }
        self.report.status = status;
        self.report.strategy = self.strategy;
        for i in 0..x.len() {
            let (l, u, f) = (self.lower[i], self.upper[i], self.work.here.f[i]);
            self.report.states.push(match (x[i] == l, x[i] == u) {
                (true, _) if f >= 0.0 || l == u => BoundState::Lower,
                (_, true) if f <= 0.0 => BoundState::Upper,
                _ => BoundState::Interior,
            });
        }
        measure(self.report, x, &self.work.here.f, self.lower, self.upper);
    }
}
