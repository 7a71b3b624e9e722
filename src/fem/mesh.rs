use std::collections::{BTreeMap, HashMap};

use super::FemError;
use super::element::{CellKind, Reference};
use super::order::completed;
use super::place::area_in_space;
use super::tokens::shorten;
use super::vectors::{cross, difference, key, mean, norm};
use crate::words::LISTED;

/// Facets by name of their group, each as its nodes.
pub(super) type FacetGroups = BTreeMap<String, Vec<Vec<usize>>>;
/// Cells by name of their group.
pub(super) type CellGroups = BTreeMap<String, Vec<usize>>;
/// Nodes by name of their group.
pub(super) type NodeGroups = BTreeMap<String, Vec<usize>>;

/// A conforming mesh in the plane or in space, with named groups of cells (materials), of facets (edges or faces of the boundary) and of
/// nodes.
///
/// ```
/// use semismooth::fem::Mesh;
/// let mut mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2])?;
/// assert_eq!((mesh.num_nodes(), mesh.num_cells()), (15, 8));
/// mesh.mark_boundary("sloping", |facet| facet.normal[0] > 0.5);
/// assert_eq!(mesh.facet_group("sloping")?.len(), 2);
/// assert_eq!(mesh.refined()?.facet_group("sloping")?.len(), 4);
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "super::file::Unchecked")
)]
pub struct Mesh {
    dim: usize,
    points: Vec<[f64; 3]>,
    kinds: Vec<CellKind>,
    /// Nodes of cell c: `nodes[first[c]..first[c + 1]]`.
    #[cfg_attr(feature = "serde", serde(skip_serializing))]
    first: Vec<usize>,
    nodes: Vec<usize>,
    facet_groups: FacetGroups,
    cell_groups: CellGroups,
    node_groups: NodeGroups,
    is_part: bool,
}

/// A facet of the boundary, as given to the closure of [`Mesh::mark_boundary`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BoundaryFacet {
    /// The cell it belongs to.
    pub cell: usize,
    /// Its nodes, ordered so that the normal points out of the cell.
    pub nodes: Vec<usize>,
    /// Unit outward normal (of the mean plane); third component 0 in the plane.
    pub normal: [f64; 3],
    /// Mean of its nodes.
    pub centre: [f64; 3],
    /// Length or area; of a bent one that of its chord or mean plane.
    pub measure: f64,
    /// Whether it is an edge of a plane mesh.
    is_edge: bool,
}

impl BoundaryFacet {
    /// Its corners: the nodes but for the middles of edges and faces of second order.
    #[must_use]
    pub fn corners(&self) -> &[usize] {
        let dim = if self.is_edge { 2 } else { 3 };
        &self.nodes[..Reference::of_facet(dim, self.nodes.len()).num_corners()]
    }
}

impl Mesh {
    /// A mesh from its points (third coordinate ignored in the plane) and cells.
    ///
    /// # Errors
    /// Dimension other than 2 or 3, no cells, cells of another dimension, wrong node numbers, coordinates that are not finite, nodes in
    /// no cell, cells with non-positive Jacobian, neighbours of different order: each names the cell or node.
    pub fn new(
        dim: usize,
        points: Vec<[f64; 3]>,
        cells: impl IntoIterator<Item = (CellKind, Vec<usize>)>,
    ) -> Result<Self, FemError> {
        let mesh = Self::unchecked(dim, points, cells)?;
        mesh.check_cells()?;
        Ok(mesh)
    }

    /// Like [`new`](Self::new), but cells numbered clockwise are reversed: for file formats that do not fix the orientation.
    ///
    /// # Errors
    /// Like [`new`](Self::new); folded or flat cells remain errors.
    pub fn oriented(
        dim: usize,
        points: Vec<[f64; 3]>,
        cells: impl IntoIterator<Item = (CellKind, Vec<usize>)>,
    ) -> Result<Self, FemError> {
        let mut mesh = Self::unchecked(dim, points, cells)?;
        for cell in 0..mesh.num_cells() {
            if mesh.is_turned_round(cell) {
                // The mirror image of the reference cell, with its first two axes exchanged.
                let points = mesh.kinds[cell].reference().points();
                let mirrored = |p: &[f64; 3]| points.iter().position(|q| *q == [p[1], p[0], p[2]]);
                let old = mesh.cell(cell).to_vec();
                let begin = mesh.first[cell];
                for (a, from) in points.iter().map(mirrored).enumerate() {
                    mesh.nodes[begin + a] = old[from.unwrap_or(a)];
                }
            }
        }
        mesh.check_cells()?;
        Ok(mesh)
    }

