//! A path from the start to a solution, through folds.

use std::cell::RefCell;

use crate::complementarity::solver::McpStep;
use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::{Plan, spread};
use crate::complementarity::{Mcp, McpFunction};
use crate::run::Status;
use crate::sparse::{Matrix, Pattern};

/// The homotopy. `outcomes::paths_and_enumeration_keep_their_limits`, `corpus::more_problems_of_the_literature_from_far_starts`.
struct Weights {
    /// Iterations of Newton's method at its end.
    newton: usize,
    /// Distances of the anchor from bounds: the least one, and the width of the interval above it over which they are spread.
    margin: (f64, f64),
    /// Largest such distance inside a box, relative to its width.
    inner: f64,
    /// Distance to a bound, relative to 1 + |x|, that counts as none.
    at_bound: f64,
    /// How far t may turn back.
    back: f64,
}

const WEIGHTS: Weights = Weights {
    newton: 60,
    margin: (0.05, 0.1),
    inner: 0.25,
    at_bound: 1e-9,
    back: 0.05,
};

impl Engine<'_> {
    /// Follows t F(x) + (1 − t)(x − x⁰) from x⁰ = `work.here.x`.
    pub(super) fn homotopy(&mut self) -> Status {
        let n = self.n();
        if !self.evaluate() || !self.jacobian() {
            return Status::Stalled;
        }
        let plan = Plan::newton(WEIGHTS.newton);
        if self.linearise(&plan, true).is_none() {
            return Status::Stalled;
        }
        let w = &*self.work;
        let lower: Vec<f64> = (0..n).map(|i| self.lower[i] / w.lin.col()[i]).collect();
        let upper: Vec<f64> = (0..n).map(|i| self.upper[i] / w.lin.col()[i]).collect();
        let start: Vec<f64> = (0..n).map(|i| w.here.x[i] / w.lin.col()[i]).collect();
        // Where the sign of F keeps x at a bound the anchor lies outside it, otherwise inside, so that no component starts on a kink.
        let anchor: Vec<f64> = (0..n)
            .map(|i| {
                let margin = WEIGHTS.margin.0 + WEIGHTS.margin.1 * spread(i);
                let width = upper[i] - lower[i];
                let inner = margin.min(WEIGHTS.inner * width);
                let f = w.equations.scaled[i];
                if start[i] - lower[i] < WEIGHTS.at_bound * (1.0 + start[i].abs()) {
                    if f > 0.0 {
                        lower[i] - margin
                    } else {
                        lower[i] + inner
                    }
                } else if upper[i] - start[i] < WEIGHTS.at_bound * (1.0 + start[i].abs()) {
                    if f < 0.0 {
                        upper[i] + margin
                    } else {
                        upper[i] - inner
                    }
                } else {
                    start[i]
                }
            })
            .collect();
        let y: Vec<f64> = (0..n).map(|i| anchor[i].max(lower[i]).min(upper[i])).collect();
        let pattern = {
            let p = w.lin.scaled().pattern();
            let all = w.lin.scaled().triplets().map(|t| (t.0, t.1));
            Pattern::from_entries(p.nrows(), n + 1, all.chain((0..n).map(|i| (i, n)))).ok()
        };
        let Some(pattern) = pattern else {
            return Status::Stalled;
        };
        let function = Homotopy {
            function: self.function,
            lower: self.lower,
            upper: self.upper,
            row: w.lin.row().to_vec(),
            col: w.lin.col().to_vec(),
            anchor,
            pattern,
            buffer: RefCell::new(Buffer {
                x: vec![0.0; n],
                beyond: vec![0.0; n],
                f: vec![0.0; n],
                jac: Matrix::zeros(w.lin.scaled().pattern().clone()),
                evaluations: 0,
                jacobians: 0,
            }),
        };
        let Ok(problem) = Mcp::new(function, lower, upper) else {
            return Status::Stalled;
        };
        let end = self.follow(&problem, &y, -WEIGHTS.back);
        let (evaluations, jacobians) = {
            let b = problem.function().buffer.borrow();
            (b.evaluations, b.jacobians)
        };
        self.report.evaluations += evaluations;
        self.report.jacobians += jacobians;
        let Some(end) = end else {
            return Status::Stalled;
        };
        for i in 0..n {
            self.work.here.x[i] = self.clamp(i, end.x[i] * self.work.lin.col()[i]);
        }
        if !self.evaluate() {
            return Status::Stalled;
        }
        // The last point of the path has been counted.
        if self.exhausted().is_none() {
            self.record(self.residual(), f64::NAN, McpStep::Own, 1.0);
        }
        match self.descend(&plan) {
            Status::Stalled if !end.reached => Status::Unbounded,
            status => status,
        }
    }
}

