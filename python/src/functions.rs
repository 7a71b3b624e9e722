//! Functions written in Python, with their derivatives: traced, by differences, or by another function.

use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use semismooth::complementarity::{AffineFunction, Differenced, McpFunction, WithJacobian};
use semismooth::sparse::{Matrix, Pattern};

use crate::arrays::{matrix, sparse, vector};
use crate::errors::{Run, raised};
use crate::map::{Map, TracedFunction, map_of};
use crate::saving::{data, data_of, field, state_of};

/// F and its Jacobian as Python functions.
pub(crate) struct Called {
    function: Py<PyAny>,
    jacobian: Py<PyAny>,
}

/// How the derivative of F is found.
pub(crate) enum Derivative {
    /// F(x) = M x + q.
    Affine(AffineFunction),
    /// By tracing F.
    Formula(Py<Map>),
    /// By differences of F.
    Differences(Py<PyAny>, Pattern),
    /// By the function `jac`.
    Function(Called, Pattern),
}

impl Derivative {
    /// The derivative of a function with n values of the m variables of `x0`, m = n, or n + 1 where the last one is a parameter.
    pub(crate) fn new(
        function: &Bound<'_, PyAny>,
        jac: Option<&Bound<'_, PyAny>>,
        pattern: Option<&Bound<'_, PyAny>>,
        x0: &[f64],
        n: usize,
    ) -> PyResult<Self> {
        let (py, m) = (function.py(), x0.len());
        if let Ok((given, q)) = function.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() {
            let affine = AffineFunction::new(matrix(&given, "M")?, vector(&q, "q")?).map_err(raised)?;
            return match (affine.num_vars(), affine.num_values()) == (m, n) {
                true => Ok(Self::Affine(affine)),
                false => Err(PyValueError::new_err(format!(
                    "M has shape ({}, {}), expected ({n}, {m})",
                    affine.num_values(),
                    affine.num_vars()
                ))),
            };
        }
        let pattern = match pattern {
            Some(pattern) => Some(matrix(pattern, "pattern")?.pattern().clone()),
            None => None,
        };
        let Some(jac) = jac else {
            let map = map_of(function, m)?;
            let (variables, values) = (map.get().num_vars(), map.get().num_residuals());
            return match (variables, values) == (m, n) {
                true => Ok(match map.get().free().affine().filter(|_| m == n) {
                    Some((matrix, q)) => Self::Affine(AffineFunction::new(matrix, q).map_err(raised)?),
                    None => Self::Formula(map.unbind()),
                }),
                false => Err(PyValueError::new_err(format!(
                    "the function must give {n} values for {m} variables; it gives {values} for {variables}"
                ))),
            };
        };
        if let Ok(word) = jac.cast::<PyString>() {
            return match word.to_str()? {
                "differences" => {
                    let pattern = pattern.unwrap_or_else(|| Pattern::full(n, m));
                    Ok(Self::Differences(function.clone().unbind(), pattern))
                }
                other => Err(PyValueError::new_err(format!(
                    "jac = \"{other}\" is not known: leave it out (F is traced), write \"differences\", or give a function"
                ))),
            };
        }
        if !jac.is_callable() {
            return Err(PyTypeError::new_err(
                "jac is neither a function nor \"differences\"",
            ));
        }
        let pattern = match pattern {
            Some(pattern) => pattern,
            // The pattern of a sparse Jacobian at the start is taken for all x.
            None => match sparse(&jac.call1((PyArray1::from_slice(py, x0),))?)? {
                Some(first) => first.matrix()?.pattern().clone(),
                None => Pattern::full(n, m),
            },
        };
        let (function, jacobian) = (function.clone().unbind(), jac.clone().unbind());
        Ok(Self::Function(Called { function, jacobian }, pattern))
    }

