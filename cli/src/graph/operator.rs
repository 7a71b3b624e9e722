//! Operators with one and with two operands: values, first and second derivatives.
//!
//! At kinks and jumps the derivatives are those of one of the pieces that meet there.

use std::f64::consts::LN_10;

/// An operator with one operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unary {
    /// −x.
    Negate,
    /// |x|.
    Abs,
    /// Largest integer ≤ x.
    Floor,
    /// Smallest integer ≥ x.
    Ceil,
    /// √x.
    Sqrt,
    /// eˣ.
    Exp,
    /// ln x.
    Log,
    /// log₁₀ x.
    Log10,
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Arc sine.
    Asin,
    /// Arc cosine.
    Acos,
    /// Arc tangent.
    Atan,
    /// Hyperbolic sine.
    Sinh,
    /// Hyperbolic cosine.
    Cosh,
    /// Hyperbolic tangent.
    Tanh,
    /// Inverse hyperbolic sine.
    Asinh,
    /// Inverse hyperbolic cosine.
    Acosh,
    /// Inverse hyperbolic tangent.
    Atanh,
    /// 1 / (1 + e⁻ˣ).
    Logistic,
    /// 1 where x = 0, else 0.
    Not,
    /// 0 where x = 0, else 1.
    Truth,
}

/// An operator with two operands; truth values are 1 and 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Binary {
    /// a + b.
    Add,
    /// a − b.
    Subtract,
    /// a b.
    Multiply,
    /// a / b.
    Divide,
    /// a minus b times the integer part of a / b.
    Remainder,
    /// aᵇ.
    Power,
    /// sign(a) |a|ᵇ.
    SignPower,
    /// max(a − b, 0).
    Less,
    /// min(a, b).
    Min,
    /// max(a, b).
    Max,
    /// The angle of the point (b, a).
    Atan2,
    /// The integer part of a / b.
    IntegerDivide,
    /// a to b significant digits.
    Precision,
    /// a rounded to b decimals.
    Round,
    /// a truncated to b decimals.
    Truncate,
    /// a ≠ 0 or b ≠ 0.
    Or,
    /// a ≠ 0 and b ≠ 0.
    And,
    /// Both are true, or neither is.
    Same,
    /// a < b.
    Below,
    /// a ≤ b.
    AtMost,
    /// a = b.
    Equal,
    /// a ≥ b.
    AtLeast,
    /// a > b.
    Above,
    /// a ≠ b.
    Different,
}

impl Unary {
    /// The value at x; NaN outside the domain.
    #[must_use]
    pub fn value(self, x: f64) -> f64 {
        match self {
            Self::Negate => -x,
            Self::Abs => x.abs(),
            Self::Floor => x.floor(),
            Self::Ceil => x.ceil(),
            Self::Sqrt => x.sqrt(),
            Self::Exp => x.exp(),
            Self::Log => x.ln(),
            Self::Log10 => x.log10(),
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Sinh => x.sinh(),
            Self::Cosh => x.cosh(),
            Self::Tanh => x.tanh(),
            Self::Asinh => x.asinh(),
            Self::Acosh => x.acosh(),
            Self::Atanh => x.atanh(),
            Self::Logistic => 1.0 / (1.0 + (-x).exp()),
            Self::Not => truth(x == 0.0, [x]),
            Self::Truth => truth(x != 0.0, [x]),
        }
    }

