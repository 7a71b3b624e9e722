//! Functions of the user that may fail: their first error comes back unchanged.
//!
//! Maps, functions, laws and operators do not return a `Result`: inner loops compute with numbers only. Where an evaluation can fail (a
//! simulator that crashes, a file, a table that ends), [`FirstError`] carries the error past the solver: the function returns NaN and is
//! not called again, so that the solver ends soon, as for any map that is not finite, and [`FirstError::run`] returns the error in place of
//! the solver's result. It works with all traits of the crate and with all that evaluate them: Newton's method, complementarity solvers,
//! curves, diagrams, enumeration, contact problems and their histories, sweeps.
//!
//! | what evaluates | how it fails |
//! |---|---|
//! | residuals, test functions, products of operators, `eval` of formulas | [`values`](FirstError::values) |
//! | Jacobians, Hessians | [`matrix`](FirstError::matrix) |
//! | a number, or a few: coefficients of friction, monitors | `attempt(…).unwrap_or(f64::NAN)`, [`attempt`](FirstError::attempt) |
//! | functions that return a `Result`: [`MatrixFree::linearize`](crate::piecewise::MatrixFree::linearize), preconditioners | `attempt(…).ok_or(…)` with an error of the crate |
//!
//! A point outside the domain of a function is not an error in this sense: return NaN there, and the step is shortened.
//!
//! ```
//! use semismooth::complementarity::{Mcp, McpFunction, McpSolver};
//! use semismooth::fallible::FirstError;
//! use semismooth::sparse::Matrix;
//!
//! #[derive(Debug, PartialEq)]
//! struct Crashed { at: f64 }
//!
//! /// F(x) = x − 3 by a program that crashes beyond x = 2.
//! struct Simulator<'e>(&'e FirstError<Crashed>);
//!
//! impl Simulator<'_> {
//!     fn simulate(&self, x: f64) -> Result<f64, Crashed> {
//!         if x > 2.0 { Err(Crashed { at: x }) } else { Ok(x - 3.0) }
//!     }
//! }
//!
//! impl McpFunction for Simulator<'_> {
//!     fn num_vars(&self) -> usize { 1 }
//!     fn value(&self, x: &[f64], out: &mut [f64]) {
//!         self.0.values(out, |out| Ok(out[0] = self.simulate(x[0])?));
//!     }
//!     fn jacobian(&self, _: &[f64], jac: &mut Matrix) { jac.add(0, 0, 1.0); }
//! }
//!
//! let errors = FirstError::new();
//! let problem = Mcp::ncp(Simulator(&errors))?;
//! let mut x = [1.0];
//! let failed = errors.run(|| McpSolver::default().solve(&problem, &mut x).map(|r| r.status)).unwrap_err();
//! assert_eq!(failed.error, Crashed { at: 3.0 });
//! assert!(x[0] <= 2.0); // the best iterate before
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::error::Error;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::sparse::Matrix;

/// Keeps the first error of a function during a [run](Self::run), after which the function is not called any more.
///
/// It is shared by the function, which evaluates through it, and by the caller of the solver. For a [sweep](crate::sweep) make one in each
/// call: an error ends the run whose function failed, and no other. If several threads evaluate one function and fail at the same time, any
/// of their errors may be the one kept.
///
/// The [module](self) has an example.
#[derive(Debug)]
pub struct FirstError<E> {
    first: Mutex<Option<E>>,
}

impl<E> Default for FirstError<E> {
    fn default() -> Self {
        Self::new()
    }
}

impl<E> FirstError<E> {
    /// No error yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            first: Mutex::new(None),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Option<E>> {
        self.first.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether an error has occurred.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.lock().is_some()
    }

    /// [`Break`](ControlFlow::Break) once there is an error: the return value of an observer, which stops its solver after the current
    /// iteration.
    pub fn flow(&self) -> ControlFlow<()> {
        match self.is_set() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// The value of `f`; `None` if it fails (its error is kept) or if an error has occurred before (`f` is not called).
    pub fn attempt<T>(&self, f: impl FnOnce() -> Result<T, E>) -> Option<T> {
        if self.is_set() {
            return None;
        }
        match f() {
            Ok(value) => Some(value),
            Err(error) => {
                self.lock().get_or_insert(error);
                None
            }
        }
    }

    /// [`attempt`](Self::attempt) for a vector, NaN where there is an error: the residual of a map, the product of an operator, or a
    /// formula over numbers that carry derivatives (`T: Real` of `Traced` and `Autodiff`).
    pub fn values<T: Copy + From<f64>>(&self, out: &mut [T], f: impl FnOnce(&mut [T]) -> Result<(), E>) {
        if self.attempt(|| f(out)).is_none() {
            out.fill(f64::NAN.into());
        }
    }

    /// [`attempt`](Self::attempt) for a matrix, all stored entries NaN where there is an error: the Jacobian of a map.
    pub fn matrix(&self, jac: &mut Matrix, f: impl FnOnce(&mut Matrix) -> Result<(), E>) {
        if self.attempt(|| f(jac)).is_none() {
            jac.values_mut().fill(f64::NAN);
        }
    }

    /// The result of `solve`, if no function failed in it. An error of an earlier run is discarded.
    ///
    /// # Errors
    /// [`Failed`] with the first error of the function and the result of `solve`.
    pub fn run<R>(&self, solve: impl FnOnce() -> R) -> Result<R, Failed<E, R>> {
        *self.lock() = None;
        let result = solve();
        match self.lock().take() {
            None => Ok(result),
            Some(error) => Err(Failed { error, result }),
        }
    }
}

/// A function failed while a solver ran. Its error is the [source](Error::source).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Failed<E, R> {
    /// The first error of the function, unchanged.
    pub error: E,
    /// The result of the solver: usually its own error, with the best iterate so far; a curve as far as it was followed. It may be a
    /// success if nothing depended on the failed evaluation.
    pub result: R,
}

impl<E: fmt::Display, R> fmt::Display for Failed<E, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the function failed: {}", self.error)
    }
}

impl<E: Error + 'static, R: fmt::Debug> Error for Failed<E, R> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        Some(&self.error)
    }
}
