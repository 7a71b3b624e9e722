//! Batches of complementarity problems.

use std::sync::Mutex;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use semismooth::complementarity::{Lcp, Mcp, McpFunction, McpOptions, McpReport, McpSolver};
use semismooth::piecewise::{self, PiecewiseSmooth, Traced};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

use super::sensitivity::BatchSensitivity;
use super::{Given, Members, count, given, members_or, parts, square};
use crate::errors::{Run, lock, raised};
use crate::map::{Map, Watched, map_of, trace_two};

/// What is known of a member.
struct Member {
    x: Vec<f64>,
    status: &'static str,
    message: Option<String>,
    residual: f64,
    error: f64,
    iterations: usize,
}

impl Member {
    /// One without unknowns: the library takes no such problem, but in a batch its members are rows of no
    /// numbers that satisfy no conditions.
    fn empty() -> Self {
        Self {
            x: Vec::new(),
            status: Status::Solved.name(),
            message: None,
            residual: 0.0,
            error: 0.0,
            iterations: 0,
        }
    }

    /// One that is no problem.
    fn invalid(n: usize, message: String) -> Self {
        Self {
            x: vec![f64::NAN; n],
            status: "invalid",
            message: Some(message),
            residual: f64::NAN,
            error: f64::NAN,
            iterations: 0,
        }
    }

    fn of(x: Vec<f64>, report: &McpReport) -> Self {
        Self {
            x,
            status: report.status.name(),
            message: (report.status != Status::Solved).then(|| report.status.to_string()),
            residual: report.residual,
            error: report.error,
            iterations: report.iterations,
        }
    }
}

/// The results of a batch of complementarity problems, one row a member.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct BatchResult {
    /// The solutions, shape (members, n); of members that are not solved the best point found, of invalid ones NaN.
    pub(crate) x: Py<PyArray2<f64>>,
    /// How each member ended: "solved", other words of :class:`McpResult`, or "invalid" where its data are.
    pub(crate) status: Py<PyList>,
    /// Whether each member is solved.
    pub(crate) solved: Py<PyArray1<bool>>,
    /// Why, for the members that are not solved, by their numbers.
    pub(crate) messages: Py<PyDict>,
    pub(crate) residual: Py<PyArray1<f64>>,
    pub(crate) error: Py<PyArray1<f64>>,
    pub(crate) iterations: Py<PyArray1<i64>>,
    /// Derivatives of the solutions in ``params``, where these were given.
    pub(crate) sensitivity: Option<Py<BatchSensitivity>>,
}

impl BatchResult {
    fn new(py: Python<'_>, n: usize, all: &[Member]) -> PyResult<Self> {
        let flat: Vec<f64> = all.iter().flat_map(|m| &m.x).copied().collect();
        let messages = PyDict::new(py);
        for (i, message) in all
            .iter()
            .enumerate()
            .filter_map(|(i, m)| Some((i, m.message.as_ref()?)))
        {
            messages.set_item(i, message)?;
        }
        Ok(Self {
            x: PyArray1::from_vec(py, flat).reshape([all.len(), n])?.unbind(),
            status: PyList::new(py, all.iter().map(|m| m.status))?.unbind(),
            solved: PyArray1::from_iter(py, all.iter().map(|m| m.status == "solved")).unbind(),
            messages: messages.unbind(),
            residual: PyArray1::from_iter(py, all.iter().map(|m| m.residual)).unbind(),
            error: PyArray1::from_iter(py, all.iter().map(|m| m.error)).unbind(),
            iterations: PyArray1::from_iter(py, all.iter().map(|m| m.iterations as i64)).unbind(),
            sensitivity: None,
        })
    }

    fn derivatives(&self) -> PyResult<&BatchSensitivity> {
        let own = self.sensitivity.as_ref().map(|s| s.get());
        own.ok_or_else(|| {
            PyValueError::new_err("there are derivatives of problems with `params` only: F(x, p)")
        })
    }
}

#[pymethods]
impl BatchResult {
    /// Number of members.
    fn __len__(&self, py: Python<'_>) -> usize {
        self.status.bind(py).len()
    }

