use super::AffineFunction;
use crate::sparse::{Matrix, Pattern};

/// The function F: ℝᵐ → ℝⁿ of a complementarity problem, with its Jacobian.
///
/// m = n, or m = n + 1 where the last variable is a parameter.
///
/// # Contract
/// * Both methods are pure. `out` arrives with length n and arbitrary content; the Jacobian arrives zeroed, over a pattern that
///   holds at least [`pattern`](Self::pattern) and the diagonal.
/// * Outside its domain F writes NaN or an infinity to the components it cannot evaluate. A solver then shortens its step, and reports the
///   component if that does not help. Solvers evaluate F inside the bounds only, unless asked otherwise.
pub trait McpFunction {
    /// Number m of variables.
    fn num_vars(&self) -> usize;

    /// Number n of values: m, or m − 1 for a function with a parameter. Default: m.
    fn num_values(&self) -> usize {
        self.num_vars()
    }

    /// Writes F(x) to `out`.
    fn value(&self, x: &[f64], out: &mut [f64]);

    /// Adds ∇F(x) (n × m) to a zeroed matrix.
    fn jacobian(&self, x: &[f64], jac: &mut Matrix);

    /// Where ∇F has entries (n × m). Default: everywhere, which takes 16 n m bytes for a Jacobian and a dense factorisation: override
    /// it above some thousand variables.
    fn pattern(&self) -> Pattern {
        Pattern::full(self.num_values(), self.num_vars())
    }

    /// Whether F is affine, so that curves of solutions are polygons.
    fn is_affine(&self) -> bool {
        false
    }

    /// M and q of F(x) = M x + q as stored, with the value of a fixed parameter, the last variable of F. Default: `None`.
    fn coefficients(&self) -> Option<(&AffineFunction, Option<f64>)> {
        None
    }
}

macro_rules! forward {
    () => {
        fn num_vars(&self) -> usize {
            (**self).num_vars()
        }
        fn num_values(&self) -> usize {
            (**self).num_values()
        }
        fn value(&self, x: &[f64], out: &mut [f64]) {
            (**self).value(x, out);
        }
        fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
            (**self).jacobian(x, jac);
        }
        fn pattern(&self) -> Pattern {
            (**self).pattern()
        }
        fn is_affine(&self) -> bool {
            (**self).is_affine()
        }
        fn coefficients(&self) -> Option<(&AffineFunction, Option<f64>)> {
            (**self).coefficients()
        }
    };
}

impl<F: McpFunction + ?Sized> McpFunction for &F {
    forward!();
}

impl<F: McpFunction + ?Sized> McpFunction for Box<F> {
    forward!();
}

/// A function given by two closures: its value and its Jacobian.
///
/// ```
/// use semismooth::complementarity::{McpFunction, WithJacobian};
/// use semismooth::sparse::Matrix;
/// let f = WithJacobian::new(
///     1,
///     |x: &[f64], out: &mut [f64]| out[0] = x[0].ln(),
///     |x: &[f64], jac: &mut Matrix| jac.add(0, 0, 1.0 / x[0]),
/// );
/// let mut out = [0.0];
/// f.value(&[-1.0], &mut out);
/// assert!(out[0].is_nan()); // outside the domain
/// ```
#[derive(Debug, Clone)]
pub struct WithJacobian<V, J> {
    values: usize,
    vars: usize,
    pattern: Option<Pattern>,
    value: V,
    jacobian: J,
}

impl<V: Fn(&[f64], &mut [f64]), J: Fn(&[f64], &mut Matrix)> WithJacobian<V, J> {
    /// A function of `n` variables with `n` values and a full Jacobian. `value(x, out)` overwrites `out`, `jacobian(x, jac)` adds
    /// to a zeroed matrix.
    pub fn new(n: usize, value: V, jacobian: J) -> Self {
        Self {
            values: n,
            vars: n,
            pattern: None,
            value,
            jacobian,
        }
    }

    /// A function of `n` variables and a parameter, which comes last.
    pub fn parametric(n: usize, value: V, jacobian: J) -> Self {
        Self {
            values: n,
            vars: n + 1,
            pattern: None,
            value,
            jacobian,
        }
    }

    /// Says where the Jacobian has entries. The pattern also settles the numbers of values and variables.
    #[must_use]
    pub fn with_pattern(mut self, pattern: Pattern) -> Self {
        self.values = pattern.nrows();
        self.vars = pattern.ncols();
        self.pattern = Some(pattern);
        self
    }
}

impl<V: Fn(&[f64], &mut [f64]), J: Fn(&[f64], &mut Matrix)> McpFunction for WithJacobian<V, J> {
    fn num_vars(&self) -> usize {
        self.vars
    }

    fn num_values(&self) -> usize {
        self.values
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        (self.value)(x, out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        (self.jacobian)(x, jac);
    }

    fn pattern(&self) -> Pattern {
        match &self.pattern {
            Some(pattern) => pattern.clone(),
            None => Pattern::full(self.values, self.vars),
        }
    }
}
