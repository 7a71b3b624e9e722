//! Results as data: their fields by name, and results made of them again, for pickles, copies and files.

use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::arrays::python;
use crate::batch::{BatchResult, BatchSensitivity, FrictionBatch};
use crate::body::{Body, Load, Material};
use crate::complementarity::{Lcp, LemkeResult, McpResult};
use crate::contact::ContactProblem;
use crate::continuation::Branch;
use crate::diagram::{Diagram, Edge, Vertex};
use crate::events::{BranchPoint, Crossing, Fold, Transition};
use crate::foundation::{Foundation, Mortar};
use crate::friction::FrictionResult;
use crate::laws::{Bonded, Cohesion, Friction, GivenBound, LimitedShear, Wear};
use crate::lists::{Continuum, Solution, SolutionSet};
use crate::map::Map;
use crate::mesh::Mesh;
use crate::optimise::MinimiseResult;
use crate::sensitivity::Sensitivity;
use crate::solution::{ContactSolution, EvolutionStep};
use crate::stability::{BoundaryEquilibrium, HopfPoint, Spectrum, StabilityBranch};
use crate::transition_set::{CharacterChange, TransitionCurve};
use crate::variational::{ConeResult, ViResult};

/// A field of a state.
pub(crate) fn field<'py, T>(state: &Bound<'py, PyDict>, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let Some(value) = state.get_item(name)? else {
        return Err(PyKeyError::new_err(format!("the saved state has no \"{name}\"")));
    };
    value.extract().map_err(|e| {
        PyValueError::new_err(format!(
            "\"{name}\" of the saved state: {}",
            Into::<PyErr>::into(e)
        ))
    })
}

/// Data of the library in a field of a state.
pub(crate) fn data<T: DeserializeOwned>(state: &Bound<'_, PyDict>, name: &str) -> PyResult<T> {
    let value: Bound<'_, PyAny> = field(state, name)?;
    pythonize::depythonize(&value)
        .map_err(|e| PyValueError::new_err(format!("\"{name}\" of the saved state: {e}")))
}

/// A dict with some data of the library.
pub(crate) fn state_of<'py>(
    py: Python<'py>,
    entries: &[(&str, Bound<'py, PyAny>)],
) -> PyResult<Bound<'py, PyDict>> {
    let state = PyDict::new(py);
    for (name, value) in entries {
        state.set_item(name, value)?;
    }
    Ok(state)
}

pub(crate) fn data_of<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    python(py, value)
}

/// How an object was made, for those that are made again: by a class or by a method of an object.
pub(crate) struct Made {
    how: &'static str,
    of: Option<Py<PyAny>>,
    arguments: Py<PyTuple>,
    options: Py<PyDict>,
}

/// An argument by name, `None` where it was left out.
type Named<'a, 'py> = (&'static str, Option<&'a Bound<'py, PyAny>>);

impl Made {
    /// By a class ("new") or one of its functions.
    pub(crate) fn by<'py>(
        py: Python<'py>,
        how: &'static str,
        arguments: &[&Bound<'py, PyAny>],
        options: &[Named<'_, 'py>],
    ) -> PyResult<Self> {
        let named = PyDict::new(py);
        for (name, value) in options {
            named.set_item(name, *value)?;
        }
        Ok(Self {
            how,
            of: None,
            arguments: PyTuple::new(py, arguments)?.unbind(),
            options: named.unbind(),
        })
    }

    /// By a method of an object.
    pub(crate) fn from<'py>(
        object: &Bound<'py, PyAny>,
        how: &'static str,
        arguments: &[&Bound<'py, PyAny>],
    ) -> PyResult<Self> {
        let made = Self::by(object.py(), how, arguments, &[])?;
        Ok(Self {
            of: Some(object.clone().unbind()),
            ..made
        })
    }

    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let state = PyDict::new(py);
        state.set_item("how", self.how)?;
        state.set_item("of", &self.of)?;
        state.set_item("arguments", &self.arguments)?;
        state.set_item("options", &self.options)?;
        Ok(state)
    }
}

/// Methods that make objects: a file says no others.
const MAKERS: [&str; 18] = [
    "new",
    "plane",
    "gap",
    "lame",
    "tensor",
    "table",
    "exponential",
    "function",
    "scaled",
    "traction",
    "body_force",
    "motion",
    "with_second_parameter",
    "from_matrices",
    "__add__",
    "__sub__",
    "__mul__",
    "__neg__",
];

fn remade<'py>(py: Python<'py>, class: &str, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
    let (how, of): (String, Option<Bound<'py, PyAny>>) = (field(state, "how")?, field(state, "of")?);
    if !MAKERS.contains(&how.as_str()) {
        return Err(PyValueError::new_err(format!("no object is made by \"{how}\"")));
    }
    let maker = match of {
        Some(object) => object,
        None => py.import("semismooth._core")?.getattr(class)?,
    };
    let maker = if how == "new" {
        maker
    } else {
        maker.getattr(how.as_str())?
    };
    let (arguments, options): (Bound<'py, PyTuple>, Bound<'py, PyDict>) =
        (field(state, "arguments")?, field(state, "options")?);
    maker.call(arguments, Some(&options))
}

/// The classes whose objects are made again.
macro_rules! made {
    ($($class:ident),*) => {$(
        impl $class {
            fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
                slf.get().made.state(slf.py())
            }

            fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
                remade(py, stringify!($class), state)
            }
        }
    )*};
}

