//! Diagrams: all solutions connected to given starts.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::continuation::{self as core, ContinuationOptions, DiagramOptions};

use crate::arrays::rows;
use crate::contact::point;
use crate::continuation::{EVERYWHERE, Given, Names, Problem};
use crate::errors::{Run, raised};
use crate::events::Fold;

/// A point of a diagram where curves meet, bend or end.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Vertex {
    /// The point (y, parameter), shape (m,).
    x: Py<PyArray1<f64>>,
    /// The parameter.
    parameter: f64,
    /// "start", "pass-through", "fold", "vertical segment", "branching", "branch point", "end", "isolated", "bound", or why the curve was not
    /// followed further.
    kind: &'static str,
    /// Indices of the edges that leave along its arms; None for an arm that was not followed.
    edges: Vec<Option<usize>>,
    /// Whether no arm is missing, within tolerances.
    complete: bool,
}

#[pymethods]
impl Vertex {
    fn __repr__(&self) -> String {
        format!("<Vertex: {} at parameter {:?}>", self.kind, self.parameter)
    }
}

/// A piece of curve between two vertices, on one selection.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Edge {
    /// Its points from end to end, shape (k, m).
    points: Py<PyArray2<f64>>,
    /// The piece of each site on it, by name.
    pieces: Vec<String>,
    /// Indices of the vertices at its ends; equal for a closed curve.
    ends: (usize, usize),
    /// Signs of the determinant of ∂H/∂y along it, each change once.
    det_signs: Vec<i8>,
    /// Whether the parameter is constant along it: a continuum of solutions.
    vertical: bool,
    /// Its arclength.
    arclength: f64,
}

/// All solutions connected to given starts, as a graph.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Diagram {
    found: core::Diagram,
    problem: Arc<Problem>,
    m: usize,
    /// The vertices.
    #[pyo3(get)]
    vertices: Vec<Py<Vertex>>,
    /// The edges.
    #[pyo3(get)]
    edges: Vec<Py<Edge>>,
}

impl Diagram {
    fn new(
        py: Python<'_>,
        found: core::Diagram,
        names: &Names,
        problem: Arc<Problem>,
        m: usize,
    ) -> PyResult<Self> {
        let vertices = found.vertices().iter().map(|v| {
            let vertex = Vertex {
                x: PyArray1::from_slice(py, &v.x).unbind(),
                parameter: v.parameter(),
                kind: v.kind.name(),
                edges: v.arms.iter().map(|a| a.edge).collect(),
                complete: v.complete,
            };
            Py::new(py, vertex)
        });
        let edges = found.edges().iter().map(|e| {
            let selection = e.points.get(e.points.len() / 2).map(|p| &p.selection);
            let edge = Edge {
                points: rows(py, m, e.points.iter().map(|p| p.x.as_slice()))?.unbind(),
                pieces: selection.map_or_else(Vec::new, |s| names.owned(s)),
                ends: (e.from.vertex, e.to.vertex),
                det_signs: e.det_signs(),
                vertical: e.is_vertical(),
                arclength: e.arclength(),
            };
            Py::new(py, edge)
        });
        Ok(Self {
            vertices: vertices.collect::<PyResult<_>>()?,
            edges: edges.collect::<PyResult<_>>()?,
            found,
            problem,
            m,
        })
    }
}

#[pymethods]
impl Diagram {
    /// Whether every arm of every vertex was followed to its end or to a bound.
    #[getter]
    fn complete(&self) -> bool {
        self.found.completeness().is_complete()
    }

    /// The same in words: "complete within the bounds", or "incomplete: ..." with what was left out.
    #[getter]
    fn completeness(&self) -> String {
        self.found.completeness().to_string()
    }

    /// All folds.
    #[getter]
    fn folds(&self, py: Python<'_>) -> Vec<Fold> {
        let folds = self.found.folds();
        let kind = |f: &core::DiagramFold| if f.vertex.is_some() { "kink" } else { "smooth" };
        folds.iter().map(|f| Fold::new(py, &f.x, kind(f), None)).collect()
    }

    /// The branches: lists of edges (index, whether it is walked against its direction), every edge in one of them.
    #[getter]
    fn branches(&self) -> Vec<Vec<(usize, bool)>> {
        self.found.branches().into_iter().map(|b| b.edges).collect()
    }

    /// The closed curves connected to nothing else.
    #[getter]
    fn isolas(&self) -> Vec<Vec<(usize, bool)>> {
        self.found.isolas().into_iter().map(|b| b.edges).collect()
    }

