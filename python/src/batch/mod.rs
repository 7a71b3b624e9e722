//! Many problems at once: a leading dimension of the data, all cores, failures marked one by one.

mod complementarity;
mod friction;
mod sensitivity;

use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use numpy::{AllowTypeChange, PyArrayLikeDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use semismooth::InputError;
use semismooth::sparse::{Matrix, Pattern};

use crate::arrays::{counted, real};
use crate::errors::lock;

pub(crate) use complementarity::{BatchResult, lcps, mcps};
pub(crate) use friction::{FrictionBatch, frictions};
pub(crate) use sensitivity::{BatchSensitivity, sensitivities};

/// Members that share a solver, one after another: so few that all cores have work, and fixed, so that results do not depend on their number.
const TOGETHER: usize = 16;

/// An array with a leading dimension for the members of a batch, or without one: then all have the same.
pub(crate) struct Given<'py> {
    array: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    what: &'static str,
}

impl<'py> Given<'py> {
    pub(crate) fn new(object: &Bound<'py, PyAny>, what: &'static str) -> PyResult<Self> {
        real(object, what)?;
        let array = object.extract().map_err(|e: PyErr| {
            let error = PyTypeError::new_err(format!("{what} must be an array of numbers"));
            error.set_cause(object.py(), Some(e));
            error
        })?;
        Ok(Self { array, what })
    }

    fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    /// The data of members with the given shape.
    fn members(&self, own: &[usize]) -> PyResult<Members<'_>> {
        let shape = self.shape();
        let width = own.iter().product();
        let data = match self.array.as_slice() {
            Ok(data) => Cow::Borrowed(data),
            Err(_) => Cow::Owned(self.array.as_array().iter().copied().collect()),
        };
        let count = match shape {
            [] if width > 0 => {
                let value = data[0];
                return Ok(Members {
                    data: Cow::Owned(vec![value; width]),
                    width,
                    count: None,
                });
            }
            shape if shape == own => None,
            [count, rest @ ..] if rest == own => Some(*count),
            _ => {
                let list = |shape: &[usize]| {
                    shape
                        .iter()
                        .map(ToString::to_string)
                        .collect::<Vec<_>>()
                        .join(", ")
                };
                return Err(PyValueError::new_err(format!(
                    "{} has the shape ({}), expected ({}), or that behind the number of members of a batch",
                    self.what,
                    list(shape),
                    list(own)
                )));
            }
        };
        Ok(Members { data, width, count })
    }
}

struct Members<'a> {
    data: Cow<'a, [f64]>,
    width: usize,
    /// None where all members have the same.
    count: Option<usize>,
}

impl Members<'_> {
    fn of(width: usize, value: f64) -> Self {
        Self {
            data: Cow::Owned(vec![value; width]),
            width,
            count: None,
        }
    }

    fn get(&self, i: usize) -> &[f64] {
        match self.count {
            Some(_) => &self.data[i * self.width..(i + 1) * self.width],
            None => &self.data,
        }
    }
}

fn given<'py>(of: Option<&Bound<'py, PyAny>>, what: &'static str) -> PyResult<Option<Given<'py>>> {
    of.map(|o| Given::new(o, what)).transpose()
}

/// Vectors of n numbers, `value` where nothing is given.
fn members_or<'a>(given: &'a Option<Given<'_>>, n: usize, value: f64) -> PyResult<Members<'a>> {
    match given {
        Some(given) => given.members(&[n]),
        None => Ok(Members::of(n, value)),
    }
}

/// The number of members that all batches have in common; none where there is no batch.
fn count(all: &[(&'static str, &Members<'_>)]) -> PyResult<usize> {
    let mut batches = all.iter().filter_map(|(what, m)| Some((*what, m.count?)));
    let Some((first, count)) = batches.next() else {
        return Err(PyValueError::new_err("there is no batch"));
    };
    match batches.find(|(_, other)| *other != count) {
        Some((what, other)) => Err(PyValueError::new_err(format!(
            "{first} has {} and {what} {other}",
            counted(count, "member")
        ))),
        None => Ok(count),
    }
}

/// How many dimensions numpy sees in an object; 0 in one that it does not take for an array.
pub(crate) fn dimensions(object: Option<&Bound<'_, PyAny>>) -> usize {
    let Some(object) = object else { return 0 };
    match object.getattr("ndim").and_then(|ndim| ndim.extract::<usize>()) {
        Ok(ndim) => ndim,
        Err(_) => {
            let numpy = object.py().import("numpy");
            let ndim = numpy.and_then(|numpy| numpy.call_method1("ndim", (object,))?.extract::<usize>());
            ndim.unwrap_or(0)
        }
    }
}

/// The number of threads of a batch: that of the cores that this process may use, or of `SEMISMOOTH_NUM_THREADS`.
fn threads() -> usize {
    let wanted = std::env::var("SEMISMOOTH_NUM_THREADS");
    let wanted = wanted.ok().and_then(|text| text.parse().ok()).filter(|n| *n > 0);
    wanted.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// Calls `each` for the members of parts of a batch on all cores; a part begins with what `begin` makes. Threads live as long as the batch:
/// a pool that lasted would not survive where Python forks.
fn parts<S, R: Send>(
    count: usize,
    begin: impl Fn() -> S + Sync,
    each: impl Fn(&mut S, usize) -> R + Sync,
) -> Vec<R> {
    let number = count.div_ceil(TOGETHER);
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(number)));
    let work = || {
        loop {
            let part = next.fetch_add(1, Ordering::Relaxed);
            if part >= number {
                return;
            }
            let range = part * TOGETHER..count.min((part + 1) * TOGETHER);
            let mut state = begin();
            let found: Vec<R> = range.map(|i| each(&mut state, i)).collect();
            lock(&done).push((part, found));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads().min(number) {
            scope.spawn(work);
        }
        work();
    });
    let mut all = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    all.sort_unstable_by_key(|(part, _)| *part);
    all.into_iter().flat_map(|(_, found)| found).collect()
}

/// The square matrix with the given rows, one after the other.
fn square(pattern: &Pattern, rows: &[f64]) -> Result<Matrix, InputError> {
    let n = pattern.nrows();
    let columns = (0..n * n).map(|e| rows[e % n * n + e / n]).collect();
    Matrix::from_values(pattern.clone(), columns)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<BatchResult>()?;
    module.add_class::<BatchSensitivity>()?;
    module.add_class::<FrictionBatch>()
}
