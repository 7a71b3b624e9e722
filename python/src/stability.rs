//! Stability of equilibria of differential equations.

use std::ops::ControlFlow;

use numpy::{Complex64, PyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::continuation::{ContinuationOptions, Event};
use semismooth::piecewise::{PiecewiseSmooth, Traced};
use semismooth::stability::{self as core, BoundaryKind, Dynamics};

use crate::arrays::{counted, vector};
use crate::contact::point;
use crate::continuation::{Branch, EVERYWHERE, Problem, direction, told};
use crate::errors::{Run, raised};
use crate::events::Transition;
use crate::map::{Watched, map_of};
use crate::names::{Names, variables};

/// Eigenvalues of y' = H(y, parameter), linearised at a point.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Spectrum {
    /// The eigenvalues, by decreasing real parts, shape (n,), complex.
    pub(crate) eigenvalues: Py<PyArray1<Complex64>>,
    /// How many have positive real parts.
    pub(crate) unstable: usize,
    /// How many have real parts that rounding hides: they are counted neither as positive nor as negative.
    pub(crate) undecided: usize,
}

impl Spectrum {
    fn new(py: Python<'_>, found: &core::Spectrum) -> PyResult<Py<Self>> {
        let eigenvalues = found.eigenvalues.iter().map(|z| Complex64::new(z.0, z.1));
        let made = Self {
            eigenvalues: PyArray1::from_iter(py, eigenvalues).unbind(),
            unstable: found.unstable,
            undecided: found.undecided,
        };
        Py::new(py, made)
    }
}

#[pymethods]
impl Spectrum {
    /// Whether all real parts are negative; None where rounding hides it.
    #[getter]
    fn stable(&self) -> Option<bool> {
        match (self.unstable, self.undecided) {
            (0, 0) => Some(true),
            (0, _) => None,
            _ => Some(false),
        }
    }

    fn __repr__(&self) -> String {
        let what = match self.stable() {
            Some(true) => "stable".to_owned(),
            Some(false) => format!(
                "{} with positive real parts",
                counted(self.unstable, "eigenvalue")
            ),
            None => "not decided".to_owned(),
        };
        format!("<Spectrum: {what}>")
    }
}

/// A point at which a pair of complex eigenvalues crosses the imaginary axis, located to rounding.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct HopfPoint {
    /// The point (y, parameter), shape (n + 1,).
    pub(crate) x: Py<PyArray1<f64>>,
    pub(crate) parameter: f64,
    /// ω of the pair ± iω.
    pub(crate) frequency: f64,
    /// Arclength from the start.
    pub(crate) arclength: f64,
    pub(crate) spectrum: Py<Spectrum>,
}

#[pymethods]
impl HopfPoint {
    fn __repr__(&self) -> String {
        format!(
            "<HopfPoint at parameter {}, frequency {}>",
            self.parameter, self.frequency
        )
    }
}

/// An equilibrium at a kink.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct BoundaryEquilibrium {
    /// The transition on the curve.
    pub(crate) transition: Py<Transition>,
    /// "persistence", "non-smooth fold", or the kind of the transition.
    pub(crate) kind: String,
    /// The eigenvalues on arrival.
    pub(crate) before: Py<Spectrum>,
    /// The eigenvalues on departure.
    pub(crate) after: Py<Spectrum>,
}

#[pymethods]
impl BoundaryEquilibrium {
    fn __repr__(&self) -> String {
        let counts = [&self.before, &self.after].map(|s| s.get().unstable);
        format!(
            "<BoundaryEquilibrium: {}; eigenvalues with positive real parts: {}, then {}>",
            self.kind, counts[0], counts[1]
        )
    }
}

/// Both ends, and the number of eigenvalues with positive real parts between them.
type Stretch = (Py<PyArray1<f64>>, Py<PyArray1<f64>>, usize);

