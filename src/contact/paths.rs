use std::fmt;
use std::sync::Arc;

use super::ContactError;
use super::error::check_length;
use crate::interface::largest;

type PathFunction = Arc<dyn Fn(f64, &mut [f64], &mut [f64]) + Send + Sync>;

/// A vector that depends on the parameter: α ↦ v(α).
#[derive(Clone)]
pub(super) enum Path {
    Affine { constant: Vec<f64>, slope: Vec<f64> },
    Function(PathFunction),
}

impl Path {
    pub(super) fn value(&self, alpha: f64, out: &mut [f64], scratch: &mut [f64]) {
        match self {
            Self::Affine { constant, slope } => {
                for (o, (c, s)) in out.iter_mut().zip(constant.iter().zip(slope)) {
                    *o = c + alpha * s;
                }
            }
            Self::Function(f) => f(alpha, out, scratch),
        }
    }

    /// Sizes of the value at α = 0 and of the change to α = 1, of n entries.
    pub(super) fn sizes(&self, n: usize) -> [f64; 2] {
        match self {
            Self::Affine { constant, slope } => [constant, slope].map(|v| largest(&mut v.iter().copied())),
            Self::Function(f) => {
                let (mut first, mut last, mut rate) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
                f(0.0, &mut first, &mut rate);
                f(1.0, &mut last, &mut rate);
                let mut change = last.iter().zip(&first).map(|(b, a)| b - a);
                [largest(&mut first.iter().copied()), largest(&mut change)]
            }
        }
    }

    pub(super) fn is_affine(&self) -> bool {
        matches!(self, Self::Affine { .. })
    }

    pub(super) fn is_constant(&self) -> bool {
        matches!(self, Self::Affine { slope, .. } if slope.iter().all(|s| *s == 0.0))
    }

    pub(super) fn check(&self, what: &'static str, expected: usize) -> Result<(), ContactError> {
        match self {
            Self::Affine { constant, slope } => {
                check_length(what, constant, expected)?;
                check_length(what, slope, expected)
            }
            Self::Function(_) => Ok(()),
        }
    }
}

impl fmt::Debug for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Affine { constant, slope } => f
                .debug_struct("Affine")
                .field("constant", constant)
                .field("slope", slope)
                .finish(),
            Self::Function(_) => f.write_str("Function"),
        }
    }
}

macro_rules! path_type {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone)]
        pub struct $name(pub(super) Path);

        impl $name {
            /// The same vector at every α.
            #[must_use]
            pub fn constant(value: Vec<f64>) -> Self {
                let slope = vec![0.0; value.len()];
                Self(Path::Affine { constant: value, slope })
            }

            /// `constant` + α `slope`.
            #[must_use]
            pub fn affine(constant: Vec<f64>, slope: Vec<f64>) -> Self {
                Self(Path::Affine { constant, slope })
            }

            /// The straight path from `start` at α = 0 to `end` at α = 1.
            #[must_use]
            pub fn between(start: Vec<f64>, end: &[f64]) -> Self {
                let slope = start.iter().zip(end).map(|(s, e)| e - s).collect();
                Self(Path::Affine { constant: start, slope })
            }

            /// Any smooth path: `function(α, value, derivative)` fills both vectors.
            #[must_use]
            pub fn function(
                function: impl Fn(f64, &mut [f64], &mut [f64]) + Send + Sync + 'static,
            ) -> Self {
                Self(Path::Function(Arc::new(function)))
            }
        }
    };
}

path_type! {
    /// The load f(α): nodal forces, one entry a displacement.
    LoadPath
}
path_type! {
    /// The coefficients of friction F(α), one entry a contact node.
    FrictionPath
}
