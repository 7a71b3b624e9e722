//! What happens on curves.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use semismooth::continuation::{self as core, Arm};

use crate::arrays::rows;
use crate::continuation::Names;

/// A point where the active pieces of a curve change, located to rounding.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Transition {
    /// The point (y, parameter), shape (m,).
    x: Py<PyArray1<f64>>,
    /// The parameter, the last entry of x.
    parameter: f64,
    /// "pass-through", "fold", "vertical segment begins", "vertical segment ends", "branching", "end" or "undecided".
    kind: &'static str,
    /// The pieces on arrival, by name, one a site.
    before: Vec<String>,
    /// The pieces on departure.
    after: Vec<String>,
    /// The sites that switch (or could), from 0; those that change first.
    sites: Vec<usize>,
    /// Unit tangent on arrival, shape (m,).
    tangent_before: Py<PyArray1<f64>>,
    /// Unit tangent on departure; that of arrival where the curve ends.
    tangent_after: Py<PyArray1<f64>>,
    /// Unit tangents of all arms that leave, but the one of arrival, shape (k, m); each is a ``direction`` for :func:`follow`.
    arms: Py<PyArray2<f64>>,
    /// Index in ``arms`` of the arm that was followed, if any.
    followed: Option<usize>,
    /// Whether all active selections were examined, so that no arm is missing, within tolerances.
    complete: bool,
    /// The test functions of all sites at x.
    test_functions: Py<PyArray1<f64>>,
    /// ‖H(x)‖₂.
    residual: f64,
    /// Arclength from the start.
    arclength: f64,
}

impl Transition {
    pub(crate) fn new(py: Python<'_>, t: &core::Transition, names: &Names) -> PyResult<Self> {
        Ok(Self {
            x: PyArray1::from_slice(py, &t.x).unbind(),
            parameter: t.parameter(),
            kind: t.kind.name(),
            before: names.owned(&t.before),
            after: names.owned(&t.after),
            sites: t.sites.iter().map(|s| s.site).collect(),
            tangent_before: PyArray1::from_slice(py, &t.tangent_before).unbind(),
            tangent_after: PyArray1::from_slice(py, &t.tangent_after).unbind(),
            arms: tangents(py, &t.arms, t.x.len())?,
            followed: t.followed,
            complete: t.complete,
            test_functions: PyArray1::from_slice(py, &t.test_functions).unbind(),
            residual: t.residual_norm,
            arclength: t.arclength,
        })
    }
}

#[pymethods]
impl Transition {
    fn __repr__(&self) -> String {
        format!("<Transition: {} at parameter {:?}>", self.kind, self.parameter)
    }
}

pub(crate) fn tangents(py: Python<'_>, arms: &[Arm], m: usize) -> PyResult<Py<PyArray2<f64>>> {
    Ok(rows(py, m, arms.iter().map(|a| a.tangent.as_slice()))?.unbind())
}

/// A point where the parameter turns.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Fold {
    /// The point (y, parameter), shape (m,).
    x: Py<PyArray1<f64>>,
    /// The parameter.
    parameter: f64,
    /// "kink" where pieces change at the fold, "smooth" inside of a piece.
    kind: &'static str,
    /// Arclength from the start of the branch; None in diagrams.
    arclength: Option<f64>,
}

impl Fold {
    pub(crate) fn new(py: Python<'_>, x: &[f64], kind: &'static str, arclength: Option<f64>) -> Self {
        Self {
            x: PyArray1::from_slice(py, x).unbind(),
            parameter: x.last().copied().unwrap_or(f64::NAN),
            kind,
            arclength,
        }
    }
}

#[pymethods]
impl Fold {
    fn __repr__(&self) -> String {
        format!("<Fold: {} at parameter {:?}>", self.kind, self.parameter)
    }
}

/// A point where the Jacobian of the pieces loses rank along the curve, so that further arms may leave.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct BranchPoint {
    /// The point (y, parameter), shape (m,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// The parameter.
    pub(crate) parameter: f64,
    /// Unit tangents of all arms that leave, but the one of arrival, shape (k, m).
    pub(crate) arms: Py<PyArray2<f64>>,
    /// Index in ``arms`` of the arm that was followed, if any.
    pub(crate) followed: Option<usize>,
    /// Whether no arm is missing, within tolerances.
    pub(crate) complete: bool,
    /// Arclength from the start.
    pub(crate) arclength: f64,
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
    fn __repr__(&self) -> String {
        format!("<Crossing: {} = 0 at parameter {:?}>", self.name, self.parameter)
    }
}
