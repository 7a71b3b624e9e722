//! Truncated Taylor series as scalars of formulas: the first K coefficients of f(x(s)) from those of x(s), by
//! the recurrences of A. Griewank and A. Walther, Evaluating Derivatives, 2nd edition (2008), tables 13.1 and
//! 13.2. Powers are composed from the binomial series of their base point instead, as the recurrence divides
//! by it and powers of 0 are wanted, too.

use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

use num_traits::Signed;

use crate::piecewise::Real;
use crate::piecewise::number::number;

/// What the coefficients of a series are: numbers, or enclosures of them.
pub(crate) trait Coefficient: Real {
    /// Whether this is certainly zero, so that a product with it is zero even where the other factor is
    /// infinite.
    fn vanishes(&self) -> bool;
    /// Whether this is negative; `None` where an enclosure has both signs.
    fn negative(&self) -> Option<bool>;
}

impl Coefficient for f64 {
    fn vanishes(&self) -> bool {
        *self == 0.0
    }
    fn negative(&self) -> Option<bool> {
        Some(self.is_sign_negative())
    }
}

/// Σ cₖ sᵏ up to s^(K−1).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Series<S, const K: usize>(pub(crate) [S; K]);

/// (1/k) Σ j aⱼ b₍ₖ₋ⱼ₎ over j = 1 … k: coefficient k of a function whose derivative is b a′.
fn integrated<S: Coefficient>(a: &[S], b: &[S], k: usize) -> S {
    let terms = (1..=k).filter(|&j| !a[j].vanishes());
    let sum = terms.fold(S::from(0.0), |sum, j| sum + a[j] * b[k - j] * j as f64);
    sum / k as f64
}

/// Σ aⱼ b₍ₖ₋ⱼ₎ over j = `first` … k − `first`: coefficient k of a product, or what its inner factors add to
/// it.
fn convolved<S: Coefficient>(a: &[S], b: &[S], k: usize, first: usize) -> S {
    (first..=k - first).fold(S::from(0.0), |sum, j| sum + a[j] * b[k - j])
}

impl<S: Coefficient, const K: usize> Series<S, K> {
    fn constant(value: S) -> Self {
        Self(std::array::from_fn(|k| if k == 0 { value } else { S::from(0.0) }))
    }

    fn map(self, f: impl FnMut(S) -> S) -> Self {
        Self(self.0.map(f))
    }

    /// A function of this series from its value and a rule for the others of its coefficients. What does not
    /// depend on s has no others, even where the slope of the function is infinite.
    fn function(self, value: S, others: impl FnOnce(&[S; K], &mut [S; K])) -> Self {
        let mut result = Self::constant(value);
        if self.0.iter().skip(1).any(|a| !a.vanishes()) {
            others(&self.0, &mut result.0);
        }
        result
    }

    /// The function r of this series a with the value given and r′ = a′/v.
    fn with_slope_over(self, value: S, v: Self) -> Self {
        self.function(value, |a, r| {
            for k in 1..K {
                r[k] = (a[k] - integrated(&*r, &v.0, k)) / v.0[0];
            }
        })
    }

    /// The pair (p, q) with p′ = q a′ and q′ = ± p a′ of this series a, from its values.
    fn pair(self, p: S, q: S, sign: f64) -> [Self; 2] {
        let mut second = Self::constant(q);
        let first = self.function(p, |a, p| {
            for k in 1..K {
                p[k] = integrated(a, &second.0, k);
                second.0[k] = integrated(a, &*p, k) * sign;
            }
        });
        [first, second]
    }

    /// The function t of this series a with t′ = v a′, v = v₀ ± (t² − t₀²).
    fn with_squared_slope(self, t: S, v: S, sign: f64) -> Self {
        let mut slope = Self::constant(v);
        self.function(t, |a, t| {
            for k in 1..K {
                t[k] = integrated(a, &slope.0, k);
                slope.0[k] = convolved(&*t, &*t, k, 0) * sign;
            }
        })
    }

