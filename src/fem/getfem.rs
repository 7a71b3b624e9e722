//! The text format of GetFEM's meshes.

use std::path::Path;

use super::tokens::shorten;
use super::{CellKind, FemError, Mesh};

/// Reads a GetFEM mesh file (`GETFEM MESH FILE`): linear triangles, quadrilaterals, tetrahedra, hexahedra. Regions are not read: use
/// [`Mesh::mark_boundary`] to name parts of the boundary. Points that belong to no cell are dropped.
///
/// # Errors
/// Files that cannot be read, malformed lines (with their number), other kinds of convexes, invalid cells.
pub fn read_getfem(path: impl AsRef<Path>) -> Result<Mesh, FemError> {
    let path = path.as_ref();
    let text = std::fs::read_to_string(path).map_err(|e| FemError::Io {
        path: path.into(),
        source: e.into(),
    })?;
    parse_getfem(&text, path)
}

/// [`read_getfem`] from text; `path` is for messages.
///
/// ```
/// let text = "BEGIN POINTS LIST
///   POINT 0 0 0
///   POINT 1 1 0
///   POINT 2 0 1
/// END POINTS LIST
/// BEGIN MESH STRUCTURE DESCRIPTION
/// CONVEX 0 'GT_PK(2,1)' 0 1 2
/// END MESH STRUCTURE DESCRIPTION";
/// let mesh = semismooth::fem::parse_getfem(text, "triangle.mesh".as_ref())?;
/// assert_eq!((mesh.num_nodes(), mesh.num_cells()), (3, 1));
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
///
/// # Errors
/// Like [`read_getfem`].
pub fn parse_getfem(text: &str, path: &Path) -> Result<Mesh, FemError> {
    let mut ids = std::collections::HashMap::new();
    let (mut points, mut cells, mut dim) = (Vec::new(), Vec::new(), None);
    for (number, line) in text.lines().enumerate() {
        let fail = |what: String| FemError::Parse {
            path: path.into(),
            line: number + 1,
            what,
        };
        let line = line.split('%').next().unwrap_or("");
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["POINT", "COUNT", ..] => {}
            ["POINT", id, coordinates @ ..] => {
                if coordinates.is_empty() || coordinates.len() > 3 {
                    return Err(fail(format!("a point with {} coordinates", coordinates.len())));
                }
                let mut point = [0.0; 3];
                for (x, word) in point.iter_mut().zip(coordinates) {
                    *x = word
                        .parse()
                        .map_err(|_| fail(format!("\"{}\" is not a coordinate", shorten(word))))?;
                }
                if ids.insert(id.to_string(), points.len()).is_some() {
                    return Err(fail(format!("point {id} is defined twice")));
                }
                points.push(point);
            }
            ["CONVEX", _, rest @ ..] => {
                // The name of the transformation may contain blanks.
                let text = rest.join(" ");
                let mut quoted = text.split('\'');
                let (Some(""), Some(name), Some(nodes)) = (quoted.next(), quoted.next(), quoted.next())
                else {
                    return Err(fail(
                        "a convex needs its transformation in quotes, then its points".into(),
                    ));
                };
                let name: String = name.chars().filter(|c| !c.is_whitespace()).collect();
                let (kind, order): (CellKind, &[usize]) = match name.trim_start_matches("GT_LINEAR_") {
                    "GT_PK(2,1)" => (CellKind::Triangle, &[0, 1, 2]),
                    "GT_QK(2,1)"
                    | "QK(2,1)"
                    | "GT_PRODUCT(GT_PK(1,1),GT_PK(1,1))"
                    | "PRODUCT(GT_PK(1,1),GT_PK(1,1))" => (CellKind::Quadrilateral, &[0, 1, 3, 2]),
                    "GT_PK(3,1)" => (CellKind::Tetrahedron, &[0, 1, 2, 3]),
                    "GT_QK(3,1)" | "QK(3,1)" => (CellKind::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6]),
                    _ => {
                        return Err(fail(format!(
                            "convexes '{}' are not supported; linear triangles, quadrilaterals, tetrahedra and hexahedra are",
                            shorten(&name)
                        )));
                    }
                };
                if *dim.get_or_insert(kind.dim()) != kind.dim() {
                    return Err(fail("plane and solid convexes in one mesh".into()));
                }
                let nodes = nodes
                    .split_whitespace()
                    .map(|word| {
                        ids.get(word)
                            .copied()
                            .ok_or_else(|| fail(format!("there is no point \"{}\"", shorten(word))))
                    })
                    .collect::<Result<Vec<usize>, _>>()?;
                if nodes.len() != kind.num_nodes() {
                    return Err(fail(format!(
                        "a {} with {} points, expected {}",
                        kind.name(),
                        nodes.len(),
                        kind.num_nodes()
                    )));
                }
                cells.push((kind, order.iter().map(|&a| nodes[a]).collect::<Vec<_>>()));
            }
            _ => {}
        }
    }
    let Some(dim) = dim else {
        return Err(FemError::Empty {
            what: "the file describes no convexes",
        });
    };
    drop_loose(&mut points, &mut cells);
    Mesh::oriented(dim, points, cells)
}

/// Removes points that belong to no cell.
pub(super) fn drop_loose(points: &mut Vec<[f64; 3]>, cells: &mut [(CellKind, Vec<usize>)]) -> Vec<usize> {
    let mut new = vec![usize::MAX; points.len()];
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
