//! Curves of solutions.

use std::ops::ControlFlow;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyString, PyTuple};
use semismooth::complementarity::Mcp;
use semismooth::continuation::{self as core, Continuation, ContinuationOptions, Direction, Event};
use semismooth::piecewise::PiecewiseSmooth;

use crate::arrays::{bound, counted, rows, vector};
use crate::contact::{ContactProblem, point};
use crate::errors::{Run, raised};
use crate::events::{BranchPoint, Crossing, Fold, Transition, tangents};
use crate::functions::Derivative;
use crate::map::{Map, map_of};
use crate::names::{Names, variables};
use crate::saving::{data, data_of, field, state_of};

/// The range of a parameter unless one is given.
pub(crate) const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// The problem whose curve is followed.
pub(crate) enum Problem {
    Map(Py<Map>),
    Contact(Py<ContactProblem>),
    /// A parametric complementarity problem; with infinite bounds, smooth equations.
    Mcp {
        derivative: Derivative,
        lower: Vec<f64>,
        upper: Vec<f64>,
    },
}

impl Problem {
    /// H with n values of the m = n + 1 variables of `x0`.
    pub(crate) fn new(function: &Bound<'_, PyAny>, given: Given<'_, '_>, x0: &[f64]) -> PyResult<Self> {
        let alone = given.jac.is_none() && given.lower.is_none() && given.upper.is_none();
        if alone && !function.is_instance_of::<PyTuple>() {
            return Self::formula(function, x0, 1);
        }
        let n = values_of(x0, 1)?;
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

    /// A formula or a contact problem whose last `parameters` variables are parameters.
    pub(crate) fn formula(function: &Bound<'_, PyAny>, x0: &[f64], parameters: usize) -> PyResult<Self> {
        let (m, n) = (x0.len(), values_of(x0, parameters)?);
        let (problem, vars, values) = match function.cast::<ContactProblem>() {
            Ok(problem) => {
                let map = problem.get().form()?.map();
                let (vars, values) = (map.num_vars(), map.num_residuals());
                (Self::Contact(problem.clone().unbind()), vars, values)
            }
            Err(_) => {
                let map = map_of(function, m)?;
                let (vars, values) = (map.get().num_vars(), map.get().num_residuals());
                (Self::Map(map.unbind()), vars, values)
            }
        };
        match (vars, values) == (m, n) {
            true => Ok(problem),
            false => Err(PyValueError::new_err(format!(
                "for a start of length {m} H must give {n} values for {m} variables; it gives {values} for {vars}"
            ))),
        }
    }

    pub(crate) fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match self {
            Self::Map(map) => state_of(py, &[("map", map.bind(py).clone().into_any())]),
            Self::Contact(problem) => state_of(py, &[("contact", problem.bind(py).clone().into_any())]),
            Self::Mcp {
                derivative,
                lower,
                upper,
            } => state_of(
                py,
                &[
                    ("function", derivative.state(py)?.into_any()),
                    ("lower", data_of(py, lower)?),
                    ("upper", data_of(py, upper)?),
                ],
            ),
        }
    }

    pub(crate) fn restored(state: &Bound<'_, PyDict>) -> PyResult<Self> {
        if state.contains("map")? {
            return Ok(Self::Map(field(state, "map")?));
        }
        if state.contains("contact")? {
            return Ok(Self::Contact(field(state, "contact")?));
        }
        Ok(Self::Mcp {
            derivative: Derivative::restored(&field(state, "function")?)?,
            lower: data(state, "lower")?,
            upper: data(state, "upper")?,
        })
    }