    /// First and second derivative at x, where the value is `y`.
    #[must_use]
    pub fn derivatives(self, x: f64, y: f64) -> (f64, f64) {
        match self {
            Self::Negate => (-1.0, 0.0),
            Self::Abs => (if x < 0.0 { -1.0 } else { 1.0 }, 0.0),
            Self::Floor | Self::Ceil | Self::Not | Self::Truth => (0.0, 0.0),
            Self::Sqrt => (0.5 / y, -0.25 / (x * y)),
            Self::Exp => (y, y),
            Self::Log => (1.0 / x, -1.0 / (x * x)),
            Self::Log10 => (1.0 / (LN_10 * x), -1.0 / (LN_10 * x * x)),
            Self::Sin => (x.cos(), -y),
            Self::Cos => (-x.sin(), -y),
            Self::Tan => (1.0 + y * y, 2.0 * y * (1.0 + y * y)),
            Self::Asin => {
                let w = 1.0 / (1.0 - x * x);
                (w.sqrt(), x * w * w.sqrt())
            }
            Self::Acos => {
                let w = 1.0 / (1.0 - x * x);
                (-w.sqrt(), -x * w * w.sqrt())
            }
            Self::Atan => {
                let w = 1.0 / (1.0 + x * x);
                (w, -2.0 * x * w * w)
            }
            Self::Sinh => (x.cosh(), y),
            Self::Cosh => (x.sinh(), y),
            Self::Tanh => (1.0 - y * y, -2.0 * y * (1.0 - y * y)),
            Self::Asinh => {
                let w = 1.0 / (1.0 + x * x);
                (w.sqrt(), -x * w * w.sqrt())
            }
            Self::Acosh => {
                let w = 1.0 / (x * x - 1.0);
                (w.sqrt(), -x * w * w.sqrt())
            }
            Self::Atanh => {
                let w = 1.0 / (1.0 - x * x);
                (w, 2.0 * x * w * w)
            }
            Self::Logistic => {
                let d = y * (1.0 - y);
                (d, d * (1.0 - 2.0 * y))
            }
        }
    }

    /// Whether second derivatives vanish wherever they exist.
    #[must_use]
    pub fn is_piecewise_affine(self) -> bool {
        matches!(
            self,
            Self::Negate | Self::Abs | Self::Floor | Self::Ceil | Self::Not | Self::Truth
        )
    }

    /// Whether the value has kinks or jumps.
    #[must_use]
    pub fn has_kinks(self) -> bool {
        matches!(
            self,
            Self::Abs | Self::Floor | Self::Ceil | Self::Not | Self::Truth
        )
    }
}

/// First and second partial derivatives with respect to both operands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Partials {
    /// ∂/∂a.
    pub a: f64,
    /// ∂/∂b.
    pub b: f64,
    /// ∂²/∂a².
    pub aa: f64,
    /// ∂²/∂a∂b.
    pub ab: f64,
    /// ∂²/∂b².
    pub bb: f64,
}

