//! Newton's method with linearised complementarity problems, each solved along its piecewise linear path.

use crate::complementarity::Mcp;
use crate::complementarity::solver::McpStep;
use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::{Plan, spread};
use crate::run::Status;
use crate::sparse::Matrix;
use crate::tolerances::ARMIJO;

/// Linearised problems. `corpus::more_problems_of_the_literature_from_far_starts`.
struct Weights {
    rounds: usize,
    /// Iterations of Newton's method after each.
    newton: usize,
    /// Multiples of I added to a Jacobian whose path does not leave the start.
    shifts: [f64; 3],
    /// Shortest step along the solution, and growth of the merit that is tolerated.
    shortest: f64,
    growth: f64,
    /// Margins by which components are held at bounds at the start of the path: between this and twice this.
    margin: f64,
}

const WEIGHTS: Weights = Weights {
    rounds: 20,
    newton: 8,
    shifts: [0.0, 1e-6, 1e-3],
    shortest: 1e-4,
    growth: 4.0,
    margin: 0.5,
};

impl Engine<'_> {
    /// Moves `work.here.x` to the solution of an affine (proximal) problem along its path; `false` where the path does not reach it.
    pub(super) fn affine_path(&mut self, plan: &Plan) -> bool {
        if !self.has_affine_paths() || !self.evaluate() || !self.jacobian() {
            return false;
        }
        if self.linearise(plan, true).is_none() {
            return false;
        }
        match self.linearised_solution() {
            Some((y, true)) => {
                for i in 0..self.n() {
                    self.work.here.x[i] = self.clamp(i, y[i] * self.work.lin.col()[i]);
                }
                self.evaluate()
            }
            _ => false,
        }
    }

    /// Newton's method with linearised complementarity problems.
    pub(super) fn josephy(&mut self) -> Status {
        let n = self.n();
        let plan = Plan::newton(WEIGHTS.newton);
        for i in 0..n {
            self.work.here.x[i] = self.clamp(i, self.work.here.x[i]);
        }
        let mut reference = f64::INFINITY;
        for k in 0..WEIGHTS.rounds {
            if let Some(status) = self.exhausted() {
                return status;
            }
            let from = self.work.here.x.clone();
            if !self.evaluate() || !self.jacobian() {
                return Status::Stalled;
            }
            let residual = self.residual();
            self.note_best(residual);
            let Some(psi) = self.linearise(&plan, k == 0) else {
                return Status::Stalled;
            };
            reference = reference.min(psi * WEIGHTS.growth).max(psi);
            let target = self.linearised_solution();
            // Its path counts, too.
            if let Some(status) = self.exhausted() {
                self.record(residual, psi, McpStep::None, 0.0);
                return status;
            }
            let Some((target, _)) = target else {
                return Status::Stalled;
            };
            for i in 0..n {
                self.work.system.d[i] = target[i] - from[i] / self.work.lin.col()[i];
            }
            let mut t = 1.0;
            let accepted = loop {
                if self
                    .try_along(&plan, t)
                    .is_some_and(|p| p <= (1.0 - ARMIJO * t) * reference)
                {
                    break true;
                }
                t *= 0.5;
                if t < WEIGHTS.shortest {
                    break false;
                }
            };
            if !accepted {
                self.record(residual, psi, McpStep::None, 0.0);
                return Status::Stalled;
            }
            self.record(residual, psi, McpStep::Linearised, t);
            self.accept_trial();
            let here = self.work.here.x.clone();
            // From here Newton's method may suffice; otherwise the sequence of linearised problems goes on.
            if self.descend(&plan) == Status::Solved {
                return Status::Solved;
            }
            self.work.here.x.copy_from_slice(&here);
        }
        Status::IterationLimit
    }

    /// The point where the path of the problem linearised at `work.here.x` ends, in scaled variables, and whether it is a solution.
    fn linearised_solution(&mut self) -> Option<(Vec<f64>, bool)> {
        let n = self.n();
        let w = &*self.work;
        let y: Vec<f64> = (0..n).map(|i| w.here.x[i] / w.lin.col()[i]).collect();
        let lower: Vec<f64> = (0..n).map(|i| self.lower[i] / w.lin.col()[i]).collect();
        let upper: Vec<f64> = (0..n).map(|i| self.upper[i] / w.lin.col()[i]).collect();
        // F − (1 − t) p vanishes at t = 0 in the interior, and has the right sign by a margin at bounds, so that no component starts
        // on a kink.
        let covering: Vec<f64> = (0..n)
            .map(|i| {
                let f = w.equations.scaled[i];
                let margin = WEIGHTS.margin * (1.0 + spread(i));
                if y[i] == lower[i] {
                    (f - margin).min(0.0)
                } else if y[i] == upper[i] {
                    (f + margin).max(0.0)
                } else {
                    f
                }
            })
            .collect();
        for shift in WEIGHTS.shifts {
            if self.is_over_time() {
                return None;
            }
            let w = &*self.work;
            let mut jy = vec![0.0; n];
            w.lin.scaled().mul_vec(&y, &mut jy);
            let mut triplets: Vec<(usize, usize, f64)> = w.lin.scaled().triplets().collect();
            triplets.extend((0..n).map(|i| (i, i, shift)));
            triplets.extend((0..n).map(|i| (i, n, covering[i])));
            let q = (0..n)
                .map(|i| w.equations.scaled[i] - jy[i] - shift * y[i] - covering[i])
                .collect();
            let matrix = Matrix::from_triplets(n, n + 1, &triplets).ok()?;
            let Ok(problem) = Mcp::affine(matrix, q, lower.clone(), upper.clone()) else {
                return None;
            };
            if let Some(end) = self.follow(&problem, &y, f64::NEG_INFINITY)
                && end.x[n] > 0.0
            {
                let mut x = end.x;
                x.truncate(n);
                return Some((x, end.reached));
            }
        }
        None
    }
}
