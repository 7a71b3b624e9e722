//! Whether the conditions of an affine problem are contradictory, in exact arithmetic.

use crate::exact::{Exact, contradict};
use crate::judge::slack;
use crate::sparse::Matrix;

/// Before a certificate is tried itself, its entries are rounded to multiples of this part of the smallest one.
const GRAIN: f64 = 1.0 / 1024.0;

/// The problem of F = M x + q with its bounds. Every solution has Fᵢ ≥ 0 where xᵢ has a lower bound only, Fᵢ ≤ 0 where it has an upper
/// one only, Fᵢ = 0 where it has none, and any Fᵢ where it has both.
pub(super) struct Conditions<'a> {
    pub(super) matrix: &'a Matrix,
    pub(super) q: &'a [f64],
    pub(super) lower: &'a [f64],
    pub(super) upper: &'a [f64],
}

/// The condition on F at a solution: sign · F ≥ 0, or F = 0.
#[derive(Clone, Copy, PartialEq)]
enum Asked {
    Sign(f64),
    Zero,
    Nothing,
}

impl Conditions<'_> {
    /// Whether no point satisfies the conditions, with the matrix taken as exact and q and bounds up to their [`slack`], given a certificate
    /// `v` that is right up to rounding. With many unknowns (more than 5 000 numbers, zeros counted) `v` is accepted only if it is right with its entries
    /// rounded to simple ratios.
    pub(super) fn contradict(&self, v: &[f64]) -> bool {
        let asked = |i: &usize| self.asked(*i) != Asked::Nothing;
        let named: Vec<usize> = (0..v.len()).filter(|&i| v[i] != 0.0).filter(asked).collect();
        if self.contradict_among(&named) == Some(true) {
            return true;
        }
        let all: Vec<usize> = (0..v.len()).filter(asked).collect();
        self.contradict_among(&all).unwrap_or_else(|| self.refuted_by(v))
    }

    fn asked(&self, i: usize) -> Asked {
        match (self.lower[i].is_finite(), self.upper[i].is_finite()) {
            (true, true) => Asked::Nothing,
            (true, false) => Asked::Sign(1.0),
            (false, true) => Asked::Sign(-1.0),
            (false, false) => Asked::Zero,
        }
    }

    /// As [`contradict`](Self::contradict) for the conditions on F of some rows. Unknowns are the distances from a bound where there is
    /// one.
    fn contradict_among(&self, rows: &[usize]) -> Option<bool> {
        let n = self.q.len();
        let (zero, inequalities): (Vec<usize>, Vec<usize>) =
            rows.iter().partition(|i| self.asked(**i) == Asked::Zero);
        let mut entries = vec![Vec::new(); n];
        self.matrix
            .triplets()
            .for_each(|(i, j, a)| entries[i].push((j, a)));
        // Its constant moves with q, and with the bounds that unknowns are measured from.
        let give = |i: usize| {
            let bounds = entries[i]
                .iter()
                .map(|&(j, a)| &exact(a).abs() * &exact(slack(self.origin(j).0)));
            bounds.fold(exact(slack(self.q[i])), |sum, give| &sum + &give)
        };
        let row = |i: usize, sign: f64| {
            let mut constant = &exact(sign * self.q[i]) + &give(i);
            let mut coefficients = vec![Exact::default(); n];
            for &(j, a) in &entries[i] {
                let (from, way) = self.origin(j);
                coefficients[j] = exact(sign * way * a);
                constant = &constant + &(&exact(sign * a) * &exact(from));
            }
            (constant, coefficients)
        };
        let (equations, loose): (Vec<usize>, Vec<usize>) = zero.iter().partition(|i| give(**i).is_zero());
        let both = |j: &usize| self.asked(*j) == Asked::Nothing;
        let width = |j: usize| {
            let mut coefficients = vec![Exact::default(); n];
            coefficients[j] = exact(-1.0);
            let (lower, upper) = (self.lower[j], self.upper[j]);
            let give = &exact(slack(lower)) + &exact(slack(upper));
            (&(&exact(upper) - &exact(lower)) + &give, coefficients)
        };
        let signed: Vec<usize> = (0..n).filter(|j| self.asked(*j) != Asked::Zero).collect();
        let sign = |i: usize| match self.asked(i) {
            Asked::Sign(sign) => sign,
            _ => 1.0,
        };
        let forms = equations.iter().map(|&i| row(i, 1.0));
        let forms = forms.chain(loose.iter().flat_map(|&i| [row(i, 1.0), row(i, -1.0)]));
        let forms = forms.chain(inequalities.iter().map(|&i| row(i, sign(i))));
        let widths = (0..n).filter(both).map(width);
        contradict(n, &signed, equations.len(), forms.chain(widths))
    }

    /// The bound from which an unknown is measured, and in which direction.
    fn origin(&self, j: usize) -> (f64, f64) {
        match self.asked(j) {
            Asked::Zero => (0.0, 1.0),
            Asked::Sign(sign) if sign < 0.0 => (self.upper[j], -1.0),
            _ => (self.lower[j], 1.0),
        }
    }

    /// Whether sup vᵀF over the bounds is negative for v, a recession direction of the box, with rounded entries.
    fn refuted_by(&self, v: &[f64]) -> bool {
        let nonzero = v.iter().map(|v| v.abs()).filter(|v| *v > 0.0);
        let grain = GRAIN * nonzero.fold(f64::INFINITY, f64::min);
        let v: Vec<Exact> = v.iter().map(|v| exact((v / grain).round())).collect();
        let (mut sup, mut slopes) = (Exact::default(), vec![Exact::default(); v.len()]);
        for (q, v) in self.q.iter().zip(&v) {
            sup = &(&sup + &(&exact(*q) * v)) + &(&exact(slack(*q)) * &v.abs());
        }
        for (i, j, a) in self.matrix.triplets() {
            slopes[j] = &slopes[j] + &(&exact(a) * &v[i]);
        }
        for (j, slope) in slopes.iter().enumerate().filter(|s| !s.1.is_zero()) {
            let bound = if slope.sign() > 0 {
                self.upper[j]
            } else {
                self.lower[j]
            };
            if !bound.is_finite() {
                return false;
            }
            sup = &(&sup + &(slope * &exact(bound))) + &(&exact(slack(bound)) * &slope.abs());
        }
        sup.sign() < 0
    }
}

