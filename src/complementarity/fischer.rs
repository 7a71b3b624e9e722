//! Fischer–Burmeister functions, free of cancellation, and the reformulation of an MCP by them.

use super::{ComplementarityError, Mcp, McpFunction};
use crate::input::check_options;
use crate::piecewise::{Activity, Semismooth, open_cone};
use crate::sparse::{Matrix, Pattern, norm};
use crate::spread::Random;
use crate::tolerances::INTERIOR_STEPS;

/// φ(a, b) = a + b − √(a² + b²).
///
/// Where an argument is positive this cancels; 2ab / (a + b + √(a² + b²)) and a − a² / (b + √(a² + b²)) do not.
pub(super) fn phi(a: f64, b: f64) -> f64 {
    let h = a.hypot(b);
    if a > 0.0 && b > 0.0 {
        2.0 * a.min(b) * (a.max(b) / (a + b + h))
    } else if a.max(b) > 0.0 {
        let (low, high) = (a.min(b), a.max(b));
        low - low * (low / (high + h))
    } else {
        a + b - h
    }
}

/// ∇φ(a, b), for (a, b) ≠ (0, 0).
fn phi_gradient(a: f64, b: f64) -> (f64, f64) {
    let h = a.hypot(b);
    // 1 − a/h, without cancellation where a is nearly h.
    let one_minus = |a: f64, b: f64| {
        if a > 0.0 {
            (b / h) * (b / (h + a))
        } else {
            1.0 - a / h
        }
    };
    (one_minus(a, b), one_minus(b, a))
}

/// φ with the penalty of Chen, Chen and Kanzow (2000): λ φ(a, b) + (1 − λ) a₊ b₊.
fn penalised(a: f64, b: f64, lambda: f64) -> f64 {
    lambda * phi(a, b) + (1.0 - lambda) * a.max(0.0) * b.max(0.0)
}

/// An element of the B-subdifferential of the penalised φ at (a, b); at its kinks the limit of gradients along (da, db).
fn penalised_gradient(a: f64, b: f64, lambda: f64, (da, db): (f64, f64)) -> (f64, f64) {
    let (ga, gb) = if a != 0.0 || b != 0.0 {
        phi_gradient(a, b)
    } else if da != 0.0 || db != 0.0 {
        phi_gradient(da, db)
    } else {
        phi_gradient(1.0, 0.0)
    };
    // The penalty has kinks where one argument is 0 and the other positive.
    let positive = |v: f64, dv: f64| if v == 0.0 { dv > 0.0 } else { v > 0.0 };
    let (pa, pb) = match positive(a, da) && positive(b, db) {
        true => (b, a),
        false => (0.0, 0.0),
    };
    (
        lambda * ga + (1.0 - lambda) * pa,
        lambda * gb + (1.0 - lambda) * pb,
    )
}

/// The distances a = x − l and b = u − x, infinite without a bound, of one component.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    pub(super) below: f64,
    pub(super) above: f64,
}

impl Gap {
    fn vanishing(self, tolerance: f64) -> Self {
        Self {
            below: vanishing(self.below, tolerance),
            above: vanishing(self.above, tolerance),
        }
    }
}

/// 0 in place of values up to `tolerance`.
fn vanishing(v: f64, tolerance: f64) -> f64 {
    if v.abs() <= tolerance { 0.0 } else { v }
}

/// Φ of one component: φ(a, f), −φ(b, −f), f, or φ(a, −φ(b, −f)), depending on which bounds are finite (Billups 1995).
pub(super) fn component(gap: Gap, f: f64, lambda: f64) -> f64 {
    let Gap { below, above } = gap;
    let inner = match above < f64::INFINITY {
        true => -penalised(above, -f, lambda),
        false => f,
    };
    match below < f64::INFINITY {
        true => penalised(below, inner, lambda),
        false => inner,
    }
}

/// Whether Φ of one component has no gradient and the rate of f decides which limit of gradients is taken.
pub(super) fn is_kink(gap: Gap, f: f64, lambda: f64) -> bool {
    let Gap { below, above } = gap;
    let penalty = lambda < 1.0 && (below.is_finite() || above.is_finite());
    f == 0.0 && (below == 0.0 || above == 0.0 || penalty)
}

/// The derivatives of Φ of one component with respect to x and to f. Where f = 0 it is their limit along a direction in which f changes at
/// rate `df` and, at a bound, x at rate 1; where f ≠ 0, kinks of the penalty at a bound are left towards points outside the bounds. df = 0
/// means that f grows: away from bounds at any rate, at a bound slower than x.
pub(super) fn component_gradient(gap: Gap, f: f64, lambda: f64, df: f64) -> (f64, f64) {
    let dx = if gap.below == 0.0 && f > 0.0 { -1.0 } else { 1.0 };
    component_limit(gap, f, lambda, (dx, df))
}

