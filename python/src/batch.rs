//! Many problems at once: a leading dimension of the data, all cores, failures marked one by one.

use std::borrow::Cow;
use std::ffi::CString;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use numpy::{
    AllowTypeChange, PyArray1, PyArray2, PyArray3, PyArrayLikeDyn, PyArrayMethods, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use semismooth::complementarity::{Lcp, Mcp, McpFunction, McpOptions, McpReport, McpSolver};
use semismooth::contact::{DelassusOptions, DelassusProblem, DelassusReport, DelassusSolver};
use semismooth::piecewise::{self, PiecewiseSmooth, Traced};
use semismooth::run::Status;
use semismooth::sensitivity::SensitivityError;
use semismooth::sparse::{Matrix, Pattern};

use crate::arrays::{counted, real};
use crate::errors::{Run, lock, raised};
use crate::map::{Map, Watched, map_of, trace_two};

/// Members that share a solver, one after another: so few that all cores have work, and fixed, so that results do not depend on their number.
const TOGETHER: usize = 16;

/// An array with a leading dimension for the members of a batch, or without one: then all have the same.
pub(crate) struct Given<'py> {
    array: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    what: &'static str,
}

impl<'py> Given<'py> {
    pub(crate) fn new(object: &Bound<'py, PyAny>, what: &'static str) -> PyResult<Self> {
        real(object, what)?;
        let array = object.extract().map_err(|e: PyErr| {
            let error = PyTypeError::new_err(format!("{what} must be an array of numbers"));
            error.set_cause(object.py(), Some(e));
            error
        })?;
        Ok(Self { array, what })
    }

    fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    /// The data of members with the given shape.
    fn members(&self, own: &[usize]) -> PyResult<Members<'_>> {
        let shape = self.shape();
        let width = own.iter().product();
        let data = match self.array.as_slice() {
            Ok(data) => Cow::Borrowed(data),
            Err(_) => Cow::Owned(self.array.as_array().iter().copied().collect()),
        };
        let count = match shape {
            [] if width > 0 => {
                let value = data[0];
                return Ok(Members {
                    data: Cow::Owned(vec![value; width]),
                    width,
                    count: None,
                });
            }
            shape if shape == own => None,
            [count, rest @ ..] if rest == own => Some(*count),
            _ => {
                let list = |shape: &[usize]| {
                    shape
                        .iter()
                        .map(ToString::to_string)
                        .collect::<Vec<_>>()
                        .join(", ")
                };
                return Err(PyValueError::new_err(format!(
                    "{} has the shape ({}), expected ({}), or that behind the number of members of a batch",
                    self.what,
                    list(shape),
                    list(own)
                )));
            }
        };
        Ok(Members { data, width, count })
    }
}

struct Members<'a> {
    data: Cow<'a, [f64]>,
    width: usize,
    /// None where all members have the same.
    count: Option<usize>,
}

impl Members<'_> {
    fn of(width: usize, value: f64) -> Self {
        Self {
            data: Cow::Owned(vec![value; width]),
            width,
            count: None,
        }
    }

    fn get(&self, i: usize) -> &[f64] {
        match self.count {
            Some(_) => &self.data[i * self.width..(i + 1) * self.width],
            None => &self.data,
        }
    }
}

fn given<'py>(of: Option<&Bound<'py, PyAny>>, what: &'static str) -> PyResult<Option<Given<'py>>> {
    of.map(|o| Given::new(o, what)).transpose()
}

/// Vectors of n numbers, `value` where nothing is given.
fn members_or<'a>(given: &'a Option<Given<'_>>, n: usize, value: f64) -> PyResult<Members<'a>> {
    match given {
        Some(given) => given.members(&[n]),
        None => Ok(Members::of(n, value)),
    }
}

/// The number of members that all batches have in common; none where there is no batch.
fn count(all: &[(&'static str, &Members<'_>)]) -> PyResult<usize> {
    let mut batches = all.iter().filter_map(|(what, m)| Some((*what, m.count?)));
    let Some((first, count)) = batches.next() else {
        return Err(PyValueError::new_err("there is no batch"));
    };
    match batches.find(|(_, other)| *other != count) {
        Some((what, other)) => Err(PyValueError::new_err(format!(
            "{first} has {} and {what} {other}",
            counted(count, "member")
        ))),
        None => Ok(count),
    }
}

