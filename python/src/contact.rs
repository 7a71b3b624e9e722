//! Bodies in contact with rigid foundations or with each other, with friction.

use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString};
use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, FullContact, ReducedBody, ReducedContact, ReducedOptions,
};
use semismooth::fem::{self, ContactRows, MultiplierSpace};
use semismooth::interface::{LoadCase, LoadPath};
use semismooth::piecewise::PiecewiseSmooth;

use crate::arrays::{counted, truncated, vector};
use crate::body::{Body, Load};
use crate::errors::{Run, SemismoothError, raised};
use crate::fields::{Direction, Failures, Scalar, in_space};
use crate::laws::{Law, law};
use crate::map::{Map, smooth};
use crate::saving::Made;
use crate::solution::ContactSolution;

/// A rigid foundation: the gap below each contact node, and the direction in which it is measured. Made by :meth:`plane` and :meth:`gap`.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Foundation {
    pub(crate) made: Made,
    shape: Shape,
    normal: Option<Direction>,
    tangent: Option<Direction>,
}

enum Shape {
    Plane { point: Vec<f64>, normal: Vec<f64> },
    Gap(Scalar),
}

#[pymethods]
impl Foundation {
    fn __repr__(&self) -> String {
        match &self.shape {
            Shape::Plane { point, normal } => {
                format!("<Foundation: plane through {point:?} with normal {normal:?}>")
            }
            Shape::Gap(Scalar::Constant(gap)) => format!("<Foundation at distance {gap:?}>"),
            Shape::Gap(Scalar::Called(_)) => "<Foundation at a distance given by a function>".to_owned(),
        }
    }

    /// The half-space below the plane through ``point``, shape (d,), with the normal ``normal``, shape (d,), which points to the body.
    #[staticmethod]
    #[pyo3(signature = (point, normal, *, tangent=None))]
    fn plane(
        point: &Bound<'_, PyAny>,
        normal: &Bound<'_, PyAny>,
        tangent: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let made = Made::by(point.py(), "plane", &[point, normal], &[("tangent", tangent)])?;
        Ok(Self {
            made,
            shape: Shape::Plane {
                point: vector(point, "point")?,
                normal: vector(normal, "normal")?,
            },
            normal: None,
            tangent: tangent.map(|t| Direction::of(t, "tangent")).transpose()?,
        })
    }

    /// A foundation at the distance ``gap``, a length or a function of a point, measured along the outward normals of the body, or along
    /// ``normal``, a vector of shape (d,) or a function that returns one, pointing out of the body. In space ``tangent`` is the first
    /// principal axis of friction (its part orthogonal to the normal; the projected x axis unless given).
    #[staticmethod]
    #[pyo3(signature = (gap, *, normal=None, tangent=None))]
    fn gap(
        gap: &Bound<'_, PyAny>,
        normal: Option<&Bound<'_, PyAny>>,
        tangent: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let options = [("normal", normal), ("tangent", tangent)];
        let made = Made::by(gap.py(), "gap", &[gap], &options)?;
        Ok(Self {
            made,
            shape: Shape::Gap(Scalar::of(gap, "gap")?),
            normal: normal.map(|n| Direction::of(n, "normal")).transpose()?,
            tangent: tangent.map(|t| Direction::of(t, "tangent")).transpose()?,
        })
    }
}

impl Foundation {
    fn foundation(&self, py: Python<'_>, dim: usize, failures: &Failures) -> PyResult<fem::Foundation> {
        let mut foundation = match &self.shape {
            Shape::Plane { point, normal } => {
                fem::Foundation::plane(in_space(point, dim, "point")?, in_space(normal, dim, "normal")?)
            }
            Shape::Gap(gap) => fem::Foundation::gap(gap.function(py, dim, failures)),
        };
        if let Some(normal) = &self.normal {
            foundation = foundation.with_normal(normal.function(py, dim, "normal", failures)?);
        }
        if let Some(tangent) = &self.tangent {
            foundation = foundation.with_tangent(tangent.function(py, dim, "tangent", failures)?);
        }
        Ok(foundation)
    }
}

