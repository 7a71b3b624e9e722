//! The Jordan algebra of a second-order cone, whose first component is that of the axis, and the scaling of Nesterov and Todd.

use crate::sparse::{dot, norm};

/// z J = (z₀, −z₁, …): the sign of component k.
fn sign(k: usize) -> f64 {
    if k == 0 { 1.0 } else { -1.0 }
}

/// zᵀ J z = z₀² − ‖z₁‖², without cancellation of squares.
pub(super) fn hyperbolic(z: &[f64]) -> f64 {
    let t = norm(&z[1..]);
    (z[0] - t) * (z[0] + t)
}

/// a ∘ b = (aᵀb, a₀ b₁ + b₀ a₁).
pub(crate) fn jordan(a: &[f64], b: &[f64], out: &mut [f64]) {
    out[0] = dot(a, b);
    for k in 1..a.len() {
        out[k] = a[0] * b[k] + b[0] * a[k];
    }
}

/// Overwrites b by z with a ∘ z = b.
pub(super) fn jordan_divide(a: &[f64], b: &mut [f64]) {
    let first = (a[0] * b[0] - dot(&a[1..], &b[1..])) / hyperbolic(a);
    for k in 1..a.len() {
        b[k] = (b[k] - first * a[k]) / a[0];
    }
    b[0] = first;
}

/// Largest t ≤ 1 with z + t d in the cone, for z inside.
pub(super) fn reach(z: &[f64], d: &[f64]) -> f64 {
    let a = hyperbolic(d);
    let b = z[0] * d[0] - dot(&z[1..], &d[1..]);
    let c = hyperbolic(z);
    // The smallest positive root of a t² + 2 b t + c; of a half-line it is double, and half of its digits would be lost.
    let disc = b * b - a * c;
    let mut t = f64::INFINITY;
    if disc >= 0.0 && z.len() > 1 {
        let s = -(b + disc.sqrt().copysign(b));
        for root in [s / a, c / s] {
            if root > 0.0 {
                t = t.min(root);
            }
        }
    }
    if d[0] < 0.0 {
        t = t.min(-z[0] / d[0]);
    }
    t.min(1.0)
}

/// W with W x = W⁻¹ y for x and y inside of the cone: W = β (2 v vᵀ − J), and W² = β² (2 w wᵀ − J).
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaling<'a> {
    pub(super) beta: f64,
    pub(super) v: &'a [f64],
    pub(super) w: &'a [f64],
}

