use super::jordan::jordan;
use super::{root, semidefinite};
use crate::sparse::norm;

/// A factor of K, by its number of variables or order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Cone {
    /// x ≥ 0, component by component; F ≥ 0.
    Nonnegative(usize),
    /// The second-order (Lorentz) cone t ≥ ‖v‖₂ of (t, v), its own dual; with one variable the half-line t ≥ 0.
    SecondOrder(usize),
    /// x is free; F = 0.
    Free(usize),
    /// The positive semidefinite matrices of this order k, k (k + 1)/2 variables as [`svec`](super::svec) puts them; its own dual. A step
    /// costs O(k⁵) for the derivatives and O(k⁶) for the system: for orders to about 50.
    Semidefinite(usize),
}

impl Cone {
    /// Number of variables; `usize::MAX` where that is too small for it.
    #[must_use]
    pub const fn len(self) -> usize {
        match self {
            Self::Nonnegative(n) | Self::SecondOrder(n) | Self::Free(n) => n,
            Self::Semidefinite(order) if order % 2 == 0 => (order / 2).saturating_mul(order + 1),
            Self::Semidefinite(order) => order.saturating_mul(order / 2 + 1),
        }
    }

    /// Whether there are no variables.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Projects x on the cone, up to rounding; a matrix that is not finite becomes NaN.
    ///
    /// ```
    /// use semismooth::cones::Cone;
    /// let mut x = [0.0, 3.0, 4.0];
    /// Cone::SecondOrder(3).project(&mut x);
    /// assert_eq!(x, [2.5, 1.5, 2.0]);
    /// ```
    pub fn project(self, x: &mut [f64]) {
        match self {
            Self::Free(_) => {}
            Self::Nonnegative(_) => x.iter_mut().for_each(|x| *x = x.max(0.0)),
            Self::SecondOrder(_) => {
                let Some((t, v)) = x.split_first_mut() else { return };
                let length = norm(v);
                if length <= -*t {
                    *t = 0.0;
                    v.fill(0.0);
                } else if length > *t {
                    let s = 0.5 * (*t + length);
                    v.iter_mut().for_each(|v| *v *= s / length);
                    *t = s;
                }
            }
            Self::Semidefinite(order) => semidefinite::project(order, x),
        }
    }

    /// An element of the B-subdifferential of the projection at z, n × n row by row (J.-S. Chen, X. Chen, P. Tseng, 2004; for matrices
    /// D. Sun, J. Sun, 2002).
    pub(super) fn projection_derivative(self, z: &[f64], out: &mut [f64]) {
        let n = z.len();
        out.fill(0.0);
        match self {
            Self::Free(_) => (0..n).for_each(|i| out[i * n + i] = 1.0),
            Self::Nonnegative(_) => (0..n).for_each(|i| out[i * n + i] = f64::from(u8::from(z[i] > 0.0))),
            Self::SecondOrder(_) => {
                let (t, v) = (z[0], &z[1..]);
                let length = norm(v);
                if length <= t && (length > 0.0 || t > 0.0) {
                    (0..n).for_each(|i| out[i * n + i] = 1.0);
                } else if length > -t {
                    out[0] = 0.5;
                    let q = t / length;
                    for i in 1..n {
                        let vi = z[i] / length;
                        out[i] = 0.5 * vi;
                        out[i * n] = 0.5 * vi;
                        for j in 1..n {
                            out[i * n + j] = -0.5 * q * vi * (z[j] / length);
                        }
                        out[i * n + i] += 0.5 * (1.0 + q);
                    }
                }
            }
            Self::Semidefinite(order) => semidefinite::projection_derivative(order, z, out),
        }
    }

    /// The smoothed Fischer–Burmeister function x + y − (x² + y² + 2 μ² e)^½ in the Jordan algebra of the cone (M. Fukushima, Z.-Q. Luo,
    /// P. Tseng, 2002); y for free variables.
    pub(super) fn smoothed(self, mu: f64, x: &[f64], y: &[f64], out: &mut [f64]) {
        match self {
            Self::Free(_) => out.copy_from_slice(y),
            Self::Semidefinite(order) => semidefinite::smoothed(order, mu, x, y, out),
            _ => root::fischer_burmeister(mu, x, y, out),
        }
    }

    /// Its derivatives by x and by y, n × n row by row: I − L_z⁻¹ L_x and I − L_z⁻¹ L_y, z the square root; where it has none, their limits
    /// along (x + t e, y + t `rate`) for t ↓ 0, an element of the B-subdifferential. `room` has length 3 n.
    pub(super) fn smoothed_derivatives(
        self,
        mu: f64,
        [x, y]: [&[f64]; 2],
        rate: Option<&[f64]>,
        [by_x, by_y]: [&mut [f64]; 2],
        room: &mut [f64],
    ) {
        let n = x.len();
        match self {
            Self::Free(_) => {
                by_x.fill(0.0);
                by_y.fill(0.0);
                (0..n).for_each(|i| by_y[i * n + i] = 1.0);
            }
            Self::Semidefinite(order) => {
                semidefinite::smoothed_derivatives(order, mu, [x, y], rate, [by_x, by_y]);
            }
            Self::Nonnegative(_) | Self::SecondOrder(_) => {
                root::derivatives(mu, [x, y], rate, [by_x, by_y], room);
            }
        }
    }

    /// a ∘ b in the Jordan algebra; 0 for free variables.
    pub(super) fn product(self, a: &[f64], b: &[f64], out: &mut [f64]) {
        match self {
            Self::Free(_) => out.fill(0.0),
            Self::Nonnegative(_) => (0..a.len()).for_each(|i| out[i] = a[i] * b[i]),
            Self::SecondOrder(_) => jordan(a, b, out),
            Self::Semidefinite(order) => semidefinite::product(order, a, b, out),
        }
    }

    /// The identity e of the Jordan algebra, inside of the cone; 0 for free variables.
    pub(super) fn unit(self, out: &mut [f64]) {
        out.fill(0.0);
        match self {
            Self::Free(_) => {}
            Self::Nonnegative(_) => out.fill(1.0),
            Self::SecondOrder(_) => out[..1].fill(1.0),
            Self::Semidefinite(order) => semidefinite::unit(order, out),
        }
    }
}