/// The facets that may touch each other where both sides are deformable; those of the contact problem carry the multipliers.
///
/// Parameters
/// ----------
/// facets : str
///     The other group of facets, of the same mesh; the nodes of both need not match.
/// gap : number or function of a point, optional
///     Added to the distance between the meshes; negative for an interference.
/// tangent : vector of shape (d,) or function of a point, optional
///     In space, the first principal axis of friction.
/// reach : float, optional
///     Facets further apart do not face each other.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Mortar {
    facets: String,
    gap: Option<Scalar>,
    tangent: Option<Direction>,
    reach: Option<f64>,
}

#[pymethods]
impl Mortar {
    #[new]
    #[pyo3(signature = (facets, *, gap=None, tangent=None, reach=None))]
    fn new(
        facets: String,
        gap: Option<&Bound<'_, PyAny>>,
        tangent: Option<&Bound<'_, PyAny>>,
        reach: Option<f64>,
    ) -> PyResult<Self> {
        Ok(Self {
            facets,
            gap: gap.map(|g| Scalar::of(g, "gap")).transpose()?,
            tangent: tangent.map(|t| Direction::of(t, "tangent")).transpose()?,
            reach,
        })
    }
}

impl Mortar {
    fn mortar(&self, py: Python<'_>, dim: usize, failures: &Failures) -> PyResult<fem::Mortar> {
        let mut mortar = fem::Mortar::default();
        if let Some(gap) = &self.gap {
            mortar = mortar.with_gap(gap.function(py, dim, failures));
        }
        if let Some(tangent) = &self.tangent {
            mortar = mortar.with_tangent(tangent.function(py, dim, "tangent", failures)?);
        }
        Ok(match self.reach {
            Some(reach) => mortar.with_reach(reach),
            None => mortar,
        })
    }
}

/// What a boundary may touch.
enum Opposite {
    Foundation(fem::Foundation),
    Boundary(String, fem::Mortar),
}

impl Opposite {
    fn of(given: &Bound<'_, PyAny>, dim: usize, failures: &Failures) -> PyResult<Self> {
        if let Ok(foundation) = given.cast::<Foundation>() {
            return Ok(Self::Foundation(foundation.get().foundation(
                given.py(),
                dim,
                failures,
            )?));
        }
        if let Ok(mortar) = given.cast::<Mortar>() {
            let own = mortar.get();
            return Ok(Self::Boundary(
                own.facets.clone(),
                own.mortar(given.py(), dim, failures)?,
            ));
        }
        match given.extract::<String>() {
            Ok(facets) => Ok(Self::Boundary(facets, fem::Mortar::default())),
            Err(_) => Err(PyTypeError::new_err(
                "the third argument is a Foundation, the name of the facets on the other side, or a Mortar",
            )),
        }
    }

    fn rows(
        &self,
        system: &fem::ElasticSystem,
        facets: &str,
        multipliers: MultiplierSpace,
    ) -> Result<ContactRows, fem::FemError> {
        match self {
            Self::Foundation(foundation) => system.contact_with(facets, foundation, multipliers),
            Self::Boundary(other, mortar) => system.contact_between(facets, other, mortar),
        }
    }
}

/// The space of contact forces by its name, or the size of its patches.
fn multipliers(given: Option<&Bound<'_, PyAny>>) -> PyResult<MultiplierSpace> {
    let Some(given) = given else {
        return Ok(MultiplierSpace::Nodal);
    };
    if let Ok(size) = given.extract::<f64>() {
        return Ok(MultiplierSpace::Patches { size });
    }
    match given.extract::<String>().as_deref() {
        Ok("nodal") => Ok(MultiplierSpace::Nodal),
        Ok("dual cells") => Ok(MultiplierSpace::DualCells),
        _ => Err(PyValueError::new_err(format!(
            "multipliers = {} is not known: write \"nodal\", \"dual cells\", or the size of patches",
            given.repr()?
        ))),
    }
}

/// A problem in one of its forms.
#[derive(Clone)]
pub(crate) enum Form {
    Condensed(CondensedContact<Law>),
    Full(FullContact<Law>),
}

