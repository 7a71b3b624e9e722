//! Cells of second order: raised from those of first order, their middles, and whether neighbours fit together.

use std::collections::HashMap;

use super::vectors::{key, mean};
use super::{CellKind, FemError, Mesh};

/// The node in the middle of an edge or a face, by its corners in increasing order.
pub(super) type Middles = HashMap<[usize; 4], usize>;

/// The nodes of a facet with the given corners: the middles of its edges from each corner to the next, and that of the face.
pub(super) fn completed(dim: usize, corners: &[usize], middles: &Middles) -> Vec<usize> {
    let k = corners.len();
    let edges =
        (0..if dim == 2 { 1 } else { k }).map(|a| key([corners[a], corners[(a + 1) % k]].into_iter()));
    let face = (k == 4).then(|| key(corners.iter().copied()));
    let between = edges.chain(face).filter_map(|key| middles.get(&key).copied());
    corners.iter().copied().chain(between).collect()
}

impl Mesh {
    /// The middle nodes of the edges and faces of second order.
    pub(super) fn middles(&self) -> Middles {
        let mut middles = HashMap::new();
        for cell in (0..self.num_cells()).filter(|&c| self.kind(c).order() == 2) {
            let (nodes, kind) = (self.cell(cell), self.kind(cell));
            for a in kind.num_corners()..nodes.len() {
                let around: Vec<_> = kind.reference().around(a).map(|k| nodes[k]).collect();
                if around.len() <= 4 {
                    middles.insert(key(around.into_iter()), nodes[a]);
                }
            }
        }
        middles
    }

    /// Refuses cells of second order.
    pub(super) fn check_first_order(&self) -> Result<(), FemError> {
        match (0..self.num_cells()).find(|&c| self.kind(c).order() == 2) {
            Some(cell) => Err(FemError::Order {
                cell,
                kind: self.kind(cell).name(),
            }),
            None => Ok(()),
        }
    }

    /// Checks that neighbours share all nodes of the facets between them, which a cell of first order beside one of second order does not.
    pub(super) fn check_neighbours(&self) -> Result<(), FemError> {
        if (0..self.num_cells()).all(|c| self.kind(c).order() == 1) {
            return Ok(());
        }
        let mut known: HashMap<[usize; 4], (usize, Vec<usize>)> = HashMap::new();
        for cell in 0..self.num_cells() {
            for local in self.kind(cell).facets() {
                let mut nodes: Vec<_> = local.iter().map(|&a| self.cell(cell)[a]).collect();
                nodes.sort_unstable();
                let (neighbour, theirs) = known
                    .entry(self.facet_key(cell, local))
                    .or_insert_with(|| (cell, nodes.clone()));
                if *theirs != nodes {
                    return Err(FemError::Neighbours {
                        cells: [*neighbour, cell],
                        at: mean(nodes.iter().map(|&n| self.points()[n])),
                    });
                }
            }
        }
        Ok(())
    }

    /// The same mesh with cells of second order: with the middles of edges, of the faces of quadrilaterals and hexahedra and of these cells
    /// as further nodes, at the end ([`Triangle6`](CellKind::Triangle6), [`Quadrilateral9`](CellKind::Quadrilateral9),
    /// [`Tetrahedron10`](CellKind::Tetrahedron10), [`Hexahedron27`](CellKind::Hexahedron27)). Cells of second order stay as they are,
    /// groups are kept. Wedges and pyramids receive the middles of their edges alone ([`Wedge15`](CellKind::Wedge15),
    /// [`Pyramid13`](CellKind::Pyramid13)): beside hexahedra take [`serendipity`](Self::serendipity).
    ///
    /// # Errors
    /// Hexahedra that are folded between their corners; neighbours that do not fit together.
    ///
    /// ```
    /// use semismooth::fem::{CellKind, Mesh};
    /// let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2])?.simplices()?.second_order()?;
    /// assert_eq!((mesh.num_nodes(), mesh.kind(0)), (9 * 5, CellKind::Triangle6));
    /// assert_eq!(mesh.facet_group("bottom")?[0].len(), 3);
    /// let mesh = Mesh::block([0.0; 3], [1.0; 3], [2, 2, 2])?;
    /// assert_eq!(mesh.second_order()?.num_nodes(), 125);
    /// assert_eq!(mesh.serendipity()?.num_nodes(), 81);
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    pub fn second_order(&self) -> Result<Self, FemError> {
        self.raised(|kind| match kind {
            CellKind::Triangle => CellKind::Triangle6,
            CellKind::Quadrilateral => CellKind::Quadrilateral9,
            CellKind::Tetrahedron => CellKind::Tetrahedron10,
            CellKind::Hexahedron => CellKind::Hexahedron27,
            CellKind::Wedge => CellKind::Wedge15,
            CellKind::Pyramid => CellKind::Pyramid13,
            kind => kind,
        })
    }

    /// As [`second_order`](Self::second_order), but quadrilaterals and hexahedra receive the middles of their edges alone
    /// ([`Quadrilateral8`](CellKind::Quadrilateral8), [`Hexahedron20`](CellKind::Hexahedron20)): fewer unknowns, and less accurate where
    /// cells are no parallelograms.
    ///
    /// # Errors
    /// As [`second_order`](Self::second_order).
    pub fn serendipity(&self) -> Result<Self, FemError> {
        self.raised(|kind| match kind {
            CellKind::Triangle => CellKind::Triangle6,
            CellKind::Quadrilateral => CellKind::Quadrilateral8,
            CellKind::Tetrahedron => CellKind::Tetrahedron10,
            CellKind::Hexahedron => CellKind::Hexahedron20,
            CellKind::Wedge => CellKind::Wedge15,
            CellKind::Pyramid => CellKind::Pyramid13,
            kind => kind,
        })
    }

    fn raised(&self, to: impl Fn(CellKind) -> CellKind) -> Result<Self, FemError> {
        let mut points = self.points().to_vec();
        // By all corners around, up to eight.
        let mut middles: HashMap<Vec<usize>, usize> = HashMap::new();
        let mut cells = Vec::with_capacity(self.num_cells());
        for cell in 0..self.num_cells() {
            let (old, kind) = (self.kind(cell), to(self.kind(cell)));
            let mut nodes = self.cell(cell).to_vec();
            for a in old.num_nodes()..kind.num_nodes() {
                let mut around: Vec<_> = kind.reference().around(a).map(|k| nodes[k]).collect();
                around.sort_unstable();
                let middle = mean(around.iter().map(|&n| self.points()[n]));
                nodes.push(*middles.entry(around).or_insert_with(|| {
                    points.push(middle);
                    points.len() - 1
                }));
            }
            cells.push((kind, nodes));
        }
        let mut mesh = Self::new(self.dim(), points, cells)?;
        let (facets, groups) = self.groups();
        for (name, list) in facets {
            mesh.add_facet_group(name.clone(), list.clone())?;
        }
        let facets = mesh.groups().0.clone();
        mesh.set_groups(facets, groups.clone());
        let mesh = mesh.with_node_groups(self.node_groups());
        Ok(if self.is_part() { mesh.into_part() } else { mesh })
    }
}
