//! The natural map of an MCP as a piecewise-smooth map.

use std::borrow::Cow;

use super::{AffineFunction, Mcp, McpFunction};
use crate::exact::passive_bounds;
use crate::piecewise::{
    Derivatives, Description, Exact, ExactConditions, ExactForm, ExactPiece, ExactPieces, ExactSite, Facet,
    PiecewiseSmooth, Selection, Structure,
};
use crate::sparse::{Matrix, Pattern};

/// The pieces of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Piece {
    Lower,
    Interior,
    Upper,
    Fixed,
}

/// The pieces of a component with these bounds.
pub(super) fn pieces(l: f64, u: f64) -> &'static [Piece] {
    use Piece::{Fixed, Interior, Lower, Upper};
    match (l.is_finite(), u.is_finite()) {
        (true, true) if l == u => &[Fixed],
        (true, true) => &[Lower, Interior, Upper],
        (true, false) => &[Lower, Interior],
        (false, true) => &[Interior, Upper],
        (false, false) => &[Interior],
    }
}

impl<F: McpFunction> Mcp<F> {
    fn pieces_of(&self, i: usize) -> &'static [Piece] {
        pieces(self.lower()[i], self.upper()[i])
    }

    fn piece(&self, selection: &Selection, i: usize) -> Piece {
        let pieces = self.pieces_of(i);
        pieces[selection.piece(i).min(pieces.len() - 1)]
    }

    /// Calls `with(position, i, bound)` for each test function xᵢ − Fᵢ − bound.
    pub(super) fn each_test(&self, mut with: impl FnMut(usize, usize, f64)) {
        let mut k = 0;
        for i in 0..self.len() {
            let (l, u) = (self.lower()[i], self.upper()[i]);
            if l == u {
                continue;
            }
            for bound in [l, u] {
                if bound.is_finite() {
                    with(k, i, bound);
                    k += 1;
                }
            }
        }
    }

    fn jacobian_at(&self, x: &[f64]) -> Matrix {
        let mut jac = Matrix::zeros(self.jacobian_pattern().clone());
        self.function().jacobian(x, &mut jac);
        jac
    }
}

impl<F: McpFunction> PiecewiseSmooth for Mcp<F> {
    fn num_vars(&self) -> usize {
        self.function().num_vars()
    }

    fn num_residuals(&self) -> usize {
        self.len()
    }

    fn num_sites(&self) -> usize {
        self.len()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.pieces_of(site).len()
    }

    fn num_tests(&self, site: usize) -> usize {
        self.pieces_of(site).len() - 1
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        const BELOW: [Facet; 1] = [Facet::negative(0)];
        const ABOVE: [Facet; 1] = [Facet::positive(0)];
        const BETWEEN: [Facet; 2] = [Facet::positive(0), Facet::negative(1)];
        const ABOVE_BOTH: [Facet; 1] = [Facet::positive(1)];
        let pieces = self.pieces_of(site);
        match (pieces[piece.min(pieces.len() - 1)], pieces) {
            (_, [_]) => &[],
            (Piece::Lower, _) | (Piece::Interior, [Piece::Interior, ..]) => &BELOW,
            (Piece::Interior, [_, _]) | (Piece::Upper, [_, _]) => &ABOVE,
            (Piece::Upper, _) => &ABOVE_BOTH,
            _ => &BETWEEN,
        }
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let mut f = vec![0.0; self.len()];
        self.function().value(x, &mut f);
        self.each_test(|k, i, bound| out[k] = (x[i] - bound) - self.factor(i) * f[i]);
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        self.function().value(x, out);
        for i in 0..self.len() {
            match self.piece(selection, i) {
                Piece::Interior => out[i] *= self.factor(i),
                Piece::Lower | Piece::Fixed => out[i] = x[i] - self.lower()[i],
                Piece::Upper => out[i] = x[i] - self.upper()[i],
            }
        }
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        self.function().jacobian(x, jac);
        let pattern = jac.pattern().clone();
        let at_bound = |i: usize| self.piece(selection, i) != Piece::Interior;
        for j in 0..pattern.ncols() {
            for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[k];
                let value = &mut jac.values_mut()[k];
                if at_bound(i) {
                    *value = f64::from(u8::from(i == j));
                } else {
                    *value *= self.factor(i);
                }
            }
        }
    }

    fn pattern(&self) -> Pattern {
        self.jacobian_pattern().clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.function().is_affine()
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }

    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }

    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl<F: McpFunction> Derivatives for Mcp<F> {
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let mut jd = vec![0.0; self.len()];
        self.jacobian_at(x).mul_vec(d, &mut jd);
        self.each_test(|k, i, _| out[k] = d[i] - self.factor(i) * jd[i]);
    }

    fn test_gradient(&self, site: usize, _test: usize, x: &[f64], gradient: &mut [f64]) {
        let jac = self.jacobian_at(x);
        for j in 0..gradient.len() {
            gradient[j] = f64::from(u8::from(j == site)) - self.factor(site) * jac.get(site, j);
        }
    }
}

