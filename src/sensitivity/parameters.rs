//! Maps whose last variables are parameters.

use std::borrow::Cow;

use crate::InputError;
use crate::input::check_length;
use crate::linear::LinearError;
use crate::piecewise::{
    Derivatives, Description, Facet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection,
    Structure,
};
use crate::sparse::{Matrix, Pattern};

/// What a map in other variables has in common with the one it is made of.
macro_rules! same_pieces {
    ($map:ident) => {
        fn num_residuals(&self) -> usize {
            self.$map.num_residuals()
        }
        fn num_sites(&self) -> usize {
            self.$map.num_sites()
        }
        fn num_pieces(&self, site: usize) -> usize {
            self.$map.num_pieces(site)
        }
        fn num_tests(&self, site: usize) -> usize {
            self.$map.num_tests(site)
        }
        fn cell(&self, site: usize, piece: usize) -> &[Facet] {
            self.$map.cell(site, piece)
        }
        fn pattern(&self) -> Pattern {
            self.pattern.clone()
        }
        fn is_piecewise_affine(&self) -> bool {
            self.$map.is_piecewise_affine()
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
    };
}

macro_rules! same_names {
    ($map:ident) => {
        fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
            self.$map.piece_name(site, piece)
        }
        fn site_name(&self, site: usize) -> Cow<'_, str> {
            self.$map.site_name(site)
        }
    };
}

/// The map H(x) + C θ in the variables (x, θ), θ being parameters that its residuals are affine functions of
/// and its test functions do not depend on, as loads of [contact problems](crate::contact). H may have
/// parameters of its own behind its unknowns; they come first.
///
/// ```
/// use semismooth::piecewise::MinMap;
/// use semismooth::sensitivity::{Loaded, Sensitivity};
/// use semismooth::sparse::Matrix;
/// // min(x, 2 x) = θ at θ = −1: x = −1/2, and x′ = 1/2.
/// let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = 2.0 * x[0]; });
/// let loaded = Loaded::new(map, Matrix::from_rows(&[[-1.0]])?)?;
/// let mut found = Sensitivity::new(loaded, &[-0.5], &[-1.0])?;
/// assert!((found.jvp(&[1.0])?[0] - 0.5).abs() < 1e-9); // differences of the two functions
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded<P> {
    map: P,
    columns: Matrix,
    own: Pattern,
    pattern: Pattern,
}

impl<P: PiecewiseSmooth> Loaded<P> {
    /// The map H (n residuals, n variables or more) with the columns C (n × k).
    ///
    /// # Errors
    /// Other shapes, entries that are not finite.
    pub fn new(map: P, columns: Matrix) -> Result<Self, PiecewiseError> {
        let n = map.num_residuals();
        check_length("the rows of the columns C", columns.nrows(), n)?;
        columns.check_finite().map_err(LinearError::from)?;
        let own = map.pattern();
        let entries = own.nrows() * own.ncols();
        check_length(
            "the declared pattern (rows times columns)",
            entries,
            n * map.num_vars(),
        )?;
        let pattern = beside(&own, columns.pattern()).map_err(LinearError::from)?;
        Ok(Self {
            map,
            columns,
            own,
            pattern,
        })
    }
}

/// Two patterns of as many rows, one beside the other.
fn beside(left: &Pattern, right: &Pattern) -> Result<Pattern, InputError> {
    let mut ptr = left.col_ptr().to_vec();
    ptr.extend(right.col_ptr()[1..].iter().map(|p| left.nnz() + p));
    let mut rows = left.row_idx().to_vec();
    rows.extend(right.row_idx());
    Pattern::from_csc(left.nrows(), left.ncols() + right.ncols(), ptr, rows)
}

impl<P: PiecewiseSmooth> PiecewiseSmooth for Loaded<P> {
    same_pieces!(map);
    fn num_vars(&self) -> usize {
        self.map.num_vars() + self.columns.ncols()
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.map.test_functions(&x[..self.map.num_vars()], out);
    }
    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (x, load) = x.split_at(self.map.num_vars());
        self.map.residual(selection, x, out);
        self.columns.as_ref().mul_add(1.0, load, out);
    }
    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let mut own = Matrix::zeros(self.own.clone());
        self.map.jacobian(selection, &x[..self.map.num_vars()], &mut own);
        if let Some((row, col)) = own.stray() {
            jac.refuse(row, col);
        }
        let values = own.values().iter().chain(self.columns.values());
        jac.values_mut()
            .iter_mut()
            .zip(values)
            .for_each(|(v, own)| *v += own);
    }
}

impl<P: PiecewiseSmooth> Structure for Loaded<P> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.map.site_rows(site, rows);
    }
}