/// How many dimensions numpy sees in an object; 0 in one that it does not take for an array.
pub(crate) fn dimensions(object: Option<&Bound<'_, PyAny>>) -> usize {
    let Some(object) = object else { return 0 };
    match object.getattr("ndim").and_then(|ndim| ndim.extract::<usize>()) {
        Ok(ndim) => ndim,
        Err(_) => {
            let numpy = object.py().import("numpy");
            let ndim = numpy.and_then(|numpy| numpy.call_method1("ndim", (object,))?.extract::<usize>());
            ndim.unwrap_or(0)
        }
    }
}

/// The number of threads of a batch: that of the cores that this process may use, or of `SEMISMOOTH_NUM_THREADS`.
fn threads() -> usize {
    let wanted = std::env::var("SEMISMOOTH_NUM_THREADS");
    let wanted = wanted.ok().and_then(|text| text.parse().ok()).filter(|n| *n > 0);
    wanted.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// Calls `each` for the members of parts of a batch on all cores; a part begins with what `begin` makes. Threads live as long as the batch:
/// a pool that lasted would not survive where Python forks.
fn parts<S, R: Send>(
    count: usize,
    begin: impl Fn() -> S + Sync,
    each: impl Fn(&mut S, usize) -> R + Sync,
) -> Vec<R> {
    let number = count.div_ceil(TOGETHER);
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(number)));
    let work = || {
        loop {
            let part = next.fetch_add(1, Ordering::Relaxed);
            if part >= number {
                return;
            }
            let range = part * TOGETHER..count.min((part + 1) * TOGETHER);
            let mut state = begin();
            let found: Vec<R> = range.map(|i| each(&mut state, i)).collect();
            lock(&done).push((part, found));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads().min(number) {
            scope.spawn(work);
        }
        work();
    });
    let mut all = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    all.sort_unstable_by_key(|(part, _)| *part);
    all.into_iter().flat_map(|(_, found)| found).collect()
}

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
            let rows = M.get(i);
            let columns = (0..n * n).map(|e| rows[e % n * n + e / n]).collect();
            let bounds = (lower.get(i).to_vec(), upper.get(i).to_vec());
            let problem = (Matrix::from_values(pattern.clone(), columns).map_err(raised))
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

fn check_values(map: &Map, n: usize, variables: usize) -> PyResult<()> {
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

type Found = semismooth::sensitivity::Sensitivity<Traced<Watched<'static>>>;

/// Solutions of a batch as functions of their parameters, made by :func:`sensitivity` and :func:`solve_mcp` with a leading dimension.
///
/// A member without a derivative has NaN in its row, and a warning names it.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct BatchSensitivity {
    /// One map for all members, or one each where bounds differ.
    maps: Vec<Map>,
    sizes: (usize, usize),
    x: Vec<f64>,
    params: Vec<f64>,
    /// Why members have no derivative, known before.
    unsolved: Vec<Option<String>>,
}

impl BatchSensitivity {
    fn new(
        py: Python<'_>,
        map: &Map,
        (n, k): (usize, usize),
        (x, params): (Vec<f64>, Vec<f64>),
        [lower, upper]: [Vec<f64>; 2],
        unsolved: Vec<Option<String>>,
        shared: bool,
    ) -> PyResult<Self> {
        let maps = if shared {
            1.min(unsolved.len())
        } else {
            unsolved.len()
        };
        let natural = |i: usize| map.natural(&lower[i * n..(i + 1) * n], &upper[i * n..(i + 1) * n]);
        Ok(Self {
            maps: py.detach(|| (0..maps).map(natural).collect()),
            sizes: (n, k),
            x,
            params,
            unsolved,
        })
    }

