//! What the rounding of the terms hides where Newton's method has converged far out.

use super::NewtonError;
use super::iterate::Run;
use crate::judge::{Columns, Point, ROUNDING};
use crate::sparse::{Matrix, norm};

/// Part of x by which the point differs where derivatives are compared.
const BESIDE: f64 = 1.0 / 1024.0;

impl Run<'_> {
    /// Rounding of a residual as a part of the size of its terms.
    pub(super) fn floor(&self) -> f64 {
        8.0 * f64::EPSILON * (self.n as f64).sqrt().max(4.0)
    }

    /// A row whose constants are less than the rounding of its terms, where x₀ = x₁ and x₀ = x₁ + 1 look the same, although the rows that
    /// determine its unknowns are dependent or curved. Independent straight rows have a solution there, however far out it is. None where the
    /// user's absolute tolerance is met, which compares with nothing.
    ///
    /// `work.r` and the matrix belong to x; the matrix is overwritten where rows may be curved.
    pub(super) fn hidden_row(&mut self, jac: &mut Matrix, x: &[f64]) -> Result<Option<usize>, NewtonError> {
        let n = self.n;
        if norm(&self.work.r) <= self.options.absolute_tolerance {
            return Ok(None);
        }
        let tolerance = self.options.relative_tolerance.max(self.floor());
        let work = &mut *self.work;
        let point = Point {
            x: &x[..n],
            f: &work.r,
            jac: Columns::Long(jac.leading_columns(n)),
            rest: None,
            start: &[],
            typical: &[],
            sizes: None,
            lower: &[],
            upper: &[],
        };
        let (singular, distant) = work.judge.conceals(&point, tolerance);
        if singular.is_some() || distant.is_empty() {
            return Ok(singular);
        }
        let rows = distant.to_vec();
        let here: Vec<_> = jac.triplets().collect();
        let mut beside = x.to_vec();
        beside[..n].iter_mut().for_each(|v| *v -= BESIDE * *v);
        self.linearize(jac, &beside)?;
        let mut pairs = here.iter().zip(jac.values());
        // Written so that NaN differs.
        let curved = pairs.find(|((i, j, a), b)| {
            let is_same = (*a - **b).abs() <= ROUNDING * a.abs();
            *j < n && rows.binary_search(i).is_ok() && !is_same
        });
        Ok(curved.map(|((i, _, _), _)| *i))
    }
}