/// How a problem is solved.
pub(crate) enum Route {
    /// As a piecewise-smooth map.
    Mapped(Box<Form>),
    /// In reduced form, for the displacements alone.
    Reduced(Box<Reduced>),
}

pub(crate) type Reduced = Mutex<ReducedContact<Law>>;

/// Numbers of free displacements beyond which "auto" takes the reduced form: for solids, because multigrid is then quicker than one
/// factorisation; in the plane, where factors stay sparse, because of memory.
const SOLID: usize = 6_000;
const PLANE: usize = 3_000_000;

/// The same expression for either form.
macro_rules! of_form {
    ($form:expr, $problem:ident => $value:expr) => {
        match $form {
            $crate::contact::Form::Condensed($problem) => $value,
            $crate::contact::Form::Full($problem) => $value,
        }
    };
}
pub(crate) use of_form;

impl Form {
    pub(crate) fn map(&self) -> &(dyn PiecewiseSmooth + Sync) {
        of_form!(self, problem => problem)
    }
}

/// An elastic body in contact with a rigid foundation, or two bodies in contact with each other, under a load f(α) = supports + ``load`` + α ``rate`` + Σ φ_k(α) f_k.
///
/// At each of the p contact nodes: penetration ≤ 0 ≤ pressure, one of them 0 (Signorini), and Coulomb's law of friction. α is the
/// parameter; :func:`follow` and :func:`diagram` take the problem in place of H, :func:`all_solutions` in place of a map (in the plane), and
/// :func:`evolve` goes through a history of α.
///
/// Parameters
/// ----------
/// body : Body
/// facets : str
///     The group of facets that may touch the foundation.
/// foundation : Foundation, str or Mortar
///     A rigid foundation; or the group of facets on the other side, where both sides are deformable (the bodies are parts of one mesh,
///     whose nodes need not match), with its settings as a :class:`Mortar`.
/// friction : number, array of shape (p,), Friction, or a pair of them, or GivenBound, or None
///     The coefficient; in space also a pair of coefficients, along the two tangents; :class:`GivenBound`: Tresca friction; ``None``: none.
/// load, rate : Load, optional
///     The constant load, and the load multiplied by the parameter. Displacements prescribed by the body's supports act at every parameter.
/// paths : list of (Load, callable), optional
///     Loads f_k with smooth amplitudes φ_k(α), traced (see :func:`trace`).
/// form : {"condensed", "full", "reduced", "auto"}
///     "condensed": x = (λν, λt₁[, λt₂], α), nodal forces, dense, one factorisation of the stiffness matrix in all. "full": x = (u, λν, λt₁[,
///     λt₂], α), sparse, one factorisation per step: for thousands of contact nodes. "reduced": x as in full form, but solved for the
///     displacements alone, with multigrid, for bodies of up to millions of displacements: :meth:`solve` and :func:`evolve` only, curves
///     are not followed. "auto": "reduced" for solids of more than 6000 free displacements and plane bodies of more than 3 million on
///     rigid foundations, else "condensed".
/// multipliers : "nodal", "dual cells" or float, optional
///     The space of the p contact forces (Haslinger, Kučera, Vlach 2008): nodal forces (unless given); constant on the part of the facets
///     nearest to each node ("dual cells"); or constant on patches, each of the facets whose centroids lie in one box of a grid of this
///     width. Contact nodes of patches are the mesh nodes nearest to their centroids.
///
/// >>> import semismooth as ss
/// >>> body = ss.Body(ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]), ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
/// >>> ground = ss.Foundation.plane([0, 0], [0, 1])
/// >>> problem = ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", [0.05, None]))
/// >>> solution = problem.solve(0.0)
/// >>> solution.counts, round(float(solution.pressures.sum()), 6)
/// ((0, 7, 2), 0.049168)
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct ContactProblem {
    pub(crate) made: Made,
    pub(crate) route: Route,
    pub(crate) rows: Arc<ContactRows>,
    /// The body.
    #[pyo3(get)]
    pub(crate) body: Py<Body>,
    law: Law,
    parameters: usize,
}

