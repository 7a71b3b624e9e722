use std::borrow::Cow;

use super::{Condensed, ExactPieces, Expansions, Facet, Selection};
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

    /// Name of a piece, for reports.
    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Owned(format!("piece {piece}"))
    }

    /// Name of a site, for reports.
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("site {site}"))
    }

    /// Replaces `rows` by the residuals that depend on the piece chosen at `site`. All other rows are the same whatever piece
    /// the site uses, so that a solver may keep its factors and update them. Default: all rows.
    fn site_rows(&self, _site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.extend(0..self.num_residuals());
    }

    /// Adds only the rows [`site_rows`](Self::site_rows) of ∇H^(σ)(x) to a matrix in which they are zero, so that a solver that has the
    /// other rows need not recompute them. Returns whether it did so. Default: `false`, and nothing added.
    fn site_jacobian(&self, _site: usize, _selection: &Selection, _x: &[f64], _jac: &mut Matrix) -> bool {
        false
    }

    /// Whether H^(σ) and the test functions are affine in x for every σ, so that curves are polygons.
    fn is_piecewise_affine(&self) -> bool {
        false
    }

    /// The conditions of the pieces with exact coefficients, from which lists of solutions are proven to be complete.
    /// Default: `None`; such lists are then at best [undecided](crate::enumeration::Completeness::Undecided).
    fn exact(&self) -> Option<&dyn ExactPieces> {
        None
    }

    /// Derivatives of the pieces beyond the first along curves. Default: `None`; they are then estimated from
    /// differences of Jacobians.
    fn expansions(&self) -> Option<Box<dyn Expansions + '_>> {
        None
    }

    /// Replaces `sizes` (length m, filled with 1) by typical sizes of the variables in their units: positive numbers, that of a
    /// parameter the change over which solutions change noticeably. Distances and angles in x are measured relative to them where a curve
    /// is followed, and so are the steps of central differences. Default: unchanged.
    fn typical_sizes(&self, _sizes: &mut [f64]) {}

    /// Replaces `out` by the test functions in the form reported at transitions, where it differs from the form used to follow curves, and
    /// returns whether it differs (the same at every x): users may prescribe a scale (the augmentation parameter of a contact problem) on
    /// which nothing else depends except the iterates of Newton's method. At solutions both forms have the same signs. Default: `false`.
    fn reported_tests(&self, _x: &[f64], _out: &mut [f64]) -> bool {
        false
    }

    /// The same equation in the scale that users prescribed, if it differs: [Newton's method](crate::newton) iterates in that scale, as its
    /// iterates depend on it. Solutions are the same. Default: `None`.
    fn in_prescribed_scale(&self) -> Option<Box<dyn PiecewiseSmooth + '_>> {
        None
    }

    /// What makes large full Jacobians cheap to factor, where they are combined from rows of one matrix. Default: `None`.
    #[doc(hidden)]
    fn condensed(&self) -> Option<Condensed<'_>> {
        None
    }

    /// Directional derivatives ∇θ(x)·d of all test functions, in the order of [`test_functions`](Self::test_functions).
    /// Default: central differences along d (two evaluations).
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        super::differences::test_derivatives(&self, x, d, out);
    }

    /// Whether kinks are nested, so that the arguments of test functions have kinks themselves and
    /// [`tests_of_selection`](Self::tests_of_selection) differs from [`test_functions`](Self::test_functions). Default: `false`.
    fn has_nested_kinks(&self) -> bool {
        false
    }

    /// The test functions θ^(σ)(x) of a selection, in which all other kinks have its pieces, or with a direction d ∇θ^(σ)(x)·d. They are
    /// smooth near the cell of σ, and in it they are those of [`test_functions`](Self::test_functions). Curves of σ are followed with
    /// them. Default, for kinks that are not nested: test functions are smooth and the same for all selections.
    fn tests_of_selection(&self, _selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        match d {
            Some(d) => self.test_derivatives(x, d, out),
            None => self.test_functions(x, out),
        }
    }

    /// The gradient ∇θ_test(x) (length m) of one test function of a site. Default: central differences (2 m evaluations of all
    /// test functions; override for large problems).
    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        super::differences::test_gradient(&self, site, test, x, gradient);
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
        fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
            (**self).piece_name(site, piece)
        }
        fn site_name(&self, site: usize) -> Cow<'_, str> {
            (**self).site_name(site)
        }
        fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
            (**self).site_rows(site, rows);
        }
        fn site_jacobian(&self, site: usize, selection: &Selection, x: &[f64], jac: &mut Matrix) -> bool {
            (**self).site_jacobian(site, selection, x, jac)
        }
        fn is_piecewise_affine(&self) -> bool {
            (**self).is_piecewise_affine()
        }
        fn exact(&self) -> Option<&dyn ExactPieces> {
            (**self).exact()
        }
        fn expansions(&self) -> Option<Box<dyn Expansions + '_>> {
            (**self).expansions()
        }
        fn typical_sizes(&self, sizes: &mut [f64]) {
            (**self).typical_sizes(sizes);
        }
        fn reported_tests(&self, x: &[f64], out: &mut [f64]) -> bool {
            (**self).reported_tests(x, out)
        }
        fn in_prescribed_scale(&self) -> Option<Box<dyn PiecewiseSmooth + '_>> {
            (**self).in_prescribed_scale()
        }
        fn condensed(&self) -> Option<Condensed<'_>> {
            (**self).condensed()
        }
        fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
            (**self).test_derivatives(x, d, out);
        }
        fn has_nested_kinks(&self) -> bool {
            (**self).has_nested_kinks()
        }
        fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
            (**self).tests_of_selection(selection, x, d, out);
        }
        fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
            (**self).test_gradient(site, test, x, gradient);
        }
    };
}

impl<P: PiecewiseSmooth + ?Sized> PiecewiseSmooth for &P {
    forward!();
}

impl<P: PiecewiseSmooth + ?Sized> PiecewiseSmooth for Box<P> {
    forward!();
}
