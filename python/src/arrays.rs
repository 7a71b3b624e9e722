//! Conversion of vectors, matrices, options and names from and to Python.

use std::time::Duration;

use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike1, PyArrayLike2, PyArrayMethods};
use pyo3::exceptions::{PyException, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use semismooth::sparse::{Matrix, Pattern};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::errors::raised;

/// A vector from anything that numpy converts to an array of one dimension.
pub(crate) fn vector(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    real(object, what)?;
    let array: PyArrayLike1<'_, f64, AllowTypeChange> = object
        .extract()
        .map_err(|e| explained(object.py(), e, &format!("{what} must be a vector of numbers")))?;
    Ok(array.as_array().to_vec())
}

/// A start: a vector, or one number for a problem with one unknown.
pub(crate) fn start(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    match object.extract::<f64>() {
        Ok(value) => Ok(vec![value]),
        Err(_) => vector(object, what),
    }
}

/// Complex arrays are refused: numpy would leave out imaginary parts with a warning.
pub(crate) fn real(object: &Bound<'_, PyAny>, what: &str) -> PyResult<()> {
    let kind = object.getattr("dtype").and_then(|dtype| dtype.getattr("kind"));
    match kind.and_then(|kind| kind.extract::<String>()).as_deref() {
        Ok("c") => Err(PyTypeError::new_err(format!(
            "{what} has complex numbers; real ones are wanted"
        ))),
        _ => Ok(()),
    }
}

/// A bound: one number for all components, or one each.
pub(crate) fn bound(
    object: Option<&Bound<'_, PyAny>>,
    n: usize,
    default: f64,
    what: &str,
) -> PyResult<Vec<f64>> {
    match object {
        None => Ok(vec![default; n]),
        Some(object) => match object.extract::<f64>() {
            Ok(value) => Ok(vec![value; n]),
            Err(_) => vector(object, what),
        },
    }
}

/// A dense matrix, or a sparse one of scipy, whose sparsity pattern is kept.
pub(crate) fn matrix(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Matrix> {
    if let Some(sparse) = sparse(object)? {
        return sparse.matrix();
    }
    real(object, what)?;
    let array: PyArrayLike2<'_, f64, AllowTypeChange> = object.extract().map_err(|e| {
        explained(
            object.py(),
            e,
            &format!("{what} must be a matrix: an array of two dimensions or a scipy.sparse one"),
        )
    })?;
    let array = array.as_array();
    let (rows, columns) = array.dim();
    Matrix::from_values(Pattern::full(rows, columns), by_columns(&array)).map_err(raised)
}

/// Rows of a tile: so few that their cache lines stay in the cache.
const TILE: usize = 16;

/// The entries column by column, as `Matrix` stores them.
fn by_columns(array: &numpy::ndarray::ArrayView2<'_, f64>) -> Vec<f64> {
    let (rows, columns) = array.dim();
    let Some(entries) = array.as_slice() else {
        let columns = array.t();
        return match columns.as_slice() {
            Some(entries) => entries.to_vec(),
            None => columns.iter().copied().collect(),
        };
    };
    let mut values = vec![0.0; entries.len()];
    for first in (0..rows).step_by(TILE) {
        let tile = first..rows.min(first + TILE);
        for j in 0..columns {
            for i in tile.clone() {
                values[j * rows + i] = entries[i * columns + j];
            }
        }
    }
    values
}

/// A matrix of scipy in compressed column format.
pub(crate) struct Sparse {
    rows: usize,
    columns: usize,
    starts: Vec<usize>,
    indices: Vec<usize>,
    values: Vec<f64>,
}

/// Sparse matrices are recognised by their method `tocsc`, so that scipy need not be imported.
pub(crate) fn sparse(object: &Bound<'_, PyAny>) -> PyResult<Option<Sparse>> {
    if !object.hasattr("tocsc")? {
        return Ok(None);
    }
    let csc = object.call_method0("tocsc")?;
    if !csc.getattr("has_canonical_format")?.is_truthy()? {
        return sparse_of(&canonical(&csc)?).map(Some);
    }
    sparse_of(&csc).map(Some)
}

/// A copy without duplicates, its indices in order.
fn canonical<'py>(csc: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let own = csc.call_method0("copy")?;
    own.call_method0("sum_duplicates")?;
    Ok(own)
}

fn sparse_of(csc: &Bound<'_, PyAny>) -> PyResult<Sparse> {
    let (rows, columns) = csc.getattr("shape")?.extract()?;
    let positions = |name: &str| indices(&csc.getattr(name)?, &format!("{name} of a sparse matrix"));
    Ok(Sparse {
        rows,
        columns,
        starts: positions("indptr")?,
        indices: positions("indices")?,
        values: vector(&csc.getattr("data")?, "the data of a sparse matrix")?,
    })
}

impl Sparse {
    pub(crate) fn matrix(self) -> PyResult<Matrix> {
        let pattern =
            Pattern::from_csc(self.rows, self.columns, self.starts, self.indices).map_err(raised)?;
        Matrix::from_values(pattern, self.values).map_err(raised)
    }
}

/// Values, row indices and starts of columns.
pub(crate) type Columns<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
);

/// A matrix in compressed columns, as `scipy.sparse.csc_matrix` takes it.
pub(crate) fn columns<'py>(py: Python<'py>, matrix: &Matrix) -> Columns<'py> {
    let integers = |v: &[usize]| PyArray1::from_iter(py, v.iter().map(|k| *k as i64));
    let pattern = matrix.pattern();
    (
        PyArray1::from_slice(py, matrix.values()),
        integers(pattern.row_idx()),
        integers(pattern.col_ptr()),
    )
}

