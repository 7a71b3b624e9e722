use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::{BigInt, Sign};
use num_traits::{Signed, ToPrimitive, Zero};

/// An integer times a power of two, of any size: sums and products of floating-point numbers are such, without rounding.
///
/// ```
/// use semismooth::piecewise::Exact;
/// let (a, b) = (Exact::new(0.1).unwrap(), Exact::new(3.0).unwrap());
/// // 3 · 0.1 is not 0.3 in floating-point numbers, nor is it what 0.1 + 0.1 + 0.1 rounds to.
/// assert_eq!(&(&a + &a) + &a, &a * &b);
/// assert_eq!((&(&a * &b) - &Exact::new(0.3).unwrap()).sign(), 1);
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Exact {
    /// Odd, or 0 with exponent 0.
    mantissa: BigInt,
    exponent: i64,
}

impl Exact {
    /// The exact value of a floating-point number; `None` for infinities and NaN.
    #[must_use]
    pub fn new(value: f64) -> Option<Self> {
        if !value.is_finite() {
            return None;
        }
        let bits = value.to_bits();
        let (raw, fraction) = ((bits >> 52 & 0x7ff) as i64, bits & ((1 << 52) - 1));
        let (magnitude, exponent) = if raw == 0 {
            (fraction, -1074)
        } else {
            (fraction | 1 << 52, raw - 1075)
        };
        let magnitude = BigInt::from(magnitude);
        Some(Self::of(
            if value < 0.0 { -magnitude } else { magnitude },
            exponent,
        ))
    }

    /// The number 1.
    #[must_use]
    pub fn one() -> Self {
        Self::of(BigInt::from(1), 0)
    }

    /// mantissa · 2^exponent.
    pub(crate) fn of(mantissa: BigInt, exponent: i64) -> Self {
        match mantissa.trailing_zeros() {
            None => Self::default(),
            Some(0) => Self { mantissa, exponent },
            Some(zeros) => Self {
                mantissa: mantissa >> zeros,
                exponent: exponent + zeros as i64,
            },
        }
    }

    /// −1, 0 or 1.
    #[must_use]
    pub fn sign(&self) -> i8 {
        match self.mantissa.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// Whether it is 0.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.mantissa.is_zero()
    }

    /// The absolute value.
    #[must_use]
    pub fn abs(&self) -> Self {
        Self {
            mantissa: self.mantissa.abs(),
            exponent: self.exponent,
        }
    }

    /// A floating-point number within one unit in the last place; 0 or infinite where that is out of range.
    #[must_use]
    pub fn to_f64(&self) -> f64 {
        self.scaled(0)
    }

    /// The least e with |self| < 2^e; `None` for 0.
    pub(crate) fn magnitude(&self) -> Option<i64> {
        (!self.is_zero()).then(|| self.mantissa.bits() as i64 + self.exponent)
    }

    /// self · 2^shift as a floating-point number, rounded by at most one unit in the last place.
    pub(crate) fn scaled(&self, shift: i64) -> f64 {
        let bits = self.mantissa.bits();
        let dropped = bits.saturating_sub(60);
        let top = if dropped > 0 {
            (self.mantissa.magnitude() >> dropped).to_f64()
        } else {
            self.mantissa.magnitude().to_f64()
        };
        let value = times_power(top.unwrap_or(0.0), self.exponent + dropped as i64 + shift);
        if self.sign() < 0 { -value } else { value }
    }

    /// self · 2^shift, which has to be an integer.
    pub(crate) fn integer(&self, shift: i64) -> BigInt {
        let exponent = self.exponent + shift;
        if exponent >= 0 {
            &self.mantissa << exponent as u64
        } else {
            &self.mantissa >> exponent.unsigned_abs()
        }
    }

    /// The largest e for which self / 2^e is an integer; `None` for 0.
    pub(crate) fn granularity(&self) -> Option<i64> {
        (!self.is_zero()).then_some(self.exponent)
    }

    /// self · 2^shift.
    pub(crate) fn shifted(mut self, shift: i64) -> Self {
        if !self.is_zero() {
            self.exponent += shift;
        }
        self
    }
}

/// v · 2^e without overflow on the way.
fn times_power(v: f64, e: i64) -> f64 {
    let mut value = v;
    let mut left = e.clamp(-4000, 4000);
    while left != 0 && value != 0.0 && value.is_finite() {
        let step = left.clamp(-900, 900);
        value *= f64::powi(2.0, step as i32);
        left -= step;
    }
    value
}

impl Add for &Exact {
    type Output = Exact;

    fn add(self, other: &Exact) -> Exact {
        if self.is_zero() {
            return other.clone();
        }
        if other.is_zero() {
            return self.clone();
        }
        let least = self.exponent.min(other.exponent);
        Exact::of(self.integer(-least) + other.integer(-least), least)
    }
}

impl Neg for &Exact {
    type Output = Exact;

    fn neg(self) -> Exact {
        Exact {
            mantissa: -&self.mantissa,
            exponent: self.exponent,
        }
    }
}

impl Sub for &Exact {
    type Output = Exact;

    fn sub(self, other: &Exact) -> Exact {
        self + &-other
    }
}

impl Mul for &Exact {
    type Output = Exact;

    fn mul(self, other: &Exact) -> Exact {
        Exact::of(&self.mantissa * &other.mantissa, self.exponent + other.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::Exact;

    #[test]
    fn floating_point_numbers_come_back() {
        for v in [
            0.0,
            1.0,
            -0.1,
            1e300,
            -3e-310,
            f64::MIN_POSITIVE,
            f64::MAX,
            5e-324,
        ] {
            let exact = Exact::new(v).unwrap();
            assert_eq!(exact.to_f64(), v);
            assert_eq!((&exact - &exact).sign(), 0);
        }
        assert!(Exact::new(f64::NAN).is_none() && Exact::new(f64::INFINITY).is_none());
        let tiny = Exact::new(1e-300).unwrap();
        let product = &tiny * &tiny;
        assert_eq!((product.sign(), product.to_f64()), (1, 0.0));
        assert!((product.scaled(2000) / (1e-300 * f64::powi(2.0, 1000)).powi(2) - 1.0).abs() < 1e-15);
    }
}