    pub(crate) fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match self {
            Self::Affine(affine) => state_of(
                py,
                &[
                    ("M", data_of(py, affine.matrix())?),
                    ("q", data_of(py, &affine.q())?),
                ],
            ),
            Self::Formula(map) => state_of(py, &[("map", map.bind(py).clone().into_any())]),
            Self::Differences(function, pattern) => state_of(
                py,
                &[
                    ("function", function.bind(py).clone()),
                    ("pattern", data_of(py, pattern)?),
                ],
            ),
            Self::Function(Called { function, jacobian }, pattern) => state_of(
                py,
                &[
                    ("function", function.bind(py).clone()),
                    ("jac", jacobian.bind(py).clone()),
                    ("pattern", data_of(py, pattern)?),
                ],
            ),
        }
    }

    pub(crate) fn restored(state: &Bound<'_, PyDict>) -> PyResult<Self> {
        if state.contains("M")? {
            let affine = AffineFunction::new(data(state, "M")?, data(state, "q")?).map_err(raised)?;
            return Ok(Self::Affine(affine));
        }
        if state.contains("map")? {
            return Ok(Self::Formula(field(state, "map")?));
        }
        let (function, pattern) = (field(state, "function")?, data(state, "pattern")?);
        Ok(match state.contains("jac")? {
            true => {
                let jacobian = field(state, "jac")?;
                Self::Function(Called { function, jacobian }, pattern)
            }
            false => Self::Differences(function, pattern),
        })
    }

    /// Whether the function was traced and has kinks of its own.
    pub(crate) fn has_kinks(&self) -> bool {
        matches!(self, Self::Formula(map) if map.get().num_sites() > 0)
    }

    pub(crate) fn function<'r>(&'r self, run: &'r Run, n: usize) -> Box<dyn McpFunction + 'r> {
        let values = |function: &'r Py<PyAny>| {
            move |x: &[f64], out: &mut [f64]| {
                if run.call(|py| fill(function.bind(py), x, out)).is_none() {
                    out.fill(f64::NAN);
                }
            }
        };
        match self {
            Self::Affine(function) => Box::new(function),
            Self::Formula(map) => Box::new(TracedFunction(map.get().traced(run))),
            Self::Differences(function, pattern) => {
                Box::new(Differenced::new(n, values(function)).with_pattern(pattern.clone()))
            }
            Self::Function(Called { function, jacobian }, pattern) => {
                let derivative = move |x: &[f64], jac: &mut Matrix| {
                    if run.call(|py| add(jacobian.bind(py), x, jac)).is_none() {
                        jac.values_mut().fill(f64::NAN);
                    }
                };
                let function = WithJacobian::new(n, values(function), derivative);
                Box::new(function.with_pattern(pattern.clone()))
            }
        }
    }
}

/// Writes the values of a Python function at x.
pub(crate) fn fill(function: &Bound<'_, PyAny>, x: &[f64], out: &mut [f64]) -> PyResult<()> {
    let values = vector(
        &function.call1((PyArray1::from_slice(function.py(), x),))?,
        "the value of the function",
    )?;
    if values.len() != out.len() {
        return Err(PyValueError::new_err(format!(
            "the function returned {} values, expected {}",
            values.len(),
            out.len()
        )));
    }
    out.copy_from_slice(&values);
    Ok(())
}

/// Adds the matrix that a Python function returns at x.
pub(crate) fn add(jacobian: &Bound<'_, PyAny>, x: &[f64], jac: &mut Matrix) -> PyResult<()> {
    let given = matrix(
        &jacobian.call1((PyArray1::from_slice(jacobian.py(), x),))?,
        "the Jacobian",
    )?;
    let (found, expected) = ((given.nrows(), given.ncols()), (jac.nrows(), jac.ncols()));
    if found != expected {
        return Err(PyValueError::new_err(format!(
            "the Jacobian has shape {found:?}, expected {expected:?}"
        )));
    }
    jac.add_block(0, 0, 1.0, &given);
    if let Some((row, col)) = jac.stray() {
        return Err(PyValueError::new_err(format!(
            "the Jacobian has an entry at ({row}, {col}) that is not in its pattern, which is that of jac at the start unless given: write \
             pattern=, a matrix with all entries that may differ from 0"
        )));
    }
    Ok(())
}