impl<F: McpFunction> Structure for Mcp<F> {
    fn exact(&self) -> Option<&dyn ExactPieces> {
        // With one parameter at most.
        let is_stated =
            self.function().num_vars() <= self.len() + 1 && self.function().coefficients().is_some();
        is_stated.then_some(self)
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(site);
    }
}

impl<F: McpFunction> Description for Mcp<F> {
    /// One size for all unknowns of an affine problem; 1 for others, whose size is unknown.
    fn typical_sizes(&self, sizes: &mut [f64]) {
        let n = self.len();
        sizes[..n].fill(self.size());
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        let pieces = self.pieces_of(site);
        Cow::Borrowed(match pieces[piece.min(pieces.len() - 1)] {
            Piece::Lower => "lower",
            Piece::Interior => "interior",
            Piece::Upper => "upper",
            Piece::Fixed => "fixed",
        })
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(self.name(site))
    }
}

/// An affine problem with exact data.
struct Stated<'a> {
    function: &'a AffineFunction,
    /// The value of the parameter, where it is fixed.
    fixed: Option<f64>,
    lower: &'a [f64],
    upper: &'a [f64],
}

impl Stated<'_> {
    /// F(x) at a parameter, row by row.
    fn values(&self, alpha: f64) -> Option<Vec<ExactForm>> {
        let (n, alpha) = (self.lower.len(), Exact::new(self.fixed.unwrap_or(alpha))?);
        let mut values = vec![ExactForm::zero(n); n];
        for (value, q) in values.iter_mut().zip(self.function.q()) {
            value.constant = Exact::new(*q)?;
        }
        for (i, j, v) in self.function.matrix().triplets() {
            let v = Exact::new(v)?;
            if j < n {
                values[i].coefficients[j] = &values[i].coefficients[j] + &v;
            } else {
                values[i].constant = &values[i].constant + &(&alpha * &v);
            }
        }
        Some(values)
    }

    /// Bounds of solutions: those of the box, or for LCPs with a positive definite matrix those that xᵀF(x) = 0 gives.
    fn bounds(&self, values: &[ExactForm]) -> Vec<Option<Exact>> {
        let boxed = |(l, u): (&f64, &f64)| Exact::new(l.abs().max(u.abs()));
        let bounds: Vec<Option<Exact>> = self.lower.iter().zip(self.upper).map(boxed).collect();
        let standard = self.lower.iter().all(|l| *l == 0.0);
        if bounds.iter().all(Option::is_some) || !standard {
            return bounds;
        }
        if self.upper.iter().any(|u| u.is_finite()) {
            return bounds;
        }
        let rows: Vec<_> = values
            .iter()
            .map(|f| (&f.constant, f.coefficients.as_slice()))
            .collect();
        passive_bounds(&rows).map_or(bounds, |b| b.into_iter().map(Some).collect())
    }

    /// x between its bounds, F(x) with the sign that belongs to the bound reached.
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        /// The forms of a component, in their order.
        #[derive(Clone, Copy)]
        enum Form {
            Value,
            OverLower,
            OverUpper,
        }
        use Form::{OverLower, OverUpper, Value};
        let places = |facets: &[(Form, i8)]| {
            facets
                .iter()
                .map(|(form, sign)| (*form as usize, *sign))
                .collect()
        };
        let n = self.lower.len();
        let values = self.values(alpha)?;
        let over = |i: usize, bound: f64| {
            let bound = Exact::new(bound).unwrap_or_default();
            ExactForm::unknown(n, i, -&bound)
        };
        let site = |i: usize| {
            let (l, u) = (self.lower[i], self.upper[i]);
            let (below, above) = (l.is_finite(), u.is_finite());
            let mut inside = Vec::new();
            if below {
                inside.push((OverLower, 1));
            }
            if above {
                inside.push((OverUpper, -1));
            }
            let conditions = |piece: &Piece| match piece {
                Piece::Lower => (OverLower, vec![(Value, 1)]),
                Piece::Interior => (Value, inside.clone()),
                Piece::Upper => (OverUpper, vec![(Value, -1)]),
                Piece::Fixed => (OverLower, Vec::new()),
            };
            let own = pieces(l, u).iter().enumerate();
            let own = own.map(|(piece, kind)| {
                let (form, facets) = conditions(kind);
                ExactPiece {
                    piece,
                    equalities: vec![(i, form as usize)],
                    facets: places(&facets),
                }
            });
            let mut implied = inside.clone();
            if below != above {
                implied.push((Value, if below { 1 } else { -1 }));
            }
            ExactSite {
                forms: vec![values[i].clone(), over(i, l), over(i, u)],
                pieces: own.collect(),
                implied: places(&implied),
            }
        };
        Some(ExactConditions {
            unknowns: n,
            common: Vec::new(),
            bounds: self.bounds(&values),
            sites: (0..n).map(site).collect(),
        })
    }
}

