//! Assembly of the stiffness matrix, nodes in parallel.

use std::ops::Range;

use super::assembly::{PRESCRIBED, pattern};
use super::element_matrix::ElementMatrix;
use super::springs::Coupled;
use super::stiffness::Elements;
use super::{ElasticSystem, FemError};
use crate::parallel;
use crate::sparse::{Blocks, Matrix, NodalBlocks, NodalMatrix, Symmetric};
use crate::tolerances::SAME;

/// Largest number of parts of the nodes, and least number of nodes of each: cells between two parts are computed twice.
const MOST_PARTS: usize = 16;
const LEAST_NODES: usize = 4096;

/// The cells at each node, and what else is attached there.
pub(super) struct CellsOf {
    first: Vec<usize>,
    cells: Vec<u32>,
}

impl CellsOf {
    pub(super) fn new(all: Coupled<'_>) -> Self {
        let nodes = all.mesh.num_nodes();
        let mut first = vec![0; nodes + 1];
        for cell in 0..all.len() {
            all.nodes(cell).iter().for_each(|n| first[n + 1] += 1);
        }
        for n in 0..nodes {
            first[n + 1] += first[n];
        }
        let mut next = first.clone();
        let mut cells = vec![0; first[nodes]];
        for cell in 0..all.len() {
            for &n in all.nodes(cell) {
                cells[next[n]] = cell as u32;
                next[n] += 1;
            }
        }
        Self { first, cells }
    }

    /// In increasing order.
    pub(super) fn of(&self, node: usize) -> &[u32] {
        &self.cells[self.first[node]..self.first[node + 1]]
    }
}

/// A renumbering of nodes.
struct Order {
    nodes: Vec<u32>,
    /// The new number of each node, `u32::MAX` for those left out.
    number: Vec<u32>,
}

impl Order {
    fn of(nodes: Vec<u32>, all: usize) -> Self {
        let mut number = vec![u32::MAX; all];
        for (k, n) in nodes.iter().enumerate() {
            number[*n as usize] = k as u32;
        }
        Self { nodes, number }
    }

    /// Layer by layer from one end of the body, in the order of E. Cuthill and J. McKee (1969): neighbouring nodes have close numbers.
    fn by_layers(elements: Coupled<'_>, cells: &CellsOf, free: impl Fn(usize) -> bool) -> Self {
        let all = elements.mesh.num_nodes();
        let points = elements.mesh.points();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for n in (0..all).filter(|n| free(*n)) {
            for d in 0..3 {
                (low[d], high[d]) = (low[d].min(points[n][d]), high[d].max(points[n][d]));
            }
        }
        let length = |d: usize| high[d] - low[d];
        let axis = (0..3).fold(0, |best, d| if length(d) > length(best) { d } else { best });
        let end = low[axis] + SAME * length(axis);
        let mut seen: Vec<bool> = (0..all).map(|n| !free(n)).collect();
        let mut spread = vec![false; elements.len()];
        let mut nodes: Vec<u32> = Vec::new();
        for n in (0..all).filter(|n| points[*n][axis] <= end) {
            if !std::mem::replace(&mut seen[n], true) {
                nodes.push(n as u32);
            }
        }
        let (mut next, mut rest) = (0, 0..all);
        loop {
            while next < nodes.len() {
                for &cell in cells.of(nodes[next] as usize) {
                    if std::mem::replace(&mut spread[cell as usize], true) {
                        continue;
                    }
                    for &n in elements.nodes(cell as usize) {
                        if !std::mem::replace(&mut seen[n], true) {
                            nodes.push(n as u32);
                        }
                    }
                }
                next += 1;
            }
            // Another connected part of the body.
            let Some(n) = rest.find(|n| !seen[*n]) else {
                break;
            };
            seen[n] = true;
            nodes.push(n as u32);
        }
        Self::of(nodes, all)
    }

    /// Ranges of nodes that are assembled in parallel.
    fn parts(&self) -> impl Iterator<Item = Range<usize>> {
        let all = self.nodes.len();
        let size = all.div_ceil(MOST_PARTS).max(LEAST_NODES);
        (0..all)
            .step_by(size)
            .map(move |first| first..all.min(first + size))
    }
}