#[pymethods]
impl ContactProblem {
    #[new]
    #[pyo3(signature = (
        body, facets, foundation, friction, *, load=None, rate=None, paths=None, form="condensed", multipliers=None
    ))]
    fn new(
        body: &Bound<'_, Body>,
        facets: &str,
        foundation: &Bound<'_, PyAny>,
        friction: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, Load>>,
        rate: Option<&Bound<'_, Load>>,
        paths: Option<Vec<(Bound<'_, Load>, Bound<'_, PyAny>)>>,
        form: &str,
        multipliers: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (py, system) = (body.py(), &body.get().system);
        let paths = amplitudes(py, paths.unwrap_or_default())?;
        let none = py.None().into_bound(py);
        let (group, word, list) = (
            PyString::new(py, facets),
            PyString::new(py, form),
            PyList::new(py, &paths)?,
        );
        let options: [(&'static str, Option<&Bound<'_, PyAny>>); 5] = [
            ("load", load.map(|l| l.as_any())),
            ("rate", rate.map(|l| l.as_any())),
            ("paths", Some(&list)),
            ("form", Some(&word)),
            ("multipliers", multipliers),
        ];
        let made = Made::by(
            py,
            "new",
            &[body, &group, foundation, friction.unwrap_or(&none)],
            &options,
        )?;
        let (load, rate) = (load.map(|l| l.get()), rate.map(|l| l.get()));
        let (dim, failures) = (system.mesh().dim(), Failures::default());
        let opposite = Opposite::of(foundation, dim, &failures)?;
        let between = matches!(opposite, Opposite::Boundary(..));
        if between && multipliers.is_some() {
            return Err(PyValueError::new_err(
                "between two boundaries multipliers are those of the nodes of the first: leave out multipliers",
            ));
        }
        let multipliers = self::multipliers(multipliers)?;
        let cases: Vec<LoadCase> = paths.iter().map(|(load, _)| load.get().case.clone()).collect();
        let path = load_path(body, load, rate, paths)?;
        let large = system.num_free() > if dim == 2 { PLANE } else { SOLID };
        let form = match form {
            "auto" if large && !between => "reduced",
            "auto" => "condensed",
            "condensed" | "full" | "reduced" => form,
            other => {
                return Err(PyValueError::new_err(format!(
                    "form = \"{other}\" is not known: write \"condensed\", \"full\", \"reduced\" or \"auto\""
                )));
            }
        };
        let rows = failures.settle(py.detach(|| opposite.rows(system, facets, multipliers)))?;
        let moving = [load, rate].into_iter().flatten().map(|l| &l.case);
        for case in moving.chain(cases.iter()) {
            rows.check_supports(system, case).map_err(raised)?;
        }
        let law = law(friction, dim, rows.nodes.len())?;
        let own = law.clone();
        let route = py.detach(|| -> Result<Route, SetupError> {
            let mut tangential = vec![rows.tangential.clone()];
            tangential.extend(rows.tangential2.clone());
            if form == "reduced" {
                let body = ReducedBody::new(system.nodal_stiffness()?, &rows.normal, &tangential, path)?;
                let body = body.with_gap(rows.gap.clone())?;
                let problem = ReducedContact::new(body, own, ReducedOptions::default())?;
                return Ok(Route::Reduced(Box::new(Mutex::new(problem))));
            }
            let body = ContactBody::new(system.stiffness().clone(), rows.normal.clone(), tangential, path)?
                .with_gap(rows.gap.clone())?;
            Ok(Route::Mapped(Box::new(match form {
                "condensed" => Form::Condensed(CondensedContact::new(body, own)?),
                _ => Form::Full(FullContact::new(body, own)?),
            })))
        });
        Ok(Self {
            made,
            route: route.map_err(|e| match e {
                SetupError::Body(e) => raised(e),
                SetupError::Contact(e) => raised(e),
            })?,
            rows: Arc::new(rows),
            body: body.clone().unbind(),
            law,
            parameters: 1,
        })
    }

    /// The problem with a second parameter β, after α in x: the load is f(α) + β ``load``. For :func:`transition_set`.
    fn with_second_parameter(slf: &Bound<'_, Self>, load: &Bound<'_, Load>) -> PyResult<Self> {
        let (own, made) = (slf.get(), Made::from(slf, "with_second_parameter", &[load])?);
        let load = load.get();
        let form = match own.form()? {
            Form::Condensed(p) => p
                .with_second_parameter(&load.case, own.law.clone())
                .map(Form::Condensed),
            Form::Full(p) => p
                .with_second_parameter(&load.case, own.law.clone())
                .map(Form::Full),
        };
        Ok(Self {
            made,
            route: Route::Mapped(Box::new(form.map_err(raised)?)),
            rows: own.rows.clone(),
            body: own.body.clone_ref(slf.py()),
            law: own.law.clone(),
            parameters: 2,
        })
    }

    /// Number p of contact nodes.
    #[getter]
    pub(crate) fn num_contacts(&self) -> usize {
        self.rows.nodes.len()
    }

    /// Number of entries of x, its one or two parameters included.
    #[getter]
    pub(crate) fn num_vars(&self) -> usize {
        match &self.route {
            Route::Mapped(form) => form.map().num_vars(),
            Route::Reduced(_) => self.num_displacements() + self.dim() * self.num_contacts() + 1,
        }
    }

    /// Index of the mesh node of each contact node, shape (p,), ordered by x, then y, then z.
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.rows.nodes.iter().map(|n| *n as i64))
    }

    /// Coordinates of the contact nodes, shape (p, d).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        truncated(py, self.dim(), &self.rows.points)
    }

    /// Unit normals, out of the body, shape (p, d).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        truncated(py, self.dim(), &self.rows.normals)
    }

    /// Unit tangents along which slips and tractions are measured, d − 1 arrays of shape (p, d).
    #[getter]
    fn tangents<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let along = |t: usize| {
            let tangents: Vec<_> = self.rows.tangents.iter().map(|both| both[t]).collect();
            truncated(py, self.dim(), &tangents)
        };
        (0..self.dim() - 1).map(along).collect()
    }

    /// Areas (in the plane lengths) of the contact nodes, shape (p,): nodal forces divided by them are pressures.
    #[getter]
    fn areas<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.rows.areas)
    }

    /// Tangents that are held at rest, as on planes of symmetry: bool, shape (p, d − 1). Solutions are then those with that symmetry: lists,
    /// counts and proofs of uniqueness say nothing of others of the whole body.
    #[getter]
    fn held<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let own = |h: &[bool; 2]| h[..self.dim() - 1].to_vec();
        let rows: Vec<Vec<bool>> = self.rows.held.iter().map(own).collect();
        PyArray2::from_vec2(py, &rows).map_err(|e| PyValueError::new_err(e.to_string()))
    }

    /// Initial gaps, shape (p,).
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.rows.gap)
    }

    /// A solution at a parameter, by Newton's method from ``start`` and, where that fails, by lowering the body onto its foundation. Other
    /// solutions may exist.
    ///
    /// Parameters
    /// ----------
    /// parameter : float
    /// start : ContactSolution or array, optional
    ///     A solution nearby.
    /// states : list of str, optional
    ///     In place of a start: "open", "stick", "slip+" or "slip-" for each contact node.
    /// **options
    ///     max_time (60 seconds; None: no limit), max_increments, max_paths and others of ContactOptions; in
    ///     reduced form max_time, tolerance, max_iterations, max_memory (bytes) and others of ReducedOptions.
    ///
    /// Returns
    /// -------
    /// ContactSolution
    ///
    /// Raises
    /// ------
    /// SemismoothError
    ///     Where no solution is found.
    #[pyo3(signature = (parameter=0.0, start=None, *, states=None, **options))]
    fn solve(
        slf: &Bound<'_, Self>,
        parameter: f64,
        start: Option<&Bound<'_, PyAny>>,
        states: Option<Vec<String>>,
        options: Option<&Bound<'_, pyo3::types::PyDict>>,
    ) -> PyResult<ContactSolution> {
        let (py, own) = (slf.py(), slf.get());
        own.one_parameter()?;
        if let Route::Reduced(reduced) = &own.route {
            if states.is_some() {
                return Err(PyValueError::new_err(
                    "in reduced form searches begin from displacements, not from states",
                ));
            }
            return Self::solve_reduced(slf, reduced, parameter, start, options);
        }
        let form = own.form()?;
        let mut start = start.map(point).transpose()?;
        let options = crate::arrays::options(options, py)?;
        if let Some(states) = states {
            let states = states.iter().map(|s| state(s)).collect::<PyResult<Vec<_>>>()?;
            let first = Run::detached(py, |_| {
                of_form!(form, p => p.start_with(parameter, &states)).map_err(raised)
            });
            start = Some(first?);
        }
        let report = Run::detached(py, |run| {
            let poll = |_: &_| run.poll();
            of_form!(form, p => p.solve_observed(parameter, start.as_deref(), &options, poll)).map_err(raised)
        })?;
        let strategy = crate::arrays::python(py, &report.strategy())?.extract()?;
        ContactSolution::at(slf, report.x, Some(strategy))
    }

    /// The solution with the variables x, a point of a curve or of a list of solutions; how well the equations hold there is in its
    /// ``residuals``.
    fn at(slf: &Bound<'_, Self>, x: &Bound<'_, PyAny>) -> PyResult<ContactSolution> {
        ContactSolution::at(slf, point(x)?, None)
    }

    fn __repr__(&self) -> String {
        format!(
            "<ContactProblem with {}, {}>",
            counted(self.num_contacts(), "contact node"),
            counted(self.num_vars(), "variable")
        )
    }
}