/// The limit of the derivatives of Φ of one component along a direction with the rates dx and df.
fn component_limit(gap: Gap, f: f64, lambda: f64, (dx, df): (f64, f64)) -> (f64, f64) {
    let Gap { below, above } = gap;
    let df = match df == 0.0 && below != 0.0 && above != 0.0 {
        true => 1.0,
        false => df,
    };
    // With respect to x: γ, to f: δ.
    let (inner, gamma, delta) = match above < f64::INFINITY {
        true => {
            let (g, d) = penalised_gradient(above, -f, lambda, (-dx, -df));
            (-penalised(above, -f, lambda), g, d)
        }
        false => (f, 0.0, 1.0),
    };
    match below < f64::INFINITY {
        true => {
            let (a, b) = penalised_gradient(below, inner, lambda, (dx, gamma * dx + delta * df));
            (a + b * gamma, b * delta)
        }
        false => (gamma, delta),
    }
}

/// Replaces J by diag(a) + diag(b) J, from a and b of each row.
fn combine(jac: &mut Matrix, factors: &[(f64, f64)]) {
    let pattern = jac.pattern().clone();
    for j in 0..pattern.ncols() {
        for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
            let i = pattern.row_idx()[k];
            let (a, b) = factors[i];
            let v = &mut jac.values_mut()[k];
            *v = b * *v + if i == j { a } else { 0.0 };
        }
    }
}

/// The reformulation Φ(x) = 0 of an MCP by (penalised) Fischer–Burmeister functions; ½‖Φ‖² is continuously differentiable.
///
/// Φᵢ = φ(xᵢ − lᵢ, Fᵢ) with a lower bound only, −φ(uᵢ − xᵢ, −Fᵢ) with an upper one only, φ(xᵢ − lᵢ, −φ(uᵢ − xᵢ, −Fᵢ)) with both, Fᵢ without
/// (Fischer 1992, Billups 1995). φ is evaluated without cancellation, so that Φ and the natural residual vanish together also in
/// floating-point numbers, and where Φ is not differentiable the Jacobian is the limit of those along a direction, an element of the
/// B-subdifferential (De Luca, Facchinei and Kanzow 1996; Chen, Chen and Kanzow 2000; Facchinei and Pang 2003, section 9.1).
///
/// ```
/// use semismooth::complementarity::{FischerBurmeister, Mcp, WithJacobian};
/// use semismooth::newton::Newton;
/// use semismooth::sparse::Matrix;
/// let f = WithJacobian::new(
///     1,
///     |x: &[f64], out: &mut [f64]| out[0] = x[0] - 2.0,
///     |_: &[f64], jac: &mut Matrix| jac.add(0, 0, 1.0),
/// );
/// let problem = Mcp::ncp(f)?;
/// let mut x = [0.5];
/// Newton::default().solve_semismooth(&FischerBurmeister::new(&problem)?, &mut x)?;
/// assert!((x[0] - 2.0).abs() < 1e-10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct FischerBurmeister<'a, F> {
    problem: &'a Mcp<F>,
    lambda: f64,
}

impl<'a, F: McpFunction> FischerBurmeister<'a, F> {
    /// The plain function.
    ///
    /// # Errors
    /// A parametric problem: fix its parameter by [`Mcp::at`].
    pub fn new(problem: &'a Mcp<F>) -> Result<Self, ComplementarityError> {
        Self::penalised(problem, 1.0)
    }

    /// The penalised function λ φ(a, b) + (1 − λ) a₊ b₊, whose merit has bounded level sets on more problems; λ in (0, 1].
    ///
    /// # Errors
    /// λ out of range; a parametric problem.
    pub fn penalised(problem: &'a Mcp<F>, lambda: f64) -> Result<Self, ComplementarityError> {
        check_options(&[("lambda", lambda, lambda > 0.0 && lambda <= 1.0, "in (0, 1]")])?;
        if problem.is_parametric() {
            return Err(ComplementarityError::Dimensions {
                vars: problem.len() + 1,
                values: problem.len(),
                expected: "fix the parameter first, by `Mcp::at`",
            });
        }
        Ok(Self { problem, lambda })
    }

