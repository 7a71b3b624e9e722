//! Affine problems are solved in units in which neither their coefficients nor their solutions are large or small: a run is the same to
//! the last bit in all units of F and of x that differ by powers of two.

use std::cell::RefCell;

use super::{McpReport, Parts};
use crate::complementarity::McpFunction;
use crate::complementarity::problem::natural;
use crate::judge::power_below;
use crate::sparse::{Matrix, Pattern};

/// Powers of two by which F is multiplied and x is divided, and bounds in these units.
#[derive(Debug, Clone, Default)]
pub(super) struct Units {
    rows: f64,
    unknowns: f64,
    lower: Vec<f64>,
    upper: Vec<f64>,
    point: Vec<f64>,
}

impl Units {
    /// Those of an affine problem: the largest coefficient becomes 1 up to a factor of two, and so does the largest of what bounds and, row
    /// by row, the constants beside the coefficients say about x. `jac` and `constants` receive ∇F and F(0).
    pub(super) fn find(&mut self, problem: &Parts<'_>, jac: &mut Matrix, constants: &mut Vec<f64>) {
        let n = problem.lower.len();
        self.point.clear();
        self.point.resize(n, 0.0);
        constants.clear();
        constants.resize(n, 0.0);
        problem.function.value(&self.point, constants);
        jac.clear();
        problem.function.jacobian(&self.point, jac);
        self.lower.clear();
        self.lower.resize(n, 0.0);
        let rows = &mut self.lower;
        jac.triplets()
            .for_each(|(i, _, v)| rows[i] = rows[i].max(v.abs()));
        let largest = rows.iter().fold(0.0_f64, |m, v| m.max(*v));
        let shares = rows.iter().zip(&*constants).filter(|e| *e.0 > 0.0);
        let bounds = problem
            .lower
            .iter()
            .chain(problem.upper)
            .filter(|b| b.is_finite());
        let size = { shares }.fold(0.0_f64, |m, (row, q)| m.max(q.abs() / row));
        let size = bounds.fold(size, |m, b| m.max(b.abs()));
        self.unknowns = power_below(size);
        self.rows = (power_below(largest) * self.unknowns).recip();
        if !self.rows.is_normal() {
            (self.rows, self.unknowns) = (1.0, 1.0);
        }
        self.set(problem.lower, problem.upper);
    }

    fn set(&mut self, lower: &[f64], upper: &[f64]) {
        for (to, from) in [(&mut self.lower, lower), (&mut self.upper, upper)] {
            to.clear();
            to.extend(from.iter().map(|b| b / self.unknowns));
        }
    }

    /// Whether nothing changes.
    pub(super) fn are_own(&self) -> bool {
        self.rows == 1.0 && self.unknowns == 1.0
    }

    pub(super) fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    /// x in these units.
    pub(super) fn enter(&self, x: &mut [f64]) {
        x.iter_mut().for_each(|x| *x /= self.unknowns);
    }

    /// A point of these units and its report in those of the problem.
    pub(super) fn leave(&self, problem: &Parts<'_>, x: &mut [f64], f: &mut [f64], report: &mut McpReport) {
        x.iter_mut().for_each(|x| *x *= self.unknowns);
        problem.function.value(x, f);
        measure(report, x, f, problem.lower, problem.upper);
    }
}

/// F in other units.
pub(super) struct InUnits<'a> {
    pub(super) function: &'a dyn McpFunction,
    pub(super) units: (f64, f64),
    point: RefCell<Vec<f64>>,
}

impl<'a> InUnits<'a> {
    pub(super) fn new(function: &'a dyn McpFunction, units: &mut Units) -> Self {
        Self {
            function,
            units: (units.rows, units.unknowns),
            point: RefCell::new(std::mem::take(&mut units.point)),
        }
    }

    /// Gives the buffer back.
    pub(super) fn end(self, units: &mut Units) {
        units.point = self.point.into_inner();
    }
}

impl McpFunction for InUnits<'_> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let mut point = self.point.borrow_mut();
        point.clear();
        point.extend(x.iter().map(|x| x * self.units.1));
        self.function.value(&point, out);
        out.iter_mut().for_each(|f| *f *= self.units.0);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let mut point = self.point.borrow_mut();
        point.clear();
        point.extend(x.iter().map(|x| x * self.units.1));
        self.function.jacobian(&point, jac);
        let factor = self.units.0 * self.units.1;
        jac.values_mut().iter_mut().for_each(|v| *v *= factor);
    }

    fn pattern(&self) -> Pattern {
        self.function.pattern()
    }

    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }
}

/// What a report says of x, where F is f.
pub(super) fn measure(report: &mut McpReport, x: &[f64], f: &[f64], lower: &[f64], upper: &[f64]) {
    let (mut residual, mut complementarity, mut feasibility) = (0.0_f64, 0.0_f64, 0.0_f64);
    for i in 0..x.len() {
        let (l, u, f) = (lower[i], upper[i], f[i]);
        let r = natural(x[i], l, u, f).abs();
        if r > residual || r.is_nan() {
            residual = r;
        }
        feasibility = feasibility.max(l - x[i]).max(x[i] - u);
        let gap = if f > 0.0 { x[i] - l } else { u - x[i] };
        complementarity = complementarity.max(gap.abs().min(f.abs()));
    }
    report.residual = residual;
    report.feasibility = feasibility;
    report.complementarity = if f.iter().all(|f| f.is_finite()) {
        complementarity
    } else {
        f64::NAN
    };
}