    fn unchecked(
        dim: usize,
        mut points: Vec<[f64; 3]>,
        cells: impl IntoIterator<Item = (CellKind, Vec<usize>)>,
    ) -> Result<Self, FemError> {
        if dim != 2 && dim != 3 {
            return Err(FemError::Dimension { dim });
        }
        if dim == 2 {
            points.iter_mut().for_each(|p| p[2] = 0.0);
        }
        if let Some(node) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(FemError::Coordinate {
                node,
                point: points[node],
            });
        }
        let (mut kinds, mut first, mut nodes) = (Vec::new(), vec![0], Vec::new());
        let mut used = vec![false; points.len()];
        for (cell, (kind, list)) in cells.into_iter().enumerate() {
            if kind.dim() != dim {
                return Err(FemError::CellDimension {
                    cell,
                    kind: kind.name(),
                    dim,
                });
            }
            if list.len() != kind.num_nodes() {
                return Err(FemError::CellNodes {
                    what: "cell",
                    index: cell,
                    expected: kind.num_nodes(),
                    found: list.len(),
                });
            }
            check_nodes("cell", cell, &list, points.len())?;
            list.iter().for_each(|&n| used[n] = true);
            kinds.push(kind);
            nodes.extend(list);
            first.push(nodes.len());
        }
        if kinds.is_empty() {
            return Err(FemError::Empty {
                what: "there are no cells",
            });
        }
        if let Some(node) = used.iter().position(|u| !u) {
            return Err(FemError::LooseNode { node });
        }
        Ok(Self {
            dim,
            points,
            kinds,
            first,
            nodes,
            facet_groups: BTreeMap::new(),
            cell_groups: BTreeMap::new(),
            node_groups: BTreeMap::new(),
            is_part: false,
        })
    }

    /// Declares that this is the part of a larger mesh that one process owns: groups may be empty here, and an
    /// [`Elasticity`](super::Elasticity) on it may leave rigid motions free, or have no free displacement. At nodes all of whose cells are
    /// in this part, the rows of the stiffness matrix, the loads and the contact rows are complete.
    #[must_use]
    pub fn into_part(mut self) -> Self {
        self.is_part = true;
        self
    }

    pub(super) fn is_part(&self) -> bool {
        self.is_part
    }

    /// 2 or 3.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of nodes.
    #[must_use]
    pub fn num_nodes(&self) -> usize {
        self.points.len()
    }

    /// Number of cells.
    #[must_use]
    pub fn num_cells(&self) -> usize {
        self.kinds.len()
    }

    /// Coordinates of the nodes; the third is 0 in the plane.
    #[must_use]
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Kind of a cell.
    #[must_use]
    pub fn kind(&self, cell: usize) -> CellKind {
        self.kinds[cell]
    }

    /// Nodes of a cell.
    #[must_use]
    pub fn cell(&self, cell: usize) -> &[usize] {
        &self.nodes[self.first[cell]..self.first[cell + 1]]
    }

    /// Positions of the nodes of a cell.
    pub(super) fn nodes_at(&self, cell: usize) -> impl Iterator<Item = [f64; 3]> + Clone + '_ {
        self.cell(cell).iter().map(|&node| self.points[node])
    }

    /// Mean of a cell's nodes.
    #[must_use]
    pub fn centre(&self, cell: usize) -> [f64; 3] {
        mean(self.cell(cell).iter().map(|&n| self.points[n]))
    }

    /// All facets that belong to one cell only, in the order of the cells.
    #[must_use]
    pub fn boundary(&self) -> Vec<BoundaryFacet> {
        let mut count: HashMap<[usize; 4], u32> = HashMap::new();
        for cell in 0..self.num_cells() {
            for local in self.kinds[cell].facets() {
                *count.entry(self.facet_key(cell, local)).or_insert(0) += 1;
            }
        }
        let mut boundary = Vec::new();
        for cell in 0..self.num_cells() {
            for local in self.kinds[cell].facets() {
                if count[&self.facet_key(cell, local)] == 1 {
                    boundary.push(self.facet(cell, local));
                }
            }
        }
        boundary
    }

    /// The corners of a facet, sorted.
    pub(super) fn facet_key(&self, cell: usize, local: &[usize]) -> [usize; 4] {
        let nodes = self.cell(cell);
        let corners = Reference::of_facet(self.dim, local.len()).num_corners();
        key(local[..corners].iter().map(|&a| nodes[a]))
    }

    fn facet(&self, cell: usize, local: &[usize]) -> BoundaryFacet {
        let all = self.cell(cell);
        let nodes: Vec<usize> = local.iter().map(|&a| all[a]).collect();
        let area = self.area_vector(&nodes);
        let measure = norm(area);
        BoundaryFacet {
            cell,
            normal: area.map(|x| x / measure),
            centre: mean(nodes.iter().map(|&n| self.points[n])),
            measure,
            nodes,
            is_edge: self.dim == 2,
        }
    }

    /// Normal times length or area of a facet.
    pub(super) fn area_vector(&self, nodes: &[usize]) -> [f64; 3] {
        let p = |a: usize| self.points[nodes[a]];
        match (self.dim, nodes.len()) {
            // Of a bent edge, too: the integral of the normal.
            (2, _) => {
                let d = difference(p(1), p(0));
                [d[1], -d[0], 0.0]
            }
            (_, 3) => cross(difference(p(1), p(0)), difference(p(2), p(0))).map(|x| 0.5 * x),
            (_, 4) => cross(difference(p(2), p(0)), difference(p(3), p(1))).map(|x| 0.5 * x),
            _ => area_in_space(&self.points, nodes),
        }
    }

    /// Adds the boundary facets for which `choose` is true to a group, which is created if it does not exist. Returns their number.
    pub fn mark_boundary(
        &mut self,
        name: impl Into<String>,
        choose: impl Fn(&BoundaryFacet) -> bool,
    ) -> usize {
        let chosen: Vec<_> = self
            .boundary()
            .into_iter()
            .filter(|f| choose(f))
            .map(|f| f.nodes)
            .collect();
        let number = chosen.len();
        self.join_facets(name.into(), chosen);
        number
    }

    /// Facets are in a group once, in whatever order of their nodes they are given: loads and areas count each once.
    fn join_facets(&mut self, group: String, facets: Vec<Vec<usize>>) {
        let dim = self.dim;
        let corners = |f: &Vec<usize>| {
            key(f
                .iter()
                .copied()
                .take(Reference::of_facet(dim, f.len()).num_corners()))
        };
        join(self.facet_groups.entry(group).or_default(), facets, corners);
    }

    /// Adds facets, given by their nodes, to a group; those in it already are not added again. Facets of second order may be given by their
    /// corners alone.
    ///
    /// # Errors
    /// Facets with too few or too many nodes or one node twice, nodes that do not exist.
    pub fn add_facet_group(
        &mut self,
        name: impl Into<String>,
        facets: Vec<Vec<usize>>,
    ) -> Result<(), FemError> {
        let mut facets = facets;
        let middles = self.middles();
        for (index, nodes) in facets.iter_mut().enumerate() {
            check_nodes("facet", index, nodes, self.points.len())?;
            let corners = Reference::of_facet(self.dim, nodes.len()).num_corners();
            let whole = nodes.get(..corners).map(|n| completed(self.dim, n, &middles));
            match whole {
                Some(whole) if nodes.len() == corners || *nodes == whole => *nodes = whole,
                whole => {
                    return Err(FemError::CellNodes {
                        what: "facet",
                        index,
                        expected: whole.map_or(self.dim, |w| w.len()),
                        found: nodes.len(),
                    });
                }
            }
            let distinct: std::collections::BTreeSet<_> = nodes.iter().collect();
            if distinct.len() < nodes.len() {
                return Err(FemError::CellNodes {
                    what: "facet",
                    index,
                    expected: nodes.len(),
                    found: distinct.len(),
                });
            }
        }
        self.join_facets(name.into(), facets);
        Ok(())
    }

    /// Adds the cells for which `choose(centre)` is true to a group. Returns their number.
    pub fn mark_cells(&mut self, name: impl Into<String>, choose: impl Fn([f64; 3]) -> bool) -> usize {
        let chosen: Vec<_> = (0..self.num_cells())
            .filter(|&c| choose(self.centre(c)))
            .collect();
        let number = chosen.len();
        join(self.cell_groups.entry(name.into()).or_default(), chosen, |c| *c);
        number
    }

    /// Adds cells, given by their numbers, to a group, which is created if it does not exist; those in it already are not added again.
    ///
    /// # Errors
    /// Cells that do not exist.
    pub fn add_cell_group(&mut self, name: impl Into<String>, cells: Vec<usize>) -> Result<(), FemError> {
        if let Some(&cell) = cells.iter().find(|c| **c >= self.num_cells()) {
            return Err(FemError::CellNumber {
                cell,
                cells: self.num_cells(),
            });
        }
        join(self.cell_groups.entry(name.into()).or_default(), cells, |c| *c);
        Ok(())
    }

    /// Facets of a group, each as its nodes.
    ///
    /// # Errors
    /// A group that does not exist or, unless the mesh is a [part](Self::into_part), is empty.
    pub fn facet_group(&self, name: &str) -> Result<&[Vec<usize>], FemError> {
        lookup("facets", name, &self.facet_groups, self.is_part)
    }

    /// Cells of a group.
    ///
    /// # Errors
    /// A group that does not exist or, unless the mesh is a [part](Self::into_part), is empty.
    pub fn cell_group(&self, name: &str) -> Result<&[usize], FemError> {
        lookup("cells", name, &self.cell_groups, self.is_part)
    }

    /// Names of the groups of facets.
    pub fn facet_group_names(&self) -> impl Iterator<Item = &str> {
        self.facet_groups.keys().map(String::as_str)
    }

    /// Names of the groups of cells.
    pub fn cell_group_names(&self) -> impl Iterator<Item = &str> {
        self.cell_groups.keys().map(String::as_str)
    }

    /// The groups of cells of a finer mesh, in which cell c of this one is divided into `children[c]`.
    pub(super) fn refined_cell_groups(&self, children: &[std::ops::Range<usize>]) -> CellGroups {
        let groups = self.cell_groups.iter();
        let fine = |list: &[usize]| list.iter().flat_map(|&c| children[c].clone()).collect();
        groups.map(|(name, list)| (name.clone(), fine(list))).collect()
    }

    pub(super) fn groups(&self) -> (&FacetGroups, &CellGroups) {
        (&self.facet_groups, &self.cell_groups)
    }

    pub(super) fn node_groups(&self) -> &NodeGroups {
        &self.node_groups
    }

    pub(super) fn node_groups_mut(&mut self) -> &mut NodeGroups {
        &mut self.node_groups
    }

    pub(super) fn set_groups(&mut self, facets: FacetGroups, cells: CellGroups) {
        self.facet_groups = facets;
        self.cell_groups = cells;
    }
}

