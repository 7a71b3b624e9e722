//! Elastic bodies and loads on them.

use std::ffi::CString;

use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyList, PyString, PyTuple};
use semismooth::InputError;
use semismooth::fem::{self, ElasticSystem, Elasticity, PlaneModel, Spring};
use semismooth::interface::LoadCase;

use crate::arrays::{Columns, columns, counted};
use crate::errors::raised;
use crate::fields::{Direction, Failures, Scalar};
use crate::mesh::Mesh;
use crate::names::number;
use crate::saving::Made;

/// A linearly elastic material: Young's modulus (a stress) and Poisson's ratio. See also :meth:`lame` and :meth:`tensor`.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Material {
    material: fem::Material,
    pub(crate) made: Made,
}

#[pymethods]
impl Material {
    #[new]
    fn new(py: Python<'_>, young: f64, poisson: f64) -> PyResult<Self> {
        let material = fem::Material::isotropic(young, poisson).map_err(raised)?;
        let arguments = [young, poisson].map(|v| PyFloat::new(py, v).into_any());
        let made = Made::by(py, "new", &[&arguments[0], &arguments[1]], &[])?;
        Ok(Self { material, made })
    }

    /// Lamé's constants λ and μ (stresses): μ > 0, 3λ + 2μ > 0.
    #[staticmethod]
    #[pyo3(name = "lame")]
    fn of_lame(py: Python<'_>, lambda_: f64, mu: f64) -> PyResult<Self> {
        let material = fem::Material::lame(lambda_, mu).map_err(raised)?;
        let arguments = [lambda_, mu].map(|v| PyFloat::new(py, v).into_any());
        let made = Made::by(py, "lame", &[&arguments[0], &arguments[1]], &[])?;
        Ok(Self { material, made })
    }

    /// A general elasticity tensor, shape (3, 3, 3, 3), symmetric and positive definite: σ_ij = c_ijkl ε_kl.
    #[staticmethod]
    fn tensor(c: &Bound<'_, PyAny>) -> PyResult<Self> {
        let components: [[[[f64; 3]; 3]; 3]; 3] = c.extract()?;
        let material = fem::Material::tensor(&components).map_err(raised)?;
        let made = Made::by(c.py(), "tensor", &[c], &[])?;
        Ok(Self { material, made })
    }

    fn __repr__(&self) -> String {
        let c = self.material.components();
        format!(
            "<Material with c_1111 = {}, c_1212 = {}>",
            number(c[0][0][0][0], &[]),
            number(c[0][1][0][1], &[])
        )
    }

    /// The elasticity tensor, shape (3, 3, 3, 3).
    #[getter]
    fn components<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let flat = self
            .material
            .components()
            .as_flattened()
            .as_flattened()
            .as_flattened()
            .to_vec();
        PyArray1::from_vec(py, flat).call_method1("reshape", (3, 3, 3, 3))
    }
}

/// Forces on a :class:`Body`, or displacements of its supports. Loads on one body can be added and multiplied by numbers.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Load {
    pub(crate) case: LoadCase,
    pub(crate) made: Made,
}

#[pymethods]
impl Load {
    /// The forces on the free displacements, those due to prescribed displacements included, shape (number of free displacements,).
    #[getter]
    fn forces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.case.forces())
    }

    fn __add__(slf: &Bound<'_, Self>, other: &Bound<'_, Self>) -> PyResult<Self> {
        let case = slf.get().case.clone().plus(&other.get().case).map_err(raised)?;
        let made = Made::from(slf, "__add__", &[other])?;
        Ok(Self { case, made })
    }

    fn __sub__(slf: &Bound<'_, Self>, other: &Bound<'_, Self>) -> PyResult<Self> {
        let case = slf
            .get()
            .case
            .clone()
            .plus(other.get().case.times(-1.0))
            .map_err(raised)?;
        let made = Made::from(slf, "__sub__", &[other])?;
        Ok(Self { case, made })
    }

    fn __mul__(slf: &Bound<'_, Self>, factor: f64) -> PyResult<Self> {
        let case = slf.get().case.times(factor);
        let made = Made::from(slf, "__mul__", &[&PyFloat::new(slf.py(), factor)])?;
        Ok(Self { case, made })
    }

    fn __rmul__(slf: &Bound<'_, Self>, factor: f64) -> PyResult<Self> {
        Self::__mul__(slf, factor)
    }

    fn __neg__(slf: &Bound<'_, Self>) -> PyResult<Self> {
        Self::__mul__(slf, -1.0)
    }

    fn __repr__(&self) -> String {
        format!("<Load on {} free displacements>", self.case.forces().len())
    }
}

