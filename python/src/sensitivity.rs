//! Derivatives of solutions in parameters.

use std::sync::Mutex;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::piecewise::Traced;
use semismooth::sensitivity::Directional;
use semismooth::sparse::Matrix;

use crate::arrays::{bound, counted, dense, matrix, rows, start};
use crate::batch::{self, dimensions};
use crate::errors::{lock, raised};
use crate::map::{Map, Watched, trace_two};
use crate::saving::{data, data_of, field, state_of};

type Found = semismooth::sensitivity::Sensitivity<Traced<Watched<'static>>>;

/// A solution x of equations or of a complementarity problem as a function of parameters p, made by :func:`sensitivity`, or by
/// :func:`solve` and :func:`solve_mcp` with ``params``.
///
/// Where a component is at a bound and F is zero as well, or a formula of F switches, the solution may have one-sided derivatives only:
/// ``differentiable`` says so, and :meth:`jvp` gives them.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Sensitivity {
    /// x − mid(lower, x − F(x, p), upper) in the variables (x, p).
    map: Py<Map>,
    x: Vec<f64>,
    params: Vec<f64>,
    /// Factors, from the first use on.
    found: Mutex<Option<Found>>,
}

impl Sensitivity {
    pub(crate) fn new(py: Python<'_>, natural: Map, x: &[f64], params: &[f64]) -> PyResult<Self> {
        Ok(Self {
            map: Py::new(py, natural)?,
            x: x.to_vec(),
            params: params.to_vec(),
            found: Mutex::new(None),
        })
    }

    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, own) = (slf.py(), slf.get());
        state_of(
            py,
            &[
                ("map", own.map.bind(py).clone().into_any()),
                ("x", data_of(py, &own.x)?),
                ("params", data_of(py, &own.params)?),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let made = Self {
            map: field(state, "map")?,
            x: data(state, "x")?,
            params: data(state, "params")?,
            found: Mutex::new(None),
        };
        Ok(Bound::new(py, made)?.into_any())
    }

    /// Runs `work` without the interpreter's lock.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Found) -> Result<T, semismooth::sensitivity::SensitivityError> + Send,
    ) -> PyResult<T> {
        let map = self.map.get();
        py.detach(|| {
            let mut kept = lock(&self.found);
            let found = match kept.take() {
                Some(found) => found,
                None => Found::new(map.free(), &self.x, &self.params).map_err(raised)?,
            };
            work(kept.insert(found)).map_err(raised)
        })
    }
}

#[pymethods]
impl Sensitivity {
    /// The parameters p, shape (k,).
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.params)
    }

    /// Whether x is a differentiable function of p here: True, False (two one-sided derivatives were found that differ), or None: not known.
    #[getter]
    pub(crate) fn differentiable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        Ok(self.with(py, Found::differentiable)?.known())
    }

    /// The answer of ``differentiable`` in a sentence.
    #[getter]
    fn message(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.with(py, Found::differentiable)?.to_string())
    }

    /// The directional derivative of x along a change dp, shape (k,) or a number: shape (n,). At a kink it is the one-sided one, and
    /// ``jvp(-dp)`` is not ``-jvp(dp)``.
    ///
    /// SemismoothError where the solutions nearby are not known to be one function of p: see :meth:`branches`.
    pub(crate) fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (py, dp) = (dp.py(), start(dp, "dp")?);
        let found = self.with(py, |found| found.jvp(&dp))?;
        Ok(PyArray1::from_vec(py, found))
    }

    /// The gradient in p, shape (k,), of a function of x whose gradient is dx, shape (n,): the product with the transposed derivative. At a kink
    /// the derivative is the lexicographic one along the unit vectors, an element of the generalised derivative.
    pub(crate) fn vjp<'py>(&self, dx: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (py, dx) = (dx.py(), start(dx, "dx")?);
        let found = self.with(py, |found| found.vjp(&dx))?;
        Ok(PyArray1::from_vec(py, found))
    }

    /// The derivative ∂x/∂p, shape (n, k).
    ///
    /// SemismoothError where x is not known to be differentiable.
    pub(crate) fn derivative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(dense(py, &self.with(py, Found::derivative)?))
    }

    /// The lexicographic derivative, shape (n, k), along the rows of ``frame``, shape (k, k), linearly independent; unit vectors unless given. It is
    /// an element of the generalised derivative, and the derivative where there is one.
    #[pyo3(signature = (frame=None))]
    fn element<'py>(
        &self,
        py: Python<'py>,
        frame: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let k = self.params.len();
        let given = match frame {
            Some(frame) => matrix(frame, "frame")?,
            None => Matrix::identity(k),
        };
        let list: Vec<Vec<f64>> = (0..given.nrows())
            .map(|i| (0..given.ncols()).map(|j| given.get(i, j)).collect())
            .collect();
        Ok(dense(py, &self.with(py, |found| found.element(&list)?.matrix())?))
    }

    /// The directions of all solutions that leave x as p moves along dp, shape (number, n), and whether there are no others: at a fold
    /// there may be none or two.
    fn branches<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyArray2<f64>>, bool)> {
        let (py, dp) = (dp.py(), start(dp, "dp")?);
        let (list, complete) = match self.with(py, |found| found.directional(&dp))? {
            Directional::Derivative(v) => (vec![v], true),
            Directional::Branches { branches, complete } => (branches, complete),
            other => return Err(PyValueError::new_err(other.to_string())),
        };
        Ok((rows(py, self.x.len(), list.iter().map(Vec::as_slice))?, complete))
    }

    /// The largest s such that x(p + t dp), 0 < t < s, stays on one smooth piece: exact (inf where no kink is met) if F and the bounds are
    /// piecewise affine in (x, p); else the curve of solutions is followed up to ``horizon``, which is returned where no kink was met.
    #[pyo3(signature = (dp, horizon=1.0))]
    pub(crate) fn valid_until(&self, dp: &Bound<'_, PyAny>, horizon: f64) -> PyResult<f64> {
        let (py, dp) = (dp.py(), start(dp, "dp")?);
        Ok(self.with(py, |found| found.valid_until(&dp, horizon))?.until())
    }

    fn __repr__(&self) -> String {
        let (n, k) = (
            counted(self.x.len(), "unknown"),
            counted(self.params.len(), "parameter"),
        );
        format!("<Sensitivity of {n} to {k}>")
    }
}

