//! Functions of solutions, minimised over parameters.

use std::ops::ControlFlow;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::complementarity::{Mcp, McpIteration};
use semismooth::optimise::{Bundle, BundleIteration, BundleOptions, BundleReport, Implicit};
use semismooth::run::Status;

use crate::arrays::{bound, python, start};
use crate::complementarity::observed;
use crate::errors::{Run, raised};
use crate::map::{TracedFunction, trace_two};
use crate::names::size;
use crate::variational::set_of;

/// What is known of the parameters that :func:`minimise` found.
///
/// ``solved`` is true exactly if they are stationary in the sense of Clarke, to the tolerance: a convex combination of elements of generalised
/// gradients, at points at most ``radius`` away, and a normal of the constraints have the small sum ``subgradient``. That does not say that they
/// are a minimum.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct MinimiseResult {
    /// The parameters, shape (k,).
    pub(crate) params: Py<PyArray1<f64>>,
    /// The solution x there, shape (n,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// f there.
    pub(crate) value: f64,
    /// "solved", "stalled", "inaccurate", "evaluation failure", "iteration limit", "time limit" or "interrupted".
    pub(crate) status: String,
    /// How the run ended, in a sentence; with the last reason why f had no gradient at a point, where it ended early.
    pub(crate) message: String,
    /// The aggregate subgradient with the normal of the constraints, shape (k,).
    pub(crate) subgradient: Py<PyArray1<f64>>,
    /// Its Euclidean norm.
    pub(crate) subgradient_norm: f64,
    /// The norm of the largest components of gradients in the run, which its components are compared with one by one.
    pub(crate) gradient_norm: f64,
    /// The aggregate linearisation error.
    pub(crate) error: f64,
    /// The points of the gradients are at most this far from ``params``.
    pub(crate) radius: f64,
    /// Multipliers of the constraints: a dict of "inequalities", "equations", "lower" and "upper".
    pub(crate) multipliers: Py<PyAny>,
    /// Iterations.
    pub(crate) iterations: usize,
    /// Evaluations of f with its gradient, a solution of the problem each.
    pub(crate) evaluations: usize,
    /// Points at which f had no value or gradient.
    pub(crate) failures: usize,
    /// The iterations, each a dict of "index", "value", "subgradient_norm", "error", "weight", "evaluations" and "step".
    pub(crate) history: Py<PyAny>,
    /// Wall-clock time in seconds.
    pub(crate) time: f64,
}

impl MinimiseResult {
    fn new(py: Python<'_>, params: &[f64], report: &BundleReport) -> PyResult<Self> {
        Ok(Self {
            params: PyArray1::from_slice(py, params).unbind(),
            x: PyArray1::from_slice(py, &report.state).unbind(),
            value: report.value,
            status: report.status.name().to_owned(),
            message: report.to_string(),
            subgradient: PyArray1::from_slice(py, &report.subgradient).unbind(),
            subgradient_norm: report.subgradient_norm,
            gradient_norm: report.gradient_norm,
            error: report.error,
            radius: report.radius,
            multipliers: python(py, &report.multipliers)?.unbind(),
            iterations: report.iterations,
            evaluations: report.evaluations,
            failures: report.failures,
            history: python(py, &report.history)?.unbind(),
            time: report.time.as_secs_f64(),
        })
    }
}

#[pymethods]
impl MinimiseResult {
    /// Whether the parameters are stationary in the sense of Clarke, to the tolerance.
    #[getter]
    fn solved(&self) -> bool {
        self.status == Status::Solved.name()
    }

    fn __repr__(&self) -> String {
        let status = match self.solved() {
            true => "stationary",
            false => &self.status,
        };
        format!(
            "<MinimiseResult: {status}, value {}, subgradient {}>",
            self.value,
            size(self.subgradient_norm)
        )
    }
}