impl<P: PiecewiseSmooth> Derivatives for Loaded<P> {
    fn has_nested_kinks(&self) -> bool {
        self.map.has_nested_kinks()
    }
    fn test_roundings(&self, x: &[f64], out: &mut [f64]) {
        if let Some(own) = self.map.derivatives() {
            own.test_roundings(&x[..self.map.num_vars()], out);
        }
    }
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let n = self.map.num_vars();
        self.map.test_derivatives(&x[..n], &d[..n], out);
    }
    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        let n = self.map.num_vars();
        self.map
            .tests_of_selection(selection, &x[..n], d.map(|d| &d[..n]), out);
    }
    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let (own, load) = gradient.split_at_mut(self.map.num_vars());
        self.map.test_gradient(site, test, &x[..own.len()], own);
        load.fill(0.0);
    }
}

impl<P: PiecewiseSmooth> Description for Loaded<P> {
    same_names!(map);
    fn typical_sizes(&self, sizes: &mut [f64]) {
        self.map.typical_sizes(&mut sizes[..self.map.num_vars()]);
    }
}

/// The curve H(x, θ + α s δ) = 0 in the variables (x, α), s being the unit of α.
pub(super) struct Line<'a> {
    map: &'a dyn PiecewiseSmooth,
    from: &'a [f64],
    /// s δ.
    direction: Vec<f64>,
    inner: Pattern,
    pattern: Pattern,
}

impl<'a> Line<'a> {
    pub(super) fn new(
        map: &'a dyn PiecewiseSmooth,
        from: &'a [f64],
        delta: &[f64],
        unit: f64,
    ) -> Result<Self, PiecewiseError> {
        let inner = map.pattern();
        let n = map.num_residuals();
        let entries = (0..inner.ncols()).flat_map(|j| {
            inner.row_idx()[inner.col_ptr()[j]..inner.col_ptr()[j + 1]]
                .iter()
                .map(move |i| (*i, j.min(n)))
        });
        let pattern = Pattern::from_entries(n, n + 1, entries).map_err(LinearError::from)?;
        Ok(Self {
            map,
            from,
            direction: delta.iter().map(|d| unit * d).collect(),
            inner,
            pattern,
        })
    }

    fn point(&self, x: &[f64]) -> Vec<f64> {
        let (own, alpha) = x.split_at(self.map.num_residuals());
        let moved = self
            .from
            .iter()
            .zip(&self.direction)
            .map(|(t, d)| t + alpha[0] * d);
        own.iter().copied().chain(moved).collect()
    }

    fn change(&self, d: &[f64]) -> Vec<f64> {
        let (own, rate) = d.split_at(self.map.num_residuals());
        own.iter()
            .copied()
            .chain(self.direction.iter().map(|d| rate[0] * d))
            .collect()
    }
}

impl PiecewiseSmooth for Line<'_> {
    same_pieces!(map);
    fn num_vars(&self) -> usize {
        self.map.num_residuals() + 1
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.map.test_functions(&self.point(x), out);
    }
    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        self.map.residual(selection, &self.point(x), out);
    }
    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let mut own = Matrix::zeros(self.inner.clone());
        self.map.jacobian(selection, &self.point(x), &mut own);
        if let Some((row, col)) = own.stray() {
            jac.refuse(row, col);
        }
        let n = self.map.num_residuals();
        for (i, j, v) in own.triplets() {
            match j.checked_sub(n) {
                Some(k) => jac.add(i, n, v * self.direction[k]),
                None => jac.add(i, j, v),
            }
        }
    }
}

impl Structure for Line<'_> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.map.site_rows(site, rows);
    }
}

impl Derivatives for Line<'_> {
    fn has_nested_kinks(&self) -> bool {
        self.map.has_nested_kinks()
    }
    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        self.map.test_derivatives(&self.point(x), &self.change(d), out);
    }
    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        let change = d.map(|d| self.change(d));
        self.map
            .tests_of_selection(selection, &self.point(x), change.as_deref(), out);
    }
    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let n = self.map.num_residuals();
        let mut own = vec![0.0; self.map.num_vars()];
        self.map.test_gradient(site, test, &self.point(x), &mut own);
        gradient[..n].copy_from_slice(&own[..n]);
        gradient[n] = own[n..].iter().zip(&self.direction).map(|(g, d)| g * d).sum();
    }
}

impl Description for Line<'_> {
    same_names!(map);
    fn typical_sizes(&self, sizes: &mut [f64]) {
        let n = self.map.num_residuals();
        let mut own = vec![1.0; self.map.num_vars()];
        self.map.typical_sizes(&mut own);
        sizes[..n].copy_from_slice(&own[..n]);
    }
}