/// A linearly elastic body on supports, discretised by elements of first or second order.
///
/// Any consistent units: metres and GPa give nodal forces in GN (in the plane per metre of depth).
///
/// Parameters
/// ----------
/// mesh : Mesh
/// material : Material
/// supports : dict
///     Names of groups of facets or nodes, and the displacement there: one number for all components, or a list of d entries with ``None`` for those
///     that are free. Numbers may be functions of a point of shape (d,). Where groups share nodes, later ones take precedence.
/// materials : dict, optional
///     Other materials for groups of cells.
/// plane : {"strain", "stress", "axisymmetric"}
///     Plane strain, plane stress, or a body of revolution about x = 0 without torsion (x is the radius, y the height): loads are forces per
///     area and volume of the rings, areas and nodal forces those of the whole rings; for meshes in the plane.
/// dilatation : {"automatic", "pointwise", "mean"}
///     How quadrilaterals and hexahedra integrate the volumetric strain: as the mean over each cell (B-bar), which keeps them from locking
///     where the material is nearly incompressible; "automatic": where Poisson's ratio is above 0.45. Other cells of first order lock
///     there, with a warning; see ``notes``.
/// floating : bool
///     Whether supports may leave rigid motions, of bodies that contact and friction alone hold (``supports={}``); :class:`ContactProblem`
///     says where nothing balances the load. Not in reduced form.
/// springs : dict, optional
///     Springs at each node of a group of nodes, to the ground, or between the nodes of two groups (a pair of names), one by one: the
///     stiffness (force per displacement, in a body of revolution of whole rings), one number for all components or d of them. Bodies that
///     springs between them alone hold need ``floating=True``.
/// foundations : dict, optional
///     Elastic foundations (of Winkler) below groups of facets, which stay in contact under tension: the stiffness per area along the
///     normal, or a pair with that along the tangents.
///
/// >>> import semismooth as ss
/// >>> mesh = ss.Mesh.rectangle([0, 0], [4, 1], [8, 2])
/// >>> ss.Body(mesh, ss.Material(211.9, 0.277), supports={"left": 0.0})
/// <Body of 16 cells with 48 free displacements>
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Body {
    pub(crate) made: Made,
    pub(crate) system: ElasticSystem,
    #[pyo3(get)]
    /// The mesh.
    mesh: Py<Mesh>,
}

