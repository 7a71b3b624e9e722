//! Solutions of contact problems, and histories of loading.

use std::ops::ControlFlow;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::contact::{
    self, Arrival, EvolutionOptions, EvolutionProgress, LocalValues, ReducedLevel, ReducedOptions,
};
use semismooth::continuation::ContinuationOptions;
use semismooth::fem::ElasticSystem;
use semismooth::output::BodyPicture;
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sensitivity::{Sensitivity, SensitivityError};

use crate::arrays::{matrix, python, rows, start, vector};
use crate::contact::{ContactProblem, Form, Reduced, Route, begun, of_form, point};
use crate::derivatives::{Chosen, ContactSensitivity};
use crate::errors::{Run, raised};
use crate::names::number;
use crate::saving::{data, data_of, field, state_of};

/// A solution of a contact problem, node by node. Forces are nodal forces: divided by :attr:`ContactProblem.areas` they are pressures.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct ContactSolution {
    /// The problem.
    #[pyo3(get)]
    pub(crate) problem: Py<ContactProblem>,
    pub(crate) x: Vec<f64>,
    solution: contact::ContactSolution,
    /// Displacements that are free, and those of the supports.
    free: Vec<f64>,
    supports: Vec<f64>,
    /// How it was found: "Newton" and other names of ContactStrategy; None where it was not searched for.
    #[pyo3(get)]
    strategy: Option<String>,
}