/// Adds to a group what it does not hold yet, in the order given.
pub(super) fn join<T, K: Ord>(group: &mut Vec<T>, more: Vec<T>, key: impl Fn(&T) -> K) {
    let mut known: std::collections::BTreeSet<K> = group.iter().map(&key).collect();
    group.extend(more.into_iter().filter(|new| known.insert(key(new))));
}

pub(super) fn lookup<'a, T>(
    what: &'static str,
    name: &str,
    groups: &'a BTreeMap<String, Vec<T>>,
    is_part: bool,
) -> Result<&'a [T], FemError> {
    match groups.get(name) {
        Some(list) if list.is_empty() && !is_part => Err(FemError::EmptyGroup {
            what,
            name: name.into(),
        }),
        Some(list) => Ok(list),
        None => {
            let names = groups.keys().take(LISTED);
            let names: Vec<_> = names.map(|k| format!("\"{}\"", shorten(k))).collect();
            let known = match groups.len().saturating_sub(LISTED) {
                0 if names.is_empty() => "none".into(),
                0 => names.join(", "),
                more => format!("{} and {more} more", names.join(", ")),
            };
            Err(FemError::NoSuchGroup {
                what,
                name: name.into(),
                known,
            })
        }
    }
}

pub(super) fn check_nodes(
    what: &'static str,
    index: usize,
    list: &[usize],
    nodes: usize,
) -> Result<(), FemError> {
    match list.iter().find(|&&n| n >= nodes) {
        Some(&node) => Err(FemError::NoSuchNode {
            what,
            index,
            node,
            nodes,
        }),
        None => Ok(()),
    }
}
