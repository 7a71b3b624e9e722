//! Functions of position, as numbers or as Python functions.

use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::vector;
use crate::errors::raised;

/// The first exception of functions that the library calls; after it they return NaN, which the library refuses.
#[derive(Clone, Default)]
pub(crate) struct Failures(Arc<Mutex<Option<PyErr>>>);

impl Failures {
    /// The exception if there was one, else the result of the library.
    pub(crate) fn settle<T>(&self, result: Result<T, impl Error>) -> PyResult<T> {
        match self.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(exception) => Err(exception),
            None => result.map_err(raised),
        }
    }

    fn call<T>(&self, otherwise: T, work: impl FnOnce(Python<'_>) -> PyResult<T>) -> T {
        let failed = |e| *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(e);
        let before = self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some();
        match before {
            true => otherwise,
            false => Python::attach(|py| work(py).map_err(failed).unwrap_or(otherwise)),
        }
    }
}

/// A number, or a function of a point of shape (d,).
pub(crate) enum Scalar {
    Constant(f64),
    Called(Py<PyAny>),
}

impl Scalar {
    pub(crate) fn of(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Self> {
        if object.is_callable() {
            return Ok(Self::Called(object.clone().unbind()));
        }
        let number = object.extract();
        let message = || PyTypeError::new_err(format!("{what} must be a number or a function of a point"));
        Ok(Self::Constant(number.map_err(|_| message())?))
    }

    pub(crate) fn function(
        &self,
        py: Python<'_>,
        dim: usize,
        failures: &Failures,
    ) -> impl Fn([f64; 3]) -> f64 + Send + Sync + 'static {
        let (own, failures) = (self.clone_ref(py), failures.clone());
        move |x| match &own {
            Self::Constant(value) => *value,
            Self::Called(function) => failures.call(f64::NAN, |py| {
                let value = function.bind(py).call1((PyArray1::from_slice(py, &x[..dim]),))?;
                value.extract()
            }),
        }
    }

    pub(crate) fn clone_ref(&self, py: Python<'_>) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(*value),
            Self::Called(function) => Self::Called(function.clone_ref(py)),
        }
    }
}

/// A vector of shape (d,), or a function of a point that gives one.
pub(crate) enum Direction {
    Constant(Vec<f64>),
    Called(Py<PyAny>),
}

impl Direction {
    pub(crate) fn of(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Self> {
        match object.is_callable() {
            true => Ok(Self::Called(object.clone().unbind())),
            false => Ok(Self::Constant(vector(object, what)?)),
        }
    }

    pub(crate) fn function(
        &self,
        py: Python<'_>,
        dim: usize,
        what: &'static str,
        failures: &Failures,
    ) -> PyResult<impl Fn([f64; 3]) -> [f64; 3] + Send + Sync + 'static> {
        let own = match self {
            Self::Constant(value) => Err(in_space(value, dim, what)?),
            Self::Called(function) => Ok(function.clone_ref(py)),
        };
        let failures = failures.clone();
        Ok(move |x: [f64; 3]| match &own {
            Err(value) => *value,
            Ok(function) => failures.call([f64::NAN; 3], |py| {
                let value = function.bind(py).call1((PyArray1::from_slice(py, &x[..dim]),))?;
                in_space(&vector(&value, what)?, dim, what)
            }),
        })
    }
}

/// A vector of length d, padded with zeros to length 3.
pub(crate) fn in_space(value: &[f64], dim: usize, what: &str) -> PyResult<[f64; 3]> {
    if value.len() != dim {
        return Err(PyValueError::new_err(format!(
            "{what} has length {}, expected {dim}",
            value.len()
        )));
    }
    let mut out = [0.0; 3];
    out[..dim].copy_from_slice(value);
    Ok(out)
}
