//! Whether rows of a polyhedron contradict each other, in exact arithmetic.

use super::Polyhedron;
use super::polyhedron::Rows;
use super::projection::Multipliers;
use crate::exact::{self, Exact};

/// Whether the constraints with multipliers, or all of them, have no common point with their floating-point data taken as exact; `None`
/// where there are too many to decide.
pub(super) fn is_empty(set: &Polyhedron, multipliers: &Multipliers) -> Option<bool> {
    let m = multipliers;
    let among = |factors: &[f64]| -> Vec<usize> {
        let indices = factors.iter().enumerate();
        indices.filter(|(_, f)| **f != 0.0).map(|(i, _)| i).collect()
    };
    let named = [&m.inequalities, &m.equations, &m.lower, &m.upper].map(|factors| among(factors));
    if contradict(set, &named)? {
        return Some(true);
    }
    let finite = |bounds: &[f64]| (0..bounds.len()).filter(|&j| bounds[j].is_finite()).collect();
    let all = [
        (0..set.a.len()).collect(),
        (0..set.e.len()).collect(),
        finite(&set.lower),
        finite(&set.upper),
    ];
    contradict(set, &all)
}

/// As [`is_empty`] for the given inequalities, equations, lower and upper bounds.
fn contradict(set: &Polyhedron, [a, e, lower, upper]: &[Vec<usize>; 4]) -> Option<bool> {
    let n = set.dimension();
    // Floating-point numbers of a polyhedron are finite.
    let number = |v: f64| Exact::new(v).unwrap_or_default();
    // Right-hand side less the row: zero for equations, not negative for all others.
    let row = |rows: &Rows, i: usize| {
        let mut coefficients = vec![Exact::default(); n];
        rows.row(i).for_each(|(j, v)| coefficients[j] = number(-v));
        (number(rows.right[i]), coefficients)
    };
    let bound = |j: usize, value: f64, sign: f64| {
        let mut coefficients = vec![Exact::default(); n];
        coefficients[j] = number(sign);
        (number(-sign * value), coefficients)
    };
    let rows = e.iter().map(|&i| row(&set.e, i));
    let rows = rows.chain(a.iter().map(|&i| row(&set.a, i)));
    let lower = lower.iter().map(|&j| bound(j, set.lower[j], 1.0));
    let upper = upper.iter().map(|&j| bound(j, set.upper[j], -1.0));
    exact::contradict(n, &[], e.len(), rows.chain(lower).chain(upper))
}
