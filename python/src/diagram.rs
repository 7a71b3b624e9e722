//! Diagrams: all solutions connected to given starts.

use std::collections::HashSet;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use semismooth::continuation::{self as core, Continuation, ContinuationOptions, DiagramOptions, Direction};
use semismooth::output::{Column, write_diagram_csv};
use semismooth::piecewise::PiecewiseSmooth;

use crate::arrays::{counted, rows};
use crate::contact::point;
use crate::continuation::{EVERYWHERE, Given, Monitor, Problem, told};
use crate::errors::{Run, SemismoothError, raised};
use crate::events::{Crossing, Fold};
use crate::names::{Names, number, variables};
use crate::saving::{data, data_of, field, state_of};
use crate::solution::ContactSolution;

/// A point of a diagram where curves meet, have a kink or end.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Vertex {
    /// The point (y, parameter), shape (m,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// The parameter.
    pub(crate) parameter: f64,
    /// "start", "pass-through", "fold", "vertical segment", "branching", "branch point", "end", "isolated", "continuum" (a region of solutions),
    /// "bound", or why the curve was not followed further.
    pub(crate) kind: String,
    /// Indices of the edges that leave along its arms; None for an arm that was not followed.
    pub(crate) edges: Vec<Option<usize>>,
    /// Whether no arm is missing, within tolerances.
    pub(crate) complete: bool,
    /// Whether a start was given here.
    pub(crate) is_start: bool,
}

#[pymethods]
impl Vertex {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let parameter = number(self.parameter, &self.x.bind(py).to_vec()?);
        Ok(format!("<Vertex: {} at parameter {parameter}>", self.kind))
    }
}

/// The part of a curve between two vertices, with one selection.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Edge {
    /// Its points from end to end, shape (k, m).
    pub(crate) points: Py<PyArray2<f64>>,
    /// Unit tangents along it, shape (k, m).
    pub(crate) tangents: Py<PyArray2<f64>>,
    /// The piece of each site on it, by name.
    pub(crate) pieces: Vec<String>,
    /// Indices of the vertices at its ends; equal for a closed curve.
    pub(crate) ends: (usize, usize),
    /// The signs of the determinant of ∂H/∂y along it, in order, repetitions left out.
    pub(crate) det_signs: Vec<i8>,
    /// The sign at each point; None where it is not known.
    pub(crate) point_det_signs: Vec<Option<i8>>,
    /// Rows of ``points`` that are smooth folds.
    pub(crate) smooth_folds: Vec<usize>,
    /// Whether the parameter is constant along it: a continuum of solutions.
    pub(crate) vertical: bool,
    /// Its arclength.
    pub(crate) arclength: f64,
}

#[pymethods]
impl Edge {
    fn __repr__(&self, py: Python<'_>) -> String {
        let points = self.points.bind(py).readonly().as_array().nrows();
        let (from, to) = self.ends;
        format!(
            "<Edge: {} from vertex {from} to vertex {to}>",
            counted(points, "point")
        )
    }
}

/// All solutions connected to given starts, as a graph.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Diagram {
    found: core::Diagram,
    names: Names,
    problem: Arc<Problem>,
    m: usize,
    /// The vertices.
    #[pyo3(get)]
    vertices: Vec<Py<Vertex>>,
    /// The edges.
    #[pyo3(get)]
    edges: Vec<Py<Edge>>,
    /// Zeros of monitors, edge by edge.
    #[pyo3(get)]
    crossings: Vec<Py<Crossing>>,
}