impl ContactSolution {
    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, own) = (slf.py(), slf.get());
        state_of(
            py,
            &[
                ("problem", own.problem.bind(py).clone().into_any()),
                ("x", data_of(py, &own.x)?),
                ("solution", data_of(py, &own.solution)?),
                ("strategy", data_of(py, &own.strategy)?),
            ],
        )
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let problem: Bound<'py, ContactProblem> = field(state, "problem")?;
        let (x, solution): (Vec<f64>, contact::ContactSolution) =
            (data(state, "x")?, data(state, "solution")?);
        if x.len() != problem.get().num_vars() || solution.nodes.len() != problem.get().num_contacts() {
            return Err(PyValueError::new_err(
                "the saved solution does not belong to its problem",
            ));
        }
        let own = Self::with(&problem, x, solution, data(state, "strategy")?)?;
        Ok(Bound::new(py, own)?.into_any())
    }

    pub(crate) fn at(
        problem: &Bound<'_, ContactProblem>,
        x: Vec<f64>,
        strategy: Option<String>,
    ) -> PyResult<Self> {
        let own = problem.get();
        let solution = match &own.route {
            Route::Mapped(form) => problem
                .py()
                .detach(|| of_form!(form.as_ref(), p => p.solution(&x))),
            Route::Reduced(reduced) => {
                own.check_length(&x)?;
                let (u, alpha) = (&x[..own.num_displacements()], x[x.len() - 1]);
                problem
                    .py()
                    .detach(|| Ok::<_, PyErr>(begun(reduced)?.solution(alpha, u)))?
            }
        };
        let solution = solution.map_err(raised)?;
        Self::with(problem, x, solution, strategy)
    }

    fn with(
        problem: &Bound<'_, ContactProblem>,
        x: Vec<f64>,
        solution: contact::ContactSolution,
        strategy: Option<String>,
    ) -> PyResult<Self> {
        let own = problem.get();
        let (free, supports) = match &own.route {
            Route::Mapped(form) => {
                let py = problem.py();
                py.detach(|| of_form!(form.as_ref(), p => (p.displacements(&x), p.support_displacements(&x))))
            }
            Route::Reduced(reduced) => {
                let alpha = x.last().copied().unwrap_or(f64::NAN);
                let supports = begun(reduced)?.body().support_displacements(alpha);
                (Ok(x[..own.num_displacements()].to_vec()), Ok(supports))
            }
        };
        Ok(Self {
            problem: problem.clone().unbind(),
            x,
            solution,
            free: free.map_err(raised)?,
            supports: supports.map_err(raised)?,
            strategy,
        })
    }

    /// Runs `work` with the derivatives in the parameters, without the interpreter's lock.
    fn derivatives<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Sensitivity<&(dyn PiecewiseSmooth + Sync)>) -> Result<T, SensitivityError> + Send,
    ) -> PyResult<T> {
        let map = self.problem.get().form()?.map();
        py.detach(|| {
            let (x, parameters) = self.x.split_at(map.num_residuals());
            Sensitivity::new(map, x, parameters).and_then(|mut found| work(&mut found))
        })
        .map_err(raised)
    }

    /// The displacements of all nodes, component by component.
    pub(crate) fn all_displacements(&self, system: &ElasticSystem) -> PyResult<Vec<f64>> {
        system.displacements(&self.free, &self.supports).map_err(raised)
    }

    /// Changes of the free displacements in the shape of `displacements`, 0 at supports.
    pub(crate) fn in_shape<'py>(&self, py: Python<'py>, free: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let Ok((body, dim)) = self.system(py, "mesh") else {
            return Ok(PyArray1::from_slice(py, free).into_any());
        };
        let supports = vec![0.0; self.supports.len()];
        let u = body.get().system.displacements(free, &supports);
        Ok(rows(py, dim, [u.map_err(raised)?.as_slice()])?.into_any())
    }

    /// The free components of an array in the shape of `displacements`, zeros where there is none.
    pub(crate) fn free_of(&self, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
        let Some(given) = given else {
            return Ok(vec![0.0; self.free.len()]);
        };
        let wrong =
            |shape: String| PyValueError::new_err(format!("displacements must have the shape {shape}"));
        let Ok((body, dim)) = self.system(given.py(), "mesh") else {
            let given = vector(given, "displacements")?;
            return match given.len() == self.free.len() {
                true => Ok(given),
                false => Err(wrong(format!("({},)", self.free.len()))),
            };
        };
        let system = &body.get().system;
        let (given, nodes) = (matrix(given, "displacements")?, system.mesh().num_nodes());
        if (given.nrows(), given.ncols()) != (nodes, dim) {
            return Err(wrong(format!("({nodes}, {dim})")));
        }
        let mut free = vec![0.0; self.free.len()];
        for (node, d) in (0..nodes).flat_map(|n| (0..dim).map(move |d| (n, d))) {
            if let Some(dof) = system.dof(node, d) {
                free[dof] = given.get(node, d);
            }
        }
        Ok(free)
    }

    fn tangential<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&LocalValues) -> [f64; 2],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let tangents = self.problem.get().dim() - 1;
        let values: Vec<_> = self.solution.nodes.iter().map(of).collect();
        rows(py, tangents, values.iter().map(|v| &v[..tangents]))
    }

    /// The body and its dimension; `what` is asked for.
    fn system<'py>(&self, py: Python<'py>, what: &str) -> PyResult<(Bound<'py, crate::body::Body>, usize)> {
        let problem = self.problem.get();
        Ok((problem.origin.body(what)?.bind(py).clone(), problem.dim()))
    }
}