#[pymethods]
impl Body {
    #[new]
    #[pyo3(signature = (
        mesh, material, *, supports, materials=None, plane="strain", dilatation="automatic", floating=false, springs=None,
        foundations=None
    ))]
    fn new(
        mesh: &Bound<'_, Mesh>,
        material: &Bound<'_, Material>,
        supports: &Bound<'_, PyDict>,
        materials: Option<&Bound<'_, PyDict>>,
        plane: &str,
        dilatation: &str,
        floating: bool,
        springs: Option<&Bound<'_, PyDict>>,
        foundations: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        // Of their own, as the caller may change his.
        let (kept, others) = (supports.copy()?, copied(materials)?);
        let (coils, beds) = (copied(springs)?, copied(foundations)?);
        let (word, volumes) = (
            PyString::new(mesh.py(), plane),
            PyString::new(mesh.py(), dilatation),
        );
        let floats = PyBool::new(mesh.py(), floating).to_owned();
        let options: [(&'static str, Option<&Bound<'_, PyAny>>); 7] = [
            ("floating", Some(&floats)),
            ("supports", Some(&kept)),
            ("materials", others.as_ref().map(|m| m.as_any())),
            ("plane", Some(&word)),
            ("dilatation", Some(&volumes)),
            ("springs", coils.as_ref().map(|m| m.as_any())),
            ("foundations", beds.as_ref().map(|m| m.as_any())),
        ];
        let made = Made::by(mesh.py(), "new", &[mesh, material], &options)?;
        let material = material.get();
        let (py, dim, failures) = (mesh.py(), mesh.get().mesh.dim(), Failures::default());
        let plane: PlaneModel = plane
            .parse()
            .map_err(|e: InputError| PyValueError::new_err(format!("plane: {e}")))?;
        let own = Elasticity::new(mesh.get().mesh.clone(), material.material.clone());
        let dilatation = dilatation
            .parse()
            .map_err(|e: InputError| PyValueError::new_err(format!("dilatation: {e}")))?;
        let mut body = own.with_plane_model(plane).with_dilatation(dilatation);
        if floating {
            body = body.floating();
        }
        for (name, material) in materials.into_iter().flatten() {
            let material = material.cast_into::<Material>()?;
            body = body.with_material(name.extract::<String>()?, material.get().material.clone());
        }
        for (name, given) in supports {
            let name: String = name.extract()?;
            for (component, value) in components(&given, dim)? {
                body = body.prescribe(&name, component, value.function(py, dim, &failures));
            }
        }
        for (groups, given) in springs.into_iter().flatten() {
            let spring = spring(&given, dim)?;
            body = match groups.extract::<(String, String)>() {
                Ok((first, second)) => body.spring_between(first, second, spring),
                Err(_) => body.spring(groups.extract::<String>()?, spring),
            };
        }
        for (name, given) in foundations.into_iter().flatten() {
            let [normal, tangential] = match given.extract::<f64>() {
                Ok(normal) => [normal, 0.0],
                Err(_) => given.extract().map_err(|_| {
                    PyTypeError::new_err(
                        "the stiffness of a foundation is a number, or a pair: normal, tangential",
                    )
                })?,
            };
            body = body.elastic_foundation(name.extract::<String>()?, normal, tangential);
        }
        let system = failures.settle(py.detach(|| body.discretize()))?;
        if system.num_locking() > 0 {
            let warning = CString::new(system.notes().join("; "))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &warning, 1)?;
        }
        Ok(Self {
            made,
            system,
            mesh: mesh.clone().unbind(),
        })
    }

    /// What should be known of the discretisation: where the volumetric strain is a mean over the cell, and where elements lock.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.system.notes()
    }

    /// Number of free displacements.
    #[getter]
    fn num_free(&self) -> usize {
        self.system.num_free()
    }

    /// The stiffness matrix of the free displacements, as ``(data, indices, indptr)`` of compressed columns:
    /// ``scipy.sparse.csc_matrix(body.stiffness)``. Displacements are numbered node by node, component by component.
    #[getter]
    fn stiffness<'py>(&self, py: Python<'py>) -> Columns<'py> {
        columns(py, self.system.stiffness())
    }

    /// The load of a traction on a group of facets: force per area (in the plane per length), a vector of shape (d,) or a function of a
    /// point that gives one.
    fn traction(slf: &Bound<'_, Self>, facets: &str, value: &Bound<'_, PyAny>) -> PyResult<Load> {
        let (py, own) = (slf.py(), slf.get());
        let made = Made::from(slf, "traction", &[&PyString::new(py, facets), value])?;
        let failures = Failures::default();
        let value = Direction::of(value, "the traction")?;
        let value = value.function(py, own.system.mesh().dim(), "the traction", &failures)?;
        let forces = py.detach(|| own.system.traction(facets, value));
        let case = failures.settle(forces)?.into();
        Ok(Load { case, made })
    }

    /// The load of a force at each node of a group of nodes, a vector of shape (d,) or a function of a point that gives one.
    fn nodal_force(slf: &Bound<'_, Self>, nodes: &str, value: &Bound<'_, PyAny>) -> PyResult<Load> {
        let (py, own) = (slf.py(), slf.get());
        let made = Made::from(slf, "nodal_force", &[&PyString::new(py, nodes), value])?;
        let failures = Failures::default();
        let value = Direction::of(value, "the force")?;
        let value = value.function(py, own.system.mesh().dim(), "the force", &failures)?;
        let forces = py.detach(|| own.system.nodal_force(nodes, value));
        let case = failures.settle(forces)?.into();
        Ok(Load { case, made })
    }

    /// The load of a force per volume (in the plane per area), a vector of shape (d,) or a function of a point that gives one.
    fn body_force(slf: &Bound<'_, Self>, value: &Bound<'_, PyAny>) -> PyResult<Load> {
        let (py, own) = (slf.py(), slf.get());
        let made = Made::from(slf, "body_force", &[value])?;
        let failures = Failures::default();
        let value = Direction::of(value, "the force")?;
        let value = value.function(py, own.system.mesh().dim(), "the force", &failures)?;
        let forces = py.detach(|| own.system.body_force(value));
        let case = failures.settle(forces)?.into();
        Ok(Load { case, made })
    }

    /// The load of supports that move: the displacement on a group of facets, as in ``supports``, whose components must be prescribed there;
    /// all other prescribed displacements are 0. As ``rate`` of a :class:`ContactProblem` it is displacement control.
    fn motion(slf: &Bound<'_, Self>, facets: &str, value: &Bound<'_, PyAny>) -> PyResult<Load> {
        let (py, own) = (slf.py(), slf.get());
        let made = Made::from(slf, "motion", &[&PyString::new(py, facets), value])?;
        let dim = own.system.mesh().dim();
        let mut sum: Option<LoadCase> = None;
        for (component, value) in components(value, dim)? {
            let failures = Failures::default();
            let value = value.function(py, dim, &failures);
            let case = py.detach(|| own.system.motion(facets, component, value));
            let case = failures.settle(case)?;
            sum = Some(match sum {
                Some(sum) => sum.plus(case).map_err(raised)?,
                None => case,
            });
        }
        let case = sum.ok_or_else(|| PyValueError::new_err("the motion has no component"))?;
        Ok(Load { case, made })
    }

    fn __repr__(&self) -> String {
        format!(
            "<Body of {} with {}>",
            counted(self.system.mesh().num_cells(), "cell"),
            counted(self.system.num_free(), "free displacement")
        )
    }
}