impl Diagram {
    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, own) = (slf.py(), slf.get());
        let crossings = own.crossings.iter().map(|c| c.clone_ref(py));
        state_of(
            py,
            &[
                ("diagram", data_of(py, &own.found)?),
                ("names", data_of(py, &own.names)?),
                ("problem", own.problem.state(py)?.into_any()),
                ("crossings", PyList::new(py, crossings)?.into_any()),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let problem = Arc::new(Problem::restored(&field(state, "problem")?)?);
        let (found, names) = (data(state, "diagram")?, data(state, "names")?);
        let mut diagram = Self::new(py, found, names, problem, &[])?;
        diagram.crossings = field(state, "crossings")?;
        Ok(Bound::new(py, diagram)?.into_any())
    }

    fn new(
        py: Python<'_>,
        found: core::Diagram,
        names: Names,
        problem: Arc<Problem>,
        zeros: &[Zero],
    ) -> PyResult<Self> {
        let m = found.vertices().first().map_or(0, |v| v.x.len());
        let crossings = zeros.iter().map(|z| {
            let crossing = Crossing::new(py, &z.name, &z.x, z.arclength, Some(z.edge));
            Py::new(py, crossing)
        });
        let vertices = found.vertices().iter().map(|v| {
            let vertex = Vertex {
                x: PyArray1::from_slice(py, &v.x).unbind(),
                parameter: v.parameter(),
                kind: v.kind.name().to_owned(),
                edges: v.arms.iter().map(|a| a.edge).collect(),
                complete: v.complete,
                is_start: v.is_start,
            };
            Py::new(py, vertex)
        });
        let edges = found.edges().iter().map(|e| {
            let selection = e.points.get(e.points.len() / 2).map(|p| &p.selection);
            let edge = Edge {
                points: rows(py, m, e.points.iter().map(|p| p.x.as_slice()))?.unbind(),
                tangents: rows(py, m, e.points.iter().map(|p| p.tangent.as_slice()))?.unbind(),
                pieces: selection.map_or_else(Vec::new, |s| names.owned(s)),
                ends: (e.from.vertex, e.to.vertex),
                det_signs: e.det_signs(),
                point_det_signs: e.points.iter().map(|p| p.det_sign).collect(),
                smooth_folds: e.smooth_folds.clone(),
                vertical: e.is_vertical(),
                arclength: e.arclength(),
            };
            Py::new(py, edge)
        });
        Ok(Self {
            vertices: vertices.collect::<PyResult<_>>()?,
            edges: edges.collect::<PyResult<_>>()?,
            crossings: crossings.collect::<PyResult<_>>()?,
            found,
            names,
            problem,
            m,
        })
    }
}

#[pymethods]
impl Diagram {
    /// Whether it is proven that nothing is missing of what is connected with the starts.
    #[getter]
    fn complete(&self) -> bool {
        self.found.completeness().is_complete()
    }

    /// Whether something is known to have been left out: a limit was reached, or a point is undecided.
    #[getter]
    fn limited(&self) -> bool {
        self.found.completeness().is_limited()
    }

    /// The same in words: "complete within the bounds, for what is connected to the starts", the same "up to steps of ...", "nothing else was found within the
    /// bounds", or "incomplete: ..." with what was left out.
    #[getter]
    fn completeness(&self) -> String {
        self.found.completeness().to_string()
    }

    /// All folds.
    #[getter]
    fn folds(&self, py: Python<'_>) -> Vec<Fold> {
        let folds = self.found.folds();
        // A start that was given at a smooth fold is a vertex, too: the pieces on its arms are the same.
        let changes = |vertex: &core::DiagramVertex| {
            let mut selections = vertex.arms.iter().map(|a| &a.arm.selection);
            let first = selections.next();
            selections.any(|other| Some(other) != first)
        };
        let kind = |f: &core::DiagramFold| match f.vertex.and_then(|v| self.found.vertices().get(v)) {
            Some(vertex) if changes(vertex) => "kink",
            _ => "smooth",
        };
        folds.iter().map(|f| Fold::new(py, &f.x, kind(f), None)).collect()
    }

