//! A mesh on one process, cut into parts that are sent to the others one after another.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use semismooth::fem::{CellKind, FemError, Mesh};

use crate::ffi::Int;
use crate::world::{PetscError, World};

const KINDS: [CellKind; 14] = [
    CellKind::Triangle,
    CellKind::Quadrilateral,
    CellKind::Tetrahedron,
    CellKind::Hexahedron,
    CellKind::Triangle6,
    CellKind::Quadrilateral8,
    CellKind::Quadrilateral9,
    CellKind::Tetrahedron10,
    CellKind::Hexahedron20,
    CellKind::Hexahedron27,
    CellKind::Wedge,
    CellKind::Wedge15,
    CellKind::Pyramid,
    CellKind::Pyramid13,
];

/// Which process owns each node: recursive bisection of the longest side of the box around the nodes.
pub(crate) fn owners(points: &[[f64; 3]], size: usize) -> Vec<u32> {
    let mut owner = vec![0; points.len()];
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let mut rest: Vec<(&mut [u32], Range<usize>)> = vec![(&mut order, 0..size)];
    while let Some((nodes, ranks)) = rest.pop() {
        if ranks.len() == 1 {
            nodes.iter().for_each(|n| owner[*n as usize] = ranks.start as u32);
            continue;
        }
        let side = |d: usize| {
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for n in nodes.iter() {
                let x = points[*n as usize][d];
                (low, high) = (low.min(x), high.max(x));
            }
            high - low
        };
        let sides = [side(0), side(1), side(2)];
        let axis = (1..3).fold(0, |best, d| if sides[d] > sides[best] { d } else { best });
        let half = ranks.len() / 2;
        let at = nodes.len() * half / ranks.len();
        let place = |n: &u32| points[*n as usize][axis];
        if at > 0 {
            // Ties are broken by number, so that the cut is unique.
            nodes.select_nth_unstable_by(at, |a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
        }
        let (low, high) = nodes.split_at_mut(at);
        rest.push((low, ranks.start..ranks.start + half));
        rest.push((high, ranks.start + half..ranks.end));
    }
    owner
}

/// A mesh with the owners of its nodes.
pub(crate) struct Cutter<'a> {
    mesh: &'a Mesh,
    owner: Vec<u32>,
    /// Number of each node among those of all processes, and number of the first node of each process.
    number: Vec<Int>,
    first: Vec<usize>,
    /// Cells with a node of process r: `cells[start[r]..start[r + 1]]`.
    start: Vec<usize>,
    cells: Vec<u32>,
    /// Groups of facets, and a cell at each facet.
    facets: Vec<Facets<'a>>,
    groups: Vec<(&'a str, &'a [usize])>,
}

/// Name, facets, and a cell at each.
type Facets<'a> = (&'a str, &'a [Vec<usize>], Vec<u32>);

/// Marks a facet without a cell.
const NO_CELL: u32 = u32::MAX;

impl<'a> Cutter<'a> {
    pub(crate) fn new(mesh: &'a Mesh, size: usize) -> Self {
        let owner = owners(mesh.points(), size);
        let mut first = vec![0; size + 1];
        owner.iter().for_each(|r| first[*r as usize + 1] += 1);
        (0..size).for_each(|r| first[r + 1] += first[r]);
        let mut next = first.clone();
        let number = owner.iter().map(|r| {
            next[*r as usize] += 1;
            (next[*r as usize] - 1) as Int
        });
        let number = number.collect();
        let at = |cell: usize| {
            let nodes = mesh.cell(cell);
            let ranks = nodes.iter().map(|n| owner[*n] as usize).enumerate();
            let is_new = |k: usize, r: usize| nodes[..k].iter().all(|n| owner[*n] as usize != r);
            ranks.filter(move |(k, r)| is_new(*k, *r)).map(|(_, r)| r)
        };
        let mut start = vec![0; size + 1];
        for cell in 0..mesh.num_cells() {
            at(cell).for_each(|r| start[r + 1] += 1);
        }
        (0..size).for_each(|r| start[r + 1] += start[r]);
        let (mut next, mut cells) = (start.clone(), vec![0; start[size]]);
        for cell in 0..mesh.num_cells() {
            for r in at(cell) {
                cells[next[r]] = cell as u32;
                next[r] += 1;
            }
        }
        let facets: Vec<_> = mesh
            .facet_group_names()
            .map(|name| {
                let list = mesh.facet_group(name).unwrap_or_default();
                (name, list, vec![NO_CELL; list.len()])
            })
            .collect();
        let groups = mesh.cell_group_names();
        let groups = groups
            .map(|name| (name, mesh.cell_group(name).unwrap_or_default()))
            .collect();
        let mut cutter = Self {
            mesh,
            owner,
            number,
            first,
            start,
            cells,
            facets,
            groups,
        };
        cutter.find_cells();
        cutter
    }

