//! F in other units of its values and unknowns.

use std::cell::RefCell;

use super::McpFunction;
use crate::sparse::{Matrix, Pattern};

/// Component i of F times `rows[i]`, where x is given divided by `unknowns`, component by component.
pub(crate) struct InUnits<'a> {
    function: &'a dyn McpFunction,
    rows: &'a [f64],
    unknowns: &'a [f64],
    point: RefCell<Vec<f64>>,
}

impl<'a> InUnits<'a> {
    /// `point` is a buffer.
    pub(crate) fn new(
        function: &'a dyn McpFunction,
        rows: &'a [f64],
        unknowns: &'a [f64],
        point: Vec<f64>,
    ) -> Self {
        Self {
            function,
            rows,
            unknowns,
            point: RefCell::new(point),
        }
    }

    /// The buffer.
    pub(crate) fn end(self) -> Vec<f64> {
        self.point.into_inner()
    }

    /// Calls `f` with x in the units of F.
    fn at(&self, x: &[f64], f: impl FnOnce(&[f64])) {
        let mut point = self.point.borrow_mut();
        point.clear();
        point.extend(x.iter().zip(self.unknowns).map(|(x, unit)| x * unit));
        f(&point);
    }
}

impl McpFunction for InUnits<'_> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }

    fn num_values(&self) -> usize {
        self.function.num_values()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.at(x, |x| self.function.value(x, out));
        out.iter_mut().zip(self.rows).for_each(|(f, unit)| *f *= unit);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.at(x, |x| self.function.jacobian(x, jac));
        jac.scale(self.rows, self.unknowns);
    }

    fn pattern(&self) -> Pattern {
        self.function.pattern()
    }

    fn is_affine(&self) -> bool {
        self.function.is_affine()
    }
}
