use std::iter::Sum;
use std::marker::PhantomData;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use super::node::{Binary, Node, Page, Smooth};

/// A variable of a [`Formula`](super::Formula) that is being recorded, what was computed from variables, or a number.
///
/// It has no value: kinks are its methods, and `if` cannot be asked. The lifetime ties it to its formula.
#[derive(Debug, Clone, Copy)]
pub struct Expression<'a> {
    inner: Inner<'a>,
    /// Keeps expressions of a formula that is recorded within another apart from those of the outer one.
    own: PhantomData<fn(&'a ()) -> &'a ()>,
}

#[derive(Debug, Clone, Copy)]
enum Inner<'a> {
    Number(f64),
    Node(&'a Page, usize),
}

impl<'a> Expression<'a> {
    pub(super) fn recorded(page: &'a Page, node: Node) -> Self {
        Self::of(Inner::Node(page, page.add(node)))
    }

    const fn of(inner: Inner<'a>) -> Self {
        Self {
            inner,
            own: PhantomData,
        }
    }

    /// The position on a page.
    pub(super) fn on(self, page: &Page) -> usize {
        match self.inner {
            Inner::Number(value) => page.number(value),
            Inner::Node(_, at) => at,
        }
    }

    /// An operation on expressions: on a page if one of them is, or among numbers alone.
    fn combine<const N: usize>(
        parts: [Self; N],
        node: impl FnOnce([usize; N]) -> Node,
        numbers: impl FnOnce([f64; N]) -> f64,
    ) -> Self {
        let page = parts.iter().find_map(|p| match p.inner {
            Inner::Node(page, _) => Some(page),
            Inner::Number(_) => None,
        });
        match page {
            Some(page) => Self::recorded(page, node(parts.map(|p| p.on(page)))),
            None => Self::of(Inner::Number(numbers(parts.map(|p| match p.inner {
                Inner::Number(value) => value,
                Inner::Node(..) => f64::NAN,
            })))),
        }
    }

    fn two(self, operator: Binary, other: Self) -> Self {
        Self::combine(
            [self, other],
            |a| Node::Two(operator, a),
            |[a, b]| operator.of(a, b),
        )
    }

    fn smooth(self, function: Smooth, numbers: fn(f64) -> f64) -> Self {
        Self::combine([self], |a| Node::Of(function, a), |[a]| numbers(a))
    }

    /// max(self, other): a kink with the pieces self and other.
    #[must_use]
    pub fn max(self, other: impl Into<Self>) -> Self {
        Self::combine([self, other.into()], Node::Max, |[a, b]| larger(a, b))
    }

    /// min(self, other): a kink with the pieces self and other.
    #[must_use]
    pub fn min(self, other: impl Into<Self>) -> Self {
        Self::combine([self, other.into()], Node::Min, |[a, b]| -larger(-a, -b))
    }

    /// max(self, 0).
    #[must_use]
    pub fn positive_part(self) -> Self {
        self.max(0.0)
    }

    /// |self|: a kink.
    #[must_use]
    pub fn abs(self) -> Self {
        Self::combine([self], Node::Abs, |[a]| a.abs())
    }

    /// The projection on [lower, upper], as [`Kinks::project`](crate::piecewise::Kinks::project): lower ≤ upper must hold at every point.
    #[must_use]
    pub fn project(self, lower: impl Into<Self>, upper: impl Into<Self>) -> Self {
        let parts = [lower.into(), self, upper.into()];
        Self::combine(parts, Node::Project, |[l, z, u]| -larger(-larger(l, z), -u))
    }

    /// `first` where self ≥ 0 and `second` elsewhere, as [`Kinks::switch`](crate::piecewise::Kinks::switch): the two must agree where self
    /// vanishes.
    #[must_use]
    pub fn switch(self, first: impl Into<Self>, second: impl Into<Self>) -> Self {
        let parts = [self, first.into(), second.into()];
        Self::combine(parts, Node::Switch, |[test, a, b]| match test >= 0.0 {
            true => a,
            false => b,
        })
    }

    /// selfⁿ
    #[must_use]
    pub fn powi(self, n: i32) -> Self {
        Self::combine([self], |a| Node::Integer(a, n), |[a]| a.powi(n))
    }

    /// self^p
    #[must_use]
    pub fn powf(self, p: f64) -> Self {
        Self::combine([self], |a| Node::Power(a, p.to_bits()), |[a]| a.powf(p))
    }
}

/// The larger of two numbers, NaN if one of them is.
fn larger(a: f64, b: f64) -> f64 {
    match a.is_nan() || a >= b {
        true => a,
        false => b,
    }
}

macro_rules! functions {
    ($($name:ident $function:ident $text:literal),*) => {
        impl Expression<'_> {
            $(
                #[doc = $text]
                #[must_use]
                pub fn $name(self) -> Self {
                    self.smooth(Smooth::$function, f64::$name)
                }
            )*
        }
    };
}
functions!(
    sqrt Sqrt "√self", exp Exp "e^self", ln Ln "The natural logarithm.", sin Sin "sin self", cos Cos "cos self", tan Tan "tan self",
    atan Atan "arctan self, in (−π/2, π/2)", sinh Sinh "sinh self", cosh Cosh "cosh self", tanh Tanh "tanh self"
);

impl From<f64> for Expression<'_> {
    fn from(value: f64) -> Self {
        Self::of(Inner::Number(value))
    }
}

impl Neg for Expression<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::combine([self], Node::Neg, |[a]| -a)
    }
}

macro_rules! expression_operators {
    ($($operator:ident $method:ident $assign:ident $assigned:ident),*) => {
        $(
            impl<'a> $operator for Expression<'a> {
                type Output = Self;
                fn $method(self, other: Self) -> Self {
                    self.two(Binary::$operator, other)
                }
            }
            impl<'a> $operator<f64> for Expression<'a> {
                type Output = Self;
                fn $method(self, other: f64) -> Self {
                    self.two(Binary::$operator, other.into())
                }
            }
            impl<'a> $operator<Expression<'a>> for f64 {
                type Output = Expression<'a>;
                fn $method(self, other: Expression<'a>) -> Expression<'a> {
                    Expression::from(self).two(Binary::$operator, other)
                }
            }
            impl<'a, T: Into<Expression<'a>>> $assign<T> for Expression<'a> {
                fn $assigned(&mut self, other: T) {
                    *self = self.two(Binary::$operator, other.into());
                }
            }
        )*
    };
}
expression_operators!(Add add AddAssign add_assign, Sub sub SubAssign sub_assign, Mul mul MulAssign mul_assign, Div div DivAssign div_assign);

impl<'a> Sum for Expression<'a> {
    fn sum<I: Iterator<Item = Self>>(items: I) -> Self {
        items.reduce(|a, b| a + b).unwrap_or_else(|| 0.0.into())
    }
}
