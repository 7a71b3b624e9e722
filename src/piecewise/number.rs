//! What the numbers have in common with which formulas are evaluated for their structure, forms, series and enclosures.

/// Implements the operators of a number from a function for each, with another number and, through `From`, with an `f64`.
macro_rules! operators {
    (@one [$($generics:tt)*] $type:ty, $trait:ident $method:ident $apply:expr) => {
        impl<$($generics)*> std::ops::$trait for $type {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                let apply: fn(Self, Self) -> Self = $apply;
                apply(self, other)
            }
        }
        impl<$($generics)*> std::ops::$trait<f64> for $type {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                std::ops::$trait::$method(self, Self::from(other))
            }
        }
    };
    ($generics:tt $type:ty { $($trait:ident $method:ident $apply:expr;)* }) => {$(
        $crate::piecewise::number::operators!(@one $generics $type, $trait $method $apply);
    )*};
}
pub(crate) use operators;

/// Implements for a number with operators, `PartialEq` and `From<f64>` what follows from these: operators in place, 0, 1, reading.
macro_rules! number {
    (@assign [$($generics:tt)*] $type:ty, $trait:ident $method:ident $assign:ident $assign_method:ident) => {
        impl<$($generics)*> std::ops::$assign for $type {
            fn $assign_method(&mut self, other: Self) {
                *self = std::ops::$trait::$method(*self, other);
            }
        }
        impl<$($generics)*> std::ops::$assign<f64> for $type {
            fn $assign_method(&mut self, other: f64) {
                *self = std::ops::$trait::$method(*self, other);
            }
        }
    };
    (@constants [$($generics:tt)*] $type:ty) => {
        impl<$($generics)*> num_traits::Zero for $type {
            fn zero() -> Self {
                Self::from(0.0)
            }
            fn is_zero(&self) -> bool {
                *self == Self::from(0.0)
            }
        }
        impl<$($generics)*> num_traits::One for $type {
            fn one() -> Self {
                Self::from(1.0)
            }
        }
        impl<$($generics)*> num_traits::Num for $type {
            type FromStrRadixErr = <f64 as num_traits::Num>::FromStrRadixErr;
            fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
                <f64 as num_traits::Num>::from_str_radix(text, radix).map(Self::from)
            }
        }
    };
    ($generics:tt $type:ty) => {
        $crate::piecewise::number::number!(@assign $generics $type, Add add AddAssign add_assign);
        $crate::piecewise::number::number!(@assign $generics $type, Sub sub SubAssign sub_assign);
        $crate::piecewise::number::number!(@assign $generics $type, Mul mul MulAssign mul_assign);
        $crate::piecewise::number::number!(@assign $generics $type, Div div DivAssign div_assign);
        $crate::piecewise::number::number!(@assign $generics $type, Rem rem RemAssign rem_assign);
        $crate::piecewise::number::number!(@constants $generics $type);
    };
}
pub(crate) use number;

/// The functions of one argument of [`Real`](super::Real), each by a method of the number that takes the function of `f64`.
macro_rules! functions {
    ($method:ident) => {
        $crate::piecewise::number::functions!(
            $method: sqrt exp ln sin cos tan atan sinh cosh tanh asin acos ln_1p exp_m1 cbrt
        );
    };
    ($method:ident: $($function:ident)*) => {$(
        fn $function(self) -> Self {
            self.$method(f64::$function)
        }
    )*};
}
pub(crate) use functions;