    /// `work` for all members, and why it failed for some.
    fn all<T: Send>(
        &self,
        py: Python<'_>,
        work: impl Fn(usize, &mut Found) -> Result<T, SensitivityError> + Sync,
    ) -> PyResult<Vec<Result<T, String>>> {
        let (n, k) = self.sizes;
        Run::watched(py, |run| {
            let each = |_: &mut (), i: usize| {
                if let Some(why) = &self.unsolved[i] {
                    return Err(why.clone());
                }
                if run.flow() == ControlFlow::Break(()) {
                    return Err("interrupted".to_owned());
                }
                let map = self.maps[if self.maps.len() == 1 { 0 } else { i }].free();
                let (x, p) = (&self.x[i * n..(i + 1) * n], &self.params[i * k..(i + 1) * k]);
                let found = Found::new(map, x, p).and_then(|mut found| work(i, &mut found));
                found.map_err(|e| e.to_string())
            };
            Ok(parts(self.unsolved.len(), || (), each))
        })
    }

    /// Rows of a result, NaN with a warning where there is none.
    fn rows(&self, py: Python<'_>, width: usize, all: Vec<Result<Vec<f64>, String>>) -> PyResult<Vec<f64>> {
        let failed: Vec<usize> = (0..all.len()).filter(|&i| all[i].is_err()).collect();
        if let Some(Err(first)) = failed.first().map(|&i| &all[i]) {
            let numbers: Vec<String> = failed.iter().take(10).map(ToString::to_string).collect();
            let more = if failed.len() > 10 { ", …" } else { "" };
            let text = format!(
                "{} without a derivative have NaN in their rows ({}{more}); the first: {first}",
                counted(failed.len(), "member"),
                numbers.join(", ")
            );
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(text)?, 1)?;
        }
        let row = |found: Result<Vec<f64>, String>| found.unwrap_or_else(|_| vec![f64::NAN; width]);
        Ok(all.into_iter().flat_map(row).collect())
    }
}

#[pymethods]
impl BatchSensitivity {
    /// Number of members.
    fn __len__(&self) -> usize {
        self.unsolved.len()
    }

    /// Whether each solution is a differentiable function of its parameters: True, False, or None: not known, also where a member is not
    /// solved.
    #[getter]
    fn differentiable(&self, py: Python<'_>) -> PyResult<Vec<Option<bool>>> {
        let all = self.all(py, |_, found| found.differentiable())?;
        Ok(all.into_iter().map(|found| found.ok()?.known()).collect())
    }

    /// The directional derivatives along changes dp, shape (members, k), or (k,) for all: shape (members, n).
    fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (py, (n, k)) = (dp.py(), self.sizes);
        let given = Given::new(dp, "dp")?;
        let dp = given.members(&[k])?;
        self.check(&dp, "dp")?;
        let all = self.all(py, |i, found| found.jvp(dp.get(i)))?;
        let flat = self.rows(py, n, all)?;
        PyArray1::from_vec(py, flat).reshape([self.unsolved.len(), n])
    }

    /// The gradients in the parameters, shape (members, k), of functions of the solutions whose gradients are dx, shape (members, n), or (n,)
    /// for all.
    fn vjp<'py>(&self, dx: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (py, (n, k)) = (dx.py(), self.sizes);
        let given = Given::new(dx, "dx")?;
        let dx = given.members(&[n])?;
        self.check(&dx, "dx")?;
        let all = self.all(py, |i, found| found.vjp(dx.get(i)))?;
        let flat = self.rows(py, k, all)?;
        PyArray1::from_vec(py, flat).reshape([self.unsolved.len(), k])
    }

    /// The derivatives, shape (members, n, k); NaN, with a warning, where a solution is not known to be differentiable.
    fn derivative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (n, k) = self.sizes;
        let all = self.all(py, |_, found| {
            let matrix = found.derivative()?;
            let entries = (0..n * k).map(|e| matrix.get(e / k, e % k));
            Ok(entries.collect())
        })?;
        let flat = self.rows(py, n * k, all)?;
        PyArray1::from_vec(py, flat).reshape([self.unsolved.len(), n, k])
    }

    fn __repr__(&self) -> String {
        let (n, k) = self.sizes;
        let (members, unknowns) = (counted(self.unsolved.len(), "member"), counted(n, "unknown"));
        format!(
            "<BatchSensitivity: {members}, {unknowns} to {}>",
            counted(k, "parameter")
        )
    }
}

