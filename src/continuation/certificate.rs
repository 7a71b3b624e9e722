//! Certificates of local uniqueness at points of a curve.

use super::point::active::vanishing_at;
use super::point::coincidence::keep_inside;
use super::{Branch, ContinuationError, ContinuationOptions, Transition};
use crate::input::check_vector;
use crate::piecewise::{
    ActiveSet, LocalUniqueness, PiecewiseSmooth, Selection, TestLayout, local_uniqueness,
    local_uniqueness_with, select,
};
use crate::sparse::Matrix;

/// [`local_uniqueness`] at a solution x, with the rule of the continuation for vanishing test functions
/// ([`vanishing_distance`](ContinuationOptions::vanishing_distance)) and its cap on active selections.
///
/// # Complexity
/// Each active selection, up to [`max_selections`](ContinuationOptions::max_selections) of the kᵖ at p sites with k active pieces each, takes
/// a factorisation of ∇_yH and a solve for each column of `load`.
///
/// # Errors
/// As [`local_uniqueness`].
///
/// ```
/// use semismooth::continuation::{ContinuationOptions, certify};
/// use semismooth::piecewise::MinMap;
/// use semismooth::sparse::Matrix;
/// // α = |y| folds at 0 and is regular elsewhere.
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let (load, options) = (Matrix::identity(1), ContinuationOptions::default());
/// assert!(certify(&map, &[0.0, 0.0], &load, &options)?.fails());
/// let constant = certify(&map, &[0.5, 0.5], &load, &options)?.constant();
/// assert!(constant.is_some_and(|c| (c - 1.0).abs() < 1e-6));
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
pub fn certify<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    load: &Matrix,
    options: &ContinuationOptions,
) -> Result<LocalUniqueness, ContinuationError> {
    let active = active_at(&map, x, options)?;
    Ok(local_uniqueness(map, x, &active, load, options.max_selections)?)
}

/// [`certify`] for parameters p on which the pieces depend, `derivative` giving ∂_pH^(σ) (n × k) of a selection: for example the
/// coefficients of friction, with [`friction_derivative`](crate::contact::friction_derivative).
///
/// # Errors
/// As [`local_uniqueness_with`].
pub fn certify_with<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    derivative: impl Fn(&Selection) -> Matrix,
    options: &ContinuationOptions,
) -> Result<LocalUniqueness, ContinuationError> {
    let active = active_at(&map, x, options)?;
    let most = options.max_selections;
    Ok(local_uniqueness_with(map, x, &active, derivative, most)?)
}

fn active_at(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &ContinuationOptions,
) -> Result<ActiveSet, ContinuationError> {
    options.validate()?;
    check_vector("the point x", x, map.num_vars())?;
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(x, &mut theta);
    let (selection, distance) = (select(map, x), options.vanishing_distance);
    let vanishing = vanishing_at(map, &layout, &selection, x, &theta, distance, &[]);
    let indices = vanishing.iter().map(|v| v.index).collect();
    Ok(ActiveSet::from_tests(map, &layout, &theta, indices))
}

impl Transition {
    /// Whether the solution is locally unique here: [`local_uniqueness`] over the selections active at this transition.
    ///
    /// # Errors
    /// As [`local_uniqueness`].
    pub fn certify<P: PiecewiseSmooth + ?Sized>(
        &self,
        map: &P,
        load: &Matrix,
        options: &ContinuationOptions,
    ) -> Result<LocalUniqueness, ContinuationError> {
        let layout = TestLayout::new(map);
        check_vector(
            "the test functions of the transition",
            &self.test_functions,
            layout.total(),
        )?;
        // Those recorded may be in the user's scale, in which rounding decides signs.
        let mut theta = vec![0.0; layout.total()];
        map.test_functions(&self.x, &mut theta);
        keep_inside(&map, &layout, &self.before, &self.vanishing, &mut theta);
        let active = ActiveSet::from_tests(map, &layout, &theta, self.vanishing.clone());
        let most = options.max_selections;
        Ok(local_uniqueness(map, &self.x, &active, load, most)?)
    }
}

impl Branch {
    /// Certificates at all points of the branch, events included, by arclength: (arclength, certificate).
    ///
    /// # Errors
    /// As [`certify`].
    pub fn certify<P: PiecewiseSmooth + ?Sized>(
        &self,
        map: &P,
        load: &Matrix,
        options: &ContinuationOptions,
    ) -> Result<Vec<(f64, LocalUniqueness)>, ContinuationError> {
        let mut list = Vec::new();
        for transition in &self.transitions {
            list.push((transition.arclength, transition.certify(map, load, options)?));
        }
        // ∇_yH is singular there by definition, to within the rounding of the location.
        for fold in &self.smooth_folds {
            let singular = (fold.selection.clone(), 0);
            let fails = LocalUniqueness::Fails {
                first: singular.clone(),
                second: singular,
            };
            list.push((fold.arclength, fails));
        }
        let branchings = self.branch_points.iter().map(|b| &b.point);
        for point in self.points.iter().chain(&self.turns).chain(branchings) {
            list.push((point.arclength, certify(map, &point.x, load, options)?));
        }
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(list)
    }
}
