//! Linear and mixed complementarity problems, Lemke's method.

use std::ops::ControlFlow;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions, LemkePivot};
use semismooth::complementarity::{
    BoundState, Mcp, McpFunction, McpIteration, McpOptions, McpReport, McpSolver,
};
use semismooth::newton::Newton;
use semismooth::run::Status;
use serde::Serialize;

use crate::arrays::{bound, counted, matrix, python, start, vector};
use crate::batch::{self, dimensions};
use crate::errors::{Run, raised};
use crate::functions::Derivative;
use crate::names::size;
use crate::saving::{data, data_of, state_of};
use crate::sensitivity::{Parametric, Sensitivity};

/// The linear complementarity problem of a square matrix M, shape (n, n), dense or scipy.sparse, and a vector q, shape (n,).
///
/// Without bounds: z ≥ 0, w = M z + q ≥ 0, zᵀw = 0. With bounds l ≤ z ≤ u (numbers, or arrays of shape (n,); ±inf where there is none):
/// w ≥ 0 where z = l, w ≤ 0 where z = u, w = 0 between.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Lcp {
    pub(crate) problem: semismooth::complementarity::Lcp,
}

impl Lcp {
    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        state_of(py, &[("problem", data_of(py, &slf.get().problem)?)])
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let problem = data(state, "problem")?;
        Ok(Bound::new(py, Self { problem })?.into_any())
    }
}

#[pymethods]
impl Lcp {
    #[new]
    #[pyo3(signature = (M, q, lower=None, upper=None))]
    fn new(
        M: &Bound<'_, PyAny>,
        q: &Bound<'_, PyAny>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let q = vector(q, "q")?;
        let lower = bound(lower, q.len(), 0.0, "lower")?;
        let upper = bound(upper, q.len(), f64::INFINITY, "upper")?;
        let problem =
            semismooth::complementarity::Lcp::boxed(matrix(M, "M")?, q, lower, upper).map_err(raised)?;
        Ok(Self { problem })
    }

    fn __len__(&self) -> usize {
        self.problem.len()
    }

    fn __repr__(&self) -> String {
        format!("<Lcp of {}>", counted(self.problem.len(), "unknown"))
    }
}

/// How a complementarity problem was solved, or not: ``solved`` is true exactly if the error of ``x`` was measured and found below the
/// tolerance.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct McpResult {
    /// The solution, or the point with the smallest natural residual, shape (n,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// "solved", "at rounding", "stationary", "unbounded", "no solution", "stalled", "iteration limit", "time limit", "evaluation failure"
    /// or "interrupted".
    pub(crate) status: String,
    /// The status in a sentence.
    pub(crate) message: String,
    /// Natural residual max |xᵢ − mid(lᵢ, uᵢ, xᵢ − Fᵢ(x))|, in the units of x and F.
    pub(crate) residual: f64,
    /// Largest error of a component relative to the terms of its row; it does not depend on units.
    pub(crate) error: f64,
    /// Where each component is: "lower", "interior" or "upper".
    pub(crate) states: Vec<String>,
    /// Iterations, over all strategies.
    pub(crate) iterations: usize,
    /// Evaluations of F.
    pub(crate) evaluations: usize,
    /// Evaluations of its Jacobian.
    pub(crate) jacobians: usize,
    /// Factorisations.
    pub(crate) factorisations: usize,
    /// The strategy that finished.
    pub(crate) strategy: String,
    /// The strategies that failed before it, each a dict of "strategy", "outcome", "residual" and "iterations".
    pub(crate) fallbacks: Vec<Py<PyDict>>,
    /// The iterates, each a dict of "index", "strategy", "residual", "merit", "step", "damping" and "sites_changed";
    /// ``pandas.DataFrame(result.history)`` is a table.
    pub(crate) history: Py<PyAny>,
    /// Where the status is "no solution", the vector v that proves it (empty where enumeration did): a recession direction of the box
    /// [lower, upper], so that every solution has vᵀF(x) ≥ 0, yet sup vᵀF(x) < 0 over the box.
    pub(crate) certificate: Py<PyArray1<f64>>,
    /// Wall-clock time in seconds.
    pub(crate) time: f64,
    /// The solution as a function of ``params``, a :class:`Sensitivity`; None without ``params``, and where nothing was solved.
    pub(crate) sensitivity: Option<Py<Sensitivity>>,
}

