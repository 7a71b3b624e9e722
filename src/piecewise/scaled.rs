use std::borrow::Cow;
use std::cell::RefCell;

use super::{
    Condensed, Derivatives, Description, ExactPieces, Expansions, Facet, PiecewiseError, PiecewiseSmooth,
    PiecewiseSmoothExt, Selection, Structure,
};
use crate::input::check_vector;
use crate::sparse::{Matrix, Pattern, norm};

/// A map in scaled variables z, x = D z, where D holds typical sizes of the variables. Distances and angles in z do not depend on the
/// units of x. Lengths that are given or reported along a curve are those in the unit of the parameter: in z times its size.
#[derive(Debug)]
pub(crate) struct Scaled<M> {
    /// D, rounded to powers of two so that scaling is exact; empty for the identity.
    sizes: Vec<f64>,
    buffers: RefCell<(Vec<f64>, Vec<f64>)>,
    rows: RefCell<Vec<usize>>,
    map: M,
}

/// Whether a size is near enough to 1 to need no scaling.
pub(crate) fn is_ordinary(size: f64) -> bool {
    (1e-3..=1e3).contains(&size)
}

/// Smallest ratio of sizes; beyond, squares overflow.
const SMALLEST: f64 = 1e-100;

impl<M: PiecewiseSmooth> Scaled<M> {
    /// Scaled by the sizes given or, where there are none, by those that the map tells; where its pieces are affine, or exact coefficients
    /// affine in α, only if they are far from 1. That of a parameter is then at most the largest of 1 and the bounds of `range`, so that
    /// small changes are resolved.
    ///
    /// # Errors
    /// Sizes of another number than the variables, or not positive and finite.
    pub(crate) fn new(map: M, given: &[f64], range: (f64, f64)) -> Result<Self, PiecewiseError> {
        let sizes = sizes_of(&map, given, range)?;
        Self::with_divisors(map, sizes)
    }

    /// With D as returned by [`divisors`](ScaledMap::divisors).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn with_divisors(map: M, sizes: Vec<f64>) -> Result<Self, PiecewiseError> {
        if !sizes.is_empty() {
            check_sizes(&sizes, map.num_vars())?;
        }
        let buffer = vec![0.0; sizes.len()];
        Ok(Self {
            sizes,
            buffers: RefCell::new((buffer.clone(), buffer)),
            rows: RefCell::default(),
            map,
        })
    }
}

impl<M> Scaled<M> {
    /// The same scaling of another map.
    pub(crate) fn with_map<N>(self, map: N) -> Scaled<N> {
        Scaled {
            sizes: self.sizes,
            buffers: self.buffers,
            rows: self.rows,
            map,
        }
    }
}

/// A map in scaled variables whatever the type of the map, so that what follows curves is compiled once.
pub(crate) trait ScaledMap: PiecewiseSmooth {
    /// D; empty for the identity.
    fn divisors(&self) -> &[f64];

    /// A function of x at z.
    fn value_at(&self, z: &[f64], function: &dyn Fn(&[f64]) -> f64) -> f64;

    /// The size of the parameter of a curve, by which lengths along it are divided; 1 for an equation.
    fn parameter_size(&self) -> f64 {
        match self.divisors().last() {
            Some(size) if self.divisors().len() > self.num_residuals() => *size,
            _ => 1.0,
        }
    }

    /// x ↦ z.
    fn scale(&self, x: &mut [f64]) {
        x.iter_mut().zip(self.divisors()).for_each(|(x, d)| *x /= d);
    }

    /// z ↦ x.
    fn unscale(&self, z: &mut [f64]) {
        z.iter_mut().zip(self.divisors()).for_each(|(z, d)| *z *= d);
    }

    /// The direction in z of a direction in x; unit vectors stay unit vectors.
    fn scale_direction(&self, t: &mut [f64]) {
        if !self.divisors().is_empty() {
            self.scale(t);
            normalise(t);
        }
    }

    /// The direction in x of a direction in z.
    fn unscale_direction(&self, t: &mut [f64]) {
        if !self.divisors().is_empty() {
            self.unscale(t);
            normalise(t);
        }
    }
}

impl<M: PiecewiseSmooth> ScaledMap for Scaled<M> {
    fn divisors(&self) -> &[f64] {
        &self.sizes
    }

    fn value_at(&self, z: &[f64], function: &dyn Fn(&[f64]) -> f64) -> f64 {
        self.at(z, function)
    }
}

