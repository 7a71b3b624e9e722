//! Contact solutions as functions of the data of their problem.

mod history;

use std::sync::Mutex;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use semismooth::contact::{self, ContactChange, ContactError, ContactParameters};
use semismooth::fem::MaterialConstant;
use semismooth::interface::{CondensedView, FullView};
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sensitivity::{SensitivityError, valid_along};
use semismooth::sparse::Matrix;

use crate::arrays::{counted, dense, matrix, rows, start, vector};
use crate::body::Load;
use crate::contact::{ContactProblem, Form, Route, begun, of_form};
use crate::errors::{SemismoothError, lock, raised};
use crate::solution::ContactSolution;

/// Of the forms that keep factors.
enum Found {
    Full(contact::ContactSensitivity<FullView>),
    Condensed(contact::ContactSensitivity<CondensedView>),
}

/// Why problems were not followed: what Python raised, or what the library found.
enum Stopped {
    Raised(PyErr),
    Found(SensitivityError),
}

impl From<SensitivityError> for Stopped {
    fn from(error: SensitivityError) -> Self {
        Self::Found(error)
    }
}

macro_rules! of_found {
    ($found:expr, $own:ident => $value:expr) => {
        match $found {
            Found::Full($own) => $value,
            Found::Condensed($own) => $value,
        }
    };
}

/// A contact solution as a function of data of its problem, made by :meth:`ContactSolution.sensitivity`. Parameters are measured as changes,
/// in one vector, dp; ``slices`` says which of its entries belong to what.
///
/// At a kink (a node at the limit of sticking, or just touching) there may be one-sided derivatives only: ``differentiable`` says so, and
/// :meth:`jvp` gives them. Problems in reduced form take one linear solve with multigrid for each derivative, at a kink two and one for each
/// force of the nodes that it is at.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct ContactSensitivity {
    #[pyo3(get)]
    solution: Py<ContactSolution>,
    parameters: Parameters,
    found: Mutex<Option<Found>>,
}

/// What of a problem its solution is a function of.
#[derive(Default)]
pub(crate) struct Chosen<'a, 'py> {
    pub(crate) parameter: bool,
    pub(crate) loads: Option<&'a Bound<'py, PyAny>>,
    pub(crate) gaps: Option<&'a Bound<'py, PyAny>>,
    pub(crate) friction: Option<&'a Bound<'py, PyAny>>,
    pub(crate) young: Option<&'a Bound<'py, PyAny>>,
    pub(crate) poisson: Option<&'a Bound<'py, PyAny>>,
    pub(crate) positions: Option<&'a Bound<'py, PyAny>>,
    pub(crate) gap_gradients: Option<&'a Bound<'py, PyAny>>,
}

/// The identity for True, nothing for False or None, else a matrix of one column for each parameter.
fn columns(given: Option<&Bound<'_, PyAny>>, count: usize, what: &str) -> PyResult<Option<Matrix>> {
    let Some(given) = given.filter(|g| !g.is_none()) else {
        return Ok(None);
    };
    match given.extract::<bool>() {
        Ok(true) => Ok(Some(Matrix::identity(count))),
        Ok(false) => Ok(None),
        Err(_) => matrix(given, what).map(Some),
    }
}

/// Names of groups of cells: None for all cells, or a list of these.
fn groups(given: Option<&Bound<'_, PyAny>>, what: &str) -> PyResult<Vec<Option<String>>> {
    let Some(given) = given.filter(|g| !g.is_none()) else {
        return Ok(Vec::new());
    };
    match given.extract::<bool>() {
        Ok(true) => Ok(vec![None]),
        Ok(false) => Ok(Vec::new()),
        Err(_) if given.extract::<String>().is_ok() => Ok(vec![Some(given.extract()?)]),
        Err(_) => given.extract().map_err(|_| {
            PyTypeError::new_err(format!(
                "{what} is True (all cells), the name of a group of cells, or a list of names; None in it stands for all cells"
            ))
        }),
    }
}

fn beside(n: usize, vectors: &[Vec<f64>]) -> PyResult<Matrix> {
    let entries: Vec<_> = (vectors.iter().enumerate())
        .flat_map(|(j, v)| v.iter().enumerate().map(move |(i, v)| (i, j, *v)))
        .collect();
    Matrix::from_triplets(n, vectors.len(), &entries).map_err(raised)
}