    /// The power p, with the powers p − j of the value: Σ C(p, j) a₀^(p−j) (a − a₀)ʲ.
    fn power(self, p: S, of_value: impl Fn(usize) -> S) -> Self {
        self.function(of_value(0), |a, c| {
            let mut change = *a;
            change[0] = S::from(0.0);
            let mut powers = change;
            let mut binomial = S::from(1.0);
            for j in 1..K {
                binomial = binomial * (p - (j - 1) as f64) / j as f64;
                if binomial.vanishes() {
                    return;
                }
                let factor = binomial * of_value(j);
                for k in (j..K).filter(|&k| !powers[k].vanishes()) {
                    c[k] += factor * powers[k];
                }
                powers = std::array::from_fn(|k| convolved(&powers, &change, k, 0));
            }
        })
    }
}

number!([S: Coefficient, const K: usize] Series<S, K>);

impl<S: Coefficient, const K: usize> Neg for Series<S, K> {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl<S: Coefficient, const K: usize> Add for Series<S, K> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }
}

impl<S: Coefficient, const K: usize> Sub for Series<S, K> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }
}

impl<S: Coefficient, const K: usize> Mul for Series<S, K> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| convolved(&self.0, &other.0, k, 0)))
    }
}

impl<S: Coefficient, const K: usize> Div for Series<S, K> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let (a, b) = (&self.0, &other.0);
        let mut r = [S::from(0.0); K];
        for k in 0..K {
            // A quotient solves b r = a, coefficient by coefficient.
            #[allow(clippy::suspicious_arithmetic_impl)]
            let known = (1..=k).fold(a[k], |left, j| left - b[j] * r[k - j]);
            r[k] = known / b[0];
        }
        Self(r)
    }
}

impl<S: Coefficient, const K: usize> Rem for Series<S, K> {
    type Output = Self;
    /// a − q b with the whole number q of the values.
    fn rem(self, other: Self) -> Self {
        let value = self.0[0] % other.0[0];
        let quotient = (self.0[0] - value) / other.0[0];
        let mut rest = self - other.map(|b| b * quotient);
        rest.0[0] = value;
        rest
    }
}

impl<S: Coefficient, const K: usize> Add<f64> for Series<S, K> {
    type Output = Self;
    fn add(mut self, other: f64) -> Self {
        self.0[0] += other;
        self
    }
}

impl<S: Coefficient, const K: usize> Sub<f64> for Series<S, K> {
    type Output = Self;
    fn sub(mut self, other: f64) -> Self {
        self.0[0] -= other;
        self
    }
}

impl<S: Coefficient, const K: usize> Mul<f64> for Series<S, K> {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        self.map(|a| a * other)
    }
}

impl<S: Coefficient, const K: usize> Div<f64> for Series<S, K> {
    type Output = Self;
    fn div(self, other: f64) -> Self {
        self.map(|a| a / other)
    }
}

impl<S: Coefficient, const K: usize> Rem<f64> for Series<S, K> {
    type Output = Self;
    fn rem(mut self, other: f64) -> Self {
        self.0[0] %= other;
        self
    }
}

impl<S: Coefficient, const K: usize> From<f64> for Series<S, K> {
    fn from(value: f64) -> Self {
        Self::constant(S::from(value))
    }
}

/// By values, so that formulas that branch take the branch of the value.
impl<S: Coefficient, const K: usize> PartialEq for Series<S, K> {
    fn eq(&self, other: &Self) -> bool {
        self.0[0] == other.0[0]
    }
}

impl<S: Coefficient, const K: usize> Signed for Series<S, K> {
    fn abs(&self) -> Self {
        match self.0[0].negative() {
            Some(false) => *self,
            Some(true) => -*self,
            // Both signs occur, and the absolute value has no derivative in between.
            None => self.function(self.0[0].abs(), |_, c| c[1..].fill(S::from(f64::NAN))),
        }
    }
    fn abs_sub(&self, other: &Self) -> Self {
        let difference = *self - *other;
        (difference + difference.abs()) / 2.0
    }
    fn signum(&self) -> Self {
        Self::constant(self.0[0].signum())
    }
    fn is_positive(&self) -> bool {
        self.0[0].is_positive()
    }
    fn is_negative(&self) -> bool {
        self.0[0].is_negative()
    }
}

