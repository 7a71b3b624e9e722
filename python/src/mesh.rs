//! Meshes.

use std::collections::BTreeSet;

use numpy::{AllowTypeChange, PyArray2, PyArrayLike1, PyArrayLike2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semismooth::fem::{self, BoundaryFacet, CellKind};
use semismooth::output::{BodyPicture, Colour, SegmentStyle};

use crate::arrays::{counted, indices, rows, truncated};
use crate::errors::raised;
use crate::saving::{data, data_of, state_of};
use crate::solution::shown;

const KINDS: [(CellKind, &str, &str); 14] = [
    (CellKind::Triangle, "triangle", "triangle"),
    (CellKind::Quadrilateral, "quad", "quadrilateral"),
    (CellKind::Tetrahedron, "tetra", "tetrahedron"),
    (CellKind::Hexahedron, "hexahedron", "hexahedron"),
    (CellKind::Triangle6, "triangle6", "triangle6"),
    (CellKind::Quadrilateral8, "quad8", "quadrilateral8"),
    (CellKind::Quadrilateral9, "quad9", "quadrilateral9"),
    (CellKind::Tetrahedron10, "tetra10", "tetrahedron10"),
    (CellKind::Hexahedron20, "hexahedron20", "hexahedron20"),
    (CellKind::Hexahedron27, "hexahedron27", "hexahedron27"),
    (CellKind::Wedge, "wedge", "wedge"),
    (CellKind::Wedge15, "wedge15", "wedge15"),
    (CellKind::Pyramid, "pyramid", "pyramid"),
    (CellKind::Pyramid13, "pyramid13", "pyramid13"),
];

/// Cells of one kind: its name, and their nodes.
type Block<'py> = (&'static str, Bound<'py, PyArray2<i64>>);

/// A mesh of triangles and quadrilaterals in the plane, or of tetrahedra, hexahedra, wedges and pyramids in space, with named groups of cells
/// (for materials) and of facets (edges or faces, for supports, loads and contact).
///
/// Parameters
/// ----------
/// points : array of shape (number of nodes, d), d = 2 or 3
/// cells : dict, or list of pairs
///     Kind ("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid", and of second order "triangle6", "quad8", "quad9", "tetra10",
///     "hexahedron20", "hexahedron27", "wedge15", "pyramid13", as meshio calls them) and an integer array of shape (k, nodes of a cell),
///     numbered as in meshio and VTK. Cells numbered clockwise are reversed.
/// facets, cell_groups, nodes : dict, optional
///     Names with facets, an integer array of shape (k, nodes of a facet) or a list of lists (corners alone may be given); with cells; and with
///     nodes: numbers, or a mask of shape (number of cells,) or (number of nodes,).
///
/// See also :meth:`rectangle`, :meth:`block`, :meth:`from_meshio` and :meth:`read_gmsh`. Meshes are immutable: ``with_...`` makes another.
///
/// >>> import semismooth as ss
/// >>> mesh = ss.Mesh([[0, 0], [1, 0], [0, 1]], {"triangle": [[0, 1, 2]]}, facets={"bottom": [[0, 1]]})
/// >>> mesh
/// <Mesh in 2 dimensions: 3 nodes, 1 cell, facets: bottom>
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Mesh {
    pub(crate) mesh: fem::Mesh,
}

impl Mesh {
    pub(crate) fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        state_of(py, &[("mesh", data_of(py, &slf.get().mesh)?)])
    }

    pub(crate) fn restored<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let mesh = data(state, "mesh")?;
        Ok(Bound::new(py, Self { mesh })?.into_any())
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (points, cells, *, facets=None, cell_groups=None, nodes=None))]
    fn new(
        points: &Bound<'_, PyAny>,
        cells: &Bound<'_, PyAny>,
        facets: Option<&Bound<'_, PyDict>>,
        cell_groups: Option<&Bound<'_, PyDict>>,
        nodes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let array: PyArrayLike2<'_, f64, AllowTypeChange> = points.extract().map_err(|_| {
            PyTypeError::new_err("points must be an array of shape (number of nodes, 2 or 3)")
        })?;
        let dim = array.shape()[1];
        if dim != 2 && dim != 3 {
            return Err(PyValueError::new_err(format!(
                "points have {dim} coordinates; a mesh has 2 or 3 dimensions"
            )));
        }
        let point = |row: numpy::ndarray::ArrayView1<'_, f64>| {
            let mut x = [0.0; 3];
            row.iter().zip(&mut x).for_each(|(v, x)| *x = *v);
            x
        };
        let points = array.as_array().rows().into_iter().map(point).collect();
        let mut all = Vec::new();
        let blocks = match cells.cast::<PyDict>() {
            Ok(dict) => dict.items().into_any(),
            Err(_) => cells.clone(),
        };
        for block in blocks.try_iter()? {
            let (kind, nodes): (String, Bound<'_, PyAny>) = block?.extract()?;
            let Some(&(kind, ..)) = KINDS.iter().find(|(_, a, b)| *a == kind || *b == kind) else {
                let known: Vec<_> = KINDS.iter().map(|k| k.1).collect();
                return Err(PyValueError::new_err(format!(
                    "cells of kind \"{kind}\" are not known: a mesh has {}",
                    known.join(", ")
                )));
            };
            all.extend(lists(&nodes, "cells")?.into_iter().map(|nodes| (kind, nodes)));
        }
        let mut mesh = fem::Mesh::oriented(dim, points, all).map_err(raised)?;
        for (name, given) in facets.into_iter().flatten() {
            mesh.add_facet_group(name.extract::<String>()?, lists(&given, "facets")?)
                .map_err(raised)?;
        }
        for (name, given) in cell_groups.into_iter().flatten() {
            let chosen = numbers(&given, mesh.num_cells(), "cells")?;
            mesh.add_cell_group(name.extract::<String>()?, chosen)
                .map_err(raised)?;
        }
        for (name, given) in nodes.into_iter().flatten() {
            let chosen = numbers(&given, mesh.num_nodes(), "nodes")?;
            mesh.add_node_group(name.extract::<String>()?, chosen)
                .map_err(raised)?;
        }
        Ok(Self { mesh })
    }

    /// A rectangle of ``cells[0]`` × ``cells[1]`` equal quadrilaterals, with the groups of facets "left", "right", "bottom", "top".
    #[staticmethod]
    fn rectangle(lower: [f64; 2], upper: [f64; 2], cells: [usize; 2]) -> PyResult<Self> {
        let mesh = fem::Mesh::rectangle(lower, upper, cells).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// A block of ``cells[0]`` × ``cells[1]`` × ``cells[2]`` equal hexahedra, with the groups of facets "left", "right" (x), "front", "back"
    /// (y), "bottom", "top" (z).
    #[staticmethod]
    fn block(lower: [f64; 3], upper: [f64; 3], cells: [usize; 3]) -> PyResult<Self> {
        let mesh = fem::Mesh::block(lower, upper, cells).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// Reads a file of Gmsh (.msh, versions 2 and 4; elements of first or second order); its physical groups become groups.
    #[staticmethod]
    fn read_gmsh(py: Python<'_>, path: std::path::PathBuf) -> PyResult<Self> {
        let mesh = py.detach(|| fem::read_gmsh(path)).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// Converts a mesh of meshio (``meshio.read`` supports Abaqus, VTU, Exodus, MED and many other formats).
    ///
    /// Blocks of triangles and quadrilaterals (plane meshes; a third coordinate must be the same everywhere) or tetrahedra and hexahedra are
    /// its cells. Named sets of cells become groups of cells or facets, by the dimension of their blocks, and so do the physical groups of
    /// Gmsh. A named set of points becomes the group of these nodes, and of the boundary facets that have all their nodes in it; points of
    /// Gmsh become groups of nodes. Nodes in no cell are left out.
    ///
    /// Parameters
    /// ----------
    /// mesh : meshio.Mesh
    ///
    /// Returns
    /// -------
    /// Mesh
    #[staticmethod]
    fn from_meshio<'py>(mesh: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let meshes = mesh.py().import("semismooth._meshes")?;
        meshes.call_method1("from_meshio", (mesh,))
    }

    /// The mesh as a mesh of meshio, with fields: its ``write`` supports VTU, XDMF and many other formats.
    ///
    /// Parameters
    /// ----------
    /// point_data, cell_data : dict, optional
    ///     Names with arrays whose first axis runs over the nodes, over the cells; those of
    ///     :attr:`ContactSolution.point_data` and :attr:`ContactSolution.cell_data` fit.
    ///
    /// Returns
    /// -------
    /// meshio.Mesh
    #[pyo3(signature = (point_data=None, cell_data=None))]
    fn to_meshio<'py>(
        slf: &Bound<'py, Self>,
        point_data: Option<Bound<'py, PyAny>>,
        cell_data: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let meshes = slf.py().import("semismooth._meshes")?;
        meshes.call_method1("to_meshio", (slf, point_data, cell_data))
    }

    /// The dimension d, 2 or 3.
    #[getter]
    fn dimension(&self) -> usize {
        self.mesh.dim()
    }

    /// Coordinates of the nodes, shape (number of nodes, d).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        truncated(py, self.mesh.dim(), self.mesh.points())
    }

    /// The cells, as a list of pairs: kind, and nodes of consecutive cells of that kind, shape (k, nodes of a cell).
    #[getter]
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Vec<Block<'py>>> {
        let mut blocks: Vec<(CellKind, Vec<Vec<i64>>)> = Vec::new();
        for cell in 0..self.mesh.num_cells() {
            let (kind, nodes) = (self.mesh.kind(cell), self.mesh.cell(cell));
            let nodes = nodes.iter().map(|n| *n as i64).collect();
            match blocks.last_mut() {
                Some((last, block)) if *last == kind => block.push(nodes),
                _ => blocks.push((kind, vec![nodes])),
            }
        }
        let block = |(kind, nodes): (CellKind, Vec<Vec<i64>>)| {
            let name = KINDS.iter().find(|k| k.0 == kind).map_or("", |k| k.1);
            Ok((name, PyArray2::from_vec2(py, &nodes)?))
        };
        blocks.into_iter().map(block).collect()
    }

    /// Number of nodes.
    #[getter]
    fn num_nodes(&self) -> usize {
        self.mesh.num_nodes()
    }

    /// Number of cells.
    #[getter]
    fn num_cells(&self) -> usize {
        self.mesh.num_cells()
    }

    /// The groups of facets: names, and the facets of each, as lists of nodes.
    #[getter]
    fn facets(&self) -> PyResult<Vec<(String, Vec<Vec<usize>>)>> {
        let group = |name: &str| {
            let facets = self.mesh.facet_group(name).map_err(raised)?;
            Ok((name.to_owned(), facets.to_vec()))
        };
        self.mesh.facet_group_names().map(group).collect()
    }

    /// The groups of cells: names, and the numbers of the cells of each.
    #[getter]
    fn cell_groups(&self) -> PyResult<Vec<(String, Vec<usize>)>> {
        let group = |name: &str| {
            let cells = self.mesh.cell_group(name).map_err(raised)?;
            Ok((name.to_owned(), cells.to_vec()))
        };
        self.mesh.cell_group_names().map(group).collect()
    }

    /// The groups of nodes: names, and the numbers of the nodes of each.
    #[getter]
    fn nodes(&self) -> PyResult<Vec<(String, Vec<usize>)>> {
        let group = |name: &str| {
            let nodes = self.mesh.node_group(name).map_err(raised)?;
            Ok((name.to_owned(), nodes.to_vec()))
        };
        self.mesh.node_group_names().map(group).collect()
    }

    /// The mesh with an additional group of nodes, for supports and springs at points and forces there.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// choose : callable
    ///     ``choose(points)`` receives the positions of all nodes, shape (number of nodes, d), and returns a mask of shape (number of nodes,).
    ///
    /// >>> import semismooth as ss
    /// >>> mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 2]).with_nodes("corner", lambda x: (x[:, 0] == 0) & (x[:, 1] == 0))
    /// >>> mesh.nodes
    /// [('corner', [0])]
    fn with_nodes(&self, py: Python<'_>, name: String, choose: &Bound<'_, PyAny>) -> PyResult<Self> {
        let chosen = choose.call1((truncated(py, self.mesh.dim(), self.mesh.points())?,))?;
        let mut mesh = self.mesh.clone();
        mesh.add_node_group(name, numbers(&chosen, self.mesh.num_nodes(), "nodes")?)
            .map_err(raised)?;
        Ok(Self { mesh })
    }

    /// The mesh with an additional group of boundary facets.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// choose : callable
    ///     ``choose(centres, normals)`` receives the centres and the outward unit normals of all boundary facets, both of shape (k, d), and
    ///     returns a mask of shape (k,).
    ///
    /// >>> import semismooth as ss
    /// >>> mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 2])
    /// >>> mesh = mesh.with_boundary("right half", lambda x, normal: (normal[:, 1] < -0.5) & (x[:, 0] > 1))
    /// >>> len(dict(mesh.facets)["right half"])
    /// 2
    fn with_boundary(&self, py: Python<'_>, name: String, choose: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (dim, boundary) = (self.mesh.dim(), self.mesh.boundary());
        let array =
            |of: fn(&BoundaryFacet) -> &[f64; 3]| rows(py, dim, boundary.iter().map(|f| &of(f)[..dim]));
        let chosen = choose.call1((array(|f| &f.centre)?, array(|f| &f.normal)?))?;
        let chosen = numbers(&chosen, boundary.len(), "boundary facets")?;
        let mut mesh = self.mesh.clone();
        let facets = chosen.into_iter().map(|k| boundary[k].nodes.clone());
        mesh.add_facet_group(name, facets.collect()).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// The mesh with an additional group of cells.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// choose : callable
    ///     ``choose(centres)`` receives the centres of all cells, shape (number of cells, d), and returns a mask of shape
    ///     (number of cells,).
    fn with_cells(&self, py: Python<'_>, name: String, choose: &Bound<'_, PyAny>) -> PyResult<Self> {
        let centres: Vec<[f64; 3]> = (0..self.mesh.num_cells()).map(|c| self.mesh.centre(c)).collect();
        let chosen = choose.call1((truncated(py, self.mesh.dim(), &centres)?,))?;
        let mut mesh = self.mesh.clone();
        mesh.add_cell_group(name, numbers(&chosen, centres.len(), "cells")?)
            .map_err(raised)?;
        Ok(Self { mesh })
    }

    /// The mesh with each cell cut into 2ᵈ; groups are kept.
    fn refined(&self, py: Python<'_>) -> PyResult<Self> {
        let mesh = py.detach(|| self.mesh.refined()).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// The same mesh with cells of second order ("triangle6", "quad9", "tetra10", "hexahedron27") in place of its cells; groups are kept.
    fn second_order(&self, py: Python<'_>) -> PyResult<Self> {
        let mesh = py.detach(|| self.mesh.second_order()).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// As :meth:`second_order`, but with nodes in the middles of edges alone ("quad8", "hexahedron20"): fewer unknowns, and less accurate where
    /// cells are no parallelograms.
    fn serendipity(&self, py: Python<'_>) -> PyResult<Self> {
        let mesh = py.detach(|| self.mesh.serendipity()).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// The same nodes with quadrilaterals cut into triangles, hexahedra into tetrahedra; groups are kept.
    fn simplices(&self, py: Python<'_>) -> PyResult<Self> {
        let mesh = py.detach(|| self.mesh.simplices()).map_err(raised)?;
        Ok(Self { mesh })
    }

    /// A picture of the mesh, in space seen from the ``view``, azimuth and elevation in degrees, with the nodes of ``groups`` of facets or
    /// nodes marked, each in a colour of its own. The picture is an SVG text, shown by notebooks.
    ///
    /// >>> import semismooth as ss
    /// >>> picture = ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]).plot(groups=["bottom", "top"])
    /// >>> picture.save("mesh.svg")  # doctest: +SKIP
    #[pyo3(signature = (*, groups=Vec::new(), view=None))]
    fn plot<'py>(
        &self,
        py: Python<'py>,
        groups: Vec<String>,
        view: Option<(f64, f64)>,
    ) -> PyResult<Bound<'py, PyAny>> {
        const COLOURS: [Colour; 4] = [Colour::BLUE, Colour::RED, Colour::GREEN, Colour::GREY];
        let mut picture = BodyPicture::new(&self.mesh);
        if let Some((azimuth, elevation)) = view {
            picture = picture.with_view(azimuth, elevation);
        }
        for (name, colour) in groups.iter().zip(COLOURS.iter().cycle()) {
            let nodes: BTreeSet<usize> = match self.mesh.facet_group(name) {
                Ok(facets) => facets.iter().flatten().copied().collect(),
                Err(e) => match self.mesh.node_group(name) {
                    Ok(nodes) => nodes.iter().copied().collect(),
                    Err(_) => return Err(raised(e)),
                },
            };
            for node in nodes {
                picture = picture.with_mark(node, SegmentStyle::new(name.clone(), *colour));
            }
        }
        shown(py, &picture)
    }

    fn __repr__(&self) -> String {
        let names: Vec<_> = self.mesh.facet_group_names().collect();
        format!(
            "<Mesh in {} dimensions: {}, {}, {}>",
            self.mesh.dim(),
            counted(self.mesh.num_nodes(), "node"),
            counted(self.mesh.num_cells(), "cell"),
            match names.is_empty() {
                true => "no groups of facets".to_owned(),
                false => format!("facets: {}", names.join(", ")),
            }
        )
    }
}

/// The rows of an integer array of two dimensions, or lists of different lengths.
fn lists(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<Vec<usize>>> {
    if let Ok(array) = object.extract::<PyArrayLike2<'_, i64, AllowTypeChange>>() {
        let row = |row: numpy::ndarray::ArrayView1<'_, i64>| {
            row.iter().map(|&v| index(v, what)).collect::<PyResult<_>>()
        };
        return array.as_array().rows().into_iter().map(row).collect();
    }
    let rows: Vec<Vec<i64>> = object
        .extract()
        .map_err(|_| PyTypeError::new_err(format!("{what} must be an integer array of two dimensions")))?;
    rows.iter()
        .map(|row| row.iter().map(|&v| index(v, what)).collect())
        .collect()
}

fn index(value: i64, what: &str) -> PyResult<usize> {
    usize::try_from(value).map_err(|_| PyValueError::new_err(format!("negative number {value} in {what}")))
}

/// Indices below `count`: given as such, or as a mask of that length.
fn numbers(object: &Bound<'_, PyAny>, count: usize, what: &str) -> PyResult<Vec<usize>> {
    let Ok(mask) = object.extract::<PyArrayLike1<'_, bool>>() else {
        return indices(object, what);
    };
    if mask.len() != count {
        return Err(PyValueError::new_err(format!(
            "the mask of {what} has length {}, expected {count}",
            mask.len()
        )));
    }
    let mask = mask.as_array();
    Ok((0..count).filter(|&k| mask[k]).collect())
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Mesh>()
}
