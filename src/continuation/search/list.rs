//! The solutions at a parameter, by whichever method the map allows.

use std::ops::ControlFlow;

use super::{FoundSolutions, SearchOptions, search_solutions_observed};
use crate::continuation::ContinuationError;
use crate::enumeration::{
    Completeness, Doubt, EnumerationError, EnumerationOptions, SolutionSet, all_solutions_until,
};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use crate::sparse::Matrix;

/// What [`list_solutions`] returns.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SolutionList {
    /// Every selection was examined, or excluded, as far as the list says: the pieces are affine.
    Enumerated(SolutionSet),
    /// The pieces are curved, and these solutions were found by a search.
    Searched(FoundSolutions),
}

/// The solutions of H(y, α) = 0 at fixed `alpha` (of H(x) = 0 for a map without parameter): all of them, by
/// [`all_solutions`](crate::enumeration::all_solutions), if the pieces are affine in y there, else those that
/// [`search_solutions`](super::search_solutions) finds. `stop` is called often, and ends the work where it returns `true`.
///
/// # Errors
/// As the two functions, except that pieces which are not affine are no error.
///
/// ```
/// use semismooth::continuation::{SearchOptions, SolutionList, list_solutions};
/// use semismooth::enumeration::EnumerationOptions;
/// use semismooth::piecewise::MinMap;
/// // min(y³ − y, y + 3) = 0
/// let curved = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[0] * x[0] * x[0] - x[0];
///     b[0] = x[0] + 3.0;
/// });
/// let list = list_solutions(&curved, 0.0, &EnumerationOptions::default(), &SearchOptions::default(), &|| false)?;
/// assert!(matches!(list, SolutionList::Searched(found) if found.solutions.len() == 3));
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
pub fn list_solutions<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    alpha: f64,
    enumeration: &EnumerationOptions,
    search: &SearchOptions,
    stop: &dyn Fn() -> bool,
) -> Result<SolutionList, ContinuationError> {
    list(&map, alpha, enumeration, search, stop)
}

fn list(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    enumeration: &EnumerationOptions,
    search: &SearchOptions,
    stop: &dyn Fn() -> bool,
) -> Result<SolutionList, ContinuationError> {
    match all_solutions_until(map, alpha, enumeration, stop) {
        Ok(found) if !is_curved(map, alpha, &found) => Ok(SolutionList::Enumerated(found)),
        Ok(_) | Err(EnumerationError::NotAffine { .. }) => {
            let none: [Vec<f64>; 0] = [];
            let observe = |_: &FoundSolutions| match stop() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            search_solutions_observed(map, alpha, &none, search, observe).map(SolutionList::Searched)
        }
        Err(e) => Err(e.into()),
    }
}

/// Whether pieces that the map cannot state as affine have other derivatives far from 0 than at 0. Near 0, where lists are tested, x²⁰ looks
/// constant.
fn is_curved(map: &dyn PiecewiseSmooth, alpha: f64, found: &SolutionSet) -> bool {
    let unstated = matches!(
        found.completeness,
        Completeness::Undecided {
            doubt: Doubt::NoCoefficients,
            ..
        }
    );
    if !unstated
        || map
            .exact()
            .is_some_and(|pieces| pieces.conditions(alpha).is_some())
    {
        return false;
    }
    let n = map.num_residuals();
    let at = |y: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..map.num_vars())
            .map(|i| if i < n { y(i) } else { alpha })
            .collect()
    };
    let points = [at(&|_| 0.0), at(&|i| ((i * 7919 + 3571) % 1009) as f64 - 504.5)];
    let mut both = [Matrix::zeros(map.pattern()), Matrix::zeros(map.pattern())];
    let mut differs = |selection: &Selection| {
        for (jac, x) in both.iter_mut().zip(&points) {
            jac.clear();
            map.jacobian(selection, x, jac);
        }
        let mut entries = both[0].triplets().zip(both[1].triplets());
        // In this form NaN differs.
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
        entries.any(|((_, j, a), (.., b))| j < n && !same(a, b))
    };
    let base = Selection::uniform(map.num_sites(), 0);
    let other = |(site, piece): (usize, usize)| {
        let mut selection = base.clone();
        selection.set(site, piece);
        selection
    };
    let mut sites = (0..map.num_sites()).flat_map(|site| (1..map.num_pieces(site)).map(move |k| (site, k)));
    differs(&base) || sites.any(|place| differs(&other(place)))
}
