//! Paths: linearised problems along piecewise linear ones, and homotopies.

use std::cell::RefCell;

use super::engine::{Engine, Plan};
use super::{McpStatus, McpStep};
use crate::complementarity::{Mcp, McpFunction};
use crate::continuation::{Continuation, ContinuationOptions, Direction, Event, Termination};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::{Matrix, Pattern};

/// The last point of a path.
struct End {
    x: Vec<f64>,
    reached: bool,
}

impl Engine<'_> {
    fn path_options(&self, size: f64, least: f64) -> ContinuationOptions {
        let left = self
            .options
            .max_time
            .map(|t| t.saturating_sub(self.clock.elapsed()));
        ContinuationOptions::default()
            .with_parameter_range((least, 1.0))
            .with_max_points(self.options.max_path_points)
            .with_max_step(10.0 * (1.0 + size))
            .with_max_nodes(self.options.max_nodes.min(20_000))
            .with_max_growth(1e8)
            .with_max_time(left)
    }

    /// Follows the curve from (y, 0) towards α = 1, as long as α stays above `least`, also over branchings.
    fn follow<P: PiecewiseSmooth>(&mut self, map: &P, y: &[f64], least: f64) -> Option<End> {
        let n = self.n();
        let mut x = y.to_vec();
        x.push(0.0);
        let size = y.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let options = self.path_options(size, least);
        let mut curve = Continuation::new(map, &x, Direction::Increasing, options.clone()).ok()?;
        let mut nearest = End {
            x: x.clone(),
            reached: false,
        };
        for _ in 0..8 {
            let mut last = None;
            for event in curve.by_ref() {
                let Ok(event) = event else { break };
                let p = event.x();
                if p[n] > nearest.x[n] {
                    nearest.x.copy_from_slice(p);
                }
                self.report.iterations += 1;
                if self.exhausted().is_some() {
                    return Some(nearest);
                }
                last = Some(event);
            }
            match (curve.termination(), last) {
                (Some(Termination::ParameterRange), Some(event)) if event.x()[n] > 0.5 => {
                    nearest.x.copy_from_slice(event.x());
                    nearest.reached = true;
                    break;
                }
                (Some(Termination::Branching), Some(Event::Transition(t))) => {
                    let rate = |a: &crate::continuation::Arm| a.tangent[n];
                    let arm = t.arms.iter().max_by(|a, b| rate(a).total_cmp(&rate(b)))?;
                    curve = Continuation::along_arm(map, &t.x, arm, options.clone()).ok()?;
                }
                _ => break,
            }
        }
        Some(nearest)
    }

    /// Moves `work.x` to the solution of an affine (proximal) problem along its path; `false` where the path does not arrive.
    pub(super) fn affine_path(&mut self, plan: &Plan) -> bool {
        if self.n() > self.options.max_path_size || !self.evaluate() || !self.jacobian() {
            return false;
        }
        if self.linearise(plan, true).is_none() {
            return false;
        }
        match self.linearised_solution() {
            Some((y, true)) => {
                for i in 0..self.n() {
                    self.work.x[i] = self.clamp(i, y[i] * self.work.lin.col()[i]);
                }
                self.evaluate()
            }
            _ => false,
        }
    }

    /// Newton's method with linearised complementarity problems.
    pub(super) fn josephy(&mut self) -> McpStatus {
        let n = self.n();
        let plan = Plan::newton(8);
        for i in 0..n {
            self.work.x[i] = self.clamp(i, self.work.x[i]);
        }
        let mut reference = f64::INFINITY;
        for k in 0..20 {
            if let Some(status) = self.exhausted() {
                return status;
            }
            let from = self.work.x.clone();
            if !self.evaluate() || !self.jacobian() {
                return McpStatus::Stalled;
            }
            let Some(psi) = self.linearise(&plan, k == 0) else {
                return McpStatus::Stalled;
            };
            reference = if k == 0 {
                psi
            } else {
                reference.min(psi * 4.0).max(psi)
            };
            let Some((target, _)) = self.linearised_solution() else {
                return McpStatus::Stalled;
            };
            self.record(self.residual(), psi, McpStep::Linearised, 1.0);
            for i in 0..n {
                self.work.d[i] = target[i] - from[i] / self.work.lin.col()[i];
            }
            let mut t = 1.0;
            let accepted = loop {
                if self
                    .try_along(&plan, t)
                    .is_some_and(|p| p <= (1.0 - 1e-4 * t) * reference)
                {
                    break true;
                }
                t *= 0.5;
                if t < 1e-4 {
                    break false;
                }
            };
            if !accepted {
                return McpStatus::Stalled;
            }
            self.accept_trial();
            let here = self.work.x.clone();
            // From here Newton's method may do; otherwise the sequence of linearised problems goes on.
            if self.descend(&plan) == McpStatus::Solved {
                return McpStatus::Solved;
            }
            self.work.x.copy_from_slice(&here);
        }
        McpStatus::IterationLimit
    }

    /// The point where the path of the problem linearised at `work.x` ends, in scaled variables, and whether it is a solution.
    fn linearised_solution(&mut self) -> Option<(Vec<f64>, bool)> {
        let n = self.n();
        let w = &*self.work;
        let y: Vec<f64> = (0..n).map(|i| w.x[i] / w.lin.col()[i]).collect();
        let lower: Vec<f64> = (0..n).map(|i| self.lower[i] / w.lin.col()[i]).collect();
        let upper: Vec<f64> = (0..n).map(|i| self.upper[i] / w.lin.col()[i]).collect();
        // F − (1 − t) p vanishes at t = 0 in the interior, and has the right sign by a margin at bounds, so that no component starts
        // on a kink.
        let covering: Vec<f64> = (0..n)
            .map(|i| {
                let f = w.scaled[i];
                let margin = 0.5 + 0.5 * ((i + 1) as f64 * 0.618_033_988_749_895).fract();
                if y[i] == lower[i] {
                    (f - margin).min(0.0)
                } else if y[i] == upper[i] {
                    (f + margin).max(0.0)
                } else {
                    f
                }
            })
            .collect();
        for shift in [0.0, 1e-6, 1e-3] {
            let w = &*self.work;
            let mut jy = vec![0.0; n];
            w.lin.scaled().mul_vec(&y, &mut jy);
            let mut triplets: Vec<(usize, usize, f64)> = w.lin.scaled().triplets().collect();
            triplets.extend((0..n).map(|i| (i, i, shift)));
            triplets.extend((0..n).map(|i| (i, n, covering[i])));
            let q = (0..n)
                .map(|i| w.scaled[i] - jy[i] - shift * y[i] - covering[i])
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

    /// Follows t F(x) + (1 − t)(x − x⁰) from x⁰ = `work.x`.
    pub(super) fn homotopy(&mut self) -> McpStatus {
        let n = self.n();
        if !self.evaluate() || !self.jacobian() {
            return McpStatus::Stalled;
        }
        let plan = Plan::newton(60);
        if self.linearise(&plan, true).is_none() {
            return McpStatus::Stalled;
        }
        let w = &*self.work;
        let lower: Vec<f64> = (0..n).map(|i| self.lower[i] / w.lin.col()[i]).collect();
        let upper: Vec<f64> = (0..n).map(|i| self.upper[i] / w.lin.col()[i]).collect();
        let start: Vec<f64> = (0..n).map(|i| w.x[i] / w.lin.col()[i]).collect();
        // The anchor lies beyond a bound that F holds x at, and inside one it does not, so that no component starts on a kink.
        let anchor: Vec<f64> = (0..n)
            .map(|i| {
                let margin = 0.05 + 0.1 * ((i + 1) as f64 * 0.618_033_988_749_895).fract();
                let width = upper[i] - lower[i];
                let inner = margin.min(0.25 * width);
                let f = w.scaled[i];
                if start[i] - lower[i] < 1e-9 * (1.0 + start[i].abs()) {
                    if f > 0.0 {
                        lower[i] - margin
                    } else {
                        lower[i] + inner
                    }
                } else if upper[i] - start[i] < 1e-9 * (1.0 + start[i].abs()) {
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
            return McpStatus::Stalled;
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
            return McpStatus::Stalled;
        };
        let end = self.follow(&problem, &y, -0.05);
        let (evaluations, jacobians) = {
            let b = problem.function().buffer.borrow();
            (b.evaluations, b.jacobians)
        };
        self.report.evaluations += evaluations;
        self.report.jacobians += jacobians;
        let Some(end) = end else {
            return McpStatus::Stalled;
        };
        for i in 0..n {
            self.work.x[i] = self.clamp(i, end.x[i] * self.work.lin.col()[i]);
        }
        if !self.evaluate() {
            return McpStatus::Stalled;
        }
        self.record(self.residual(), f64::NAN, McpStep::Path, 1.0);
        match self.descend(&plan) {
            McpStatus::Stalled if !end.reached => McpStatus::Unbounded,
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
    /// F at the point within the bounds next to x, continued by its linearisation: correctors look a little beyond bounds, F may not.
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
