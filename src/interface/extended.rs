//! An interface problem whose load, traces and law have further parameters.

use std::borrow::Cow;

use super::evaluation::Scratch;
use super::{Interface, View};
use crate::linear::LinearError;
use crate::piecewise::{
    Derivatives, Description, Facet, PiecewiseSmooth, PiecewiseSmoothExt, Selection, Structure,
};
use crate::sparse::{Matrix, Pattern};

/// A u + Bᵀ λ + E θ = f(α), G(B u + T θ, λ, α, W θ) = 0 with the variables (u, λ, θ), or (u, λ, α, θ): parameters θ behind those of an
/// interface problem. In condensed form the variables begin with λ, and T is T − B A⁻¹ E.
#[derive(Debug, Clone)]
pub(crate) struct Extended<V, G> {
    /// The problem, with a law of 2q + 1 + m variables.
    base: Interface<V, G>,
    columns: Columns,
    law_pattern: Pattern,
    /// The load parameter, where it is no variable.
    alpha: Option<f64>,
    pattern: Pattern,
    affine: bool,
}

/// E (n × k), T (q × k) and W (m × k).
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    pub(crate) equilibrium: Matrix,
    pub(crate) traces: Matrix,
    pub(crate) law: Matrix,
    /// Whether they are the same at all solutions and parameters.
    pub(crate) constant: bool,
}

impl<V: View, G: PiecewiseSmooth> Extended<V, G> {
    /// `base` has a law with m variables more than its own pattern tells; the columns must fit.
    pub(crate) fn new(
        base: Interface<V, G>,
        columns: Columns,
        alpha: Option<f64>,
    ) -> Result<Self, LinearError> {
        let law_pattern = base.law.pattern();
        let affine = base.is_piecewise_affine() && columns.constant;
        let mut made = Self {
            base,
            columns,
            pattern: law_pattern.clone(),
            law_pattern,
            alpha,
            affine,
        };
        made.pattern = made.own_pattern()?;
        Ok(made)
    }

    pub(crate) fn base(&self) -> &Interface<V, G> {
        &self.base
    }

    fn num_parameters(&self) -> usize {
        self.columns.traces.ncols()
    }

    /// Number of variables before θ.
    fn own(&self) -> usize {
        self.num_residuals() + usize::from(self.alpha.is_none())
    }

    fn own_pattern(&self) -> Result<Pattern, LinearError> {
        let (rows, own, k) = (self.num_residuals(), self.own(), self.num_parameters());
        if self.base.leading() == 0 {
            return Ok(Pattern::full(rows, own + k));
        }
        let (first, q) = (self.base.leading(), self.base.num_traces());
        let inner = self.base.pattern();
        let spans = |p: &Pattern, j: usize| p.row_idx()[p.col_ptr()[j]..p.col_ptr()[j + 1]].to_vec();
        let mut entries: Vec<(usize, usize)> = (0..own)
            .flat_map(|j| spans(&inner, j).into_iter().map(move |i| (i, j)))
            .collect();
        entries.extend(self.columns.equilibrium.triplets().map(|(i, j, _)| (i, own + j)));
        let sources = [(&self.columns.traces, 0), (&self.columns.law, 2 * q + 1)];
        for (matrix, offset) in sources {
            for (i, j, _) in matrix.triplets() {
                let rows = spans(&self.law_pattern, offset + i);
                entries.extend(rows.into_iter().map(|row| (first + row, own + j)));
            }
        }
        Ok(Pattern::from_entries(rows, own + k, entries)?)
    }

    /// (u, λ, α) and θ.
    fn split<'x>(&self, x: &'x [f64], last: f64) -> (Cow<'x, [f64]>, &'x [f64]) {
        let (own, theta) = x.split_at(self.own());
        let point = match self.alpha {
            None => Cow::Borrowed(own),
            Some(_) => Cow::Owned(own.iter().copied().chain([last]).collect()),
        };
        (point, theta)
    }

    fn fixed(&self) -> f64 {
        self.alpha.unwrap_or_default()
    }

    /// The point of the law, with the workspace of the problem left as for derivatives there.
    fn law_point(&self, x: &[f64], s: &mut Scratch) -> Vec<f64> {
        let (point, theta) = self.split(x, self.fixed());
        self.base.parts().law_point(&point, s);
        self.moved(&s.z, theta)
    }

    fn law_direction(&self, x: &[f64], d: &[f64], s: &mut Scratch) -> Vec<f64> {
        let (point, _) = self.split(x, self.fixed());
        let (direction, change) = self.split(d, 0.0);
        self.base.parts().law_direction(false, &point, &direction, s);
        self.moved(&s.dz, change)
    }

    fn moved(&self, z: &[f64], theta: &[f64]) -> Vec<f64> {
        let (own, q) = (z.len(), self.base.num_traces());
        let mut moved = vec![0.0; self.law_pattern.ncols()];
        moved[..own].copy_from_slice(z);
        (self.columns.traces.as_ref()).mul_add(1.0, theta, &mut moved[..q]);
        (self.columns.law.as_ref()).mul_add(1.0, theta, &mut moved[own..]);
        moved
    }

    /// Tᵀ and Wᵀ of the derivatives of a function of the law's point.
    fn pulled(&self, z: &[f64], gradient: &mut [f64]) {
        let q = self.base.num_traces();
        gradient.fill(0.0);
        (self.columns.traces.as_ref()).mul_transpose_add(1.0, &z[..q], gradient);
        (self.columns.law.as_ref()).mul_transpose_add(1.0, &z[2 * q + 1..], gradient);
    }
}