/// The parameters at a solution, and which of them belong to what.
struct Parameters {
    list: ContactParameters,
    names: Vec<(&'static str, usize)>,
}

impl ContactSensitivity {
    pub(crate) fn new(solution: &Bound<'_, ContactSolution>, chosen: &Chosen<'_, '_>) -> PyResult<Self> {
        Ok(Self {
            solution: solution.clone().unbind(),
            parameters: Parameters::new(solution.get(), chosen)?,
            found: Mutex::new(None),
        })
    }
}

impl Parameters {
    fn new(own: &ContactSolution, chosen: &Chosen<'_, '_>) -> PyResult<Self> {
        let problem = own.problem.get();
        let (n, p) = (problem.num_displacements(), problem.num_contacts());
        let list = match &problem.route {
            Route::Mapped(form) => match form.as_ref() {
                Form::Condensed(problem) => problem.parameters(),
                Form::Full(problem) => problem.parameters(),
            },
            Route::Reduced(reduced) => begun(reduced)?.parameters(),
        };
        let mut made = Self {
            list,
            names: Vec::new(),
        };
        if chosen.parameter {
            made.add("parameter", |own| Ok(own.with_alpha()))?;
        }
        if let Some(loads) = loads(chosen.loads, n)? {
            made.add("loads", |own| own.with_loads(&loads))?;
        }
        if let Some(gaps) = columns(chosen.gaps, p, "gaps")? {
            made.add("gaps", |own| own.with_gaps(&gaps))?;
        }
        if let Some(weights) = columns(chosen.friction, p, "friction")? {
            let law = problem.shifted.clone().ok_or_else(|| {
                PyValueError::new_err(
                    "derivatives in the coefficient of friction are those of Coulomb friction with one coefficient at each node",
                )
            })?;
            made.add("friction", |own| own.with_law(law, &weights))?;
        }
        made.with_materials(own, problem, chosen)?;
        made.with_positions(own, problem, chosen)?;
        if made.list.is_empty() {
            return Err(PyValueError::new_err(
                "name the data that the solution is a function of: parameter, loads, gaps, friction, young, poisson, positions",
            ));
        }
        Ok(made)
    }

    fn add(
        &mut self,
        name: &'static str,
        with: impl FnOnce(ContactParameters) -> Result<ContactParameters, ContactError>,
    ) -> PyResult<()> {
        let made = with(self.list.clone()).map_err(raised)?;
        self.names.push((name, made.len() - self.list.len()));
        self.list = made;
        Ok(())
    }

    fn with_materials(
        &mut self,
        own: &ContactSolution,
        problem: &ContactProblem,
        chosen: &Chosen<'_, '_>,
    ) -> PyResult<()> {
        for (name, given, constant) in [
            ("young", chosen.young, MaterialConstant::Young),
            ("poisson", chosen.poisson, MaterialConstant::Poisson),
        ] {
            let groups = groups(given, name)?;
            if groups.is_empty() {
                continue;
            }
            let system = &problem.origin.body("material")?.get().system;
            let u = own.all_displacements(system)?;
            let forces = groups.iter().map(|group| {
                let found = system.forces_by_material(&u, constant, group.as_deref());
                found.map_err(raised)
            });
            let forces = beside(system.num_free(), &forces.collect::<PyResult<Vec<_>>>()?)?;
            self.add(name, |own| own.with_body(&forces, None))?;
        }
        Ok(())
    }

