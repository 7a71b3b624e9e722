//! The implicit function of a piecewise-smooth map and its parameter.

use super::determinants::Examined;
use super::orientation::{Cones, examine};
use super::uniqueness::verdict;
use super::{ActiveSet, LocalUniqueness, PiecewiseError, PiecewiseSmooth, Selection, active_set};
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::sparse::Matrix;
use crate::tolerances::{DIRECTION, DOUBTFUL};
use std::fmt;

/// What is known of the solutions y(α) of H(y, α) = 0 near a point.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ImplicitFunction {
    /// Whether they are one Lipschitz function of α, also for all small perturbations of H. Its constant is max over the active selections
    /// σ of ‖(∇_yH^(σ))⁻¹ ∂_αH^(σ)‖∞, in the limit of small neighbourhoods; directions of [`LocalUniqueness::Winds`] are those of (y, α).
    pub verdict: LocalUniqueness,
    /// y'(α; +1), the derivative as α grows (length n), where the verdict is [`LocalUniqueness::Lipschitz`] and rounding permits it.
    pub right: Option<Vec<f64>>,
    /// y'(α; −1), the derivative as α falls: at smooth points −y'(α; +1).
    pub left: Option<Vec<f64>>,
}

impl ImplicitFunction {
    /// The Lipschitz constant, where the function is certified.
    #[must_use]
    pub fn constant(&self) -> Option<f64> {
        self.verdict.constant()
    }
}

impl fmt::Display for ImplicitFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.verdict.fmt(f)
    }
}

/// Whether the solutions of H(y, α) = 0 near a solution x = (y, α) are a Lipschitz function y(α), its Lipschitz constant and its one-sided
/// derivatives. The map has n residuals and n + 1 variables, the parameter last.
///
/// The map (y, α) ↦ (H(y, α), α) is piecewise smooth. Where all essentially active selections σ, those whose cells have points near x while y
/// *and* α move, give det ∇_yH^(σ) one sign, not 0, and its B-derivative at x takes no value twice, it is a Lipschitz homeomorphism with a
/// piecewise smooth inverse, and y(α) is a part of that (J.-S. Pang, D. Ralph, Math. Oper. Res. 21 (1996), Theorems 4, 5; D. Ralph, S. Scholtes,
/// Math. Program. 76 (1997); S. Scholtes, *Introduction to Piecewise Differentiable Equations* (2012), sections 3.2 and 4.2). Where this is known
/// to fail there is no such function for all small perturbations of H, although there may be one for H itself: |y| = 0 for all α.
///
/// Selections are examined as in [`local_uniqueness`](super::local_uniqueness), at most `cap` of them, one factorisation each. Test functions
/// with |θ(x)| ≤ `tolerance` count as vanishing. That H(x) = 0 is not checked.
///
/// # Errors
/// Wrong lengths, values that are not finite, maps with another number of variables than n + 1, Jacobians that are not finite or leave their
/// pattern, and several active selections of matrices so large that no determinant is available ([`LinearError::Solver`]).
///
/// ```
/// use semismooth::piecewise::{MinMap, implicit_function};
/// // max(y, 3 y) = α, here min(α − y, α − 3 y) = 0: y = α for α < 0, y = α/3 for α > 0.
/// let h = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] - 3.0 * x[0];
/// });
/// let found = implicit_function(&h, &[0.0, 0.0], 1e-12, 100)?;
/// let near = |v: Option<&Vec<f64>>, y: f64| v.is_some_and(|v| (v[0] - y).abs() < 1e-9);
/// assert!((found.constant().unwrap() - 1.0).abs() < 1e-9);
/// assert!(near(found.right.as_ref(), 1.0 / 3.0) && near(found.left.as_ref(), -1.0));
/// # Ok::<(), semismooth::piecewise::PiecewiseError>(())
/// ```
pub fn implicit_function<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<ImplicitFunction, PiecewiseError> {
    implicit_function_of(&map, x, tolerance, cap)
}

fn implicit_function_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    tolerance: f64,
    cap: u64,
) -> Result<ImplicitFunction, PiecewiseError> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    if m != n + 1 {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "one variable more than residuals, the parameter",
        });
    }
    check_vector("the point x", x, m)?;
    let active = active_set(map, x, tolerance);
    if let Some(&site) = active.outside().first() {
        return Ok(ImplicitFunction {
            verdict: LocalUniqueness::Outside { site },
            right: None,
            left: None,
        });
    }
    let cones = Cones::new(Box::new(map), x, &active, m);
    let mut jac = Matrix::zeros(map.pattern());
    let mut constant = 0.0_f64;
    // For both directions of α: the selection into whose cell the rate points most.
    let mut best: [(f64, Option<Vec<f64>>); 2] = [(-DIRECTION, None), (-DIRECTION, None)];
    let signs = examine(&cones, &active, cap, (DOUBTFUL, false), &mut |found| {
        let selection = found.selection;
        let Some(rate) = rate_of(map, x, &mut jac, found)? else {
            constant = f64::INFINITY;
            return Ok(());
        };
        constant = rate.iter().fold(constant, |c, r| c.max(r.abs()));
        for ((most, kept), sign) in best.iter_mut().zip([1.0, -1.0]) {
            let mut d: Vec<f64> = rate.iter().map(|r| sign * r).collect();
            d.push(sign);
            let margin = cones.margin(selection, &d);
            if margin > *most {
                d.pop();
                (*most, *kept) = (margin, Some(d));
            }
        }
        Ok(())
    })?;
    let verdict = verdict(&cones, &active, signs, constant)?;
    let certified = verdict.constant().is_some_and(f64::is_finite);
    let [right, left] = best.map(|side| side.1.filter(|_| certified));
    Ok(ImplicitFunction { verdict, right, left })
}

/// Whether the solutions near x of a map of n residuals are one Lipschitz function of all variables behind the first n, as in
/// [`implicit_function`]. `visit` sees each regular selection that may have points near x, with the factors of its first n columns.
pub(crate) fn implicit_verdict(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    cap: u64,
    visit: &mut dyn FnMut(&Selection, &mut AutoSolver) -> Result<(), PiecewiseError>,
) -> Result<LocalUniqueness, PiecewiseError> {
    let cones = Cones::new(Box::new(map), x, active, map.num_vars());
    let signs = examine(
        &cones,
        active,
        cap,
        (DOUBTFUL, false),
        &mut |found| match found.solver {
            Some(solver) => visit(found.selection, solver),
            None => Ok(()),
        },
    )?;
    verdict(&cones, active, signs, 0.0)
}

/// −(∇_yH^(σ))⁻¹ ∂_αH^(σ); `None` where it is inaccurate by rounding.
fn rate_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    jac: &mut Matrix,
    found: Examined<'_>,
) -> Result<Option<Vec<f64>>, PiecewiseError> {
    let n = map.num_residuals();
    let selection: &Selection = found.selection;
    let Some(solver) = found.solver else {
        return Ok(None);
    };
    jac.clear();
    map.jacobian(selection, x, jac);
    let mut rate: Vec<f64> = (0..n).map(|i| -jac.get(i, n)).collect();
    match solver.solve_in_place(&mut rate) {
        Ok(()) => Ok(Some(rate)),
        Err(LinearError::Inaccurate { .. }) => Ok(None),
        Err(e) => Err(e.into()),
    }
}