    /// The branches: lists of edges (index, whether it is traversed backwards), every edge in one of them.
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
            "<Diagram: {}, {}, {}>",
            counted(self.vertices.len(), "vertex"),
            counted(self.edges.len(), "edge"),
            self.found.completeness()
        )
    }

    /// Names of the variables, the parameter last; empty where none were given.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.names.variables.clone()
    }

    /// For the first sites, what legends call each piece.
    #[getter]
    fn _legend(&self) -> Vec<Vec<(&str, &str)>> {
        self.names.legend()
    }

    /// The diagram as a picture, where matplotlib is installed, and its folds as a table, for notebooks.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("semismooth._views")?
            .call_method1("diagram_html", (slf,))
    }

    /// The table of :meth:`to_pandas` as comma-separated values.
    fn _csv(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        Run::detached(py, |run| {
            let map = self.problem.map(run)?;
            let columns: Vec<_> = (0..self.m - 1)
                .map(|k| Column::entry(format!("x{k}"), k))
                .collect();
            let mut table = Vec::new();
            write_diagram_csv(&mut table, &*map, &self.found, &columns).map_err(raised)?;
            Ok(table)
        })
    }

    /// A pandas.DataFrame with a row for each point, edge after edge, isolated vertices last: "edge" (missing there), "arclength" along it,
    /// "x0" …, "parameter" (or the names given), "event" ("point", "smooth fold", or the kind of the vertex), "det" (missing where unknown), and "site0" … for the
    /// pieces.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("semismooth._views")?
            .call_method1("diagram_table", (slf,))
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

/// A zero of a monitor on an edge.
struct Zero {
    name: String,
    x: Vec<f64>,
    arclength: f64,
    edge: usize,
}

/// Zeros of the monitors on the edges, located by following the curve from the point before the change of sign.
fn zeros(
    run: &Run,
    map: &dyn PiecewiseSmooth,
    found: &core::Diagram,
    monitors: &[Monitor],
    options: &ContinuationOptions,
) -> PyResult<Vec<Zero>> {
    let mut zeros = Vec::new();
    // A vertex at which a monitor vanishes belongs to several edges, but is listed once.
    let mut known = HashSet::new();
    for (edge, of) in found.edges().iter().enumerate() {
        let last = of.points.len() - 1;
        for (number, monitor) in monitors.iter().enumerate() {
            let values: Vec<f64> = of.points.iter().map(|p| monitor.value(run, &p.x)).collect();
            let at = |x: &[f64], arclength| Zero {
                name: monitor.name().to_owned(),
                x: x.to_vec(),
                arclength,
                edge,
            };
            for (k, point) in of.points.iter().enumerate() {
                let new = match k {
                    0 => known.insert((number, of.from.vertex)),
                    _ if k == last => known.insert((number, of.to.vertex)),
                    _ => true,
                };
                if values[k] == 0.0 && new {
                    zeros.push(at(&point.x, point.arclength));
                }
                if k < last && values[k] * values[k + 1] < 0.0 {
                    let ends = [point, &of.points[k + 1]];
                    let zero = between(run, map, monitor, ends, options)?;
                    zeros.extend(zero.map(|z| at(&z.x, point.arclength + z.arclength)));
                }
            }
        }
    }
    Ok(zeros)
}

/// The zero of a monitor between two points of a curve at which its signs differ; none after an exception.
fn between(
    run: &Run,
    map: &dyn PiecewiseSmooth,
    monitor: &Monitor,
    [here, there]: [&core::Point; 2],
    options: &ContinuationOptions,
) -> PyResult<Option<core::Point>> {
    let chord = there.x.iter().zip(&here.x).map(|(b, a)| b - a).collect();
    let mut options = options.clone();
    options.targets.clear();
    options.max_arclength = 2.0 * (there.arclength - here.arclength);
    let curve = Continuation::new(map, &here.x, Direction::Along(chord), options)
        .map_err(raised)?
        .with_stop(monitor.name(), |x: &[f64]| monitor.value(run, x));
    let branch = core::Branch::collect(curve, |_| run.poll()).map_err(raised)?;
    let found = branch.monitor_crossings.into_iter().next().map(|c| c.point);
    match found {
        None if !run.is_broken() => Err(SemismoothError::new_err(format!(
            "the zero of monitor {} near parameter {} cannot be located: a smaller max_step may help",
            monitor.name(),
            here.parameter()
        ))),
        found => Ok(found),
    }
}