    fn with_positions(
        &mut self,
        own: &ContactSolution,
        problem: &ContactProblem,
        chosen: &Chosen<'_, '_>,
    ) -> PyResult<()> {
        let Some(given) = chosen.positions.filter(|g| !g.is_none()) else {
            return Ok(());
        };
        let system = &problem.origin.body("mesh")?.get().system;
        let contact = problem.origin.rows("contact nodes")?;
        let (dim, nodes) = (problem.dim(), system.mesh().num_nodes());
        let mut fields = Vec::new();
        for (k, field) in given.try_iter()?.enumerate() {
            let field = matrix(&field?, "a field of positions")?;
            if (field.nrows(), field.ncols()) != (nodes, dim) {
                return Err(PyValueError::new_err(format!(
                    "positions is a list of fields of shape ({nodes}, {dim}), the velocities of all nodes; field {k} has shape ({}, {})",
                    field.nrows(),
                    field.ncols()
                )));
            }
            let all = (0..nodes).flat_map(|n| (0..dim).map(move |d| (n, d)));
            fields.push(all.map(|(n, d)| field.get(n, d)).collect::<Vec<f64>>());
        }
        let gradients = match chosen.gap_gradients.filter(|g| !g.is_none()) {
            Some(given) => {
                let given = matrix(given, "gap_gradients")?;
                if (given.nrows(), given.ncols()) != (contact.nodes.len(), dim) {
                    return Err(PyValueError::new_err(format!(
                        "gap_gradients has shape ({}, {}), expected ({}, {dim})",
                        given.nrows(),
                        given.ncols(),
                        contact.nodes.len()
                    )));
                }
                let at = |i: usize| std::array::from_fn(|d| if d < dim { given.get(i, d) } else { 0.0 });
                (0..contact.nodes.len()).map(at).collect::<Vec<[f64; 3]>>()
            }
            None if contact.normals.iter().all(|n| *n == contact.normals[0]) => {
                contact.normals.iter().map(|n| n.map(|v| -v)).collect()
            }
            None => {
                return Err(PyValueError::new_err(
                    "normals differ from node to node: derivatives in positions are those of a plane foundation",
                ));
            }
        };
        let u = own.all_displacements(system)?;
        let by_position = system.forces_by_position(&u).map_err(raised)?;
        let place = |at: [f64; 3]| contact.points.iter().position(|p| *p == at);
        let traces = contact
            .traces_by_position(system, |at| place(at).map_or([f64::NAN; 3], |i| gradients[i]))
            .map_err(raised)?;
        let times = |by: &Matrix| {
            let product = |field: &Vec<f64>| {
                let mut out = vec![0.0; by.nrows()];
                by.mul_vec(field, &mut out);
                out
            };
            beside(by.nrows(), &fields.iter().map(product).collect::<Vec<_>>())
        };
        let (forces, traces) = (times(&by_position)?, times(&traces)?);
        self.add("positions", |own| own.with_body(&forces, Some(&traces)))
    }

    /// Which entries belong to what.
    fn slices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (slices, mut first) = (PyDict::new(py), 0);
        for (name, count) in &self.names {
            let slice = PySlice::new(py, first as isize, (first + count) as isize, 1);
            slices.set_item(name, slice)?;
            first += count;
        }
        Ok(slices)
    }

    fn described(&self, what: &str) -> String {
        let names: Vec<&str> = self.names.iter().map(|n| n.0).collect();
        let count = counted(self.list.len(), "parameter");
        format!("<{what} to {count}: {}>", names.join(", "))
    }
}

/// Changes in the shapes of a solution's displacements, pressures and tractions.
fn triple<'py>(py: Python<'py>, own: &ContactSolution, change: &ContactChange) -> PyResult<Triple<'py>> {
    let (p, dim) = (own.problem.get().num_contacts(), own.problem.get().dim());
    let traction = |i: usize| (1..dim).map(|d| change.forces[d * p + i]).collect::<Vec<_>>();
    let tractions: Vec<Vec<f64>> = (0..p).map(traction).collect();
    Ok((
        own.in_shape(py, &change.displacements)?,
        PyArray1::from_slice(py, &change.forces[..p]),
        rows(py, dim - 1, tractions.iter().map(Vec::as_slice))?,
    ))
}

/// Gradients in the free displacements and in the forces from those in the shapes of a solution, zeros where they are left out.
fn gradients(
    own: &ContactSolution,
    displacements: Option<&Bound<'_, PyAny>>,
    pressures: Option<&Bound<'_, PyAny>>,
    tractions: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let (p, dim) = (own.problem.get().num_contacts(), own.problem.get().dim());
    let of_u = own.free_of(displacements)?;
    let mut forces = match pressures {
        Some(given) => vector(given, "pressures")?,
        None => vec![0.0; p],
    };
    let wrong =
        |what: &str, shape: String| PyValueError::new_err(format!("{what} must have the shape {shape}"));
    if forces.len() != p {
        return Err(wrong("pressures", format!("({p},)")));
    }
    match tractions {
        None => forces.resize(dim * p, 0.0),
        Some(given) => {
            let given = matrix(given, "tractions")?;
            if (given.nrows(), given.ncols()) != (p, dim - 1) {
                return Err(wrong("tractions", format!("({p}, {})", dim - 1)));
            }
            let all = (0..dim - 1).flat_map(|d| (0..p).map(move |i| (i, d)));
            forces.extend(all.map(|(i, d)| given.get(i, d)));
        }
    }
    Ok((of_u, forces))
}