/// An error in the construction of a problem.
enum SetupError {
    Body(fem::FemError),
    Contact(ContactError),
}

impl From<fem::FemError> for SetupError {
    fn from(error: fem::FemError) -> Self {
        Self::Body(error)
    }
}

impl From<ContactError> for SetupError {
    fn from(error: ContactError) -> Self {
        Self::Contact(error)
    }
}

impl ContactProblem {
    /// The problem as a map.
    pub(crate) fn form(&self) -> PyResult<&Form> {
        match &self.route {
            Route::Mapped(form) => Ok(form.as_ref()),
            Route::Reduced(_) => Err(SemismoothError::new_err(
                "a problem in reduced form supports solve and evolve, not follow, diagram or all_solutions: write form=\"condensed\"",
            )),
        }
    }

    /// The problem in reduced form.
    pub(crate) fn reduced(&self) -> Option<&Reduced> {
        match &self.route {
            Route::Mapped(_) => None,
            Route::Reduced(problem) => Some(problem),
        }
    }

    /// Number of free displacements.
    pub(crate) fn num_displacements(&self) -> usize {
        self.rows.normal.ncols()
    }

    fn solve_reduced(
        slf: &Bound<'_, Self>,
        reduced: &Reduced,
        parameter: f64,
        start: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, pyo3::types::PyDict>>,
    ) -> PyResult<ContactSolution> {
        let (py, own) = (slf.py(), slf.get());
        let start = start.map(point).transpose()?;
        if let Some(x) = &start {
            own.check_length(x)?;
        }
        let start = start.as_ref().map(|x| &x[..own.num_displacements()]);
        let options: ReducedOptions = crate::arrays::options(options, py)?;
        let report = Run::watched(py, |run| {
            let mut problem = begun(reduced)?;
            problem.set_options(options).map_err(raised)?;
            problem
                .solve_observed(parameter, start, |_| run.flow())
                .map_err(raised)
        })?;
        let strategy = report.strategy.to_string();
        let mut x = report.displacements;
        x.extend(report.forces);
        x.push(parameter);
        ContactSolution::at(slf, x, Some(strategy))
    }

