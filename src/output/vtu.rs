//! Fields on meshes as VTU files, and series of them in time as PVD files, for ParaView.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

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
    /// A field of `components` numbers per node or cell, in their order. Displacements of plane meshes (two components) are drawn as
    /// vectors in space.
    pub fn new(name: impl Into<String>, components: usize, values: Vec<f64>) -> Self {
        Self {
            name: name.into(),
            components,
            values,
        }
    }

    fn check(&self, expected: usize) -> Result<(), OutputError> {
        let wanted = self.components.max(1).saturating_mul(expected);
        if self.components == 0 || self.values.len() != wanted {
            return Err(OutputError::Field {
                name: self.name.clone(),
                expected: wanted,
                found: self.values.len(),
            });
        }
        Ok(())
    }

    /// Numbers per node or cell in the file.
    fn width(&self) -> usize {
        match self.components {
            2 => 3,
            n => n,
        }
    }

    /// The numbers as written to the file; plane vectors have a third component 0.
    fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let padding = self.width() - self.components;
        let parts = self.values.chunks_exact(self.components);
        parts.flat_map(move |part| part.iter().copied().chain(std::iter::repeat_n(0.0, padding)))
    }
}

/// Writes a mesh with its fields in one format.
type Grid = fn(&mut dyn Write, &Mesh, &[Field], &[Field]) -> io::Result<()>;

/// Writes a mesh with fields at its nodes and in its cells: VTU (XML, numbers in base64) if the path ends in `.vtu`, legacy VTK (text) if
/// in `.vtk`. Any f64 is written, NaN included.
///
/// # Errors
/// Fields of the wrong length, paths that cannot be written or have another extension.
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
    at_nodes.iter().try_for_each(|f| f.check(mesh.num_nodes()))?;
    in_cells.iter().try_for_each(|f| f.check(mesh.num_cells()))?;
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let grid = match ending {
        "vtu" => xml_grid as Grid,
        "vtk" => legacy_grid,
        _ => {
            return Err(bad_name(
                path,
                "the name of a file with fields ends in .vtu or .vtk",
            ));
        }
    };
    write_file(path, |out| grid(out, mesh, at_nodes, in_cells))
}

/// Writes a series in time of files written by [`write_vtu`]: ParaView opens the `.pvd` file as an animation. `files` are pairs of time (or
/// load parameter; increasing) and path; relative paths are relative to the folder of the series.
///
/// # Errors
/// Times that are NaN or infinite, names of files that are not UTF-8, paths that cannot be written.
///
/// ```no_run
/// use semismooth::{fem::Mesh, output::{write_pvd, write_vtu}};
/// let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 2])?;
/// let mut series = Vec::new();
/// for step in 0..3 {
///     let name = format!("step_{step}.vtu");
///     write_vtu(&name, &mesh, &[], &[])?;
///     series.push((f64::from(step), name));
/// }
/// write_pvd("history.pvd", &series)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_pvd<P: AsRef<Path>>(path: impl AsRef<Path>, files: &[(f64, P)]) -> Result<(), OutputError> {
    let mut entries = Vec::with_capacity(files.len());
    for (index, (time, file)) in files.iter().enumerate() {
        if !time.is_finite() {
            return Err(OutputError::Time { index, time: *time });
        }
        let Some(name) = file.as_ref().to_str() else {
            return Err(bad_name(
                file.as_ref(),
                "names of files in a series must be UTF-8",
            ));
        };
        entries.push((*time, escaped(name)));
    }
    write_file(path.as_ref(), |out| {
        begin_file(out, "Collection")?;
        writeln!(out, "  <Collection>")?;
        for (time, file) in &entries {
            writeln!(
                out,
                "    <DataSet timestep=\"{time}\" group=\"\" part=\"0\" file=\"{file}\"/>"
            )?;
        }
        writeln!(out, "  </Collection>\n</VTKFile>")
    })
}

fn bad_name(path: &Path, what: &str) -> OutputError {
    OutputError::Io {
        path: Some(path.into()),
        source: io::Error::new(io::ErrorKind::InvalidInput, what).into(),
    }
}

fn write_file(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    let whole = |part: &Path| {
        let mut out = BufWriter::new(File::create(part)?);
        write(&mut out)?;
        out.flush()
    };
    replace_file(path, whole).map_err(|e| OutputError::Io {
        path: Some(path.into()),
        source: e.into(),
    })
}

fn begin_file(out: &mut dyn Write, kind: &str) -> io::Result<()> {
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )
}

/// Text as the value of an attribute. XML has no characters below a space except tab and line ends.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => out.push_str(&format!("&#{};", u32::from(c))),
            c if c < ' ' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// The cell type number of VTK.
fn number_of(kind: CellKind) -> u8 {
    match kind {
        CellKind::Triangle => 5,
        CellKind::Quadrilateral => 9,
        CellKind::Tetrahedron => 10,
        CellKind::Hexahedron => 12,
        CellKind::Wedge => 13,
        CellKind::Pyramid => 14,
        CellKind::Triangle6 => 22,
        CellKind::Quadrilateral8 => 23,
        CellKind::Tetrahedron10 => 24,
        CellKind::Hexahedron20 => 25,
        CellKind::Wedge15 => 26,
        CellKind::Pyramid13 => 27,
        CellKind::Quadrilateral9 => 28,
        CellKind::Hexahedron27 => 29,
    }
}