impl ContactSensitivity {
    /// Runs `work` on kept factors without the interpreter's lock, or `reduced` on a problem in reduced form.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Found) -> Result<T, SensitivityError> + Send,
        reduced: impl FnOnce(&mut contact::ReducedSensitivity<'_>) -> Result<T, SensitivityError> + Send,
    ) -> PyResult<T> {
        let own = self.solution.get();
        let problem = own.problem.get();
        py.detach(|| match &problem.route {
            Route::Mapped(form) => {
                let mut kept = lock(&self.found);
                let found = match kept.take() {
                    Some(found) => found,
                    None => match form.as_ref() {
                        Form::Condensed(p) => {
                            p.sensitivity(&own.x, &self.parameters.list).map(Found::Condensed)
                        }
                        Form::Full(p) => p.sensitivity(&own.x, &self.parameters.list).map(Found::Full),
                    }
                    .map_err(raised)?,
                };
                work(kept.insert(found)).map_err(raised)
            }
            Route::Reduced(of) => {
                let u = &own.x[..problem.num_displacements()];
                let alpha = own.x[own.x.len() - 1];
                let mut of = begun(of)?;
                let mut found = of.sensitivity(alpha, u, &self.parameters.list).map_err(raised)?;
                reduced(&mut found).map_err(raised)
            }
        })
    }

    /// How far the solution keeps its states in the problems that a function gives.
    fn valid_along(&self, dp: &[f64], horizon: f64, problem: &Bound<'_, PyAny>) -> PyResult<f64> {
        let own = self.solution.get();
        let count = self.parameters.list.len();
        if dp.len() != count {
            return Err(PyValueError::new_err(format!(
                "dp has {} entries for {count} parameters",
                dp.len()
            )));
        }
        let changes_parameter = self.parameters.names.first().is_some_and(|n| n.0 == "parameter");
        let rate = if changes_parameter { dp[0] } else { 0.0 };
        let (x, alpha) = own.x.split_at(own.x.len() - 1);
        let family = |s: f64| -> Result<_, Stopped> {
            let given = problem.call1((s,)).map_err(Stopped::Raised)?;
            let given = given.cast::<ContactProblem>().map_err(|_| {
                let what = "problem must give a ContactProblem for each s";
                Stopped::Raised(PyTypeError::new_err(what))
            })?;
            let map: Box<dyn PiecewiseSmooth> = match &given.get().route {
                Route::Mapped(form) => of_form!(form.as_ref().clone(), own => Box::new(own)),
                Route::Reduced(_) => {
                    let what = "problem must give problems in the form of this one";
                    return Err(Stopped::Raised(PyValueError::new_err(what)));
                }
            };
            Ok((map, vec![alpha[0] + s * rate]))
        };
        match valid_along(family, x, horizon) {
            Ok(found) => Ok(found.until()),
            Err(Stopped::Raised(e)) => Err(e),
            Err(Stopped::Found(e)) => Err(raised(e)),
        }
    }

    fn change(&self, py: Python<'_>, dp: &[f64]) -> PyResult<ContactChange> {
        self.with(
            py,
            |found| of_found!(found, own => own.jvp(dp)),
            |own| own.jvp(dp),
        )
    }

    fn known(&self, py: Python<'_>) -> PyResult<(Option<bool>, String)> {
        self.with(
            py,
            |found| {
                let found = of_found!(found, own => own.differentiable())?;
                Ok((found.known(), found.to_string()))
            },
            |own| {
                let found = own.differentiable()?;
                Ok((found.known(), found.to_string()))
            },
        )
    }
}

fn loads(given: Option<&Bound<'_, PyAny>>, n: usize) -> PyResult<Option<Matrix>> {
    let Some(given) = given.filter(|g| !g.is_none()) else {
        return Ok(None);
    };
    match given.extract::<bool>() {
        Ok(true) => return Ok(Some(Matrix::identity(n))),
        Ok(false) => return Ok(None),
        Err(_) => {}
    }
    let one = |load: &Bound<'_, PyAny>| match load.cast::<Load>() {
        Ok(load) => Ok(load.get().case.forces().to_vec()),
        Err(_) => vector(load, "a load"),
    };
    let list = match given.cast::<Load>() {
        Ok(_) => vec![one(given)?],
        Err(_) => (given.try_iter()?)
            .map(|load| one(&load?))
            .collect::<PyResult<Vec<_>>>()?,
    };
    match list.iter().position(|f| f.len() != n) {
        Some(k) => Err(PyValueError::new_err(format!(
            "load {k} has {} forces for {n} free displacements",
            list[k].len()
        ))),
        None => beside(n, &list).map(Some),
    }
}

