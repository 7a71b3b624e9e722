//! Whether rows of a polyhedron contradict each other, in exact arithmetic.

use super::polyhedron::Rows;
use super::{Multipliers, Polyhedron};
use crate::exact::{self, Exact};
use crate::judge::{Emptiness, slack};

/// Whether the constraints with multipliers, or all of them, have no common point, with their coefficients taken as exact; `None` where
/// there are too many to decide.
pub(super) fn emptiness(set: &Polyhedron, multipliers: &Multipliers) -> Option<Emptiness> {
    let m = multipliers;
    let among = |factors: &[f64]| -> Vec<usize> {
        let indices = factors.iter().enumerate();
        indices.filter(|(_, f)| **f != 0.0).map(|(i, _)| i).collect()
    };
    let named = [&m.inequalities, &m.equations, &m.lower, &m.upper].map(|factors| among(factors));
    if contradict(set, &named, slack)? {
        return Some(Emptiness::Empty);
    }
    let finite = |bounds: &[f64]| (0..bounds.len()).filter(|&j| bounds[j].is_finite()).collect();
    let all = [
        (0..set.a.len()).collect(),
        (0..set.e.len()).collect(),
        finite(&set.lower),
        finite(&set.upper),
    ];
    Some(match () {
        () if contradict(set, &all, slack)? => Emptiness::Empty,
        () if contradict(set, &named, |_| 0.0)? || contradict(set, &all, |_| 0.0)? => {
            Emptiness::WithinRounding
        }
        () => Emptiness::Feasible,
    })
}

/// Whether the given inequalities, equations, lower and upper bounds have no common point although each constant may move by its slack.
fn contradict(
    set: &Polyhedron,
    [a, e, lower, upper]: &[Vec<usize>; 4],
    slack: fn(f64) -> f64,
) -> Option<bool> {
    let n = set.dimension();
    // Floating-point numbers of a polyhedron are finite.
    let number = |v: f64| Exact::new(v).unwrap_or_default();
    let loose = |v: f64, by: f64| &number(v) + &number(slack(by));
    // Right-hand side less the row, or the reverse: zero for equations, not negative for all others.
    let row = |rows: &Rows, i: usize, sign: f64| {
        let mut coefficients = vec![Exact::default(); n];
        rows.row(i).for_each(|(j, v)| coefficients[j] = number(-sign * v));
        (loose(sign * rows.right[i], rows.right[i]), coefficients)
    };
    let bound = |j: usize, value: f64, sign: f64| {
        let mut coefficients = vec![Exact::default(); n];
        coefficients[j] = number(sign);
        (loose(-sign * value, value), coefficients)
    };
    let (moving, fixed): (Vec<usize>, Vec<usize>) = e.iter().partition(|i| slack(set.e.right[**i]) > 0.0);
    let rows = fixed.iter().map(|&i| row(&set.e, i, 1.0));
    let rows = rows.chain(
        moving
            .iter()
            .flat_map(|&i| [row(&set.e, i, 1.0), row(&set.e, i, -1.0)]),
    );
    let rows = rows.chain(a.iter().map(|&i| row(&set.a, i, 1.0)));
    let lower = lower.iter().map(|&j| bound(j, set.lower[j], 1.0));
    let upper = upper.iter().map(|&j| bound(j, set.upper[j], -1.0));
    exact::contradict(n, &[], fixed.len(), rows.chain(lower).chain(upper))
}
