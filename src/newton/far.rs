//! What the rounding of the terms hides where Newton's method has converged far out.

use super::iterate::Run;
use crate::judge::{Columns, Point};
use crate::sparse::{Matrix, norm};

impl Run<'_> {
    /// Rounding of a residual as a part of the size of its terms.
    pub(super) fn floor(&self) -> f64 {
        8.0 * f64::EPSILON * (self.n as f64).sqrt().max(4.0)
    }

    /// A row whose constants are less than the rounding of its terms, where x₀ = x₁ and x₀ = x₁ + 1 look the same, although the rows that
    /// determine its unknowns are dependent: independent ones have a solution there, however far out it is. None where the user's absolute
    /// tolerance, which compares with nothing, is met by the residual and by the rounding in it. `work.r` and the matrix belong to x.
    pub(super) fn hidden_row(&mut self, jac: &Matrix, x: &[f64]) -> Option<usize> {
        let tolerance = self.options.relative_tolerance.max(self.floor());
        let work = &mut *self.work;
        let point = Point {
            x: &x[..self.n],
            f: &work.r,
            jac: Columns::Long(jac.leading_columns(self.n)),
            rest: None,
            start: &[],
            typical: &[],
            sizes: None,
            lower: &[],
            upper: &[],
        };
        let row = work.judge.conceals(&point, tolerance)?;
        let residual = norm(&work.r) + work.judge.rounding();
        (residual > self.options.absolute_tolerance).then_some(row)
    }
}
