//! Curves of solutions and diagrams.

use std::ops::ControlFlow;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};
use semismooth::complementarity::Mcp;
use semismooth::continuation::{
    self as core, Arm, Continuation, ContinuationOptions, DiagramOptions, Direction, Event, PointKind,
};
use semismooth::piecewise::{PiecewiseSmooth, Selection};

use crate::arrays::{bound, matrix, rows, vector};
use crate::complementarity::Derivative;
use crate::errors::{Run, raised};
use crate::expressions::{Map, map_of};

/// The range of a parameter unless one is given.
const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// What is followed.
enum Problem {
    Map(Py<Map>),
    /// A parametric complementarity problem; with infinite bounds, smooth equations.
    Mcp {
        derivative: Derivative,
        lower: Vec<f64>,
        upper: Vec<f64>,
    },
}

impl Problem {
    /// H with n values of the m = n + 1 variables of `x0`.
    fn new(function: &Bound<'_, PyAny>, given: Given<'_, '_>, x0: &[f64]) -> PyResult<Self> {
        let m = x0.len();
        let Some(n) = m.checked_sub(1).filter(|n| *n > 0) else {
            return Err(PyValueError::new_err(format!(
                "a point has the unknowns and the parameter, at least two numbers; there are {m}"
            )));
        };
        let alone = given.jac.is_none() && given.lower.is_none() && given.upper.is_none();
        if alone && !function.is_instance_of::<PyTuple>() {
            let map = map_of(function, m)?;
            let (vars, values) = (map.get().num_vars(), map.get().num_residuals());
            return match (vars, values) == (m, n) {
                true => Ok(Self::Map(map.unbind())),
                false => Err(PyValueError::new_err(format!(
                    "H gives {values} values for {vars} variables; for a start of length {m} it must give {n} for {m}"
                ))),
            };
        }
        let derivative = Derivative::new(function, given.jac, given.pattern, x0, n)?;
        if derivative.has_kinks() {
            return Err(PyValueError::new_err(
                "a function with kinks cannot have bounds, too: write them as kinks, x - clip(x - F(x), lower, upper)",
            ));
        }
        Ok(Self::Mcp {
            derivative,
            lower: bound(given.lower, n, f64::NEG_INFINITY, "lower")?,
            upper: bound(given.upper, n, f64::INFINITY, "upper")?,
        })
    }

    fn map<'r>(&'r self, run: &'r Run) -> PyResult<Box<dyn PiecewiseSmooth + 'r>> {
        match self {
            Self::Map(map) => Ok(Box::new(map.get().traced(run))),
            Self::Mcp {
                derivative,
                lower,
                upper,
            } => {
                let function = derivative.function(run, lower.len());
                let mcp = Mcp::new(function, lower.clone(), upper.clone()).map_err(raised)?;
                Ok(Box::new(mcp))
            }
        }
    }
}

/// How H is to be understood.
struct Given<'a, 'py> {
    jac: Option<&'a Bound<'py, PyAny>>,
    pattern: Option<&'a Bound<'py, PyAny>>,
    lower: Option<&'a Bound<'py, PyAny>>,
    upper: Option<&'a Bound<'py, PyAny>>,
}

/// Names of the pieces, site by site.
struct Names(Vec<Vec<String>>);

impl Names {
    fn of(map: &dyn PiecewiseSmooth) -> Self {
        let site = |s| {
            (0..map.num_pieces(s))
                .map(|p| map.piece_name(s, p).into_owned())
                .collect()
        };
        Self((0..map.num_sites()).map(site).collect())
    }

    fn selection(&self, selection: &Selection) -> Vec<&str> {
        let pieces = self.0.iter().zip(selection.pieces());
        pieces
            .map(|(names, p)| names.get(p).map_or("", String::as_str))
            .collect()
    }

    fn owned(&self, selection: &Selection) -> Vec<String> {
        self.selection(selection).into_iter().map(str::to_owned).collect()
    }
}

/// A point of a curve as a row of tables.
struct Row {
    x: Vec<f64>,
    tangent: Vec<f64>,
    selection: Selection,
    arclength: f64,
    det_sign: Option<i8>,
    kind: &'static str,
}

