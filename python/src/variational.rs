//! Variational inequalities over polyhedra, complementarity over cones.

use std::ops::ControlFlow;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::complementarity::{McpIteration, McpOptions};
use semismooth::cones::{Cone, ConeIteration, ConeOptions, ConeProblem, ConeSolver};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

use crate::arrays::{bound, matrix, python, start, vector};
use crate::complementarity::observed;
use crate::errors::{Run, raised};
use crate::functions::Derivative;
use crate::names::size;

/// How a variational inequality was solved, or not.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct ViResult {
    /// The solution, or the best point, shape (n,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// "solved", "empty set" and "no solution" (both proven), or a status of :class:`McpResult`.
    pub(crate) status: String,
    /// ‖x − P(x − F(x))‖_∞ with the projection P on the set, measured at x.
    pub(crate) residual: f64,
    /// Multipliers λ ≥ 0 of A x ≤ b, shape (m,).
    pub(crate) inequalities: Py<PyArray1<f64>>,
    /// Multipliers μ of E x = d, shape (k,).
    pub(crate) equations: Py<PyArray1<f64>>,
    /// Multipliers of the lower bounds, shape (n,).
    pub(crate) lower: Py<PyArray1<f64>>,
    /// Multipliers of the upper bounds, shape (n,): F(x) + Aᵀλ + Eᵀμ = lower − upper.
    pub(crate) upper: Py<PyArray1<f64>>,
    /// Where there is no solution, the direction of recession v with sup F(x)ᵀv < 0 that proves it, if one was found.
    pub(crate) ray: Option<Py<PyArray1<f64>>>,
    /// The proof of "empty set" or "no solution", or None: a dict with "multipliers" ("inequalities", "equations", "lower", "upper"),
    /// "value" (negative), "radius" (nothing smaller is a counterexample; inf where it is exact) and, of "no solution", "direction".
    pub(crate) certificate: Py<PyAny>,
    /// Whether the set is empty as stored, but not if its constants move by 2⁻⁵³ of themselves, as in 0.1 + 0.2 = 0.3.
    pub(crate) within_rounding: bool,
    /// Iterations.
    pub(crate) iterations: usize,
    /// The iterates, as those of :class:`McpResult`.
    pub(crate) history: Py<PyAny>,
}

#[pymethods]
impl ViResult {
    /// Whether the problem is solved.
    #[getter]
    fn solved(&self) -> bool {
        self.status == "solved"
    }

    fn __repr__(&self) -> String {
        format!("<ViResult: {}, residual {}>", self.status, size(self.residual))
    }
}

/// Rows of a matrix and their right-hand sides, both or neither.
fn rows_of(
    rows: Option<&Bound<'_, PyAny>>,
    right: Option<&Bound<'_, PyAny>>,
    names: [&str; 2],
) -> PyResult<Option<(Matrix, Vec<f64>)>> {
    match (rows, right) {
        (None, None) => Ok(None),
        (Some(rows), Some(right)) => Ok(Some((matrix(rows, names[0])?, vector(right, names[1])?))),
        _ => Err(PyValueError::new_err(format!(
            "{} and {} must be given together",
            names[0], names[1]
        ))),
    }
}

