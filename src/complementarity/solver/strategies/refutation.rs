//! Whether the conditions of an affine problem contradict each other, whatever the active set: a linear program, which is cheap beside
//! the strategies that follow where there is no solution.

use crate::clock::Deadline;
use crate::complementarity::solver::engine::Engine;
use crate::enumeration::refutation;
use crate::sparse::max_abs;

impl Engine<'_> {
    /// Whether the program is proven to have no point; its certificate is then in the report. Its table is full: it is tried at the sizes at
    /// which paths are followed.
    pub(super) fn refute(&mut self) -> bool {
        if !self.affine || self.n() > self.options.max_path_size {
            return false;
        }
        let Some(problem) = self.affine_problem() else {
            return false;
        };
        let deadline = Deadline::of(self.clock, self.options.max_time);
        let Some(found) = refutation(&problem, 0.0, deadline) else {
            return false;
        };
        // The first form of each site is F; the others are the distances from bounds.
        let mut v = vec![0.0; self.n()];
        found.iter().filter(|f| f.1 == 0).for_each(|&(i, _, factor)| v[i] = factor);
        let largest = max_abs(&v);
        v.iter_mut().for_each(|v| *v /= largest);
        let finite = v.iter().all(|v| v.is_finite());
        if finite {
            self.report.certificate = v;
        }
        finite
    }
}
