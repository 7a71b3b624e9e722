//! Events on curves: transitions, folds, branch points and zeros of monitors.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::continuation::{self as core, Arm};

use crate::arrays::{counted, rows};
use crate::names::{Names, number};
use crate::saving::{data, data_of, state_of};

/// A point where the active pieces of a curve change, located to rounding.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Transition {
    /// Names and arrays are made on access.
    found: Arc<core::Transition>,
    names: Arc<Names>,
}

impl Transition {
    pub(crate) fn new(found: &core::Transition, names: Arc<Names>) -> Self {
        let found = Arc::new(found.clone());
        Self { found, names }
    }

    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, own) = (slf.py(), slf.get());
        state_of(
            py,
            &[
                ("transition", data_of(py, own.found())?),
                ("names", data_of(py, &*own.names)?),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let own = Self {
            found: Arc::new(data(state, "transition")?),
            names: Arc::new(data(state, "names")?),
        };
        Ok(Bound::new(py, own)?.into_any())
    }

    fn found(&self) -> &core::Transition {
        &self.found
    }
}

#[pymethods]
impl Transition {
    /// The point (y, parameter), shape (m,).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found().x)
    }

    /// The parameter, the last entry of x.
    #[getter]
    fn parameter(&self) -> f64 {
        self.found().parameter()
    }

    /// "pass-through", "fold", "vertical segment begins", "vertical segment ends", "branching", "end" or "undecided".
    #[getter]
    fn kind(&self) -> &'static str {
        self.found().kind.name()
    }

    /// The pieces on arrival, by name, one per site.
    #[getter]
    fn before(&self) -> Vec<&str> {
        self.names.selection(&self.found().before)
    }

    /// The pieces on departure.
    #[getter]
    fn after(&self) -> Vec<&str> {
        self.names.selection(&self.found().after)
    }

    /// Indices from 0 of the sites that switch or could; those that do come first.
    #[getter]
    fn sites(&self) -> Vec<usize> {
        self.found().sites.iter().map(|s| s.site).collect()
    }

    /// Unit tangent on arrival, shape (m,).
    #[getter]
    fn tangent_before<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found().tangent_before)
    }

    /// Unit tangent on departure; that of arrival where the curve ends.
    #[getter]
    fn tangent_after<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found().tangent_after)
    }

    /// Unit tangents of all arms except the one of arrival, shape (k, m); each is a ``direction`` for :func:`follow`.
    #[getter]
    fn arms(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        tangents(py, &self.found().arms, self.found().x.len())
    }

    /// Index in ``arms`` of the arm that was followed, if any.
    #[getter]
    fn followed(&self) -> Option<usize> {
        self.found().followed
    }

    /// Whether all active selections were examined, so that no arm is missing, within tolerances.
    #[getter]
    fn complete(&self) -> bool {
        self.found().complete
    }

    /// The test functions of all sites at x.
    #[getter]
    fn test_functions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found().test_functions)
    }

    /// ‖H(x)‖₂.
    #[getter]
    fn residual(&self) -> f64 {
        self.found().residual_norm
    }

    /// Arclength from the start.
    #[getter]
    fn arclength(&self) -> f64 {
        self.found().arclength
    }

    fn __repr__(&self) -> String {
        format!(
            "<Transition: {} at parameter {}>",
            self.kind(),
            number(self.parameter(), &self.found().x)
        )
    }
}

pub(crate) fn tangents(py: Python<'_>, arms: &[Arm], m: usize) -> PyResult<Py<PyArray2<f64>>> {
    Ok(rows(py, m, arms.iter().map(|a| a.tangent.as_slice()))?.unbind())
}

/// A point where the parameter turns.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Fold {
    /// The point (y, parameter), shape (m,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// The parameter.
    pub(crate) parameter: f64,
    /// "kink" where pieces change at the fold, "smooth" inside a cell; "not known" where the kinks of the function are not known.
    pub(crate) kind: String,
    /// Arclength from the start of the branch; None in diagrams.
    pub(crate) arclength: Option<f64>,
}

impl Fold {
    pub(crate) fn new(py: Python<'_>, x: &[f64], kind: &str, arclength: Option<f64>) -> Self {
        Self {
            x: PyArray1::from_slice(py, x).unbind(),
            parameter: x.last().copied().unwrap_or(f64::NAN),
            kind: kind.to_owned(),
            arclength,
        }
    }
}

#[pymethods]
impl Fold {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let parameter = number(self.parameter, &self.x.bind(py).to_vec()?);
        Ok(format!("<Fold: {} at parameter {parameter}>", self.kind))
    }
}

/// A point where the Jacobian of the pieces loses rank along the curve, so that further arms may leave.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct BranchPoint {
    /// The point (y, parameter), shape (m,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// The parameter.
    pub(crate) parameter: f64,
    /// Unit tangents of all arms except the one of arrival, shape (k, m).
    pub(crate) arms: Py<PyArray2<f64>>,
    /// Index in ``arms`` of the arm that was followed, if any.
    pub(crate) followed: Option<usize>,
    /// Whether no arm is missing, within tolerances.
    pub(crate) complete: bool,
    /// Arclength from the start.
    pub(crate) arclength: f64,
}

#[pymethods]
impl BranchPoint {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let parameter = number(self.parameter, &self.x.bind(py).to_vec()?);
        let arms = counted(self.arms.bind(py).readonly().as_array().nrows() + 1, "arm");
        Ok(format!("<BranchPoint: {arms} at parameter {parameter}>"))
    }
}

/// A zero of a monitor on the curve.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Crossing {
    /// Name of the monitor.
    pub(crate) name: String,
    /// The point (y, parameter), shape (m,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// The parameter.
    pub(crate) parameter: f64,
    /// Arclength from the start; in diagrams, along the edge.
    pub(crate) arclength: f64,
    /// Index of the edge of a diagram; None on branches.
    pub(crate) edge: Option<usize>,
}

impl Crossing {
    pub(crate) fn new(py: Python<'_>, name: &str, x: &[f64], arclength: f64, edge: Option<usize>) -> Self {
        Self {
            name: name.to_owned(),
            x: PyArray1::from_slice(py, x).unbind(),
            parameter: x.last().copied().unwrap_or(f64::NAN),
            arclength,
            edge,
        }
    }
}

#[pymethods]
impl Crossing {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let parameter = number(self.parameter, &self.x.bind(py).to_vec()?);
        Ok(format!("<Crossing: {} = 0 at parameter {parameter}>", self.name))
    }
}