made!(
    Material,
    Load,
    Body,
    Foundation,
    Mortar,
    Friction,
    GivenBound,
    LimitedShear,
    Cohesion,
    Wear,
    Bonded,
    ContactProblem
);

/// The classes all of whose data are attributes.
macro_rules! plain {
    ($($class:ident { $($field:ident),* $(,)? })*) => {
        fn fields(name: &str) -> Option<&'static [&'static str]> {
            match name {
                $(stringify!($class) => Some(&[$(stringify!($field)),*]),)*
                _ => None,
            }
        }

        const PLAIN: &[&str] = &[$(stringify!($class)),*];

        fn made<'py>(py: Python<'py>, name: &str, state: &Bound<'py, PyDict>) -> PyResult<Option<Bound<'py, PyAny>>> {
            Ok(Some(match name {
                $(stringify!($class) => {
                    let made = $class { $($field: field(state, stringify!($field))?),* };
                    Bound::new(py, made)?.into_any()
                })*
                _ => return Ok(None),
            }))
        }
    };
}

plain! {
    McpResult {
        x, status, message, residual, error, states, iterations, evaluations, jacobians, factorisations, strategy, fallbacks,
        history, certificate, time, sensitivity,
    }
    LemkeResult { x, status, message, residual, pivots, ray, history }
    ViResult { x, status, residual, inequalities, equations, lower, upper, ray, certificate, within_rounding, iterations, history }
    ConeResult { x, status, residual, error, ray, radius, iterations, history }
    FrictionResult { reactions, velocities, states, status, residual, factorisations, history }
    BatchResult { x, status, solved, messages, residual, error, iterations, sensitivity }
    FrictionBatch { reactions, velocities, status, solved, messages, residual }
    MinimiseResult {
        params, x, value, status, message, subgradient, subgradient_norm, gradient_norm, error, radius, multipliers, iterations,
        evaluations, failures, history, time,
    }
    Solution { x, pieces, det_signs, margin, index, residual, continuum }
    Continuum { pieces, dimension, point, ends, directions, described }
    SolutionSet { solutions, points, continua, complete, status, residual, completeness, index_sum, nodes }
    Fold { x, parameter, kind, arclength }
    Spectrum { eigenvalues, unstable, undecided }
    HopfPoint { x, parameter, frequency, arclength, spectrum }
    BoundaryEquilibrium { transition, kind, before, after }
    StabilityBranch { branch, hopf, kinks, stretches, unexplained }
    BranchPoint { x, parameter, arms, followed, complete, arclength }
    Crossing { name, x, parameter, arclength, edge }
    CharacterChange { x, folds_before }
    TransitionCurve { branch, folds, character_changes }
    Vertex { x, parameter, kind, edges, complete, is_start }
    EvolutionStep { level, solution, folds, transitions, arrival, work, stored, dissipated, returned, history }
    Edge { points, tangents, pieces, ends, det_signs, point_det_signs, smooth_folds, vertical, arclength }
}

/// The classes with data of the library, which write and read their state themselves.
macro_rules! own {
    ($($class:ident),*) => {
        fn own_state<'py>(object: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyDict>>> {
            $(if let Ok(found) = object.cast::<$class>() {
                return $class::state(found).map(Some);
            })*
            Ok(None)
        }

        fn own_made<'py>(py: Python<'py>, name: &str, state: &Bound<'py, PyDict>) -> PyResult<Option<Bound<'py, PyAny>>> {
            match name {
                $(stringify!($class) => $class::restored(py, state).map(Some),)*
                _ => Ok(None),
            }
        }

        const OWN: &[&str] = &[$(stringify!($class)),*];
    };
}

own!(
    Branch,
    Transition,
    Diagram,
    Map,
    Sensitivity,
    BatchSensitivity,
    Lcp,
    Mesh,
    Material,
    Load,
    Body,
    Foundation,
    Mortar,
    Friction,
    GivenBound,
    LimitedShear,
    Cohesion,
    Wear,
    Bonded,
    ContactProblem,
    ContactSolution
);

/// The names of all classes whose objects can be saved.
#[pyfunction]
fn _saved_classes() -> Vec<&'static str> {
    PLAIN.iter().chain(OWN).copied().collect()
}

/// The data of an object, by name.
#[pyfunction]
fn _state<'py>(object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    if let Some(state) = own_state(object)? {
        return Ok(state);
    }
    let class = object.get_type().name()?.to_string();
    let names = fields(&class)
        .ok_or_else(|| PyTypeError::new_err(format!("objects of class {class} cannot be saved")))?;
    let state = PyDict::new(object.py());
    for name in names {
        state.set_item(name, object.getattr(*name)?)?;
    }
    Ok(state)
}

/// The object of a class with these data.
#[pyfunction]
fn _restored<'py>(py: Python<'py>, name: &str, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
    let found = match made(py, name, state)? {
        Some(found) => Some(found),
        None => own_made(py, name, state)?,
    };
    found.ok_or_else(|| PyValueError::new_err(format!("there is no class {name} that can be saved")))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_saved_classes, module)?)?;
    module.add_function(wrap_pyfunction!(_state, module)?)?;
    module.add_function(wrap_pyfunction!(_restored, module)?)
}
