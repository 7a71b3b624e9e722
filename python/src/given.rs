//! Where the data of a contact problem come from: a mesh, or matrices; what is given node by node.

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use semismooth::contact::{ContactBody, ContactError, LoadPath};
use semismooth::fem::ContactRows;
use semismooth::sparse::{Matrix, read_substructure};

use crate::arrays::{Columns, columns, matrix, vector};
use crate::body::Body;
use crate::errors::{SemismoothError, raised};
use crate::laws::PerNode;

/// The stiffness of a substructure in compressed columns; label of the node and component, from 1, of each displacement, shape (n, 2).
#[pyfunction]
fn _read_substructure<'py>(
    py: Python<'py>,
    path: PathBuf,
) -> PyResult<(Columns<'py>, Bound<'py, PyArray2<i64>>)> {
    let found = py.detach(|| read_substructure(&path)).map_err(raised)?;
    let places: Vec<i64> = found.displacements.iter().flatten().map(|v| *v as i64).collect();
    let places = PyArray1::from_vec(py, places).reshape([found.displacements.len(), 2])?;
    Ok((columns(py, &found.stiffness), places))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_read_substructure, module)?)
}

/// Where the data of a problem come from.
pub(crate) enum Origin {
    Mesh { body: Py<Body>, rows: Arc<ContactRows> },
    Matrices(Arc<Given>),
}

/// What is known of the contact nodes of a body given by matrices.
pub(crate) struct Given {
    displacements: usize,
    gap: Vec<f64>,
    /// Empty where they are not given.
    points: Vec<[f64; 3]>,
    held: Vec<[bool; 2]>,
    /// What had to be changed.
    pub(crate) note: Option<String>,
}

impl Given {
    /// From A, Bν and a list of Bt; the load and its rate; gaps; points.
    pub(crate) fn new(
        [stiffness, normal, tangential]: [&Bound<'_, PyAny>; 3],
        loads: [Option<&Bound<'_, PyAny>>; 2],
        gap: Option<&Bound<'_, PyAny>>,
        points: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Self, ContactBody)> {
        let py = stiffness.py();
        let (a, b) = (matrix(stiffness, "stiffness")?, matrix(normal, "normal")?);
        let each = |t: PyResult<Bound<'_, PyAny>>| matrix(&t?, "each matrix in tangential");
        let bt: Vec<Matrix> = tangential.try_iter()?.map(each).collect::<PyResult<_>>()?;
        let (n, p, dim) = (a.nrows(), b.nrows(), 1 + bt.len());
        let forces = |given: Option<&Bound<'_, PyAny>>, what: &str| {
            given.map_or_else(|| Ok(vec![0.0; n]), |f| vector(f, what))
        };
        let path = LoadPath::affine(forces(loads[0], "load")?, forces(loads[1], "rate")?);
        let gap = gap.map_or_else(|| Ok(vec![0.0; p]), |g| vector(g, "gap"))?;
        let places = points.map_or_else(|| Ok(Vec::new()), |x| positions(x, p, dim))?;
        let held = held_tangents(&bt, p);
        let (body, note) = py
            .detach(|| {
                let (body, note) = ContactBody::exported(a, b, bt, path)?;
                Ok((body.with_gap(gap.clone())?, note))
            })
            .map_err(|e: ContactError| raised(e))?;
        if let Some(note) = &note {
            PyErr::warn(
                py,
                &py.get_type::<PyUserWarning>(),
                &CString::new(note.as_str())?,
                1,
            )?;
        }
        let given = Self {
            displacements: n,
            gap,
            points: places,
            held,
            note,
        };
        Ok((given, body))
    }
}

/// Tangents whose rows are zero.
fn held_tangents(tangential: &[Matrix], count: usize) -> Vec<[bool; 2]> {
    let mut held = vec![[0, 1].map(|t| t < tangential.len()); count];
    for (t, matrix) in tangential.iter().enumerate().take(2) {
        for (i, _, _) in matrix.triplets().filter(|entry| entry.2 != 0.0) {
            if let Some(held) = held.get_mut(i) {
                held[t] = false;
            }
        }
    }
    held
}

fn positions(given: &Bound<'_, PyAny>, count: usize, dim: usize) -> PyResult<Vec<[f64; 3]>> {
    let places = matrix(given, "points")?;
    if (places.nrows(), places.ncols()) != (count, dim) {
        return Err(PyValueError::new_err(format!(
            "points have the shape ({}, {}), expected ({count}, {dim})",
            places.nrows(),
            places.ncols()
        )));
    }
    let at = |i: usize| [0, 1, 2].map(|d| if d < dim { places.get(i, d) } else { 0.0 });
    Ok((0..count).map(at).collect())
}

impl Origin {
    pub(crate) fn clone_ref(&self, py: Python<'_>) -> Self {
        match self {
            Self::Mesh { body, rows } => Self::Mesh {
                body: body.clone_ref(py),
                rows: rows.clone(),
            },
            Self::Matrices(given) => Self::Matrices(given.clone()),
        }
    }

