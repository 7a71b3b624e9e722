//! Lists of all solutions.

use std::time::Duration;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList};
use semismooth::continuation::{FoundSolution, FoundSolutions, SearchOptions, search_solutions_observed};
use semismooth::enumeration::{self, Completeness, EnumerationError, EnumerationOptions};
use semismooth::piecewise::{self, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, cell_margin};

use crate::arrays::{counted, names, rows, vector};
use crate::complementarity::Lcp;
use crate::contact::ContactProblem;
use crate::errors::{Run, raised};
use crate::map::{Map, map_of};
use crate::names::{number, size};

/// Coordinates up to which a point is shown.
const SHOWN: usize = 6;

/// One solution of a list.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Solution {
    /// The point, shape (m,); the parameter last where there is one.
    pub(crate) x: Py<PyArray1<f64>>,
    /// The pieces of each site, by name, of every selection in whose closed cell the point lies (64 of them if there are more than 256).
    pub(crate) pieces: Vec<Vec<String>>,
    /// The sign of the determinant for each of them: −1, 0 or 1, None where it is not known.
    pub(crate) det_signs: Vec<Option<i8>>,
    /// Distance to the nearest kink in terms of test functions; 0 on a kink.
    pub(crate) margin: f64,
    /// The local index (degree), where one or two active selections determine it.
    pub(crate) index: Option<i8>,
    /// max |Hᵢ(x)|, evaluated at the point returned.
    pub(crate) residual: f64,
    /// The number of the first listed continuum to which the point belongs, often as an end; None if there is
    /// none: in a complete list the point is isolated.
    pub(crate) continuum: Option<usize>,
}

#[pymethods]
impl Solution {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let x = self.x.bind(py).to_vec()?;
        let shown = x.iter().take(SHOWN).map(|v| number(*v, &x));
        let more = if x.len() > SHOWN { ", …" } else { "" };
        let index = self
            .index
            .map_or_else(String::new, |index| format!(", index {index}"));
        let text = shown.collect::<Vec<_>>().join(", ");
        Ok(format!(
            "<Solution: ({text}{more}){index}, margin {}>",
            size(self.margin)
        ))
    }
}

/// A continuum of solutions.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct Continuum {
    /// The pieces of each site, by name, of the selections whose solutions form it.
    pub(crate) pieces: Vec<Vec<String>>,
    /// 1 for a segment, a ray or a line.
    pub(crate) dimension: usize,
    /// One of its points, shape (m,): inside of it if it is described. Empty where none is known.
    pub(crate) point: Py<PyArray1<f64>>,
    /// The two ends of a segment, the one end of a ray, the vertices of a polyhedron, shape (k, m).
    pub(crate) ends: Py<PyArray2<f64>>,
    /// Directions in which it is unbounded, shape (k, n), of the n unknowns without the parameter; of a line
    /// both.
    pub(crate) directions: Py<PyArray2<f64>>,
    /// Whether it is the convex hull of its ends (of its point, where it has none) with all nonnegative
    /// multiples of its directions added.
    pub(crate) described: bool,
}

/// All solutions of a piecewise-affine equation, and whether the list is proven to be complete.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct SolutionSet {
    /// The solutions.
    pub(crate) solutions: Vec<Py<Solution>>,
    /// Their points, shape (number of solutions, m).
    pub(crate) points: Py<PyArray2<f64>>,
    /// Continua of solutions.
    pub(crate) continua: Vec<Py<Continuum>>,
    /// Whether every selection was examined or ruled out, which is proven in exact arithmetic for the numbers given.
    pub(crate) complete: bool,
    /// "complete", "incomplete" (the search was ended by a limit), "not proven" (all selections were examined, but without a proof) or
    /// "searched" (for a map with curved pieces, from many starts: there may be other solutions).
    pub(crate) status: String,
    /// The largest residual of the solutions; 0 where there are none.
    pub(crate) residual: f64,
    /// The verdict: "complete", "incomplete: ..." with how far the search got, or "not proven: ..." with the reason; for contact problems
    /// with tangents that are held, with the remark that it concerns symmetric solutions only.
    pub(crate) completeness: String,
    /// Sum of the local indices of a complete list without continua, where all are known.
    pub(crate) index_sum: Option<i64>,
    /// Partial selections tried.
    pub(crate) nodes: u64,
}

#[pymethods]
impl Continuum {
    fn __repr__(&self, py: Python<'_>) -> String {
        let ends = self.ends.bind(py).readonly().as_array().nrows();
        format!(
            "<Continuum of dimension {}: {}>",
            self.dimension,
            counted(ends, "end")
        )
    }
}

#[pymethods]
impl SolutionSet {
    fn __len__(&self) -> usize {
        self.solutions.len()
    }

