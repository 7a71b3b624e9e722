//! Frictional contact problems in Delassus form.

use std::ops::ControlFlow;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::contact::{DelassusIteration, DelassusOptions, DelassusProblem, DelassusSolver};

use crate::arrays::{matrix, python, rows, vector};
use crate::batch::{self, dimensions};
use crate::complementarity::observed;
use crate::errors::{Run, raised};
use crate::names::size;

/// How a frictional contact problem was solved, or not.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct FrictionResult {
    /// The reactions, shape (contacts, dimension): columns N, T1 (and T2), in the units of M⁻¹ q.
    pub(crate) reactions: Py<PyArray2<f64>>,
    /// The velocities u = M r + q, shape (contacts, dimension).
    pub(crate) velocities: Py<PyArray2<f64>>,
    /// The state of each contact: "open", "stick", "slip+" where it slips along T1, "slip-" where against it.
    pub(crate) states: Vec<String>,
    /// "solved", "iteration limit" (of factorisations), "time limit", "stalled" or "interrupted".
    pub(crate) status: String,
    /// The residual, scaled and contact by contact, measured at the reactions.
    pub(crate) residual: f64,
    /// Factorisations.
    pub(crate) factorisations: usize,
    /// The iterates, each a dict of "index", "phase", "residual", "alpha", "work" and "success".
    pub(crate) history: Py<PyAny>,
}

#[pymethods]
impl FrictionResult {
    /// The reactions in one vector, shape (contacts · dimension,).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(self
            .reactions
            .bind(py)
            .call_method0("ravel")?
            .cast_into::<PyArray1<f64>>()?)
    }

    /// Whether the problem is solved.
    #[getter]
    fn solved(&self) -> bool {
        self.status == "solved"
    }

    fn __repr__(&self) -> String {
        format!(
            "<FrictionResult: {}, residual {}>",
            self.status,
            size(self.residual)
        )
    }
}

/// Solves a frictional contact problem reduced to its contacts: u = M r + q, with Signorini's conditions 0 ≤ u_N ⟂ r_N ≥ 0 and Coulomb's law
/// at each contact.
///
/// Parameters
/// ----------
/// M : array or scipy.sparse matrix of shape (dk, dk)
///     The Delassus matrix of k contacts, d = 2 in the plane, 3 in space: positive semidefinite; components N, T1 (, T2) contact by contact.
/// q : array of shape (dk,)
/// mu : array of shape (k,)
///     Coefficients of friction, at least 0.
/// start : array of shape (dk,), optional
///     Reactions to start from.
/// callback : callable, optional
///     Called with a dict on each iterate; returns True to stop.
/// **options
///     tolerance, max_time (60 seconds; None: no limit), max_sweeps and max_factorisations of DelassusOptions.
///
/// Returns
/// -------
/// FrictionResult
///     With a leading dimension of M, (members, n, n), q, mu or start, a :class:`FrictionBatch`, solved on all cores.
///
/// >>> import numpy as np, semismooth as ss
/// >>> # A block of unit mass, pressed by 1 and pushed by 0.2, with μ = 0.3: it sticks.
/// >>> result = ss.solve_friction(np.eye(2), [-1.0, -0.2], [0.3])
/// >>> result.states, result.reactions.round(9)
/// (['stick'], array([[1. , 0.2]]))
#[pyfunction]
#[pyo3(signature = (M, q, mu, *, start=None, callback=None, **options))]
fn solve_friction(
    py: Python<'_>,
    M: &Bound<'_, PyAny>,
    q: &Bound<'_, PyAny>,
    mu: &Bound<'_, PyAny>,
    start: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<PyAny>> {
    if dimensions(Some(M)) > 2 || [Some(q), Some(mu), start].iter().any(|v| dimensions(*v) > 1) {
        if callback.is_some() {
            return Err(PyTypeError::new_err(
                "a batch is solved on all cores without a callback",
            ));
        }
        return Ok(Py::new(py, batch::frictions(py, [M, q, mu], start, options)?)?.into_any());
    }
    let (q, mu) = (vector(q, "q")?, vector(mu, "mu")?);
    let dimension = q.len().checked_div(mu.len()).unwrap_or(0);
    if dimension * mu.len() != q.len() {
        return Err(PyValueError::new_err(format!(
            "q has length {}, which is no multiple of the {} contacts of mu",
            q.len(),
            mu.len()
        )));
    }
    let start = start.map(|s| vector(s, "start")).transpose()?;
    let options: DelassusOptions = crate::arrays::options(options, py)?;
    let problem = DelassusProblem::new(dimension, matrix(M, "M")?, q, mu).map_err(raised)?;
    let report = Run::detached(py, |run| {
        let mut flow = ControlFlow::Continue(());
        let observe = |iteration: &DelassusIteration| observed(run, callback.as_ref(), iteration, &mut flow);
        DelassusSolver::new(options)
            .solve_observed(&problem, start.as_deref(), observe)
            .map_err(raised)
    })?;
    let result = FrictionResult {
        reactions: rows(py, dimension, [report.r.as_slice()])?.unbind(),
        velocities: rows(py, dimension, [report.u.as_slice()])?.unbind(),
        states: report.states.iter().map(|s| s.name().to_owned()).collect(),
        status: report.status.name().to_owned(),
        residual: report.residual,
        factorisations: report.factorisations,
        history: python(py, &report.history)?.unbind(),
    };
    Ok(Py::new(py, result)?.into_any())
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<FrictionResult>()?;
    module.add_function(wrap_pyfunction!(solve_friction, module)?)
}