/// A curve of equilibria with its stability, made by :func:`follow_equilibria`.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct StabilityBranch {
    /// The curve, whose crossings are the Hopf points, two at each: one for each eigenvalue.
    pub(crate) branch: Py<Branch>,
    /// The Hopf points, along the curve.
    pub(crate) hopf: Vec<Py<HopfPoint>>,
    /// The equilibria at kinks, along the curve: one for each transition.
    pub(crate) kinks: Vec<Py<BoundaryEquilibrium>>,
    /// The curve from point to point, events among them: (one end, the other, number of eigenvalues with positive
    /// real parts between them).
    pub(crate) stretches: Vec<Stretch>,
    /// Arclengths of the ends of stretches that hide events: smaller steps find them.
    pub(crate) unexplained: Vec<(f64, f64)>,
}

impl StabilityBranch {
    fn new(py: Python<'_>, found: core::StabilityBranch, names: Names, m: usize) -> PyResult<Self> {
        let hopf = found.hopf.iter().map(|h| {
            let made = HopfPoint {
                x: PyArray1::from_slice(py, &h.point.x).unbind(),
                parameter: h.parameter(),
                frequency: h.frequency,
                arclength: h.point.arclength,
                spectrum: Spectrum::new(py, &h.spectrum)?,
            };
            Py::new(py, made)
        });
        let hopf = hopf.collect::<PyResult<_>>()?;
        let stretches = found.stretches.iter().map(|s| {
            let [from, to] = [0, 1].map(|k| PyArray1::from_slice(py, &s.ends[k]).unbind());
            (from, to, s.unstable)
        });
        let stretches = stretches.collect();
        let branch = Py::new(py, Branch::new(py, found.branch, names, m)?)?;
        let kinks = found.kinks.iter().enumerate().map(|(k, kink)| {
            let kind = match kink.kind {
                BoundaryKind::Persistence => "persistence",
                BoundaryKind::NonsmoothFold => "non-smooth fold",
                _ => kink.transition.kind.name(),
            };
            let made = BoundaryEquilibrium {
                transition: branch.get().transition(py, k),
                kind: kind.to_owned(),
                before: Spectrum::new(py, &kink.before)?,
                after: Spectrum::new(py, &kink.after)?,
            };
            Py::new(py, made)
        });
        Ok(Self {
            kinks: kinks.collect::<PyResult<_>>()?,
            branch,
            hopf,
            stretches,
            unexplained: found.unexplained,
        })
    }
}

#[pymethods]
impl StabilityBranch {
    fn __repr__(&self) -> String {
        let stable = self.stretches.iter().filter(|s| s.2 == 0).count();
        format!(
            "<StabilityBranch: {}, {}; {} stable, {} not>",
            counted(self.hopf.len(), "Hopf point"),
            counted(self.kinks.len(), "kink"),
            counted(stable, "stretch"),
            self.stretches.len() - stable
        )
    }

    /// Draws the curve with matplotlib and returns the axes: solid where it is stable and dashed where not, with markers as
    /// :meth:`Branch.plot`.
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
            .call_method1("plot_stability", (slf, ax, x, y, style))
    }
}

fn dynamics<'a>(
    map: &'a Traced<Watched<'a>>,
    x: &[f64],
    mass: Option<Vec<f64>>,
) -> PyResult<Dynamics<'a, Traced<Watched<'a>>>> {
    let (m, n) = (map.num_vars(), map.num_residuals());
    if (m, n + 1) != (x.len(), x.len()) {
        return Err(PyValueError::new_err(format!(
            "for a point of length {} H must give {} values; it gives {n} for {m} variables",
            x.len(),
            x.len().saturating_sub(1)
        )));
    }
    let made = Dynamics::new(map);
    match mass {
        Some(mass) => made.with_mass(mass).map_err(raised),
        None => Ok(made),
    }
}

