//! Lists of all solutions.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::enumeration::{self, Completeness, EnumerationOptions};
use semismooth::piecewise::{self, PiecewiseSmooth, Selection};

use crate::arrays::{counted, names, rows};
use crate::complementarity::Lcp;
use crate::contact::ContactProblem;
use crate::errors::{Run, raised};
use crate::map::Map;

/// One solution of a list.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Solution {
    /// The point, shape (m,); the parameter last where there is one.
    x: Py<PyArray1<f64>>,
    /// The pieces of each site, by name, of every selection in whose closed cell the point lies (64 of them if there are more than 256).
    pieces: Vec<Vec<String>>,
    /// The sign of the determinant for each of them: −1, 0 or 1, None where it is not known.
    det_signs: Vec<Option<i8>>,
    /// Distance to the nearest kink in terms of test functions; 0 on a kink.
    margin: f64,
    /// The local index (degree), where one or two active selections determine it.
    index: Option<i8>,
    /// max |Hᵢ(x)|, evaluated at the point returned.
    residual: f64,
}

/// A continuum of solutions.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Continuum {
    /// The pieces of each site, by name, of the selections whose solutions form it.
    pieces: Vec<Vec<String>>,
    /// 1 for a segment, a ray or a line.
    dimension: usize,
    /// The two ends of a segment, or the one end of a ray, shape (k, m).
    ends: Py<PyArray2<f64>>,
}

/// All solutions of a piecewise-affine equation, and whether the list is proven to be complete.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct SolutionSet {
    /// The solutions.
    solutions: Vec<Py<Solution>>,
    /// Their points, shape (number of solutions, m).
    points: Py<PyArray2<f64>>,
    /// Continua of solutions.
    continua: Vec<Py<Continuum>>,
    /// Whether every selection was examined or ruled out, which is proven in exact arithmetic for the numbers given.
    complete: bool,
    /// "complete", "incomplete" (the search was ended by a limit) or "not proven" (all selections were examined, but without a proof).
    status: &'static str,
    /// The largest residual of the solutions; 0 where there are none.
    residual: f64,
    /// The verdict: "complete", "incomplete: ..." with how far the search got, or "not proven: ..." with the reason.
    completeness: String,
    /// Sum of the local indices of a complete list without continua, where all are known.
    index_sum: Option<i64>,
    /// Partial selections tried.
    nodes: u64,
}

#[pymethods]
impl SolutionSet {
    fn __len__(&self) -> usize {
        self.solutions.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "<SolutionSet: {}, {}, {}>",
            counted(self.solutions.len(), "solution"),
            counted(self.continua.len(), "continuum"),
            self.completeness
        )
    }
}

impl SolutionSet {
    fn of(
        py: Python<'_>,
        map: &(dyn PiecewiseSmooth + Sync),
        parameter: f64,
        options: &EnumerationOptions,
    ) -> PyResult<Self> {
        let found = Run::detached(py, |run| {
            let stop = || run.poll().is_break();
            enumeration::all_solutions_until(map, parameter, options, &stop).map_err(raised)
        })?;
        Self::new(py, map, &found)
    }

    fn new(
        py: Python<'_>,
        map: &dyn PiecewiseSmooth,
        found: &enumeration::SolutionSet,
    ) -> PyResult<SolutionSet> {
        let pieces = |selections: &[Selection]| -> Vec<Vec<String>> {
            selections.iter().map(|s| names(map, s)).collect()
        };
        let m = map.num_vars();
        let residuals: Vec<f64> = found.solutions.iter().map(|s| residual(map, s)).collect();
        let solutions = found.solutions.iter().zip(&residuals).map(|(s, &residual)| {
            let solution = Solution {
                x: PyArray1::from_slice(py, &s.x).unbind(),
                pieces: pieces(&s.selections),
                det_signs: s.det_signs.clone(),
                margin: s.margin,
                index: s.index,
                residual,
            };
            Py::new(py, solution)
        });
        let continua = found.continua.iter().map(|c| {
            let continuum = Continuum {
                pieces: pieces(&c.selections),
                dimension: c.dimension,
                ends: rows(py, m, c.ends.iter().map(Vec::as_slice))?.unbind(),
            };
            Py::new(py, continuum)
        });
        Ok(Self {
            solutions: solutions.collect::<PyResult<_>>()?,
            points: rows(py, m, found.solutions.iter().map(|s| s.x.as_slice()))?.unbind(),
            continua: continua.collect::<PyResult<_>>()?,
            complete: found.completeness.is_complete(),
            status: match found.completeness {
                Completeness::Complete => "complete",
                Completeness::Incomplete { .. } => "incomplete",
                _ => "not proven",
            },
            residual: residuals
                .iter()
                .fold(0.0, |m, &v| if v > m || v.is_nan() { v } else { m }),
            completeness: found.completeness.to_string(),
            index_sum: found.index_sum,
            nodes: found.nodes,
        })
    }
}

/// max |Hᵢ(x)| on a selection in whose closed cell x lies: H is continuous, so that all of them agree.
fn residual(map: &dyn PiecewiseSmooth, solution: &enumeration::Solution) -> f64 {
    let own;
    let selection = match solution.selections.first() {
        Some(selection) => selection,
        None => {
            own = piecewise::select(map, &solution.x);
            &own
        }
    };
    let mut values = vec![0.0; map.num_residuals()];
    map.residual(selection, &solution.x, &mut values);
    // `max` would drop NaN, which is to be reported.
    values
        .into_iter()
        .fold(0.0, |m: f64, v| if v.is_nan() { v } else { m.max(v.abs()) })
}

/// All solutions of an Lcp, or of a piecewise-affine map H(x) = 0, at ``parameter`` where H has one variable more than values.
///
/// Parameters
/// ----------
/// problem : Lcp, Map or ContactProblem in the plane
///     See :func:`trace` for maps. Friction must not depend on the slip.
/// parameter : float
///     The last variable of a map with a parameter.
/// **options
///     max_nodes (1 000 000), max_time (60 seconds; None: no limit) and others of EnumerationOptions.
///
/// Returns
/// -------
/// SolutionSet
///
/// >>> import semismooth as ss
/// >>> found = ss.all_solutions(ss.Lcp([[-1.0]], [1.0]))
/// >>> found.points.ravel(), found.completeness
/// (array([0., 1.]), 'complete')
#[pyfunction]
#[pyo3(signature = (problem, parameter=0.0, **options))]
fn all_solutions(
    py: Python<'_>,
    problem: &Bound<'_, PyAny>,
    parameter: f64,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<SolutionSet> {
    let options: EnumerationOptions = crate::arrays::options(options, py)?;
    if let Ok(lcp) = problem.cast::<Lcp>() {
        let mcp = lcp.get().problem.mcp();
        return SolutionSet::of(py, mcp, parameter, &options);
    }
    if let Ok(contact) = problem.cast::<ContactProblem>() {
        contact.get().one_parameter()?;
        return SolutionSet::of(py, contact.get().form()?.map(), parameter, &options);
    }
    let Ok(map) = problem.cast::<Map>() else {
        return Err(PyTypeError::new_err(
            "all_solutions takes an Lcp, a Map or a ContactProblem: write semismooth.trace(H, num_vars)",
        ));
    };
    SolutionSet::of(py, map.get().own(), parameter, &options)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Solution>()?;
    module.add_class::<Continuum>()?;
    module.add_class::<SolutionSet>()?;
    module.add_function(wrap_pyfunction!(all_solutions, module)?)
}