#[pymethods]
impl ContactSolution {
    /// The variables, the parameter last: see ``form`` of :class:`ContactProblem`.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.x)
    }

    /// Whether the solution is a differentiable function of the parameter here: True, False (where a node begins to slip, stick, touch
    /// or part), or None: not known; see :class:`Sensitivity`. Not in reduced form.
    #[getter]
    fn differentiable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        Ok(self.derivatives(py, |found| found.differentiable())?.known())
    }

    /// The directional derivative of ``x`` as the parameter changes at the rate dp, of the same shape: its last entry is dp. With dp = -1 it
    /// is the one towards smaller parameters, which at a kink is not the opposite of that with dp = 1.
    #[pyo3(signature = (dp=None))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        dp: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let dp = dp.map_or_else(|| Ok(vec![1.0]), |dp| start(dp, "dp"))?;
        let mut rate = self.derivatives(py, |found| found.jvp(&dp))?;
        rate.extend(dp);
        Ok(PyArray1::from_vec(py, rate))
    }

    /// The derivative in the parameter, shape (1,), of a function of ``x`` with the gradient dx in its entries before the parameter.
    fn vjp<'py>(&self, dx: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (py, dx) = (dx.py(), vector(dx, "dx")?);
        let found = self.derivatives(py, |found| found.vjp(&dx))?;
        Ok(PyArray1::from_vec(py, found))
    }

    /// The largest s such that no node changes its state as the parameter moves from here by t dp, 0 < t < s: exact where the problem is
    /// piecewise affine, else found by following the curve up to s = ``horizon``.
    #[pyo3(signature = (dp=1.0, horizon=1.0))]
    fn valid_until(&self, py: Python<'_>, dp: f64, horizon: f64) -> PyResult<f64> {
        let found = self.derivatives(py, |found| found.valid_until(&[dp], horizon))?;
        Ok(found.until())
    }

    /// The solution as a function of data of its problem. Each argument adds parameters, in the order of the arguments: those of a dict
    /// ``slices``.
    ///
    /// Parameters
    /// ----------
    /// parameter : bool
    ///     The load parameter.
    /// loads : True, Load, or list of Load or of arrays of forces on free displacements
    ///     Factors of further loads; ``True``: all components of the load.
    /// gaps, friction : True or array of shape (p, k)
    ///     Initial gaps and coefficients of friction of the contact nodes; ``True``: all p of them, an array: its columns are the changes with
    ///     each of k parameters (a column of ones: one common to all). Friction is Coulomb's with one coefficient at each node.
    /// young, poisson : True, str, or list of str
    ///     E and ν of all cells or of groups of cells. Materials are isotropic.
    /// positions : list of arrays of shape (number of nodes, dim)
    ///     Velocities of the nodes, one field for each parameter of the shape. Forces on nodes do not change with it. A model of half a body
    ///     stays one: its fields keep nodes of the plane of symmetry on it.
    /// gap_gradients : array of shape (p, dim), optional
    ///     Gradients of the foundation's gap at the contact nodes; those of a plane unless given. Its normals must be the same everywhere.
    #[pyo3(signature = (
        *, parameter=false, loads=None, gaps=None, friction=None, young=None, poisson=None, positions=None, gap_gradients=None
    ))]
    fn sensitivity<'py>(
        slf: &Bound<'py, Self>,
        parameter: bool,
        loads: Option<&Bound<'py, PyAny>>,
        gaps: Option<&Bound<'py, PyAny>>,
        friction: Option<&Bound<'py, PyAny>>,
        young: Option<&Bound<'py, PyAny>>,
        poisson: Option<&Bound<'py, PyAny>>,
        positions: Option<&Bound<'py, PyAny>>,
        gap_gradients: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<ContactSensitivity> {
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
        ContactSensitivity::new(slf, &chosen)
    }

    /// The parameter α.
    #[getter]
    fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }

    /// The state of each contact node: "open", "stick", "slip+" or "slip-".
    #[getter]
    fn states(&self) -> Vec<&'static str> {
        self.solution.states.iter().map(|s| s.name()).collect()
    }

    /// Numbers of open, sticking and slipping nodes.
    #[getter]
    fn counts(&self) -> (usize, usize, usize) {
        (self.solution.open(), self.solution.stick(), self.solution.slip())
    }

    /// Normal nodal forces λν ≥ 0, shape (p,).
    #[getter]
    fn pressures<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.solution.nodes.iter().map(|v| v.pressure))
    }

    /// Normal displacements less the gaps, shape (p,), ≤ 0.
    #[getter]
    fn penetrations<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.solution.nodes.iter().map(|v| v.penetration))
    }

    /// Tangential nodal forces λt along the tangents, with the sign of the slip, shape (p, d − 1).
    #[getter]
    fn tractions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.tangential(py, |v| v.traction)
    }

    /// Slips along the tangents, shape (p, d − 1); in a history their increments since the level before.
    #[getter]
    fn slips<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.tangential(py, |v| v.slip)
    }

    /// Displacements of all mesh nodes, shape (number of nodes, d); u, shape (n,), where the problem is given by matrices.
    #[getter]
    fn displacements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let Ok((body, dim)) = self.system(py, "mesh") else {
            return Ok(PyArray1::from_slice(py, &self.free).into_any());
        };
        let u = body.get().system.displacements(&self.free, &self.supports);
        Ok(rows(py, dim, [u.map_err(raised)?.as_slice()])?.into_any())
    }

    /// Forces of the supports on the body at prescribed displacements, 0 elsewhere, shape (number of nodes, d).
    #[getter]
    fn reactions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (body, dim) = self.system(py, "reactions")?;
        let forces = body.get().system.reactions(&self.free, &self.supports);
        rows(py, dim, [forces.map_err(raised)?.as_slice()])
    }

    /// Stresses (11, 22, 33, 12, 23, 13) at the centres of the cells, shape (number of cells, 6).
    #[getter]
    fn stresses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (body, _) = self.system(py, "stresses")?;
        let system = &body.get().system;
        let stresses = py.detach(|| system.stresses(&self.free, &self.supports));
        rows(py, 6, stresses.map_err(raised)?.iter().map(|s| s.as_slice()))
    }

    /// A dict of energies, forces times lengths: "stored" (elastic), "load" (loads times displacements), "normal", "friction", "dissipated".
    /// 2 stored = load − normal − friction.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python(py, &self.solution.energy)
    }

    /// A dict of the largest residuals of the equations, each relative to the largest force in it: "equilibrium", "normal", "tangential".
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python(py, &self.solution.residuals)
    }

    /// The resultant of the nodal forces: normal and along the tangents, shape (d,); meaningful on a flat boundary.
    #[getter]
    fn resultant<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.solution.resultant()[..self.problem.get().dim()])
    }

    /// Fields on the mesh nodes, a dict of arrays: "displacement" (number of nodes, 3), "pressure" (number of nodes,), "traction" and
    /// "slip" (number of nodes, 3), the tractions of the foundation on the body per area, and "contact state" (−1 off the contact nodes,
    /// 0 open, 1 stick, 2 slip+, 3 slip-).
    #[getter]
    fn point_data<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.get().system(slf.py(), "fields")?;
        slf.py()
            .import("semismooth._meshes")?
            .call_method1("point_data", (slf,))
    }

    /// Fields in the cells, a dict of arrays: "stress" (number of cells, 6) and "von Mises stress" (number of cells,).
    #[getter]
    fn cell_data<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.get().system(slf.py(), "fields")?;
        slf.py()
            .import("semismooth._meshes")?
            .call_method1("cell_data", (slf,))
    }

    /// A picture of the deformed body: displacements times ``magnification`` (so that they are seen, unless given), cells in the colour of
    /// their stress of von Mises, contact nodes in that of their state. Bodies in space are seen from below, where they touch the ground,
    /// unless another ``view`` is given: azimuth and elevation in degrees. The picture is an SVG text, shown by notebooks.
    #[pyo3(signature = (*, magnification=None, view=None))]
    fn plot<'py>(
        &self,
        py: Python<'py>,
        magnification: Option<f64>,
        view: Option<(f64, f64)>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (body, _) = self.system(py, "pictures")?;
        let system = &body.get().system;
        let nodes = &self.problem.get().origin.rows("pictures")?.nodes;
        let (states, displacements) = (&self.solution.states, [&self.free[..], &self.supports]);
        let mut picture =
            BodyPicture::of_contact(system, nodes, states, displacements, magnification).map_err(raised)?;
        if let Some((azimuth, elevation)) = view {
            picture = picture.with_view(azimuth, elevation);
        }
        shown(py, &picture)
    }

    /// :meth:`plot` with displacements to scale unless a ``magnification`` is given.
    #[pyo3(signature = (*, magnification=1.0))]
    fn to_svg<'py>(&self, py: Python<'py>, magnification: f64) -> PyResult<Bound<'py, PyAny>> {
        self.plot(py, Some(magnification), None)
    }

    /// The mesh of the body with all fields, as a mesh of meshio: ``solution.to_meshio().write("solution.vtu")``.
    fn to_meshio<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.get().system(slf.py(), "fields")?;
        let mesh = slf.getattr("problem")?.getattr("body")?.getattr("mesh")?;
        let data = (slf.getattr("point_data")?, slf.getattr("cell_data")?);
        mesh.call_method1("to_meshio", data)
    }

    fn __repr__(&self) -> String {
        let (open, stick, slip) = self.counts();
        format!(
            "<ContactSolution at parameter {}: {open} open, {stick} stick, {slip} slip>",
            number(self.parameter(), &self.x)
        )
    }
}

