use super::{Derivatives, Description, Facet, Selection, Structure};
use crate::sparse::{Matrix, Pattern};

/// A piecewise-smooth (PC¹) map H: ℝᵐ → ℝⁿ, given by its selection functions.
///
/// H is continuous, and at every x equal to one of finitely many smooth selection functions H^(σ). A selection σ picks one
/// *piece* at each *site*. Which piece is right at x follows from the signs of the site's *test functions* θ: each piece owns a
/// *cell*, the set where its [facets](Facet) hold. m = n is an equation to [solve](crate::newton); m = n + 1 a curve to
/// [follow](crate::continuation), with x = (y, α) and the parameter α last.
///
/// # Contract
/// * [`residual`](Self::residual) and [`jacobian`](Self::jacobian) of a given selection are defined (and smooth) on a
///   neighbourhood of its cell, not only inside it: correctors evaluate them beyond kinks.
/// * At a point on the boundary of several cells, the selections concerned agree: H is continuous.
/// * The cells of one site do not overlap (except in boundaries) and cover the domain.
/// * All functions are pure: same input, same output. `out` arrives with the right length and arbitrary content; the Jacobian
///   arrives zeroed.
///
/// Breaking the contract is a logic error: results are then wrong, but nothing panics. [`check`](super::check) tests it.
///
/// # Example
/// `max(x, 0) = α`, as a curve in (x, α):
/// ```
/// use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
/// use semismooth::sparse::Matrix;
///
/// struct Ramp;
/// impl PiecewiseSmooth for Ramp {
///     fn num_vars(&self) -> usize { 2 }
///     fn num_residuals(&self) -> usize { 1 }
///     fn num_sites(&self) -> usize { 1 }
///     fn num_pieces(&self, _site: usize) -> usize { 2 }
///     fn num_tests(&self, _site: usize) -> usize { 1 }
///     fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
///         const CELLS: [[Facet; 1]; 2] = [[Facet::negative(0)], [Facet::positive(0)]];
///         &CELLS[piece]
///     }
///     fn test_functions(&self, x: &[f64], out: &mut [f64]) { out[0] = x[0]; }
///     fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
///         out[0] = [0.0, x[0]][s.piece(0)] - x[1];
///     }
///     fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
///         jac.add(0, 0, [0.0, 1.0][s.piece(0)]);
///         jac.add(0, 1, -1.0);
///     }
/// }
/// ```
pub trait PiecewiseSmooth {
    /// Number m of variables.
    fn num_vars(&self) -> usize;

    /// Number n of residuals.
    fn num_residuals(&self) -> usize;

    /// Number p of sites; 0 for a smooth map.
    fn num_sites(&self) -> usize;

    /// Number of pieces at a site; at least 1.
    fn num_pieces(&self, site: usize) -> usize;

    /// Number of test functions of a site.
    fn num_tests(&self, site: usize) -> usize;

    /// The cell of a piece: all its facets must hold. Facets count the test functions of the site from 0.
    fn cell(&self, site: usize, piece: usize) -> &[Facet];

    /// All test functions at x: those of site 0, then those of site 1, and so on.
    fn test_functions(&self, x: &[f64], out: &mut [f64]);

    /// The residual H^(σ)(x), of length n.
    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]);

    /// Adds ∇H^(σ)(x) (n × m) to a zeroed matrix over [`pattern`](Self::pattern).
    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix);

    /// The sparsity pattern of Jacobians, over all selections (n × m). Default: full, which takes 16 n m bytes for a Jacobian and a
    /// dense factorisation: override it above some thousand variables.
    fn pattern(&self) -> Pattern {
        Pattern::full(self.num_residuals(), self.num_vars())
    }

    /// Whether H^(σ) and the test functions are affine in x for every σ, so that curves are polygons.
    fn is_piecewise_affine(&self) -> bool {
        false
    }

    /// Derivatives of test functions, test functions of nested kinks, derivatives of higher order, from maps
    /// that know them. Default: `None`; differences stand in for them. A map that implements [`Derivatives`]
    /// returns `Some(self)`, else its implementation is never asked; likewise below.
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        None
    }

    /// Which rows a site changes, and exact coefficients. Default: `None`: all rows, and no proofs of
    /// completeness.
    fn structure(&self) -> Option<&dyn Structure> {
        None
    }

    /// Names for reports, typical sizes of the variables and a scale that users prescribed. Default: `None`:
    /// numbers, and sizes of 1.
    fn description(&self) -> Option<&dyn Description> {
        None
    }
}

macro_rules! forward {
    () => {
        fn num_vars(&self) -> usize {
            (**self).num_vars()
        }
        fn num_residuals(&self) -> usize {
            (**self).num_residuals()
        }
        fn num_sites(&self) -> usize {
            (**self).num_sites()
        }
        fn num_pieces(&self, site: usize) -> usize {
            (**self).num_pieces(site)
        }
        fn num_tests(&self, site: usize) -> usize {
            (**self).num_tests(site)
        }
        fn cell(&self, site: usize, piece: usize) -> &[Facet] {
            (**self).cell(site, piece)
        }
        fn test_functions(&self, x: &[f64], out: &mut [f64]) {
            (**self).test_functions(x, out);
        }
        fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
            (**self).residual(selection, x, out);
        }
        fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
            (**self).jacobian(selection, x, jac);
        }
        fn pattern(&self) -> Pattern {
            (**self).pattern()
        }
        fn is_piecewise_affine(&self) -> bool {
            (**self).is_piecewise_affine()
        }
        fn derivatives(&self) -> Option<&dyn Derivatives> {
            (**self).derivatives()
        }
        fn structure(&self) -> Option<&dyn Structure> {
            (**self).structure()
        }
        fn description(&self) -> Option<&dyn Description> {
            (**self).description()
        }
    };
}

impl<P: PiecewiseSmooth + ?Sized> PiecewiseSmooth for &P {
    forward!();
}

impl<P: PiecewiseSmooth + ?Sized> PiecewiseSmooth for Box<P> {
    forward!();
}