impl<M: PiecewiseSmooth> Scaled<M> {
    /// The map in its own variables.
    pub(crate) fn map(&self) -> &M {
        &self.map
    }

    /// Evaluates a function of x at z.
    fn at<R>(&self, z: &[f64], evaluate: impl FnOnce(&[f64]) -> R) -> R {
        if self.sizes.is_empty() {
            return evaluate(z);
        }
        let mut x = std::mem::take(&mut self.buffers.borrow_mut().0);
        x.clear();
        x.extend(z.iter().zip(&self.sizes).map(|(z, d)| z * d));
        let value = evaluate(&x);
        self.buffers.borrow_mut().0 = x;
        value
    }

    /// Evaluates a function of the direction D d.
    fn along<R>(&self, d: &[f64], evaluate: impl FnOnce(&[f64]) -> R) -> R {
        let mut direction = std::mem::take(&mut self.buffers.borrow_mut().1);
        direction.clear();
        direction.extend(d.iter().zip(&self.sizes).map(|(d, s)| d * s));
        let value = evaluate(&direction);
        self.buffers.borrow_mut().1 = direction;
        value
    }
}

/// D by the rules of [`Scaled::new`].
fn sizes_of(map: &dyn PiecewiseSmooth, given: &[f64], range: (f64, f64)) -> Result<Vec<f64>, PiecewiseError> {
    let m = map.num_vars();
    let mut sizes = given.to_vec();
    if given.is_empty() {
        sizes.resize(m, 1.0);
        map.typical_sizes(&mut sizes);
    }
    check_sizes(&sizes, m)?;
    if given.is_empty() {
        if m > map.num_residuals()
            && let Some(parameter) = sizes.last_mut()
        {
            *parameter = parameter.min(range.0.abs().max(range.1.abs()).max(1.0));
        }
        // Without curvature nothing is measured in steps, and exact coefficients are those of the map's own variables.
        let own = map.is_piecewise_affine() || map.exact().is_some_and(ExactPieces::is_affine_in_parameter);
        if own && sizes.iter().all(|s| is_ordinary(*s)) {
            sizes.clear();
        }
    }
    for size in &mut sizes {
        *size = size.clamp(SMALLEST, 1.0 / SMALLEST).log2().round().exp2();
    }
    if sizes.iter().all(|s| *s == 1.0) {
        sizes.clear();
    }
    Ok(sizes)
}

/// Checks that there are `expected` sizes, all positive and finite.
pub(crate) fn check_sizes(sizes: &[f64], expected: usize) -> Result<(), PiecewiseError> {
    check_vector("the list of typical sizes", sizes, expected)?;
    match sizes.iter().position(|s| *s <= 0.0) {
        Some(index) => Err(PiecewiseError::Size {
            index,
            value: sizes[index],
        }),
        None => Ok(()),
    }
}

fn normalise(t: &mut [f64]) {
    // Divided twice, as squares of sizes far from 1 may overflow.
    let largest = t.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    if largest > 0.0 && largest.is_finite() {
        t.iter_mut().for_each(|v| *v /= largest);
        let length = norm(t);
        t.iter_mut().for_each(|v| *v /= length);
    }
}

impl<M: PiecewiseSmooth> PiecewiseSmooth for Scaled<M> {
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
    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        self.at(z, |x| self.map.test_functions(x, out));
    }
    fn residual(&self, selection: &Selection, z: &[f64], out: &mut [f64]) {
        self.at(z, |x| self.map.residual(selection, x, out));
    }
    fn jacobian(&self, selection: &Selection, z: &[f64], jac: &mut Matrix) {
        self.at(z, |x| self.map.jacobian(selection, x, jac));
        if !self.sizes.is_empty() {
            jac.scale_columns(&self.sizes);
        }
    }
    fn pattern(&self) -> Pattern {
        self.map.pattern()
    }
    fn is_piecewise_affine(&self) -> bool {
        self.map.is_piecewise_affine()
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

impl<M: PiecewiseSmooth> Derivatives for Scaled<M> {
    fn expansions(&self) -> Option<Box<dyn Expansions + '_>> {
        let map = self.map.expansions()?;
        let sizes = &self.sizes;
        Some(if sizes.is_empty() {
            map
        } else {
            Box::new(ScaledExpansions { map, sizes })
        })
    }
    fn test_derivatives(&self, z: &[f64], d: &[f64], out: &mut [f64]) {
        if self.sizes.is_empty() {
            return self.map.test_derivatives(z, d, out);
        }
        self.along(d, |direction| {
            self.at(z, |x| self.map.test_derivatives(x, direction, out));
        });
    }
    fn has_nested_kinks(&self) -> bool {
        self.map.has_nested_kinks()
    }
    fn tests_of_selection(&self, selection: &Selection, z: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        let Some(d) = d.filter(|_| !self.sizes.is_empty()) else {
            return self.at(z, |x| self.map.tests_of_selection(selection, x, d, out));
        };
        self.along(d, |direction| {
            self.at(z, |x| {
                self.map.tests_of_selection(selection, x, Some(direction), out)
            });
        });
    }
    fn test_gradient(&self, site: usize, test: usize, z: &[f64], gradient: &mut [f64]) {
        self.at(z, |x| self.map.test_gradient(site, test, x, gradient));
        self.unscale(gradient);
    }
}

