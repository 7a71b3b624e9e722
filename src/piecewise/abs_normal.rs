//! The abs-normal form of a piecewise-affine formula (Griewank, "On stable piecewise linearization and generalized algorithmic
//! differentiation", 2013): every kink is an unknown of its own, and all else is affine in the variables and the kinks. It is found by
//! evaluating the formula over such affine forms, in exact arithmetic.

use std::cell::RefCell;
use std::ops::Neg;

use num_traits::Signed;

use super::number::{functions, number, operators};
use super::{ExactForm, Real};
use crate::exact::Exact;

/// Largest number of terms written for a formula.
const MAX_WORK: usize = 1 << 23;

/// An affine form of few unknowns: a constant, and coefficients in the order of the unknowns.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Terms {
    pub(crate) constant: Exact,
    pub(crate) terms: Vec<(usize, Exact)>,
}

impl Terms {
    fn number(value: f64) -> Option<Self> {
        Some(Self {
            constant: Exact::new(value)?,
            terms: Vec::new(),
        })
    }

    fn unknown(index: usize) -> Self {
        Self {
            constant: Exact::default(),
            terms: vec![(index, Exact::one())],
        }
    }

    /// self + factor · other.
    pub(crate) fn plus(&self, factor: &Exact, other: &Self) -> Self {
        let (mut a, mut b) = (self.terms.iter().peekable(), other.terms.iter().peekable());
        let mut terms = Vec::with_capacity(self.terms.len() + other.terms.len());
        loop {
            let first = [a.peek(), b.peek()].into_iter().flatten().map(|t| t.0).min();
            let Some(unknown) = first else {
                break;
            };
            let own = a
                .next_if(|t| t.0 == unknown)
                .map(|t| t.1.clone())
                .unwrap_or_default();
            let sum = match b.next_if(|t| t.0 == unknown) {
                Some((_, v)) => &own + &(factor * v),
                None => own,
            };
            if !sum.is_zero() {
                terms.push((unknown, sum));
            }
        }
        Self {
            constant: &self.constant + &(factor * &other.constant),
            terms,
        }
    }

    /// Whether it is a multiple of another form, 0 among them.
    pub(crate) fn is_multiple_of(&self, other: &Self) -> bool {
        let (Some((unknown, b)), false) = (other.terms.first(), *self == Self::default()) else {
            return *self == Self::default();
        };
        let own = self.terms.iter().find(|t| t.0 == *unknown);
        own.is_some_and(|(_, a)| {
            let none = Self::default();
            none.plus(b, self) == none.plus(a, other)
        })
    }

    /// The form over the given number of unknowns, each in the given place.
    pub(crate) fn form(&self, unknowns: usize, place: impl Fn(usize) -> usize) -> ExactForm {
        let mut form = ExactForm::zero(unknowns);
        form.constant = self.constant.clone();
        for (unknown, value) in &self.terms {
            form.coefficients[place(*unknown)] = value.clone();
        }
        form
    }
}

/// An unknown beside the variables, a function of those before it.
#[derive(Debug, Clone)]
pub(crate) enum Added {
    /// The value of a kink: one of the pieces, as the signs of the tests say.
    Kink { tests: Vec<Terms>, pieces: Vec<Terms> },
    /// The quotient w of a form by a number, by a form that vanishes and in which w has a positive coefficient.
    Quotient(Terms),
}

/// What an evaluation has written.
#[derive(Debug)]
pub(crate) struct Tape {
    written: RefCell<Written>,
}

#[derive(Debug)]
struct Written {
    forms: Vec<Terms>,
    added: Vec<Added>,
    variables: usize,
    work: usize,
    lost: bool,
}

