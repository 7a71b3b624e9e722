//! Batches of frictional contact problems.

use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use semismooth::contact::{DelassusOptions, DelassusProblem, DelassusReport, DelassusSolver};
use semismooth::run::Status;
use semismooth::sparse::Pattern;

use super::{Given, Members, count, parts, square};
use crate::errors::Run;

/// The results of a batch of frictional contact problems in Delassus form.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct FrictionBatch {
    /// The reactions, shape (members, contacts, dim); NaN where the data of a member are invalid.
    pub(crate) reactions: Py<PyArray3<f64>>,
    /// The velocities, in the same shape.
    pub(crate) velocities: Py<PyArray3<f64>>,
    /// How each member ended.
    pub(crate) status: Py<PyList>,
    /// Whether each member is solved.
    pub(crate) solved: Py<PyArray1<bool>>,
    /// Why, for the members that are not solved, by their numbers.
    pub(crate) messages: Py<PyDict>,
    pub(crate) residual: Py<PyArray1<f64>>,
}

#[pymethods]
impl FrictionBatch {
    /// Number of members.
    fn __len__(&self, py: Python<'_>) -> usize {
        self.status.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let all = self.status.bind(py).len();
        format!(
            "<FrictionBatch: {} of {all} solved>",
            all - self.messages.bind(py).len()
        )
    }
}

/// A batch of frictional contact problems: see `solve_friction`.
pub(crate) fn frictions(
    py: Python<'_>,
    [M, q, mu]: [&Bound<'_, PyAny>; 3],
    start: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<FrictionBatch> {
    let (M, q, mu) = (Given::new(M, "M")?, Given::new(q, "q")?, Given::new(mu, "mu")?);
    let start = start.map(|s| Given::new(s, "start")).transpose()?;
    let last = |given: &Given<'_>| given.shape().last().copied().unwrap_or(1);
    let (n, contacts) = (last(&q), last(&mu));
    let dimension = n.checked_div(contacts).unwrap_or(0);
    if dimension * contacts != n {
        return Err(PyValueError::new_err(format!(
            "q has length {n}, which is no multiple of the {contacts} contacts of mu"
        )));
    }
    let (M, q, mu) = (M.members(&[n, n])?, q.members(&[n])?, mu.members(&[contacts])?);
    let start = start.as_ref().map(|s| s.members(&[n])).transpose()?;
    let none = Members::of(n, 0.0);
    let named = [
        ("M", &M),
        ("q", &q),
        ("mu", &mu),
        ("start", start.as_ref().unwrap_or(&none)),
    ];
    let count = count(&named)?;
    let options: DelassusOptions = crate::arrays::options(options, py)?;
    let pattern = Pattern::full(n, n);
    // Members without contacts, which the library takes for no problems, have nothing to report.
    let all: Vec<Result<Option<DelassusReport>, String>> = Run::watched(py, |run| {
        let each = |solver: &mut DelassusSolver, i: usize| {
            if n == 0 {
                return Ok(None);
            }
            let matrix = square(&pattern, M.get(i)).map_err(|e| e.to_string())?;
            let problem = DelassusProblem::new(dimension, matrix, q.get(i).to_vec(), mu.get(i).to_vec());
            let problem = problem.map_err(|e| e.to_string())?;
            let start = start.as_ref().map(|s| s.get(i));
            let found = solver.solve_observed(&problem, start, |_| run.flow());
            found.map(Some).map_err(|e| e.to_string())
        };
        Ok(parts(count, || DelassusSolver::new(options.clone()), each))
    })?;
    let messages = PyDict::new(py);
    for (i, found) in all.iter().enumerate() {
        match found {
            Ok(None) => {}
            Ok(Some(report)) if report.status == Status::Solved => {}
            Ok(Some(report)) => messages.set_item(i, report.status.to_string())?,
            Err(why) => messages.set_item(i, why)?,
        }
    }
    let flat = |of: fn(&DelassusReport) -> &Vec<f64>| -> PyResult<Py<PyArray3<f64>>> {
        let row = |found: &Result<Option<DelassusReport>, String>| match found {
            Ok(report) => report.as_ref().map_or_else(Vec::new, |r| of(r).clone()),
            Err(_) => vec![f64::NAN; n],
        };
        let flat: Vec<f64> = all.iter().flat_map(row).collect();
        Ok(PyArray1::from_vec(py, flat)
            .reshape([count, contacts, dimension])?
            .unbind())
    };
    let status = |found: &Result<Option<DelassusReport>, String>| match found {
        Ok(Some(report)) => report.status.name(),
        Ok(None) => Status::Solved.name(),
        Err(_) => "invalid",
    };
    let residual = |found: &Result<Option<DelassusReport>, String>| match found {
        Ok(report) => report.as_ref().map_or(0.0, |r| r.residual),
        Err(_) => f64::NAN,
    };
    Ok(FrictionBatch {
        reactions: flat(|r| &r.r)?,
        velocities: flat(|r| &r.u)?,
        status: PyList::new(py, all.iter().map(status))?.unbind(),
        solved: PyArray1::from_iter(py, all.iter().map(|f| status(f) == "solved")).unbind(),
        messages: messages.unbind(),
        residual: PyArray1::from_iter(py, all.iter().map(residual)).unbind(),
    })
}
