use super::LinearError;
use crate::sparse::sum_abs;
use crate::tolerances::ROUNDING;

/// Most steps of the estimator; it rarely needs more than two.
const STEPS: usize = 5;

/// Hager's and Higham's lower bound of ‖B‖₁, exact up to order 4, from products with B (`apply(x, false)`) and Bᵀ
/// (`apply(x, true)`).
///
/// `x` and `sign` are scratch of the order of B. The bound is mostly exact and seldom low by a factor above 3.
/// N. J. Higham, ACM Trans. Math. Softw. 14 (1988), doi:10.1145/50063.214386.
pub(super) fn norm_1_estimate(
    mut apply: impl FnMut(&mut [f64], bool),
    x: &mut [f64],
    sign: &mut [f64],
) -> f64 {
    let n = x.len();
    if n <= 4 {
        return (0..n).fold(0.0, |norm, j| {
            x.fill(0.0);
            x[j] = 1.0;
            apply(x, false);
            larger(norm, sum_abs(x))
        });
    }
    x.fill(1.0 / n as f64);
    apply(x, false);
    let mut estimate = sum_abs(x);
    for (s, v) in sign.iter_mut().zip(x.iter()) {
        *s = 1.0_f64.copysign(*v);
    }
    let mut last = None;
    for _ in 0..STEPS {
        x.copy_from_slice(sign);
        apply(x, true);
        let j = arg_max_abs(x);
        if last == Some(j) {
            break;
        }
        last = Some(j);
        x.fill(0.0);
        x[j] = 1.0;
        apply(x, false);
        let norm = sum_abs(x);
        let mut same = true;
        for (s, v) in sign.iter_mut().zip(x.iter()) {
            let new = 1.0_f64.copysign(*v);
            same &= new == *s;
            *s = new;
        }
        let grown = norm > estimate || norm.is_nan();
        estimate = larger(estimate, norm);
        if same || !grown {
            break;
        }
    }
    // A vector of alternating signs detects the matrices that mislead the iteration.
    for (i, x) in x.iter_mut().enumerate() {
        let size = 1.0 + i as f64 / (n - 1) as f64;
        *x = if i % 2 == 0 { size } else { -size };
    }
    apply(x, false);
    larger(estimate, 2.0 * sum_abs(x) / (3 * n) as f64)
}

/// Turns ‖S‖₁ and an estimate of ‖S⁻¹‖₁ into a reciprocal condition number, or the finding that S is singular.
pub(super) fn judge(norm: f64, inverse_norm: f64) -> Result<f64, LinearError> {
    let rcond = 1.0 / (norm * inverse_norm);
    if rcond.is_nan() {
        return Err(LinearError::Singular { rcond: 0.0 });
    }
    if rcond < ROUNDING {
        return Err(LinearError::Singular { rcond });
    }
    Ok(rcond.min(1.0))
}

/// Index of the entry largest in modulus (0 for an empty slice).
pub(super) fn arg_max_abs(x: &[f64]) -> usize {
    let mut best = 0;
    for i in 1..x.len() {
        if x[i].abs() > x[best].abs() {
            best = i;
        }
    }
    best
}

fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}