impl<S: Coefficient, const K: usize> Real for Series<S, K> {
    fn value(&self) -> f64 {
        self.0[0].value()
    }
    fn single(&self) -> Option<f64> {
        self.0[0].single()
    }
    fn sqrt(self) -> Self {
        self.function(self.0[0].sqrt(), |a, r| {
            for k in 1..K {
                r[k] = (a[k] - convolved(&*r, &*r, k, 1)) / (r[0] * 2.0);
            }
        })
    }
    fn exp(self) -> Self {
        self.function(self.0[0].exp(), |a, r| {
            for k in 1..K {
                r[k] = integrated(a, &*r, k);
            }
        })
    }
    fn ln(self) -> Self {
        self.with_slope_over(self.0[0].ln(), self)
    }
    fn sin(self) -> Self {
        self.pair(self.0[0].sin(), self.0[0].cos(), -1.0)[0]
    }
    fn cos(self) -> Self {
        self.pair(self.0[0].sin(), self.0[0].cos(), -1.0)[1]
    }
    fn tan(self) -> Self {
        let t = self.0[0].tan();
        self.with_squared_slope(t, t.powi(2) + 1.0, 1.0)
    }
    fn atan(self) -> Self {
        let mut slope = self * self + 1.0;
        slope.0[0] = self.0[0].powi(2) + 1.0;
        self.with_slope_over(self.0[0].atan(), slope)
    }
    fn sinh(self) -> Self {
        self.pair(self.0[0].sinh(), self.0[0].cosh(), 1.0)[0]
    }
    fn cosh(self) -> Self {
        self.pair(self.0[0].sinh(), self.0[0].cosh(), 1.0)[1]
    }
    fn tanh(self) -> Self {
        // 1 − tanh² would lose all digits of large arguments.
        let cosh = self.0[0].cosh();
        let slope = S::from(1.0) / cosh / cosh;
        self.with_squared_slope(self.0[0].tanh(), slope, -1.0)
    }
    fn asin(self) -> Self {
        let root = ((-self + 1.0) * (self + 1.0)).sqrt();
        self.with_slope_over(self.0[0].asin(), root)
    }
    fn acos(self) -> Self {
        let root = ((-self + 1.0) * (self + 1.0)).sqrt();
        self.with_slope_over(self.0[0].acos(), -root)
    }
    fn ln_1p(self) -> Self {
        self.with_slope_over(self.0[0].ln_1p(), self + 1.0)
    }
    fn exp_m1(self) -> Self {
        let mut result = self.exp();
        result.0[0] = self.0[0].exp_m1();
        result
    }
    fn cbrt(self) -> Self {
        let root = self.0[0].cbrt();
        self.power(S::from(1.0) / 3.0, |j| root / self.0[0].powi(j as i32))
    }
    fn atan2(self, other: Self) -> Self {
        // (x² + y²) r′ = x y′ − y x′.
        let (y, x, square) = (&self.0, &other.0, self * self + other * other);
        let mut result = Self::constant(y[0].atan2(x[0]));
        if [y, x].iter().any(|a| a.iter().skip(1).any(|a| !a.vanishes())) {
            let r = &mut result.0;
            for k in 1..K {
                let turned = integrated(y, x, k) - integrated(x, y, k);
                r[k] = (turned - integrated(&*r, &square.0, k)) / square.0[0];
            }
        }
        result
    }
    fn powi(self, n: i32) -> Self {
        self.power(S::from(f64::from(n)), |j| {
            self.0[0].powi(n.saturating_sub(j as i32))
        })
    }
    fn powf(self, p: f64) -> Self {
        self.power(S::from(p), |j| self.0[0].powf(p - j as f64))
    }
}

#[cfg(test)]
mod tests;