impl Binary {
    /// The value at (a, b); NaN outside the domain.
    #[must_use]
    pub fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Remainder => a % b,
            Self::Power => power(a, b),
            Self::SignPower => power(a.abs(), b).copysign(a),
            Self::Less => least_zero(a - b),
            Self::Min => choose(a, b, a <= b),
            Self::Max => choose(a, b, a >= b),
            Self::Atan2 => a.atan2(b),
            Self::IntegerDivide => (a / b).trunc(),
            Self::Precision => significant(a, b),
            Self::Round => decimals(a, b, f64::round),
            Self::Truncate => decimals(a, b, f64::trunc),
            // As in AMPL, the second operand counts only where the first leaves the result open.
            Self::Or if a != 0.0 => truth(true, [a]),
            Self::And if a == 0.0 => 0.0,
            Self::Or | Self::And => truth(b != 0.0, [a, b]),
            Self::Same => truth((a != 0.0) == (b != 0.0), [a, b]),
            Self::Below => truth(a < b, [a, b]),
            Self::AtMost => truth(a <= b, [a, b]),
            Self::Equal => truth(a == b, [a, b]),
            Self::AtLeast => truth(a >= b, [a, b]),
            Self::Above => truth(a > b, [a, b]),
            Self::Different => truth(a != b, [a, b]),
        }
    }

    /// The derivatives at (a, b), where the value is `y`.
    #[must_use]
    pub fn derivatives(self, a: f64, b: f64, y: f64) -> Partials {
        let first = |a, b| Partials {
            a,
            b,
            ..Partials::default()
        };
        match self {
            Self::Add => first(1.0, 1.0),
            Self::Subtract => first(1.0, -1.0),
            Self::Multiply => Partials {
                ab: 1.0,
                ..first(b, a)
            },
            Self::Divide => Partials {
                ab: -1.0 / (b * b),
                bb: 2.0 * y / (b * b),
                ..first(1.0 / b, -y / b)
            },
            Self::Remainder => first(1.0, -(a / b).trunc()),
            Self::Power => {
                let (a1, a2) = power_derivatives(a, b);
                let log = a.ln();
                // 0 to a positive power does not change with the exponent.
                let flat = a == 0.0 && b > 0.0;
                Partials {
                    a: a1,
                    b: if flat { 0.0 } else { y * log },
                    aa: a2,
                    ab: if flat {
                        0.0
                    } else {
                        power(a, b - 1.0) * (1.0 + b * log)
                    },
                    bb: if flat { 0.0 } else { y * log * log },
                }
            }
            Self::SignPower => {
                let p = Self::Power.derivatives(a.abs(), b, y.abs());
                let sign = 1.0_f64.copysign(a);
                Partials {
                    a: p.a,
                    b: sign * p.b,
                    aa: sign * p.aa,
                    ab: p.ab,
                    bb: sign * p.bb,
                }
            }
            Self::Less => match a > b {
                true => first(1.0, -1.0),
                false => first(0.0, 0.0),
            },
            Self::Min => first(truth(a <= b, [a, b]), truth(a > b, [a, b])),
            Self::Max => first(truth(a >= b, [a, b]), truth(a < b, [a, b])),
            Self::Atan2 => {
                let r = a * a + b * b;
                Partials {
                    aa: -2.0 * a * b / (r * r),
                    ab: (a * a - b * b) / (r * r),
                    bb: 2.0 * a * b / (r * r),
                    ..first(b / r, -a / r)
                }
            }
            Self::IntegerDivide
            | Self::Precision
            | Self::Round
            | Self::Truncate
            | Self::Or
            | Self::And
            | Self::Same
            | Self::Below
            | Self::AtMost
            | Self::Equal
            | Self::AtLeast
            | Self::Above
            | Self::Different => first(0.0, 0.0),
        }
    }

    /// Whether second derivatives vanish wherever they exist.
    #[must_use]
    pub fn is_piecewise_affine(self) -> bool {
        !matches!(
            self,
            Self::Multiply | Self::Divide | Self::Power | Self::SignPower | Self::Atan2
        )
    }

    /// Whether the value has kinks or jumps.
    #[must_use]
    pub fn has_kinks(self) -> bool {
        self.is_piecewise_affine() && !matches!(self, Self::Add | Self::Subtract)
    }
}

/// First and second derivative of aᵖ with respect to a; 0⁰ = 1 and its derivatives are 0.
#[must_use]
pub fn power_derivatives(a: f64, p: f64) -> (f64, f64) {
    let times = |c: f64, q: f64| if c == 0.0 { 0.0 } else { c * power(a, q) };
    (times(p, p - 1.0), times(p * (p - 1.0), p - 2.0))
}

/// aᵖ; by integer powers where p is a small integer. NaN for NaN, also where p = 0 or a = 1.
#[must_use]
pub fn power(a: f64, p: f64) -> f64 {
    if a.is_nan() || p.is_nan() {
        f64::NAN
    } else if p == p.trunc() && p.abs() <= 64.0 {
        a.powi(p as i32)
    } else {
        a.powf(p)
    }
}

/// 1 or 0; NaN if an operand is NaN, since it is undefined then whether the statement holds.
fn truth<const N: usize>(is: bool, operands: [f64; N]) -> f64 {
    match operands.iter().any(|x| x.is_nan()) {
        true => f64::NAN,
        false => f64::from(u8::from(is)),
    }
}

