mod affinity;
mod dual;
mod exact;
mod expansions;
mod interval;
mod kinks;
mod series;

use std::borrow::Cow;

use std::sync::atomic::{AtomicBool, Ordering};

use num_dual::Dual64;

use self::expansions::Expanded;
pub use self::kinks::Kinks;
use self::kinks::{Kind, Mode};
use super::trace::{LABELS, lacking, members, ordinary_point, structure};
use super::{
    Derivatives, Description, ExactPieces, Expansions, Facet, PiecewiseSmooth, Real, Selection, Structure,
};
use crate::sparse::{Coloring, Matrix, Pattern};

/// A nonsmooth function written once over [`Real`], its kinks expressed through [`Kinks`]. [`Traced`] turns it into a
/// [`PiecewiseSmooth`] map with exact Jacobians (forward-mode dual numbers).
pub trait NonsmoothFunction {
    /// Number m of variables.
    fn num_vars(&self) -> usize;

    /// Number n of residuals.
    fn num_residuals(&self) -> usize;

    /// Computes H(x) into `out` (length n). Each call on `kinks` is a site; the same calls must be made in the same order at
    /// every x (where their number differs, [`Traced`] gives NaN). A kink may lie inside another.
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]);

    /// The sparsity pattern of Jacobians, over all pieces. Default: found by tracing [`eval`](Self::eval) at two points, the zero vector
    /// and one in (½, ¾)ᵐ, every kink counting as dependent on all of its arguments. A pattern of your own that lacks an entry is refused
    /// ([`PiecewiseError::StrayEntry`](super::PiecewiseError::StrayEntry)) where the first Jacobian is evaluated. Where
    /// [`eval`](Self::eval) branches without a kink, a branch that neither point takes may have entries that are not found, and Jacobians
    /// there are wrong: give the pattern then.
    fn pattern(&self) -> Pattern {
        let (n, m) = (self.num_residuals(), self.num_vars());
        let mut entries = Vec::new();
        for x in [vec![0.0; m], ordinary_point(m)] {
            entries.extend(structure(n, m, &x, &mut |x, _, out| {
                self.eval(x, &mut Kinks::new(Mode::Joined), out);
            }));
        }
        // All of them lie inside.
        Pattern::from_entries(n, m, entries).unwrap_or_else(|_| Pattern::full(n, m))
    }

    /// Typical sizes of the variables, as [`Description::typical_sizes`]. Default: unchanged.
    fn typical_sizes(&self, _sizes: &mut [f64]) {}

    /// Whether the function is affine apart from its kinks, in all variables (the parameter among them), and
    /// so are the arguments of the kinks: its curves are then polygons, followed from vertex to vertex in one
    /// step. It is ignored if a kink lies inside another, and if the two formulas of a
    /// [`switch`](Kinks::switch) are not exactly the same where its test vanishes.
    ///
    /// Default: found by tracing [`eval`](Self::eval); `false` where it branches on [`value`](Real::value),
    /// and where terms of higher order cancel (x y − x y). If your own answer is wrong, so are curves;
    /// [`check`](super::check) finds that out.
    fn is_piecewise_affine(&self) -> bool {
        affinity::is_affine(self.num_vars(), self.num_residuals(), |x, out| {
            self.eval(x, &mut Kinks::new(Mode::Switched), out);
        })
    }

    /// Writes down, where the function knows it without being evaluated, the residuals that depend on the piece of each site, the
    /// variables of each test function (in the order of sites; a projection has two), and whether a test function depends on a piece. What
    /// is not known (`false`) is found by tracing, which takes time in proportion to the square of the number of variables and kinks.
    #[doc(hidden)]
    fn dependencies(
        &self,
        _rows: &mut [Vec<usize>],
        _variables: &mut [Vec<usize>],
        _nested: &mut bool,
    ) -> bool {
        false
    }

    /// Name of a site, in the order of the calls on `kinks`, for tables and pictures. Default: none, the site has a number.
    fn site_name(&self, _site: usize) -> Option<Cow<'_, str>> {
        None
    }

    /// Name of a piece of a site. Default: none, the name comes from the kind of kink ("first", "second", "lower", "interior", "upper").
    fn piece_name(&self, _site: usize, _piece: usize) -> Option<Cow<'_, str>> {
        None
    }
}