impl Row {
    fn of(event: &Event) -> Self {
        let point = |p: &core::Point, kind| Row {
            x: p.x.clone(),
            tangent: p.tangent.clone(),
            selection: p.selection.clone(),
            arclength: p.arclength,
            det_sign: p.det_sign,
            kind,
        };
        match event {
            Event::Transition(t) => Row {
                x: t.x.clone(),
                tangent: t.tangent_before.clone(),
                selection: t.before.clone(),
                arclength: t.arclength,
                det_sign: None,
                kind: t.kind.name(),
            },
            Event::Point(p) => point(p, name(p.kind)),
            Event::SmoothFold(f) => point(&f.point, "smooth fold"),
            Event::BranchPoint(b) => point(&b.point, "branch point"),
            Event::Monitor(m) => point(&m.point, "monitor"),
            other => Row {
                x: other.x().to_vec(),
                tangent: vec![f64::NAN; other.x().len()],
                selection: Selection::default(),
                arclength: other.arclength(),
                det_sign: None,
                kind: "other",
            },
        }
    }
}

fn name(kind: PointKind) -> &'static str {
    match kind {
        PointKind::Start => "start",
        PointKind::Target => "target",
        _ => "step",
    }
}

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
    fn new(py: Python<'_>, t: &core::Transition, names: &Names) -> PyResult<Self> {
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

fn tangents(py: Python<'_>, arms: &[Arm], m: usize) -> PyResult<Py<PyArray2<f64>>> {
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
    x: Py<PyArray1<f64>>,
    /// The parameter.
    parameter: f64,
    /// Unit tangents of all arms that leave, but the one of arrival, shape (k, m).
    arms: Py<PyArray2<f64>>,
    /// Index in ``arms`` of the arm that was followed, if any.
    followed: Option<usize>,
    /// Whether no arm is missing, within tolerances.
    complete: bool,
    /// Arclength from the start.
    arclength: f64,
}

/// A zero of a monitor on the curve.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Crossing {
    /// Name of the monitor.
    name: String,
    /// The point (y, parameter), shape (m,).
    x: Py<PyArray1<f64>>,
    /// The parameter.
    parameter: f64,
    /// Arclength from the start.
    arclength: f64,
}

/// A stretch of a solution curve. Row i of the arrays is point i along it, events included.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Branch {
    rows: Vec<Row>,
    names: Names,
    m: usize,
    /// Transitions, along the curve.
    #[pyo3(get)]
    transitions: Vec<Py<Transition>>,
    /// All folds, along the curve.
    #[pyo3(get)]
    folds: Vec<Py<Fold>>,
    /// Branch points, along the curve.
    #[pyo3(get)]
    branch_points: Vec<Py<BranchPoint>>,
    /// Zeros of monitors, along the curve.
    #[pyo3(get)]
    crossings: Vec<Py<Crossing>>,
    /// Why the branch ended: "bound of the parameter", "end of the branch", "closed curve", "branching", "tends to infinity", "limit on points",
    /// "step too small", "zero of a monitor", "stopped" and others.
    #[pyo3(get)]
    termination: &'static str,
    /// Number of factorisations.
    #[pyo3(get)]
    factorisations: usize,
    /// Number of correction steps.
    #[pyo3(get)]
    corrections: usize,
}

