//! Reports as pages of HTML.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use semismooth::output::{Report, ReportOptions};
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};

use crate::arrays::vector;
use crate::contact::{ContactProblem, Form};
use crate::continuation::Problem;
use crate::errors::{Run, raised};
use crate::given::Origin;
use crate::names::variables;

/// Sites up to which pieces are called by their formulas.
const FEW: usize = 1000;

/// Write a report: one page of HTML on a problem with a parameter, the load, for readers who know nothing of nonsmooth analysis.
///
/// The curve of solutions with its events, folds and what happens there, the numbers of solutions at some loads and how far they are known,
/// distances to the nearest kink; of bodies in contact the first slip and lift-off of each node, reactions, energies and pictures; how all
/// this was computed, and what is not proven. Browsers print it, also as PDF.
///
/// Parameters
/// ----------
/// problem : callable, Map, or ContactProblem in condensed form
///     As for :func:`follow`.
/// path : str or path
///     The file, which is replaced.
/// parameter_range : (float, float), optional
///     The first and the last value of the parameter. Either this or ``levels``.
/// x0 : array of shape (n,), optional
///     An estimate of the unknowns at the first value; for a callable or a Map. A contact problem is solved there.
/// levels : array of shape (k,), optional
///     For a contact problem: a report on the history of loading through these levels, the first of which is the start.
/// loads : array of shape (l,), optional
///     Values of the parameter at which solutions are counted; five equidistant ones unless given, and one between any two neighbouring folds.
/// title : str, optional
///     The heading.
/// names : list of str, optional
///     Names of the n + 1 variables, the parameter last.
/// drawn : list of int, optional
///     The unknowns that are drawn, by their positions; the first two unless given.
/// max_time : float
///     Seconds for each of three parts: the curve, the lists of solutions, all curves through them.
///
/// >>> import pathlib, tempfile
/// >>> import semismooth as ss
/// >>> def beam(x):
/// ...     y, load = x
/// ...     return [y - 1.25 * ss.maximum(y - 1, 0) + 10 * ss.maximum(y - 3, 0) - load]
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "beam.html"
/// >>> ss.report(beam, path, (0.0, 2.0), [0.0], names=["y", "load"])
/// >>> "fold: the load turns back" in path.read_text(encoding="utf-8")
/// True
#[pyfunction]
#[pyo3(signature = (
    problem, path, parameter_range=None, x0=None, *, levels=None, loads=None, title=None, names=None, drawn=None, max_time=20.0
))]
pub(crate) fn report(
    py: Python<'_>,
    problem: &Bound<'_, PyAny>,
    path: PathBuf,
    parameter_range: Option<(f64, f64)>,
    x0: Option<&Bound<'_, PyAny>>,
    levels: Option<&Bound<'_, PyAny>>,
    loads: Option<&Bound<'_, PyAny>>,
    title: Option<String>,
    names: Option<Vec<String>>,
    drawn: Option<Vec<usize>>,
    max_time: f64,
) -> PyResult<()> {
    let max_time = Duration::try_from_secs_f64(max_time)
        .map_err(|e| PyValueError::new_err(format!("max_time = {max_time}: {e}")))?;
    let mut options = ReportOptions::default()
        .with_max_time(max_time)
        .with_drawn(drawn.unwrap_or_default());
    if let Some(title) = title {
        options = options.with_title(title);
    }
    if let Some(loads) = loads {
        options = options.with_loads(vector(loads, "loads")?);
    }
    let report = match (problem.cast::<ContactProblem>(), x0) {
        (Ok(problem), None) => {
            let levels = levels.map(|l| vector(l, "levels")).transpose()?;
            of_contact(problem, parameter_range, levels, &options)?
        }
        (Ok(_), Some(_)) => {
            return Err(PyValueError::new_err(
                "a contact problem is solved at its first load: leave out x0",
            ));
        }
        (Err(_), Some(x0)) if levels.is_none() => {
            let (from, to) = parameter_range.ok_or_else(|| wanted("parameter_range"))?;
            let mut x = vector(x0, "x0")?;
            x.push(from);
            of_map(py, problem, &x, to, names, options)?
        }
        (Err(_), Some(_)) => {
            return Err(PyValueError::new_err(
                "levels are for contact problems: leave them out",
            ));
        }
        (Err(_), None) => return Err(wanted("x0")),
    };
    report.write(&path).map_err(raised)
}

fn wanted(name: &str) -> PyErr {
    PyValueError::new_err(format!("{name} is wanted for this problem"))
}

fn of_map(
    py: Python<'_>,
    function: &Bound<'_, PyAny>,
    x: &[f64],
    to: f64,
    names: Option<Vec<String>>,
    options: ReportOptions,
) -> PyResult<Report> {
    let problem = Problem::formula(function, x, 1)?;
    let given = variables(names, x.len())?;
    let names = match given.is_empty() {
        true => (0..x.len()).map(|k| format!("x[{k}]")).collect(),
        false => given,
    };
    Run::detached(py, |run| {
        let map = problem.map(run)?;
        let options = match &problem {
            // A formula is found by going through all of them.
            Problem::Map(own) if map.num_sites() <= FEW => {
                let label = |site, k| own.get().label(site, k, &names);
                let name = |site, k| label(site, k).unwrap_or_else(|| map.piece_name(site, k).into_owned());
                let pieces = |site| (0..map.num_pieces(site)).map(|k| name(site, k)).collect();
                options.with_pieces((0..map.num_sites()).map(pieces).collect())
            }
            _ => options,
        };
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        Report::of_map(&*map, &names, x, to, &options, |_| run.poll()).map_err(raised)
    })
}

fn of_contact(
    problem: &Bound<'_, ContactProblem>,
    range: Option<(f64, f64)>,
    levels: Option<Vec<f64>>,
    options: &ReportOptions,
) -> PyResult<Report> {
    let (py, own) = (problem.py(), problem.get());
    own.one_parameter()?;
    let Form::Condensed(condensed) = own.form()? else {
        return Err(PyValueError::new_err(
            "reports are on problems in condensed form: write form=\"condensed\"",
        ));
    };
    let origin = own.origin.clone_ref(py);
    Run::detached(py, |run| {
        let observe = |_: &str| -> ControlFlow<()> { run.poll() };
        let body = match &origin {
            Origin::Mesh { body, rows } => Some((&body.get().system, &**rows)),
            Origin::Matrices(_) => None,
        };
        match (range, levels) {
            (Some((from, to)), None) => {
                Report::of_contact(condensed, body, [from, to], options, observe).map_err(raised)
            }
            (None, Some(levels)) => {
                Report::of_history(&mut condensed.clone(), body, &levels, options, observe).map_err(raised)
            }
            _ => Err(PyValueError::new_err(
                "one of parameter_range and levels is wanted",
            )),
        }
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(report, module)?)
}