/// A picture as a text that notebooks show.
pub(crate) fn shown<'py>(py: Python<'py>, picture: &BodyPicture<'_>) -> PyResult<Bound<'py, PyAny>> {
    let svg = picture.to_svg().map_err(raised)?;
    py.import("semismooth._views")?.call_method1("Picture", (svg,))
}

/// A level of a history of loading.
#[pyclass(frozen, get_all, module = "semismooth")]
pub(crate) struct EvolutionStep {
    /// The parameter.
    pub(crate) level: f64,
    /// The solution; slips are the increments since the level before.
    pub(crate) solution: Py<ContactSolution>,
    /// Parameters of the folds on the curve from the level before; near a fold solutions are not unique.
    pub(crate) folds: Vec<f64>,
    /// Number of transitions (points where nodes change their state) on the curve from the level before. In reduced form, number of nodes
    /// whose state differs from that at the level before.
    pub(crate) transitions: usize,
    /// How the level was reached: "followed" (along the curve from the level before), "jumped" (the curve turns back, another solution was
    /// found), "passed folds" (the curve reaches the level after folds, the solution may lie elsewhere), "same level" (as that before), or
    /// "ended: ..." and "not followed: ..." with the reason; "solved" in reduced form, where curves are not followed.
    pub(crate) arrival: String,
    /// Work of the loads and of moving supports in this step; NaN in reduced form.
    pub(crate) work: f64,
    /// Change of the elastic energy.
    pub(crate) stored: f64,
    /// Energy dissipated by friction; work = stored + dissipated where the level was followed. In reduced form, from the forces at its end.
    pub(crate) dissipated: f64,
    /// Work returned by friction at nodes that reverse their slip within the step, ≥ 0: where it is not small compared with ``dissipated``,
    /// levels are too far apart. NaN in reduced form.
    pub(crate) returned: f64,
    /// History variables of the law at each node, shape (p, h): the slip accumulated over all levels, where friction depends on it.
    pub(crate) history: Py<PyArray2<f64>>,
}