/// Follows the curves of H(x) = 0 through all starts in both directions, and all arms met on the way.
///
/// Parameters
/// ----------
/// H, jac, pattern, lower, upper
///     As for :func:`follow`.
/// starts : array of shape (k, n + 1) or (n + 1,), or ContactSolution or list of them
///     One point or several; points (y, parameter), corrected onto the curve at their parameter.
///     Unless given, all solutions at ``sections`` that :func:`all_solutions` finds.
/// parameter_range : (float, float), optional
///     Where curves end.
/// sections : list of float, optional
///     Parameters at which starts are sought where none are given; the ends and the middle of ``parameter_range`` unless given.
/// monitors : dict of name and callable or Map, optional
///     Real functions of x; where one changes its sign along an edge the zero is located and listed in ``crossings``.
/// callback : callable, optional
///     Called with a dict of "event", "x", "parameter" and "arclength" (along the current curve) at each point, in the order in which they
///     are computed; returns True to stop, which leaves the diagram incomplete.
/// names : list of str, optional
///     Names of the n + 1 variables, for tables and pictures.
/// max_edges, max_points, same_point
///     Limits on the whole diagram (10 000 edges, 1 000 000 points), and the distance, relative to 1 + ‖x‖, within which vertices are one
///     (1e-7).
/// **options
///     As for :func:`follow`; max_time (60 seconds; None: no limit) is for the whole diagram.
///
/// Returns
/// -------
/// Diagram
///
/// >>> import semismooth as ss
/// >>> pitchfork = lambda x: [x[0] ** 3 - x[1] * x[0]]
/// >>> diagram = ss.diagram(pitchfork, [[0.0, -0.5]], parameter_range=(-1.0, 1.0))
/// >>> diagram.completeness, sorted(diagram.solutions_at(0.25)[:, 0].round(9).tolist())
/// ('nothing else was found within the bounds', [-0.5, 0.0, 0.5])
#[pyfunction]
#[pyo3(signature = (
    H, starts=None, parameter_range=None, *, sections=None, jac=None, pattern=None, lower=None, upper=None, monitors=None,
    callback=None, max_edges=None, max_points=None, same_point=None, names=None, **options
))]
fn diagram(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    starts: Option<&Bound<'_, PyAny>>,
    parameter_range: Option<(f64, f64)>,
    sections: Option<Vec<f64>>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    monitors: Option<&Bound<'_, PyDict>>,
    callback: Option<Py<PyAny>>,
    max_edges: Option<usize>,
    max_points: Option<usize>,
    same_point: Option<f64>,
    names: Option<Vec<String>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Diagram> {
    let alone = jac.is_none() && lower.is_none() && upper.is_none();
    let found;
    let (H, starts) = match (starts, alone) {
        (Some(starts), _) => (H.clone(), starts.clone()),
        (None, false) => {
            return Err(PyValueError::new_err(
                "a diagram of a function with bounds or with jac needs starts",
            ));
        }
        (None, true) => {
            found = py
                .import("semismooth._arrays")?
                .getattr("solutions_at_sections")?;
            found.call1((H, parameter_range, sections))?.extract()?
        }
    };
    let (H, starts) = (&H, &starts);
    let starts = match starts.extract::<Vec<f64>>().is_ok_and(|one| !one.is_empty())
        || starts.is_instance_of::<ContactSolution>()
    {
        true => vec![point(starts)?],
        false => (starts.try_iter()?)
            .map(|start| point(&start?))
            .collect::<PyResult<Vec<_>>>()?,
    };
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
    let monitors = Monitor::list(monitors, false, m)?;
    let variables = variables(names, m)?;
    let (found, names, zeros) = Run::detached(py, |run| {
        let map = problem.map(run)?;
        let found = core::Diagram::explore_observed(&*map, &starts, &options, |now| {
            told(run, callback.as_ref(), now.event)
        })
        .map_err(raised)?;
        let zeros = zeros(run, &*map, &found, &monitors, &options.continuation)?;
        Ok((found, Names::of(&*map), zeros))
    })?;
    let names = names.with(&problem, variables);
    Diagram::new(py, found, names, problem, &zeros)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Diagram>()?;
    module.add_class::<Edge>()?;
    module.add_class::<Vertex>()?;
    module.add_function(wrap_pyfunction!(diagram, module)?)
}