    pub(crate) fn map<'r>(&'r self, run: &'r Run) -> PyResult<Box<dyn PiecewiseSmooth + 'r>> {
        match self {
            Self::Map(map) => Ok(Box::new(map.get().traced(run))),
            Self::Contact(problem) => Ok(Box::new(problem.get().form()?.map())),
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

/// The number n of values of H, from the length of a point and the number of parameters.
fn values_of(x0: &[f64], parameters: usize) -> PyResult<usize> {
    let values = x0.len().checked_sub(parameters).filter(|n| *n > 0);
    values.ok_or_else(|| {
        let (last, least) = match parameters {
            1 => ("the parameter", "two"),
            _ => ("both parameters", "three"),
        };
        PyValueError::new_err(format!(
            "a point has the unknowns and {last}, at least {least} numbers; there are {}",
            x0.len()
        ))
    })
}

/// The optional arguments that define H.
pub(crate) struct Given<'a, 'py> {
    pub(crate) jac: Option<&'a Bound<'py, PyAny>>,
    pub(crate) pattern: Option<&'a Bound<'py, PyAny>>,
    pub(crate) lower: Option<&'a Bound<'py, PyAny>>,
    pub(crate) upper: Option<&'a Bound<'py, PyAny>>,
}

/// An arc of a solution curve. Row i of the arrays is its point i; events are among the points.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Branch {
    found: Arc<core::Branch>,
    names: Arc<Names>,
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
    /// Why the branch ended: "bound of the parameter", "end of the branch", "closed curve", "branching", "tends to infinity", "point limit",
    /// "step too small", "zero of a monitor", "interrupted" and others.
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
    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, own) = (slf.py(), slf.get());
        state_of(
            py,
            &[
                ("curve", data_of(py, &*own.found)?),
                ("names", data_of(py, &*own.names)?),
                ("variables", data_of(py, &own.m)?),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let (found, names) = (data(state, "curve")?, data(state, "names")?);
        let branch = Self::new(py, found, names, data(state, "variables")?)?;
        Ok(Bound::new(py, branch)?.into_any())
    }

    pub(crate) fn new(py: Python<'_>, found: core::Branch, names: Names, m: usize) -> PyResult<Self> {
        let (found, names) = (Arc::new(found), Arc::new(names));
        let transitions =
            (found.transitions.iter()).map(|t| Py::new(py, Transition::new(t, Arc::clone(&names))));
        let kinks = found.transitions.iter().filter(|t| t.is_fold());
        let kinks = kinks.map(|t| (t.arclength, &t.x, "kink"));
        let smooth = found.smooth_folds.iter();
        let smooth = smooth.map(|p| (p.arclength, &p.x, "smooth"));
        let turns = found.turns.iter().map(|p| (p.arclength, &p.x, "not known"));
        let mut folds: Vec<_> = kinks.chain(smooth).chain(turns).collect();
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
            let (x, arclength) = (&c.point.x, c.point.arclength);
            Py::new(py, Crossing::new(py, &c.name, x, arclength, None))
        });
        Ok(Self {
            transitions: transitions.collect::<PyResult<_>>()?,
            folds: folds.into_iter().map(fold).collect::<PyResult<_>>()?,
            branch_points: branch_points.collect::<PyResult<_>>()?,
            crossings: crossings.collect::<PyResult<_>>()?,
            termination: found.termination.name(),
            factorisations: found.factorisations,
            corrections: found.corrections,
            found,
            names,
            m,
        })
    }
}

impl Branch {
    pub(crate) fn transition(&self, py: Python<'_>, k: usize) -> Py<Transition> {
        self.transitions[k].clone_ref(py)
    }
}

#[pymethods]
impl Branch {
    /// The points (y, parameter), shape (k, m).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.m, self.found.vertices().iter().map(|v| v.x))
    }

    /// Unit tangents in the direction of travel (at transitions, on departure), shape (k, m).
    #[getter]
    fn tangents<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.m, self.found.vertices().iter().map(|v| v.tangent))
    }

    /// The same with those of arrival at transitions, for pictures.
    #[getter]
    fn _arrivals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.m, self.found.vertices().iter().map(|v| v.tangent_before))
    }

    /// The parameter, the last column of ``points``, shape (k,).
    #[getter]
    fn parameter<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let vertices = self.found.vertices();
        PyArray1::from_iter(py, vertices.iter().map(core::BranchVertex::parameter))
    }

    /// Arclength from the start, shape (k,).
    #[getter]
    fn arclength<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.found.vertices().iter().map(|v| v.arclength))
    }

    /// The piece of each site, by name, a list for each point (at transitions, on departure).
    #[getter]
    fn pieces(&self) -> Vec<Vec<&str>> {
        let vertices = self.found.vertices();
        vertices
            .iter()
            .map(|v| self.names.selection(v.selection))
            .collect()
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

    /// What each point is: "point", a kind of transition, "smooth fold", "branch point", or the name of a monitor.
    #[getter]
    fn events(&self) -> Vec<String> {
        let vertices = self.found.vertices();
        vertices.iter().map(|v| v.event.to_owned()).collect()
    }

    /// Sign of the determinant of ∂H/∂y at each point: −1, 0 or 1, None where it is not known; at transitions, on departure.
    #[getter]
    fn det_signs(&self) -> Vec<Option<i8>> {
        self.found.vertices().iter().map(|v| v.det_sign).collect()
    }

    /// The sign between each point and the next, from an end at which it is not 0.
    #[getter]
    fn _segment_signs(&self) -> Vec<Option<i8>> {
        let vertices = self.found.vertices();
        let sign = |ends: [Option<i8>; 2]| ends.into_iter().flatten().find(|s| *s != 0);
        vertices
            .windows(2)
            .map(|v| sign([v[0].det_sign, v[1].sign_before]))
            .collect()
    }

    fn __len__(&self) -> usize {
        self.found.vertices().len()
    }

    /// The points, one after another.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        self.points(py)?.into_any().try_iter()
    }

    /// The curve as a picture, where matplotlib is installed, and its events as a table, for notebooks.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("semismooth._views")?
            .call_method1("branch_html", (slf,))
    }

    /// Whether the kinks of the function are known: if not (see ``jac`` of :func:`follow`), no transitions and branch points are listed
    /// although there may be some, and folds are at kinks or smooth.
    #[getter]
    fn pieces_known(&self) -> bool {
        !self.found.is_black_box
    }

    fn __repr__(&self) -> String {
        if self.found.is_black_box {
            return format!(
                "<Branch: {}, {}, pieces not known, ended: {}>",
                counted(self.__len__(), "point"),
                counted(self.folds.len(), "turning point"),
                self.termination
            );
        }
        format!(
            "<Branch: {}, {}, {}, ended: {}>",
            counted(self.__len__(), "point"),
            counted(self.transitions.len(), "transition"),
            counted(self.folds.len(), "fold"),
            self.termination
        )
    }

    /// A pandas.DataFrame with a row for each point: "arclength", "x0" …, "parameter" (or the names given), "event", and "site0" … for the
    /// pieces.
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
pub(crate) struct Monitor {
    name: String,
    function: Watch,
    stops: bool,
}