    /// The body and the contact rows of its mesh; `what` is asked for.
    fn mesh(&self, what: &str) -> PyResult<(&Py<Body>, &ContactRows)> {
        match self {
            Self::Mesh { body, rows } => Ok((body, rows)),
            Self::Matrices(_) => Err(SemismoothError::new_err(format!(
                "a problem given by matrices has no {what}: they belong to a mesh"
            ))),
        }
    }

    pub(crate) fn body(&self, what: &str) -> PyResult<&Py<Body>> {
        Ok(self.mesh(what)?.0)
    }

    pub(crate) fn rows(&self, what: &str) -> PyResult<&ContactRows> {
        Ok(self.mesh(what)?.1)
    }

    pub(crate) fn points(&self) -> PyResult<&[[f64; 3]]> {
        match self {
            Self::Mesh { rows, .. } => Ok(&rows.points),
            Self::Matrices(given) if given.points.len() == given.gap.len() => Ok(&given.points),
            Self::Matrices(_) => Err(SemismoothError::new_err(
                "the points of the contact nodes are not known: give points to from_matrices",
            )),
        }
    }

    pub(crate) fn gaps(&self) -> &[f64] {
        match self {
            Self::Mesh { rows, .. } => &rows.gap,
            Self::Matrices(given) => &given.gap,
        }
    }

    pub(crate) fn held(&self) -> &[[bool; 2]] {
        match self {
            Self::Mesh { rows, .. } => &rows.held,
            Self::Matrices(given) => &given.held,
        }
    }

    pub(crate) fn num_held(&self) -> usize {
        self.held().iter().filter(|h| h.contains(&true)).count()
    }

    pub(crate) fn num_displacements(&self) -> usize {
        match self {
            Self::Mesh { rows, .. } => rows.normal.ncols(),
            Self::Matrices(given) => given.displacements,
        }
    }
}

/// An array with one entry a mesh node as one of the contact nodes; anything else as it is.
pub(crate) fn of_contact_nodes<'py>(
    given: &Bound<'py, PyAny>,
    nodes: &[usize],
    all: usize,
) -> PyResult<Bound<'py, PyAny>> {
    if nodes.len() == all || !given.hasattr("shape")? || !given.len().is_ok_and(|len| len == all) {
        return Ok(given.clone());
    }
    let values = vector(given, "the coefficient of friction")?;
    let picked = PyArray1::from_iter(given.py(), nodes.iter().map(|&n| values[n]));
    Ok(picked.into_any())
}

/// Normal and tangential compliances of contact nodes.
pub(crate) struct Compliance([Vec<f64>; 2]);

impl Compliance {
    /// From a pair of stiffnesses per area, `None` for rigid.
    pub(crate) fn new(stiffness: Option<&Bound<'_, PyAny>>, areas: &[f64]) -> PyResult<Option<Self>> {
        let Some(given) = stiffness.filter(|s| !s.is_none()) else {
            return Ok(None);
        };
        let pair: (Bound<'_, PyAny>, Bound<'_, PyAny>) = given
            .extract()
            .map_err(|_| PyTypeError::new_err("the stiffness of a layer is a pair: normal, tangential"))?;
        let along = |given: &Bound<'_, PyAny>| -> PyResult<Vec<f64>> {
            if given.is_none() {
                return Ok(vec![0.0; areas.len()]);
            }
            let what = "the stiffness of the layer";
            let values = PerNode::of(given, what)?.at(areas.len(), what)?;
            match values.iter().find(|k| !(**k > 0.0 && k.is_finite())) {
                Some(wrong) => Err(PyValueError::new_err(format!(
                    "{what} is {wrong}; it must be positive and finite (None: rigid)"
                ))),
                None => Ok(values.iter().zip(areas).map(|(k, a)| 1.0 / (k * a)).collect()),
            }
        };
        Ok(Some(Self([along(&pair.0)?, along(&pair.1)?])))
    }

    /// The body with these compliances, if any.
    pub(crate) fn of(body: ContactBody, own: Option<Self>) -> Result<ContactBody, ContactError> {
        match own {
            Some(Self([normal, tangential])) => body.with_compliance(&normal, &tangential),
            None => Ok(body),
        }
    }
}
