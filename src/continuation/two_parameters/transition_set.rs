use std::borrow::Cow;

use crate::InputError;
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::{
    Derivatives, Description, Facet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection,
    Structure, TestLayout, check_selection, gradient_of,
};
use crate::sparse::{Matrix, Pattern};

/// The points (y, α, β) of a two-parameter family at which one test function vanishes: a curve to [follow](crate::continuation::Continuation) in
/// the last parameter β.
///
/// The family is a map of n residuals in n + 2 variables, the parameters α and β last; the equation θ_k(y, α, β) = 0 is appended. At
/// the site of θ_k only the pieces on one side of its facet are kept, without that facet: on θ_k = 0 the pieces of the other side agree
/// with them, up to the walls of the pieces kept: where a coefficient of friction falls below 0 the curve ends, though a node that only
/// touches would continue. Transitions of the curve are its points of codimension two, where a second test function vanishes.
///
/// A non-smooth fold is followed in the same way: [`is_fold`](Self::is_fold) says where along the curve α folds.
///
/// ```
/// use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionSet};
/// use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
/// use semismooth::sparse::Matrix;
///
/// struct Family;
/// impl PiecewiseSmooth for Family { // max(y, 0) = α + β
///     fn num_vars(&self) -> usize { 3 }
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
///         out[0] = [0.0, x[0]][s.piece(0)] - x[1] - x[2];
///     }
///     fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
///         jac.add(0, 0, [0.0, 1.0][s.piece(0)]);
///         jac.add(0, 1, -1.0);
///         jac.add(0, 2, -1.0);
///     }
/// }
/// let set = TransitionSet::new(Family, 0, 0)?;
/// let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
/// let line = Branch::follow(&set, &[0.0, 0.0, 0.0], Direction::Increasing, options)?;
/// let end = &line.points.last().unwrap().x; // α + β = 0
/// assert!(end[0].abs() < 1e-12 && (end[1] + 1.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct TransitionSet<P> {
    family: P,
    layout: TestLayout,
    site: usize,
    test: usize,
    /// Pieces of the family kept at `site`, and their cells without the facet of θ_k.
    kept: Vec<(usize, Vec<Facet>)>,
    /// A piece on the other side of the facet.
    beyond: Vec<usize>,
    /// The pattern; its appended row is dense, as the gradient of θ_k may fill it.
    pattern: Pattern,
}

/// What determinants of a family are computed with, kept from one to the next.
pub(super) struct Determinants {
    jac: Matrix,
    solver: AutoSolver,
}

impl<P: PiecewiseSmooth> TransitionSet<P> {
    /// The set θ = 0 for test function `test` of `site`.
    ///
    /// # Errors
    /// A family that has not two variables more than residuals; a site or test function out of range, or one that is no facet of any
    /// piece.
    pub fn new(family: P, site: usize, test: usize) -> Result<Self, PiecewiseError> {
        let (m, n) = (family.num_vars(), family.num_residuals());
        if m != n + 2 {
            return Err(PiecewiseError::Dimensions {
                vars: m,
                residuals: n,
                expected: "a family has two variables (its parameters) more than residuals",
            });
        }
        let owners = |positive: bool| -> Vec<usize> {
            let has = |f: &Facet| f.test() == test && (f.sign() > 0.0) == positive;
            (0..if site < family.num_sites() {
                family.num_pieces(site)
            } else {
                0
            })
                .filter(|&piece| family.cell(site, piece).iter().any(has))
                .collect()
        };
        let (above, below) = (owners(true), owners(false));
        // The side with more pieces is kept: its cells have more of the other facets.
        let (pieces, beyond) = if above.len() >= below.len() {
            (above, below)
        } else {
            (below, above)
        };
        if pieces.is_empty() {
            return Err(PiecewiseError::Input(InputError::Length {
                what: "the list of pieces bounded by the test function",
                expected: 1,
                found: 0,
            }));
        }
        let kept = pieces
            .into_iter()
            .map(|piece| {
                let rest = family.cell(site, piece).iter().filter(|f| f.test() != test);
                (piece, rest.copied().collect())
            })
            .collect();
        let own = family.pattern();
        let mut entries: Vec<(usize, usize)> = Vec::new();
        for j in 0..own.ncols() {
            let rows = &own.row_idx()[own.col_ptr()[j]..own.col_ptr()[j + 1]];
            entries.extend(rows.iter().map(|&i| (i, j)));
        }
        entries.extend((0..m).map(|j| (n, j)));
        let pattern = Pattern::from_entries(n + 1, m, entries).map_err(LinearError::from)?;
        Ok(Self {
            layout: TestLayout::new(&family),
            site,
            test,
            kept,
            beyond,
            pattern,
            family,
        })
    }

    /// The family.
    #[must_use]
    pub fn family(&self) -> &P {
        &self.family
    }

    /// The selection of the family that corresponds to a selection of this map.
    #[must_use]
    pub fn family_selection(&self, selection: &Selection) -> Selection {
        let mut own = selection.clone();
        own.set(self.site, self.piece(selection.piece(self.site)));
        own
    }

    /// Whether α folds at a point of the curve where no further test function vanishes: the determinants of ∇_yH on both sides of the
    /// facet differ in sign. `None` where one is singular or unknown.
    ///
    /// # Errors
    /// Wrong lengths, selections of other maps; failures of the linear solver.
    pub fn is_fold(&self, selection: &Selection, x: &[f64]) -> Result<Option<bool>, PiecewiseError> {
        check_vector("the point x", x, self.num_vars())?;
        check_selection("the selection", selection, self)?;
        self.folds_at(selection, x, &mut self.determinants())
    }

