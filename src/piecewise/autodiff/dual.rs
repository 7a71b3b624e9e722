//! Dual numbers as scalars of formulas.

use num_dual::{Dual64, DualNum};

use crate::piecewise::Real;

/// A function of x from its value and slope there; what does not depend on a variable has no derivative, even where the slope is infinite.
fn chain(x: Dual64, value: f64, slope: f64) -> Dual64 {
    Dual64::new(value, if x.eps == 0.0 { 0.0 } else { x.eps * slope })
}

/// xⁿ. Where x⁻ⁿ is too large or too small to be divided by, xⁿ may still be a number: then it is the power
/// of 1/x.
fn whole_power(x: f64, n: i32) -> f64 {
    let power = Real::powi(x, n);
    let inverse = x.recip();
    match n < 0 && !power.is_normal() && inverse.is_finite() {
        true => inverse.powi(n.saturating_neg()),
        false => power,
    }
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
        let slope = match n.checked_sub(1) {
            _ if n == 0 => 0.0,
            Some(less) => f64::from(n) * whole_power(self.re, less),
            None => f64::from(n) * self.re.powf(f64::from(n) - 1.0),
        };
        chain(self, whole_power(self.re, n), slope)
    }
    fn powf(self, p: f64) -> Self {
        let slope = if p == 0.0 { 0.0 } else { p * self.re.powf(p - 1.0) };
        chain(self, Real::powf(self.re, p), slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n xⁿ⁻¹ from logarithms, where it is a number, at points all over the range of numbers and for all
    /// signs.
    #[test]
    fn slopes_of_powers_are_numbers_wherever_they_exist() {
        for n in [-40, -7, -3, -2, -1, 0, 1, 2, 3, 8, 33] {
            for exponent in (-307..=307).step_by(3) {
                for x in [2.5, -2.5].map(|digits| digits * 10.0_f64.powi(exponent)) {
                    let slope = Real::powi(Dual64::new(x, 1.0), n).eps;
                    let size = x.abs().log10() * f64::from(n - 1) + f64::from(n).abs().log10();
                    let sign = if n < 0 { -1.0 } else { 1.0 } * if n % 2 == 0 { x.signum() } else { 1.0 };
                    if n == 0 || size < -324.0 {
                        assert_eq!(slope, 0.0, "{x:e} {n}");
                    } else if size > 309.0 {
                        assert_eq!(slope, sign * f64::INFINITY, "{x:e} {n}");
                    } else if size.abs() < 307.0 {
                        let digits = (slope * sign).log10() - size;
                        assert!(digits.abs() <= 1e-11, "{x:e} {n}: {slope:e}");
                    }
                }
            }
        }
        let exact = [(1e-70, -2, -2e210), (1e110, -1, -1e-220), (1e155, -1, -1e-310)];
        for (x, n, slope) in exact {
            let found = Real::powi(Dual64::new(x, 1.0), n).eps;
            assert!((found / slope - 1.0).abs() <= 1e-14, "{x:e} {n}: {found:e}");
        }
        assert_eq!(Real::powi(Dual64::new(10.0, 1.0), -1).eps, -0.01);
    }
}
