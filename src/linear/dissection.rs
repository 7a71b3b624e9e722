//! Nested dissection of a graph by level sets: fewer operations than minimum degree where a mesh is large and solid.

use crate::tolerances::NONE;

/// Regions of at most so many nodes are ordered by the caller's method for small graphs.
const LEAF: usize = 150;
/// Part of a region that each side of a separator must have at least.
const BALANCE: f64 = 0.3;

/// A symmetric graph by compressed columns.
#[derive(Clone, Copy)]
pub(super) struct Graph<'a> {
    pub(super) col_ptr: &'a [usize],
    pub(super) row_idx: &'a [usize],
}

impl<'a> Graph<'a> {
    fn num_nodes(self) -> usize {
        self.col_ptr.len() - 1
    }

    fn neighbours(self, node: usize) -> &'a [usize] {
        &self.row_idx[self.col_ptr[node]..self.col_ptr[node + 1]]
    }
}

/// An order of elimination: both sides of a separator before it, recursively (George 1973). Separators are level sets of the distance from
/// the nodes farthest from a node at the rim: planes, in a block. `leaf` orders small graphs.
pub(super) fn dissect<E>(
    graph: Graph<'_>,
    mut leaf: impl FnMut(Graph<'_>) -> Result<Vec<usize>, E>,
) -> Result<Vec<usize>, E> {
    let n = graph.num_nodes();
    let mut work = Dissection {
        graph,
        region: vec![0; n],
        regions: 1,
        level: vec![NONE; n],
        queue: Vec::with_capacity(n),
    };
    // Filled from the back: separators first, then what they separate.
    let mut order = Vec::with_capacity(n);
    let mut pending = vec![(0..n).collect::<Vec<usize>>()];
    while let Some(nodes) = pending.pop() {
        match (nodes.len() > LEAF).then(|| work.split(&nodes)).flatten() {
            Some((parts, separator)) => {
                order.extend(separator.into_iter().rev());
                pending.extend(parts);
            }
            None => {
                let local = work.order_leaf(&nodes, &mut leaf)?;
                order.extend(local.into_iter().rev());
            }
        }
    }
    order.reverse();
    Ok(order)
}

struct Dissection<'a> {
    graph: Graph<'a>,
    /// Number of the region in which a node is.
    region: Vec<usize>,
    regions: usize,
    level: Vec<usize>,
    queue: Vec<usize>,
}