/// The function F(x, p) of a problem, traced once.
pub(crate) struct Parametric {
    pub(crate) params: Vec<f64>,
    full: Map,
    n: usize,
}

impl Parametric {
    /// Of n unknowns and as many values.
    pub(crate) fn new(
        function: &Bound<'_, PyAny>,
        params: &Bound<'_, PyAny>,
        n: usize,
        others: bool,
    ) -> PyResult<Self> {
        if others {
            let what = "with params the function is traced: leave out jac and pattern";
            return Err(PyTypeError::new_err(what));
        }
        let params = start(params, "params")?;
        if let Some(k) = params.iter().position(|p| !p.is_finite()) {
            let what = format!("params[{k}] is {}; all must be finite", params[k]);
            return Err(PyValueError::new_err(what));
        }
        let full = trace_two(function.py(), function, n, params.len())?;
        match full.num_residuals() == n {
            true => Ok(Self { params, full, n }),
            false => Err(PyValueError::new_err(format!(
                "the function must give {n} values for {n} unknowns; it gives {}",
                full.num_residuals()
            ))),
        }
    }

    /// F at the parameters.
    pub(crate) fn fixed(&self) -> Map {
        self.full.fixed(self.n, &self.params)
    }

    pub(crate) fn sensitivity(
        &self,
        py: Python<'_>,
        lower: &[f64],
        upper: &[f64],
        x: &[f64],
    ) -> PyResult<Sensitivity> {
        Sensitivity::new(py, self.full.natural(lower, upper), x, &self.params)
    }
}

/// A solution x of F(x, p) = 0, or with bounds of the mixed complementarity problem, as a function of the parameters p.
///
/// Parameters
/// ----------
/// F : callable
///     ``F(x, p)`` for x of shape (n,) and p of shape (k,) gives n values. It is traced once: see :func:`trace`.
/// x : array of shape (n,), or number
///     A solution at ``params``.
/// params : array of shape (k,), or number
/// lower, upper : number or array of shape (n,), optional
///     Bounds, as in :func:`solve_mcp`.
///
/// Returns
/// -------
/// Sensitivity
///     With a leading dimension of x, (members, n), and of params, (members, k), a :class:`BatchSensitivity`: F is traced once.
///
/// >>> import numpy as np, semismooth as ss
/// >>> kink = ss.sensitivity(lambda x, p: x - np.maximum(p, 2 * p), 0.0, 0.0)
/// >>> kink.differentiable, kink.jvp(1.0), kink.jvp(-1.0)
/// (False, array([2.]), array([-1.]))
#[pyfunction]
#[pyo3(signature = (F, x, params, lower=None, upper=None))]
fn sensitivity(
    py: Python<'_>,
    F: &Bound<'_, PyAny>,
    x: &Bound<'_, PyAny>,
    params: &Bound<'_, PyAny>,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    if [Some(x), Some(params), lower, upper]
        .iter()
        .any(|v| dimensions(*v) > 1)
    {
        let made = batch::sensitivities(py, F, [x, params], [lower, upper])?;
        return Ok(Py::new(py, made)?.into_any());
    }
    let x = start(x, "x")?;
    let lower = bound(lower, x.len(), f64::NEG_INFINITY, "lower")?;
    let upper = bound(upper, x.len(), f64::INFINITY, "upper")?;
    let parametric = Parametric::new(F, params, x.len(), false)?;
    let made = parametric.sensitivity(py, &lower, &upper, &x)?;
    // A point that is no solution, or an irregular one, is told at once.
    made.with(py, |_| Ok(()))?;
    Ok(Py::new(py, made)?.into_any())
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Sensitivity>()?;
    module.add_function(wrap_pyfunction!(sensitivity, module)?)
}
