//! Bodies in contact with rigid foundations or with each other, with friction.

use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString};
use semismooth::contact::{
    CondensedContact, ContactError, ContactForm, FullContact, ReducedContact, ReducedOptions,
};
use semismooth::interface::{LoadCase, LoadPath};
use semismooth::piecewise::PiecewiseSmooth;

use crate::arrays::{counted, truncated, vector};
use crate::body::{Body, Load};
use crate::errors::{Run, SemismoothError, raised};
use crate::fields::Failures;
use crate::foundation::{Opposite, multipliers};
use crate::given::{Compliance, Given, Origin, of_contact_nodes};
use crate::laws::{Law, law, shifted};
use crate::map::{Map, smooth};
use crate::saving::Made;
use crate::solution::ContactSolution;

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
/// friction : number, array of shape (p,), Friction, or a pair of them, GivenBound, LimitedShear, Cohesion, Wear, Bonded, or None
///     The coefficient (an array of shape (number of mesh nodes,) gives those of the contact nodes by its entries at :attr:`nodes`); in
///     space also a pair of coefficients, along the two tangents; :class:`GivenBound`: Tresca friction; ``None``: none.
/// load, rate : Load, optional
///     The constant load, and the load multiplied by the parameter. Displacements prescribed by the body's supports act at every parameter.
/// paths : list of (Load, callable), optional
///     Loads f_k with smooth amplitudes φ_k(α), traced (see :func:`trace`).
/// form : {"condensed", "full", "reduced", "auto"}
///     "condensed": x = (λν, λt₁[, λt₂], α), nodal forces, dense, one factorisation of the stiffness matrix in all; of a body that contact
///     alone holds, with displacements of some points before α, as many as it has rigid motions. "full": x = (u, λν, λt₁[,
///     λt₂], α), sparse, one factorisation per step: for thousands of contact nodes. "reduced": x as in full form, but solved for the
///     displacements alone, with multigrid, for bodies of up to millions of displacements: :meth:`solve` and :func:`evolve` only, curves
///     are not followed. "auto": "reduced" for solids of more than 6000 free displacements and plane bodies of more than 3 million that their
///     supports hold, with nodal multipliers or between facets of first order, else "condensed".
/// multipliers : "nodal", "dual cells", int, list of str, or pair of a Mesh and str, optional
///     The space of the p contact forces (Haslinger, Kučera, Vlach 2008): nodal forces (unless given); constant on the part of the facets
///     nearest to each node ("dual cells"); or polynomials on the elements of a partition T_H: k facets merged (k × k quadrilaterals in
///     space), the groups of facets named, or the facets of a group of another mesh, which lie on the boundary and may cut the body's. Each
///     force is that of a function ψ ≥ 0; contact nodes are the mesh nodes nearest to the centroids of these.
/// degree : {"constant", "linear", "continuous"}
///     Of the polynomials on a partition: constant; linear, with jumps between elements; linear and continuous.
/// stiffness : pair of numbers or arrays of shape (p,), optional
///     Of a layer between both sides, along the normal and along the tangents, forces per area and displacement (``None``: rigid): normal
///     compliance and elastic slip, in series with the law. Penetrations and slips of solutions are those of the law, without the layer.
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
    pub(crate) origin: Origin,
    pub(crate) law: Law,
    /// The law with a second parameter that is added to the coefficient of friction, where it has one.
    pub(crate) shifted: Option<Law>,
    parameters: usize,
}