/// A matrix as a numpy array.
pub(crate) fn dense<'py>(py: Python<'py>, matrix: &Matrix) -> Bound<'py, PyArray2<f64>> {
    let array = PyArray2::zeros(py, [matrix.nrows(), matrix.ncols()], false);
    let mut view = array.readwrite();
    let mut view = view.as_array_mut();
    for (i, j, v) in matrix.triplets() {
        view[[i, j]] = v;
    }
    array
}

/// Vectors of one length as the rows of a numpy array.
pub(crate) fn rows<'py, 'v>(
    py: Python<'py>,
    columns: usize,
    vectors: impl IntoIterator<Item = &'v [f64]>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = vectors.into_iter().flatten().copied().collect();
    let rows = flat.len().checked_div(columns).unwrap_or(0);
    PyArray1::from_vec(py, flat).reshape([rows, columns])
}

/// "1 fold", "2 folds".
pub(crate) fn counted(count: usize, what: &str) -> String {
    let plural = match what {
        "vertex" => "vertices",
        "continuum" => "continua",
        "stretch" => "stretches",
        _ => return format!("{count} {what}{}", if count == 1 { "" } else { "s" }),
    };
    format!("{count} {}", if count == 1 { what } else { plural })
}

/// Points in space as the rows of a numpy array with the first `dim` coordinates.
pub(crate) fn truncated<'py>(
    py: Python<'py>,
    dim: usize,
    points: &[[f64; 3]],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    rows(py, dim, points.iter().map(|p| &p[..dim]))
}

/// Integers that are not negative.
pub(crate) fn indices(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<usize>> {
    let array: PyArrayLike1<'_, i64, AllowTypeChange> = object
        .extract()
        .map_err(|e| explained(object.py(), e, &format!("{what} must be a vector of integers")))?;
    let numbers: Result<_, _> = array.as_array().iter().map(|&v| usize::try_from(v)).collect();
    numbers.map_err(|_| PyValueError::new_err(format!("negative number in {what}")))
}

/// The pieces of a selection by name.
pub(crate) fn names(map: &dyn PiecewiseSmooth, selection: &Selection) -> Vec<String> {
    let pieces = selection.pieces().enumerate();
    pieces.map(|(s, p)| map.piece_name(s, p).into_owned()).collect()
}

/// Data of the library as dicts, lists, numbers and strings.
pub(crate) fn python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    Ok(pythonize::pythonize(py, value)?)
}

/// Seconds after which a run ends unless `max_time` says otherwise: as long as people wait for an answer. `max_time=None` is no limit.
const MAX_TIME: f64 = 60.0;

/// Options by their names in the library; what is not given has its default, `max_time` that of this package. Times are in seconds.
pub(crate) fn options<T: DeserializeOwned>(given: Option<&Bound<'_, PyDict>>, py: Python<'_>) -> PyResult<T> {
    let given = given.map_or_else(|| Ok(PyDict::new(py)), |g| g.copy())?;
    let limit = match given.get_item("max_time")? {
        Some(seconds) => seconds.extract()?,
        None => Some(MAX_TIME),
    };
    if let Some(seconds) = limit {
        let time = Duration::try_from_secs_f64(seconds)
            .map_err(|e| PyValueError::new_err(format!("max_time = {seconds} s: {e}")))?;
        given.set_item("max_time", pythonize::pythonize(py, &time)?)?;
    }
    if let Some(names) = given.get_item("strategies")? {
        given.set_item("strategies", strategies(&names)?)?;
    }
    let wrong = match pythonize::depythonize(&given) {
        Ok(options) => return Ok(options),
        Err(e) => e,
    };
    // The error does not name the option: each is tried alone.
    for (name, value) in given.iter() {
        let one = PyDict::new(py);
        one.set_item(&name, value)?;
        if let Err(e) = pythonize::depythonize::<T>(&one) {
            return Err(PyTypeError::new_err(format!("option {name}: {e}")));
        }
    }
    Err(PyTypeError::new_err(format!("options: {wrong}")))
}

/// Names of strategies in the words of results ("interior points") as the library's options write them; one need not be in a list.
fn strategies(given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    let names = match given.extract::<String>() {
        Ok(name) => vec![name],
        Err(_) => given
            .extract::<Vec<String>>()
            .map_err(|e| explained(given.py(), e, "strategies must be names of strategies in a list"))?,
    };
    let joined = |name: &String| {
        let words = name.split(|c: char| !c.is_alphanumeric());
        let capital = |word: &str| {
            let mut letters = word.chars();
            letters.next().map_or_else(String::new, |first| {
                first.to_uppercase().chain(letters).collect::<String>()
            })
        };
        words.map(capital).collect::<String>()
    };
    Ok(names.iter().map(joined).collect())
}

/// Like `options`, with `defaults` in place of those of the type.
pub(crate) fn options_over<T: Serialize + DeserializeOwned>(
    defaults: &T,
    given: Option<&Bound<'_, PyDict>>,
    py: Python<'_>,
) -> PyResult<T> {
    let all = python(py, defaults)?.cast_into::<PyDict>()?;
    all.del_item("max_time")?;
    if let Some(given) = given {
        all.update(given.as_mapping())?;
    }
    options(Some(&all), py)
}

/// A `TypeError` that says what was expected, with the failed conversion as its cause; `KeyboardInterrupt` and the like are passed on.
fn explained(py: Python<'_>, cause: PyErr, message: &str) -> PyErr {
    if !cause.is_instance_of::<PyException>(py) {
        return cause;
    }
    let error = PyTypeError::new_err(message.to_owned());
    error.set_cause(py, Some(cause));
    error
}
