use std::borrow::Cow;

use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// A map in other units of its variables, x = D y: arclengths of its curves then mean something whatever the units of the problem.
pub(super) struct Scaled<'a, M> {
    pub(super) map: &'a M,
    pub(super) units: Vec<f64>,
}

impl<M: PiecewiseSmooth> Scaled<'_, M> {
    pub(super) fn x(&self, y: &[f64]) -> Vec<f64> {
        y.iter().zip(&self.units).map(|(y, d)| y * d).collect()
    }

    pub(super) fn y(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.units).map(|(x, d)| x / d).collect()
    }
}

impl<M: PiecewiseSmooth> PiecewiseSmooth for Scaled<'_, M> {
    fn num_vars(&self) -> usize {
        self.map.num_vars()
    }

    fn num_residuals(&self) -> usize {
        self.map.num_residuals()
    }

    fn num_sites(&self) -> usize {
        self.map.num_sites()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.map.num_pieces(site)
    }

    fn num_tests(&self, site: usize) -> usize {
        self.map.num_tests(site)
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.map.cell(site, piece)
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.map.piece_name(site, piece)
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.map.site_name(site)
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.map.site_rows(site, rows);
    }

    fn pattern(&self) -> Pattern {
        self.map.pattern()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.map.is_piecewise_affine()
    }

    fn test_functions(&self, y: &[f64], out: &mut [f64]) {
        self.map.test_functions(&self.x(y), out);
    }

    fn residual(&self, selection: &Selection, y: &[f64], out: &mut [f64]) {
        self.map.residual(selection, &self.x(y), out);
    }

    fn jacobian(&self, selection: &Selection, y: &[f64], jac: &mut Matrix) {
        self.map.jacobian(selection, &self.x(y), jac);
        let columns = jac.pattern().col_ptr().to_vec();
        for (span, unit) in columns.windows(2).zip(&self.units) {
            let column = &mut jac.values_mut()[span[0]..span[1]];
            column.iter_mut().for_each(|v| *v *= unit);
        }
    }

    fn test_derivatives(&self, y: &[f64], d: &[f64], out: &mut [f64]) {
        self.map.test_derivatives(&self.x(y), &self.x(d), out);
    }

    fn test_gradient(&self, site: usize, test: usize, y: &[f64], gradient: &mut [f64]) {
        self.map.test_gradient(site, test, &self.x(y), gradient);
        gradient.iter_mut().zip(&self.units).for_each(|(g, d)| *g *= d);
    }
}