    /// Rates of F along the direction along which limits are taken: the indicator of the components at kinks. Where the sign of an F
    /// decides but its rate is zero along this direction, the rate along a generic second direction replaces it, as after a perturbation of
    /// higher order.
    fn rates(&self, x: &[f64], f: &[f64], jac: &Matrix) -> Vec<f64> {
        let n = x.len();
        let kink: Vec<bool> = (0..n)
            .map(|i| is_kink(self.gap(x, i), f[i], self.lambda))
            .collect();
        let mut z: Vec<f64> = kink.iter().map(|&k| f64::from(u8::from(k))).collect();
        let mut rate = vec![0.0; n];
        jac.mul_vec(&z, &mut rate);
        let open = |i: usize| {
            let Gap { below, above } = self.gap(x, i);
            below != 0.0 && above != 0.0
        };
        if !(0..n).any(|i| kink[i] && open(i) && rate[i] == 0.0) {
            return rate;
        }
        // At bounds, components with F ≠ 0 move outside the bounds.
        let mut spread = Random::new(1);
        for (i, z) in z.iter_mut().enumerate() {
            *z = match self.gap(x, i) {
                Gap { below: 0.0, .. } if f[i] > 0.0 => -1.0,
                _ => 1.5 + 0.5 * spread.symmetric(),
            };
        }
        let mut further = vec![0.0; n];
        jac.mul_vec(&z, &mut further);
        let open_kinks = rate
            .iter_mut()
            .enumerate()
            .filter(|(i, r)| **r == 0.0 && open(*i));
        open_kinks.for_each(|(i, r)| *r = further[i]);
        rate
    }

    /// F(x), values up to `tolerance` as 0.
    fn values(&self, x: &[f64], tolerance: f64) -> Vec<f64> {
        let mut f = vec![0.0; x.len()];
        self.problem.function().value(x, &mut f);
        f.iter_mut().for_each(|f| *f = vanishing(*f, tolerance));
        f
    }

    /// The components at kinks of the penalty, with the unit gradient of what changes its sign there: xᵢ or Fᵢ. `None` where a component
    /// with F = 0 is at a bound, and where both bounds are equal.
    fn kinks(&self, f: &[f64], gap: &dyn Fn(usize) -> Gap, jac: &Matrix) -> Option<Vec<(usize, Vec<f64>)>> {
        let n = f.len();
        let mut kinks = Vec::new();
        for (i, &f) in f.iter().enumerate() {
            let Gap { below, above } = gap(i);
            let closed = below == 0.0 || above == 0.0;
            if closed && (f == 0.0 || below == above) {
                return None;
            }
            let gradient: Vec<f64> = if below == 0.0 && f > 0.0 || above == 0.0 && f < 0.0 {
                (0..n).map(|j| f64::from(u8::from(i == j))).collect()
            } else if is_kink(gap(i), f, self.lambda) {
                (0..n).map(|j| jac.get(i, j)).collect()
            } else {
                continue;
            };
            // Where ∇F vanishes both sides have the same limit.
            let size = norm(&gradient);
            if size > 0.0 && self.lambda < 1.0 {
                kinks.push((i, gradient.iter().map(|g| g / size).collect()));
            }
        }
        Some(kinks)
    }

    fn gap(&self, x: &[f64], i: usize) -> Gap {
        Gap {
            below: x[i] - self.problem.lower()[i],
            above: self.problem.upper()[i] - x[i],
        }
    }
}