#[pymethods]
impl EvolutionStep {
    fn __repr__(&self) -> String {
        let level = number(self.level, &[]);
        format!("<EvolutionStep to parameter {level}: {}>", self.arrival)
    }
}

impl EvolutionStep {
    fn new(problem: &Bound<'_, ContactProblem>, step: &contact::EvolutionStep) -> PyResult<Self> {
        let py = problem.py();
        let solution = ContactSolution::with(problem, step.x.clone(), step.solution.clone(), None)?;
        let arrival = match &step.arrival {
            Arrival::Followed => "followed".to_owned(),
            Arrival::SameLevel => "same level".to_owned(),
            Arrival::Jumped => "jumped".to_owned(),
            Arrival::PassedFolds => "passed folds".to_owned(),
            Arrival::Ended(reason) => format!("ended: {}", reason.name()),
            Arrival::NotFollowed(error) => format!("not followed: {error}"),
            _ => "other".to_owned(),
        };
        let variables = step.history.len() / step.solution.states.len().max(1);
        Ok(Self {
            level: step.level,
            solution: Py::new(py, solution)?,
            folds: step.folds.clone(),
            transitions: step.transitions,
            arrival,
            work: step.work,
            stored: step.stored,
            dissipated: step.dissipated,
            returned: step.returned,
            history: rows(py, variables, [step.history.as_slice()])?.unbind(),
        })
    }