impl Branch {
    fn new(py: Python<'_>, found: &core::Branch, rows: Vec<Row>, names: Names, m: usize) -> PyResult<Self> {
        let transitions = found.transitions.iter();
        let kinks = found.transitions.iter().filter(|t| t.is_fold());
        let kinks = kinks.map(|t| (t.arclength, &t.x, "kink"));
        let smooth = found.smooth_folds.iter().map(|f| &f.point);
        let smooth = smooth.map(|p| (p.arclength, &p.x, "smooth"));
        let mut folds: Vec<_> = kinks.chain(smooth).collect();
        folds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fold =
            |(arclength, x, kind): (f64, &Vec<f64>, _)| Py::new(py, Fold::new(py, x, kind, Some(arclength)));
        let branch_points = found.branch_points.iter().map(|b| {
            let point = BranchPoint {
                x: PyArray1::from_slice(py, &b.point.x).unbind(),
                parameter: b.point.parameter(),
                arms: tangents(py, &b.arms, m)?,
                followed: b.followed,
                complete: b.complete,
                arclength: b.point.arclength,
            };
            Py::new(py, point)
        });
        let crossings = found.monitor_crossings.iter().map(|c| {
            let crossing = Crossing {
                name: c.name.clone(),
                x: PyArray1::from_slice(py, &c.point.x).unbind(),
                parameter: c.point.parameter(),
                arclength: c.point.arclength,
            };
            Py::new(py, crossing)
        });
        Ok(Self {
            transitions: transitions
                .map(|t| Py::new(py, Transition::new(py, t, &names)?))
                .collect::<PyResult<_>>()?,
            folds: folds.into_iter().map(fold).collect::<PyResult<_>>()?,
            branch_points: branch_points.collect::<PyResult<_>>()?,
            crossings: crossings.collect::<PyResult<_>>()?,
            termination: found.termination.name(),
            factorisations: found.factorisations,
            corrections: found.corrections,
            rows,
            names,
            m,
        })
    }
}

impl Fold {
    fn new(py: Python<'_>, x: &[f64], kind: &'static str, arclength: Option<f64>) -> Self {
        Self {
            x: PyArray1::from_slice(py, x).unbind(),
            parameter: x.last().copied().unwrap_or(f64::NAN),
            kind,
            arclength,
        }
    }
}

#[pymethods]
impl Branch {
    /// The points (y, parameter), shape (k, m).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.m, self.rows.iter().map(|r| r.x.as_slice()))
    }

    /// Unit tangents in the direction of travel (at transitions, on arrival), shape (k, m).
    #[getter]
    fn tangents<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.m, self.rows.iter().map(|r| r.tangent.as_slice()))
    }

    /// The parameter, the last column of ``points``, shape (k,).
    #[getter]
    fn parameter<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let last = self.rows.iter().map(|r| r.x.last().copied().unwrap_or(f64::NAN));
        PyArray1::from_iter(py, last)
    }

    /// Arclength from the start, shape (k,).
    #[getter]
    fn arclength<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.rows.iter().map(|r| r.arclength))
    }

    /// The piece of each site, by name, a list for each point (at transitions, on arrival).
    #[getter]
    fn pieces(&self) -> Vec<Vec<&str>> {
        let selections = self.rows.iter().map(|r| &r.selection);
        selections.map(|s| self.names.selection(s)).collect()
    }

    /// What each point is: "start", "step", "target", a kind of transition, "smooth fold", "branch point" or "monitor".
    #[getter]
    fn events(&self) -> Vec<&'static str> {
        self.rows.iter().map(|r| r.kind).collect()
    }

    /// Sign of the determinant of ∂H/∂y at each point: −1, 0 or 1, None at transitions and where it is not known.
    #[getter]
    fn det_signs(&self) -> Vec<Option<i8>> {
        self.rows.iter().map(|r| r.det_sign).collect()
    }

    fn __len__(&self) -> usize {
        self.rows.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "<Branch: {} points, {} transitions, {} folds, ended: {}>",
            self.rows.len(),
            self.transitions.len(),
            self.folds.len(),
            self.termination
        )
    }

    /// A pandas.DataFrame with a row for each point: "arclength", "x0" …, "parameter", "event", and "site0" … for the pieces.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("semismooth._views")?
            .call_method1("branch_table", (slf,))
    }

    /// Draws the curve with matplotlib and returns the axes: dashed where the determinant is negative, a marker for each kind of event.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     A new figure unless given.
    /// x, y : int or callable
    ///     What is drawn: an entry of the points (-1: the parameter) or a function of one point. Default: x = -1, y = 0.
    /// **style
    ///     For the lines, as matplotlib's ``plot`` takes it.
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
            .call_method1("plot_branch", (slf, ax, x, y, style))
    }
}

