//! Taylor expansions of traced maps.

use super::series::Series;
use super::{NonsmoothFunction, Traced};
use crate::piecewise::expansion::{Expansions, TERMS};
use crate::piecewise::{PiecewiseSmooth, Selection};

impl<F: NonsmoothFunction> Expansions for Traced<F> {
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]) {
        let coefficient = |j: usize, k: usize| arc.get(k).and_then(|a| a.get(j)).copied().unwrap_or(0.0);
        let x: Vec<Series<f64, TERMS>> = (0..self.num_vars())
            .map(|j| Series(std::array::from_fn(|k| coefficient(j, k))))
            .collect();
        let zero = Series::from(0.0);
        let mut values = vec![zero; self.num_residuals()];
        let mut thetas = vec![zero; self.variables.len()];
        self.evaluate(Some(selection), &x, &mut values, &mut thetas);
        for (out, found) in [(residual, values), (tests, thetas)] {
            for (out, series) in out.chunks_exact_mut(TERMS).zip(found) {
                out.copy_from_slice(&series.0);
            }
        }
    }
}