    /// [`is_fold`](Self::is_fold) at a point and a selection of this set.
    pub(super) fn folds_at(
        &self,
        selection: &Selection,
        x: &[f64],
        work: &mut Determinants,
    ) -> Result<Option<bool>, PiecewiseError> {
        let Some(sides) = self.sides(selection, x) else {
            return Ok(None);
        };
        let [here, there] = sides.map(|side| self.determinant(&side, x, work));
        Ok(match (here?, there?) {
            (Some((a, _)), Some((b, _))) if a * b != 0 => Some(a != b),
            _ => None,
        })
    }

    /// The selections of the family on both sides of the facet at x, that of the side kept first.
    pub(super) fn sides(&self, selection: &Selection, x: &[f64]) -> Option<[Selection; 2]> {
        let here = self.family_selection(selection);
        let mut theta = vec![0.0; self.layout.total()];
        self.family.test_functions(x, &mut theta);
        let tests = &theta[self.layout.range(self.site)];
        let margin = |piece: usize| {
            let facets = self.family.cell(self.site, piece).iter();
            let rest = facets.filter(|f| f.test() != self.test);
            rest.map(|f| f.margin(tests)).fold(f64::INFINITY, f64::min)
        };
        let beyond = self.beyond.iter();
        let across = *beyond.max_by(|&&a, &&b| margin(a).total_cmp(&margin(b)))?;
        let mut there = here.clone();
        there.set(self.site, across);
        Some([here, there])
    }

    pub(super) fn determinants(&self) -> Determinants {
        Determinants {
            jac: Matrix::zeros(self.family.pattern()),
            solver: AutoSolver::with_determinants(),
        }
    }

    /// Sign and logarithm of |det ∇_yH| of a selection of the family: (0, −∞) where that is singular, `None` where the solver has none.
    pub(super) fn determinant(
        &self,
        selection: &Selection,
        x: &[f64],
        Determinants { jac, solver }: &mut Determinants,
    ) -> Result<Option<(i8, f64)>, PiecewiseError> {
        jac.clear();
        self.family.jacobian(selection, x, jac);
        let square = jac.leading_columns(self.family.num_residuals());
        solver.analyze(square.pattern)?;
        match solver.factor(square) {
            Ok(()) => Ok(solver.log_det()),
            Err(LinearError::Singular { .. }) => Ok(Some((0, f64::NEG_INFINITY))),
            Err(e) => Err(e.into()),
        }
    }

    /// The position of θ_k among all test functions.
    fn index(&self) -> usize {
        self.layout.range(self.site).start + self.test
    }

    fn piece(&self, own: usize) -> usize {
        self.kept.get(own).map_or(0, |k| k.0)
    }
}

impl<P: PiecewiseSmooth> PiecewiseSmooth for TransitionSet<P> {
    fn num_vars(&self) -> usize {
        self.family.num_vars()
    }

    fn num_residuals(&self) -> usize {
        self.family.num_residuals() + 1
    }

    fn num_sites(&self) -> usize {
        self.family.num_sites()
    }

    fn num_pieces(&self, site: usize) -> usize {
        if site == self.site {
            self.kept.len()
        } else {
            self.family.num_pieces(site)
        }
    }

    fn num_tests(&self, site: usize) -> usize {
        self.family.num_tests(site)
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        if site == self.site {
            self.kept.get(piece).map_or(&[], |k| &k.1)
        } else {
            self.family.cell(site, piece)
        }
    }

    /// θ_k itself, zero on the curve, is shown as 1: it bounds no cell here.
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.family.test_functions(x, out);
        out[self.index()] = 1.0;
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let n = self.family.num_residuals();
        self.family
            .residual(&self.family_selection(selection), x, &mut out[..n]);
        let mut theta = vec![0.0; self.layout.total()];
        self.family
            .tests_of_selection(&self.family_selection(selection), x, None, &mut theta);
        out[n] = theta[self.index()];
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let n = self.family.num_residuals();
        let mut own = Matrix::zeros(self.family.pattern());
        let selection = self.family_selection(selection);
        self.family.jacobian(&selection, x, &mut own);
        if let Some((i, j)) = own.stray() {
            return jac.refuse(i, j);
        }
        jac.add_block(0, 0, 1.0, &own);
        let mut gradient = vec![0.0; x.len()];
        let (layout, index) = (&self.layout, self.index());
        gradient_of(&self.family, layout, &selection, index, x, &mut gradient);
        for (j, g) in gradient.into_iter().enumerate() {
            jac.add(n, j, g);
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.family.is_piecewise_affine()
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

impl<P: PiecewiseSmooth> Derivatives for TransitionSet<P> {
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        self.family.test_derivatives(x, d, out);
        out[self.index()] = 0.0;
    }

    fn has_nested_kinks(&self) -> bool {
        self.family.has_nested_kinks()
    }

    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        self.family
            .tests_of_selection(&self.family_selection(selection), x, d, out);
        out[self.index()] = if d.is_some() { 0.0 } else { 1.0 };
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        if (site, test) == (self.site, self.test) {
            gradient.fill(0.0);
        } else {
            self.family.test_gradient(site, test, x, gradient);
        }
    }
}

impl<P: PiecewiseSmooth> Structure for TransitionSet<P> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.family.site_rows(site, rows);
    }
}

impl<P: PiecewiseSmooth> Description for TransitionSet<P> {
    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        let piece = if site == self.site {
            self.piece(piece)
        } else {
            piece
        };
        self.family.piece_name(site, piece)
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.family.site_name(site)
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        self.family.typical_sizes(sizes);
    }
}
