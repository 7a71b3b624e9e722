use std::fmt::Debug;

use num_traits::{NumAssignOps, NumOps, Signed};

/// The scalar a user's formula is written over: `f64` for values, dual numbers for exact derivatives.
///
/// Arithmetic mixes with `f64` on the right (`2.0 * x` is written `x * 2.0`). Branching on [`value`](Self::value), `abs` and
/// the like hide kinks from the crate; express them through `Kinks` instead.
pub trait Real:
    Copy + Debug + From<f64> + Signed + NumAssignOps + NumOps<f64, Self> + NumAssignOps<f64>
{
    /// The value without derivatives.
    fn value(&self) -> f64;
    /// √x
    #[must_use]
    fn sqrt(self) -> Self;
    /// eˣ
    #[must_use]
    fn exp(self) -> Self;
    /// ln x
    #[must_use]
    fn ln(self) -> Self;
    /// sin x
    #[must_use]
    fn sin(self) -> Self;
    /// cos x
    #[must_use]
    fn cos(self) -> Self;
    /// tan x
    #[must_use]
    fn tan(self) -> Self;
    /// arctan x, in (−π/2, π/2)
    #[must_use]
    fn atan(self) -> Self;
    /// sinh x
    #[must_use]
    fn sinh(self) -> Self;
    /// cosh x
    #[must_use]
    fn cosh(self) -> Self;
    /// tanh x
    #[must_use]
    fn tanh(self) -> Self;
    /// arcsin x, in [−π/2, π/2]; NaN for |x| > 1. This and the next five are composed of the functions above unless a scalar defines them.
    #[must_use]
    fn asin(self) -> Self {
        (self / ((-self + 1.0) * (self + 1.0)).sqrt()).atan()
    }
    /// arccos x, in [0, π]; NaN for |x| > 1
    #[must_use]
    fn acos(self) -> Self {
        ((-self + 1.0) / (self + 1.0)).sqrt().atan() * 2.0
    }
    /// ln(1 + x); the scalars of this crate keep all digits near 0
    #[must_use]
    fn ln_1p(self) -> Self {
        (self + 1.0).ln()
    }
    /// eˣ − 1; the scalars of this crate keep all digits near 0
    #[must_use]
    fn exp_m1(self) -> Self {
        let half = self * 0.5;
        half.exp() * half.sinh() * 2.0
    }
    /// The real cube root of x, which is negative where x is; its slope at 0 is infinite
    #[must_use]
    fn cbrt(self) -> Self {
        self * (self * self).powf(-1.0 / 3.0)
    }
    /// The angle of the point (x, y) = (other, self), in (−π, π], as `f64::atan2`; it jumps by 2π across the half-line x < 0, y = 0
    #[must_use]
    fn atan2(self, other: Self) -> Self {
        let radius = (self * self + other * other).sqrt();
        (self / (radius + other)).atan() * 2.0
    }
    /// xⁿ
    #[must_use]
    fn powi(self, n: i32) -> Self;
    /// x^p
    #[must_use]
    fn powf(self, p: f64) -> Self;

    /// This value, marked as depending on `others` and on a label, too: for scalars that trace dependencies.
    #[doc(hidden)]
    #[must_use]
    fn joined(self, _others: &[Self], _label: Option<usize>) -> Self {
        self
    }
    /// The value, where it is one number: those that enclose many have none.
    #[doc(hidden)]
    fn single(&self) -> Option<f64> {
        Some(self.value())
    }
    /// The labels of a scalar that traces dependencies.
    #[doc(hidden)]
    fn labels(&self) -> [u64; 4] {
        [0; 4]
    }
    /// The value of a kink with these pieces, whichever the tests choose: for scalars that keep all of them.
    /// `_natural` gives the piece that the tests choose where their values are known.
    #[doc(hidden)]
    #[must_use]
    fn switched(_tests: &[Self], pieces: &[Self], _natural: impl Fn() -> usize) -> Self {
        pieces[0]
    }
}

impl Real for f64 {
    fn value(&self) -> f64 {
        *self
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn ln(self) -> Self {
        f64::ln(self)
    }
    fn sin(self) -> Self {
        f64::sin(self)
    }
    fn cos(self) -> Self {
        f64::cos(self)
    }
    fn tan(self) -> Self {
        f64::tan(self)
    }
    fn atan(self) -> Self {
        f64::atan(self)
    }
    fn sinh(self) -> Self {
        f64::sinh(self)
    }
    fn cosh(self) -> Self {
        f64::cosh(self)
    }
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
    fn asin(self) -> Self {
        f64::asin(self)
    }
    fn acos(self) -> Self {
        f64::acos(self)
    }
    fn ln_1p(self) -> Self {
        f64::ln_1p(self)
    }
    fn exp_m1(self) -> Self {
        f64::exp_m1(self)
    }
    fn cbrt(self) -> Self {
        f64::cbrt(self)
    }
    fn atan2(self, other: Self) -> Self {
        f64::atan2(self, other)
    }
    // The powers of NaN are NaN: std has 1 for the exponent 0.
    fn powi(self, n: i32) -> Self {
        if self.is_nan() { self } else { f64::powi(self, n) }
    }
    fn powf(self, p: f64) -> Self {
        if self.is_nan() { self } else { f64::powf(self, p) }
    }
}
