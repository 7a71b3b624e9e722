//! Intervals as scalars of formulas: what a formula takes at all points of a box lies in the interval that it
//! gives for the box.
//!
//! Sums, products, quotients and square roots are rounded outward exactly, by the sign of their rounding
//! error. The other functions of the standard library are assumed to be within [`ULPS`] units in the last
//! place.

use std::cell::Cell;
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

use num_traits::Signed;

use super::series::Coefficient;
use crate::piecewise::Real;
use crate::piecewise::number::number;

/// Units in the last place by which exp, ln and the like are widened: the C libraries and Rust's own port of
/// them document errors of at most 2 for these functions; twice as many leaves a margin.
const ULPS: usize = 4;

thread_local! {
    /// Whether a formula asked for the value of an interval with more than one point: then it may have taken
    /// a branch that is not that of all points. Formulas run on the thread that calls them, as scalars need
    /// not be `Send`.
    static BRANCHED: Cell<bool> = const { Cell::new(false) };
}

/// What `evaluate` gives, unless a formula branched in it on the value of an interval that does not decide
/// the branch.
pub(super) fn without_branches<R>(evaluate: impl FnOnce() -> R) -> Option<R> {
    let before = BRANCHED.replace(false);
    let result = evaluate();
    (!BRANCHED.replace(before)).then_some(result)
}

fn branch() {
    BRANCHED.set(true);
}

/// The numbers from `low` to `high`; both are NaN where a function is not defined at some of its arguments.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interval {
    low: f64,
    high: f64,
}

/// a + b rounded down: the rounding error is computed exactly (Knuth 1969), or is no number where the sum
/// overflows.
fn sum_down(a: f64, b: f64) -> f64 {
    let sum = a + b;
    let part = sum - a;
    let error = (a - (sum - part)) + (b - part);
    if error >= 0.0 { sum } else { sum.next_down() }
}

/// a b rounded down; 0 times anything is 0, as infinite ends stand for large numbers.
fn product_down(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        return 0.0;
    }
    let product = a * b;
    let error = a.mul_add(b, -product);
    // An error that underflows keeps its sign, and no error is +0.
    if !error.is_nan() && error.is_sign_negative() {
        product.next_down()
    } else {
        product
    }
}

/// a / b rounded down, b ≠ 0.
fn quotient_down(a: f64, b: f64) -> f64 {
    if a == 0.0 {
        return 0.0;
    }
    let (a, b) = if b < 0.0 { (-a, -b) } else { (a, b) };
    let quotient = a / b;
    let left = (-quotient).mul_add(b, a);
    if !left.is_nan() && left.is_sign_negative() {
        quotient.next_down()
    } else {
        quotient
    }
}

fn root_down(a: f64) -> f64 {
    let root = a.sqrt();
    let left = (-root).mul_add(root, a);
    if !left.is_nan() && left.is_sign_negative() {
        root.next_down()
    } else {
        root
    }
}

fn root_up(a: f64) -> f64 {
    let root = a.sqrt();
    let over = root.mul_add(root, -a);
    if !over.is_nan() && over.is_sign_negative() {
        root.next_up()
    } else {
        root
    }
}

fn far_down(value: f64) -> f64 {
    (0..ULPS).fold(value, |v, _| v.next_down())
}

fn far_up(value: f64) -> f64 {
    (0..ULPS).fold(value, |v, _| v.next_up())
}

impl Interval {
    const UNDEFINED: Self = Self {
        low: f64::NAN,
        high: f64::NAN,
    };

    pub(crate) fn new(low: f64, high: f64) -> Self {
        if low <= high {
            // Infinite numbers are no values; they stand for large ones.
            let (low, high) = (low.min(f64::MAX), high.max(f64::MIN));
            Self { low, high }
        } else {
            Self::UNDEFINED
        }
    }

    /// All numbers at most `radius` from `centre`.
    pub(crate) fn ball(centre: f64, radius: f64) -> Self {
        Self::new(sum_down(centre, -radius), -sum_down(-centre, -radius))
    }

    /// The ends; infinite where the function is not defined everywhere.
    pub(crate) fn ends(self) -> (f64, f64) {
        if self.is_undefined() {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            (self.low, self.high)
        }
    }

    pub(crate) fn is_undefined(self) -> bool {
        self.low.is_nan()
    }

    fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    fn is_point(self) -> bool {
        self.low == self.high
    }

    /// A growing function that the library computes, with the bounds of its values.
    fn growing(self, f: fn(f64) -> f64, least: f64, most: f64) -> Self {
        if self.is_undefined() {
            return self;
        }
        Self::new(far_down(f(self.low)).max(least), far_up(f(self.high)).min(most))
    }

    /// Distances from 0.
    fn modulus(self) -> Self {
        if self.low >= 0.0 {
            self
        } else if self.high <= 0.0 {
            -self
        } else {
            Self::new(0.0, (-self.low).max(self.high))
        }
    }

