//! Gmsh's MSH files, versions 2.2 and 4.1, text and binary.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use super::tokens::{Reader, shorten};
use super::{CellKind, FemError, Mesh};
use crate::InputError;
use crate::tolerances::NONE;

/// Reads a Gmsh mesh file (MSH 2.2 or 4.1, ASCII or binary of either byte order) of elements of first or second order.
///
/// The elements of the highest dimension are the cells, those of one dimension less are the facets of groups, points the nodes of groups;
/// physical groups keep their names, or are called "physical N" by their number. Other elements and sections are ignored. Cells may be numbered in
/// either orientation. A plane mesh must lie in a plane z = constant.
///
/// # Errors
/// Files that cannot be read, other versions, elements of higher order (the element is named), more than 2²⁰ + 16 × (number of elements)
/// memberships of elements in physical groups, node numbers that do not exist, truncated files, folded cells.
pub fn read_gmsh(path: impl AsRef<Path>) -> Result<Mesh, FemError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| {
        FemError::Input(InputError::Io {
            path: path.into(),
            source: e.into(),
        })
    })?;
    parse_gmsh(&bytes, path)
}

/// [`read_gmsh`] from the bytes of a file; `path` is for messages.
///
/// ```
/// let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat
/// $PhysicalNames\n1\n1 7 \"foot\"\n$EndPhysicalNames
/// $Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes
/// $Elements\n2\n1 1 2 7 1 1 2\n2 2 2 9 1 1 2 3\n$EndElements\n";
/// let mesh = semismooth::fem::parse_gmsh(text.as_bytes(), "triangle.msh".as_ref())?;
/// assert_eq!((mesh.num_nodes(), mesh.num_cells()), (3, 1));
/// assert_eq!(mesh.facet_group("foot")?, [[0, 1]]);
/// assert_eq!(mesh.cell_group("physical 9")?, [0]);
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
///
/// # Errors
/// Like [`read_gmsh`].
pub fn parse_gmsh(bytes: &[u8], path: &Path) -> Result<Mesh, FemError> {
    let mut reader = Reader {
        bytes,
        at: 0,
        path,
        binary: false,
        swapped: false,
    };
    let mut file = File::default();
    let mut version = None;
    while let Some(section) = reader.next_section() {
        match (section.as_str(), version) {
            ("MeshFormat", _) => version = Some(reader.format()?),
            (_, None) => return Err(reader.fail("the file must begin with $MeshFormat")),
            ("PhysicalNames", _) => reader.names(&mut file)?,
            ("Entities", Some(Version::Four)) => reader.entities(&mut file)?,
            ("Nodes", Some(Version::Two)) => reader.nodes_2(&mut file)?,
            ("Nodes", Some(Version::Four)) => reader.nodes_4(&mut file)?,
            ("Elements", Some(Version::Two)) => reader.elements_2(&mut file)?,
            ("Elements", Some(Version::Four)) => reader.elements_4(&mut file)?,
            _ => {}
        }
        reader.skip_to_end(&section)?;
    }
    file.mesh(&reader)
}

/// Number of memberships of elements in physical groups that any file may have, and the additional number per element.
const MEMBERSHIPS: usize = 1 << 20;
const PER_ELEMENT: usize = 16;

#[derive(Clone, Copy)]
enum Version {
    Two,
    Four,
}

#[derive(Default)]
struct File {
    names: HashMap<(i64, i64), String>,
    /// Physical groups of each entity (dimension, tag).
    physical: HashMap<(i64, i64), Vec<i64>>,
    points: Vec<[f64; 3]>,
    place: HashMap<u64, usize>,
    elements: Vec<Element>,
    /// Memberships of elements in groups.
    memberships: usize,
}

struct Element {
    tag: u64,
    kind: i64,
    groups: Vec<i64>,
    nodes: Vec<usize>,
}

/// Dimension and number of nodes of an element type.
fn shape(kind: i64) -> Option<(i64, usize)> {
    match kind {
        15 => Some((0, 1)),
        1 => Some((1, 2)),
        8 => Some((1, 3)),
        _ => cell_kind(kind).map(|k| (k.dim() as i64, k.num_nodes())),
    }
}

