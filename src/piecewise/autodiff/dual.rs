//! Dual numbers as scalars of formulas.

use num_dual::{Dual64, DualNum};

use crate::piecewise::Real;

/// A function of x from its value and slope there; what does not depend on a variable has no derivative, even where the slope is infinite.
fn chain(x: Dual64, value: f64, slope: f64) -> Dual64 {
    Dual64::new(value, if x.eps == 0.0 { 0.0 } else { x.eps * slope })
}

// Of num-dual's derivatives those of √x, tanh x, xⁿ and x^p are NaN or inexact where x is 0, tiny or large.
impl Real for Dual64 {
    fn value(&self) -> f64 {
        self.re
    }
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        chain(self, root, 0.5 / root)
    }
    fn exp(self) -> Self {
        DualNum::exp(&self)
    }
    fn ln(self) -> Self {
        DualNum::ln(&self)
    }
    fn sin(self) -> Self {
        DualNum::sin(&self)
    }
    fn cos(self) -> Self {
        DualNum::cos(&self)
    }
    fn tan(self) -> Self {
        DualNum::tan(&self)
    }
    fn atan(self) -> Self {
        DualNum::atan(&self)
    }
    fn sinh(self) -> Self {
        DualNum::sinh(&self)
    }
    fn cosh(self) -> Self {
        DualNum::cosh(&self)
    }
    fn tanh(self) -> Self {
        let cosh = self.re.cosh();
        chain(self, self.re.tanh(), 1.0 / cosh / cosh)
    }
    fn powi(self, n: i32) -> Self {
        let slope = if n == 0 {
            0.0
        } else {
            f64::from(n) * Real::powi(self.re, n.saturating_sub(1))
        };
        chain(self, Real::powi(self.re, n), slope)
    }
    fn powf(self, p: f64) -> Self {
        let slope = if p == 0.0 { 0.0 } else { p * self.re.powf(p - 1.0) };
        chain(self, Real::powf(self.re, p), slope)
    }
}