    /// As :attr:`BatchSensitivity.differentiable`.
    #[getter]
    fn differentiable(&self, py: Python<'_>) -> PyResult<Vec<Option<bool>>> {
        self.derivatives()?.differentiable(py)
    }

    /// As :meth:`BatchSensitivity.jvp`.
    fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.derivatives()?.jvp(dp)
    }

    /// As :meth:`BatchSensitivity.vjp`.
    fn vjp<'py>(&self, dx: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.derivatives()?.vjp(dx)
    }

    /// As :meth:`BatchSensitivity.derivative`.
    fn derivative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.derivatives()?.derivative(py)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let all = self.status.bind(py).len();
        let failed = self.messages.bind(py).len();
        format!("<BatchResult: {} of {all} solved>", all - failed)
    }
}

/// Solves with a solver of the part; a run that is over is not begun.
fn solved<F: McpFunction>(run: &Run, solver: &mut McpSolver, problem: &Mcp<F>, mut x: Vec<f64>) -> Member {
    let n = x.len();
    let found = solver.solve_observed(problem, &mut x, |_| run.flow()).cloned();
    match found {
        Ok(report) => Member::of(x, &report),
        Err(e) => Member::invalid(n, e.to_string()),
    }
}

/// A batch of linear complementarity problems: see `solve_lcp`.
pub(crate) fn lcps(
    py: Python<'_>,
    [M, q]: [&Bound<'_, PyAny>; 2],
    bounds: [Option<&Bound<'_, PyAny>>; 2],
    x0: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<BatchResult> {
    let (M, q) = (Given::new(M, "M")?, Given::new(q, "q")?);
    let n = q.shape().last().copied().unwrap_or(1);
    let (M, q) = (M.members(&[n, n])?, q.members(&[n])?);
    let others = [
        given(bounds[0], "lower")?,
        given(bounds[1], "upper")?,
        given(x0, "x0")?,
    ];
    let or = |k: usize, value: f64| members_or(&others[k], n, value);
    let (lower, upper, x0) = (or(0, 0.0)?, or(1, f64::INFINITY)?, or(2, 0.0)?);
    let named = [
        ("M", &M),
        ("q", &q),
        ("lower", &lower),
        ("upper", &upper),
        ("x0", &x0),
    ];
    let count = count(&named)?;
    let options: McpOptions = crate::arrays::options(options, py)?;
    let pattern = Pattern::full(n, n);
    let all = Run::watched(py, |run| {
        let each = |solver: &mut McpSolver, i: usize| {
            if n == 0 {
                return Member::empty();
            }
            let bounds = (lower.get(i).to_vec(), upper.get(i).to_vec());
            let problem = (square(&pattern, M.get(i)).map_err(raised))
                .and_then(|m| Lcp::boxed(m, q.get(i).to_vec(), bounds.0, bounds.1).map_err(raised));
            match problem {
                Ok(problem) => solved(run, solver, problem.mcp(), x0.get(i).to_vec()),
                Err(e) => Member::invalid(n, e.to_string()),
            }
        };
        Ok(parts(count, || McpSolver::new(options.clone()), each))
    })?;
    BatchResult::new(py, n, &all)
}

/// F(·, p) of a function F(x, p) that was traced once.
struct AtParams<'a> {
    full: &'a Traced<Watched<'static>>,
    pattern: &'a Pattern,
    params: &'a [f64],
    room: Mutex<(Vec<f64>, Matrix)>,
}

impl<'a> AtParams<'a> {
    fn new(full: &'a Traced<Watched<'static>>, pattern: &'a Pattern, params: &'a [f64]) -> Self {
        let room = Mutex::new((vec![0.0; full.num_vars()], Matrix::zeros(full.pattern())));
        Self {
            full,
            pattern,
            params,
            room,
        }
    }

    fn at<'r>(&self, x: &[f64], room: &'r mut Vec<f64>) -> &'r [f64] {
        room.clear();
        room.extend_from_slice(x);
        room.extend_from_slice(self.params);
        room
    }
}