impl McpResult {
    fn new(py: Python<'_>, x: &[f64], report: &McpReport) -> PyResult<Self> {
        let fallbacks = report.fallbacks.iter().map(|f| {
            let dict = PyDict::new(py);
            dict.set_item("strategy", f.strategy.name())?;
            dict.set_item("outcome", f.outcome.name())?;
            dict.set_item("residual", f.residual)?;
            dict.set_item("iterations", f.iterations)?;
            Ok(dict.unbind())
        });
        let state = |s: &BoundState| match s {
            BoundState::Lower => "lower".to_owned(),
            BoundState::Upper => "upper".to_owned(),
            _ => "interior".to_owned(),
        };
        Ok(Self {
            x: PyArray1::from_slice(py, x).unbind(),
            status: report.status.name().to_owned(),
            message: report.status.to_string(),
            residual: report.residual,
            error: report.error,
            states: report.states.iter().map(state).collect(),
            iterations: report.iterations,
            evaluations: report.evaluations,
            jacobians: report.jacobians,
            factorisations: report.factorisations,
            strategy: report.strategy.name().to_owned(),
            fallbacks: fallbacks.collect::<PyResult<_>>()?,
            history: python(py, &report.history)?.unbind(),
            certificate: PyArray1::from_slice(py, &report.certificate).unbind(),
            time: report.time.as_secs_f64(),
            sensitivity: None,
        })
    }

    /// With the derivatives in parameters, where it is solved.
    fn with_sensitivity(
        mut self,
        py: Python<'_>,
        parametric: Option<Parametric>,
        (lower, upper): (&[f64], &[f64]),
        x: &[f64],
    ) -> PyResult<Self> {
        if let (Some(parametric), true) = (parametric, self.status == "solved") {
            self.sensitivity = Some(Py::new(py, parametric.sensitivity(py, lower, upper, x)?)?);
        }
        Ok(self)
    }

    fn derivatives(&self) -> PyResult<&Sensitivity> {
        let own = self.sensitivity.as_ref().map(|s| s.get());
        own.ok_or_else(|| {
            PyValueError::new_err("there are derivatives of solved problems with `params` only: F(x, p)")
        })
    }
}

#[pymethods]
impl McpResult {
    /// Whether the problem is solved.
    #[getter]
    fn solved(&self) -> bool {
        self.status == "solved"
    }

    /// Whether x is a differentiable function of ``params`` here: True, False or None (not known); see :class:`Sensitivity`.
    #[getter]
    fn differentiable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        self.derivatives()?.differentiable(py)
    }

    /// The directional derivative of x along a change of ``params``: :meth:`Sensitivity.jvp`.
    fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.derivatives()?.jvp(dp)
    }

    /// The gradient in ``params`` of a function of x with this gradient: :meth:`Sensitivity.vjp`.
    fn vjp<'py>(&self, dx: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.derivatives()?.vjp(dx)
    }

    /// The derivative of x in ``params``, shape (n, k): :meth:`Sensitivity.derivative`.
    fn derivative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.derivatives()?.derivative(py)
    }

    /// How far along dp the piece holds: :meth:`Sensitivity.valid_until`.
    #[pyo3(signature = (dp, horizon=1.0))]
    fn valid_until(&self, dp: &Bound<'_, PyAny>, horizon: f64) -> PyResult<f64> {
        self.derivatives()?.valid_until(dp, horizon)
    }

    fn __repr__(&self) -> String {
        format!(
            "<McpResult: {}, residual {}, {}>",
            self.message,
            size(self.residual),
            counted(self.iterations, "iteration")
        )
    }
}

