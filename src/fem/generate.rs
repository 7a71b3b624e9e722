//! Structured meshes.

use super::{CellKind, FemError, Mesh};
use crate::tolerances::MAX_DIMENSION;

/// Peak memory per node while a mesh is built, in bytes: measured for hexahedra.
const PEAK: usize = 420;

impl Mesh {
    /// A rectangle of `n[0]` × `n[1]` equal quadrilaterals, with the groups of facets "left", "right", "bottom", "top". Nodes are
    /// numbered along x first.
    ///
    /// # Errors
    /// No cells, more than 2³¹ nodes or than memory holds (420 bytes a node at the peak), corners that are not in order.
    pub fn rectangle(lower: [f64; 2], upper: [f64; 2], n: [usize; 2]) -> Result<Self, FemError> {
        check_numbers(&n)?;
        let lines = |d: usize| divide(lower[d], upper[d], n[d]);
        Self::rectangle_graded(&lines(0), &lines(1))
    }

    /// A rectangle with the given increasing grid lines; groups as [`rectangle`](Self::rectangle).
    ///
    /// # Errors
    /// Fewer than two lines, lines that do not increase, as many nodes as [`rectangle`](Self::rectangle) refuses.
    pub fn rectangle_graded(x: &[f64], y: &[f64]) -> Result<Self, FemError> {
        check_lines("x", x)?;
        check_lines("y", y)?;
        check_numbers(&[x.len() - 1, y.len() - 1])?;
        let columns = x.len();
        let mut points = Vec::with_capacity(columns * y.len());
        for &yj in y {
            points.extend(x.iter().map(|&xi| [xi, yj, 0.0]));
        }
        let cells = (0..y.len() - 1).flat_map(|j| {
            (0..columns - 1).map(move |i| {
                let a = j * columns + i;
                (
                    CellKind::Quadrilateral,
                    vec![a, a + 1, a + 1 + columns, a + columns],
                )
            })
        });
        let mut mesh = Self::new(2, points, cells)?;
        mesh.mark_sides();
        Ok(mesh)
    }

    /// A box of `n[0]` × `n[1]` × `n[2]` equal hexahedra, with the groups "left", "right" (x), "front", "back" (y), "bottom", "top" (z).
    ///
    /// # Errors
    /// No cells, more than 2³¹ nodes or than memory holds (420 bytes a node at the peak), corners that are not in order.
    pub fn block(lower: [f64; 3], upper: [f64; 3], n: [usize; 3]) -> Result<Self, FemError> {
        check_numbers(&n)?;
        let lines = |d: usize| divide(lower[d], upper[d], n[d]);
        Self::block_graded(&lines(0), &lines(1), &lines(2))
    }

    /// A box with the given increasing grid planes; groups as [`block`](Self::block).
    ///
    /// # Errors
    /// Fewer than two planes, planes that do not increase, as many nodes as [`block`](Self::block) refuses.
    pub fn block_graded(x: &[f64], y: &[f64], z: &[f64]) -> Result<Self, FemError> {
        check_lines("x", x)?;
        check_lines("y", y)?;
        check_lines("z", z)?;
        check_numbers(&[x.len() - 1, y.len() - 1, z.len() - 1])?;
        let (nx, layer) = (x.len(), x.len() * y.len());
        let mut points = Vec::with_capacity(layer * z.len());
        for &zk in z {
            for &yj in y {
                points.extend(x.iter().map(|&xi| [xi, yj, zk]));
            }
        }
        let mut cells = Vec::with_capacity((nx - 1) * (y.len() - 1) * (z.len() - 1));
        for k in 0..z.len() - 1 {
            for j in 0..y.len() - 1 {
                for i in 0..nx - 1 {
                    let a = k * layer + j * nx + i;
                    let face = [a, a + 1, a + 1 + nx, a + nx];
                    let nodes = face
                        .iter()
                        .copied()
                        .chain(face.iter().map(|n| n + layer))
                        .collect();
                    cells.push((CellKind::Hexahedron, nodes));
                }
            }
        }
        let mut mesh = Self::new(3, points, cells)?;
        mesh.mark_sides();
        Ok(mesh)
    }

