//! Whether a formula is affine apart from its kinks, found by evaluating it over degrees instead of numbers.

use std::cell::Cell;
use std::ops::Neg;

use num_traits::Signed;

use crate::piecewise::Real;
use crate::piecewise::number::{functions, number, operators};

/// How a number depends on the variables of a formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Degree {
    /// Not at all: it is known.
    Number,
    /// It is affine on each piece of the kinks.
    Affine,
    /// In any other way, or not known.
    Curved,
}

/// A number of which the degree is known, and the value where it depends on nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Graded<'t> {
    degree: Degree,
    /// Of a `Number`, else NaN.
    value: f64,
    /// Set once the degrees found hold on a part of the space only, or a kink has curved tests. A `Number`
    /// has none.
    lost: Option<&'t Cell<bool>>,
}

/// Whether all of the given number of values, and all tests of kinks, are affine in the variables on each
/// piece. `false` also where the formula branches on values: what the other branches do is not known then.
pub(super) fn is_affine(
    variables: usize,
    values: usize,
    formula: impl for<'t> FnOnce(&[Graded<'t>], &mut [Graded<'t>]),
) -> bool {
    let lost = Cell::new(false);
    let variable = Graded {
        degree: Degree::Affine,
        value: f64::NAN,
        lost: Some(&lost),
    };
    let mut out = vec![Graded::from(0.0); values];
    formula(&vec![variable; variables], &mut out);
    out.iter().all(|v| v.degree() < Degree::Curved) && !lost.get()
}

impl<'t> Graded<'t> {
    /// The degree; a number that is not finite makes all that is computed from it curved.
    fn degree(self) -> Degree {
        match self.degree {
            Degree::Number if !self.value.is_finite() => Degree::Curved,
            degree => degree,
        }
    }

    /// The value of an operation on two numbers; `degree` is asked for where one of them depends on
    /// something.
    fn with(self, other: Self, value: f64, degree: impl FnOnce(Degree, Degree) -> Degree) -> Self {
        match self.lost.or(other.lost) {
            None => Self::from(value),
            lost => Self {
                degree: degree(self.degree(), other.degree()),
                value: f64::NAN,
                lost,
            },
        }
    }

    fn sum(self, other: Self, value: fn(f64, f64) -> f64) -> Self {
        self.with(other, value(self.value, other.value), Degree::max)
    }

    fn times(self, other: Self) -> Self {
        // 0 times what is finite wherever the variables are.
        let vanishes =
            |a: Self, b: Self| (a.degree, a.value) == (Degree::Number, 0.0) && b.degree() < Degree::Curved;
        if vanishes(self, other) || vanishes(other, self) {
            return Self::from(0.0);
        }
        self.with(other, self.value * other.value, |a, b| match a.min(b) {
            Degree::Number => a.max(b),
            _ => Degree::Curved,
        })
    }

    fn over(self, other: Self) -> Self {
        let fine = other.degree == Degree::Number && other.value != 0.0;
        self.with(other, self.value / other.value, |a, b| {
            if fine { a.max(b) } else { Degree::Curved }
        })
    }

    /// A function that is not affine.
    fn curved(self, value: impl FnOnce(f64) -> f64) -> Self {
        self.with(self, value(self.value), |_, _| Degree::Curved)
    }
}

impl PartialEq for Graded<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

impl From<f64> for Graded<'_> {
    fn from(value: f64) -> Self {
        Self {
            degree: Degree::Number,
            value,
            lost: None,
        }
    }
}

operators!(['t] Graded<'t> {
    Add add |a, b| a.sum(b, std::ops::Add::add);
    Sub sub |a, b| a.sum(b, std::ops::Sub::sub);
    Mul mul |a, b| a.times(b);
    Div div |a, b| a.over(b);
    Rem rem |a, b| a.with(b, a.value % b.value, |_, _| Degree::Curved);
});
number!(['t] Graded<'t>);

impl Neg for Graded<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            ..self
        }
    }
}

impl Signed for Graded<'_> {
    fn abs(&self) -> Self {
        self.curved(f64::abs)
    }
    fn abs_sub(&self, other: &Self) -> Self {
        (*self - *other).curved(|v| v.max(0.0))
    }
    fn signum(&self) -> Self {
        self.curved(f64::signum)
    }
    fn is_positive(&self) -> bool {
        self.value().is_sign_positive()
    }
    fn is_negative(&self) -> bool {
        self.value().is_sign_negative()
    }
}

impl Real for Graded<'_> {
    functions!(curved);

    fn atan2(self, other: Self) -> Self {
        self.with(other, self.value.atan2(other.value), |_, _| Degree::Curved)
    }

    fn value(&self) -> f64 {
        // A branch on what is not known.
        if let Some(lost) = self.lost {
            lost.set(true);
        }
        self.value
    }
    fn powi(self, n: i32) -> Self {
        match n {
            // Where the base is undefined, so is its power.
            0 if self.degree() < Degree::Curved => Self::from(1.0),
            1 => self,
            _ => self.curved(|v| v.powi(n)),
        }
    }
    fn powf(self, p: f64) -> Self {
        match p {
            0.0 if self.degree() < Degree::Curved => Self::from(1.0),
            1.0 => self,
            _ => self.curved(|v| v.powf(p)),
        }
    }
    fn switched(tests: &[Self], pieces: &[Self], natural: impl Fn() -> usize) -> Self {
        let all = tests.iter().chain(pieces);
        let Some(lost) = all.clone().find_map(|v| v.lost) else {
            // A kink among numbers.
            let undefined = all.clone().any(|v| v.value.is_nan());
            let chosen = pieces.get(natural()).filter(|_| !undefined);
            return chosen.copied().unwrap_or(f64::NAN.into());
        };
        if tests.iter().any(|t| t.degree() == Degree::Curved) {
            lost.set(true);
        }
        // Of constants, too, it is no number.
        let degree = pieces.iter().map(|p| p.degree()).max();
        Self {
            degree: degree.map_or(Degree::Curved, |d| d.max(Degree::Affine)),
            value: f64::NAN,
            lost: Some(lost),
        }
    }
}
