//! From what the user gives to a first point and a first direction.

use super::arms::{Arms, distance};
use super::{Arm, ContinuationError, ContinuationOptions, Strategy};
use crate::newton::{Newton, NewtonOptions};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, select};
use crate::sparse::Matrix;
use crate::sparse::{dot, norm};

/// Which way to leave the start.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Direction {
    /// With growing α.
    Increasing,
    /// With falling α.
    Decreasing,
    /// Along the arm nearest to the given vector (length n + 1), which must not be orthogonal to it.
    Along(Vec<f64>),
}

/// Solves at fixed α unless x is a solution already.
pub(super) fn onto_curve<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    options: &ContinuationOptions,
) -> Result<Vec<f64>, ContinuationError> {
    let mut x = x.to_vec();
    let selection = select(map, &x);
    let mut r = vec![0.0; map.num_residuals()];
    map.residual(&selection, &x, &mut r);
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(&selection, &x, &mut jac);
    if let Some((row, col)) = jac.stray() {
        return Err(PiecewiseError::StrayEntry { row, col }.into());
    }
    let size = term_size(&jac, &x, 0.0, &x);
    let tolerance = match options.strategy {
        Strategy::Located => 1e-13 * size,
        Strategy::Switching => options.residual_tolerance,
    };
    if norm(&r) <= tolerance {
        return Ok(x);
    }
    let given = x.clone();
    let solved = Newton::new(NewtonOptions::default()).solve(map, &mut x);
    match solved {
        Ok(_) => Ok(x),
        // At folds and on vertical segments ∇_yH is singular: a start that is good to the tolerance is taken as it is.
        Err(_) if norm(&r) <= options.residual_tolerance * size => Ok(given),
        Err(e) => Err(e.into()),
    }
}

/// ‖ |J| (|x| + h |t|) ‖₂: the size of the terms that cancel in H.
pub(super) fn term_size(jac: &Matrix, x: &[f64], h: f64, t: &[f64]) -> f64 {
    let mut sums = vec![0.0; jac.nrows()];
    for (i, j, v) in jac.triplets() {
        sums[i] += v.abs() * (x[j].abs() + h * t[j].abs());
    }
    norm(&sums)
}

pub(super) fn choose_start<'b>(arms: &'b Arms, direction: &Direction) -> Result<&'b Arm, ContinuationError> {
    const FLAT: f64 = 1e-10;
    let rate = |a: &Arm| a.tangent.last().copied().unwrap_or(0.0);
    let (found, wanted) = match direction {
        Direction::Increasing => (arms.list.iter().find(|a| rate(a) > FLAT), "growing parameter"),
        Direction::Decreasing => (arms.list.iter().find(|a| rate(a) < -FLAT), "falling parameter"),
        Direction::Along(v) => {
            let length = norm(v);
            let unit: Vec<f64> = v.iter().map(|c| c / length).collect();
            let nearest = arms
                .list
                .iter()
                .min_by(|a, b| distance(&a.tangent, &unit).total_cmp(&distance(&b.tangent, &unit)));
            let ahead = nearest.filter(|a| dot(&a.tangent, &unit) > 0.0);
            (ahead, "a positive component along the vector given")
        }
    };
    found.ok_or(ContinuationError::NoArm {
        wanted,
        found: arms.list.len(),
    })
}
