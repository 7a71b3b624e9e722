//! Taylor expansions of traced maps, at points and enclosed over boxes.

use super::interval::{Interval, without_branches};
use super::series::{Coefficient, Series};
use super::{NonsmoothFunction, Traced};
use crate::piecewise::Expansions;
use crate::piecewise::expansion::TERMS;
use crate::piecewise::{PiecewiseSmooth, Selection};

pub(super) struct Expanded<'a, F>(pub(super) &'a Traced<F>);

impl<F: NonsmoothFunction> Expanded<'_, F> {
    /// The series of residuals and test functions for those of the variables.
    fn series<S: Coefficient, const K: usize>(
        &self,
        selection: &Selection,
        variable: impl FnMut(usize) -> Series<S, K>,
    ) -> [Vec<Series<S, K>>; 2] {
        let Self(map) = self;
        let x: Vec<Series<S, K>> = (0..map.num_vars()).map(variable).collect();
        let mut residual = vec![Series::from(0.0); map.num_residuals()];
        let mut tests = vec![Series::from(0.0); map.variables.len()];
        map.evaluate(Some(selection), &x, &mut residual, &mut tests);
        [residual, tests]
    }
}

/// The box |x − centre| ≤ radius in variable j.
fn side(centre: &[f64], radius: &[f64], j: usize) -> Interval {
    let component = |v: &[f64]| v.get(j).copied().unwrap_or(f64::NAN);
    Interval::ball(component(centre), component(radius))
}

impl<F: NonsmoothFunction> Expansions for Expanded<'_, F> {
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]) {
        let coefficient = |j: usize, k: usize| arc.get(k).and_then(|a| a.get(j)).copied().unwrap_or(0.0);
        let variable = |j| Series::<f64, TERMS>(std::array::from_fn(|k| coefficient(j, k)));
        let found = self.series(selection, variable);
        for (out, found) in [residual, tests].into_iter().zip(found) {
            for (out, series) in out.chunks_exact_mut(TERMS).zip(found) {
                out.copy_from_slice(&series.0);
            }
        }
    }

    fn jacobian_within(
        &self,
        selection: &Selection,
        centre: &[f64],
        radius: &[f64],
        jacobian: &mut [(f64, f64)],
        tests: &mut [(f64, f64)],
    ) -> bool {
        let m = self.0.num_vars();
        let column = |column: usize| {
            let slope = |j: usize| Interval::from(if j == column { 1.0 } else { 0.0 });
            without_branches(|| self.series(selection, |j| Series([side(centre, radius, j), slope(j)])))
        };
        let outputs = &mut [jacobian, tests];
        (0..m).all(|j| {
            column(j).is_some_and(|found| {
                let mut rows = outputs.iter_mut().zip(found).flat_map(|(out, found)| {
                    let column = out.iter_mut().skip(j).step_by(m);
                    column.zip(found).map(|(out, Series([_, slope]))| {
                        *out = slope.ends();
                        !slope.is_undefined()
                    })
                });
                rows.all(|defined| defined)
            })
        })
    }

    fn derivatives_within(
        &self,
        selection: &Selection,
        centre: &[f64],
        radius: &[f64],
        direction: &[f64],
        residual: &mut [(f64, f64)],
        tests: &mut [(f64, f64)],
    ) -> bool {
        let variable = |j: usize| {
            let mut line = Series::<Interval, TERMS>::from(0.0);
            line.0[0] = side(centre, radius, j);
            line.0[1] = Interval::from(direction.get(j).copied().unwrap_or(f64::NAN));
            line
        };
        let Some(found) = without_branches(|| self.series(selection, variable)) else {
            return false;
        };
        let mut defined = true;
        for (out, found) in [residual, tests].into_iter().zip(found) {
            let coefficients = found.into_iter().flat_map(|series| series.0);
            for (out, coefficient) in out.iter_mut().zip(coefficients) {
                *out = coefficient.ends();
                defined &= !coefficient.is_undefined();
            }
        }
        defined
    }
}