    /// The solutions, one after another.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        let solutions = self.solutions.iter().map(|s| s.clone_ref(py));
        PyList::new(py, solutions)?.into_any().try_iter()
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<Py<Solution>> {
        let count = self.solutions.len();
        let at = if index < 0 {
            index.checked_add_unsigned(count)
        } else {
            Some(index)
        };
        let found = at
            .and_then(|at| usize::try_from(at).ok())
            .and_then(|at| self.solutions.get(at));
        let found =
            found.ok_or_else(|| PyIndexError::new_err(format!("there are {}", counted(count, "solution"))));
        Ok(found?.clone_ref(py))
    }

    /// The solutions as a table, for notebooks.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("semismooth._views")?
            .call_method1("list_html", (slf,))
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
        let found = Self::listed(py, map, parameter, options)?.map_err(raised)?;
        Self::new(py, map, &found)
    }

    fn listed(
        py: Python<'_>,
        map: &(dyn PiecewiseSmooth + Sync),
        parameter: f64,
        options: &EnumerationOptions,
    ) -> PyResult<Result<enumeration::SolutionSet, EnumerationError>> {
        Run::detached(py, |run| {
            let stop = || run.poll().is_break();
            Ok(enumeration::all_solutions_until(map, parameter, options, &stop))
        })
    }

    /// What a search from many starts finds, for maps whose pieces are curved.
    fn searched(
        py: Python<'_>,
        map: &Map,
        parameter: f64,
        starts: &[Vec<f64>],
        max_time: Option<Duration>,
    ) -> PyResult<Self> {
        let mut options = SearchOptions::default();
        options.max_time = max_time;
        let found = Run::detached(py, |run| {
            let observe = |_: &FoundSolutions| run.poll();
            search_solutions_observed(&map.traced(run), parameter, starts, &options, observe).map_err(raised)
        })?;
        let (map, layout) = (map.own(), TestLayout::new(map.own()));
        let mut tests = vec![0.0; layout.total()];
        let mut margin = |s: &FoundSolution| {
            map.tests_of_selection(&s.selection, &s.x, None, &mut tests);
            let margins = (s.selection.pieces().enumerate())
                .map(|(site, piece)| cell_margin(map.cell(site, piece), &tests[layout.range(site)]));
            margins.fold(f64::INFINITY, f64::min).max(0.0)
        };
        let residuals: Vec<f64> = (found.solutions.iter())
            .map(|s| residual(map, std::slice::from_ref(&s.selection), &s.x))
            .collect();
        let solutions = found.solutions.iter().zip(&residuals).map(|(s, &residual)| {
            let solution = Solution {
                x: PyArray1::from_slice(py, &s.x).unbind(),
                pieces: vec![names(map, &s.selection)],
                det_signs: vec![s.det_sign],
                margin: margin(s),
                index: s.index,
                residual,
                continuum: None,
            };
            Py::new(py, solution)
        });
        let continua = match found.continua {
            0 => String::new(),
            many => format!("; {} at this parameter", counted(many, "continuum")),
        };
        Ok(Self {
            solutions: solutions.collect::<PyResult<_>>()?,
            points: rows(py, map.num_vars(), found.solutions.iter().map(|s| s.x.as_slice()))?.unbind(),
            continua: Vec::new(),
            complete: false,
            status: "searched".to_owned(),
            residual: largest(&residuals),
            completeness: format!(
                "not proven: found by a search from many starts, there may be others{continua}"
            ),
            index_sum: found.index_sum,
            nodes: found.runs as u64,
        })
    }

    fn new(
        py: Python<'_>,
        map: &dyn PiecewiseSmooth,
        found: &enumeration::SolutionSet,
    ) -> PyResult<SolutionSet> {
        let pieces = |selections: &[Selection]| -> Vec<Vec<String>> {
            selections.iter().map(|s| names(map, s)).collect()
        };
        let (m, n) = (map.num_vars(), map.num_residuals());
        let residuals: Vec<f64> = (found.solutions.iter())
            .map(|s| residual(map, &s.selections, &s.x))
            .collect();
        let solutions = found.solutions.iter().zip(&residuals).map(|(s, &residual)| {
            let solution = Solution {
                x: PyArray1::from_slice(py, &s.x).unbind(),
                pieces: pieces(&s.selections),
                det_signs: s.det_signs.clone(),
                margin: s.margin,
                index: s.index,
                residual,
                continuum: s.continuum,
            };
            Py::new(py, solution)
        });
        let continua = found.continua.iter().map(|c| {
            let continuum = Continuum {
                pieces: pieces(&c.selections),
                dimension: c.dimension,
                point: PyArray1::from_slice(py, &c.point).unbind(),
                ends: rows(py, m, c.ends.iter().map(Vec::as_slice))?.unbind(),
                directions: rows(py, n, c.directions.iter().map(Vec::as_slice))?.unbind(),
                described: c.described,
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
            }
            .to_owned(),
            residual: largest(&residuals),
            completeness: found.completeness.to_string(),
            index_sum: found.index_sum,
            nodes: found.nodes,
        })
    }
}

