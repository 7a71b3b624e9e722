//! Constraints of one unknown as limits on it.

use super::multipliers::Kind;
use super::polyhedron::Rows;
use super::{Multipliers, Polyhedron};

/// A limit of one unknown: right-hand side over coefficient.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    pub(super) at: f64,
    pub(super) coefficient: f64,
    pub(super) kind: Kind,
}

impl Limit {
    /// Gives the constraint a multiplier by which its coefficient becomes |coefficient| · factor.
    pub(super) fn weigh(&self, unknown: usize, factor: f64, multipliers: &mut Multipliers) {
        match self.kind {
            Kind::Equation(i) => multipliers.equations[i] = factor * self.coefficient.signum(),
            Kind::Inequality(i) => multipliers.inequalities[i] = factor.abs(),
            Kind::Lower(_) | Kind::Upper(_) | Kind::Fixed(_) if factor < 0.0 => {
                multipliers.lower[unknown] = -factor;
            }
            Kind::Lower(_) | Kind::Upper(_) | Kind::Fixed(_) => multipliers.upper[unknown] = factor,
        }
    }
}

/// The limits that a constraint puts on an unknown if it has no other: from below (side 0), from above (side 1).
pub(super) fn limits_of(set: &Polyhedron, kind: Kind) -> [Option<(usize, usize, Limit)>; 2] {
    let limit = |j: usize, side: usize, coefficient: f64, right: f64| {
        let at = right / coefficient;
        Some((
            j,
            side,
            Limit {
                at,
                coefficient,
                kind,
            },
        ))
    };
    let single = |rows: &Rows, i: usize| {
        let mut entries = rows.row(i).filter(|e| e.1 != 0.0);
        entries.next().filter(|_| entries.next().is_none())
    };
    match kind {
        Kind::Equation(i) => single(&set.e, i).map_or([None; 2], |(j, v)| {
            let right = set.e.right[i];
            [limit(j, 0, v, right), limit(j, 1, v, right)]
        }),
        Kind::Inequality(i) => single(&set.a, i).map_or([None; 2], |(j, v)| {
            [limit(j, usize::from(v > 0.0), v, set.a.right[i]), None]
        }),
        Kind::Lower(j) => [limit(j, 0, 1.0, set.lower[j]), None],
        Kind::Upper(j) => [limit(j, 1, 1.0, set.upper[j]), None],
        Kind::Fixed(j) => [limit(j, 0, 1.0, set.lower[j]), limit(j, 1, 1.0, set.upper[j])],
    }
}