/// What the kinks of a function depend on, and what depends on them, whichever pieces are chosen.
struct Dependencies {
    /// The residuals that depend on the piece of each site.
    rows: Vec<Vec<usize>>,
    /// The variables of each test function.
    variables: Vec<Vec<usize>>,
    /// Whether a test function depends on a piece.
    nested: bool,
}

impl Dependencies {
    fn new(function: &impl NonsmoothFunction, x: &[f64], sites: usize, tests: usize) -> Self {
        let empty = || Self {
            rows: vec![Vec::new(); sites],
            variables: vec![Vec::new(); tests],
            nested: false,
        };
        let mut own = empty();
        if !function.dependencies(&mut own.rows, &mut own.variables, &mut own.nested) {
            own = empty();
            own.trace(function, x, sites, tests);
        }
        own
    }

    /// By evaluations over sets of labels.
    fn trace(&mut self, function: &impl NonsmoothFunction, x: &[f64], sites: usize, tests: usize) {
        let m = x.len();
        let found = structure(function.num_residuals(), m + sites, x, &mut |x, first, out| {
            let mut found = Vec::with_capacity(tests);
            let mode = Mode::Labelled {
                behind: m,
                first,
                tests: &mut found,
            };
            function.eval(x, &mut Kinks::new(mode), out);
            for (variables, labels) in self.variables.iter_mut().zip(&found) {
                let last = m.saturating_sub(first).min(LABELS);
                variables.extend(members(labels).take_while(|l| *l < last).map(|l| first + l));
                self.nested |= members(labels).any(|l| l >= last);
            }
        });
        for (row, index) in found {
            if let Some(rows) = index.checked_sub(m).and_then(|site| self.rows.get_mut(site)) {
                rows.push(row);
            }
        }
    }
}

/// A [`NonsmoothFunction`] as a [`PiecewiseSmooth`] map.
///
/// Where it is piecewise affine it gives its [exact coefficients](crate::piecewise::Structure::exact): lists
/// of its solutions are proven complete, and of its arms where it is affine in the parameter, too. For this
/// it is evaluated over affine forms in exact arithmetic, with an unknown for every kink (the abs-normal
/// form, Griewank 2013). The numbers in the formula count as they are stored; quotients by numbers are not
/// rounded. It gives none where it branches on [`value`](Real::value), calls `abs` or any nonlinear smooth
/// function, or does arithmetic among constants of type `T` that has to round (`T::from(1.0) / 3.0`).
///
/// ```
/// use semismooth::newton::Newton;
/// use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
///
/// /// |x| + x/2 = 3 and y = max(x, 1).
/// struct Example;
/// impl NonsmoothFunction for Example {
///     fn num_vars(&self) -> usize { 2 }
///     fn num_residuals(&self) -> usize { 2 }
///     fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
///         out[0] = kinks.abs(x[0]) + x[0] * 0.5 - 3.0;
///         out[1] = x[1] - kinks.max(x[0], T::from(1.0));
///     }
/// }
/// let map = Traced::new(Example);
/// let mut x = [0.3, 0.0];
/// Newton::default().solve(&map, &mut x)?;
/// assert_eq!(x, [2.0, 2.0]);
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
#[derive(Debug)]
pub struct Traced<F> {
    function: F,
    kinds: Vec<Kind>,
    pattern: Pattern,
    coloring: Coloring,
    /// Residuals that depend on the piece of each site.
    rows: Vec<Vec<usize>>,
    /// Variables of each test function.
    variables: Vec<Vec<usize>>,
    /// Whether the test functions of one kink depend on another.
    nested: bool,
    /// Whether pieces and test functions are affine: those of an outer kink are on the pieces of the inner
    /// one only.
    affine: bool,
    /// Whether the pattern was compared with the function at a point.
    checked: AtomicBool,
}