/// What a list does not say where tangents are held.
const SYMMETRIC: &str = " (symmetric solutions only: tangents are held, as on planes of symmetry)";

fn largest(residuals: &[f64]) -> f64 {
    let worse = |m, &v: &f64| if v > m || v.is_nan() { v } else { m };
    residuals.iter().fold(0.0, worse)
}

/// max |Hᵢ(x)| on a selection in whose closed cell x lies: H is continuous, so that all of them agree.
fn residual(map: &dyn PiecewiseSmooth, selections: &[Selection], x: &[f64]) -> f64 {
    let own;
    let selection = match selections.first() {
        Some(selection) => selection,
        None => {
            own = piecewise::select(map, x);
            &own
        }
    };
    let mut values = vec![0.0; map.num_residuals()];
    map.residual(selection, x, &mut values);
    // `max` would drop NaN, which is to be reported.
    values
        .into_iter()
        .fold(0.0, |m: f64, v| if v.is_nan() { v } else { m.max(v.abs()) })
}

/// All solutions of an Lcp, or of an equation H(x) = 0, at ``parameter`` where H has one variable more than values: proven to be all where its
/// pieces are affine; where they are curved, those that a search finds (``status`` says which).
///
/// Parameters
/// ----------
/// problem : callable, Map, Lcp, or ContactProblem in the plane
///     A function is traced: see :func:`trace`. Friction must not depend on the slip.
/// parameter : float
///     The last variable of a map with a parameter.
/// num_vars : int, optional
///     The number of variables of a function, with the parameter if there is one. Default: as many as the function itself determines.
/// starts : array of shape (k, num_vars), optional
///     Points from which a search begins.
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
/// >>> curved = ss.all_solutions(lambda x: [abs(x[0]) - x[0] ** 2 / 4])
/// >>> sorted(curved.points[:, 0].round(9).tolist()), curved.status
/// ([-4.0, 0.0, 4.0], 'searched')
#[pyfunction]
#[pyo3(signature = (problem, parameter=0.0, *, num_vars=None, starts=None, **options))]
fn all_solutions(
    py: Python<'_>,
    problem: &Bound<'_, PyAny>,
    parameter: f64,
    num_vars: Option<usize>,
    starts: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<SolutionSet> {
    let options: EnumerationOptions = crate::arrays::options(options, py)?;
    if let Ok(lcp) = problem.cast::<Lcp>() {
        let mcp = lcp.get().problem.mcp();
        return SolutionSet::of(py, mcp, parameter, &options);
    }
    if let Ok(contact) = problem.cast::<ContactProblem>() {
        contact.get().one_parameter()?;
        let mut found = SolutionSet::of(py, contact.get().form()?.map(), parameter, &options)?;
        if contact.get().origin.num_held() > 0 {
            found.completeness.push_str(SYMMETRIC);
        }
        return Ok(found);
    }
    let starts = match starts {
        None => Vec::new(),
        Some(one) if one.extract::<Vec<f64>>().is_ok_and(|one| !one.is_empty()) => {
            vec![vector(one, "starts")?]
        }
        Some(many) => (many.try_iter()?)
            .map(|start| vector(&start?, "a start"))
            .collect::<PyResult<_>>()?,
    };
    let map = match (problem.cast::<Map>(), num_vars.or(starts.first().map(Vec::len))) {
        (Ok(map), _) => map.clone(),
        (Err(_), Some(n)) => map_of(problem, n)?,
        (Err(_), None) => {
            let counted = py.import("semismooth._arrays")?.getattr("with_own_variables")?;
            counted.call1((problem,))?.cast_into::<Map>()?
        }
    };
    let map = map.get();
    match SolutionSet::listed(py, map.own(), parameter, &options)? {
        Ok(found) => SolutionSet::new(py, map.own(), &found),
        // Curved pieces, or too many of them: nothing can be proven.
        Err(EnumerationError::NotAffine { .. } | EnumerationError::TooLarge { .. }) => {
            SolutionSet::searched(py, map, parameter, &starts, options.max_time)
        }
        Err(other) => Err(raised(other)),
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Solution>()?;
    module.add_class::<Continuum>()?;
    module.add_class::<SolutionSet>()?;
    module.add_function(wrap_pyfunction!(all_solutions, module)?)
}