impl ElasticSystem {
    /// A in blocks of nodes, with their positions: a quarter of the memory of single entries, for
    /// [`ReducedContact`](crate::contact::ReducedContact). Assembled at each call. Nodes are renumbered layer by layer.
    ///
    /// # Errors
    /// [`FemError::TooLarge`] where the blocks do not fit into memory.
    ///
    /// ```
    /// use semismooth::fem::{Elasticity, Material, Mesh};
    /// let mesh = Mesh::block([0.0; 3], [1.0; 3], [3, 3, 3])?;
    /// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix("left").discretize()?;
    /// let nodal = system.nodal_stiffness()?;
    /// assert_eq!((nodal.num_nodes(), nodal.num_unknowns()), (48, 144));
    /// assert_eq!(nodal.to_matrix()?, *system.stiffness());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn nodal_stiffness(&self) -> Result<NodalMatrix, FemError> {
        let dim = self.mesh.dim();
        let cells = CellsOf::new(self.coupled());
        let free = |n: usize| (0..dim).any(|d| self.dofs[dim * n + d] != PRESCRIBED);
        let order = Order::by_layers(self.coupled(), &cells, free);
        let points = order
            .nodes
            .iter()
            .map(|n| self.mesh.points()[*n as usize])
            .collect();
        let mut places = Vec::with_capacity(self.free);
        for (k, _) in self.dofs.iter().enumerate().filter(|d| *d.1 != PRESCRIBED) {
            places.push(dim as u32 * order.number[k / dim] + (k % dim) as u32);
        }
        let blocks = match dim {
            2 => NodalBlocks::Plane(self.in_blocks(&cells, &order)?),
            _ => NodalBlocks::Space(self.in_blocks(&cells, &order)?),
        };
        Ok(NodalMatrix::from_parts(blocks, points, places))
    }

    fn in_blocks<const B: usize>(&self, cells: &CellsOf, order: &Order) -> Result<Symmetric<B>, FemError> {
        let nodes = order.nodes.len();
        let too_large = || FemError::TooLarge {
            cells: vec![self.mesh.num_cells()],
        };
        if nodes >= u32::MAX as usize / 6 {
            return Err(too_large());
        }
        let mut blocks = Blocks::<B, B>::new(nodes);
        let ranges: Vec<_> = order.parts().collect();
        let rows = crate::sweep::sweep(&ranges, |rows| self.neighbours(cells, order, rows.clone()));
        blocks.start.reserve_exact(nodes);
        for (cols, counts) in &rows {
            blocks.col.extend_from_slice(cols);
            for count in counts {
                blocks
                    .start
                    .push(blocks.start[blocks.start.len() - 1] + *count as usize);
            }
        }
        drop(rows);
        let count = blocks.col.len();
        if count > u32::MAX as usize {
            return Err(too_large());
        }
        blocks.value.try_reserve_exact(count).map_err(|_| too_large())?;
        // Initialised by one thread: page faults of several threads at once would be serialised.
        blocks.value.resize(count, [[0.0; B]; B]);
        let fixed: Vec<u8> = (0..order.number.len())
            .map(|n| {
                let prescribed = (0..B).filter(|d| self.dofs[B * n + d] == PRESCRIBED);
                prescribed.fold(0, |m, d| m | 1 << d)
            })
            .collect();
        let (start, col) = (&blocks.start, &blocks.col);
        let first = |row: usize| start[row];
        self.fill(
            cells,
            order,
            &first,
            &mut blocks.value,
            &|values, nodes, a, element| {
                let row = order.number[nodes[a]] as usize;
                let cols = &col[start[row]..start[row + 1]];
                for (b, &nb) in nodes.iter().enumerate() {
                    // The upper triangle is not stored.
                    let Ok(k) = cols.binary_search(&order.number[nb]) else {
                        continue;
                    };
                    let block = &mut values[k];
                    for d in (0..B).filter(|d| fixed[nodes[a]] >> d & 1 == 0) {
                        for e in (0..B).filter(|e| fixed[nb] >> e & 1 == 0) {
                            block[d][e] += element.get(B * a + d, B * b + e);
                        }
                    }
                }
            },
        );
        Ok(Symmetric::of(blocks))
    }

    /// The new numbers of the neighbours of each node up to its own, which is the last one, increasing, and their count.
    fn neighbours(&self, cells: &CellsOf, order: &Order, rows: Range<usize>) -> (Vec<u32>, Vec<u32>) {
        let (mut all, mut counts) = (Vec::new(), Vec::with_capacity(rows.len()));
        let mut seen = vec![u32::MAX; order.nodes.len()];
        for row in rows {
            let (before, row) = (all.len(), row as u32);
            for &cell in cells.of(order.nodes[row as usize] as usize) {
                for &n in self.coupled().nodes(cell as usize) {
                    let k = order.number[n];
                    if k < row && std::mem::replace(&mut seen[k as usize], row) != row {
                        all.push(k);
                    }
                }
            }
            all.push(row);
            all[before..].sort_unstable();
            counts.push((all.len() - before) as u32);
        }
        (all, counts)
    }

    /// A in compressed columns, one per free displacement.
    pub(super) fn single_entries(&self) -> Matrix {
        let (dim, cells) = (self.mesh.dim(), CellsOf::new(self.coupled()));
        let pattern = match pattern(self.coupled(), dim, &self.dofs, self.free) {
            Ok(pattern) => pattern,
            Err(_) => unreachable!("rows of free displacements increase"),
        };
        let all = self.mesh.num_nodes();
        let order = Order::of((0..all as u32).collect(), all);
        // The first free displacement at or after each node.
        let mut displacements = vec![self.free; all + 1];
        for n in (0..all).rev() {
            let own = self.dofs[dim * n..dim * (n + 1)].iter();
            let least = own.copied().filter(|d| *d != PRESCRIBED).min();
            displacements[n] = least.unwrap_or(displacements[n + 1]);
        }
        let (start, rows) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
        let first = |node: usize| start[displacements[node]];
        let mut values = vec![0.0; rows.len()];
        self.fill(
            &cells,
            &order,
            &first,
            &mut values,
            &|values, nodes, b, element| {
                for e in 0..dim {
                    let column = self.dofs[dim * nodes[b] + e];
                    if column == PRESCRIBED {
                        continue;
                    }
                    let own = start[column]..start[column + 1];
                    let (rows, shift) = (&rows[own.clone()], own.start - first(nodes[b]));
                    for (a, &na) in nodes.iter().enumerate() {
                        for d in 0..dim {
                            if let Ok(k) = rows.binary_search(&self.dofs[dim * na + d]) {
                                values[shift + k] += element.get(dim * a + d, dim * b + e);
                            }
                        }
                    }
                }
            },
        );
        match Matrix::from_values(pattern, values) {
            Ok(matrix) => matrix,
            Err(_) => unreachable!("a value for each entry of the pattern"),
        }
    }

    /// Calls `add` with the values of a node (from `first` of its new number on), the nodes of a cell, the index of the node among them,
    /// and the stiffness of the cell. Each node receives its cells in increasing order, so that sums are symmetric to the last bit.
    fn fill<V: Send>(
        &self,
        cells: &CellsOf,
        order: &Order,
        first: &(impl Fn(usize) -> usize + Sync),
        values: &mut [V],
        add: &(impl Fn(&mut [V], &[usize], usize, &ElementMatrix) + Sync),
    ) {
        let parts: Vec<_> = order.parts().collect();
        let ends: Vec<usize> = std::iter::once(0)
            .chain(parts.iter().map(|rows| first(rows.end)))
            .collect();
        parallel::spans(&ends, values, &|k, values| {
            let rows = parts[k].clone();
            let nodes = &order.nodes[rows.clone()];
            let mut own: Vec<u32> = nodes
                .iter()
                .flat_map(|n| cells.of(*n as usize))
                .copied()
                .collect();
            own.sort_unstable();
            own.dedup();
            let (begin, mut elements) = (first(rows.start), Elements::new(self));
            for cell in own {
                let (nodes, element) = (self.coupled().nodes(cell as usize), elements.of(cell as usize));
                for (a, &n) in nodes.iter().enumerate() {
                    let place = order.number[n] as usize;
                    if rows.contains(&place) {
                        add(&mut values[first(place) - begin..], nodes, a, element);
                    }
                }
            }
        });
    }
}
