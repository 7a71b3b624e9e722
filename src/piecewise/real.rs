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
    // The powers of NaN are NaN: std has 1 for the exponent 0.
    fn powi(self, n: i32) -> Self {
        if self.is_nan() { self } else { f64::powi(self, n) }
    }
    fn powf(self, p: f64) -> Self {
        if self.is_nan() { self } else { f64::powf(self, p) }
    }
}