    /// xⁿ of numbers x ≥ 0.
    fn whole_power(self, mut n: u32) -> Self {
        let (mut power, mut square) = (Self::from(1.0), self);
        while n > 0 {
            if n & 1 == 1 {
                power *= square;
            }
            n >>= 1;
            if n > 0 {
                square *= square;
            }
        }
        power
    }

    /// sin (greatest where x / (π/2) is 1 modulo 4) and cos (0), least two quarter turns on.
    fn wave(self, f: fn(f64) -> f64, top: f64) -> Self {
        if self.is_undefined() {
            return self;
        }
        let turns = self.quarter_turns();
        let (first, last) = (f(self.low), f(self.high));
        let low = if turns.meets(top + 2.0, 4.0) {
            -1.0
        } else {
            far_down(first.min(last)).max(-1.0)
        };
        let high = if turns.meets(top, 4.0) {
            1.0
        } else {
            far_up(first.max(last)).min(1.0)
        };
        Self::new(low, high)
    }

    /// Whether a number `period` · k + `first` (k whole, the period a power of two) lies in this interval.
    /// Rounding of large numbers never moves one across such a number.
    fn meets(self, first: f64, period: f64) -> bool {
        ((self.low - first) / period).ceil() <= ((self.high - first) / period).floor()
    }

    /// x / (π/2).
    fn quarter_turns(self) -> Self {
        self / Self::new(FRAC_PI_2.next_down(), FRAC_PI_2.next_up())
    }
}

impl From<f64> for Interval {
    fn from(value: f64) -> Self {
        Self::new(value, value)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            low: -self.high,
            high: -self.low,
        }
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(sum_down(self.low, other.low), -sum_down(-self.high, -other.high))
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

/// The hull of what pairs of ends give, each rounded down and up; that of two infinite ends is no number and
/// says nothing.
fn hull(pairs: [(f64, f64); 4], down: fn(f64, f64) -> f64) -> Interval {
    let ends = pairs.map(|(a, b)| (down(a, b), -down(-a, b)));
    Interval::new(
        ends.iter().fold(f64::INFINITY, |low, e| low.min(e.0)),
        ends.iter().fold(f64::NEG_INFINITY, |high, e| high.max(e.1)),
    )
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.is_undefined() || other.is_undefined() {
            return Self::UNDEFINED;
        }
        let (a, b) = (self, other);
        if a.low >= 0.0 && b.low >= 0.0 {
            return Self::new(product_down(a.low, b.low), -product_down(-a.high, b.high));
        }
        hull(
            [(a.low, b.low), (a.low, b.high), (a.high, b.low), (a.high, b.high)],
            product_down,
        )
    }
}

impl Div for Interval {
    type Output = Self;
    /// Undefined where the divisor may be 0.
    fn div(self, other: Self) -> Self {
        if self.is_undefined() || other.is_undefined() || other.contains(0.0) {
            return Self::UNDEFINED;
        }
        let (a, b) = (self, other);
        hull(
            [(a.low, b.low), (a.low, b.high), (a.high, b.low), (a.high, b.high)],
            quotient_down,
        )
    }
}

impl Rem for Interval {
    type Output = Self;
    /// Undefined where the quotients have different whole parts.
    fn rem(self, other: Self) -> Self {
        let quotient = self / other;
        let whole = quotient.low.trunc();
        if whole == quotient.high.trunc() {
            self - other * whole
        } else {
            Self::UNDEFINED
        }
    }
}

macro_rules! with_numbers {
    ($($trait:ident $method:ident)*) => {$(
        impl $trait<f64> for Interval {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                self.$method(Self::from(other))
            }
        }
    )*};
}
with_numbers!(Add add Sub sub Mul mul Div div Rem rem);
number!([] Interval);

impl PartialEq for Interval {
    fn eq(&self, other: &Self) -> bool {
        let apart = self.high < other.low || other.high < self.low;
        if !(apart || self.is_point() && other.is_point()) {
            branch();
        }
        self.is_point() && other.is_point() && !apart
    }
}

impl Signed for Interval {
    fn abs(&self) -> Self {
        if self.is_undefined() {
            return *self;
        }
        self.modulus()
    }
    fn abs_sub(&self, other: &Self) -> Self {
        let difference = *self - *other;
        Self::new(difference.low.max(0.0), difference.high.max(0.0))
    }
    fn signum(&self) -> Self {
        match self.negative() {
            Some(negative) => Self::from(if negative { -1.0 } else { 1.0 }),
            None => {
                branch();
                Self::new(-1.0, 1.0)
            }
        }
    }
    fn is_positive(&self) -> bool {
        !self.is_negative()
    }
    fn is_negative(&self) -> bool {
        self.negative().unwrap_or_else(|| {
            branch();
            false
        })
    }
}

