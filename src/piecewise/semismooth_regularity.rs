//! Regularity of semismooth maps that give their B-subdifferential.

use super::orientation::sign_of;
use super::regularity::{Element, Tally, convex_hull, singular};
use super::{CertificateDoubt, PiecewiseError, Regularity, Selection, Semismooth};
use crate::InputError;
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearSolver};
use crate::tolerances::DOUBTFUL;

/// BD-regularity of a semismooth map, as [`bd_regularity`](super::bd_regularity) of a piecewise-smooth one: whether all elements that
/// [`Semismooth::b_subdifferential`] gives at x, up to `cap` of them, are regular. Where it gives none the answer is undecided
/// ([`CertificateDoubt::Elements`]). In verdicts a selection has one site, whose piece is the number of the element in that list.
///
/// A matrix whose reciprocal condition, rows and columns equilibrated, is below 1e-11 counts as singular.
///
/// # Errors
/// A wrong length of x or values in it that are not finite, elements over another pattern than that of the map or with entries that are not
/// finite, and failures of the linear solver other than singularity.
///
/// ```
/// use semismooth::piecewise::{Semismooth, bd_regularity_semismooth, cd_regularity_semismooth};
/// use semismooth::sparse::Matrix;
/// /// x + 2 |x| = 0, with the slopes 3 and −1.
/// struct Bent;
/// impl Semismooth for Bent {
///     fn num_vars(&self) -> usize { 1 }
///     fn residual(&self, x: &[f64], out: &mut [f64]) { out[0] = x[0] + 2.0 * x[0].abs(); }
///     fn jacobian(&self, x: &[f64], jac: &mut Matrix) { jac.add(0, 0, if x[0] < 0.0 { -1.0 } else { 3.0 }); }
///     fn b_subdifferential(&self, x: &[f64], tolerance: f64, _: u64) -> Option<Vec<Matrix>> {
///         let slopes: &[f64] = if x[0].abs() <= tolerance { &[3.0, -1.0] } else if x[0] < 0.0 { &[-1.0] } else { &[3.0] };
///         slopes.iter().map(|s| Matrix::from_rows(&[[*s]]).ok()).collect()
///     }
/// }
/// assert!(bd_regularity_semismooth(&Bent, &[0.0], 1e-12, 10)?.is_regular());
/// assert!(cd_regularity_semismooth(&Bent, &[0.0], 1e-12, 10)?.fails()); // ¼ · 3 + ¾ · (−1) = 0
/// assert!(cd_regularity_semismooth(&Bent, &[-1.0], 1e-12, 10)?.is_regular());
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn bd_regularity_semismooth<S: Semismooth + ?Sized>(
    map: &S,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Regularity, PiecewiseError> {
    examine_elements(&map, x, tolerance, cap, None)
}

/// CD-regularity of a semismooth map, as [`cd_regularity`](super::cd_regularity) of a piecewise-smooth one: whether all convex combinations of
/// the elements that [`Semismooth::b_subdifferential`] gives at x are regular. Conventions are those of [`bd_regularity_semismooth`].
///
/// # Errors
/// As [`bd_regularity_semismooth`].
pub fn cd_regularity_semismooth<S: Semismooth + ?Sized>(
    map: &S,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<Regularity, PiecewiseError> {
    let mut elements = Vec::new();
    let known = examine_elements(&map, x, tolerance, cap, Some(&mut elements))?;
    convex_hull(known, &elements, cap)
}

/// BD-regularity; the different elements go to `keep`.
pub(super) fn examine_elements(
    map: &dyn Semismooth,
    x: &[f64],
    tolerance: f64,
    cap: u64,
    keep: Option<&mut Vec<Element>>,
) -> Result<Regularity, PiecewiseError> {
    check_vector("the point x", x, map.num_vars())?;
    let mut tally = Tally::new(keep);
    let known = map.b_subdifferential(x, tolerance, cap);
    let Some(matrices) = known.filter(|list| !list.is_empty()) else {
        return Ok(tally.verdict(Some(CertificateDoubt::Elements)));
    };
    let pattern = map.pattern();
    let mut solver = AutoSolver::default();
    solver.analyze(pattern.leading_columns(pattern.ncols()))?;
    for (k, matrix) in matrices.into_iter().enumerate() {
        if *matrix.pattern() != pattern {
            return Err(PiecewiseError::Input(InputError::Length {
                what: "the entries of an element of the B-subdifferential",
                expected: pattern.row_idx().len(),
                found: matrix.pattern().row_idx().len(),
            }));
        }
        if let Some((row, col)) = matrix.stray() {
            return Err(PiecewiseError::StrayEntry { row, col });
        }
        let selection = Selection::from_pieces([k]);
        let sign = sign_of(&mut solver, &matrix, x.len(), DOUBTFUL)?;
        if sign == Some(0) {
            return singular(vec![(selection, 1.0)], &matrix);
        }
        tally.add(Element {
            selection,
            matrix,
            sign,
            certain: true,
        })?;
    }
    Ok(tally.verdict(None))
}