fn cell_kind(kind: i64) -> Option<CellKind> {
    Some(match kind {
        2 => CellKind::Triangle,
        3 => CellKind::Quadrilateral,
        4 => CellKind::Tetrahedron,
        5 => CellKind::Hexahedron,
        6 => CellKind::Wedge,
        7 => CellKind::Pyramid,
        9 => CellKind::Triangle6,
        10 => CellKind::Quadrilateral9,
        11 => CellKind::Tetrahedron10,
        12 => CellKind::Hexahedron27,
        16 => CellKind::Quadrilateral8,
        17 => CellKind::Hexahedron20,
        18 => CellKind::Wedge15,
        19 => CellKind::Pyramid13,
        _ => return None,
    })
}

/// The place in Gmsh's order of each node, where that is not ours: edges of cells in space, faces of hexahedra.
fn order(kind: CellKind) -> Option<&'static [usize]> {
    const HEXAHEDRON: [usize; 27] = [
        0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26,
    ];
    match kind {
        CellKind::Tetrahedron10 => Some(&[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
        CellKind::Hexahedron20 | CellKind::Hexahedron27 => Some(&HEXAHEDRON),
        CellKind::Wedge15 => Some(&[0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]),
        CellKind::Pyramid13 => Some(&[0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12]),
        _ => None,
    }
}

impl File {
    fn add(
        &mut self,
        reader: &Reader,
        tag: u64,
        kind: i64,
        groups: Vec<i64>,
        nodes: &[u64],
    ) -> Result<(), FemError> {
        // In version 4 an element belongs to all groups of its entity, so that a short file may imply very many memberships.
        self.memberships += groups.len();
        if self.memberships > MEMBERSHIPS + PER_ELEMENT * self.elements.len() {
            return Err(reader.fail(format!(
                "element {tag} is in {} physical groups and brings the memberships to {}; {PER_ELEMENT} an element (and {MEMBERSHIPS} more) are supported",
                groups.len(),
                self.memberships
            )));
        }
        let nodes = nodes
            .iter()
            .map(|n| {
                self.place.get(n).copied().ok_or_else(|| {
                    reader.fail(format!("element {tag} refers to node {n}, which does not exist"))
                })
            })
            .collect::<Result<_, _>>()?;
        self.elements.push(Element {
            tag,
            kind,
            groups,
            nodes,
        });
        Ok(())
    }

    fn mesh(self, reader: &Reader) -> Result<Mesh, FemError> {
        let dims = self.elements.iter().filter_map(|e| shape(e.kind)).map(|s| s.0);
        let dim = dims.max().unwrap_or(0);
        if dim < 2 {
            return Err(FemError::Empty {
                what: "the file holds neither surface nor volume elements",
            });
        }
        let (mut cells, mut facets) = (Vec::new(), BTreeMap::<String, Vec<Vec<usize>>>::new());
        let mut cell_groups = BTreeMap::<String, Vec<usize>>::new();
        let mut nodes = BTreeMap::<String, Vec<usize>>::new();
        for element in &self.elements {
            let own = shape(element.kind).map_or(0, |s| s.0);
            let name = |group: &i64| {
                let known = self.names.get(&(own, *group)).cloned();
                known.unwrap_or_else(|| format!("physical {group}"))
            };
            if own == dim {
                for group in &element.groups {
                    cell_groups.entry(name(group)).or_default().push(cells.len());
                }
                // Elements of the dimension of the mesh are cells.
                let Some(kind) = cell_kind(element.kind) else {
                    continue;
                };
                let mut nodes = element.nodes.clone();
                if let Some(order) = order(kind) {
                    nodes
                        .iter_mut()
                        .zip(order)
                        .for_each(|(n, &a)| *n = element.nodes[a]);
                }
                cells.push((kind, nodes));
            } else if own == dim - 1 {
                for group in &element.groups {
                    facets.entry(name(group)).or_default().push(element.nodes.clone());
                }
            } else if own == 0 {
                for group in &element.groups {
                    nodes.entry(name(group)).or_default().extend(&element.nodes);
                }
            }
        }
        let mut points = self.points;
        let new = drop_loose(&mut points, &mut cells);
        if dim == 2 {
            let z = points[0][2];
            let size = points.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
            if let Some(p) = points.iter().find(|p| (p[2] - z).abs() > 1e-12 * size) {
                return Err(reader.fail(format!(
                    "a surface mesh must lie in a plane z = constant, but there are z = {z} and z = {}",
                    p[2]
                )));
            }
        }
        for node in facets.values_mut().flatten().flatten() {
            *node = new[*node];
        }
        let tags: Vec<u64> = self
            .elements
            .iter()
            .filter(|e| shape(e.kind).is_some_and(|s| s.0 == dim))
            .map(|e| e.tag)
            .collect();
        let mut mesh = Mesh::oriented(dim as usize, points, cells).map_err(|e| match e {
            FemError::Jacobian { cell, .. } => reader.fail(format!("element {}: {e}", tags[cell])),
            e => e,
        })?;
        for (name, list) in facets {
            mesh.add_facet_group(name, list)?;
        }
        let facets = mesh.groups().0.clone();
        mesh.set_groups(facets, cell_groups);
        for (name, list) in nodes {
            // Points in no cell are not nodes of the mesh.
            let mut list: Vec<usize> = list
                .into_iter()
                .map(|n| new[n])
                .filter(|n| *n != usize::MAX)
                .collect();
            list.sort_unstable();
            list.dedup();
            mesh.add_node_group(name, list)?;
        }
        Ok(mesh)
    }
}

impl Reader<'_> {
    fn format(&mut self) -> Result<Version, FemError> {
        let version: String = self.token()?.to_owned();
        let binary: i64 = self.number()?;
        let size: i64 = self.number()?;
        let known = match version.as_str() {
            "2.2" | "2" | "2.1" => Version::Two,
            "4.1" => Version::Four,
            _ => {
                return Err(self.fail(format!(
                    "MSH version {} is not supported; save as 2.2 or 4.1 (gmsh -format msh41)",
                    shorten(&version)
                )));
            }
        };
        if size != 8 {
            return Err(self.fail(format!("numbers of {size} bytes are not supported; 8 are")));
        }
        self.line();
        if binary == 1 {
            self.binary = true;
            let one: [u8; 4] = self.raw()?;
            self.swapped = match i32::from_le_bytes(one) {
                1 => false,
                0x0100_0000 => true,
                _ => return Err(self.fail("the mark of the byte order is not 1")),
            };
        }
        Ok(known)
    }

    fn names(&mut self, file: &mut File) -> Result<(), FemError> {
        let count: usize = self.number()?;
        self.line();
        for _ in 0..count {
            let line = self.line();
            let mut words = line.trim().splitn(3, char::is_whitespace);
            let parsed = (|| {
                let dim = words.next()?.parse().ok()?;
                let tag = words.next()?.parse().ok()?;
                let name = words.next()?.trim().strip_prefix('"')?.strip_suffix('"')?;
                Some(((dim, tag), name.to_owned()))
            })();
            let Some((key, name)) = parsed else {
                return Err(self.fail(format!(
                    "\"{}\" is no physical name (dimension, number, \"name\")",
                    shorten(&line)
                )));
            };
            file.names.insert(key, name);
        }
        Ok(())
    }

    fn entities(&mut self, file: &mut File) -> Result<(), FemError> {
        let counts = [self.size()?, self.size()?, self.size()?, self.size()?];
        for (dim, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = self.int()?;
                for _ in 0..if dim == 0 { 3 } else { 6 } {
                    self.double()?;
                }
                let mut physical = (0..self.size()?)
                    .map(|_| self.int())
                    .collect::<Result<Vec<_>, _>>()?;
                physical.sort_unstable();
                physical.dedup();
                file.physical.insert((dim as i64, tag), physical);
                if dim > 0 {
                    for _ in 0..self.size()? {
                        self.int()?;
                    }
                }
            }
        }
        Ok(())
    }

    fn nodes_2(&mut self, file: &mut File) -> Result<(), FemError> {
        let count: u64 = self.number()?;
        self.line();
        for _ in 0..count {
            let tag = self.int()?;
            let point = self.point()?;
            self.node(file, tag as u64, point)?;
        }
        Ok(())
    }

    fn node(&self, file: &mut File, tag: u64, point: [f64; 3]) -> Result<(), FemError> {
        if file.place.insert(tag, file.points.len()).is_some() {
            return Err(self.fail(format!("node {tag} is defined twice")));
        }
        if point.iter().any(|x| !x.is_finite()) {
            return Err(self.fail(format!(
                "node {tag} lies at {point:?}; coordinates must be finite"
            )));
        }
        file.points.push(point);
        Ok(())
    }

    fn nodes_4(&mut self, file: &mut File) -> Result<(), FemError> {
        let blocks = self.size()?;
        for _ in 0..3 {
            self.size()?;
        }
        for _ in 0..blocks {
            let dim = self.int()?;
            self.int()?;
            let parametric = self.int()? != 0;
            let count = self.size()?;
            let tags = (0..count).map(|_| self.size()).collect::<Result<Vec<_>, _>>()?;
            for tag in tags {
                let point = self.point()?;
                for _ in 0..if parametric { dim } else { 0 } {
                    self.double()?;
                }
                self.node(file, tag, point)?;
            }
        }
        Ok(())
    }

    fn supported(&self, tag: u64, kind: i64) -> Result<usize, FemError> {
        match shape(kind) {
            Some((_, nodes)) => Ok(nodes),
            None => Err(self.fail(format!(
                "element {tag} is of Gmsh type {kind}; lines, triangles, quadrilaterals, tetrahedra and hexahedra of first and second order are supported"
            ))),
        }
    }

    fn elements_2(&mut self, file: &mut File) -> Result<(), FemError> {
        let count: u64 = self.number()?;
        self.line();
        let mut done = 0;
        while done < count {
            // In binary files elements of one type share a header; in text each has its own.
            let (mut tag, kind, follow, tags);
            if self.binary {
                (kind, follow, tags) = (self.int()?, self.int()? as u64, self.int()?);
                tag = 0;
            } else {
                tag = self.int()? as u64;
                (kind, follow, tags) = (self.int()?, 1, self.int()?);
            }
            let nodes = self.supported(tag, kind)?;
            for _ in 0..follow {
                if self.binary {
                    tag = self.int()? as u64;
                }
                let labels = (0..tags).map(|_| self.int()).collect::<Result<Vec<_>, _>>()?;
                let list = (0..nodes)
                    .map(|_| self.int().map(|n| n as u64))
                    .collect::<Result<Vec<_>, _>>()?;
                let groups = labels.first().copied().filter(|g| *g != 0).into_iter().collect();
                file.add(self, tag, kind, groups, &list)?;
            }
            done += follow.max(1);
        }
        Ok(())
    }

    fn elements_4(&mut self, file: &mut File) -> Result<(), FemError> {
        let blocks = self.size()?;
        for _ in 0..3 {
            self.size()?;
        }
        for _ in 0..blocks {
            let (dim, entity, kind) = (self.int()?, self.int()?, self.int()?);
            let count = self.size()?;
            let groups = file.physical.get(&(dim, entity)).cloned().unwrap_or_default();
            for _ in 0..count {
                let tag = self.size()?;
                let nodes = self.supported(tag, kind)?;
                let list = (0..nodes).map(|_| self.size()).collect::<Result<Vec<_>, _>>()?;
                file.add(self, tag, kind, groups.clone(), &list)?;
            }
        }
        Ok(())
    }
}

/// Removes points that belong to no cell.
fn drop_loose(points: &mut Vec<[f64; 3]>, cells: &mut [(CellKind, Vec<usize>)]) -> Vec<usize> {
    let mut new = vec![NONE; points.len()];
    for &n in cells.iter().flat_map(|c| &c.1) {
        if let Some(slot) = new.get_mut(n) {
            *slot = 0;
        }
    }
    let mut kept = Vec::with_capacity(points.len());
    for (old, point) in points.iter().enumerate() {
        if new[old] == 0 {
            new[old] = kept.len();
            kept.push(*point);
        }
    }
    for n in cells.iter_mut().flat_map(|c| &mut c.1) {
        if let Some(&m) = new.get(*n) {
            *n = m;
        }
    }
    *points = kept;
    new
}
