use std::sync::OnceLock;

use super::{Mcp, McpFunction};
use crate::piecewise::is_ordinary;
use crate::sparse::{Matrix, Pattern};

/// Units of x and F(x), determined on first use.
#[derive(Debug, Clone, Default)]
pub(super) struct Units(OnceLock<Found>);

#[derive(Debug, Clone)]
struct Found {
    /// Factors by which values of F are brought to the size of x; empty for 1.
    factors: Vec<f64>,
    /// Typical size of x; 1 where it is not known, as in problems that are not affine.
    size: f64,
}

impl PartialEq for Units {
    /// Derived from the problem, so that it does not count in comparisons.
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

impl<F: McpFunction> Mcp<F> {
    fn units(&self) -> &Found {
        self.units.0.get_or_init(|| {
            find_units(
                self.function(),
                self.jacobian_pattern(),
                self.lower(),
                self.upper(),
            )
        })
    }

    /// The factor of component i, which makes min(x, F) independent of the units of the two.
    pub(super) fn factor(&self, i: usize) -> f64 {
        self.units().factors.get(i).copied().unwrap_or(1.0)
    }

    pub(super) fn size(&self) -> f64 {
        self.units().size
    }
}

fn find_units(function: &dyn McpFunction, pattern: &Pattern, lower: &[f64], upper: &[f64]) -> Found {
    let n = lower.len();
    let mut found = Found {
        factors: Vec::new(),
        size: 1.0,
    };
    if !function.is_affine() {
        found.factors = far_from_one(&slopes(function, pattern, lower, upper));
        return found;
    }
    let origin = vec![0.0; function.num_vars()];
    let mut jac = Matrix::zeros(pattern.clone());
    function.jacobian(&origin, &mut jac);
    let mut offset = vec![0.0; n];
    function.value(&origin, &mut offset);
    let (mut rows, mut rates) = (vec![0.0_f64; n], vec![0.0_f64; n]);
    for (i, j, v) in jac.triplets() {
        let to = if j < n { &mut rows } else { &mut rates };
        to[i] = to[i].max(v.abs());
    }
    let mut factors: Vec<f64> = rows.iter().map(|row| reciprocal(*row)).collect();
    let shift = |v: &[f64]| {
        let seen = factors.iter().zip(v).zip(&rows).filter(|e| *e.1 > 0.0);
        seen.fold(0.0_f64, |a, ((f, v), _)| a.max(f * v.abs()))
    };
    let bound = lower
        .iter()
        .chain(upper)
        .filter(|b| b.is_finite())
        .fold(0.0_f64, |a, b| a.max(b.abs()));
    let size = shift(&offset).max(shift(&rates)).max(bound);
    if size.is_normal() {
        found.size = size;
    }
    // Values of F that do not depend on x: what they change by over a unit of the parameter, or what they are, becomes that size.
    for (i, factor) in factors.iter_mut().enumerate().filter(|e| rows[e.0] == 0.0) {
        let own = if rates[i] > 0.0 { rates[i] } else { offset[i].abs() };
        if own.is_normal() && (found.size / own).is_normal() {
            *factor = found.size / own;
        }
    }
    found.factors = far_from_one(&factors);
    found
}

/// For each component of a nonlinear F, the reciprocal of its largest slope at the points within the bounds nearest to 0 and 1, that by the
/// parameter where it does not depend on x; 1 where F has no finite derivatives there.
fn slopes(function: &dyn McpFunction, pattern: &Pattern, lower: &[f64], upper: &[f64]) -> Vec<f64> {
    let (n, m) = (lower.len(), function.num_vars());
    let (mut rows, mut rates) = (vec![0.0_f64; n], vec![0.0_f64; n]);
    let mut jac = Matrix::zeros(pattern.clone());
    for reference in [0.0_f64, 1.0] {
        let mut x = vec![reference; m];
        for (x, (lower, upper)) in x.iter_mut().zip(lower.iter().zip(upper)) {
            *x = x.max(*lower).min(*upper);
        }
        jac.clear();
        function.jacobian(&x, &mut jac);
        for (i, j, v) in jac.triplets().filter(|e| e.2.is_finite()) {
            let to = if j < n { &mut rows } else { &mut rates };
            to[i] = to[i].max(v.abs());
        }
    }
    let both = rows.iter().zip(&rates);
    both.map(|(row, rate)| reciprocal(if *row > 0.0 { *row } else { *rate }))
        .collect()
}

fn reciprocal(size: f64) -> f64 {
    if size.is_normal() { size.recip() } else { 1.0 }
}

/// The factors as powers of two; none where all are near 1.
fn far_from_one(factors: &[f64]) -> Vec<f64> {
    if factors.iter().all(|f| is_ordinary(*f)) {
        return Vec::new();
    }
    factors.iter().map(|f| f.log2().round().exp2()).collect()
}
