use std::borrow::Cow;

use super::error::check_length;
use super::law::TESTS;
use super::{ContactError, FrictionProblem};
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// A friction problem with a second parameter β in its load and friction: f(α) + β f₂ and F(α) + β F₂, in full form with
/// x = (u, λν, λt, α, β). As a two-parameter family its [transition sets](crate::continuation::TransitionSet) are curves in the
/// (α, β) plane.
#[derive(Debug, Clone)]
pub struct FrictionFamily {
    problem: FrictionProblem,
    load: Vec<f64>,
    friction: Vec<f64>,
    pattern: Pattern,
}

impl FrictionFamily {
    /// The family with load f(α) + β `load` and friction F(α) + β `friction`.
    ///
    /// # Errors
    /// Wrong lengths, values that are not finite.
    pub fn new(
        mut problem: FrictionProblem,
        load: Vec<f64>,
        friction: Vec<f64>,
    ) -> Result<Self, ContactError> {
        let (n, p) = (problem.num_displacements(), problem.num_contacts());
        check_length("the load of the second parameter", &load, n)?;
        check_length("the friction of the second parameter", &friction, p)?;
        if friction.iter().any(|f| *f != 0.0) {
            problem.law.constant_friction = false;
        }
        let own = problem.pattern();
        let (rows, alpha) = (n + 2 * p, n + 2 * p);
        let mut entries: Vec<(usize, usize)> = Vec::new();
        for j in 0..own.ncols() {
            let column = &own.row_idx()[own.col_ptr()[j]..own.col_ptr()[j + 1]];
            entries.extend(column.iter().map(|&i| (i, j)));
        }
        entries.extend((0..rows).map(|i| (i, alpha + 1)));
        Ok(Self {
            pattern: Pattern::from_entries(rows, alpha + 2, entries)?,
            problem,
            load,
            friction,
        })
    }

    /// The problem at β = 0.
    #[must_use]
    pub fn problem(&self) -> &FrictionProblem {
        &self.problem
    }

    /// Calls `f(node, values, ∂F/∂α)` for every contact node.
    fn for_nodes(&self, x: &[f64], mut f: impl FnMut(usize, super::NodeValues, f64)) {
        let (own, beta) = (&x[..x.len() - 1], x[x.len() - 1]);
        self.problem.for_nodes(own, |i, mut v, rate| {
            v.friction += beta * self.friction[i];
            f(i, v, rate);
        });
    }
}

impl PiecewiseSmooth for FrictionFamily {
    fn num_vars(&self) -> usize {
        self.problem.num_vars() + 1
    }

    fn num_residuals(&self) -> usize {
        self.problem.num_residuals()
    }

    fn num_sites(&self) -> usize {
        self.problem.num_sites()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.problem.num_pieces(site)
    }

    fn num_tests(&self, _site: usize) -> usize {
        TESTS
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.problem.cell(site, piece)
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.problem.piece_name(site, piece)
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.problem.site_name(site)
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.problem.site_rows(site, rows);
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.problem.is_piecewise_affine()
    }

    /// β is measured as α is.
    fn typical_sizes(&self, sizes: &mut [f64]) {
        let own = sizes.len() - 1;
        self.problem.typical_sizes(&mut sizes[..own]);
        sizes[own] = sizes[own - 1];
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.for_nodes(x, |i, v, _| {
            out[TESTS * i..TESTS * (i + 1)].copy_from_slice(&self.problem.law.tests(&v));
        });
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (n, p) = (self.problem.num_displacements(), self.problem.num_contacts());
        let (own, beta) = (&x[..x.len() - 1], x[x.len() - 1]);
        self.problem.residual(selection, own, out);
        out.iter_mut().zip(&self.load).for_each(|(o, f)| *o -= beta * f);
        self.for_nodes(x, |i, v, _| {
            let [normal, tangential] = self.problem.law.residual(selection.piece(i), &v);
            out[n + i] = normal;
            out[n + p + i] = tangential;
        });
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let (n, p) = (self.problem.num_displacements(), self.problem.num_contacts());
        let beta = n + 2 * p + 1;
        self.problem.equilibrium_jacobian(x[beta - 1], jac);
        for (i, f) in self.load.iter().enumerate() {
            jac.add(i, beta, -f);
        }
        self.for_nodes(x, |i, v, rate| {
            let rows = self.problem.law.rows(selection.piece(i), &v);
            for (row, index) in rows.iter().zip([n + i, n + p + i]) {
                self.problem
                    .scatter(i, row, rate, |j, value| jac.add(index, j, value));
                jac.add(index, beta, row.friction * self.friction[i]);
            }
        });
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let beta = d[d.len() - 1];
        self.for_nodes(x, |i, v, rate| {
            let rows = self.problem.law.test_rows(&v);
            for (o, row) in out[TESTS * i..TESTS * (i + 1)].iter_mut().zip(&rows) {
                *o = row.friction * self.friction[i] * beta;
                self.problem.scatter(i, row, rate, |j, value| *o += value * d[j]);
            }
        });
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let beta = x.len() - 1;
        self.for_nodes(x, |i, v, rate| {
            if i == site {
                let row = self.problem.law.test_rows(&v)[test.min(TESTS - 1)];
                self.problem
                    .scatter(i, &row, rate, |j, value| gradient[j] += value);
                gradient[beta] += row.friction * self.friction[i];
            }
        });
    }
}
