use semismooth::piecewise::{Derivatives, Facet, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// Value, ∂/∂y and ∂/∂α of a function of (y, α).
pub(crate) type Function = fn(f64, f64) -> [f64; 3];

/// Curves in the plane, with one site.
pub(crate) struct Plane {
    pub(crate) pieces: Vec<Function>,
    pub(crate) tests: Vec<Function>,
    pub(crate) cells: Vec<Vec<Facet>>,
    pub(crate) affine: bool,
}

impl Plane {
    pub(crate) fn smooth(f: Function) -> Self {
        Self::within(f, &[])
    }

    /// One curved piece, in whose cell all test functions are positive.
    pub(crate) fn within(piece: Function, tests: &[Function]) -> Self {
        Self {
            pieces: vec![piece],
            tests: tests.to_vec(),
            cells: vec![(0..tests.len() as u16).map(Facet::positive).collect()],
            affine: false,
        }
    }

    /// `above` where θ > 0, `below` where θ < 0.
    pub(crate) fn two(above: Function, below: Function, theta: Function) -> Self {
        Self {
            pieces: vec![above, below],
            tests: vec![theta],
            cells: vec![vec![Facet::positive(0)], vec![Facet::negative(0)]],
            affine: false,
        }
    }

    pub(crate) fn value(&self, x: &[f64]) -> f64 {
        let mut r = [0.0];
        semismooth::piecewise::value(self, x, &mut r);
        r[0]
    }
}

impl PiecewiseSmooth for Plane {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn num_sites(&self) -> usize {
        1
    }
    fn num_pieces(&self, _site: usize) -> usize {
        self.pieces.len()
    }
    fn num_tests(&self, _site: usize) -> usize {
        self.tests.len()
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        &self.cells[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (o, f) in out.iter_mut().zip(&self.tests) {
            *o = f(x[0], x[1])[0];
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = self.pieces[s.piece(0)](x[0], x[1])[0];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let [_, y, alpha] = self.pieces[s.piece(0)](x[0], x[1]);
        jac.add(0, 0, y);
        jac.add(0, 1, alpha);
    }
    fn is_piecewise_affine(&self) -> bool {
        self.affine
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl Derivatives for Plane {
    fn test_gradient(&self, _site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        gradient.copy_from_slice(&self.tests[test](x[0], x[1])[1..]);
    }
    fn test_derivatives(&self, x: &[f64], direction: &[f64], out: &mut [f64]) {
        for (o, f) in out.iter_mut().zip(&self.tests) {
            let [_, y, alpha] = f(x[0], x[1]);
            *o = y * direction[0] + alpha * direction[1];
        }
    }
}