    /// Whether x is a point of the problem in reduced form.
    pub(crate) fn check_length(&self, x: &[f64]) -> PyResult<()> {
        let expected = self.num_displacements() + self.dim() * self.rows.nodes.len() + 1;
        match x.len() == expected {
            true => Ok(()),
            false => Err(SemismoothError::new_err(format!(
                "the point x has length {}, expected {expected}",
                x.len()
            ))),
        }
    }

    pub(crate) fn dim(&self) -> usize {
        match self.law.num_tangents() {
            1 => 2,
            _ => 3,
        }
    }

    pub(crate) fn one_parameter(&self) -> PyResult<()> {
        match self.parameters {
            1 => Ok(()),
            _ => Err(PyTypeError::new_err(
                "a problem with two parameters has no solution of its own: use the one that it was made from",
            )),
        }
    }
}

/// Loads with their amplitudes as formulas.
fn amplitudes<'py>(
    py: Python<'py>,
    paths: Vec<(Bound<'py, Load>, Bound<'py, PyAny>)>,
) -> PyResult<Vec<(Bound<'py, Load>, Py<Map>)>> {
    let of_one = py.import("semismooth._functions")?.getattr("of_one")?;
    let formula = |(load, amplitude)| {
        let wrapped = of_one.call1((amplitude,))?;
        Ok((load, smooth(&wrapped, 1, "an amplitude")?))
    };
    paths.into_iter().map(formula).collect()
}