fn copied<'py>(given: Option<&Bound<'py, PyDict>>) -> PyResult<Option<Bound<'py, PyDict>>> {
    given.map(|m| m.copy()).transpose()
}

/// A stiffness for all components, or one each.
fn spring(given: &Bound<'_, PyAny>, dim: usize) -> PyResult<Spring> {
    let stiffness = match given.extract::<f64>() {
        Ok(all) => vec![all; dim],
        Err(_) => given.extract::<Vec<f64>>().map_err(|_| {
            PyTypeError::new_err("the stiffness of a spring is a number, or one for each component")
        })?,
    };
    if stiffness.len() != dim {
        return Err(PyTypeError::new_err(format!(
            "the stiffness of a spring has {dim} components, there are {}",
            stiffness.len()
        )));
    }
    let mut axes = [0.0; 3];
    axes[..dim].copy_from_slice(&stiffness);
    Spring::axes(axes).map_err(raised)
}

/// One value for all components, or one each, `None` for those that are free.
fn components(given: &Bound<'_, PyAny>, dim: usize) -> PyResult<Vec<(usize, Scalar)>> {
    const WHAT: &str = "a displacement";
    let listed = given.is_instance_of::<PyList>()
        || given.is_instance_of::<PyTuple>()
        || (given.hasattr("shape")? && given.len().is_ok());
    if !listed {
        return (0..dim).map(|c| Ok((c, Scalar::of(given, WHAT)?))).collect();
    }
    let entries: Vec<Bound<'_, PyAny>> = given.try_iter()?.collect::<PyResult<_>>()?;
    if entries.len() != dim {
        return Err(PyTypeError::new_err(format!(
            "a displacement has {dim} components, there are {}",
            entries.len()
        )));
    }
    let prescribed = entries.iter().enumerate().filter(|(_, e)| !e.is_none());
    prescribed.map(|(c, e)| Ok((c, Scalar::of(e, WHAT)?))).collect()
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Material>()?;
    module.add_class::<Load>()?;
    module.add_class::<Body>()
}