impl McpFunction for AtParams<'_> {
    fn num_vars(&self) -> usize {
        self.full.num_vars() - self.params.len()
    }

    fn num_values(&self) -> usize {
        self.full.num_residuals()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let (point, _) = &mut *lock(&self.room);
        piecewise::value(self.full, self.at(x, point), out);
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let (point, all) = &mut *lock(&self.room);
        let point = self.at(x, point);
        all.clear();
        self.full
            .jacobian(&piecewise::select(self.full, point), point, all);
        // The columns of x come first.
        let own = jac.values().len();
        jac.values_mut().copy_from_slice(&all.values()[..own]);
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }
}

/// A batch of mixed complementarity problems: see `solve_mcp`.
pub(crate) fn mcps(
    py: Python<'_>,
    function: &Bound<'_, PyAny>,
    bounds: [Option<&Bound<'_, PyAny>>; 2],
    x0: &Bound<'_, PyAny>,
    params: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<BatchResult> {
    let x0 = Given::new(x0, "x0")?;
    let n = x0.shape().last().copied().unwrap_or(1);
    let params = params.map(|p| Given::new(p, "params")).transpose()?;
    let others = [given(bounds[0], "lower")?, given(bounds[1], "upper")?];
    let or = |k: usize, value: f64| members_or(&others[k], n, value);
    let (lower, upper) = (or(0, f64::NEG_INFINITY)?, or(1, f64::INFINITY)?);
    let k = params
        .as_ref()
        .map_or(0, |p| p.shape().last().copied().unwrap_or(1));
    let p = match &params {
        Some(params) => params.members(&[k])?,
        None => Members::of(0, 0.0),
    };
    let map = match params {
        Some(_) => Bound::new(py, trace_two(py, function, n, k)?)?,
        None => map_of(function, n)?,
    };
    check_values(map.get(), n, n + k)?;
    let starts = x0.members(&[n])?;
    let named = [
        ("params", &p),
        ("x0", &starts),
        ("lower", &lower),
        ("upper", &upper),
    ];
    let count = count(&named)?;
    let options: McpOptions = crate::arrays::options(options, py)?;
    let full = map.get().free();
    let pattern = leading(&full.pattern(), n)?;
    let all = Run::watched(py, |run| {
        let each = |solver: &mut McpSolver, i: usize| {
            if n == 0 {
                return Member::empty();
            }
            if let Some(j) = p.get(i).iter().position(|v| !v.is_finite()) {
                return Member::invalid(n, format!("params[{j}] is {}; all must be finite", p.get(i)[j]));
            }
            let function = AtParams::new(&full, &pattern, p.get(i));
            match Mcp::new(function, lower.get(i).to_vec(), upper.get(i).to_vec()) {
                Ok(problem) => solved(run, solver, &problem, starts.get(i).to_vec()),
                Err(e) => Member::invalid(n, e.to_string()),
            }
        };
        Ok(parts(count, || McpSolver::new(options.clone()), each))
    })?;
    let mut result = BatchResult::new(py, n, &all)?;
    if params.is_some() {
        let status = all.iter().map(|m| m.message.clone()).collect();
        let x = all.into_iter().flat_map(|m| m.x).collect();
        let params = (0..count).flat_map(|i| p.get(i).to_vec()).collect();
        let bounds = [&lower, &upper].map(|b| (0..count).flat_map(|i| b.get(i).to_vec()).collect());
        let shared = lower.count.is_none() && upper.count.is_none();
        let made = BatchSensitivity::new(py, map.get(), (n, k), (x, params), bounds, status, shared)?;
        result.sensitivity = Some(Py::new(py, made)?);
    }
    Ok(result)
}

pub(super) fn check_values(map: &Map, n: usize, variables: usize) -> PyResult<()> {
    match (map.num_vars(), map.num_residuals()) == (variables, n) {
        true => Ok(()),
        false => Err(PyValueError::new_err(format!(
            "the function must give {n} values for {n} unknowns; it gives {}",
            map.num_residuals()
        ))),
    }
}

fn leading(pattern: &Pattern, n: usize) -> PyResult<Pattern> {
    let ptr = &pattern.col_ptr()[..=n];
    let rows = pattern.row_idx()[..ptr[n]].to_vec();
    Pattern::from_csc(pattern.nrows(), n, ptr.to_vec(), rows).map_err(raised)
}