/// max(x, 0), NaN for NaN.
fn least_zero(x: f64) -> f64 {
    if x < 0.0 { 0.0 } else { x }
}

fn choose(a: f64, b: f64, first: bool) -> f64 {
    match () {
        () if a.is_nan() || b.is_nan() => f64::NAN,
        () if first => a,
        () => b,
    }
}

fn significant(x: f64, digits: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    decimals(x, digits - 1.0 - x.abs().log10().floor(), f64::round)
}

fn decimals(x: f64, places: f64, cut: fn(f64) -> f64) -> f64 {
    let scale = 10.0_f64.powf(places.round());
    let cut = cut(x * scale) / scale;
    // So many places that nothing is cut.
    if cut.is_finite() { cut } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNARY: [Unary; 21] = [
        Unary::Negate,
        Unary::Abs,
        Unary::Floor,
        Unary::Ceil,
        Unary::Sqrt,
        Unary::Exp,
        Unary::Log,
        Unary::Log10,
        Unary::Sin,
        Unary::Cos,
        Unary::Tan,
        Unary::Asin,
        Unary::Acos,
        Unary::Atan,
        Unary::Sinh,
        Unary::Cosh,
        Unary::Tanh,
        Unary::Asinh,
        Unary::Acosh,
        Unary::Atanh,
        Unary::Logistic,
    ];

    fn close(found: f64, expected: f64) -> bool {
        (found - expected).abs() <= 1e-5 * (1.0 + expected.abs())
    }

    #[test]
    fn derivatives_of_one_operand_are_limits_of_quotients() {
        let h = 1e-5;
        for op in UNARY {
            let mut tried = 0;
            for x in [-2.3, -0.7, -0.3, 0.3, 0.7, 1.3, 2.3] {
                let f = |x| op.value(x);
                let (d1, d2) = op.derivatives(x, f(x));
                if !f(x).is_finite() {
                    continue;
                }
                tried += 1;
                let first = (f(x + h) - f(x - h)) / (2.0 * h);
                assert!(close(d1, first), "{op:?} at {x}: {d1} is not {first}");
                let slope = |x: f64| op.derivatives(x, op.value(x)).0;
                let second = (slope(x + h) - slope(x - h)) / (2.0 * h);
                assert!(close(d2, second), "{op:?} at {x}: {d2} is not {second}");
                assert!(d2 == 0.0 || !op.is_piecewise_affine());
            }
            assert!(tried >= 2, "{op:?}");
        }
    }

    #[test]
    fn derivatives_of_two_operands_are_limits_of_quotients() {
        let h = 1e-5;
        for op in [
            Binary::Add,
            Binary::Subtract,
            Binary::Multiply,
            Binary::Divide,
            Binary::Remainder,
            Binary::Power,
            Binary::SignPower,
            Binary::Less,
            Binary::Min,
            Binary::Max,
            Binary::Atan2,
        ] {
            let mut tried = 0;
            for (a, b) in [(0.7, 1.6), (2.3, 0.9), (-0.4, 1.7), (-2.7, -1.1), (3.1, -2.0)] {
                let f = |a, b| op.value(a, b);
                if !f(a, b).is_finite() || (op == Binary::Power && a < 0.0) {
                    continue;
                }
                tried += 1;
                let d = |a, b| op.derivatives(a, b, op.value(a, b));
                let along_a = |g: &dyn Fn(f64, f64) -> f64| (g(a + h, b) - g(a - h, b)) / (2.0 * h);
                let along_b = |g: &dyn Fn(f64, f64) -> f64| (g(a, b + h) - g(a, b - h)) / (2.0 * h);
                for (name, found, expected) in [
                    ("a", d(a, b).a, along_a(&f)),
                    ("b", d(a, b).b, along_b(&f)),
                    ("aa", d(a, b).aa, along_a(&|a, b| d(a, b).a)),
                    ("ab", d(a, b).ab, along_a(&|a, b| d(a, b).b)),
                    ("ba", d(a, b).ab, along_b(&|a, b| d(a, b).a)),
                    ("bb", d(a, b).bb, along_b(&|a, b| d(a, b).b)),
                ] {
                    assert!(
                        close(found, expected),
                        "{op:?} at ({a}, {b}), {name}: {found} is not {expected}"
                    );
                }
            }
            assert!(tried >= 3, "{op:?}");
        }
    }

    #[test]
    fn values_with_digits_are_those_of_ampl() {
        for (op, a, b, value) in [
            (Binary::Precision, 1234.567, 3.0, 1230.0),
            (Binary::Precision, -0.012345, 2.0, -0.012),
            (Binary::Precision, 0.0, 2.0, 0.0),
            (Binary::Round, 7.28459, 2.0, 7.28),
            (Binary::Round, -2.5, 0.0, -3.0),
            (Binary::Round, 1234.0, -2.0, 1200.0),
            (Binary::Truncate, -3.99, 0.0, -3.0),
            (Binary::Truncate, 3.999, 1.0, 3.9),
            (Binary::IntegerDivide, -7.0, 2.0, -3.0),
            (Binary::Remainder, -7.0, 2.0, -1.0),
            (Binary::Less, 5.0, 2.0, 3.0),
            (Binary::Less, 2.0, 5.0, 0.0),
            (Binary::Round, 1.5, 400.0, 1.5),
        ] {
            assert_eq!(op.value(a, b), value, "{op:?} {a} {b}");
        }
    }

    #[test]
    fn what_is_not_a_number_stays_so() {
        for op in [
            Binary::Min,
            Binary::Max,
            Binary::Less,
            Binary::Add,
            Binary::Power,
            Binary::SignPower,
            Binary::Same,
            Binary::Below,
            Binary::AtMost,
            Binary::Equal,
            Binary::AtLeast,
            Binary::Above,
            Binary::Different,
        ] {
            assert!(op.value(f64::NAN, 1.0).is_nan() && op.value(1.0, f64::NAN).is_nan());
        }
        for op in UNARY.into_iter().chain([Unary::Not, Unary::Truth]) {
            assert!(op.value(f64::NAN).is_nan(), "{op:?}");
        }
        assert!(power(f64::NAN, 0.0).is_nan());
    }

    #[test]
    fn and_and_or_need_their_second_operand_only_where_the_first_leaves_them_open() {
        let nan = f64::NAN;
        assert_eq!(
            (Binary::Or.value(2.0, nan), Binary::And.value(0.0, nan)),
            (1.0, 0.0)
        );
        for (op, a, b) in [
            (Binary::Or, 0.0, nan),
            (Binary::Or, nan, 1.0),
            (Binary::And, 1.0, nan),
            (Binary::And, nan, 0.0),
        ] {
            assert!(op.value(a, b).is_nan(), "{op:?} {a} {b}");
        }
        for (op, values) in [
            (Binary::Or, [0.0, 1.0, 1.0, 1.0]),
            (Binary::And, [0.0, 0.0, 0.0, 1.0]),
        ] {
            let found = [(0.0, 0.0), (0.0, 2.0), (-1.0, 0.0), (3.0, 1.0)].map(|(a, b)| op.value(a, b));
            assert_eq!(found, values, "{op:?}");
        }
    }

    #[test]
    fn powers_of_zero_have_finite_derivatives_where_they_exist() {
        assert_eq!(power_derivatives(0.0, 2.0), (0.0, 2.0));
        assert_eq!(power_derivatives(0.0, 1.0), (1.0, 0.0));
        assert_eq!(power_derivatives(0.0, 0.0), (0.0, 0.0));
        assert_eq!(power_derivatives(0.0, 0.5).0, f64::INFINITY);
        let d = Binary::Power.derivatives(0.0, 2.0, 0.0);
        assert_eq!((d.a, d.b, d.aa, d.bb), (0.0, 0.0, 2.0, 0.0));
    }
}