/// Solves the linear complementarity problem 0 ≤ z ⟂ M z + q ≥ 0, or with bounds lower ≤ z ≤ upper.
///
/// Parameters
/// ----------
/// M : array or scipy.sparse matrix of shape (n, n)
/// q : array of shape (n,)
/// lower, upper : number or array of shape (n,), optional
///     Bounds, ±inf where there is none; 0 and inf unless given.
/// x0 : array of shape (n,), optional
///     Start; 0, or the nearest point within the bounds.
/// callback : callable, optional
///     Called with a dict on each iterate, and with residual and merit NaN for points of paths, during enumeration, and for starts at
///     which F is not finite; returns True to stop.
/// verbose, progress : bool, optional
///     A line printed for each iterate; a bar that counts them, with tqdm where it is installed.
/// **options
///     tolerance (1e-10, relative to the terms of each row), acceptable (1e-8), max_iterations, max_time (60 seconds; None: no limit),
///     strategies (a list of names such as "Newton", "enumeration"), fallbacks, max_nodes, restarts and others of McpOptions.
///
/// Returns
/// -------
/// McpResult
///     With a leading dimension of M or q, (members, n, n) or (members, n), and of bounds and x0 where these differ, a :class:`BatchResult`:
///     all members are solved on all cores, failures marked one by one; max_time is that of a member, and there is no callback.
///
/// >>> import semismooth as ss
/// >>> ss.solve_lcp([[2.0, 1.0], [1.0, 2.0]], [-5.0, -1.0]).x
/// array([2.5, 0. ])
/// >>> ss.solve_lcp([[2.0, 1.0], [1.0, 2.0]], [[-5.0, -1.0], [-1.0, -5.0]]).x
/// array([[2.5, 0. ],
///        [0. , 2.5]])
#[pyfunction]
#[pyo3(signature = (M, q, lower=None, upper=None, *, x0=None, callback=None, **options))]
fn solve_lcp(
    py: Python<'_>,
    M: &Bound<'_, PyAny>,
    q: &Bound<'_, PyAny>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    x0: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<PyAny>> {
    let batched = dimensions(Some(M)) > 2 || [Some(q), lower, upper, x0].iter().any(|v| dimensions(*v) > 1);
    if batched {
        no_callback(callback.as_ref())?;
        let found = batch::lcps(py, [M, q], [lower, upper], x0, options)?;
        return Ok(Py::new(py, found)?.into_any());
    }
    let Lcp { problem } = Lcp::new(M, q, lower, upper)?;
    let mut x = x0.map_or_else(|| Ok(vec![0.0; problem.len()]), |x0| start(x0, "x0"))?;
    let options = crate::arrays::options(options, py)?;
    let report = Run::detached(py, |run| {
        solve(run, problem.mcp(), &mut x, options, callback.as_ref())
    })?;
    Ok(Py::new(py, McpResult::new(py, &x, &report)?)?.into_any())
}

fn no_callback(callback: Option<&Py<PyAny>>) -> PyResult<()> {
    match callback {
        Some(_) => Err(PyTypeError::new_err(
            "a batch is solved on all cores without a callback",
        )),
        None => Ok(()),
    }
}

fn solve<F: McpFunction>(
    run: &Run,
    problem: &Mcp<F>,
    x: &mut [f64],
    options: McpOptions,
    callback: Option<&Py<PyAny>>,
) -> PyResult<McpReport> {
    let mut solver = McpSolver::new(options);
    let mut flow = ControlFlow::Continue(());
    let observe = |iteration: &McpIteration| observed(run, callback, iteration, &mut flow);
    solver
        .solve_observed(problem, x, observe)
        .cloned()
        .map_err(raised)
}

