//! Whether rows of a polyhedron contradict each other, in exact arithmetic.

use super::Polyhedron;
use super::polyhedron::Rows;
use super::projection::Multipliers;
use crate::exact::{Dictionary, Exact};

/// Most entries of the rows, columns counted in full: below, integers stay short enough for a fraction of a second.
const MAX_ENTRIES: usize = 5_000;

/// Whether the constraints with multipliers, or all of them, have no common point as their floating-point numbers state them; `None`
/// where there are too many to tell.
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
    let count = a.len() + e.len() + lower.len() + upper.len();
    if count.saturating_mul(n + 1) > MAX_ENTRIES {
        return None;
    }
    // Right-hand side less the row: zero for equations, not negative for all others.
    let row = |rows: &Rows, i: usize| -> Option<(Exact, Vec<Exact>)> {
        let mut coefficients = vec![Exact::default(); n];
        for (j, v) in rows.row(i) {
            coefficients[j] = -&Exact::new(v)?;
        }
        Some((Exact::new(rows.right[i])?, coefficients))
    };
    let bound = |j: usize, value: f64, sign: f64| -> Option<(Exact, Vec<Exact>)> {
        let mut coefficients = vec![Exact::default(); n];
        coefficients[j] = Exact::new(sign)?;
        Some((Exact::new(-sign * value)?, coefficients))
    };
    let mut forms = Vec::with_capacity(count);
    for &i in e {
        forms.push(row(&set.e, i)?);
    }
    for &i in a {
        forms.push(row(&set.a, i)?);
    }
    for &j in lower {
        forms.push(bound(j, set.lower[j], 1.0)?);
    }
    for &j in upper {
        forms.push(bound(j, set.upper[j], -1.0)?);
    }
    let mut dictionary = Dictionary::new(n, forms.iter().map(|(c, r)| (c, r.as_slice())));
    let mut consistent = (0..e.len()).all(|var| dictionary.fix(var).is_ok());
    consistent = consistent && (e.len()..count).all(|var| dictionary.constrain(var, 1).is_ok());
    Some(!(consistent && dictionary.repair().is_ok()))
}