impl<M: PiecewiseSmooth> Structure for Scaled<M> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.map.site_rows(site, rows);
    }
    fn site_jacobian(&self, site: usize, selection: &Selection, z: &[f64], jac: &mut Matrix) -> bool {
        if self.sizes.is_empty() {
            return self.map.site_jacobian(site, selection, z, jac);
        }
        let done = self.at(z, |x| self.map.site_jacobian(site, selection, x, jac));
        if done {
            // The other rows of `jac` are scaled already.
            let mut rows = self.rows.borrow_mut();
            self.map.site_rows(site, &mut rows);
            rows.sort_unstable();
            rows.dedup();
            jac.scale_columns_in_rows(&self.sizes, &rows);
        }
        done
    }
    fn exact(&self) -> Option<&dyn ExactPieces> {
        // Exact coefficients are those of the map's own variables.
        if self.sizes.is_empty() {
            self.map.exact()
        } else {
            None
        }
    }
    fn condensed(&self) -> Option<Condensed<'_>> {
        let condensed = self.map.structure()?.condensed()?;
        if !condensed.sizes.is_empty() {
            return None;
        }
        Some(Condensed {
            sizes: &self.sizes,
            ..condensed
        })
    }
}

impl<M: PiecewiseSmooth> Description for Scaled<M> {
    fn reported_tests(&self, z: &[f64], out: &mut [f64]) -> bool {
        self.at(z, |x| self.map.reported_tests(x, out))
    }
    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.map.piece_name(site, piece)
    }
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.map.site_name(site)
    }
}

struct ScaledExpansions<'a> {
    map: Box<dyn Expansions + 'a>,
    sizes: &'a [f64],
}

impl ScaledExpansions<'_> {
    fn unscaled(&self, z: &[f64]) -> Vec<f64> {
        z.iter().zip(self.sizes).map(|(z, d)| z * d).collect()
    }
}

impl Expansions for ScaledExpansions<'_> {
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]) {
        let arc: Vec<Vec<f64>> = arc.iter().map(|z| self.unscaled(z)).collect();
        let arc: Vec<&[f64]> = arc.iter().map(Vec::as_slice).collect();
        self.map.along(selection, &arc, residual, tests);
    }

    fn jacobian_within(
        &self,
        selection: &Selection,
        centre: &[f64],
        radius: &[f64],
        jacobian: &mut [(f64, f64)],
        tests: &mut [(f64, f64)],
    ) -> bool {
        let (centre, radius) = (self.unscaled(centre), self.unscaled(radius));
        let known = self
            .map
            .jacobian_within(selection, &centre, &radius, jacobian, tests);
        for row in [jacobian, tests]
            .into_iter()
            .flat_map(|m| m.chunks_exact_mut(self.sizes.len()))
        {
            // Powers of two: nothing is rounded.
            for (entry, size) in row.iter_mut().zip(self.sizes) {
                *entry = (entry.0 * size, entry.1 * size);
            }
        }
        known
    }

    fn derivatives_within(
        &self,
        selection: &Selection,
        centre: &[f64],
        radius: &[f64],
        direction: &[f64],
        residual: &mut [(f64, f64)],
        tests: &mut [(f64, f64)],
    ) -> bool {
        let [centre, radius, direction] = [centre, radius, direction].map(|z| self.unscaled(z));
        self.map
            .derivatives_within(selection, &centre, &radius, &direction, residual, tests)
    }
}