/// A scalar of the evaluation.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Affine<'t> {
    /// A number without rounding.
    Number(f64),
    /// A number with rounding, which has no exact coefficients.
    Rounded(f64),
    /// A form on the tape.
    Form(&'t Tape, usize),
    /// Anything else that is computed from the variables of a tape.
    Other(&'t Tape),
}

/// A formula in abs-normal form.
#[derive(Debug)]
pub(crate) struct AbsNormal {
    /// Values, over the variables and the unknowns appended to them.
    pub(crate) values: Vec<Terms>,
    pub(crate) added: Vec<Added>,
}

/// The abs-normal form of a formula with the given number of values; `None` where it is not piecewise affine, or branches on values. The
/// last variable is fixed where a value is given for it.
pub(crate) fn abs_normal(
    variables: usize,
    fixed: Option<f64>,
    values: usize,
    formula: impl for<'t> FnOnce(&[Affine<'t>], &mut [Affine<'t>]),
) -> Option<AbsNormal> {
    let tape = Tape {
        written: RefCell::new(Written {
            forms: (0..variables).map(Terms::unknown).collect(),
            added: Vec::new(),
            variables,
            work: 0,
            lost: false,
        }),
    };
    let mut x: Vec<Affine<'_>> = (0..variables).map(|k| Affine::Form(&tape, k)).collect();
    if let (Some(last), Some(value)) = (x.last_mut(), fixed) {
        *last = Affine::Number(value);
    }
    let mut out = vec![Affine::Number(0.0); values];
    formula(&x, &mut out);
    let values = out.iter().map(|v| v.terms()).collect::<Option<_>>()?;
    let written = tape.written.into_inner();
    (!written.lost).then_some(AbsNormal {
        values,
        added: written.added,
    })
}

impl Tape {
    /// Writes a form.
    fn write(&self, form: Terms) -> Affine<'_> {
        let mut written = self.written.borrow_mut();
        written.work += 1 + form.terms.len();
        if written.work > MAX_WORK {
            written.lost = true;
            return Affine::Other(self);
        }
        written.forms.push(form);
        Affine::Form(self, written.forms.len() - 1)
    }

    /// Adds an unknown; the form that defines it may contain it.
    fn add(&self, given: impl FnOnce(usize) -> Added) -> Affine<'_> {
        let unknown = {
            let mut written = self.written.borrow_mut();
            let unknown = written.variables + written.added.len();
            written.added.push(given(unknown));
            unknown
        };
        self.write(Terms::unknown(unknown))
    }
}

impl<'t> Affine<'t> {
    fn terms(self) -> Option<Terms> {
        match self {
            Self::Number(value) => Terms::number(value),
            Self::Form(tape, index) => tape.written.borrow().forms.get(index).cloned(),
            Self::Rounded(_) | Self::Other(_) => None,
        }
    }

    fn tape(self) -> Option<&'t Tape> {
        match self {
            Self::Form(tape, _) | Self::Other(tape) => Some(tape),
            Self::Number(_) | Self::Rounded(_) => None,
        }
    }

    /// The value where it depends on no variable, else NaN.
    fn number(self) -> f64 {
        match self {
            Self::Number(value) | Self::Rounded(value) => value,
            Self::Form(..) | Self::Other(_) => f64::NAN,
        }
    }

    /// What has no exact coefficients: computed from variables, or the given number.
    fn inexact(self, other: Self, number: f64) -> Self {
        match self.tape().or(other.tape()) {
            Some(tape) => Self::Other(tape),
            None => Self::Rounded(number),
        }
    }

    /// A number, if it is one without rounding.
    fn exactly(rounded: f64, exact: impl FnOnce() -> Option<bool>) -> Self {
        if exact() == Some(true) {
            Self::Number(rounded)
        } else {
            Self::Rounded(rounded)
        }
    }

    fn plus(self, factor: f64, other: Self) -> Self {
        if let (Self::Number(a), Self::Number(b)) = (self, other) {
            let sum = a + factor * b;
            return Self::exactly(sum, || {
                let exact = &Exact::new(a)? + &(&Exact::new(factor)? * &Exact::new(b)?);
                Some(Exact::new(sum)? == exact)
            });
        }
        let form = || {
            let tape = self.tape().or(other.tape())?;
            let sum = self.terms()?.plus(&Exact::new(factor)?, &other.terms()?);
            Some(tape.write(sum))
        };
        form().unwrap_or_else(|| self.inexact(other, self.number() + factor * other.number()))
    }

    fn times(self, other: Self) -> Self {
        if let (Self::Number(a), Self::Number(b)) = (self, other) {
            let product = a * b;
            return Self::exactly(product, || {
                Some(Exact::new(product)? == &Exact::new(a)? * &Exact::new(b)?)
            });
        }
        let form = || {
            let tape = self.tape().or(other.tape())?;
            let (a, b) = (self.terms()?, other.terms()?);
            let (form, factor) = if b.terms.is_empty() { (a, b) } else { (b, a) };
            let scaled = Terms::default().plus(&factor.constant, &form);
            factor.terms.is_empty().then(|| tape.write(scaled))
        };
        form().unwrap_or_else(|| self.inexact(other, self.number() * other.number()))
    }

    fn over(self, other: Self) -> Self {
        if let (Self::Number(a), Self::Number(b)) = (self, other) {
            let quotient = a / b;
            return Self::exactly(quotient, || {
                Some(&Exact::new(quotient)? * &Exact::new(b)? == Exact::new(a)?)
            });
        }
        let form = || {
            let tape = self.tape().or(other.tape())?;
            let (a, b) = (self.terms()?, other.terms()?);
            if !b.terms.is_empty() || b.constant.is_zero() {
                return None;
            }
            // |b| w ∓ a = 0.
            let minus = if b.constant.sign() < 0 {
                Exact::one()
            } else {
                -&Exact::one()
            };
            let quotient = |w: usize| {
                let own = Terms::default().plus(&b.constant.abs(), &Terms::unknown(w));
                Added::Quotient(own.plus(&minus, &a))
            };
            Some(tape.add(quotient))
        };
        form().unwrap_or_else(|| self.inexact(other, self.number() / other.number()))
    }

    /// A function that is not affine.
    fn curved(self, function: impl FnOnce(f64) -> f64) -> Self {
        self.inexact(self, function(self.number()))
    }
}