/// Functions of the point watched along a curve.
struct Monitor {
    name: String,
    function: Watch,
    stops: bool,
}

enum Watch {
    Formula(Py<Map>),
    Called(Py<PyAny>),
}

impl Monitor {
    fn list(given: Option<&Bound<'_, PyDict>>, stops: bool, m: usize) -> PyResult<Vec<Self>> {
        let Some(given) = given else {
            return Ok(Vec::new());
        };
        let monitor = |(name, function): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let function = match function.cast::<Map>() {
                Ok(map) if (map.get().num_vars(), map.get().num_residuals()) != (m, 1) => {
                    return Err(PyValueError::new_err(format!(
                        "monitor {name} gives {} values for {} variables; it must give one for {m}",
                        map.get().num_residuals(),
                        map.get().num_vars()
                    )));
                }
                Ok(map) => Watch::Formula(map.clone().unbind()),
                Err(_) if function.is_callable() => Watch::Called(function.unbind()),
                Err(_) => {
                    return Err(PyTypeError::new_err(format!("monitor {name} is no function")));
                }
            };
            let name = name.extract()?;
            Ok(Self {
                name,
                function,
                stops,
            })
        };
        given.iter().map(monitor).collect()
    }

    /// The value at x; NaN, which is no change of sign, after an exception.
    fn value(&self, run: &Run, x: &[f64]) -> f64 {
        match &self.function {
            Watch::Formula(map) => map.get().first_value(x),
            Watch::Called(function) => {
                let value = run.call(|py| {
                    let value = function.bind(py).call1((PyArray1::from_slice(py, x),))?;
                    value.extract::<f64>()
                });
                value.unwrap_or(f64::NAN)
            }
        }
    }
}

fn direction(given: Option<&Bound<'_, PyAny>>) -> PyResult<Direction> {
    let Some(given) = given else {
        return Ok(Direction::Increasing);
    };
    let Ok(word) = given.cast::<PyString>() else {
        return Ok(Direction::Along(vector(given, "direction")?));
    };
    match word.to_str()? {
        "increasing" => Ok(Direction::Increasing),
        "decreasing" => Ok(Direction::Decreasing),
        other => Err(PyValueError::new_err(format!(
            "direction = \"{other}\" is not known: write \"increasing\", \"decreasing\" or a vector"
        ))),
    }
}