/// The polyhedron of bounds, A x ≤ b and E x = d.
pub(crate) fn set_of(
    [lower, upper]: [Vec<f64>; 2],
    [A, b]: [Option<&Bound<'_, PyAny>>; 2],
    [E, d]: [Option<&Bound<'_, PyAny>>; 2],
) -> PyResult<Polyhedron> {
    let mut set = Polyhedron::boxed(lower, upper).map_err(raised)?;
    if let Some((rows, right)) = rows_of(A, b, ["A", "b"])? {
        set = set.with_inequalities(rows, right).map_err(raised)?;
    }
    if let Some((rows, right)) = rows_of(E, d, ["E", "d"])? {
        set = set.with_equations(rows, right).map_err(raised)?;
    }
    Ok(set)
}

/// Solves the variational inequality over C = {lower ≤ x ≤ upper, A x ≤ b, E x = d}: x in C with F(x)ᵀ(y − x) ≥ 0 for all y in C.
///
/// Parameters
/// ----------
/// F : callable, Map, or tuple (M, q)
///     ``F(x)`` for x of shape (n,) gives n values; traced unless ``jac`` is given. (M, q) is M x + q: only then a proof that there is no
///     solution is sought.
/// x0 : array of shape (n,)
///     Start; it may lie outside of C.
/// lower, upper : number or array of shape (n,), optional
///     -inf and inf unless given.
/// A, b : matrix of shape (m, n) and array of shape (m,), optional
/// E, d : matrix of shape (k, n) and array of shape (k,), optional
/// jac, pattern, callback, **options
///     As for :func:`solve_mcp`.
///
/// Returns
/// -------
/// ViResult
///
/// >>> import semismooth as ss
/// >>> # The point of x + y ≤ 1 nearest to (1, 1).
/// >>> ss.solve_vi(lambda x: x - 1, [0.0, 0.0], A=[[1.0, 1.0]], b=[1.0]).x
/// array([0.5, 0.5])
#[pyfunction]
#[pyo3(signature = (
    F, x0, *, lower=None, upper=None, A=None, b=None, E=None, d=None, jac=None, pattern=None, callback=None, **options
))]
fn solve_vi(
    py: Python<'_>,
    F: &Bound<'_, PyAny>,
    x0: &Bound<'_, PyAny>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    A: Option<&Bound<'_, PyAny>>,
    b: Option<&Bound<'_, PyAny>>,
    E: Option<&Bound<'_, PyAny>>,
    d: Option<&Bound<'_, PyAny>>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<ViResult> {
    let mut x = start(x0, "x0")?;
    let n = x.len();
    let lower = bound(lower, n, f64::NEG_INFINITY, "lower")?;
    let upper = bound(upper, n, f64::INFINITY, "upper")?;
    let set = set_of([lower, upper], [A, b], [E, d])?;
    let derivative = Derivative::new(F, jac, pattern, &x, n)?;
    let options: McpOptions = crate::arrays::options(options, py)?;
    let report = Run::detached(py, |run| {
        let problem = Vi::new(derivative.function(run, n), set).map_err(raised)?;
        let mut flow = ControlFlow::Continue(());
        let observe = |iteration: &McpIteration| observed(run, callback.as_ref(), iteration, &mut flow);
        let mut solver = ViSolver::new(options);
        solver.solve_observed(&problem, &mut x, observe).map_err(raised)
    })?;
    let array = |v: &[f64]| PyArray1::from_slice(py, v).unbind();
    Ok(ViResult {
        x: array(&x),
        status: report.status.name().to_owned(),
        residual: report.residual,
        inequalities: array(&report.multipliers.inequalities),
        equations: array(&report.multipliers.equations),
        lower: array(&report.multipliers.lower),
        upper: array(&report.multipliers.upper),
        ray: report.ray.as_ref().map(|ray| array(&ray.direction)),
        certificate: match (&report.ray, &report.infeasibility) {
            (Some(ray), _) => python(py, ray)?.unbind(),
            (None, Some(empty)) => python(py, empty)?.unbind(),
            (None, None) => py.None(),
        },
        within_rounding: report.within_rounding,
        iterations: report.mcp.iterations,
        history: python(py, &report.mcp.history)?.unbind(),
    })
}

/// How a complementarity problem over cones was solved, or not.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct ConeResult {
    /// The solution, or the best point, shape (n,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// "solved", "no solution" (proven by ``ray``), "stalled", "iteration limit", "time limit", "evaluation failure" or "interrupted".
    pub(crate) status: String,
    /// ‖x − P(x − F(x))‖_∞ with the projection P on the cones.
    pub(crate) residual: f64,
    /// The error that is compared with the tolerance, scaled for each cone.
    pub(crate) error: f64,
    /// Where there is no solution, v in K with −Mᵀv in K* and qᵀv = −1 up to rounding, shape (n,).
    pub(crate) ray: Option<Py<PyArray1<f64>>>,
    /// What ``ray`` proves, rounding included: there is no solution with ‖x‖₂ below this radius; inf where it is exact.
    pub(crate) radius: Option<f64>,
    /// Iterations.
    pub(crate) iterations: usize,
    /// The iterates, each a dict of "attempt", "merit", "mu" and "damping".
    pub(crate) history: Py<PyAny>,
}