impl<V: View, G: PiecewiseSmooth> PiecewiseSmooth for Extended<V, G> {
    fn num_vars(&self) -> usize {
        self.own() + self.num_parameters()
    }
    fn num_residuals(&self) -> usize {
        self.base.num_residuals()
    }
    fn num_sites(&self) -> usize {
        self.base.num_sites()
    }
    fn num_pieces(&self, site: usize) -> usize {
        self.base.num_pieces(site)
    }
    fn num_tests(&self, site: usize) -> usize {
        self.base.num_tests(site)
    }
    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.base.cell(site, piece)
    }
    fn is_piecewise_affine(&self) -> bool {
        self.affine
    }
    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let z = self.base.with_scratch(|s| self.law_point(x, s));
        self.base.law.test_functions(&z, out);
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (equilibrium, rows) = out.split_at_mut(self.base.leading());
        let z = self.base.with_scratch(|s| {
            if !equilibrium.is_empty() {
                let (point, theta) = self.split(x, self.fixed());
                self.base.parts().equilibrium(&point, s, equilibrium);
                (self.columns.equilibrium.as_ref()).mul_add(1.0, theta, equilibrium);
            }
            self.law_point(x, s)
        });
        self.base.law.residual(selection, &z, rows);
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let (first, own, q) = (self.base.leading(), self.own(), self.base.num_traces());
        let parts = self.base.parts();
        // Columns of a Jacobian with α as a variable, from which that of α is left out where it is none.
        let mut wide = Matrix::zeros(self.base.pattern());
        let mut law = Matrix::zeros(self.law_pattern.clone());
        self.base.with_scratch(|s| {
            if first > 0 {
                let (point, _) = self.split(x, self.fixed());
                parts.equilibrium_jacobian(&point, s, &mut wide);
            }
            let z = self.law_point(x, s);
            self.base.law.jacobian(selection, &z, &mut law);
            let near = law.triplets().filter(|(_, k, c)| *k <= 2 * q && *c != 0.0);
            near.for_each(|entry| parts.add_gradient(&s.free, entry, &mut wide));
        });
        for (i, j, v) in wide.triplets().filter(|t| t.1 < own) {
            jac.add(i, j, v);
        }
        if first > 0 {
            jac.add_block(0, own, 1.0, &self.columns.equilibrium);
        }
        let transposed = [self.columns.traces.transpose(), self.columns.law.transpose()];
        for (i, k, c) in law.triplets().filter(|t| t.2 != 0.0) {
            let (source, k) = match k {
                k if k < q => (&transposed[0], k),
                k if k > 2 * q => (&transposed[1], k - 2 * q - 1),
                _ => continue,
            };
            let span = source.pattern().col_ptr()[k]..source.pattern().col_ptr()[k + 1];
            for e in span {
                jac.add(
                    first + i,
                    own + source.pattern().row_idx()[e],
                    c * source.values()[e],
                );
            }
        }
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

impl<V: View, G: PiecewiseSmooth> Derivatives for Extended<V, G> {
    fn has_nested_kinks(&self) -> bool {
        Derivatives::has_nested_kinks(&self.base)
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let (z, dz) = self
            .base
            .with_scratch(|s| (self.law_point(x, s), self.law_direction(x, d, s)));
        self.base.law.test_derivatives(&z, &dz, out);
    }

    fn test_roundings(&self, x: &[f64], out: &mut [f64]) {
        let z = self.base.with_scratch(|s| self.law_point(x, s));
        self.base.add_roundings(&self.split(x, self.fixed()).0, &z, out);
    }

    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        let (z, dz) = self
            .base
            .with_scratch(|s| (self.law_point(x, s), d.map(|d| self.law_direction(x, d, s))));
        self.base
            .law
            .tests_of_selection(selection, &z, dz.as_deref(), out);
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let (own, q) = (self.own(), self.base.num_traces());
        let mut of_law = vec![0.0; self.law_pattern.ncols()];
        let mut wide = vec![0.0; self.num_residuals() + 1];
        self.base.with_scratch(|s| {
            let z = self.law_point(x, s);
            self.base.law.test_gradient(site, test, &z, &mut of_law);
            s.dz.copy_from_slice(&of_law[..=2 * q]);
            self.base.parts().gradient(s, &mut wide);
        });
        gradient[..own].copy_from_slice(&wide[..own]);
        self.pulled(&of_law, &mut gradient[own..]);
    }
}

impl<V: View, G: PiecewiseSmooth> Structure for Extended<V, G> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        Structure::site_rows(&self.base, site, rows);
    }
}

impl<V: View, G: PiecewiseSmooth> Description for Extended<V, G> {
    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        Description::piece_name(&self.base, site, piece)
    }
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Description::site_name(&self.base, site)
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        let own = self.num_residuals() + 1;
        let mut all = vec![1.0; own];
        Description::typical_sizes(&self.base, &mut all);
        let kept = self.own();
        sizes[..kept].copy_from_slice(&all[..kept]);
    }
}