impl PartialEq for Affine<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

impl From<f64> for Affine<'_> {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

operators!(['t] Affine<'t> {
    Add add |a, b| a.plus(1.0, b);
    Sub sub |a, b| a.plus(-1.0, b);
    Mul mul |a, b| a.times(b);
    Div div |a, b| a.over(b);
    Rem rem |a, b| a.inexact(b, a.number() % b.number());
});
number!(['t] Affine<'t>);

impl Neg for Affine<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Signed for Affine<'_> {
    fn abs(&self) -> Self {
        match self {
            Self::Number(value) => Self::Number(value.abs()),
            _ => self.curved(f64::abs),
        }
    }
    fn abs_sub(&self, other: &Self) -> Self {
        let difference = *self - *other;
        if matches!(difference, Self::Number(d) if d > 0.0) {
            return difference;
        }
        difference.curved(|d| d.max(0.0))
    }
    fn signum(&self) -> Self {
        match self {
            Self::Number(value) => Self::Number(value.signum()),
            _ => self.curved(f64::signum),
        }
    }
    fn is_positive(&self) -> bool {
        self.value().is_sign_positive()
    }
    fn is_negative(&self) -> bool {
        self.value().is_sign_negative()
    }
}

impl Real for Affine<'_> {
    functions!(curved);

    fn atan2(self, other: Self) -> Self {
        self.inexact(other, self.number().atan2(other.number()))
    }

    fn value(&self) -> f64 {
        // A branch on what is not known: the evaluation holds on one side of it only.
        if let Some(tape) = self.tape() {
            tape.written.borrow_mut().lost = true;
        }
        self.number()
    }
    fn powi(self, n: i32) -> Self {
        match n {
            // Where the base is undefined, so is its power.
            0 if matches!(self, Self::Form(..)) || !self.number().is_nan() => Self::Number(1.0),
            1 => self,
            2 => self * self,
            _ => self.curved(|v| v.powi(n)),
        }
    }
    fn powf(self, p: f64) -> Self {
        if p == 1.0 {
            self
        } else {
            self.curved(|v| v.powf(p))
        }
    }
    fn switched(tests: &[Self], pieces: &[Self], natural: impl Fn() -> usize) -> Self {
        let all = |list: &[Self]| list.iter().map(|v| v.terms()).collect::<Option<Vec<Terms>>>();
        let Some(tape) = tests.iter().chain(pieces).find_map(|v| v.tape()) else {
            // A kink among numbers.
            return pieces.get(natural()).copied().unwrap_or(Self::Rounded(f64::NAN));
        };
        match (all(tests), all(pieces)) {
            (Some(tests), Some(pieces)) => tape.add(|_| Added::Kink { tests, pieces }),
            _ => Self::Other(tape),
        }
    }
}
