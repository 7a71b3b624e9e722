//! What a boundary may touch: rigid foundations, and boundaries of other bodies.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyString};
use semismooth::fem::{self, ContactRows, Degree, MultiplierSpace, Partition};

use crate::arrays::vector;
use crate::fields::{Direction, Failures, Scalar, in_space};
use crate::mesh::Mesh;
use crate::saving::Made;

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
    pub(crate) fn foundation(
        &self,
        py: Python<'_>,
        dim: usize,
        failures: &Failures,
    ) -> PyResult<fem::Foundation> {
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
    pub(crate) made: Made,
    pub(crate) facets: String,
    gap: Option<Scalar>,
    tangent: Option<Direction>,
    reach: Option<f64>,
}

#[pymethods]
impl Mortar {
    fn __repr__(&self) -> String {
        format!("<Mortar against {:?}>", self.facets)
    }

    #[new]
    #[pyo3(signature = (facets, *, gap=None, tangent=None, reach=None))]
    fn new(
        facets: &Bound<'_, PyString>,
        gap: Option<&Bound<'_, PyAny>>,
        tangent: Option<&Bound<'_, PyAny>>,
        reach: Option<f64>,
    ) -> PyResult<Self> {
        let far = reach.map(|r| PyFloat::new(facets.py(), r).into_any());
        let options = [("gap", gap), ("tangent", tangent), ("reach", far.as_ref())];
        Ok(Self {
            made: Made::by(facets.py(), "new", &[facets.as_any()], &options)?,
            facets: facets.to_string(),
            gap: gap.map(|g| Scalar::of(g, "gap")).transpose()?,
            tangent: tangent.map(|t| Direction::of(t, "tangent")).transpose()?,
            reach,
        })
    }
}

impl Mortar {
    pub(crate) fn mortar(&self, py: Python<'_>, dim: usize, failures: &Failures) -> PyResult<fem::Mortar> {
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
pub(crate) enum Opposite {
    Foundation(fem::Foundation),
    Boundary(String, fem::Mortar),
}

impl Opposite {
    pub(crate) fn of(given: &Bound<'_, PyAny>, dim: usize, failures: &Failures) -> PyResult<Self> {
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

    pub(crate) fn rows(
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

/// The space of contact forces by its name, or as polynomials of a degree on a partition: a number of facets to be merged, names of groups,
/// or a mesh and the name of one of its groups.
pub(crate) fn multipliers(given: Option<&Bound<'_, PyAny>>, degree: &str) -> PyResult<MultiplierSpace> {
    let degree = match degree {
        "constant" => Degree::Constant,
        "linear" => Degree::Linear,
        "continuous" => Degree::Continuous,
        other => {
            return Err(PyValueError::new_err(format!(
                "degree = \"{other}\" is not known: write \"constant\", \"linear\" or \"continuous\""
            )));
        }
    };
    let Some(given) = given else {
        return Ok(MultiplierSpace::Nodal);
    };
    if let Ok(name) = given.extract::<String>() {
        match name.as_str() {
            "nodal" => return Ok(MultiplierSpace::Nodal),
            "dual cells" => return Ok(MultiplierSpace::DualCells),
            _ => {}
        }
    } else {
        let partition = if let Ok(count) = given.extract::<usize>() {
            Some(Partition::Merged(count))
        } else if let Ok((mesh, facets)) = given.extract::<(PyRef<'_, Mesh>, String)>() {
            let mesh = Box::new(mesh.mesh.clone());
            Some(Partition::Coarse { mesh, facets })
        } else {
            given.extract::<Vec<String>>().ok().map(Partition::Groups)
        };
        if let Some(partition) = partition {
            return Ok(MultiplierSpace::Piecewise { partition, degree });
        }
    }
    Err(PyValueError::new_err(format!(
        "multipliers = {} is not known: write \"nodal\", \"dual cells\", a number of facets to be merged, a list of groups of facets, or \
         a pair of a mesh and one of its groups",
        given.repr()?
    )))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Foundation>()?;
    module.add_class::<Mortar>()
}