/// Minimises f(x(p), p) over parameters p in {p_lower ≤ p ≤ p_upper, A p ≤ b, E p = d}, where x(p) solves the mixed complementarity problem
/// of F(x, p) and the bounds lower ≤ x ≤ upper.
///
/// A proximal bundle method with gradients by one adjoint solve for each solution. It is local: the result is stationary in the sense of Clarke,
/// to the tolerance; other starts may lead to better points. Where the problem of x has several solutions, x0 chooses among them.
///
/// Parameters
/// ----------
/// f : callable
///     ``f(x, p)`` for x of shape (n,) and p of shape (k,) gives a number. It is traced once, as F: see :func:`trace`. Both may have kinks.
/// F : callable
///     ``F(x, p)`` gives n values.
/// x0 : array of shape (n,), or number
///     Start of the first solution.
/// p0 : array of shape (k,), or number
///     Start of the parameters, which is projected on their constraints.
/// lower, upper : number or array of shape (n,), optional
///     Bounds of x, as in :func:`solve_mcp`; -inf and inf unless given.
/// p_lower, p_upper : number or array of shape (k,), optional
/// A, b : matrix of shape (m, k) and array of shape (m,), optional
/// E, d : matrix of shape (l, k) and array of shape (l,), optional
/// callback : callable, optional
///     Called with a dict after each iteration; a true value stops the run.
/// **options
///     ``tolerance`` (1e-6), ``value_tolerance`` (1e-9), ``step``, ``max_iterations`` (500), ``max_time`` (seconds), ``max_bundle`` (60).
///
/// Returns
/// -------
/// MinimiseResult
///
/// >>> import semismooth as ss
/// >>> # A leader sells p, the follower q: 0 ≤ q ⟂ 2 q + p − 10 ≥ 0.
/// >>> found = ss.minimise(lambda q, p: p * (p + q - 10), lambda q, p: 2 * q + p - 10, 1.0, 1.0, lower=0.0, p_lower=0.0, p_upper=20.0)
/// >>> found.solved, found.params.round(4), found.x.round(4)
/// (True, array([5.]), array([2.5]))
#[pyfunction]
#[pyo3(signature = (
    f, F, x0, p0, lower=None, upper=None, *, p_lower=None, p_upper=None, A=None, b=None, E=None, d=None, callback=None, **options
))]
fn minimise(
    py: Python<'_>,
    f: &Bound<'_, PyAny>,
    F: &Bound<'_, PyAny>,
    x0: &Bound<'_, PyAny>,
    p0: &Bound<'_, PyAny>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    p_lower: Option<&Bound<'_, PyAny>>,
    p_upper: Option<&Bound<'_, PyAny>>,
    A: Option<&Bound<'_, PyAny>>,
    b: Option<&Bound<'_, PyAny>>,
    E: Option<&Bound<'_, PyAny>>,
    d: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<MinimiseResult> {
    let (x0, p0) = (start(x0, "x0")?, start(p0, "p0")?);
    let (n, k) = (x0.len(), p0.len());
    let lower = bound(lower, n, f64::NEG_INFINITY, "lower")?;
    let upper = bound(upper, n, f64::INFINITY, "upper")?;
    let bounds = [
        bound(p_lower, k, f64::NEG_INFINITY, "p_lower")?,
        bound(p_upper, k, f64::INFINITY, "p_upper")?,
    ];
    let set = set_of(bounds, [A, b], [E, d])?;
    let options: BundleOptions = crate::arrays::options(options, py)?;
    let traced = |function, what: &str, values: usize| {
        let map = trace_two(py, function, n, k)?;
        match map.num_residuals() {
            found if found == values => Ok(map),
            found => Err(PyValueError::new_err(format!(
                "{what} must give {values} values; it gives {found}"
            ))),
        }
    };
    let (objective, function) = (traced(f, "f", 1)?, traced(F, "F", n)?);
    let (params, report) = Run::detached(py, |run| {
        let natural = function.natural(&lower, &upper).free();
        let problem = Mcp::with_parameters(TracedFunction(function.free()), lower, upper).map_err(raised)?;
        let mut f = Implicit::new(problem, natural, TracedFunction(objective.free()), &x0).map_err(raised)?;
        let mut flow = ControlFlow::Continue(());
        let observe = |iteration: &BundleIteration| observed(run, callback.as_ref(), iteration, &mut flow);
        let mut inner = |_: &McpIteration| run.poll();
        Bundle::new(options)
            .minimise_observed(&set, &p0, &mut f.observed(&mut inner), observe)
            .map_err(raised)
    })?;
    MinimiseResult::new(py, &params, &report)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<MinimiseResult>()?;
    module.add_function(wrap_pyfunction!(minimise, module)?)
}