enum Watch {
    Formula(Py<Map>),
    Called(Py<PyAny>),
}

impl Monitor {
    pub(crate) fn list(given: Option<&Bound<'_, PyDict>>, stops: bool, m: usize) -> PyResult<Vec<Self>> {
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

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The value at x; NaN, which counts as no change of sign, after an exception.
    pub(crate) fn value(&self, run: &Run, x: &[f64]) -> f64 {
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

pub(crate) fn direction(given: Option<&Bound<'_, PyAny>>) -> PyResult<Direction> {
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
/// H : callable, Map, ContactProblem, or tuple (M, q) of an affine function
///     ``H(x)`` for x of shape (n + 1,), the parameter last, gives n values. Unless ``jac`` is given it is traced: see :func:`trace`.
/// x0 : array of shape (n + 1,), or ContactSolution
///     Start; corrected onto the curve at its parameter.
/// parameter_range : (float, float), optional
///     The curve ends where the parameter leaves it.
/// direction : "increasing", "decreasing" or array of shape (n + 1,), optional
///     With increasing (the default) or decreasing parameter, or along the arm nearest to a vector (one of ``arms`` of a transition).
/// jac : callable or "differences", optional
///     ``jac(x)`` of shape (n, n + 1), dense or scipy.sparse: H is then called, not traced, and its kinks are not known (at a kink ``jac`` may
///     be that of either side). Points where the parameter turns and zeros of monitors are located; transitions and branch points are not
///     listed, and what begins and ends within half a step may be passed over.
/// smooth : bool, optional
///     True: a promise that the function with ``jac`` has no kinks, so that folds are smooth ones and branch points are located.
/// pattern : matrix of shape (n, n + 1), optional
///     The sparsity pattern of the Jacobian, as for :func:`solve_mcp`.
/// lower, upper : number or array of shape (n,), optional
///     H is then the (smooth) function of a mixed complementarity problem in y with these bounds; its pieces are "lower", "interior", "upper".
/// monitors, stops : dict of name and callable or Map, optional
///     Real functions of x; where one changes its sign the zero is located and listed in ``crossings``. Those of ``stops`` end the curve.
/// callback : callable, optional
///     Called with a dict of "event", "x", "parameter" and "arclength" at each point; returns True to stop.
/// verbose, progress : bool, optional
///     A line printed for each point; a bar that counts them, with tqdm where it is installed.
/// names : list of str, optional
///     Names of the n + 1 variables, for tables and pictures.
/// **options
///     step (0.05), min_step, max_step (1), targets (parameters at which points are computed), max_points (10 000), max_arclength,
///     max_time (60 seconds; None: no limit), typical_sizes and others of ContinuationOptions.
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
    H, x0, parameter_range=None, direction=None, *, jac=None, pattern=None, lower=None, upper=None, smooth=None,
    monitors=None, stops=None, callback=None, names=None, **options
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
    smooth: Option<bool>,
    monitors: Option<&Bound<'_, PyDict>>,
    stops: Option<&Bound<'_, PyDict>>,
    callback: Option<Py<PyAny>>,
    names: Option<Vec<String>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Branch> {
    let x0 = point(x0)?;
    let called = jac.is_some() && lower.is_none() && upper.is_none();
    if smooth.is_some() && !called {
        return Err(PyValueError::new_err(
            "smooth says something of a function with jac and without bounds; of others the kinks are known",
        ));
    }
    let given = Given {
        jac,
        pattern,
        lower,
        upper,
    };
    let problem = Problem::new(H, given, &x0)?;
    let mut monitors = Monitor::list(monitors, false, x0.len())?;
    monitors.extend(Monitor::list(stops, true, x0.len())?);
    let travel = Travel {
        direction: self::direction(direction)?,
        options: crate::arrays::options::<ContinuationOptions>(options, py)?
            .with_parameter_range(parameter_range.unwrap_or(EVERYWHERE)),
        monitors,
        callback,
        x0,
    };
    let m = travel.x0.len();
    let variables = variables(names, m)?;
    let (found, names) = Run::detached(py, |run| {
        let map = problem.map(run)?;
        match called && smooth != Some(true) {
            true => travel.through(run, &*map),
            false => travel.along(run, &*map),
        }
    })?;
    Branch::new(py, found, names.with(&problem, variables), m)
}

/// How a curve is followed.
pub(crate) struct Travel {
    pub(crate) x0: Vec<f64>,
    pub(crate) direction: Direction,
    pub(crate) options: ContinuationOptions,
    pub(crate) monitors: Vec<Monitor>,
    pub(crate) callback: Option<Py<PyAny>>,
}

impl Travel {
    pub(crate) fn along(self, run: &Run, map: &dyn PiecewiseSmooth) -> PyResult<(core::Branch, Names)> {
        let over = || run.poll().is_break();
        let mut curve =
            Continuation::new_until(map, &self.x0, self.direction, self.options, over).map_err(raised)?;
        for monitor in &self.monitors {
            let function = |x: &[f64]| monitor.value(run, x);
            curve = match monitor.stops {
                true => curve.with_stop(&monitor.name, function),
                false => curve.with_monitor(&monitor.name, function),
            };
        }
        let found = core::Branch::collect(curve, |event| told(run, self.callback.as_ref(), event));
        Ok((found.map_err(raised)?, Names::of(map)))
    }

    /// The same for a map whose kinks are not known.
    fn through(self, run: &Run, map: &dyn PiecewiseSmooth) -> PyResult<(core::Branch, Names)> {
        let mut curve = core::BlackBoxCurve::new(map, &self.x0, self.direction, self.options)
            .until(|| run.poll().is_break());
        for monitor in &self.monitors {
            let function = |x: &[f64]| monitor.value(run, x);
            curve = match monitor.stops {
                true => curve.with_stop(&monitor.name, function),
                false => curve.with_monitor(&monitor.name, function),
            };
        }
        let found = curve.follow_observed(|vertex| passed(run, self.callback.as_ref(), vertex));
        Ok((found.map_err(raised)?, Names::of(map)))
    }
}

/// Calls a callback with a point.
pub(crate) fn told(run: &Run, callback: Option<&Py<PyAny>>, event: &Event) -> ControlFlow<()> {
    passed(run, callback, &core::BranchVertex::from(event))
}

fn passed(run: &Run, callback: Option<&Py<PyAny>>, vertex: &core::BranchVertex<'_>) -> ControlFlow<()> {
    let Some(callback) = callback else {
        return run.poll();
    };
    let stop = run.call(|py| {
        let told = PyDict::new(py);
        told.set_item("event", vertex.event)?;
        told.set_item("x", PyArray1::from_slice(py, vertex.x))?;
        told.set_item("parameter", vertex.parameter())?;
        told.set_item("arclength", vertex.arclength)?;
        callback.bind(py).call1((told,))?.is_truthy()
    });
    match stop {
        Some(false) => run.poll(),
        _ => ControlFlow::Break(()),
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Branch>()?;
    module.add_class::<BranchPoint>()?;
    module.add_class::<Crossing>()?;
    module.add_class::<Fold>()?;
    module.add_class::<Transition>()?;
    module.add_function(wrap_pyfunction!(follow, module)?)
}