/// Calls a callback, which stops the run by returning a true value. It is not called again then, although solvers report one more iterate.
pub(crate) fn observed(
    run: &Run,
    callback: Option<&Py<PyAny>>,
    data: &impl Serialize,
    flow: &mut ControlFlow<()>,
) -> ControlFlow<()> {
    if let (Some(callback), true) = (callback, flow.is_continue()) {
        let stop = run.call(|py| callback.bind(py).call1((python(py, data)?,))?.is_truthy());
        if stop.unwrap_or(true) {
            *flow = ControlFlow::Break(());
        }
    }
    match run.poll() {
        ControlFlow::Continue(()) => *flow,
        stop => stop,
    }
}

/// Solves the mixed complementarity problem of F and its bounds: lower ≤ x ≤ upper with Fᵢ(x) ≥ 0 where xᵢ = lowerᵢ, Fᵢ(x) ≤ 0 where
/// xᵢ = upperᵢ, and Fᵢ(x) = 0 between.
///
/// Parameters
/// ----------
/// F : callable, Map, or tuple (M, q)
///     ``F(x)`` for x of shape (n,) gives n values. Unless ``jac`` is given it is traced: see :func:`trace`. (M, q) is M x + q.
/// lower, upper : number, array of shape (n,), or None
///     Bounds, ±inf where there is none; None: no bound. F is evaluated within them only.
/// x0 : array of shape (n,), or number
///     Start.
/// jac : callable or "differences", optional
///     ``jac(x)``, of shape (n, n), dense or scipy.sparse: F is then called, not traced. "differences": central differences of F.
/// pattern : array or scipy.sparse matrix of shape (n, n), optional
///     The sparsity pattern of the Jacobian: the stored entries of a sparse matrix, zeros among them, or all entries of an array.
///     Default: that of ``jac(x0)`` if it is sparse; else full.
/// params : array of shape (k,), or number, optional
///     Parameters p of a function ``F(x, p)``, which is traced once: the result then has derivatives of x in p.
/// callback, **options
///     As for :func:`solve_lcp`.
///
/// Returns
/// -------
/// McpResult
///     With a leading dimension of params, (members, k), or of x0, (members, n), and of bounds where these differ, a :class:`BatchResult`: F
///     is traced once, and all members are solved on all cores, failures marked one by one.
///
/// >>> import semismooth as ss
/// >>> result = ss.solve_mcp(lambda x: (x - 1) ** 2 - 1.01, 0, float("inf"), [0.0])
/// >>> result.status, result.x.round(6)
/// ('solved', array([2.004988]))
/// >>> result = ss.solve_mcp(lambda x, p: x**2 - p, 0, float("inf"), 1.0, params=4.0)
/// >>> result.x, result.differentiable, result.derivative()
/// (array([2.]), True, array([[0.25]]))
#[pyfunction]
#[pyo3(signature = (F, lower, upper, x0, jac=None, *, pattern=None, params=None, callback=None, **options))]
fn solve_mcp(
    py: Python<'_>,
    F: &Bound<'_, PyAny>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    x0: &Bound<'_, PyAny>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    params: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<PyAny>> {
    if dimensions(params) > 1 || [Some(x0), lower, upper].iter().any(|v| dimensions(*v) > 1) {
        no_callback(callback.as_ref())?;
        if jac.is_some() || pattern.is_some() {
            return Err(PyTypeError::new_err(
                "the function of a batch is traced: leave out jac and pattern",
            ));
        }
        let found = batch::mcps(py, F, [lower, upper], x0, params, options)?;
        return Ok(Py::new(py, found)?.into_any());
    }
    let mut x = start(x0, "x0")?;
    let n = x.len();
    let lower = bound(lower, n, f64::NEG_INFINITY, "lower")?;
    let upper = bound(upper, n, f64::INFINITY, "upper")?;
    let (parametric, derivative) = with_params(F, jac, pattern, params, &x)?;
    let options = crate::arrays::options(options, py)?;
    let report = Run::detached(py, |run| {
        let (lower, upper) = (lower.clone(), upper.clone());
        let problem = Mcp::new(derivative.function(run, n), lower, upper).map_err(raised)?;
        solve(run, &problem, &mut x, options, callback.as_ref())
    })?;
    let result = McpResult::new(py, &x, &report)?.with_sensitivity(py, parametric, (&lower, &upper), &x)?;
    Ok(Py::new(py, result)?.into_any())
}

/// F with its derivative, at the parameters if there are any.
fn with_params(
    function: &Bound<'_, PyAny>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    params: Option<&Bound<'_, PyAny>>,
    x0: &[f64],
) -> PyResult<(Option<Parametric>, Derivative)> {
    let n = x0.len();
    let Some(params) = params else {
        return Ok((None, Derivative::new(function, jac, pattern, x0, n)?));
    };
    let parametric = Parametric::new(function, params, n, jac.is_some() || pattern.is_some())?;
    let map = Py::new(function.py(), parametric.fixed())?;
    Ok((Some(parametric), Derivative::Formula(map)))
}

/// Solves the square equation H(x) = 0, which may have kinks.
///
/// Parameters
/// ----------
/// H : callable, Map, or tuple (M, q)
///     ``H(x)`` for x of shape (n,) gives n values. Unless ``jac`` is given it is traced: see :func:`trace`. (M, q) is M x + q.
/// x0 : array of shape (n,), or number
///     Start.
/// jac, pattern, params, callback, **options
///     As for :func:`solve_mcp`. A function that is called, not traced, may have kinks, too: its Jacobian is then that of any of its pieces.
///
/// Returns
/// -------
/// McpResult
///     ``solved`` is true exactly if the error at ``x`` was measured and found below the tolerance.
///
/// >>> import numpy as np
/// >>> import semismooth as ss
/// >>> result = ss.solve(lambda x: np.maximum(x, 2 * x) - 3, -1.0)
/// >>> result.solved, result.x
/// (True, array([1.5]))
#[pyfunction]
#[pyo3(signature = (H, x0, jac=None, *, pattern=None, params=None, callback=None, **options))]
#[pyo3(name = "solve")]
fn solve_equation(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    x0: &Bound<'_, PyAny>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    params: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<McpResult> {
    let x0 = start(x0, "x0")?;
    let n = x0.len();
    let (parametric, derivative) = with_params(H, jac, pattern, params, &x0)?;
    let options: McpOptions = crate::arrays::options(options, py)?;
    let [lower, upper] = [f64::NEG_INFINITY, f64::INFINITY].map(|bound| vec![bound; n]);
    let (x, report) = Run::detached(py, |run| {
        let (lower, upper) = (lower.clone(), upper.clone());
        let problem = Mcp::new(derivative.function(run, n), lower, upper).map_err(raised)?;
        let mut x = x0.clone();
        let report = solve(run, &problem, &mut x, options.clone(), callback.as_ref())?;
        let Derivative::Formula(map) = &derivative else {
            return Ok((x, report));
        };
        let over = matches!(report.status, Status::Interrupted | Status::TimeLimit);
        if report.status == Status::Solved || over || run.is_broken() {
            return Ok((x, report));
        }
        // Newton's method for the pieces themselves; its point is judged as those of the others are.
        let mut second = x0.clone();
        let newton = Newton::default().solve(&map.get().traced(run), &mut second);
        if newton.is_err() || run.is_broken() {
            return Ok((x, report));
        }
        let judged = solve(run, &problem, &mut second, options, None)?;
        match judged.status {
            Status::Solved => Ok((second, judged)),
            _ => Ok((x, report)),
        }
    })?;
    let mut result = McpResult::new(py, &x, &report)?;
    if let (false, Derivative::Formula(map)) = (report.status == Status::Solved, &derivative) {
        let map = map.get();
        if let Some(jump) = py.detach(|| map.jump([&x0, &x])) {
            result.message = format!("{}; {jump}", result.message);
        }
    }
    result.with_sensitivity(py, parametric, (&lower, &upper), &x)
}

/// Where the path of Lemke's method ended.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct LemkeResult {
    /// The solution, or the end of the path, shape (n,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// "solved", "no solution" (proven by ``ray``), "ray", "iteration limit" (of pivots), "interrupted" or "inaccurate".
    pub(crate) status: String,
    /// The status in a sentence.
    pub(crate) message: String,
    /// Natural residual of x.
    pub(crate) residual: f64,
    /// Number of pivots.
    pub(crate) pivots: usize,
    /// Direction of the ray on which the path ended, shape (n,), or None.
    pub(crate) ray: Option<Py<PyArray1<f64>>>,
    /// The pivots, each a dict of "index", "path" and "cover", the value of the covering variable before it.
    pub(crate) history: Py<PyAny>,
}

