//! Transitions as curves in a second parameter.

use std::ops::ControlFlow;

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::continuation::{BranchVertex, ContinuationOptions, TransitionSet};

use crate::arrays::counted;
use crate::contact::point;
use crate::continuation::{Branch, EVERYWHERE, Problem, Travel};
use crate::errors::{Run, raised};

/// A point of a transition set at which its transitions change between folds and pass-throughs.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct CharacterChange {
    /// The point (y, α, β), shape (n + 2,).
    pub(crate) x: Py<PyArray1<f64>>,
    /// Whether the transitions before it, in the direction of travel, are folds.
    pub(crate) folds_before: bool,
}

#[pymethods]
impl CharacterChange {
    fn __repr__(&self) -> &'static str {
        match self.folds_before {
            true => "<CharacterChange: from folds to pass-throughs>",
            false => "<CharacterChange: from pass-throughs to folds>",
        }
    }
}

#[pymethods]
impl TransitionCurve {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let points = counted(self.branch.bind(py).len()?, "point");
        let changes = counted(self.character_changes.len(), "change");
        Ok(format!("<TransitionCurve: {points}, {changes} of character>"))
    }
}

/// A transition as a curve in a second parameter.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct TransitionCurve {
    /// The points (y, α, β), the second parameter last. Its own transitions are points of codimension two.
    pub(crate) branch: Py<Branch>,
    /// For each point of the branch, whether α folds there; None where that is not known.
    pub(crate) folds: Vec<Option<bool>>,
    /// Where ``folds`` changes between transitions of the branch.
    pub(crate) character_changes: Vec<Py<CharacterChange>>,
}

/// Follows a transition of a two-parameter family H(y, α, β) = 0 as a curve in β: the points at which one test function vanishes.
///
/// Parameters
/// ----------
/// H : callable, Map or ContactProblem
///     ``H(x)`` for x of shape (n + 2,), both parameters last, gives n values; it is traced: see :func:`trace`. A contact problem
///     gets its second parameter by :meth:`ContactProblem.with_second_parameter`.
/// x0 : array of shape (n + 2,)
///     Start: the x of a transition, then β; corrected at its β.
/// site, test : int
///     The site that switches (one of ``sites`` of the transition) and which of its test functions vanishes, both counted from 0.
/// parameter_range, direction, callback, **options
///     As for :func:`follow`, the parameter being β.
///
/// Returns
/// -------
/// TransitionCurve
///
/// >>> import semismooth as ss
/// >>> # y + max(y, 0) = α + β has its kink at α = -β.
/// >>> curve = ss.transition_set(lambda x: [x[0] + ss.maximum(x[0], 0) - x[1] - x[2]], [0.0, 0.0, 0.0], 0, parameter_range=(0.0, 1.0))
/// >>> curve.branch.points[-1].round(9).tolist(), curve.folds[-1]
/// ([0.0, -1.0, 1.0], False)
#[pyfunction]
#[pyo3(signature = (H, x0, site, test=0, parameter_range=None, direction=None, *, callback=None, **options))]
fn transition_set(
    py: Python<'_>,
    H: &Bound<'_, PyAny>,
    x0: &Bound<'_, PyAny>,
    site: usize,
    test: usize,
    parameter_range: Option<(f64, f64)>,
    direction: Option<&Bound<'_, PyAny>>,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<TransitionCurve> {
    let x0 = point(x0)?;
    let problem = Problem::formula(H, &x0, 2)?;
    let travel = Travel {
        direction: crate::continuation::direction(direction)?,
        options: crate::arrays::options::<ContinuationOptions>(options, py)?
            .with_parameter_range(parameter_range.unwrap_or(EVERYWHERE)),
        monitors: Vec::new(),
        callback,
        x0,
    };
    let m = travel.x0.len();
    let (found, names, folds, changes) = Run::detached(py, |run| {
        let set = TransitionSet::new(problem.map(run)?, site, test).map_err(raised)?;
        let (found, names) = travel.along(run, &set)?;
        let at = |v: &BranchVertex<'_>| match run.poll() {
            ControlFlow::Break(()) => Ok(None),
            ControlFlow::Continue(()) => set.is_fold(v.selection, v.x).map_err(raised),
        };
        let folds = found.vertices().iter().map(at).collect::<PyResult<Vec<_>>>()?;
        let changes = match run.is_broken() {
            true => Vec::new(),
            false => set.character_changes(&found).map_err(raised)?,
        };
        Ok((found, names, folds, changes))
    })?;
    let changes = changes.iter().map(|c| {
        let change = CharacterChange {
            x: PyArray1::from_slice(py, &c.x).unbind(),
            folds_before: c.folds_before,
        };
        Py::new(py, change)
    });
    Ok(TransitionCurve {
        branch: Py::new(py, Branch::new(py, found, names, m)?)?,
        folds,
        character_changes: changes.collect::<PyResult<_>>()?,
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<CharacterChange>()?;
    module.add_class::<TransitionCurve>()?;
    module.add_function(wrap_pyfunction!(transition_set, module)?)
}