    /// A level of a history in reduced form; `stored` is the elastic energy of the one before.
    fn of_level(problem: &Bound<'_, ContactProblem>, level: &ReducedLevel, stored: f64) -> PyResult<Self> {
        let (py, energy) = (problem.py(), level.solution.energy);
        let mut x = level.report.displacements.clone();
        x.extend(&level.report.forces);
        x.push(level.level);
        let supports = level.supports.clone();
        let solution = ContactSolution {
            problem: problem.clone().unbind(),
            x,
            solution: level.solution.clone(),
            free: level.report.displacements.clone(),
            supports,
            strategy: Some(level.report.strategy.to_string()),
        };
        let variables = level.history.len() / level.solution.states.len().max(1);
        Ok(Self {
            level: level.level,
            solution: Py::new(py, solution)?,
            folds: Vec::new(),
            transitions: level.num_changes(),
            arrival: "solved".to_owned(),
            work: f64::NAN,
            stored: energy.stored - stored,
            dissipated: energy.dissipated,
            returned: f64::NAN,
            history: rows(py, variables, [level.history.as_slice()])?.unbind(),
        })
    }
}

/// Solves a history of load levels: at each the static law holds for the increments of slip, and the curve of solutions is followed from
/// the level before, so that folds are detected. Friction that depends on the slip depends on the slip accumulated since the beginning.
///
/// Parameters
/// ----------
/// problem : ContactProblem
///     Not modified.
/// start : ContactSolution, EvolutionStep or array
///     The solution at the first level; its slips enter the accumulated slip. A step of an earlier history is continued with its
///     history variables.
/// levels : array of shape (k,)
///     The parameters of the levels after the first.
/// slip_increments : bool
///     If true, friction that depends on the slip depends on the increment of each level alone; the result then depends on the levels.
/// callback : callable, optional
///     Called with each :class:`EvolutionStep`; returns True to stop.
/// **options
///     As for :func:`follow`; max_points and max_nodes are 1000 for each level, max_time (60 seconds; None: no limit) is for each. In reduced
///     form those of :meth:`ContactProblem.solve`.
///
/// Returns
/// -------
/// list of EvolutionStep
///
/// Raises
/// ------
/// SemismoothError
///     If no solution is found at a level; the callback has been called with the steps before.
///
/// >>> import semismooth as ss
/// >>> body = ss.Body(ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]), ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
/// >>> ground = ss.Foundation.plane([0, 0], [0, 1])
/// >>> problem = ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", [0.05, None]))
/// >>> steps = ss.evolve(problem, problem.solve(0.0), [0.5, 1.0, 0.0])
/// >>> [s.arrival for s in steps], [s.solution.counts for s in steps]
/// (['followed', 'followed', 'followed'], [(0, 4, 5), (0, 0, 9), (0, 8, 1)])
#[pyfunction]
#[pyo3(signature = (problem, start, levels, *, slip_increments=false, callback=None, **options))]
pub(crate) fn evolve(
    problem: &Bound<'_, ContactProblem>,
    start: &Bound<'_, PyAny>,
    levels: &Bound<'_, PyAny>,
    slip_increments: bool,
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Py<EvolutionStep>>> {
    let py = problem.py();
    problem.get().one_parameter()?;
    let levels = vector(levels, "levels")?;
    if let Some(reduced) = problem.get().reduced() {
        let start = Start::of(start)?;
        return evolve_reduced(problem, reduced, &start, &levels, callback, options);
    }
    let mut form: Form = problem.get().form()?.clone();
    let start = match start.cast::<EvolutionStep>() {
        Ok(step) => {
            let step = step.get();
            let history = vector(&step.history.bind(py).call_method0("ravel")?, "the history")?;
            let x = step.solution.get().x.clone();
            of_form!(&mut form, p => p.set_history(&history).and_then(|()| {
                let traces = p.traces(&x)?;
                p.set_reference_slip(&traces[p.num_contacts()..])
            }))
            .map_err(raised)?;
            x
        }
        Err(_) => point(start)?,
    };
    let own = EvolutionOptions::default();
    let given: ContinuationOptions = crate::arrays::options_over(&own.continuation, options, py)?;
    let options = own.with_continuation(given).with_slip_increments(slip_increments);
    let mut steps = Vec::new();
    let shared = problem.clone().unbind();
    Run::detached(py, |run| {
        let observe = |progress: &EvolutionProgress<'_>| {
            if let EvolutionProgress::Step(step) = progress {
                let told = run.call(|py| {
                    let step = Py::new(py, EvolutionStep::new(shared.bind(py), step)?)?;
                    steps.push(step.clone_ref(py));
                    match &callback {
                        Some(callback) => callback.bind(py).call1((step,))?.is_truthy(),
                        None => Ok(false),
                    }
                });
                if told != Some(false) {
                    return ControlFlow::Break(());
                }
            }
            run.poll()
        };
        of_form!(&mut form, p => contact::evolve_observed(p, &start, &levels, &options, observe))
            .map_err(raised)
    })?;
    Ok(steps)
}

