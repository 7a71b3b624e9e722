//! Output of fields on parts, one file per process and one that combines them.

use std::fmt::Write;
use std::io;
use std::path::Path;

use semismooth::fem::Mesh;
use semismooth::output::{Field, OutputError, write_vtu};

use crate::Part;
use crate::body::Boxed;
use crate::ffi::Int;
use crate::part::PartError;
use crate::world::{Error, World};

const PVTU: &str = "the name of a file with fields of parts is UTF-8 and ends in .pvtu";

/// Values at the nodes of a [`Part`], for [`Part::write`].
///
/// ```
/// use semismooth_petsc::PartField;
/// let heights = PartField::new("height", 1, &[0.0, 0.5, 1.0]);
/// assert_eq!(heights.name, "height");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PartField<'a> {
    /// Its name, the same on all processes.
    pub name: &'a str,
    /// Number of components per node, the same on all processes.
    pub components: usize,
    /// The values node by node, as the mesh of the part numbers them.
    pub values: &'a [f64],
}

impl<'a> PartField<'a> {
    /// A field with `components` values per node.
    #[must_use]
    pub const fn new(name: &'a str, components: usize, values: &'a [f64]) -> Self {
        Self {
            name,
            components,
            values,
        }
    }
}

impl Part {
    /// Writes fields at nodes: each process R writes `NAME.R.vtu` with its share of the cells, process 0 writes `NAME.pvtu`, which ParaView
    /// opens as one mesh. Values at nodes of other processes are fetched: only those at own nodes are used. Collective.
    ///
    /// ```no_run
    /// use semismooth_petsc::{Part, PartField, run};
    /// fn main() -> std::process::ExitCode {
    ///     run([], |world| {
    ///         let part = Part::rectangle(world, [0.0; 2], [2.0, 1.0], [64, 32])?;
    ///         let x: Vec<f64> = part.mesh().points().iter().map(|p| p[0]).collect();
    ///         part.write(world, "x.pvtu", &[PartField::new("x", 1, &x)])
    ///     })
    /// }
    /// ```
    ///
    /// # Errors
    /// Names that do not end in `.pvtu` or are not UTF-8, fields of the wrong length, files that cannot be written.
    pub fn write(
        &self,
        world: &World,
        path: impl AsRef<Path>,
        fields: &[PartField<'_>],
    ) -> Result<(), Error> {
        let path = path.as_ref();
        let name = world.agree(self.check(path, fields))?;
        let (nodes, mesh) = world.agree(self.own_cells())?;
        let mut out = Vec::new();
        for field in fields {
            let values = world.agree(self.complete(world, field))?;
            let width = field.components;
            let here = nodes.iter().flat_map(|n| &values[width * n..width * (n + 1)]);
            out.push(Field::new(field.name, width, here.copied().collect()));
        }
        let written = match &mesh {
            Some(mesh) => write_vtu(path.with_file_name(piece(name, world.rank())), mesh, &out, &[]),
            None => Ok(()),
        };
        world.agree(written)?;
        let mut has = vec![0.0; world.size()];
        has[world.rank()] = f64::from(u8::from(mesh.is_some()));
        world.agree(world.add(&mut has))?;
        // All pieces must be complete before the file that names them is written.
        let index = match world.rank() {
            0 => std::fs::write(path, index(name, &has, fields)).map_err(|e| OutputError::Io {
                path: Some(path.into()),
                source: e.into(),
            }),
            _ => Ok(()),
        };
        world.agree(index)
    }

    /// The name without its ending.
    fn check<'p>(&self, path: &'p Path, fields: &[PartField<'_>]) -> Result<&'p str, PartError> {
        let name = path.file_stem().and_then(|s| s.to_str());
        let Some(name) = name.filter(|_| path.extension().is_some_and(|e| e == "pvtu")) else {
            return Err(PartError::Output(OutputError::Io {
                path: Some(path.into()),
                source: io::Error::new(io::ErrorKind::InvalidInput, PVTU).into(),
            }));
        };
        for field in fields {
            let expected = field.components.max(1) * self.mesh().num_nodes();
            if field.components == 0 || field.values.len() != expected {
                return Err(PartError::Output(OutputError::Field {
                    name: field.name.into(),
                    expected,
                    found: field.values.len(),
                }));
            }
        }
        Ok(name)
    }

    /// The nodes and the mesh of the cells whose smallest node number belongs to this process: each cell belongs to exactly one process.
    fn own_cells(&self) -> Result<(Vec<usize>, Option<Mesh>), Boxed> {
        let mesh = self.mesh();
        let own = self.first() as Int..(self.first() + self.own().len()) as Int;
        let is_own = |c: &usize| {
            let smallest = mesh.cell(*c).iter().map(|n| self.global()[*n]).min();
            smallest.is_some_and(|n| own.contains(&n))
        };
        let cells: Vec<usize> = (0..mesh.num_cells()).filter(is_own).collect();
        if cells.is_empty() {
            return Ok((Vec::new(), None));
        }
        let mut nodes: Vec<usize> = cells.iter().flat_map(|c| mesh.cell(*c).iter().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let points = nodes.iter().map(|n| mesh.points()[*n]).collect();
        let place = |n: &usize| nodes.binary_search(n).unwrap_or(0);
        let list = cells
            .iter()
            .map(|c| (mesh.kind(*c), mesh.cell(*c).iter().map(place).collect()));
        let mesh = Mesh::new(mesh.dim(), points, list)?;
        Ok((nodes, Some(mesh)))
    }

    /// The values of a field, with those of the owners at nodes of other processes.
    fn complete(&self, world: &World, field: &PartField<'_>) -> Result<Vec<f64>, Boxed> {
        let width = field.components;
        let at = |n: usize| &field.values[width * n..width * (n + 1)];
        let own: Vec<f64> = self.own().iter().flat_map(|n| at(*n)).copied().collect();
        let others: Vec<usize> = self.others().collect();
        let asked: Vec<Int> = others.iter().map(|n| self.global()[*n]).collect();
        let fetched = world.fetch(width, &own, &asked)?;
        let mut values = field.values.to_vec();
        for (n, told) in others.iter().zip(fetched.chunks_exact(width)) {
            values[width * n..width * (n + 1)].copy_from_slice(told);
        }
        Ok(values)
    }
}

fn piece(name: &str, rank: usize) -> String {
    format!("{name}.{rank}.vtu")
}

/// Text of the file that names the pieces.
fn index(name: &str, has: &[f64], fields: &[PartField<'_>]) -> String {
    let mut out = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n  <PUnstructuredGrid GhostLevel=\"0\">\n    <PPointData>\n",
    );
    for field in fields {
        // Vectors of the plane have a third component 0 in the pieces.
        let width = if field.components == 2 {
            3
        } else {
            field.components
        };
        let _ = writeln!(
            out,
            "      <PDataArray type=\"Float64\" Name=\"{}\" NumberOfComponents=\"{width}\"/>",
            escaped(field.name)
        );
    }
    out += "    </PPointData>\n    <PPoints>\n      <PDataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"/>\n    \
            </PPoints>\n";
    for rank in (0..has.len()).filter(|r| has[*r] > 0.0) {
        let _ = writeln!(out, "    <Piece Source=\"{}\"/>", escaped(&piece(name, rank)));
    }
    out + "  </PUnstructuredGrid>\n</VTKFile>\n"
}

fn escaped(text: &str) -> String {
    let pairs = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;")];
    pairs
        .iter()
        .fold(text.into(), |t: String, (c, e)| t.replace(c, e))
}