#[pymethods]
impl LemkeResult {
    /// Whether the problem is solved.
    #[getter]
    fn solved(&self) -> bool {
        self.status == "solved"
    }

    fn __repr__(&self) -> String {
        format!(
            "<LemkeResult: {}, {}>",
            self.message,
            counted(self.pivots, "pivot")
        )
    }
}

/// Lemke's complementary pivoting for the linear complementarity problem of M and q, with bounds if given.
///
/// Parameters
/// ----------
/// M : array or scipy.sparse matrix of shape (n, n), n ≤ 20 000
/// q : array of shape (n,)
/// lower, upper : number or array of shape (n,), optional
///     0 and inf unless given.
/// covering : array of shape (n,), optional
///     The covering vector, positive: the path depends on it. Ones unless given.
/// max_pivots : int, optional
///     50 n + 1000 on up to five paths unless given.
/// label : int, optional
///     The method of Lemke and Howson: from the solution 0 of a problem with q ≥ 0 along the path on which the
///     unknown of this number need not be complementary. Games with payoffs A, B > 0: M = [[0, -A], [-B.T, 0]], q = 1.
///
/// Returns
/// -------
/// LemkeResult
///
/// >>> import semismooth as ss
/// >>> ss.lemke([[2.0, 1.0], [1.0, 2.0]], [-5.0, -1.0]).x
/// array([2.5, 0. ])
#[pyfunction]
#[pyo3(signature = (M, q, lower=None, upper=None, *, covering=None, max_pivots=None, label=None))]
fn lemke(
    py: Python<'_>,
    M: &Bound<'_, PyAny>,
    q: &Bound<'_, PyAny>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    covering: Option<&Bound<'_, PyAny>>,
    max_pivots: Option<usize>,
    label: Option<usize>,
) -> PyResult<LemkeResult> {
    let Lcp { problem } = Lcp::new(M, q, lower, upper)?;
    let mut options = LemkeOptions::default();
    options.max_pivots = max_pivots;
    options.label = label;
    options.covering = covering.map(|c| vector(c, "covering")).transpose()?;
    let (mut x, mut history) = (vec![0.0; problem.len()], Vec::new());
    let mut solver = Lemke::new(options);
    let report = Run::detached(py, |run| {
        let observe = |pivot: &LemkePivot| {
            history.push(*pivot);
            run.poll()
        };
        solver.solve_observed(&problem, &mut x, observe).map_err(raised)
    })?;
    let on_ray = matches!(report.status, Status::NoSolution | Status::Ray);
    let ray = solver.ray().filter(|_| on_ray);
    Ok(LemkeResult {
        x: PyArray1::from_vec(py, x).unbind(),
        status: report.status.name().to_owned(),
        message: report.status.to_string(),
        residual: report.residual,
        pivots: report.pivots,
        ray: ray.map(|ray| PyArray1::from_slice(py, ray).unbind()),
        history: python(py, &history)?.unbind(),
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Lcp>()?;
    module.add_class::<McpResult>()?;
    module.add_class::<LemkeResult>()?;
    module.add_function(wrap_pyfunction!(solve_equation, module)?)?;
    module.add_function(wrap_pyfunction!(solve_lcp, module)?)?;
    module.add_function(wrap_pyfunction!(solve_mcp, module)?)?;
    module.add_function(wrap_pyfunction!(lemke, module)?)
}