    /// The same nodes with every quadrilateral cut into two triangles (along the shorter diagonal, the first on a tie) or every hexahedron
    /// into six tetrahedra around one of its diagonals; groups are kept. Simplices are unchanged.
    ///
    /// # Errors
    /// A hexahedron too distorted to be cut; quadrilaterals and hexahedra of second order, wedges and pyramids ([`FemError::Order`]).
    pub fn simplices(&self) -> Result<Self, FemError> {
        /// Paths from corner 0 to corner 6: conforming on structured grids, as opposite faces are cut the same way.
        const SIX: [[usize; 4]; 6] = [
            [0, 1, 2, 6],
            [0, 2, 3, 6],
            [0, 3, 7, 6],
            [0, 7, 4, 6],
            [0, 4, 5, 6],
            [0, 5, 1, 6],
        ];
        let mut cells = Vec::new();
        let mut children = Vec::with_capacity(self.num_cells());
        for cell in 0..self.num_cells() {
            let n = self.cell(cell);
            let begin = cells.len();
            match self.kind(cell) {
                CellKind::Quadrilateral => {
                    let length = |a: usize, b: usize| {
                        let (p, q) = (self.points()[n[a]], self.points()[n[b]]);
                        (p[0] - q[0]).hypot(p[1] - q[1])
                    };
                    let cut = if length(0, 2) <= length(1, 3) * (1.0 + 1e-12) {
                        [[0, 1, 2], [0, 2, 3]]
                    } else {
                        [[0, 1, 3], [1, 2, 3]]
                    };
                    cells.extend(cut.map(|t| (CellKind::Triangle, t.map(|a| n[a]).to_vec())));
                }
                CellKind::Hexahedron => {
                    cells.extend(SIX.map(|t| (CellKind::Tetrahedron, t.map(|a| n[a]).to_vec())));
                }
                kind if !kind.reference().is_simplex() => {
                    return Err(FemError::Order {
                        cell,
                        kind: kind.name(),
                    });
                }
                kind => cells.push((kind, n.to_vec())),
            }
            children.push(begin..cells.len());
        }
        let mut mesh = Self::new(self.dim(), self.points().to_vec(), cells)?;
        let mut facets = self.groups().0.clone();
        if self.dim() == 3 {
            // The triangles of the new boundary that lie inside a facet of the group.
            let boundary = mesh.boundary();
            for list in facets.values_mut() {
                let mut parts = std::mem::take(list);
                parts.retain_mut(|facet| {
                    if facet.len() == 3 {
                        list.push(facet.clone());
                        return false;
                    }
                    facet.sort_unstable();
                    true
                });
                let quads: std::collections::HashSet<Vec<usize>> = parts.into_iter().collect();
                let mut owner: std::collections::HashMap<usize, Vec<&Vec<usize>>> = Default::default();
                for q in &quads {
                    for &n in q {
                        owner.entry(n).or_default().push(q);
                    }
                }
                for f in &boundary {
                    let inside = owner
                        .get(&f.nodes[0])
                        .is_some_and(|own| own.iter().any(|q| f.nodes.iter().all(|n| q.contains(n))));
                    if inside {
                        list.push(f.nodes.clone());
                    }
                }
            }
        }
        let groups = self.refined_cell_groups(&children);
        mesh.set_groups(facets, groups);
        Ok(mesh.with_node_groups(self.node_groups()))
    }

    fn mark_sides(&mut self) {
        let names: &[[&str; 2]] = if self.dim() == 2 {
            &[["left", "right"], ["bottom", "top"]]
        } else {
            &[["left", "right"], ["front", "back"], ["bottom", "top"]]
        };
        let mut groups = self.groups().0.clone();
        for facet in self.boundary() {
            for (d, pair) in names.iter().enumerate() {
                if facet.normal[d].abs() > 0.5 {
                    let name = pair[usize::from(facet.normal[d] > 0.0)];
                    groups
                        .entry(name.to_string())
                        .or_default()
                        .push(facet.nodes.clone());
                }
            }
        }
        self.set_groups(groups, Default::default());
    }
}

/// Rejects numbers of cells whose nodes do not fit into memory before anything is allocated.
fn check_numbers(n: &[usize]) -> Result<(), FemError> {
    if n.contains(&0) {
        return Err(FemError::Empty {
            what: "a grid needs at least one cell along each axis",
        });
    }
    let nodes = n
        .iter()
        .try_fold(1_usize, |all, n| all.checked_mul(n.checked_add(1)?));
    match nodes {
        Some(nodes) if nodes <= MAX_DIMENSION && fits(nodes) => Ok(()),
        _ => Err(FemError::TooLarge { cells: n.to_vec() }),
    }
}

fn fits(nodes: usize) -> bool {
    let bytes = nodes.checked_mul(PEAK);
    bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok())
}

/// n + 1 equally spaced lines.
fn divide(lower: f64, upper: f64, n: usize) -> Vec<f64> {
    (0..=n)
        .map(|i| {
            if i == n {
                upper
            } else {
                lower + (upper - lower) * i as f64 / n as f64
            }
        })
        .collect()
}

fn check_lines(axis: &'static str, lines: &[f64]) -> Result<(), FemError> {
    if lines.len() < 2 {
        return Err(FemError::Empty {
            what: "a grid needs at least two lines along each axis",
        });
    }
    for (line, &value) in lines.iter().enumerate() {
        if !value.is_finite() || (line > 0 && value <= lines[line - 1]) {
            return Err(FemError::Grading { axis, line, value });
        }
    }
    Ok(())
}