/// Follows the curve of solutions x = (y, parameter) of H(x) = 0 from ``x0``, through its kinks.
///
/// Every point where the active pieces change is located to rounding and classified; so are smooth folds, branch points and zeros of monitors.
///
/// Parameters
/// ----------
/// H : callable, Map, or tuple (M, q) of an affine function
///     ``H(x)`` for x of shape (n + 1,), the parameter last, gives n values. Unless ``jac`` is given it is traced: see :func:`trace`.
/// x0 : array of shape (n + 1,)
///     Start; corrected onto the curve at its parameter.
/// parameter_range : (float, float), optional
///     The curve ends where the parameter leaves it.
/// direction : "increasing", "decreasing" or array of shape (n + 1,), optional
///     With growing (unless given) or falling parameter, or along the arm nearest to a vector (one of ``arms`` of a transition).
/// jac : callable or "differences", optional
///     ``jac(x)`` of shape (n, n + 1), dense or scipy.sparse: H is then called, not traced, and must be smooth.
/// pattern : matrix of shape (n, n + 1), optional
///     Where the Jacobian has entries.
/// lower, upper : number or array of shape (n,), optional
///     H is then the (smooth) function of a mixed complementarity problem in y with these bounds; its pieces are "lower", "interior", "upper".
/// monitors, stops : dict of name and callable or Map, optional
///     Real functions of x; where one changes its sign the zero is located and listed in ``crossings``. Those of ``stops`` end the curve.
/// callback : callable, optional
///     Called with a dict of "event", "x", "parameter" and "arclength" at each point; returns True to stop.
/// **options
///     step (0.05), min_step, max_step (1), targets (parameters to be hit), max_points (10 000), max_arclength, max_time (seconds),
///     typical_sizes and others of ContinuationOptions.
///
/// Returns
/// -------
/// Branch
///
/// >>> import semismooth as ss
/// >>> def beam(x):
/// ...     y, load = x
/// ...     return [y - 1.25 * ss.maximum(y - 1, 0) + 10 * ss.maximum(y - 3, 0) - load]
/// >>> branch = ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, 2.0))
/// >>> [(t.kind, float(t.x[0].round(9)), round(t.parameter, 9)) for t in branch.transitions]
/// [('fold', 1.0, 1.0), ('fold', 3.0, 0.5)]
#[pyfunction]
#[pyo3(signature = (
    H, x0, parameter_range=None, direction=None, *, jac=None, pattern=None, lower=None, upper=None,
    monitors=None, stops=None, callback=None, **options
))]
fn follow(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    x0: &Bound<'_, PyAny>,
    parameter_range: Option<(f64, f64)>,
    direction: Option<&Bound<'_, PyAny>>,
    jac: Option<&Bound<'_, PyAny>>,
    pattern: Option<&Bound<'_, PyAny>>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    monitors: Option<&Bound<'_, PyDict>>,
    stops: Option<&Bound<'_, PyDict>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Branch> {
    let x0 = vector(x0, "x0")?;
    let given = Given {
        jac,
        pattern,
        lower,
        upper,
    };
    let problem = Problem::new(H, given, &x0)?;
    let direction = self::direction(direction)?;
    let mut monitors = Monitor::list(monitors, false, x0.len())?;
    monitors.extend(Monitor::list(stops, true, x0.len())?);
    let options: ContinuationOptions = crate::arrays::options(options, py)?;
    let options = options.with_parameter_range(parameter_range.unwrap_or(EVERYWHERE));
    let (found, rows, names) = Run::detached(py, |run| {
        let map = problem.map(run)?;
        let mut curve = Continuation::new(&*map, &x0, direction, options).map_err(raised)?;
        for monitor in &monitors {
            let function = |x: &[f64]| monitor.value(run, x);
            curve = match monitor.stops {
                true => curve.with_stop(&monitor.name, function),
                false => curve.with_monitor(&monitor.name, function),
            };
        }
        let mut rows = Vec::new();
        let found = core::Branch::collect(curve, |event| {
            let row = Row::of(event);
            let flow = told(run, callback.as_ref(), &row);
            rows.push(row);
            flow
        });
        Ok((found.map_err(raised)?, rows, Names::of(&*map)))
    })?;
    Branch::new(py, &found, rows, names, x0.len())
}

/// Tells a callback of a point.
fn told(run: &Run, callback: Option<&Py<PyAny>>, row: &Row) -> ControlFlow<()> {
    let Some(callback) = callback else {
        return run.poll();
    };
    let stop = run.call(|py| {
        let event = PyDict::new(py);
        event.set_item("event", row.kind)?;
        event.set_item("x", PyArray1::from_slice(py, &row.x))?;
        event.set_item("parameter", row.x.last())?;
        event.set_item("arclength", row.arclength)?;
        callback.bind(py).call1((event,))?.is_truthy()
    });
    match stop {
        Some(false) => run.poll(),
        _ => ControlFlow::Break(()),
    }
}

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
/// starts : array of shape (k, n + 1)
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
    let starts = matrix(starts, "starts")?;
    let m = starts.ncols();
    let starts: Vec<Vec<f64>> = (0..starts.nrows())
        .map(|i| (0..m).map(|j| starts.get(i, j)).collect())
        .collect();
    let Some(first) = starts.first() else {
        return Err(PyValueError::new_err("a diagram needs a start"));
    };
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
    module.add_class::<Branch>()?;
    module.add_class::<BranchPoint>()?;
    module.add_class::<Crossing>()?;
    module.add_class::<Diagram>()?;
    module.add_class::<Edge>()?;
    module.add_class::<Fold>()?;
    module.add_class::<Transition>()?;
    module.add_class::<Vertex>()?;
    module.add_function(wrap_pyfunction!(follow, module)?)?;
    module.add_function(wrap_pyfunction!(diagram, module)?)
}