#[pymethods]
impl ConeResult {
    /// Whether the problem is solved.
    #[getter]
    fn solved(&self) -> bool {
        self.status == "solved"
    }

    fn __repr__(&self) -> String {
        format!("<ConeResult: {}, residual {}>", self.status, size(self.residual))
    }
}

/// Solves x ∈ K, F(x) ∈ K*, xᵀF(x) = 0 for a product K of cones.
///
/// Parameters
/// ----------
/// F : callable, Map, or tuple (M, q)
///     As for :func:`solve_vi`.
/// cones : list of (str, int)
///     The factors of K and their dimensions, which partition x in this order: "free", "nonnegative", "second-order" (x₀ ≥ ‖(x₁, …)‖₂),
///     or "semidefinite" with the order k of the matrices, k (k + 1)/2 variables: the upper triangle column by column, entries off the
///     diagonal times √2.
/// x0 : array of shape (n,), optional
///     Start; 0 unless given.
/// jac, pattern, callback
///     As for :func:`solve_mcp`.
/// **options
///     tolerance, max_iterations, max_time (60 seconds; None: no limit), strategies and restarts of ConeOptions.
///
/// Returns
/// -------
/// ConeResult
///
/// >>> import semismooth as ss
/// >>> # The point of t ≥ ‖v‖ nearest to (0, 3, 4).
/// >>> ss.solve_cone(lambda x: x - [0, 3, 4], [("second-order", 3)]).x.round(9)
/// array([2.5, 1.5, 2. ])
#[pyfunction]
#[pyo3(signature = (F, cones, x0=None, *, jac=None, pattern=None, callback=None, **options))]
fn solve_cone(
    py: Python<'_>,
    F: &Bound<'_, PyAny>,
    cones: Vec<(String, usize)>,
    x0: Option<&Bound<'_, PyAny>>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<ConeResult> {
    let cone = |(name, dimension): (String, usize)| match name.as_str() {
        "free" => Ok(Cone::Free(dimension)),
        "nonnegative" => Ok(Cone::Nonnegative(dimension)),
        "second-order" => Ok(Cone::SecondOrder(dimension)),
        "semidefinite" => Ok(Cone::Semidefinite(dimension)),
        _ => Err(PyValueError::new_err(format!(
            "the cone \"{name}\" is not known: write \"free\", \"nonnegative\", \"second-order\" or \"semidefinite\""
        ))),
    };
    let cones: Vec<Cone> = cones.into_iter().map(cone).collect::<PyResult<_>>()?;
    let n = cones.iter().map(|c| c.len()).sum();
    let mut x = x0.map_or_else(|| Ok(vec![0.0; n]), |x0| start(x0, "x0"))?;
    let derivative = Derivative::new(F, jac, pattern, &x, n)?;
    let options: ConeOptions = crate::arrays::options(options, py)?;
    let report = Run::detached(py, |run| {
        let problem = ConeProblem::new(derivative.function(run, n), cones).map_err(raised)?;
        let mut flow = ControlFlow::Continue(());
        let observe = |iteration: &ConeIteration| observed(run, callback.as_ref(), iteration, &mut flow);
        let solver = ConeSolver::new(options);
        solver.solve_observed(&problem, &mut x, observe).map_err(raised)
    })?;
    Ok(ConeResult {
        x: PyArray1::from_vec(py, x).unbind(),
        status: report.status.name().to_owned(),
        residual: report.residual,
        error: report.error,
        radius: report.ray.as_ref().map(|ray| ray.radius),
        ray: report
            .ray
            .map(|ray| PyArray1::from_vec(py, ray.direction).unbind()),
        iterations: report.iterations,
        history: python(py, &report.history)?.unbind(),
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<ViResult>()?;
    module.add_class::<ConeResult>()?;
    module.add_function(wrap_pyfunction!(solve_vi, module)?)?;
    module.add_function(wrap_pyfunction!(solve_cone, module)?)
}