    /// The solutions of the diagram at a parameter, corrected to rounding, shape (k, m); continua are left out.
    fn solutions_at<'py>(&self, py: Python<'py>, parameter: f64) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = Run::detached(py, |run| {
            let map = self.problem.map(run)?;
            self.found.solutions_at(&*map, parameter).map_err(raised)
        })?;
        let points = found.points.iter().map(|s| s.x.as_slice());
        rows(py, self.m, points.chain(found.isolated.iter().map(Vec::as_slice)))
    }

    fn __repr__(&self) -> String {
        format!(
            "<Diagram: {} vertices, {} edges, {}>",
            self.vertices.len(),
            self.edges.len(),
            self.found.completeness()
        )
    }

    /// Draws the diagram with matplotlib and returns the axes; arguments are those of :meth:`Branch.plot`.
    #[pyo3(signature = (ax=None, x=None, y=None, **style))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<Bound<'py, PyAny>>,
        x: Option<Bound<'py, PyAny>>,
        y: Option<Bound<'py, PyAny>>,
        style: Option<Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("semismooth._views")?
            .call_method1("plot_diagram", (slf, ax, x, y, style))
    }
}

/// Follows the curves of H(x) = 0 through all starts in both directions, and all arms met on the way.
///
/// Parameters
/// ----------
/// H, jac, pattern, lower, upper
///     As for :func:`follow`.
/// starts : array of shape (k, n + 1), or list of ContactSolution
///     Points (y, parameter), corrected onto the curve at their parameter.
/// parameter_range : (float, float), optional
///     Where curves end.
/// max_edges, max_points, same_point
///     Limits on the whole diagram (10 000 edges, 1 000 000 points), and the distance, relative to 1 + ‖x‖, within which vertices are one
///     (1e-7).
/// **options
///     As for :func:`follow`; max_time (seconds) is for the whole diagram.
///
/// Returns
/// -------
/// Diagram
///
/// >>> import semismooth as ss
/// >>> pitchfork = lambda x: [x[0] ** 3 - x[1] * x[0]]
/// >>> diagram = ss.diagram(pitchfork, [[0.0, -0.5]], parameter_range=(-1.0, 1.0))
/// >>> diagram.completeness, sorted(diagram.solutions_at(0.25)[:, 0].round(9).tolist())
/// ('complete within the bounds', [-0.5, 0.0, 0.5])
#[pyfunction]
#[pyo3(signature = (
    H, starts, parameter_range=None, *, jac=None, pattern=None, lower=None, upper=None, max_edges=None,
    max_points=None, same_point=None, **options
))]
fn diagram(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    starts: &Bound<'_, PyAny>,
    parameter_range: Option<(f64, f64)>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    max_edges: Option<usize>,
    max_points: Option<usize>,
    same_point: Option<f64>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Diagram> {
    let starts: Vec<Vec<f64>> = starts
        .try_iter()?
        .map(|start| point(&start?))
        .collect::<PyResult<_>>()?;
    let Some(first) = starts.first() else {
        return Err(PyValueError::new_err("a diagram needs a start"));
    };
    let m = first.len();
    if let Some(k) = starts.iter().position(|s| s.len() != m) {
        return Err(PyValueError::new_err(format!(
            "start {k} has length {}, the first one {m}",
            starts[k].len()
        )));
    }
    let given = Given {
        jac,
        pattern,
        lower,
        upper,
    };
    let problem = Arc::new(Problem::new(H, given, first)?);
    let options: ContinuationOptions = crate::arrays::options(options, py)?;
    let mut options = DiagramOptions::default()
        .with_continuation(options.with_parameter_range(parameter_range.unwrap_or(EVERYWHERE)));
    options.max_edges = max_edges.unwrap_or(options.max_edges);
    options.max_points = max_points.unwrap_or(options.max_points);
    options.same_point = same_point.unwrap_or(options.same_point);
    let (found, names) = Run::detached(py, |run| {
        let map = problem.map(run)?;
        let found = core::Diagram::explore_observed(&*map, &starts, &options, |_| run.poll());
        Ok((found.map_err(raised)?, Names::of(&*map)))
    })?;
    Diagram::new(py, found, &names, problem, m)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Diagram>()?;
    module.add_class::<Edge>()?;
    module.add_class::<Vertex>()?;
    module.add_function(wrap_pyfunction!(diagram, module)?)
}
