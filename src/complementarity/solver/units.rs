//! Affine problems are solved in units in which neither their coefficients nor their solutions are large or small: a run is the same to
//! the last bit in all units of F and of x that differ by powers of two.

use super::{McpReport, Parts};
use crate::complementarity::InUnits;
use crate::complementarity::McpFunction;
use crate::complementarity::problem::natural;
use crate::judge::{Sizes, Units as Exponents};
use crate::sparse::{Matrix, max_abs};

/// Powers of two by which the components of F are multiplied and those of x are divided, and bounds in these units.
#[derive(Debug, Clone, Default)]
pub(super) struct Units {
    exponents: Exponents,
    rows: Vec<f64>,
    unknowns: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    point: Vec<f64>,
    own: bool,
}

impl Units {
    /// Those of an affine problem. `jac` and `constants` receive ∇F and F(0).
    pub(super) fn find(&mut self, problem: &Parts<'_>, jac: &mut Matrix, constants: &mut Vec<f64>) {
        let n = problem.lower.len();
        self.point.clear();
        self.point.resize(n, 0.0);
        constants.clear();
        constants.resize(n, 0.0);
        problem.function.value(&self.point, constants);
        jac.clear();
        problem.function.jacobian(&self.point, jac);
        let bound = |i: usize| {
            let both = [problem.lower[i], problem.upper[i]].into_iter();
            both.filter(|b| b.is_finite())
                .fold(0.0_f64, |m, b| m.max(b.abs()))
        };
        self.own = !self.exponents.find(&Sizes {
            owner: None,
            blocks: n,
            matrix: jac,
            constant: &|i| constants[i],
            bound: &bound,
            keep_ratios: false,
        });
        if self.own {
            return;
        }
        for (to, from) in [
            (&mut self.rows, &self.exponents.rows),
            (&mut self.unknowns, &self.exponents.unknowns),
        ] {
            to.clear();
            to.extend(from.iter().map(|k| (*k as f64).exp2()));
        }
        for (to, from) in [(&mut self.lower, problem.lower), (&mut self.upper, problem.upper)] {
            to.clear();
            to.extend(from.iter().zip(&self.unknowns).map(|(b, unit)| b / unit));
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
        // Rows with these weights add to a contradiction: the larger the unit of a row, the smaller its weight.
        let certificate = &mut report.certificate;
        certificate
            .iter_mut()
            .zip(&self.rows)
            .for_each(|(v, unit)| *v *= unit);
        let largest = max_abs(certificate);
        certificate.iter_mut().for_each(|v| *v /= largest);
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
