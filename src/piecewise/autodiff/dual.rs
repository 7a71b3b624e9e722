//! Dual numbers as scalars of formulas.

use num_dual::{Dual64, DualNum};

use crate::piecewise::Real;

/// A function of x from its value and slope there; what does not depend on a variable has no derivative, even where the slope is infinite.
fn chain(x: Dual64, value: f64, slope: f64) -> Dual64 {
    Dual64::new(value, if x.eps == 0.0 { 0.0 } else { x.eps * slope })
}

// Of num-dual's derivatives those of √x, tanh x and x^p are NaN or inexact where x is 0, tiny or large.
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
    fn asin(self) -> Self {
        let root = ((1.0 - self.re) * (1.0 + self.re)).sqrt();
        chain(self, self.re.asin(), 1.0 / root)
    }
    fn acos(self) -> Self {
        let root = ((1.0 - self.re) * (1.0 + self.re)).sqrt();
        chain(self, self.re.acos(), -1.0 / root)
    }
    fn ln_1p(self) -> Self {
        chain(self, self.re.ln_1p(), 1.0 / (1.0 + self.re))
    }
    fn exp_m1(self) -> Self {
        chain(self, self.re.exp_m1(), self.re.exp())
    }
    fn cbrt(self) -> Self {
        let root = self.re.cbrt();
        chain(self, root, 1.0 / (3.0 * root * root))
    }
    fn atan2(self, other: Self) -> Self {
        let angle = self.re.atan2(other.re);
        if self.eps == 0.0 && other.eps == 0.0 {
            return Dual64::new(angle, 0.0);
        }
        let radius = self.re.hypot(other.re);
        let slope = (other.re / radius * self.eps - self.re / radius * other.eps) / radius;
        Dual64::new(angle, slope)
    }
    fn powi(self, n: i32) -> Self {
        DualNum::powi(&self, n)
    }
    fn powf(self, p: f64) -> Self {
        let slope = if p == 0.0 { 0.0 } else { p * self.re.powf(p - 1.0) };
        chain(self, self.re.powf(p), slope)
    }
}