/// Of a number that is finite.
fn exact(v: f64) -> Exact {
    Exact::new(v).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// F = (11 x₀, q₁ − 8 x₀) with bounds 0 ≤ x₀ ≤ u, 0 ≤ x₁: 8 F₀ + 11 F₁ = 11 q₁ and 8 F₀ + 10 F₁ = 10 q₁ + 8 x₀.
    #[test]
    fn certificates_are_right_with_simple_ratios_or_not_believed() {
        let matrix = Matrix::from_rows(&[[11.0, 0.0], [-8.0, 0.0]]).unwrap();
        let inf = f64::INFINITY;
        for (v, constant, upper, refuted) in [
            ([8.0, 11.0], -1.0, inf, true),
            ([8.0, 11.0], 1.0, inf, false),
            ([8.0, 11.0], 0.0, inf, false),
            ([8.0, 10.0], -1.0, inf, false),
            ([8.0, 10.0], -1.0, 2.0, false),
            ([8.0, 10.0], -1.0, 1.0, true),
        ] {
            let conditions = Conditions {
                matrix: &matrix,
                q: &[0.0, constant],
                lower: &[0.0; 2],
                upper: &[upper, inf],
            };
            let rounded = [v[0] * (1.0 + 1e-10), v[1] * (1.0 - 1e-10)];
            assert_eq!(
                conditions.refuted_by(&rounded),
                refuted,
                "{v:?} {constant} {upper}"
            );
        }
    }
}
