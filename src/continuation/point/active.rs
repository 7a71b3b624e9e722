//! Which test functions vanish at a point, and the search for its arms.

use std::collections::BTreeSet;

use super::search::ArmSearch;
use super::units::Units;
use super::{Arms, Wanted};
use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, Solver};
use crate::piecewise::{
    ActiveSet, PiecewiseSmooth, PiecewiseSmoothExt, ScaledMap, Selection, TestLayout, Vanishing,
};
use crate::sparse::norm;
use crate::spread::centred;
/// How much smaller than ‖∇θ‖ the largest of two directional derivatives may be.
const SPREAD: f64 = 1e5;

/// The vanishing test functions at x: those within `distance`·(1 + ‖x‖) of their facet, and those `forced`.
pub(in crate::continuation) fn vanishing_at<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    layout: &TestLayout,
    selection: &Selection,
    x: &[f64],
    theta: &[f64],
    distance: f64,
    forced: &[usize],
) -> Vec<Vanishing> {
    let reach = distance * (1.0 + norm(x));
    let sizes = gradient_sizes(map, selection, x, theta.len());
    let mut list = Vec::new();
    for (index, value) in theta.iter().enumerate() {
        let is_forced = forced.contains(&index);
        if !is_forced && value.abs() > SPREAD * reach * sizes[index] {
            continue;
        }
        let candidate = Vanishing::new(map, layout, selection, index, x);
        if is_forced || value.abs() <= reach * candidate.gradient_norm {
            list.push(candidate);
        }
    }
    list
}

/// Sizes of the gradients of all test functions, from two directional derivatives, as gradients are expensive. They are hardly ever too
/// small by more than [`SPREAD`].
pub(super) fn gradient_sizes<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    selection: &Selection,
    x: &[f64],
    tests: usize,
) -> Vec<f64> {
    let mut sizes = vec![0.0f64; tests];
    let (mut rates, mut direction) = (vec![0.0; tests], vec![0.0; x.len()]);
    for second in [false, true] {
        for (j, d) in direction.iter_mut().enumerate() {
            *d = centred(j + 1, second);
        }
        map.tests_of_selection(selection, x, Some(&direction), &mut rates);
        for (size, rate) in sizes.iter_mut().zip(&rates) {
            *size = size.max(rate.abs());
        }
    }
    sizes
}

impl<'a> Curve<'a> {
    pub(in crate::continuation) fn vanishing_here(&self, forced: &[usize]) -> Vec<Vanishing> {
        let distance = self.setup.options.vanishing_distance;
        let (map, layout, selection) = (&self.map, &self.setup.layout, &self.path.selection);
        let (x, theta) = (&self.here.x, &self.here.theta);
        let mut list = vanishing_at(map, layout, selection, x, theta, distance, forced);
        let mut units = Units::new(map, selection, x);
        list.retain(|v| forced.contains(&v.index) || units.is_near(v, theta[v.index], distance));
        list
    }

    pub(in crate::continuation) fn active_here(&self, vanishing: &[Vanishing]) -> ActiveSet {
        let indices = vanishing.iter().map(|v| v.index).collect();
        ActiveSet::from_tests(&self.map, &self.setup.layout, &self.here.theta, indices)
    }

    pub(in crate::continuation) fn all_arms(
        &mut self,
        vanishing: &[Vanishing],
    ) -> Result<Arms, ContinuationError> {
        self.arms_with(vanishing, None)
    }

    /// All arms, or where a sign of α̇ is given one on which α moves so, and others that are found with it.
    pub(in crate::continuation) fn arms_with(
        &mut self,
        vanishing: &[Vanishing],
        rate: Option<f64>,
    ) -> Result<Arms, ContinuationError> {
        let active = self.active_here(vanishing);
        if let Some(&site) = active.outside().first() {
            return Err(ContinuationError::Outside {
                site: self.map.site_name(site).into_owned(),
            });
        }
        let start = self.path.selection.clone();
        // As the point was located.
        let singular = self.here.orientation.is_none() && self.here.det_sign == Some(0);
        let mut search = self.search(vanishing);
        search.unknown = !search.map.is_piecewise_affine();
        search.singular = singular.then(|| start.clone());
        match rate {
            Some(rate) => Ok(search.following(&active, Wanted::Rate(rate), &start)?),
            None => Ok(search.all(&active)?),
        }
    }

    pub(in crate::continuation) fn search<'s>(
        &'s mut self,
        vanishing: &'s [Vanishing],
    ) -> ArmSearch<'s, dyn ScaledMap + 'a, Solver<'a>> {
        ArmSearch {
            map: &self.map,
            corrector: &mut self.corrector,
            options: &self.setup.options,
            layout: &self.setup.layout,
            x: &self.here.x,
            theta: &self.here.theta,
            vanishing,
            singular: None,
            within: f64::INFINITY,
            unknown: false,
            deadline: self.setup.deadline(),
            decomposed: false,
            found: Vec::new(),
            seen: BTreeSet::new(),
            solids: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::vanishing_at;
    use crate::continuation::testing::Plane;
    use crate::piecewise::{Selection, TestLayout};

    /// θ = 10 y next to its zero: within the distance, which is one of x, or where it is known to vanish.
    #[test]
    fn facets_within_the_distance_vanish_and_those_that_are_forced() {
        let map = Plane::within(|y, _| [y, 1.0, 0.0], &[|y, _| [10.0 * y, 10.0, 0.0]]);
        let (layout, selection) = (TestLayout::new(&map), Selection::uniform(1, 0));
        let count = |y: f64, distance: f64, forced: &[usize]| {
            vanishing_at(
                &map,
                &layout,
                &selection,
                &[y, 0.0],
                &[10.0 * y],
                distance,
                forced,
            )
            .len()
        };
        for y in [1e-9, 1e-6, 0.5] {
            assert_eq!(
                (count(y, 0.99 * y / (1.0 + y), &[]), count(y, 1.01 * y, &[])),
                (0, 1),
                "{y}"
            );
            assert_eq!((count(y, 1e-15, &[0]), count(-y, 1e-15, &[0])), (1, 1), "{y}");
        }
    }
}