/// t R F(C y) + (1 − t)(y − y⁰), in scaled variables y; the last variable is t.
struct Homotopy<'a> {
    function: &'a dyn McpFunction,
    lower: &'a [f64],
    upper: &'a [f64],
    row: Vec<f64>,
    col: Vec<f64>,
    anchor: Vec<f64>,
    pattern: Pattern,
    buffer: RefCell<Buffer>,
}

struct Buffer {
    x: Vec<f64>,
    beyond: Vec<f64>,
    f: Vec<f64>,
    jac: Matrix,
    evaluations: usize,
    jacobians: usize,
}

impl Homotopy<'_> {
    /// F at the point within the bounds next to x, continued by its linearisation: correctors may leave the bounds a little, F is not
    /// evaluated there.
    fn evaluate(&self, y: &[f64], b: &mut Buffer) {
        let mut outside = false;
        for i in 0..y.len() {
            let x = self.col[i] * y[i];
            b.x[i] = x.max(self.lower[i]).min(self.upper[i]);
            b.beyond[i] = x - b.x[i];
            outside |= b.beyond[i] != 0.0;
        }
        self.function.value(&b.x, &mut b.f);
        b.evaluations += 1;
        if outside {
            self.linearise(b);
            b.jac.as_ref().mul_add(1.0, &b.beyond, &mut b.f);
        }
    }

    fn linearise(&self, b: &mut Buffer) {
        b.jac.clear();
        self.function.jacobian(&b.x, &mut b.jac);
        b.jacobians += 1;
    }
}

impl McpFunction for Homotopy<'_> {
    fn num_vars(&self) -> usize {
        self.row.len() + 1
    }

    fn num_values(&self) -> usize {
        self.row.len()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let b = &mut *self.buffer.borrow_mut();
        let n = out.len();
        let t = x[n];
        self.evaluate(&x[..n], b);
        for i in 0..n {
            out[i] = t * self.row[i] * b.f[i] + (1.0 - t) * (x[i] - self.anchor[i]);
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let b = &mut *self.buffer.borrow_mut();
        let n = self.row.len();
        let t = x[n];
        self.evaluate(&x[..n], b);
        self.linearise(b);
        for (i, j, v) in b.jac.triplets() {
            jac.add(i, j, t * self.row[i] * v * self.col[j]);
        }
        for i in 0..n {
            jac.add(i, i, 1.0 - t);
            jac.add(i, n, self.row[i] * b.f[i] - (x[i] - self.anchor[i]));
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::complementarity::WithJacobian;

    /// Beyond a bound F goes on along its tangent there: x² with 0 ≤ x ≤ 1 is 0 below and 2 x − 1 above.
    #[test]
    fn functions_go_on_straight_beyond_their_bounds() {
        let square = WithJacobian::new(
            1,
            |x: &[f64], out: &mut [f64]| out[0] = x[0] * x[0],
            |x: &[f64], jac: &mut Matrix| jac.add(0, 0, 2.0 * x[0]),
        );
        let homotopy = Homotopy {
            function: &square,
            lower: &[0.0],
            upper: &[1.0],
            row: vec![1.0],
            col: vec![1.0],
            anchor: vec![0.0],
            pattern: Pattern::full(1, 2),
            buffer: RefCell::new(Buffer {
                x: vec![0.0],
                beyond: vec![0.0],
                f: vec![0.0],
                jac: Matrix::zeros(Pattern::full(1, 1)),
                evaluations: 0,
                jacobians: 0,
            }),
        };
        for (x, f) in [(-0.5, 0.0), (0.5, 0.25), (1.0, 1.0), (1.5, 2.0)] {
            let mut out = [f64::NAN];
            homotopy.value(&[x, 1.0], &mut out);
            assert_eq!(out, [f], "{x}");
        }
    }
}