impl Coefficient for Interval {
    fn vanishes(&self) -> bool {
        self.low == 0.0 && self.high == 0.0
    }
    fn negative(&self) -> Option<bool> {
        if self.low >= 0.0 {
            Some(false)
        } else if self.high < 0.0 {
            Some(true)
        } else {
            None
        }
    }
}

impl Real for Interval {
    fn value(&self) -> f64 {
        if !self.is_point() {
            branch();
        }
        0.5 * self.low + 0.5 * self.high
    }
    fn single(&self) -> Option<f64> {
        (self.is_undefined() || self.is_point()).then_some(self.low)
    }
    fn sqrt(self) -> Self {
        if self.low >= 0.0 {
            Self::new(root_down(self.low), root_up(self.high))
        } else {
            Self::UNDEFINED
        }
    }
    fn exp(self) -> Self {
        self.growing(f64::exp, 0.0, f64::INFINITY)
    }
    fn ln(self) -> Self {
        if self.low > 0.0 {
            self.growing(f64::ln, f64::NEG_INFINITY, f64::INFINITY)
        } else {
            Self::UNDEFINED
        }
    }
    fn sin(self) -> Self {
        self.wave(f64::sin, 1.0)
    }
    fn cos(self) -> Self {
        self.wave(f64::cos, 0.0)
    }
    fn tan(self) -> Self {
        // Poles are the odd quarter turns.
        if self.quarter_turns().meets(1.0, 2.0) {
            return Self::UNDEFINED;
        }
        self.growing(f64::tan, f64::NEG_INFINITY, f64::INFINITY)
    }
    fn atan(self) -> Self {
        self.growing(f64::atan, -FRAC_PI_2.next_up(), FRAC_PI_2.next_up())
    }
    fn sinh(self) -> Self {
        self.growing(f64::sinh, f64::NEG_INFINITY, f64::INFINITY)
    }
    fn cosh(self) -> Self {
        self.modulus().growing(f64::cosh, 1.0, f64::INFINITY)
    }
    fn tanh(self) -> Self {
        self.growing(f64::tanh, -1.0, 1.0)
    }
    fn asin(self) -> Self {
        if self.low >= -1.0 && self.high <= 1.0 {
            self.growing(f64::asin, -FRAC_PI_2.next_up(), FRAC_PI_2.next_up())
        } else {
            Self::UNDEFINED
        }
    }
    fn acos(self) -> Self {
        if self.low >= -1.0 && self.high <= 1.0 {
            let falling = |x: f64| -x.acos();
            -self.growing(falling, -PI.next_up(), 0.0)
        } else {
            Self::UNDEFINED
        }
    }
    fn ln_1p(self) -> Self {
        if self.low > -1.0 {
            self.growing(f64::ln_1p, f64::NEG_INFINITY, f64::INFINITY)
        } else {
            Self::UNDEFINED
        }
    }
    fn exp_m1(self) -> Self {
        self.growing(f64::exp_m1, -1.0, f64::INFINITY)
    }
    fn cbrt(self) -> Self {
        self.growing(f64::cbrt, f64::NEG_INFINITY, f64::INFINITY)
    }
    fn atan2(self, other: Self) -> Self {
        let quarter = Self::new(FRAC_PI_2.next_down(), FRAC_PI_2.next_up());
        if other.low > 0.0 {
            (self / other).atan()
        } else if self.low > 0.0 {
            quarter - (other / self).atan()
        } else if self.high < 0.0 {
            -quarter - (other / self).atan()
        } else {
            // At the jump, or where the angle is not defined.
            Self::UNDEFINED
        }
    }
    fn powi(self, n: i32) -> Self {
        if self.is_undefined() {
            return self;
        }
        let size = n.unsigned_abs();
        let of = |x: f64| Self::from(x.abs()).whole_power(size);
        let power = if n % 2 == 0 {
            let modulus = self.modulus();
            Self::new(of(modulus.low).low, of(modulus.high).high)
        } else {
            let signed = |x: f64| if x < 0.0 { -of(x) } else { of(x) };
            Self::new(signed(self.low).low, signed(self.high).high)
        };
        if n < 0 { Self::from(1.0) / power } else { power }
    }
    fn powf(self, p: f64) -> Self {
        if p.trunc() == p && p.abs() <= f64::from(i32::MAX) {
            return self.powi(p as i32);
        }
        let inside = self.low > 0.0 || (self.low == 0.0 && p > 0.0);
        if !inside || !p.is_finite() {
            return Self::UNDEFINED;
        }
        let (first, last) = (self.low.powf(p), self.high.powf(p));
        let (least, most) = if p > 0.0 { (first, last) } else { (last, first) };
        Self::new(far_down(least).max(0.0), far_up(most))
    }
}

#[cfg(test)]
mod tests;
