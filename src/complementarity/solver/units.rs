//! Affine problems are solved in units in which neither their coefficients nor their solutions are large or small: a run is the same to
//! the last bit in all units of F and of x that differ by powers of two.

use super::McpReport;
use super::parts::Parts;
use crate::complementarity::InUnits;
use crate::complementarity::McpFunction;
use crate::complementarity::problem::natural;
use crate::judge::power_below;
use crate::sparse::{Matrix, max_abs};

/// Powers of two by which F is multiplied and x is divided, the same for all components, and bounds in these units.
#[derive(Debug, Clone, Default)]
pub(super) struct Units {
    rows: Vec<f64>,
    unknowns: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    point: Vec<f64>,
    own: bool,
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
        self.rows.clear();
        self.rows.resize(n, 0.0);
        let rows = &mut self.rows;
        jac.triplets()
            .for_each(|(i, _, v)| rows[i] = rows[i].max(v.abs()));
        let largest = rows.iter().fold(0.0_f64, |m, v| m.max(*v));
        let shares = rows.iter().zip(&*constants).filter(|e| *e.0 > 0.0);
        let bounds = { problem.lower.iter().chain(problem.upper) }.filter(|b| b.is_finite());
        let size = { shares }.fold(0.0_f64, |m, (row, q)| m.max(q.abs() / row));
        let size = bounds.fold(size, |m, b| m.max(b.abs()));
        let unknown = power_below(size);
        // Where F is constant, its values are what there is to compare.
        let values = match largest > 0.0 {
            true => power_below(largest) * unknown,
            false => power_below(max_abs(constants)),
        };
        let row = values.recip();
        self.own = !row.is_normal() || (row == 1.0 && unknown == 1.0);
        for (to, unit) in [(&mut self.rows, row), (&mut self.unknowns, unknown)] {
            to.clear();
            to.resize(n, unit);
        }
        for (to, from) in [(&mut self.lower, problem.lower), (&mut self.upper, problem.upper)] {
            to.clear();
            to.extend(from.iter().map(|b| b / unknown));
        }
    }

    /// Whether nothing changes.
    pub(super) fn are_own(&self) -> bool {
        self.own
    }

    pub(super) fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    /// x in these units.
    pub(super) fn enter(&self, x: &mut [f64]) {
        x.iter_mut().zip(&self.unknowns).for_each(|(x, unit)| *x /= unit);
    }

    /// A point of these units and its report in those of the problem.
    pub(super) fn leave(&self, problem: &Parts<'_>, x: &mut [f64], f: &mut [f64], report: &mut McpReport) {
        x.iter_mut().zip(&self.unknowns).for_each(|(x, unit)| *x *= unit);
        problem.function.value(x, f);
        measure(report, x, f, problem.lower, problem.upper);
    }

    /// F in these units.
    pub(super) fn function<'a>(&'a self, function: &'a dyn McpFunction, point: Vec<f64>) -> InUnits<'a> {
        InUnits::new(function, &self.rows, &self.unknowns, point)
    }

    pub(super) fn point(&mut self) -> &mut Vec<f64> {
        &mut self.point
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