#[pymethods]
impl ContactSensitivity {
    /// Which entries of dp belong to what: a dict of slices.
    #[getter]
    fn slices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.parameters.slices(py)
    }

    /// Number of parameters.
    fn __len__(&self) -> usize {
        self.parameters.list.len()
    }

    /// Whether the solution is a differentiable function of the parameters here: True, False (two one-sided derivatives were found that
    /// differ), or None: not known.
    #[getter]
    fn differentiable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        Ok(self.known(py)?.0)
    }

    /// The answer of ``differentiable`` in a sentence.
    #[getter]
    fn message(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.known(py)?.1)
    }

    /// The directional derivative along a change dp of the parameters, shape (k,) or a number. At a kink it is the one-sided one.
    ///
    /// Returns
    /// -------
    /// displacements, pressures, tractions
    ///     In the shapes of the solution's; displacements are 0 at supports, whose motion is given.
    fn jvp<'py>(&self, dp: &Bound<'py, PyAny>) -> PyResult<Triple<'py>> {
        let (py, dp) = (dp.py(), start(dp, "dp")?);
        triple(py, self.solution.get(), &self.change(py, &dp)?)
    }

    /// The gradient in the parameters, shape (k,), of a function of the solution whose gradients are given, in the shapes of the solution's
    /// displacements, pressures and tractions; 0 where they are left out. One solve with the transposed system. At a kink the derivative is
    /// the lexicographic one along the unit vectors.
    #[pyo3(signature = (displacements=None, pressures=None, tractions=None))]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        displacements: Option<&Bound<'py, PyAny>>,
        pressures: Option<&Bound<'py, PyAny>>,
        tractions: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (of_u, forces) = gradients(self.solution.get(), displacements, pressures, tractions)?;
        let gradient = self.with(
            py,
            |found| of_found!(found, own => own.vjp(&of_u, &forces)),
            |own| own.vjp(&of_u, &forces),
        )?;
        Ok(PyArray1::from_vec(py, gradient))
    }

    /// The derivative of (displacements, pressures, tractions), the free displacements of the body first, then all pressures, then all
    /// tractions along t₁, then t₂: an array with a column for each parameter.
    ///
    /// SemismoothError where the solution is not known to be differentiable.
    fn derivative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = self.with(
            py,
            |found| of_found!(found, own => own.derivative()),
            |own| {
                let k = own.num_parameters();
                let (mut entries, mut delta, mut count) = (Vec::new(), vec![0.0; k], 0);
                for j in 0..k {
                    delta[j] = 1.0;
                    let change = own.jvp(&delta)?;
                    delta[j] = 0.0;
                    let column = change.displacements.iter().chain(&change.forces);
                    count = change.displacements.len() + change.forces.len();
                    entries.extend(column.enumerate().map(|(i, v)| (i, j, *v)));
                }
                let found = Matrix::from_triplets(count, k, &entries);
                Ok(found.map_err(semismooth::linear::LinearError::from)?)
            },
        )?;
        Ok(dense(py, &found))
    }

    /// The largest s such that all nodes keep their states for changes t dp, 0 < t < s: exact (inf where no state changes) for loads and
    /// gaps under constant friction; else the curve of solutions is followed up to ``horizon``.
    ///
    /// Where dp changes a material or positions, whose effect is known to first order only, ``problem`` has to give the problem for s, in the
    /// form of this one: with its data changed by s dp. (A change of the parameter is taken from dp.) Solutions in the same states are then
    /// computed at the ends and in the middle of ever shorter intervals, and the first kink located to 1e-9 of the horizon: an estimate, as a
    /// kink that is passed and left again between two of these points is not seen. SemismoothError without it, and in reduced form.
    #[pyo3(signature = (dp, horizon=1.0, problem=None))]
    fn valid_until(
        &self,
        dp: &Bound<'_, PyAny>,
        horizon: f64,
        problem: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<f64> {
        let (py, dp) = (dp.py(), start(dp, "dp")?);
        if matches!(self.solution.get().problem.get().route, Route::Reduced(_)) {
            return Err(SemismoothError::new_err(
                "a problem in reduced form does not say how far a derivative holds: write form=\"condensed\"",
            ));
        }
        if let Some(problem) = problem.filter(|p| !p.is_none()) {
            return self.valid_along(&dp, horizon, problem);
        }
        let found = self.with(
            py,
            |found| of_found!(found, own => own.valid_until(&dp, horizon)).map(|v| v.until()),
            |_| Err(SensitivityError::NotDifferentiable),
        )?;
        Ok(found)
    }

    fn __repr__(&self) -> String {
        self.parameters.described("ContactSensitivity")
    }
}

type Triple<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<ContactSensitivity>()?;
    history::register(module)
}