#[pymethods]
impl ContactProblem {
    #[new]
    #[pyo3(signature = (
        body, facets, foundation, friction, *, load=None, rate=None, paths=None, form="condensed", multipliers=None,
        degree="constant", stiffness=None
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
        degree: &str,
        stiffness: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (py, system) = (body.py(), &body.get().system);
        let paths = amplitudes(py, paths.unwrap_or_default())?;
        let none = py.None().into_bound(py);
        let (group, word, list) = (
            PyString::new(py, facets),
            PyString::new(py, form),
            PyList::new(py, &paths)?,
        );
        let order = PyString::new(py, degree);
        let options: [(&'static str, Option<&Bound<'_, PyAny>>); 7] = [
            ("degree", Some(&order)),
            ("load", load.map(|l| l.as_any())),
            ("rate", rate.map(|l| l.as_any())),
            ("paths", Some(&list)),
            ("form", Some(&word)),
            ("multipliers", multipliers),
            ("stiffness", stiffness),
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
        let multipliers = self::multipliers(multipliers, degree)?;
        let cases: Vec<LoadCase> = paths.iter().map(|(load, _)| load.get().case.clone()).collect();
        let path = load_path(body, load, rate, paths)?;
        let wanted = match form {
            "auto" => ContactForm::Auto,
            "condensed" => ContactForm::Condensed,
            "full" => ContactForm::Full,
            "reduced" => ContactForm::Displacements,
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
        let picked = friction
            .map(|f| of_contact_nodes(f, &rows.nodes, system.mesh().num_nodes()))
            .transpose()?;
        let shifted = shifted(picked.as_ref(), dim, rows.areas.len())?;
        let law = law(picked.as_ref(), dim, &rows.areas)?;
        let compliance = Compliance::new(stiffness, &rows.areas)?;
        let nodal = compliance.is_none() && rows.has_own_nodes(system);
        let wanted = wanted.suited(dim, system.num_free(), nodal);
        if wanted == ContactForm::Displacements && compliance.is_some() {
            return Err(PyValueError::new_err(
                "a problem in reduced form has no stiffness between its sides: write form=\"condensed\"",
            ));
        }
        let own = law.clone();
        let route = py.detach(|| -> Result<Route, ContactError> {
            if wanted == ContactForm::Displacements {
                let body = semismooth::reduced_body(system, &rows, path.clone())?;
                if form != "auto" || body.is_supported() {
                    let problem = ReducedContact::new(body, own, ReducedOptions::default())?;
                    return Ok(Route::Reduced(Box::new(Mutex::new(problem))));
                }
            }
            let body = Compliance::of(semismooth::contact_body(system, &rows, path)?, compliance)?;
            Ok(Route::Mapped(Box::new(match wanted {
                ContactForm::Full => Form::Full(FullContact::new(body, own)?),
                _ => Form::Condensed(CondensedContact::new(body, own)?),
            })))
        });
        Ok(Self {
            made,
            route: route.map_err(raised)?,
            origin: Origin::Mesh {
                body: body.clone().unbind(),
                rows: Arc::new(rows),
            },
            law,
            shifted,
            parameters: 1,
        })
    }

    /// A body given by matrices: A u = f − Bνᵀ λν − Σ Btᵀ λt with n displacements u, u_ν = Bν u ≤ ``gap`` at p contact nodes, from another
    /// program, or a substructure condensed onto some of its displacements.
    ///
    /// Parameters
    /// ----------
    /// stiffness : matrix of shape (n, n)
    ///     Dense, or of scipy.sparse; symmetric, positive definite. Where rounding of a file has made it unsymmetric, by 1e-10 to 1e-6 of its
    ///     largest entry, its symmetric part is taken, with a warning; see :attr:`notes`. Form "full" takes other matrices, too.
    /// normal : matrix of shape (p, n)
    ///     Bν, along unit normals out of the body.
    /// tangential : list of one or two matrices of shape (p, n)
    ///     Bt, along unit tangents: one in the plane, two in space. A row of zeros holds that tangent, as on planes of symmetry.
    /// friction : number, array of shape (p,), Friction, or a pair of them, or GivenBound, or None
    ///     As for :class:`ContactProblem`.
    /// load, rate : arrays of shape (n,), optional
    ///     The constant forces f, and those multiplied by the parameter.
    /// gap : array of shape (p,), optional
    ///     0 unless given.
    /// points : array of shape (p, d), optional
    ///     Coordinates of the contact nodes, for :attr:`points`.
    /// form : {"condensed", "full"}
    /// springs : pair of numbers or arrays of shape (p,), optional
    ///     As ``stiffness`` of :class:`ContactProblem`, but nodal forces per displacement.
    ///
    /// >>> import numpy as np, semismooth as ss
    /// >>> problem = ss.ContactProblem.from_matrices(np.diag([2.0, 2.0]), [[1.0, 0.0]], [[[0.0, 1.0]]], 0.5, load=[1.0, 0.3])
    /// >>> problem.solve().states, problem.solve().displacements
    /// (['stick'], array([0., 0.]))
    #[staticmethod]
    #[pyo3(signature = (
        stiffness, normal, tangential, friction, *, load=None, rate=None, gap=None, points=None, form="condensed",
        springs=None
    ))]
    fn from_matrices(
        stiffness: &Bound<'_, PyAny>,
        normal: &Bound<'_, PyAny>,
        tangential: &Bound<'_, PyAny>,
        friction: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, PyAny>>,
        rate: Option<&Bound<'_, PyAny>>,
        gap: Option<&Bound<'_, PyAny>>,
        points: Option<&Bound<'_, PyAny>>,
        form: &str,
        springs: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (py, none) = (stiffness.py(), stiffness.py().None());
        let none = none.bind(py);
        let word = PyString::new(py, form);
        let options: [(&'static str, Option<&Bound<'_, PyAny>>); 6] = [
            ("load", load),
            ("rate", rate),
            ("gap", gap),
            ("points", points),
            ("form", Some(&word)),
            ("springs", springs),
        ];
        let arguments = [stiffness, normal, tangential, friction.unwrap_or(none)];
        let made = Made::by(py, "from_matrices", &arguments, &options)?;
        let (given, body) = Given::new([stiffness, normal, tangential], [load, rate], gap, points)?;
        let areas = vec![1.0; body.num_contacts()];
        let shifted = shifted(friction, 1 + body.num_tangents(), areas.len())?;
        let law = law(friction, 1 + body.num_tangents(), &areas)?;
        let body = Compliance::of(body, Compliance::new(springs, &areas)?).map_err(raised)?;
        let own = law.clone();
        let mapped = match form {
            "condensed" => py.detach(|| CondensedContact::new(body, own).map(Form::Condensed)),
            "full" => py.detach(|| FullContact::new(body, own).map(Form::Full)),
            other => {
                return Err(PyValueError::new_err(format!(
                    "form = \"{other}\" is not known: a body given by matrices has the forms \"condensed\" and \"full\""
                )));
            }
        };
        Ok(Self {
            made,
            route: Route::Mapped(Box::new(mapped.map_err(raised)?)),
            origin: Origin::Matrices(Arc::new(given)),
            law,
            shifted,
            parameters: 1,
        })
    }

    /// The body; ``None`` where the problem is given by matrices.
    #[getter]
    fn body(&self, py: Python<'_>) -> Option<Py<Body>> {
        match &self.origin {
            Origin::Mesh { body, .. } => Some(body.clone_ref(py)),
            Origin::Matrices(_) => None,
        }
    }

    /// What should be known of the discretisation: see :attr:`Body.notes`, and where matrices were not symmetric.
    #[getter]
    fn notes(&self) -> Vec<String> {
        match &self.origin {
            Origin::Mesh { body, .. } => body.get().system.notes(),
            Origin::Matrices(given) => given.note.iter().cloned().collect(),
        }
    }

    /// The problem with a second parameter β, after α in x: the load is f(α) + β ``load``. For :func:`transition_set`. Where the problem is
    /// given by matrices, ``load`` is an array of shape (n,).
    fn with_second_parameter(slf: &Bound<'_, Self>, load: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (own, made) = (slf.get(), Made::from(slf, "with_second_parameter", &[load])?);
        let case = match (&own.origin, load.cast::<Load>()) {
            (Origin::Mesh { .. }, Ok(load)) => load.get().case.clone(),
            (Origin::Mesh { .. }, Err(_)) => {
                return Err(PyTypeError::new_err("the load of a body with a mesh is a Load"));
            }
            (Origin::Matrices(_), _) => vector(load, "the load")?.into(),
        };
        let form = match own.form()? {
            Form::Condensed(p) => p
                .with_second_parameter(&case, own.law.clone())
                .map(Form::Condensed),
            Form::Full(p) => p.with_second_parameter(&case, own.law.clone()).map(Form::Full),
        };
        Ok(Self {
            made,
            route: Route::Mapped(Box::new(form.map_err(raised)?)),
            origin: own.origin.clone_ref(slf.py()),
            law: own.law.clone(),
            shifted: None,
            parameters: 2,
        })
    }

    /// Number p of contact nodes.
    #[getter]
    pub(crate) fn num_contacts(&self) -> usize {
        self.origin.gaps().len()
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
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let nodes = &self.origin.rows("nodes")?.nodes;
        Ok(PyArray1::from_iter(py, nodes.iter().map(|n| *n as i64)))
    }

    /// Coordinates of the contact nodes, shape (p, d).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        truncated(py, self.dim(), self.origin.points()?)
    }

    /// Unit normals, out of the body, shape (p, d).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        truncated(py, self.dim(), &self.origin.rows("normals")?.normals)
    }

    /// Unit tangents along which slips and tractions are measured, d − 1 arrays of shape (p, d).
    #[getter]
    fn tangents<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let rows = self.origin.rows("tangents")?;
        let along = |t: usize| {
            let tangents: Vec<_> = rows.tangents.iter().map(|both| both[t]).collect();
            truncated(py, self.dim(), &tangents)
        };
        (0..self.dim() - 1).map(along).collect()
    }

    /// Areas (in the plane lengths) of the contact nodes, shape (p,): nodal forces divided by them are pressures.
    #[getter]
    fn areas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_slice(py, &self.origin.rows("areas")?.areas))
    }

    /// Tangents that are held at rest, as on planes of symmetry: bool, shape (p, d − 1). Solutions are then those with that symmetry: lists,
    /// counts and proofs of uniqueness say nothing of others of the whole body.
    #[getter]
    fn held<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let own = |h: &[bool; 2]| h[..self.dim() - 1].to_vec();
        let rows: Vec<Vec<bool>> = self.origin.held().iter().map(own).collect();
        PyArray2::from_vec2(py, &rows).map_err(|e| PyValueError::new_err(e.to_string()))
    }

    /// Initial gaps, shape (p,).
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.origin.gaps())
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
        self.origin.num_displacements()
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
        let expected = self.num_displacements() + self.dim() * self.num_contacts() + 1;
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
    module.add_class::<ContactProblem>()
}