impl<F: Clone> Clone for Traced<F> {
    fn clone(&self) -> Self {
        Self {
            function: self.function.clone(),
            kinds: self.kinds.clone(),
            pattern: self.pattern.clone(),
            coloring: self.coloring.clone(),
            rows: self.rows.clone(),
            variables: self.variables.clone(),
            nested: self.nested,
            affine: self.affine,
            checked: AtomicBool::new(self.checked.load(Ordering::Relaxed)),
        }
    }
}

impl<F: NonsmoothFunction> Traced<F> {
    /// Finds the kinks of `function`, which residuals depend on which of them, where Jacobians have entries,
    /// and whether it is affine apart from the kinks, by evaluations at x = 0 (and at a second point for the
    /// pattern).
    pub fn new(function: F) -> Self {
        let (n, m) = (function.num_residuals(), function.num_vars());
        let mut kinds = Vec::new();
        let x = vec![0.0; m];
        let mut out = vec![0.0; n];
        function.eval(&x, &mut Kinks::new(Mode::Record(&mut kinds)), &mut out);
        let pattern = function.pattern();
        let num_tests = kinds.iter().map(|k| k.tests()).sum();
        let Dependencies {
            rows,
            variables,
            nested,
        } = Dependencies::new(&function, &x, kinds.len(), num_tests);
        let mut traced = Self {
            coloring: Coloring::new(&pattern),
            affine: !nested && function.is_piecewise_affine(),
            function,
            kinds,
            pattern,
            rows,
            variables,
            nested,
            checked: AtomicBool::new(false),
        };
        traced.affine = traced.affine && traced.is_continuous_at_switches();
        traced
    }

    /// Adds the entries of ∇H^(σ)(x) in the rows that `wanted` names, one evaluation for all columns of a colour.
    fn derivatives(&self, selection: &Selection, x: &[f64], wanted: Option<&[usize]>, jac: &mut Matrix) {
        if !self.checked.load(Ordering::Relaxed) {
            // Within one colour, an entry missing from the pattern would be attributed to another column.
            let stray = lacking(&self.pattern, x, &mut |x, _, out| {
                self.function.eval(x, &mut Kinks::new(Mode::Joined), out);
            });
            if let Some((i, j)) = stray {
                jac.refuse(i, j);
                return;
            }
            self.checked.store(true, Ordering::Relaxed);
        }
        let mut seeded: Vec<Dual64> = x.iter().map(|&v| Dual64::from(v)).collect();
        let mut out = vec![Dual64::from(0.0); self.num_residuals()];
        let entries = |j: usize| {
            let column = &self.pattern.row_idx()[self.pattern.col_ptr()[j]..self.pattern.col_ptr()[j + 1]];
            let asked = |i: &&usize| wanted.is_none_or(|rows| rows.binary_search(i).is_ok());
            column.iter().filter(asked).copied()
        };
        for group in self.coloring.groups() {
            if group.iter().all(|&j| entries(j).next().is_none()) {
                continue;
            }
            group.iter().for_each(|&j| seeded[j].eps = 1.0);
            self.evaluate(Some(selection), &seeded, &mut out, &mut []);
            for &j in group {
                seeded[j].eps = 0.0;
                entries(j).for_each(|i| jac.add(i, j, out[i].eps));
            }
        }
    }

    /// Residuals and test functions of the pieces of a selection, or of those that the test functions choose:
    /// NaN where another number of kinks is met than at first.
    fn evaluate<T: Real>(&self, selection: Option<&Selection>, x: &[T], residual: &mut [T], tests: &mut [T]) {
        let mut kinks = Kinks::new(Mode::Pieces(selection, &mut *tests));
        self.function.eval(x, &mut kinks, residual);
        if kinks.site != self.kinds.len() {
            // Derivatives that the scalar carries along become NaN, too.
            residual.iter_mut().chain(tests).for_each(|v| *v *= f64::NAN);
        }
    }