fn ends_of_cells(mesh: &Mesh) -> impl Iterator<Item = usize> + '_ {
    (0..mesh.num_cells()).scan(0, |end, cell| {
        *end += mesh.cell(cell).len();
        Some(*end)
    })
}

fn xml_grid(out: &mut dyn Write, mesh: &Mesh, at_nodes: &[Field], in_cells: &[Field]) -> io::Result<()> {
    let cells = 0..mesh.num_cells();
    begin_file(out, "UnstructuredGrid")?;
    writeln!(
        out,
        "  <UnstructuredGrid>\n    <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">",
        mesh.num_nodes(),
        mesh.num_cells()
    )?;
    for (section, fields) in [("PointData", at_nodes), ("CellData", in_cells)] {
        writeln!(out, "      <{section}>")?;
        for field in fields {
            doubles(out, &field.name, field.width(), field.numbers())?;
        }
        writeln!(out, "      </{section}>")?;
    }
    writeln!(out, "      <Points>")?;
    doubles(out, "Points", 3, mesh.points().iter().flatten().copied())?;
    writeln!(out, "      </Points>\n      <Cells>")?;
    let nodes = cells.clone().flat_map(|cell| mesh.cell(cell).iter().copied());
    integers(out, "connectivity", nodes)?;
    integers(out, "offsets", ends_of_cells(mesh))?;
    let kinds = cells.map(|cell| number_of(mesh.kind(cell))).collect();
    array(out, "UInt8", "types", 1, kinds)?;
    writeln!(
        out,
        "      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n</VTKFile>"
    )
}

fn doubles(
    out: &mut dyn Write,
    name: &str,
    width: usize,
    values: impl Iterator<Item = f64>,
) -> io::Result<()> {
    let bytes = values.flat_map(f64::to_le_bytes).collect();
    array(out, "Float64", name, width, bytes)
}

fn integers(out: &mut dyn Write, name: &str, values: impl Iterator<Item = usize>) -> io::Result<()> {
    let bytes = values.flat_map(|v| (v as i64).to_le_bytes()).collect();
    array(out, "Int64", name, 1, bytes)
}

/// An array as base64 of the number of its bytes (eight bytes) and the bytes.
fn array(out: &mut dyn Write, kind: &str, name: &str, width: usize, bytes: Vec<u8>) -> io::Result<()> {
    let name = escaped(name);
    writeln!(
        out,
        "        <DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{width}\" format=\"binary\">"
    )?;
    let length = (bytes.len() as u64).to_le_bytes();
    base64(out, length.into_iter().chain(bytes))?;
    writeln!(out, "\n        </DataArray>")
}

/// RFC 4648, section 4.
fn base64(out: &mut dyn Write, bytes: impl IntoIterator<Item = u8>) -> io::Result<()> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digit = |word: u32, place: u32| DIGITS[(word >> (6 * place) & 63) as usize];
    let mut bytes = bytes.into_iter();
    while let Some(first) = bytes.next() {
        let (second, third) = (bytes.next(), bytes.next());
        let word = u32::from_be_bytes([0, first, second.unwrap_or(0), third.unwrap_or(0)]);
        out.write_all(&[
            digit(word, 3),
            digit(word, 2),
            if second.is_some() { digit(word, 1) } else { b'=' },
            if third.is_some() { digit(word, 0) } else { b'=' },
        ])?;
    }
    Ok(())
}

fn legacy_grid(out: &mut dyn Write, mesh: &Mesh, at_nodes: &[Field], in_cells: &[Field]) -> io::Result<()> {
    let cells = 0..mesh.num_cells();
    let total: usize = cells.clone().map(|cell| 1 + mesh.cell(cell).len()).sum();
    writeln!(
        out,
        "# vtk DataFile Version 3.0\nsemismooth\nASCII\nDATASET UNSTRUCTURED_GRID"
    )?;
    writeln!(out, "POINTS {} double", mesh.num_nodes())?;
    for [x, y, z] in mesh.points() {
        writeln!(out, "{x:?} {y:?} {z:?}")?;
    }
    writeln!(out, "CELLS {} {total}", mesh.num_cells())?;
    for cell in cells.clone() {
        write!(out, "{}", mesh.cell(cell).len())?;
        for node in mesh.cell(cell) {
            write!(out, " {node}")?;
        }
        writeln!(out)?;
    }
    writeln!(out, "CELL_TYPES {}", mesh.num_cells())?;
    for cell in cells {
        writeln!(out, "{}", number_of(mesh.kind(cell)))?;
    }
    for (section, count, fields) in [
        ("POINT_DATA", mesh.num_nodes(), at_nodes),
        ("CELL_DATA", mesh.num_cells(), in_cells),
    ] {
        if fields.is_empty() {
            continue;
        }
        writeln!(out, "{section} {count}\nFIELD FieldData {}", fields.len())?;
        for field in fields {
            // In this format names end at the first space.
            let name: String = field
                .name
                .chars()
                .map(|c| if c.is_whitespace() { '_' } else { c })
                .collect();
            writeln!(out, "{name} {} {count} double", field.width())?;
            for value in field.numbers() {
                writeln!(out, "{value:?}")?;
            }
        }
    }
    Ok(())
}
