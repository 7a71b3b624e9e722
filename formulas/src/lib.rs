//! Equations as people type them: sums, products, powers, smooth functions, and `max`, `min`, `abs` for kinks. The page in the browser and
//! the program on the command line use the same parser.
//!
//! ```
//! use semismooth::piecewise::{PiecewiseSmooth, Traced, value};
//! use semismooth_formulas::Formulas;
//! let beam = Formulas::read(&["y - 1.25*max(y - 1, 0) = load"], &["y", "load"])?;
//! let map = Traced::new(beam);
//! assert_eq!((map.site_name(0), map.piece_name(0, 1)), ("y − 1 | 0".into(), "0".into()));
//! let mut out = [0.0];
//! value(&map, &[3.0, 0.5], &mut out);
//! assert_eq!(out, [0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod expression;
mod parser;

use std::borrow::Cow;

use semismooth::piecewise::{Kinks, NonsmoothFunction, Real};

use parser::{Equation, read};
pub use parser::{Mistake, Site};

/// A mistake in one of several equations.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{mistake}")]
pub struct WrongEquation {
    /// Number of the equation, from 0.
    pub equation: usize,
    /// What is wrong, and where.
    #[source]
    pub mistake: Mistake,
}

/// Equations in variables, of which the last may be a parameter: each is `formula`, meaning formula = 0, or `left = right`.
#[derive(Debug, Clone, PartialEq)]
pub struct Formulas {
    variables: usize,
    equations: Vec<Equation>,
}

impl Formulas {
    /// Reads equations in the variables of these names.
    ///
    /// # Errors
    /// The first equation that cannot be read.
    pub fn read<S: AsRef<str>>(texts: &[S], variables: &[&str]) -> Result<Self, WrongEquation> {
        let numbered: Vec<(&str, usize)> = variables.iter().copied().zip(0..).collect();
        let one = |(equation, text): (usize, &S)| {
            read(text.as_ref(), &numbered).map_err(|mistake| WrongEquation { equation, mistake })
        };
        Ok(Self {
            variables: variables.len(),
            equations: texts.iter().enumerate().map(one).collect::<Result<_, _>>()?,
        })
    }

    /// The places where the equations switch, in the order of the sites of the map.
    pub fn sites(&self) -> impl Iterator<Item = &Site> {
        self.equations.iter().flat_map(|e| &e.sites)
    }
}

impl NonsmoothFunction for Formulas {
    fn num_vars(&self) -> usize {
        self.variables
    }

    fn num_residuals(&self) -> usize {
        self.equations.len()
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        for (out, equation) in out.iter_mut().zip(&self.equations) {
            *out = equation.expression.eval(x, kinks);
        }
    }

    fn site_name(&self, site: usize) -> Option<Cow<'_, str>> {
        let site = self.sites().nth(site)?;
        Some(Cow::Owned(site.pieces.join(" | ")))
    }

    fn piece_name(&self, site: usize, piece: usize) -> Option<Cow<'_, str>> {
        let site = self.sites().nth(site)?;
        site.pieces.get(piece).map(|name| Cow::Borrowed(name.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semismooth::piecewise::{Traced, value};

    #[test]
    fn what_is_undefined_stays_so() {
        let texts = [
            "max(x + 2, ln(x))",
            "max(ln(x), 5)",
            "min(ln(x), x)",
            "min(-9, ln(x))",
            "abs(ln(x))",
            "ln(x)^0",
        ];
        let map = Traced::new(Formulas::read(&texts, &["x"]).unwrap());
        let mut out = [0.0; 6];
        value(&map, &[-2.0], &mut out);
        assert!(out.iter().all(|v| v.is_nan()), "{out:?}");
        value(&map, &[1.0], &mut out);
        assert_eq!(out, [3.0, 5.0, 0.0, -9.0, 0.0, 1.0]);
    }
}
