use std::path::Path;

use vtkio::IOBuffer;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray, DataSet, ElementType,
    UnstructuredGridPiece, Version, VertexNumbers, Vtk,
};

use super::OutputError;
use crate::fem::{CellKind, Mesh};
use crate::sparse::replace_file;

/// Values at the nodes or in the cells of a mesh, for [`write_vtu`].
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    name: String,
    components: usize,
    values: Vec<f64>,
}

impl Field {
    /// A field of `components` numbers a node or cell, in their order. Displacements of plane meshes (two components) are drawn as vectors
    /// in space.
    pub fn new(name: impl Into<String>, components: usize, values: Vec<f64>) -> Self {
        Self {
            name: name.into(),
            components,
            values,
        }
    }

    fn array(&self, expected: usize) -> Result<Attribute, OutputError> {
        let wanted = self.components.max(1).saturating_mul(expected);
        if self.components == 0 || self.values.len() != wanted {
            return Err(OutputError::Field {
                name: self.name.clone(),
                expected: wanted,
                found: self.values.len(),
            });
        }
        let (elem, values) = match self.components {
            1 => (
                ElementType::Scalars {
                    num_comp: 1,
                    lookup_table: None,
                },
                self.values.clone(),
            ),
            2 => (
                ElementType::Vectors,
                self.values
                    .chunks_exact(2)
                    .flat_map(|v| [v[0], v[1], 0.0])
                    .collect(),
            ),
            3 => (ElementType::Vectors, self.values.clone()),
            n => (ElementType::Generic(n as u32), self.values.clone()),
        };
        Ok(Attribute::DataArray(DataArray {
            name: self.name.clone(),
            elem,
            data: IOBuffer::F64(values),
        }))
    }
}

/// Writes a mesh with fields at its nodes and in its cells: VTU (XML) if the path ends in `.vtu`, legacy VTK if in `.vtk`.
///
/// # Errors
/// Fields of the wrong length, paths that cannot be written or have another ending.
///
/// ```no_run
/// use semismooth::{fem::Mesh, output::{Field, write_vtu}};
/// let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 2])?;
/// let height = Field::new("height", 1, mesh.points().iter().map(|p| p[1]).collect());
/// write_vtu("square.vtu", &mesh, &[height], &[])?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_vtu(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    at_nodes: &[Field],
    in_cells: &[Field],
) -> Result<(), OutputError> {
    let path = path.as_ref();
    let mut connectivity = Vec::new();
    let (mut offsets, mut types) = (Vec::new(), Vec::new());
    for cell in 0..mesh.num_cells() {
        connectivity.extend(mesh.cell(cell).iter().map(|&n| n as u64));
        offsets.push(connectivity.len() as u64);
        types.push(match mesh.kind(cell) {
            CellKind::Triangle => CellType::Triangle,
            CellKind::Quadrilateral => CellType::Quad,
            CellKind::Tetrahedron => CellType::Tetra,
            CellKind::Hexahedron => CellType::Hexahedron,
        });
    }
    let arrays = |fields: &[Field], expected: usize| {
        fields
            .iter()
            .map(|f| f.array(expected))
            .collect::<Result<Vec<_>, _>>()
    };
    let piece = UnstructuredGridPiece {
        points: IOBuffer::F64(mesh.points().iter().flatten().copied().collect()),
        cells: Cells {
            cell_verts: VertexNumbers::XML {
                connectivity,
                offsets,
            },
            types,
        },
        data: Attributes {
            point: arrays(at_nodes, mesh.num_nodes())?,
            cell: arrays(in_cells, mesh.num_cells())?,
        },
    };
    let file = Vtk {
        version: Version::new((1, 0)),
        title: "semismooth".into(),
        byte_order: ByteOrder::LittleEndian,
        file_path: None,
        data: DataSet::inline(piece),
    };
    let write = |part: &Path| file.export(part).map_err(std::io::Error::other);
    replace_file(path, write).map_err(|e| OutputError::Io {
        path: Some(path.into()),
        what: e.to_string(),
    })
}