impl<F: McpFunction> ExactPieces for Mcp<F> {
    fn is_affine_in_parameter(&self) -> bool {
        true
    }

    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let (function, fixed) = self.function().coefficients()?;
        let (lower, upper) = (self.lower(), self.upper());
        let stated = Stated {
            function,
            fixed,
            lower,
            upper,
        };
        stated.conditions(alpha)
    }
}

#[cfg(test)]
mod tests {
    use super::super::problem::natural;
    use super::*;
    use crate::piecewise::check::{CheckOptions, check};
    use crate::piecewise::value;

    /// Unknowns scale with constants and bounds; without constants the bounds alone give their size.
    #[test]
    fn typical_sizes_grow_with_constants_and_bounds() {
        for (constant, bound) in [(0.0, 7.0), (1.0, 7.0), (30.0, 0.5)] {
            let size = |c: f64| {
                let matrix = Matrix::from_rows(&[[2.0, 1.0], [1.0, 4.0]]).unwrap();
                let f = AffineFunction::new(matrix, vec![c * constant, -c * constant]).unwrap();
                let lower = vec![0.0, -c * bound];
                let mcp = Mcp::new(f, lower, vec![f64::INFINITY; 2]).unwrap();
                let mut sizes = [0.0; 2];
                mcp.typical_sizes(&mut sizes);
                assert_eq!(sizes[0], sizes[1]);
                sizes[0]
            };
            for c in [1e-9, 1e9] {
                assert!(
                    (size(c) / c - size(1.0)).abs() < 1e-12,
                    "{constant} {bound} {c:e}"
                );
            }
        }
    }

    #[test]
    fn keeps_the_contract_for_all_kinds_of_bounds() {
        let inf = f64::INFINITY;
        let rows: Vec<Vec<f64>> = (0..5)
            .map(|i| {
                (0..5)
                    .map(|j| ((i * 7 + j * 3) % 5) as f64 - 1.5 + 4.0 * f64::from(u8::from(i == j)))
                    .collect()
            })
            .collect();
        let f =
            AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![1.0, -2.0, 0.5, 3.0, -1.0]).unwrap();
        let lower = vec![0.0, -inf, -1.0, -inf, 2.0];
        let upper = vec![inf, 1.0, 1.0, inf, 2.0];
        let mcp = Mcp::new(f, lower.clone(), upper.clone()).unwrap();
        let points: Vec<Vec<f64>> = (0..20)
            .map(|k| {
                (0..5)
                    .map(|i| ((k * 13 + i * 5) % 11) as f64 * 0.4 - 2.0)
                    .collect()
            })
            .collect();
        for x in &points {
            let (mut a, mut f) = (vec![0.0; 5], vec![0.0; 5]);
            value(&mcp, x, &mut a);
            mcp.function().value(x, &mut f);
            for i in 0..5 {
                let mid = (x[i] - f[i]).max(lower[i]).min(upper[i]);
                assert!((a[i] - (x[i] - mid)).abs() < 1e-12);
                assert!((natural(x[i], lower[i], upper[i], f[i]) - a[i]).abs() < 1e-12);
            }
        }
        check(&mcp, &points, &CheckOptions::default()).unwrap();
    }
}