impl Dissection<'_> {
    /// The parts of a region and what separates them; `None` where no balanced separator is found.
    fn split(&mut self, nodes: &[usize]) -> Option<([Vec<usize>; 2], Vec<usize>)> {
        let reached = self.levels(&nodes[..1]);
        if reached < nodes.len() {
            let (inside, outside): (Vec<usize>, Vec<usize>) =
                nodes.iter().partition(|&&i| self.level[i] != NONE);
            self.forget(nodes);
            return Some((self.number([inside, outside]), Vec::new()));
        }
        // From any node to the rim, from there to the other end, and back from all of that end.
        for single in [true, false] {
            let end = self.last_level(single);
            self.forget(nodes);
            self.levels(&end);
        }
        let found = self.separate();
        let parts = found.map(|level| {
            let side = |keep: &dyn Fn(usize) -> bool| -> Vec<usize> {
                nodes.iter().copied().filter(|&i| keep(self.level[i])).collect()
            };
            (
                [side(&|l| l < level), side(&|l| l > level)],
                side(&|l| l == level),
            )
        });
        self.forget(nodes);
        parts.map(|(sides, separator)| (self.number(sides), separator))
    }

    /// Distances from the given nodes within their region; returns how many nodes were reached, in `queue` by distance.
    fn levels(&mut self, from: &[usize]) -> usize {
        self.queue.clear();
        self.queue.extend_from_slice(from);
        from.iter().for_each(|&i| self.level[i] = 0);
        let mut next = 0;
        while next < self.queue.len() {
            let node = self.queue[next];
            next += 1;
            for &j in self.graph.neighbours(node) {
                if self.region[j] == self.region[node] && self.level[j] == NONE {
                    self.level[j] = self.level[node] + 1;
                    self.queue.push(j);
                }
            }
        }
        self.queue.len()
    }

    fn last_level(&self, single: bool) -> Vec<usize> {
        let Some(&last) = self.queue.last() else {
            return Vec::new();
        };
        let level = self.level[last];
        let far = self.queue.iter().rev().take_while(|&&i| self.level[i] == level);
        far.copied().take(if single { 1 } else { usize::MAX }).collect()
    }

    /// The smallest level that leaves enough on both sides.
    fn separate(&self) -> Option<usize> {
        let n = self.queue.len();
        let least = BALANCE * n as f64;
        let mut best: Option<(usize, usize)> = None;
        let mut start = 0;
        while start < n {
            let level = self.level[self.queue[start]];
            let size = self.queue[start..]
                .iter()
                .take_while(|&&i| self.level[i] == level)
                .count();
            let behind = n - start - size;
            if start as f64 >= least && behind as f64 >= least && best.is_none_or(|b| size < b.0) {
                best = Some((size, level));
            }
            start += size;
        }
        best.map(|b| b.1)
    }

    fn forget(&mut self, nodes: &[usize]) {
        nodes.iter().for_each(|&i| self.level[i] = NONE);
    }

    fn number(&mut self, parts: [Vec<usize>; 2]) -> [Vec<usize>; 2] {
        for part in &parts {
            part.iter().for_each(|&i| self.region[i] = self.regions);
            self.regions += 1;
        }
        parts
    }

    fn order_leaf<E>(
        &mut self,
        nodes: &[usize],
        leaf: &mut impl FnMut(Graph<'_>) -> Result<Vec<usize>, E>,
    ) -> Result<Vec<usize>, E> {
        // Levels serve as local numbers.
        nodes.iter().enumerate().for_each(|(k, &i)| self.level[i] = k);
        let (mut col_ptr, mut row_idx) = (vec![0], Vec::new());
        for &i in nodes {
            let inside = self.graph.neighbours(i).iter();
            let inside = inside.filter(|&&j| self.region[j] == self.region[i]);
            row_idx.extend(inside.map(|&j| self.level[j]));
            col_ptr.push(row_idx.len());
        }
        self.forget(nodes);
        let local = leaf(Graph {
            col_ptr: &col_ptr,
            row_idx: &row_idx,
        })?;
        Ok(local.into_iter().map(|k| nodes[k]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: [usize; 3]) -> (Vec<usize>, Vec<usize>) {
        let (mut col_ptr, mut row_idx) = (vec![0], Vec::new());
        let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    for c in near(k, n[2]) {
                        for b in near(j, n[1]) {
                            row_idx.extend(near(i, n[0]).map(|a| a + n[0] * (b + n[1] * c)));
                        }
                    }
                    col_ptr.push(row_idx.len());
                }
            }
        }
        (col_ptr, row_idx)
    }

    #[test]
    fn a_block_is_cut_across_its_length() {
        let n = [31, 6, 5];
        let (col_ptr, row_idx) = grid(n);
        let graph = Graph {
            col_ptr: &col_ptr,
            row_idx: &row_idx,
        };
        let order = dissect(graph, |g| Ok::<_, ()>((0..g.num_nodes()).collect())).unwrap();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..31 * 30).collect::<Vec<_>>());
        // The last separator is a plane of 6 × 5 nodes across the long side.
        let plane: Vec<usize> = order[order.len() - 30..].iter().map(|i| i % 31).collect();
        assert!(plane.iter().all(|i| *i == plane[0]), "{plane:?}");
    }

    #[test]
    fn parts_that_do_not_hang_together_are_no_matter() {
        let (mut col_ptr, mut row_idx) = grid([20, 20, 1]);
        let entries = row_idx.len();
        let second: Vec<usize> = row_idx.iter().map(|i| i + 400).collect();
        row_idx.extend(second);
        let more: Vec<usize> = col_ptr[1..].iter().map(|p| p + entries).collect();
        col_ptr.extend(more);
        let graph = Graph {
            col_ptr: &col_ptr,
            row_idx: &row_idx,
        };
        let mut order = dissect(graph, |g| Ok::<_, ()>((0..g.num_nodes()).collect())).unwrap();
        order.sort_unstable();
        assert_eq!(order, (0..800).collect::<Vec<_>>());
    }
}
