//! What a map may say beyond [`PiecewiseSmooth`], in three traits by subject, and [`PiecewiseSmoothExt`],
//! which asks any map.

use std::borrow::Cow;

use super::{Condensed, ExactPieces, Expansions, PiecewiseSmooth, Selection, differences};
use crate::sparse::Matrix;

/// Derivatives of test functions and derivatives of higher order, for maps that know them:
/// [`PiecewiseSmooth::derivatives`] then returns `Some(self)`. Where a map does not, solvers use central
/// differences.
///
/// ```
/// use semismooth::piecewise::{Derivatives, PiecewiseSmooth};
/// # use semismooth::piecewise::{Facet, PiecewiseSmoothExt, Selection};
/// # use semismooth::sparse::Matrix;
/// # struct Disc;
/// impl PiecewiseSmooth for Disc {
///     // …
/// #   fn num_vars(&self) -> usize { 2 }
/// #   fn num_residuals(&self) -> usize { 1 }
/// #   fn num_sites(&self) -> usize { 1 }
/// #   fn num_pieces(&self, _: usize) -> usize { 2 }
/// #   fn num_tests(&self, _: usize) -> usize { 1 }
/// #   fn cell(&self, _: usize, piece: usize) -> &[Facet] {
/// #       const CELLS: [[Facet; 1]; 2] = [[Facet::negative(0)], [Facet::positive(0)]];
/// #       &CELLS[piece]
/// #   }
/// #   fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
/// #       out[0] = s.piece(0) as f64 * (x[0] * x[0] + x[1] * x[1] - 1.0) - x[0];
/// #   }
/// #   fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
/// #       jac.add(0, 0, s.piece(0) as f64 * 2.0 * x[0] - 1.0);
/// #       jac.add(0, 1, s.piece(0) as f64 * 2.0 * x[1]);
/// #   }
///     fn test_functions(&self, x: &[f64], out: &mut [f64]) { out[0] = x[0] * x[0] + x[1] * x[1] - 1.0; }
///     fn derivatives(&self) -> Option<&dyn Derivatives> { Some(self) }
/// }
/// impl Derivatives for Disc {
///     fn test_gradient(&self, _site: usize, _test: usize, x: &[f64], gradient: &mut [f64]) {
///         gradient[0] = 2.0 * x[0];
///         gradient[1] = 2.0 * x[1];
///     }
/// }
/// # let mut gradient = [0.0; 2];
/// # PiecewiseSmoothExt::test_gradient(&Disc, 0, 0, &[3.0, 4.0], &mut gradient);
/// # assert_eq!(gradient, [6.0, 8.0]);
/// ```
pub trait Derivatives: PiecewiseSmooth {
    /// Directional derivatives ∇θ(x)·d of all test functions, in the order of
    /// [`test_functions`](PiecewiseSmooth::test_functions). Default: central differences along d (two
    /// evaluations).
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        differences::test_derivatives(&self, x, d, out);
    }

    /// The gradient ∇θ_test(x) (length m) of one test function of a site. Default: central differences (2 m
    /// evaluations of all test functions; override for large problems).
    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        differences::test_gradient(&self, site, test, x, gradient);
    }

    /// Adds to `out` by how much rounding may have moved the test functions at x beside that of the variables:
    /// of constants that were computed, as displacements A⁻¹ f are. Where solutions are differentiated, a test
    /// function counts as zero up to that. Default: nothing.
    fn test_roundings(&self, _x: &[f64], _out: &mut [f64]) {}

    /// Whether kinks are nested, so that the arguments of test functions have kinks themselves and
    /// [`tests_of_selection`](Self::tests_of_selection) differs from
    /// [`test_functions`](PiecewiseSmooth::test_functions). Default: `false`.
    fn has_nested_kinks(&self) -> bool {
        false
    }

    /// The test functions θ^(σ)(x) of a selection, in which all other kinks have its pieces, or with a
    /// direction d ∇θ^(σ)(x)·d. They are smooth near the cell of σ, and in it they are those of
    /// [`test_functions`](PiecewiseSmooth::test_functions). Curves of σ are followed with them. Default, for
    /// kinks that are not nested: test functions are smooth and the same for all selections.
    fn tests_of_selection(&self, _selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        match d {
            Some(d) => Derivatives::test_derivatives(self, x, d, out),
            None => self.test_functions(x, out),
        }
    }

    /// Derivatives of the pieces beyond the first along curves. Default: `None`; they are then estimated from
    /// differences of Jacobians.
    fn expansions(&self) -> Option<Box<dyn Expansions + '_>> {
        None
    }
}

/// What solvers may use of the structure of a map: [`PiecewiseSmooth::structure`] then returns `Some(self)`.
/// Results are the same without, but for proofs; large problems take longer.
pub trait Structure: PiecewiseSmooth {
    /// Replaces `rows` by the residuals that depend on the piece chosen at `site`. All other rows are the
    /// same whatever piece the site uses, so that a solver may keep its factors and update them. Default: all
    /// rows.
    fn site_rows(&self, _site: usize, rows: &mut Vec<usize>) {
        all_rows(self.num_residuals(), rows);
    }

    /// Adds only the rows [`site_rows`](Self::site_rows) of ∇H^(σ)(x) to a matrix in which they are zero, so
    /// that a solver that has the other rows need not recompute them. Returns whether it did so. Default:
    /// `false`, and nothing added.
    fn site_jacobian(&self, _site: usize, _selection: &Selection, _x: &[f64], _jac: &mut Matrix) -> bool {
        false
    }