impl<F: McpFunction> Semismooth for FischerBurmeister<'_, F> {
    fn num_vars(&self) -> usize {
        self.problem.len()
    }

    fn residual(&self, x: &[f64], out: &mut [f64]) {
        self.problem.function().value(x, out);
        for i in 0..out.len() {
            out[i] = component(self.gap(x, i), out[i], self.lambda);
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let n = x.len();
        let mut f = vec![0.0; n];
        self.problem.function().value(x, &mut f);
        self.problem.function().jacobian(x, jac);
        let rate = self.rates(x, &f, jac);
        let factors: Vec<(f64, f64)> = (0..n)
            .map(|i| component_gradient(self.gap(x, i), f[i], self.lambda, rate[i]))
            .collect();
        combine(jac, &factors);
    }

    fn pattern(&self) -> Pattern {
        self.problem.jacobian_pattern().clone()
    }

    /// `None` where x is at a bound and F = 0, as the set is infinite there, and where it is not known which sides of kinks of the penalty
    /// intersect (a curved F with dependent gradients). Distances to bounds and values of F up to `tolerance` count as 0.
    fn b_subdifferential(&self, x: &[f64], tolerance: f64, cap: u64) -> Option<Vec<Matrix>> {
        let f = self.values(x, tolerance);
        let mut jac = Matrix::zeros(self.pattern());
        self.problem.function().jacobian(x, &mut jac);
        let gap = |i: usize| self.gap(x, i).vanishing(tolerance);
        let kinks = self.kinks(&f, &gap, &jac)?;
        let choices = 1_u64.checked_shl(kinks.len() as u32).filter(|c| *c <= cap)?;
        let mut found = Vec::new();
        for choice in 0..choices {
            let side = |k: usize| if choice >> k & 1 == 0 { 1.0 } else { -1.0 };
            let mut sides = vec![1.0; x.len()];
            let mut normals = Vec::new();
            for (k, (i, gradient)) in kinks.iter().enumerate() {
                sides[*i] = side(k);
                normals.push(gradient.iter().map(|g| side(k) * g).collect());
            }
            match open_cone(&normals, INTERIOR_STEPS) {
                Activity::Essential => {}
                Activity::Inessential if self.problem.function().is_affine() => continue,
                _ => return None,
            }
            let limit = |i: usize| component_limit(gap(i), f[i], self.lambda, (sides[i], sides[i]));
            let factors: Vec<(f64, f64)> = (0..x.len()).map(limit).collect();
            let mut element = jac.clone();
            combine(&mut element, &factors);
            found.push(element);
        }
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn does_not_cancel() {
        // a + b − √(a² + b²) is 0 in floating-point numbers for the first pair; the true value is nearly 2ab/(a + b + h).
        assert!((phi(1e-4, 1e13) - 1e-4).abs() < 1e-12);
        assert!((phi(1e13, 1e-4) - 1e-4).abs() < 1e-12);
        assert!((phi(3.0, 4.0) - 2.0).abs() < 1e-15);
        assert!((phi(-1e-4, 1e13) + 1e-4).abs() < 1e-19);
        assert_eq!(phi(0.0, 5.0), 0.0);
    }

    #[test]
    fn is_homogeneous_up_to_the_largest_numbers() {
        for (x, f) in [(0.3, 0.4), (2.0, -1.0), (-0.5, 1.0), (-1.0, -2.0)] {
            let at = |size: f64| {
                let (below, above) = (size * x, f64::INFINITY);
                let value = component(Gap { below, above }, size * f, 1.0) / size;
                (
                    value,
                    component_gradient(Gap { below, above }, size * f, 1.0, 0.0),
                )
            };
            for exponent in [-700, -500, 500, 1000] {
                assert_eq!(at(f64::powi(2.0, exponent)), at(1.0), "{x} {f} 2^{exponent}");
            }
        }
    }

    /// Where f = 0, gradients are limits along directions in which f changes at the rate given.
    #[test]
    fn gradients_at_kinks_are_limits_along_the_direction() {
        let inf = f64::INFINITY;
        for (below, above) in [
            (0.0, inf),
            (inf, 0.0),
            (0.0, 1.0),
            (1.0, 0.0),
            (0.5, 2.0),
            (2.0, inf),
            (inf, 2.0),
        ] {
            for (lambda, rate) in [(1.0, 0.7), (1.0, -0.7), (0.8, 3.0), (0.8, -3.0)] {
                let at = |s: f64| {
                    let (below, above) = (below + s, above - s);
                    component_gradient(Gap { below, above }, s * rate, lambda, rate)
                };
                let ((x, f), (near_x, near_f)) = (at(0.0), at(1e-9));
                assert!(
                    (x - near_x).abs() < 1e-7 && (f - near_f).abs() < 1e-7,
                    "{below} {above} {lambda} {rate}: {x} {f}, {near_x} {near_f}"
                );
            }
        }
    }

    #[test]
    fn gradients_are_those_of_differences() {
        let inf = f64::INFINITY;
        for (l, u) in [(0.0, inf), (-inf, 1.0), (0.0, 1.0), (-inf, inf)] {
            for lambda in [1.0, 0.8] {
                for (x, f) in [(0.3, 0.4), (0.9, -2.0), (-0.5, 1.0), (1.5, 3.0), (0.2, -1e3)] {
                    let at = |x: f64, f: f64| {
                        let gap = Gap {
                            below: x - l,
                            above: u - x,
                        };
                        (component(gap, f, lambda), component_gradient(gap, f, lambda, 0.0))
                    };
                    let h = 1e-6;
                    let (_, (gx, gf)) = at(x, f);
                    let dx = (at(x + h, f).0 - at(x - h, f).0) / (2.0 * h);
                    let df = (at(x, f + h).0 - at(x, f - h).0) / (2.0 * h);
                    assert!(
                        (gx - dx).abs() < 1e-6 * (1.0 + gx.abs()),
                        "{l} {u} {x} {f}: {gx} {dx}"
                    );
                    assert!(
                        (gf - df).abs() < 1e-6 * (1.0 + gf.abs()),
                        "{l} {u} {x} {f}: {gf} {df}"
                    );
                }
            }
        }
    }
}
