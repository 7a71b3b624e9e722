//! Elements of the generalised Jacobians of Bouligand and Clarke.

use super::error::check_selection;
use super::orientation::{Cell, Cones};
use super::{Activity, PiecewiseError, PiecewiseSmooth, Selection, active_set};
use crate::InputError;
use crate::input::check_vector;
use crate::sparse::Matrix;
use crate::tolerances::SAME;

/// An element of the B-subdifferential ∂_B H(x), the set of the limits of ∇H(x_k) along points x_k → x at which H is differentiable.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BElement {
    /// An active selection σ.
    pub selection: Selection,
    /// [`Essential`](Activity::Essential), or [`Undecided`](Activity::Undecided) where it is not known whether the cell of σ has points
    /// arbitrarily near x: then the matrix may not belong to ∂_B H(x).
    pub activity: Activity,
    /// ∇H^(σ)(x), n × m, over the [pattern](PiecewiseSmooth::pattern) of the map.
    pub jacobian: Matrix,
}

/// The B-subdifferential ∂_B H(x) = {∇H^(σ)(x): σ essentially active at x} (S. Scholtes, *Introduction to Piecewise Differentiable
/// Equations* (2012), Prop. 4.3.1; J.-S. Pang, D. Ralph, Math. Oper. Res. 21 (1996), Lemma 2), one element after the other; all
/// variables count, the parameter of a curve included.
///
/// Selections come in lexicographic order; those whose cells have no points near x are left out, and different selections may have one
/// matrix. Test functions with |θ(x)| ≤ `tolerance` count as vanishing. The iterator is lazy: of 2⁵⁰ active selections take the first
/// few.
///
/// # Errors
/// A wrong length of x or values in it that are not finite. Elements are errors where a Jacobian has an entry outside the pattern or one
/// that is not finite.
///
/// ```
/// use semismooth::piecewise::{MinMap, b_subdifferential};
/// // min(x, −x) = −|x|: ∂_B = {1, −1} at 0.
/// let h = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = -x[0]; });
/// let slopes: Result<Vec<f64>, _> = b_subdifferential(&h, &[0.0], 1e-12)?
///     .map(|element| Ok(element?.jacobian.get(0, 0)))
///     .collect();
/// let slopes = slopes.map_err(|e: semismooth::piecewise::PiecewiseError| e)?;
/// assert!((slopes[0] - 1.0).abs() < 1e-9 && (slopes[1] + 1.0).abs() < 1e-9); // differences of the two functions
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn b_subdifferential<'a, P: PiecewiseSmooth + ?Sized>(
    map: &'a P,
    x: &'a [f64],
    tolerance: f64,
) -> Result<impl Iterator<Item = Result<BElement, PiecewiseError>> + 'a, PiecewiseError> {
    let m = map.num_vars();
    check_vector("the point x", x, m)?;
    let active = active_set(map, x, tolerance);
    let cones = Cones::new(Box::new(map), x, &active, m);
    let mut jac = Matrix::zeros(map.pattern());
    Ok(active
        .selections()
        .filter_map(move |selection| element(&cones, selection, &mut jac).transpose()))
}

fn element(
    cones: &Cones<'_>,
    selection: Selection,
    jac: &mut Matrix,
) -> Result<Option<BElement>, PiecewiseError> {
    let activity = match cones.element(&selection, jac)? {
        Cell::Empty => return Ok(None),
        Cell::Open => Activity::Essential,
        Cell::Unknown => Activity::Undecided,
    };
    check_jacobian(jac)?;
    Ok(Some(BElement {
        selection,
        activity,
        jacobian: jac.clone(),
    }))
}

fn check_jacobian(jac: &Matrix) -> Result<(), PiecewiseError> {
    match jac.triplets().find(|t| !t.2.is_finite()) {
        Some((index, _, value)) => Err(PiecewiseError::Input(InputError::NotFinite {
            what: "the Jacobian of an active selection, row ",
            index,
            value,
        })),
        None => Ok(()),
    }
}

/// An element Σ w_σ ∇H^(σ)(x) of Clarke's generalised Jacobian ∂H(x) = conv ∂_B H(x) (n × m), from weights w_σ ≥ 0 of sum 1. Test functions
/// with |θ(x)| ≤ `tolerance` count as vanishing.
///
/// # Errors
/// [`PiecewiseError::Combination`] for weights that are negative or do not sum to 1, and for selections that are not known to be
/// essentially active at x; wrong lengths, values that are not finite, selections of other maps.
///
/// ```
/// use semismooth::piecewise::{MinMap, Selection, clarke_element};
/// // min(x, −x) = −|x| at 0: ∂H(0) = [−1, 1] holds 0.
/// let h = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = -x[0]; });
/// let halves = [0, 1].map(|piece| (Selection::uniform(1, piece), 0.5));
/// assert!(clarke_element(&h, &[0.0], &halves, 1e-12)?.get(0, 0).abs() < 1e-9);
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn clarke_element<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    weights: &[(Selection, f64)],
    tolerance: f64,
) -> Result<Matrix, PiecewiseError> {
    let sum: f64 = weights.iter().map(|w| w.1).sum();
    let no = |what| Err(PiecewiseError::Combination { what });
    if weights.iter().any(|w| w.1 < 0.0) {
        return no("a weight is negative");
    }
    // A sum that is NaN is refused, too.
    let is_one = (sum - 1.0).abs() <= SAME;
    if !is_one {
        return no("the weights do not sum to 1");
    }
    clarke_element_of(&map, x, weights, tolerance)
}

fn clarke_element_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    weights: &[(Selection, f64)],
    tolerance: f64,
) -> Result<Matrix, PiecewiseError> {
    check_vector("the point x", x, map.num_vars())?;
    let active = active_set(map, x, tolerance);
    let cones = Cones::new(Box::new(map), x, &active, x.len());
    let mut sum = Matrix::zeros(map.pattern());
    let mut jac = sum.clone();
    for (selection, weight) in weights {
        check_selection("a selection", selection, map)?;
        if !active.contains(selection) || cones.element(selection, &mut jac)? != Cell::Open {
            let what = "a selection is not known to be essentially active";
            return Err(PiecewiseError::Combination { what });
        }
        check_jacobian(&jac)?;
        let entries = sum.values_mut().iter_mut().zip(jac.values());
        entries.for_each(|(s, v)| *s += weight * v);
    }
    Ok(sum)
}