/// Where a history begins.
struct Start {
    x: Vec<f64>,
    /// History variables, where an earlier history is continued.
    history: Option<Vec<f64>>,
}

impl Start {
    fn of(start: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Ok(step) = start.cast::<EvolutionStep>() else {
            return Ok(Self {
                x: point(start)?,
                history: None,
            });
        };
        let (py, step) = (start.py(), step.get());
        let history = step.history.bind(py).call_method0("ravel")?;
        Ok(Self {
            x: step.solution.get().x.clone(),
            history: Some(vector(&history, "the history")?),
        })
    }
}

fn evolve_reduced(
    problem: &Bound<'_, ContactProblem>,
    reduced: &Reduced,
    start: &Start,
    levels: &[f64],
    callback: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Py<EvolutionStep>>> {
    let (py, own) = (problem.py(), problem.get());
    own.check_length(&start.x)?;
    let (u, first) = (&start.x[..own.num_displacements()], start.x[start.x.len() - 1]);
    let options: ReducedOptions = crate::arrays::options(options, py)?;
    let all: Vec<f64> = std::iter::once(first).chain(levels.iter().copied()).collect();
    let (mut steps, mut stored) = (Vec::new(), None);
    let shared = problem.clone().unbind();
    Run::watched(py, |run| {
        let mut problem = begun(reduced)?;
        problem.set_options(options).map_err(raised)?;
        if let Some(history) = &start.history {
            // The reference slips are those of the displacements at the start.
            let solution = problem.solution(first, u).map_err(raised)?;
            let along = |d: usize| solution.nodes.iter().map(move |v| v.slip[d]);
            let slips: Vec<f64> = (0..own.dim() - 1).flat_map(along).collect();
            problem.set_reference_slip(&slips).map_err(raised)?;
            problem.set_history(history).map_err(raised)?;
        }
        let observe = |level: &ReducedLevel| {
            let before = stored.replace(level.solution.energy.stored);
            // The first one is the start.
            let Some(before) = before else {
                return run.flow();
            };
            let told = run.call(|py| {
                let step = Py::new(py, EvolutionStep::of_level(shared.bind(py), level, before)?)?;
                steps.push(step.clone_ref(py));
                match &callback {
                    Some(callback) => callback.bind(py).call1((step,))?.is_truthy(),
                    None => Ok(false),
                }
            });
            match told {
                Some(false) => run.flow(),
                _ => ControlFlow::Break(()),
            }
        };
        let done = problem.evolve_observed(Some(u), &all, |_| run.flow(), observe);
        done.map_err(raised)
    })?;
    Ok(steps)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<ContactSolution>()?;
    module.add_class::<EvolutionStep>()?;
    module.add_function(wrap_pyfunction!(evolve, module)?)
}
