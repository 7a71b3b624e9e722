//! Proofs hold for the coefficients that a map states. The points and directions found are compared with the map itself.

use super::lists::{Completeness, Doubt, SolutionSet};
use crate::clock::Deadline;
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::sparse::Matrix;

/// Residuals above this part of their terms contradict a solution. Listed coordinates have eight digits, in the units of the statement and
/// relative to the largest of the point.
const CONTRADICTION: f64 = 1e-5;

/// Compares points and directions with the pieces of a map.
pub(super) struct Comparison<'a> {
    map: &'a dyn PiecewiseSmooth,
    /// Sizes of the unknowns y.
    units: Vec<f64>,
    jac: Matrix,
    values: Vec<f64>,
    terms: Vec<f64>,
    residual: Vec<f64>,
}

impl<'a> Comparison<'a> {
    /// `units` of the unknowns of the statement; those of the map come first.
    pub(super) fn new(map: &'a dyn PiecewiseSmooth, mut units: Vec<f64>) -> Self {
        let n = map.num_residuals();
        units.truncate(n);
        Self {
            map,
            units,
            jac: Matrix::zeros(map.pattern()),
            values: vec![0.0; n],
            terms: vec![0.0; n],
            residual: vec![0.0; n],
        }
    }

    /// Whether H^(σ)(x) is not 0, by far more than rounding; `None` where its value is not finite.
    pub(super) fn at_point(&mut self, selection: &Selection, x: &[f64]) -> Option<bool> {
        // Constants of the map may cancel in numbers that it does not show: at least the size of those stated counts.
        self.linearise(selection, x, x, 1.0);
        self.map.residual(selection, x, &mut self.residual);
        // What is left of H without its linear part is the constant.
        for ((r, value), term) in self.residual.iter().zip(&self.values).zip(&mut self.terms) {
            *term += (r - value).abs();
        }
        let finite = self.residual.iter().all(|r| r.is_finite());
        finite.then(|| contradicts(&self.residual, &self.terms))
    }

    /// Whether ∇H^(σ)(x) d is not 0, by far more than rounding.
    pub(super) fn along(&mut self, selection: &Selection, x: &[f64], d: &[f64]) -> bool {
        self.linearise(selection, x, d, 0.0);
        contradicts(&self.values, &self.terms)
    }

    /// ∇H^(σ)(x) d, and the size of its terms where each unknown is as large as the largest in its unit, or `least`.
    fn linearise(&mut self, selection: &Selection, x: &[f64], d: &[f64], least: f64) {
        let largest = d
            .iter()
            .zip(&self.units)
            .map(|(d, u)| (d / u).abs())
            .fold(least, f64::max);
        self.jac.clear();
        self.map.jacobian(selection, x, &mut self.jac);
        self.values.fill(0.0);
        self.terms.fill(0.0);
        for (i, j, v) in self.jac.triplets() {
            self.values[i] += v * d[j];
            self.terms[i] += (v * self.units.get(j).map_or(d[j], |u| u * largest)).abs();
        }
    }
}

fn contradicts(values: &[f64], terms: &[f64]) -> bool {
    let mut rows = values.iter().zip(terms);
    rows.any(|(value, terms)| value.is_nan() || value.abs() > CONTRADICTION * terms)
}

/// Removes points and ends that are not finite; how many there were.
pub(super) fn drop_overflows(set: &mut SolutionSet) -> u64 {
    let finite = |x: &[f64]| x.iter().all(|v| v.is_finite());
    let points =
        |set: &SolutionSet| set.solutions.len() + set.continua.iter().map(|c| c.ends.len()).sum::<usize>();
    let before = points(set);
    set.solutions.retain(|s| finite(&s.x));
    for continuum in &mut set.continua {
        continuum.ends.retain(|x| finite(x));
        if !finite(&continuum.point) {
            continuum.point.clear();
        }
    }
    (before - points(set)) as u64
}

/// A list is not proven if some of its points do not solve the map, whose statement then is wrong, if some solutions are no floating-point
/// numbers, or if time is over before all of them are compared.
pub(super) fn doubt_contradictions(
    mut comparison: Comparison<'_>,
    set: &mut SolutionSet,
    deadline: Deadline<'_>,
) {
    let mut overflows = drop_overflows(set);
    let (mut wrong, mut late) = (0, false);
    for solution in &set.solutions {
        late = deadline.is_over();
        if late {
            break;
        }
        match comparison.at_point(&solution.selections[0], &solution.x) {
            Some(contradicts) => wrong += u64::from(contradicts),
            None => overflows += 1,
        }
    }
    let doubt = match (wrong, overflows, late) {
        (0, 0, false) => return,
        (0, 0, true) if !set.completeness.is_complete() => return,
        (0, 0, true) => Doubt::Limit,
        (0, ..) => Doubt::Overflow,
        _ => Doubt::Contradiction,
    };
    set.index_sum = None;
    if !matches!(set.completeness, Completeness::Incomplete { .. }) {
        set.completeness = Completeness::Undecided {
            selections: wrong + overflows,
            doubt,
        };
    }
}