    /// The selection on which test functions depend: none where kinks are not nested.
    fn governing<'a>(&self, selection: &'a Selection) -> Option<&'a Selection> {
        self.nested.then_some(selection)
    }

    fn tests(&self, selection: Option<&Selection>, x: &[f64], out: &mut [f64]) {
        self.evaluate(selection, x, &mut vec![0.0; self.num_residuals()], out);
    }

    /// Derivatives of all test functions, or of those of a selection, along a direction.
    fn test_slopes(&self, selection: Option<&Selection>, seeded: &[Dual64], out: &mut [f64]) {
        let mut residual = vec![Dual64::from(0.0); self.num_residuals()];
        let mut tests = vec![Dual64::from(0.0); out.len()];
        self.evaluate(selection, seeded, &mut residual, &mut tests);
        for (out, test) in out.iter_mut().zip(&tests) {
            *out = test.eps;
        }
    }

    /// The function.
    pub fn function(&self) -> &F {
        &self.function
    }
}

fn seeded(x: &[f64], d: &[f64]) -> Vec<Dual64> {
    let pairs = x.iter().zip(d);
    pairs.map(|(&re, &eps)| Dual64::new(re, eps)).collect()
}

impl<F: NonsmoothFunction> PiecewiseSmooth for Traced<F> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }

    fn num_residuals(&self) -> usize {
        self.function.num_residuals()
    }

    fn num_sites(&self) -> usize {
        self.kinds.len()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.num_tests(site) + 1
    }

    fn num_tests(&self, site: usize) -> usize {
        self.kinds[site].tests()
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        const MID: [&[Facet]; 3] = [
            &[Facet::negative(0)],
            &[Facet::positive(0), Facet::negative(1)],
            &[Facet::positive(1)],
        ];
        const TWO: [&[Facet]; 2] = [&[Facet::positive(0)], &[Facet::negative(0)]];
        match self.kinds[site] {
            Kind::Mid => MID[piece.min(2)],
            _ => TWO[piece.min(1)],
        }
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.tests(None, x, out);
    }

    fn is_piecewise_affine(&self) -> bool {
        self.affine
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        self.evaluate(Some(selection), x, out, &mut []);
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        self.derivatives(selection, x, None, jac);
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

impl<F: NonsmoothFunction> Derivatives for Traced<F> {
    fn has_nested_kinks(&self) -> bool {
        self.nested
    }

    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        match d {
            Some(d) => self.test_slopes(self.governing(selection), &seeded(x, d), out),
            None => self.tests(self.governing(selection), x, out),
        }
    }

    fn expansions(&self) -> Option<Box<dyn Expansions + '_>> {
        Some(Box::new(Expanded(self)))
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        self.test_slopes(None, &seeded(x, d), out);
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let first: usize = self.kinds[..site].iter().map(|k| k.tests()).sum();
        let mut seeded: Vec<Dual64> = x.iter().map(|&v| Dual64::from(v)).collect();
        let mut slopes = vec![0.0; self.variables.len()];
        gradient.fill(0.0);
        for &j in &self.variables[first + test] {
            seeded[j].eps = 1.0;
            self.test_slopes(None, &seeded, &mut slopes);
            seeded[j].eps = 0.0;
            gradient[j] = slopes[first + test];
        }
    }
}

impl<F: NonsmoothFunction> Structure for Traced<F> {
    fn exact(&self) -> Option<&dyn ExactPieces> {
        Some(self)
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clone_from(&self.rows[site]);
    }

    fn site_jacobian(&self, site: usize, selection: &Selection, x: &[f64], jac: &mut Matrix) -> bool {
        self.derivatives(selection, x, Some(&self.rows[site]), jac);
        true
    }
}

impl<F: NonsmoothFunction> Description for Traced<F> {
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        let own = self.function.site_name(site);
        own.unwrap_or_else(|| Cow::Owned(format!("site {site}")))
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        if let Some(name) = self.function.piece_name(site, piece) {
            return name;
        }
        Cow::Borrowed(match self.kinds[site] {
            Kind::Mid => ["lower", "interior", "upper"][piece.min(2)],
            Kind::Abs => ["positive", "negative"][piece.min(1)],
            Kind::Max | Kind::Min | Kind::Switch => ["first", "second"][piece.min(1)],
        })
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        self.function.typical_sizes(sizes);
    }
}
