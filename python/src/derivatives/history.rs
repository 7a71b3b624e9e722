//! The last state of a history of loading as a function of the data of its problem.

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::contact::{self, ContactError, ContactParameters};
use semismooth::interface::{CondensedView, FullView};

use super::{Chosen, Parameters, Triple, gradients, triple};
use crate::arrays::start;
use crate::contact::Form;
use crate::errors::raised;
use crate::laws::Law;
use crate::solution::{ContactSolution, EvolutionStep};

/// The last state of a history of loading as a function of data of its problem, made by :func:`history_sensitivity`. Parameters are as
/// those of :class:`ContactSensitivity`, the same at all levels.
///
/// Gradients go backwards through the levels, with the factors of one level at a time.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct HistorySensitivity {
    solutions: Vec<Py<ContactSolution>>,
    parameters: Vec<Parameters>,
}

enum History {
    Full(contact::HistorySensitivity<FullView, Law>),
    Condensed(contact::HistorySensitivity<CondensedView, Law>),
}

macro_rules! of_history {
    ($history:expr, $own:ident => $value:expr) => {
        match $history {
            History::Full($own) => $value,
            History::Condensed($own) => $value,
        }
    };
}

impl HistorySensitivity {
    fn last(&self) -> &ContactSolution {
        self.solutions[self.solutions.len() - 1].get()
    }

    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&History) -> Result<T, ContactError> + Send,
    ) -> PyResult<T> {
        let form = self.last().problem.get().form()?;
        py.detach(|| {
            let states: Vec<Vec<f64>> = self.solutions.iter().map(|s| s.get().x.clone()).collect();
            let parameters: Vec<ContactParameters> = self.parameters.iter().map(|p| p.list.clone()).collect();
            let history = match form {
                Form::Full(p) => p.history_sensitivity(&states, &parameters).map(History::Full),
                Form::Condensed(p) => p
                    .history_sensitivity(&states, &parameters)
                    .map(History::Condensed),
            };
            history.and_then(|history| work(&history)).map_err(raised)
        })
    }
}

#[pymethods]
impl HistorySensitivity {
    /// Which entries of dp belong to what: a dict of slices.
    #[getter]
    fn slices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.parameters[0].slices(py)
    }

    /// Number of parameters.
    fn __len__(&self) -> usize {
        self.parameters[0].list.len()
    }

    /// True where the states of all levels are differentiable, so that the last is; None where that is not known of a level.
    #[getter]
    fn differentiable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        self.with(py, |history| of_history!(history, own => own.differentiable()))
    }

    /// The directional derivative of the last state along a change dp of the parameters, shape (k,) or a number: changes of displacements,
    /// pressures and tractions, as of :meth:`ContactSensitivity.jvp`. At kinks it is the one-sided one.
    fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Triple<'py>> {
        let (py, dp) = (dp.py(), start(dp, "dp")?);
        let changes = self.with(py, |history| of_history!(history, own => own.jvp(&dp)))?;
        triple(py, self.last(), &changes[changes.len() - 1])
    }

    /// The gradient in the parameters, shape (k,), of a function of the last state, as of :meth:`ContactSensitivity.vjp`.
    ///
    /// SemismoothError where a level is not known to be differentiable.
    #[pyo3(signature = (displacements=None, pressures=None, tractions=None))]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        displacements: Option<&Bound<'py, PyAny>>,
        pressures: Option<&Bound<'py, PyAny>>,
        tractions: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (of_u, forces) = gradients(self.last(), displacements, pressures, tractions)?;
        let gradient = self.with(py, |history| of_history!(history, own => own.vjp(&of_u, &forces)))?;
        Ok(PyArray1::from_vec(py, gradient))
    }

    fn __repr__(&self) -> String {
        self.parameters[0].described("HistorySensitivity")
    }
}

/// The last state of a history of loading as a function of data of its problem.
///
/// Parameters
/// ----------
/// start : ContactSolution
///     The solution that :func:`evolve` began with.
/// steps : list of EvolutionStep
///     What it returned, all levels.
/// parameter, loads, gaps, friction, young, poisson, positions, gap_gradients
///     As for :meth:`ContactSolution.sensitivity`: each changes the data of all levels alike, ``parameter`` the load parameters of all.
///
/// Returns
/// -------
/// HistorySensitivity
///     Not in reduced form, and not with friction that depends on the slip.
#[pyfunction]
#[pyo3(signature = (
    start, steps, *, parameter=false, loads=None, gaps=None, friction=None, young=None, poisson=None, positions=None, gap_gradients=None
))]
fn history_sensitivity(
    start: &Bound<'_, ContactSolution>,
    steps: Vec<Bound<'_, EvolutionStep>>,
    parameter: bool,
    loads: Option<&Bound<'_, PyAny>>,
    gaps: Option<&Bound<'_, PyAny>>,
    friction: Option<&Bound<'_, PyAny>>,
    young: Option<&Bound<'_, PyAny>>,
    poisson: Option<&Bound<'_, PyAny>>,
    positions: Option<&Bound<'_, PyAny>>,
    gap_gradients: Option<&Bound<'_, PyAny>>,
) -> PyResult<HistorySensitivity> {
    let chosen = Chosen {
        parameter,
        loads,
        gaps,
        friction,
        young,
        poisson,
        positions,
        gap_gradients,
    };
    let py = start.py();
    let mut solutions = vec![start.clone().unbind()];
    solutions.extend(steps.iter().map(|step| step.get().solution.clone_ref(py)));
    let problem = &start.get().problem;
    problem.get().form()?;
    if solutions.iter().any(|s| !s.get().problem.is(problem)) {
        return Err(PyValueError::new_err(
            "start and steps belong to different problems",
        ));
    }
    let parameters = solutions.iter().map(|s| Parameters::new(s.get(), &chosen));
    let made = HistorySensitivity {
        parameters: parameters.collect::<PyResult<_>>()?,
        solutions,
    };
    // What is no history of this problem, or one of its laws, is told at once.
    made.with(py, |history| of_history!(history, own => own.differentiable()))?;
    Ok(made)
}

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<HistorySensitivity>()?;
    module.add_function(wrap_pyfunction!(history_sensitivity, module)?)
}