impl Scaling<'_> {
    /// Writes v and w; β.
    pub(super) fn between(x: &[f64], y: &[f64], v: &mut [f64], w: &mut [f64]) -> f64 {
        let (a, b) = (hyperbolic(x).sqrt(), hyperbolic(y).sqrt());
        let gamma = (0.5 * (1.0 + dot(x, y) / (a * b))).sqrt();
        for k in 0..x.len() {
            w[k] = (y[k] / b + sign(k) * x[k] / a) / (2.0 * gamma);
        }
        let scale = (2.0 * (w[0] + 1.0)).sqrt().recip();
        for k in 0..x.len() {
            v[k] = (w[k] + f64::from(k == 0)) * scale;
        }
        (b / a).sqrt()
    }

    /// W z.
    pub(super) fn apply(&self, z: &[f64], out: &mut [f64]) {
        let inner = 2.0 * dot(self.v, z);
        for k in 0..z.len() {
            out[k] = self.beta * (inner * self.v[k] - sign(k) * z[k]);
        }
    }

    /// W⁻¹ z.
    pub(super) fn apply_inverse(&self, z: &[f64], out: &mut [f64]) {
        let inner = 2.0 * (2.0 * self.v[0] * z[0] - dot(self.v, z));
        for k in 0..z.len() {
            out[k] = sign(k) * (inner * self.v[k] - z[k]) / self.beta;
        }
    }

    /// out − W² z.
    pub(super) fn subtract_square(&self, z: &[f64], out: &mut [f64]) {
        let (square, inner) = (self.beta * self.beta, 2.0 * dot(self.w, z));
        for k in 0..z.len() {
            out[k] -= square * (inner * self.w[k] - sign(k) * z[k]);
        }
    }

    /// Entry (i, j) of W².
    pub(super) fn square(&self, i: usize, j: usize) -> f64 {
        let diagonal = if i == j { sign(i) } else { 0.0 };
        self.beta * self.beta * (2.0 * self.w[i] * self.w[j] - diagonal)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A point inside of the cone.
    fn inside(r: &[f64]) -> Vec<f64> {
        let mut z = r.to_vec();
        z[0] = norm(&r[1..]) + r[0].abs() + 1e-3;
        z
    }

    #[test]
    fn the_end_of_a_half_line_is_reached() {
        for k in 1..200 {
            let (z, d) = (0.1 * f64::from(k), -0.13 - 0.37 * f64::from(k));
            assert_eq!(reach(&[z], &[d]), (-z / d).min(1.0));
        }
    }

    /// (s, 0) + t (−1, 1 − δ) leaves the cone at t = s/(2 − δ): the direction is nearly one of its boundary.
    #[test]
    fn the_boundary_is_reached_along_directions_close_to_it() {
        for k in 1..=50 {
            let (size, small) = (1.0 / (1.0 + f64::from(k)), 0.5_f64.powi(k));
            let t = reach(&[size, 0.0], &[-1.0, 1.0 - small]);
            assert!(
                (t * (2.0 - small) / size - 1.0).abs() <= 16.0 * f64::EPSILON,
                "{k}: {t}"
            );
        }
    }

    /// (1 + δ)² − 1 = δ (2 + δ).
    #[test]
    fn hyperbolic_norms_near_the_boundary_have_all_digits() {
        for k in 1..=50 {
            let small = 0.5_f64.powi(k);
            let exact = small * (2.0 + small);
            assert!((hyperbolic(&[1.0 + small, 1.0]) - exact).abs() <= 4.0 * f64::EPSILON * exact);
        }
    }

    proptest! {
        /// W x = W⁻¹ y = λ, so that W² x = y; division undoes the product; the reach ends on the boundary.
        #[test]
        fn scalings_and_products(r in prop::collection::vec(-3.0..3.0_f64, 15), n in 1..6_usize) {
            let (x, y, d) = (inside(&r[..n]), inside(&r[5..5 + n]), &r[10..10 + n]);
            let (mut v, mut w) = (vec![0.0; n], vec![0.0; n]);
            let beta = Scaling::between(&x, &y, &mut v, &mut w);
            let scaling = Scaling { beta, v: &v, w: &w };
            let (mut left, mut right) = (vec![0.0; n], vec![0.0; n]);
            scaling.apply(&x, &mut left);
            scaling.apply_inverse(&y, &mut right);
            let mut rest = y.clone();
            scaling.subtract_square(&x, &mut rest);
            let size = 1.0 + norm(&x) + norm(&y);
            for i in 0..n {
                prop_assert!((left[i] - right[i]).abs() <= 1e-8 * size);
                prop_assert!(rest[i].abs() <= 1e-8 * size);
                let row: f64 = (0..n).map(|j| scaling.square(i, j) * x[j]).sum();
                prop_assert!((row - y[i]).abs() <= 1e-8 * size);
            }
            let mut product = vec![0.0; n];
            jordan(&x, d, &mut product);
            jordan_divide(&x, &mut product);
            prop_assert!(product.iter().zip(d).all(|(p, d)| (p - d).abs() <= 1e-8 * size));
            let t = reach(&x, d);
            let at = |t: f64| -> Vec<f64> { x.iter().zip(d).map(|(x, d)| x + t * d).collect() };
            let slack = |z: &[f64]| z[0] - norm(&z[1..]);
            prop_assert!(slack(&at(t)) >= -1e-8 * size);
            prop_assert!(t == 1.0 || slack(&at(t)).abs() <= 1e-8 * size);
        }
    }
}
