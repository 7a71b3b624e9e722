//! Formulas of variables, as trees.

use semismooth::piecewise::{Kinks, Real};

/// Functions without kinks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Smooth {
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Atan,
    Sinh,
    Cosh,
    Tanh,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Expression {
    Variable(usize),
    Number(f64),
    Negative(Box<Expression>),
    Two(Operator, Box<Expression>, Box<Expression>),
    /// A power with an integer or another constant exponent.
    Whole(Box<Expression>, i32),
    Power(Box<Expression>, f64),
    Of(Smooth, Box<Expression>),
    Max(Box<Expression>, Box<Expression>),
    Min(Box<Expression>, Box<Expression>),
    Abs(Box<Expression>),
}

impl Expression {
    pub(crate) fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>) -> T {
        match self {
            Self::Variable(k) => x[*k],
            Self::Number(v) => T::from(*v),
            Self::Negative(a) => -a.eval(x, kinks),
            Self::Two(operator, a, b) => {
                let (a, b) = (a.eval(x, kinks), b.eval(x, kinks));
                match operator {
                    Operator::Plus => a + b,
                    Operator::Minus => a - b,
                    Operator::Times => a * b,
                    Operator::Over => a / b,
                }
            }
            Self::Whole(a, n) => a.eval(x, kinks).powi(*n),
            Self::Power(a, p) => a.eval(x, kinks).powf(*p),
            Self::Of(function, a) => {
                let a = a.eval(x, kinks);
                match function {
                    Smooth::Sqrt => a.sqrt(),
                    Smooth::Exp => a.exp(),
                    Smooth::Ln => a.ln(),
                    Smooth::Sin => a.sin(),
                    Smooth::Cos => a.cos(),
                    Smooth::Tan => a.tan(),
                    Smooth::Atan => a.atan(),
                    Smooth::Sinh => a.sinh(),
                    Smooth::Cosh => a.cosh(),
                    Smooth::Tanh => a.tanh(),
                }
            }
            Self::Max(a, b) => {
                let (a, b) = (a.eval(x, kinks), b.eval(x, kinks));
                kinks.max(a, b)
            }
            Self::Min(a, b) => {
                let (a, b) = (a.eval(x, kinks), b.eval(x, kinks));
                kinks.min(a, b)
            }
            Self::Abs(a) => {
                let a = a.eval(x, kinks);
                kinks.abs(a)
            }
        }
    }
}