    /// A cell at each facet of a group.
    fn find_cells(&mut self) {
        let mut of_node: HashMap<usize, Vec<(usize, usize)>> = HashMap::new();
        for (g, (_, list, _)) in self.facets.iter().enumerate() {
            for (k, facet) in list.iter().enumerate() {
                of_node.entry(facet[0]).or_default().push((g, k));
            }
        }
        for cell in 0..self.mesh.num_cells() {
            let nodes = self.mesh.cell(cell);
            for node in nodes {
                for &(g, k) in of_node.get(node).into_iter().flatten() {
                    let (_, list, at) = &mut self.facets[g];
                    if at[k] == NO_CELL && list[k].iter().all(|n| nodes.contains(n)) {
                        at[k] = cell as u32;
                    }
                }
            }
        }
    }

    /// The part of a process.
    pub(crate) fn piece(&self, rank: usize) -> Piece {
        let mut cells = self.cells[self.start[rank]..self.start[rank + 1]].to_vec();
        let mut near: Vec<usize> = self.nodes(&cells);
        // Neighbours of own nodes must have the same supports as on their owner: all facets there are needed, with their cells.
        let is_near = |n: &usize| near.binary_search(n).is_ok();
        let mut facets = Vec::new();
        for (name, list, at) in &self.facets {
            let here = (0..list.len()).filter(|k| at[*k] != NO_CELL && list[*k].iter().any(is_near));
            let here: Vec<usize> = here.collect();
            cells.extend(here.iter().map(|k| at[*k]));
            facets.push((*name, *list, here));
        }
        cells.sort_unstable();
        cells.dedup();
        near = self.nodes(&cells);
        let place = |n: &usize| near.binary_search(n).unwrap_or(0) as u64;
        let mut kinds = Vec::with_capacity(cells.len());
        let mut nodes = Vec::new();
        for cell in &cells {
            let kind = self.mesh.kind(*cell as usize);
            kinds.push(KINDS.iter().position(|k| *k == kind).unwrap_or(0) as u64);
            nodes.extend(self.mesh.cell(*cell as usize).iter().map(place));
        }
        let names = |name: &str| name.bytes().map(u64::from).collect();
        let own = near
            .iter()
            .enumerate()
            .filter(|n| self.owner[*n.1] as usize == rank);
        let mut lists = vec![
            vec![
                self.mesh.dim() as u64,
                self.first[rank] as u64,
                self.facets.len() as u64,
            ],
            near.iter()
                .flat_map(|n| self.mesh.points()[*n].map(f64::to_bits))
                .collect(),
            kinds,
            nodes,
            own.map(|n| n.0 as u64).collect(),
            near.iter().map(|n| self.number[*n] as u64).collect(),
        ];
        for (name, list, here) in facets {
            lists.push(names(name));
            lists.push(here.iter().map(|k| list[*k].len() as u64).collect());
            lists.push(here.iter().flat_map(|k| list[*k].iter().map(place)).collect());
        }
        for (name, list) in &self.groups {
            let here = list.iter().filter_map(|c| cells.binary_search(&(*c as u32)).ok());
            lists.push(names(name));
            lists.push(here.map(|c| c as u64).collect());
        }
        Piece { lists }
    }

