//! Curves in the plane for tests of single parts.

use super::engine::Curve;
use super::{Continuation, ContinuationOptions, Direction};
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::Matrix;

/// Value, ∂/∂y and ∂/∂α of a function of (y, α).
pub(super) type Function = fn(f64, f64) -> [f64; 3];

/// One site with these pieces, test functions and cells.
pub(super) struct Plane {
    pub(super) pieces: Vec<Function>,
    pub(super) tests: Vec<Function>,
    pub(super) cells: Vec<Vec<Facet>>,
    pub(super) affine: bool,
}

impl Plane {
    /// One curved piece, in whose cell all tests are positive.
    pub(super) fn within(piece: Function, tests: &[Function]) -> Self {
        Self {
            pieces: vec![piece],
            tests: tests.to_vec(),
            cells: vec![(0..tests.len() as u16).map(Facet::positive).collect()],
            affine: false,
        }
    }

    /// The curve through (y, α), with growing α.
    pub(super) fn curve(&self, y: f64, alpha: f64) -> Continuation<'_, Self> {
        let options = ContinuationOptions::default();
        Continuation::new(self, &[y, alpha], Direction::Increasing, options).unwrap()
    }
}

impl Curve<'_> {
    /// Makes (y, α) with a unit tangent the end of the step at hand, as if that had been corrected.
    pub(super) fn step_to(&mut self, x: [f64; 2], t: [f64; 2]) {
        self.next = self.here.clone();
        self.next.x.copy_from_slice(&x);
        self.next.t.copy_from_slice(&t);
        self.next.s = self.progress_to(&x);
        self.map.test_functions(&x, &mut self.next.theta);
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
    fn num_pieces(&self, _: usize) -> usize {
        self.pieces.len()
    }
    fn num_tests(&self, _: usize) -> usize {
        self.tests.len()
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        &self.cells[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (o, f) in out.iter_mut().zip(&self.tests) {
            *o = f(x[0], x[1])[0];
        }
    }
    fn test_gradient(&self, _: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        gradient.copy_from_slice(&self.tests[test](x[0], x[1])[1..]);
    }
    fn test_derivatives(&self, x: &[f64], direction: &[f64], out: &mut [f64]) {
        for (o, f) in out.iter_mut().zip(&self.tests) {
            let [_, y, alpha] = f(x[0], x[1]);
            *o = y * direction[0] + alpha * direction[1];
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
}