fn load_path(
    body: &Bound<'_, Body>,
    load: Option<&Load>,
    rate: Option<&Load>,
    paths: Vec<(Bound<'_, Load>, Py<Map>)>,
) -> PyResult<LoadPath> {
    let system = &body.get().system;
    let mut constant = system.supports().clone();
    if let Some(load) = load {
        constant = constant.plus(&load.case).map_err(raised)?;
    }
    let slope = rate.map_or_else(
        || LoadCase::from(vec![0.0; system.num_free()]),
        |rate| rate.case.clone(),
    );
    if paths.is_empty() {
        return Ok(LoadPath::affine(constant, slope));
    }
    let (loads, amplitudes): (Vec<_>, Vec<_>) = paths.into_iter().unzip();
    let cases = std::iter::once(slope).chain(loads.iter().map(|load| load.get().case.clone()));
    let at = move |alpha: f64, value: &mut [f64], rate: &mut [f64]| {
        (value[0], rate[0]) = (alpha, 1.0);
        for (k, amplitude) in amplitudes.iter().enumerate() {
            let (v, gradient) = amplitude.get().value_and_gradient(&[alpha]);
            (value[k + 1], rate[k + 1]) = (v, gradient[0]);
        }
    };
    Ok(LoadPath::cases(constant, cases, at))
}

/// The problem in reduced form, with the reference slips and history variables of earlier runs reset to 0.
pub(crate) fn begun(problem: &Reduced) -> PyResult<MutexGuard<'_, ReducedContact<Law>>> {
    let mut problem = match problem.try_lock() {
        Ok(problem) => problem,
        Err(TryLockError::Poisoned(e)) => e.into_inner(),
        // In a callback, waiting for the lock would be a deadlock.
        Err(TryLockError::WouldBlock) => {
            return Err(SemismoothError::new_err(
                "a problem in reduced form does one thing at a time: do not use it in its own callback or in two threads",
            ));
        }
    };
    let slips = vec![0.0; problem.body().num_contacts() * (problem.body().dim() - 1)];
    let history = vec![0.0; problem.history().len()];
    problem.set_reference_slip(&slips).map_err(raised)?;
    problem.set_history(&history).map_err(raised)?;
    Ok(problem)
}

/// The variables of a solution, or a vector of them.
pub(crate) fn point(object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    match object.cast::<ContactSolution>() {
        Ok(solution) => Ok(solution.get().x.clone()),
        Err(_) => vector(object, "the point x"),
    }
}

fn state(name: &str) -> PyResult<semismooth::contact::ContactState> {
    let mut all = semismooth::contact::ContactState::ALL.into_iter();
    all.find(|s| s.name() == name).ok_or_else(|| {
        PyValueError::new_err(format!(
            "state \"{name}\" is not known: write \"open\", \"stick\", \"slip+\" or \"slip-\""
        ))
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Foundation>()?;
    module.add_class::<Mortar>()?;
    module.add_class::<ContactProblem>()
}
