//! Derivatives of batches of solutions.

use std::ffi::CString;
use std::ops::ControlFlow;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use semismooth::piecewise::Traced;
use semismooth::sensitivity::{Differentiability, SensitivityError};

use super::complementarity::check_values;
use super::{Given, Members, count, given, members_or, parts};
use crate::arrays::counted;
use crate::errors::Run;
use crate::map::{Map, Watched, trace_two};
use crate::saving::{data, data_of, field, state_of};

type Found = semismooth::sensitivity::Sensitivity<Traced<Watched<'static>>>;

/// Solutions of a batch as functions of their parameters, made by :func:`sensitivity` and :func:`solve_mcp` with a leading dimension.
///
/// A member without a derivative has NaN in its row, and a warning names it.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct BatchSensitivity {
    /// One map for all members, or one each where bounds differ.
    maps: Vec<Py<Map>>,
    sizes: (usize, usize),
    x: Vec<f64>,
    params: Vec<f64>,
    /// Why members have no derivative, known before.
    unsolved: Vec<Option<String>>,
}

impl BatchSensitivity {
    pub(super) fn new(
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
        let maps: Vec<Map> = py.detach(|| (0..maps).map(natural).collect());
        Ok(Self {
            maps: maps
                .into_iter()
                .map(|map| Py::new(py, map))
                .collect::<PyResult<_>>()?,
            sizes: (n, k),
            x,
            params,
            unsolved,
        })
    }

    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, own) = (slf.py(), slf.get());
        state_of(
            py,
            &[
                (
                    "maps",
                    PyList::new(py, own.maps.iter().map(|map| map.bind(py)))?.into_any(),
                ),
                ("sizes", data_of(py, &own.sizes)?),
                ("x", data_of(py, &own.x)?),
                ("params", data_of(py, &own.params)?),
                ("unsolved", data_of(py, &own.unsolved)?),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let made = Self {
            maps: field(state, "maps")?,
            sizes: data(state, "sizes")?,
            x: data(state, "x")?,
            params: data(state, "params")?,
            unsolved: data(state, "unsolved")?,
        };
        let (n, k) = made.sizes;
        let members = made.unsolved.len();
        // A file may have been changed; each member finds its numbers.
        let lengths = [(made.x.len(), members * n), (made.params.len(), members * k)];
        if lengths.iter().any(|(found, expected)| found != expected)
            || !(made.maps.len() == members || made.maps.len() == 1)
        {
            return Err(PyValueError::new_err(format!(
                "the saved state has numbers for another batch than one of {}",
                counted(members, "member")
            )));
        }
        Ok(Bound::new(py, made)?.into_any())
    }

    /// `work` for all members, and why it failed for some; of members without unknowns `nothing`.
    fn all<T: Send + Clone>(
        &self,
        py: Python<'_>,
        nothing: T,
        work: impl Fn(usize, &mut Found) -> Result<T, SensitivityError> + Sync,
    ) -> PyResult<Vec<Result<T, String>>> {
        let (n, k) = self.sizes;
        if n == 0 {
            return Ok(vec![Ok(nothing); self.unsolved.len()]);
        }
        Run::watched(py, |run| {
            let each = |_: &mut (), i: usize| {
                if let Some(why) = &self.unsolved[i] {
                    return Err(why.clone());
                }
                if run.flow() == ControlFlow::Break(()) {
                    return Err("interrupted".to_owned());
                }
                let map = self.maps[if self.maps.len() == 1 { 0 } else { i }].get().free();
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

#[pymethods]
impl BatchSensitivity {
    /// Number of members.
    fn __len__(&self) -> usize {
        self.unsolved.len()
    }

    /// Whether each solution is a differentiable function of its parameters: True, False, or None: not known, also where a member is not
    /// solved.
    #[getter]
    pub(super) fn differentiable(&self, py: Python<'_>) -> PyResult<Vec<Option<bool>>> {
        let all = self.all(
            py,
            Differentiability::Yes {
                margin: f64::INFINITY,
            },
            |_, found| found.differentiable(),
        )?;
        Ok(all.into_iter().map(|found| found.ok()?.known()).collect())
    }

    /// The directional derivatives along changes dp, shape (members, k), or (k,) for all: shape (members, n).
    pub(super) fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (py, (n, k)) = (dp.py(), self.sizes);
        let given = Given::new(dp, "dp")?;
        let dp = given.members(&[k])?;
        self.check(&dp, "dp")?;
        let all = self.all(py, Vec::new(), |i, found| found.jvp(dp.get(i)))?;
        let flat = self.rows(py, n, all)?;
        PyArray1::from_vec(py, flat).reshape([self.unsolved.len(), n])
    }

    /// The gradients in the parameters, shape (members, k), of functions of the solutions whose gradients are dx, shape (members, n), or (n,)
    /// for all.
    pub(super) fn vjp<'py>(&self, dx: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (py, (n, k)) = (dx.py(), self.sizes);
        let given = Given::new(dx, "dx")?;
        let dx = given.members(&[n])?;
        self.check(&dx, "dx")?;
        let all = self.all(py, vec![0.0; k], |i, found| found.vjp(dx.get(i)))?;
        let flat = self.rows(py, k, all)?;
        PyArray1::from_vec(py, flat).reshape([self.unsolved.len(), k])
    }

    /// The derivatives, shape (members, n, k); NaN, with a warning, where a solution is not known to be differentiable.
    pub(super) fn derivative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (n, k) = self.sizes;
        let all = self.all(py, Vec::new(), |_, found| {
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