    /// Nodes of cells, in increasing order.
    fn nodes(&self, cells: &[u32]) -> Vec<usize> {
        let mut nodes: Vec<usize> = cells
            .iter()
            .flat_map(|c| self.mesh.cell(*c as usize).iter().copied())
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

/// A part as lists of numbers, for sending: dimension, number of the first own node and number of groups of facets; coordinates; kinds and
/// nodes of cells; own nodes; numbers of nodes; name, lengths and nodes of each group of facets; name and cells of each group of cells.
pub(crate) struct Piece {
    lists: Vec<Vec<u64>>,
}

impl Piece {
    pub(crate) fn send(&self, world: &World, to: usize) -> Result<(), PetscError> {
        world.send_list(&[self.lists.len() as u64], to)?;
        self.lists.iter().try_for_each(|list| world.send_list(list, to))
    }

    pub(crate) fn receive(world: &World, from: usize) -> Result<Self, PetscError> {
        let count = world.receive_list(from)?.first().copied().unwrap_or(0);
        let lists = (0..count).map(|_| world.receive_list(from));
        Ok(Self {
            lists: lists.collect::<Result<_, _>>()?,
        })
    }

    /// Mesh, own nodes, numbers of nodes, number of the first own node.
    pub(crate) fn open(self) -> Result<(Mesh, Vec<usize>, Vec<Int>, usize), FemError> {
        let mut lists = self.lists.into_iter();
        let mut next = || lists.next().unwrap_or_default();
        let head = next();
        let [dim, first, facet_groups] = [0, 1, 2].map(|k| head.get(k).copied().unwrap_or(0) as usize);
        let points = next()
            .as_chunks()
            .0
            .iter()
            .map(|p| p.map(f64::from_bits))
            .collect();
        let (kinds, nodes) = (next(), next());
        let own = next().into_iter().map(|n| n as usize).collect();
        let global = next().into_iter().map(|n| n as Int).collect();
        let mut from = nodes.into_iter().map(|n| n as usize);
        let cells = kinds.iter().map(|k| {
            let kind = KINDS[*k as usize % KINDS.len()];
            (kind, from.by_ref().take(kind.num_nodes()).collect())
        });
        let mut mesh = Mesh::new(dim, points, cells)?.into_part();
        let text = |list: Vec<u64>| {
            let bytes: Vec<u8> = list.iter().map(|b| *b as u8).collect();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        for _ in 0..facet_groups {
            let (name, lengths) = (text(next()), next());
            let mut from = next().into_iter().map(|n| n as usize);
            let facets = lengths.iter().map(|n| from.by_ref().take(*n as usize).collect());
            mesh.add_facet_group(name, facets.collect())?;
        }
        while let Some(name) = lists.next() {
            // Cells are known by their centres.
            let centre = |c: u64| mesh.centre(c as usize).map(f64::to_bits);
            let here: HashSet<_> = lists.next().unwrap_or_default().into_iter().map(centre).collect();
            mesh.mark_cells(text(name), |x| here.contains(&x.map(f64::to_bits)));
        }
        Ok((mesh, own, global, first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tetrahedra and groups of a box, nodes in a shuffled order.
    fn shuffled() -> Mesh {
        let grid = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [6, 4, 3]).unwrap();
        let n = grid.num_nodes();
        // 71 and n have no common divisor.
        let to = |k: usize| (71 * k + 5) % n;
        let mut points = vec![[0.0; 3]; n];
        grid.points()
            .iter()
            .enumerate()
            .for_each(|(k, p)| points[to(k)] = *p);
        let cells = (0..grid.num_cells()).flat_map(|c| {
            let v = grid.cell(c);
            [
                [0, 1, 2, 6],
                [0, 2, 3, 6],
                [0, 3, 7, 6],
                [0, 7, 4, 6],
                [0, 4, 5, 6],
                [0, 5, 1, 6],
            ]
            .map(|t| (CellKind::Tetrahedron, t.map(|a| to(v[a])).to_vec()))
        });
        let mut mesh = Mesh::oriented(3, points, cells).unwrap();
        mesh.mark_boundary("left", |f| f.normal[0] < -0.5);
        mesh.mark_boundary("bottom", |f| f.normal[2] < -0.5);
        mesh.mark_cells("soft", |x| x[0] > 1.2);
        mesh
    }

    fn bits(p: [f64; 3]) -> [u64; 3] {
        p.map(f64::to_bits)
    }

    /// Each node has one owner, and parts of equal size up to a node for each cut.
    #[test]
    fn nodes_are_spread_evenly() {
        let mesh = shuffled();
        for size in [1, 2, 3, 5, 8] {
            let owner = owners(mesh.points(), size);
            let mut count = vec![0usize; size];
            owner.iter().for_each(|r| count[*r as usize] += 1);
            let (low, high) = (count.iter().min().unwrap(), count.iter().max().unwrap());
            assert!(high - low <= 3, "{count:?}");
        }
        // More processes than nodes: none twice.
        assert_eq!(owners(&[[0.0; 3], [1.0, 0.0, 0.0]], 2), [0, 1]);
    }

    /// Parts have all cells at their nodes, all facets at the neighbours of these, and their groups; numbers run through the processes.
    #[test]
    fn parts_of_any_mesh_have_what_their_rows_need() {
        let whole = shuffled();
        let size = 4;
        let cutter = Cutter::new(&whole, size);
        let mut end = 0;
        let mut numbers = HashMap::new();
        for rank in 0..size {
            let (mesh, own, global, first) = cutter.piece(rank).open().unwrap();
            assert_eq!(first, end);
            end += own.len();
            for (n, p) in mesh.points().iter().enumerate() {
                assert_eq!(*numbers.entry(bits(*p)).or_insert(global[n]), global[n]);
            }
            for (k, n) in own.iter().enumerate() {
                assert_eq!(global[*n] as usize, first + k);
            }
            let at = |mesh: &Mesh, nodes: &[usize]| -> Vec<_> {
                nodes.iter().map(|n| bits(mesh.points()[*n])).collect()
            };
            let mine: HashSet<_> = at(&mesh, &own).into_iter().collect();
            let held: HashSet<Vec<_>> = (0..mesh.num_cells()).map(|c| at(&mesh, mesh.cell(c))).collect();
            let mut near = HashSet::new();
            for cell in (0..whole.num_cells()).map(|c| at(&whole, whole.cell(c))) {
                if cell.iter().any(|p| mine.contains(p)) {
                    assert!(held.contains(&cell));
                    near.extend(cell);
                }
            }
            for name in ["left", "bottom"] {
                let list = mesh.facet_group(name).unwrap();
                let held: HashSet<Vec<_>> = list.iter().map(|f| at(&mesh, f)).collect();
                for facet in whole.facet_group(name).unwrap() {
                    let facet = at(&whole, facet);
                    assert_eq!(held.contains(&facet), facet.iter().any(|p| near.contains(p)));
                }
            }
            let soft = mesh.cell_group("soft").unwrap();
            for c in 0..mesh.num_cells() {
                assert_eq!(soft.contains(&c), mesh.centre(c)[0] > 1.2);
            }
        }
        assert_eq!((end, numbers.len()), (whole.num_nodes(), whole.num_nodes()));
    }
}