impl BatchSensitivity {
    fn check(&self, members: &Members<'_>, what: &str) -> PyResult<()> {
        match members.count {
            Some(count) if count != self.unsolved.len() => Err(PyValueError::new_err(format!(
                "{what} has {} for a batch of {}",
                counted(count, "member"),
                self.unsolved.len()
            ))),
            _ => Ok(()),
        }
    }
}

/// A batch of solutions as functions of parameters: see `sensitivity`.
pub(crate) fn sensitivities(
    py: Python<'_>,
    function: &Bound<'_, PyAny>,
    [x, params]: [&Bound<'_, PyAny>; 2],
    bounds: [Option<&Bound<'_, PyAny>>; 2],
) -> PyResult<BatchSensitivity> {
    let (x, params) = (Given::new(x, "x")?, Given::new(params, "params")?);
    let last = |given: &Given<'_>| given.shape().last().copied().unwrap_or(1);
    let (n, k) = (last(&x), last(&params));
    let (x, params) = (x.members(&[n])?, params.members(&[k])?);
    let others = [given(bounds[0], "lower")?, given(bounds[1], "upper")?];
    let or = |k: usize, value: f64| members_or(&others[k], n, value);
    let (lower, upper) = (or(0, f64::NEG_INFINITY)?, or(1, f64::INFINITY)?);
    let count = count(&[
        ("x", &x),
        ("params", &params),
        ("lower", &lower),
        ("upper", &upper),
    ])?;
    let map = trace_two(py, function, n, k)?;
    check_values(&map, n, n + k)?;
    let flat = |members: &Members<'_>| (0..count).flat_map(|i| members.get(i).to_vec()).collect();
    let shared = lower.count.is_none() && upper.count.is_none();
    let (points, bounds) = ((flat(&x), flat(&params)), [flat(&lower), flat(&upper)]);
    BatchSensitivity::new(py, &map, (n, k), points, bounds, vec![None; count], shared)
}

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
    let all: Vec<Result<DelassusReport, String>> = Run::watched(py, |run| {
        let each = |solver: &mut DelassusSolver, i: usize| {
            let rows = M.get(i);
            let columns = (0..n * n).map(|e| rows[e % n * n + e / n]).collect();
            let matrix = Matrix::from_values(pattern.clone(), columns).map_err(|e| e.to_string())?;
            let problem = DelassusProblem::new(dimension, matrix, q.get(i).to_vec(), mu.get(i).to_vec());
            let problem = problem.map_err(|e| e.to_string())?;
            let start = start.as_ref().map(|s| s.get(i));
            let found = solver.solve_observed(&problem, start, |_| run.flow());
            found.map_err(|e| e.to_string())
        };
        Ok(parts(count, || DelassusSolver::new(options.clone()), each))
    })?;
    let messages = PyDict::new(py);
    for (i, found) in all.iter().enumerate() {
        match found {
            Ok(report) if report.status == Status::Solved => {}
            Ok(report) => messages.set_item(i, report.status.to_string())?,
            Err(why) => messages.set_item(i, why)?,
        }
    }
    let flat = |of: fn(&DelassusReport) -> &Vec<f64>| -> PyResult<Py<PyArray3<f64>>> {
        let row = |found: &Result<DelassusReport, String>| match found {
            Ok(report) => of(report).clone(),
            Err(_) => vec![f64::NAN; n],
        };
        let flat: Vec<f64> = all.iter().flat_map(row).collect();
        Ok(PyArray1::from_vec(py, flat)
            .reshape([count, contacts, dimension])?
            .unbind())
    };
    let status =
        |found: &Result<DelassusReport, String>| found.as_ref().map_or("invalid", |r| r.status.name());
    Ok(FrictionBatch {
        reactions: flat(|r| &r.r)?,
        velocities: flat(|r| &r.u)?,
        status: PyList::new(py, all.iter().map(status))?.unbind(),
        solved: PyArray1::from_iter(py, all.iter().map(|f| status(f) == "solved")).unbind(),
        messages: messages.unbind(),
        residual: PyArray1::from_iter(
            py,
            all.iter().map(|f| f.as_ref().map_or(f64::NAN, |r| r.residual)),
        )
        .unbind(),
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<BatchResult>()?;
    module.add_class::<BatchSensitivity>()?;
    module.add_class::<FrictionBatch>()
}
