//! Second-order cones: their product, and the scaling of Nesterov and Todd.

use super::scaled::Block;

/// The Nesterov–Todd scaling of one contact: W = β (2 v vᵀ − J), and W² = β² (2 w wᵀ − J).
#[derive(Debug, Clone, Copy)]
pub(super) struct Nt<const D: usize> {
    pub(super) beta: f64,
    pub(super) v: [f64; D],
    pub(super) w: [f64; D],
}

impl<const D: usize> Nt<D> {
    pub(super) fn new(x: &[f64; D], y: &[f64; D]) -> Self {
        let (a, b) = (hyperbolic(x).sqrt(), hyperbolic(y).sqrt());
        let inner: f64 = (0..D).map(|k| x[k] * y[k]).sum::<f64>() / (a * b);
        let gamma = (0.5 * (1.0 + inner)).sqrt();
        let w: [f64; D] =
            std::array::from_fn(|k| (y[k] / b + if k == 0 { x[k] } else { -x[k] } / a) / (2.0 * gamma));
        let scale = (2.0 * (w[0] + 1.0)).sqrt().recip();
        let v = std::array::from_fn(|k| (w[k] + f64::from(k == 0)) * scale);
        Self {
            beta: (b / a).sqrt(),
            v,
            w,
        }
    }

    /// 2 a (a·z) − J z.
    fn reflect(a: &[f64; D], z: &[f64; D]) -> [f64; D] {
        let inner: f64 = 2.0 * (0..D).map(|k| a[k] * z[k]).sum::<f64>();
        std::array::from_fn(|k| inner * a[k] - if k == 0 { z[k] } else { -z[k] })
    }

    pub(super) fn apply(&self, z: &[f64; D]) -> [f64; D] {
        Self::reflect(&self.v, z).map(|v| self.beta * v)
    }

    pub(super) fn apply_inverse(&self, z: &[f64; D]) -> [f64; D] {
        let mirrored: [f64; D] = std::array::from_fn(|k| if k == 0 { self.v[k] } else { -self.v[k] });
        Self::reflect(&mirrored, z).map(|v| v / self.beta)
    }

    pub(super) fn square(&self) -> Block<D> {
        let b = self.beta * self.beta;
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let sign = match (i == j, i) {
                    (false, _) => 0.0,
                    (true, 0) => 1.0,
                    (true, _) => -1.0,
                };
                b * (2.0 * self.w[i] * self.w[j] - sign)
            })
        })
    }
}

/// xᵀ J x = x_N² − ‖x_T‖², without cancellation of squares.
pub(super) fn hyperbolic<const D: usize>(x: &[f64; D]) -> f64 {
    let t = super::cone::tangential_norm(x);
    (x[0] - t) * (x[0] + t)
}

/// The Jordan product of L.
pub(super) fn jordan<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    let inner: f64 = (0..D).map(|k| a[k] * b[k]).sum();
    std::array::from_fn(|k| if k == 0 { inner } else { a[0] * b[k] + b[0] * a[k] })
}

/// z with a ∘ z = b.
pub(super) fn jordan_divide<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    let det = hyperbolic(a);
    let tb: f64 = (1..D).map(|k| a[k] * b[k]).sum();
    let first = (a[0] * b[0] - tb) / det;
    std::array::from_fn(|k| {
        if k == 0 {
            first
        } else {
            (b[k] - first * a[k]) / a[0]
        }
    })
}

/// Largest t ≤ 1 with x + t d in L, for x inside.
pub(super) fn reach<const D: usize>(x: &[f64; D], d: &[f64; D]) -> f64 {
    let a = hyperbolic(d);
    let b = x[0] * d[0] - (1..D).map(|k| x[k] * d[k]).sum::<f64>();
    let c = hyperbolic(x);
    // The smallest positive root of a t² + 2 b t + c.
    let disc = b * b - a * c;
    let mut t = f64::INFINITY;
    if disc >= 0.0 {
        let s = -(b + disc.sqrt().copysign(b));
        for root in [s / a, c / s] {
            if root > 0.0 {
                t = t.min(root);
            }
        }
    }
    if d[0] < 0.0 {
        t = t.min(-x[0] / d[0]);
    }
    t.min(1.0)
}