fn diagonal(mass: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f64>>> {
    mass.map(|mass| vector(mass, "mass")).transpose()
}

/// The eigenvalues of y' = H(y, parameter), or M y' = H, linearised at a point.
///
/// Parameters
/// ----------
/// H : callable or Map
///     ``H(x)`` for x = (y, parameter) of shape (n + 1,) gives the n right-hand sides: value i is the rate of y[i]. See :func:`trace`.
/// x : array of shape (n + 1,)
///     An equilibrium, or another point; at a kink the piece in whose cell it lies counts.
/// mass : array of shape (n,), optional
///     The diagonal of M; zeros mark algebraic equations, which must determine as many unknowns.
///
/// Returns
/// -------
/// Spectrum
///
/// >>> import semismooth as ss
/// >>> ss.spectrum(lambda x: [x[2] * x[0] - x[1], x[0] + x[2] * x[1]], [0.0, 0.0, -0.5])
/// <Spectrum: stable>
#[pyfunction]
#[pyo3(signature = (H, x, mass=None))]
fn spectrum(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    x: &Bound<'_, PyAny>,
    mass: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<Spectrum>> {
    let (x, mass) = (vector(x, "x")?, diagonal(mass)?);
    let map = map_of(H, x.len())?;
    let map = map.get();
    let found = py.detach(|| dynamics(&map.free(), &x, mass)?.spectrum(&x).map_err(raised))?;
    Spectrum::new(py, &found)
}

/// Follows the equilibria of y' = H(y, parameter), or M y' = H, from ``x0``, with their eigenvalues.
///
/// Hopf points are located to rounding, as folds and branch points are; at kinks the eigenvalues of both
/// sides are given. That H = 0 has the same solutions is not enough: value i of H must be the rate of y[i].
///
/// Parameters
/// ----------
/// H : callable or Map
///     ``H(x)`` for x = (y, parameter) of shape (n + 1,) gives n values. It is traced: see :func:`trace`.
/// x0 : array of shape (n + 1,)
///     Start; corrected onto the curve at its parameter.
/// parameter_range, direction, callback, names, **options
///     As for :func:`follow`.
/// mass : array of shape (n,), optional
///     The diagonal of M; zeros mark algebraic equations.
///
/// Returns
/// -------
/// StabilityBranch
///
/// >>> import semismooth as ss
/// >>> def brusselator(x):
/// ...     u, v, b = x
/// ...     return [1 + u**2 * v - (b + 1) * u, b * u - u**2 * v]
/// >>> found = ss.follow_equilibria(brusselator, [1.0, 1.0, 1.0], parameter_range=(1.0, 3.0))
/// >>> [(round(h.parameter, 9), round(h.frequency, 9)) for h in found.hopf]
/// [(2.0, 1.0)]
#[pyfunction]
#[pyo3(signature = (H, x0, parameter_range=None, direction=None, *, mass=None, callback=None, names=None, **options))]
fn follow_equilibria(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    x0: &Bound<'_, PyAny>,
    parameter_range: Option<(f64, f64)>,
    direction: Option<&Bound<'_, PyAny>>,
    mass: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    names: Option<Vec<String>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<StabilityBranch> {
    let (x0, mass) = (point(x0)?, diagonal(mass)?);
    let (travel, m) = (self::direction(direction)?, x0.len());
    let options = crate::arrays::options::<ContinuationOptions>(options, py)?
        .with_parameter_range(parameter_range.unwrap_or(EVERYWHERE));
    let variables = variables(names, m)?;
    let traced = map_of(H, m)?;
    let formula = traced.get();
    let (found, names) = Run::detached(py, |run| {
        let map = formula.traced(run);
        let observe = |event: &Event| -> ControlFlow<()> { told(run, callback.as_ref(), event) };
        let found = dynamics(&map, &x0, mass)?
            .follow_observed(&x0, travel, options, observe)
            .map_err(raised)?;
        Ok((found, Names::of(&map)))
    })?;
    StabilityBranch::new(
        py,
        found,
        names.with(&Problem::Map(traced.unbind()), variables),
        m,
    )
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Spectrum>()?;
    module.add_class::<HopfPoint>()?;
    module.add_class::<BoundaryEquilibrium>()?;
    module.add_class::<StabilityBranch>()?;
    module.add_function(wrap_pyfunction!(spectrum, module)?)?;
    module.add_function(wrap_pyfunction!(follow_equilibria, module)?)
}