    /// The conditions of the pieces with exact coefficients, from which lists of solutions are proven to be
    /// complete. Default: `None`; such lists are then at best
    /// [undecided](crate::enumeration::Completeness::Undecided).
    fn exact(&self) -> Option<&dyn ExactPieces> {
        None
    }

    /// What makes large full Jacobians cheap to factor, where they are combined from rows of one matrix.
    /// Default: `None`.
    #[doc(hidden)]
    fn condensed(&self) -> Option<Condensed<'_>> {
        None
    }
}

/// What the numbers of a map mean to its user, names, sizes and scales: [`PiecewiseSmooth::description`] then
/// returns `Some(self)`.
pub trait Description: PiecewiseSmooth {
    /// Name of a piece, for reports. Default: its number.
    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        numbered("piece", piece)
    }

    /// Name of a site, for reports. Default: its number.
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        numbered("site", site)
    }

    /// Replaces `sizes` (length m, filled with 1) by typical sizes of the variables in their units: positive
    /// numbers, that of a parameter the change over which solutions change noticeably. Distances and angles
    /// in x are measured relative to them where a curve is followed, and so are the steps of central
    /// differences. Default: unchanged.
    fn typical_sizes(&self, _sizes: &mut [f64]) {}

    /// Replaces `out` by the test functions in the form reported at transitions, where it differs from the
    /// form used to follow curves, and returns whether it differs (the same at every x): users may prescribe
    /// a scale (the augmentation parameter of a contact problem) on which nothing else depends except the
    /// iterates of Newton's method. At solutions both forms have the same signs. Default: `false`.
    fn reported_tests(&self, _x: &[f64], _out: &mut [f64]) -> bool {
        false
    }

    /// The same equation in the scale that users prescribed, if it differs: [Newton's method](crate::newton)
    /// iterates in that scale, as its iterates depend on it. Solutions are the same. Default: `None`.
    fn in_prescribed_scale(&self) -> Option<Box<dyn PiecewiseSmooth + '_>> {
        None
    }
}

fn all_rows(n: usize, rows: &mut Vec<usize>) {
    rows.clear();
    rows.extend(0..n);
}

fn numbered(what: &str, number: usize) -> Cow<'static, str> {
    Cow::Owned(format!("{what} {number}"))
}

/// The questions of [`Derivatives`], [`Structure`] and [`Description`] for any map: what it says there, else
/// the default. Maps implement those; solvers ask this. For a type that implements one of them itself, say by
/// path which is meant where both traits are imported.
///
/// ```
/// use semismooth::piecewise::{MinMap, PiecewiseSmoothExt};
///
/// let map = MinMap::new(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a.copy_from_slice(x);
///     b.fill(1.0);
/// });
/// let mut rows = Vec::new();
/// map.site_rows(1, &mut rows);
/// assert_eq!(rows, [1]);
/// assert_eq!(map.piece_name(1, 0), "first");
/// ```
pub trait PiecewiseSmoothExt: PiecewiseSmooth {
    /// See [`Derivatives::test_derivatives`].
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        match self.derivatives() {
            Some(own) => own.test_derivatives(x, d, out),
            None => differences::test_derivatives(&self, x, d, out),
        }
    }

    /// See [`Derivatives::test_gradient`].
    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        match self.derivatives() {
            Some(own) => own.test_gradient(site, test, x, gradient),
            None => differences::test_gradient(&self, site, test, x, gradient),
        }
    }

    /// See [`Derivatives::has_nested_kinks`].
    fn has_nested_kinks(&self) -> bool {
        self.derivatives().is_some_and(Derivatives::has_nested_kinks)
    }

    /// See [`Derivatives::tests_of_selection`].
    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        match (self.derivatives(), d) {
            (Some(own), _) => own.tests_of_selection(selection, x, d, out),
            (None, Some(d)) => differences::test_derivatives(&self, x, d, out),
            (None, None) => self.test_functions(x, out),
        }
    }

    /// See [`Derivatives::expansions`].
    fn expansions(&self) -> Option<Box<dyn Expansions + '_>> {
        self.derivatives()?.expansions()
    }

    /// See [`Structure::site_rows`].
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        match self.structure() {
            Some(own) => own.site_rows(site, rows),
            None => all_rows(self.num_residuals(), rows),
        }
    }

    /// See [`Structure::site_jacobian`].
    fn site_jacobian(&self, site: usize, selection: &Selection, x: &[f64], jac: &mut Matrix) -> bool {
        self.structure()
            .is_some_and(|own| own.site_jacobian(site, selection, x, jac))
    }

    /// See [`Structure::exact`].
    fn exact(&self) -> Option<&dyn ExactPieces> {
        self.structure()?.exact()
    }

    /// See [`Description::piece_name`].
    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.description()
            .map_or_else(|| numbered("piece", piece), |own| own.piece_name(site, piece))
    }

    /// See [`Description::site_name`].
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.description()
            .map_or_else(|| numbered("site", site), |own| own.site_name(site))
    }

    /// See [`Description::typical_sizes`].
    fn typical_sizes(&self, sizes: &mut [f64]) {
        if let Some(own) = self.description() {
            own.typical_sizes(sizes);
        }
    }

    /// See [`Description::reported_tests`].
    fn reported_tests(&self, x: &[f64], out: &mut [f64]) -> bool {
        self.description().is_some_and(|own| own.reported_tests(x, out))
    }

    /// See [`Description::in_prescribed_scale`].
    fn in_prescribed_scale(&self) -> Option<Box<dyn PiecewiseSmooth + '_>> {
        self.description()?.in_prescribed_scale()
    }
}

impl<P: PiecewiseSmooth + ?Sized> PiecewiseSmoothExt for P {}
