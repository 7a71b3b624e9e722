//! Orders of elimination.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::LinearError;
use super::dissection::{Graph, dissect};
use super::sparse_lu::give_up;
use crate::tolerances::NONE;

/// The unknown at each place, and the place of each unknown.
pub(super) struct Order {
    pub(super) unknowns: Vec<usize>,
    pub(super) places: Vec<usize>,
}

/// The graph of a matrix in which neighbouring unknowns of equal columns (those of one node of a mesh) are merged: much smaller, with
/// equally good orders.
pub(super) struct Nodes<'l> {
    /// The unknowns to come last.
    last: &'l [usize],
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    /// The unknowns of group g are `members[first[g]..first[g + 1]]`.
    members: Vec<usize>,
    first: Vec<usize>,
}

impl<'l> Nodes<'l> {
    pub(super) fn new(a: SymbolicSparseColMatRef<'_, usize>, last: &'l [usize]) -> Self {
        let n = a.ncols();
        let mut left_out = vec![false; n];
        last.iter().for_each(|&i| left_out[i] = true);
        let column = |j: usize| &a.row_idx()[a.col_ptr()[j]..a.col_ptr()[j + 1]];
        let (mut members, mut first) = (Vec::with_capacity(n), Vec::new());
        let mut group_of = vec![NONE; n];
        let mut previous = None;
        for j in (0..n).filter(|&j| !left_out[j]) {
            if previous.is_none_or(|i| column(i) != column(j)) {
                first.push(members.len());
            }
            group_of[j] = first.len() - 1;
            members.push(j);
            previous = Some(j);
        }
        let (mut col_ptr, mut row_idx) = (vec![0], Vec::with_capacity(a.row_idx().len() / 2));
        for &start in &first {
            let begun = row_idx.len();
            for &i in column(members[start]) {
                let g = group_of[i];
                if g != NONE && (row_idx.len() == begun || row_idx[row_idx.len() - 1] != g) {
                    row_idx.push(g);
                }
            }
            col_ptr.push(row_idx.len());
        }
        first.push(members.len());
        Self {
            last,
            col_ptr,
            row_idx,
            members,
            first,
        }
    }

    /// An approximate minimum degree order (Amestoy, Davis, Duff 1996).
    pub(super) fn minimum_degree(&self) -> Result<Order, LinearError> {
        Ok(self.unknowns(minimum_degree(Graph {
            col_ptr: &self.col_ptr,
            row_idx: &self.row_idx,
        })?))
    }

    /// Nested dissection, with minimum degree for small regions.
    pub(super) fn dissected(&self) -> Result<Order, LinearError> {
        let graph = Graph {
            col_ptr: &self.col_ptr,
            row_idx: &self.row_idx,
        };
        Ok(self.unknowns(dissect(graph, minimum_degree)?))
    }

    /// The order of the unknowns that belongs to one of their groups.
    fn unknowns(&self, groups: Vec<usize>) -> Order {
        let n = self.members.len() + self.last.len();
        let mut unknowns = Vec::with_capacity(n);
        for g in groups {
            unknowns.extend_from_slice(&self.members[self.first[g]..self.first[g + 1]]);
        }
        unknowns.extend_from_slice(self.last);
        let mut places = vec![0; n];
        for (place, &i) in unknowns.iter().enumerate() {
            places[i] = place;
        }
        Order { unknowns, places }
    }
}

fn minimum_degree(graph: Graph<'_>) -> Result<Vec<usize>, LinearError> {
    let k = graph.col_ptr.len() - 1;
    let (mut order, mut places) = (vec![0; k], vec![0; k]);
    let symbolic = SymbolicSparseColMatRef::new_checked(k, k, graph.col_ptr, None, graph.row_idx);
    let request = amd::order_maybe_unsorted_scratch::<usize>(k, graph.row_idx.len());
    let mut memory = MemBuffer::try_new(request).map_err(|_| LinearError::Solver {
        what: "out of memory while ordering the unknowns".to_owned(),
    })?;
    let stack = MemStack::new(&mut memory);
    amd::order_maybe_unsorted(&mut order, &mut places, symbolic, amd::Control::default(), stack)
        .map_err(give_up)?;
    Ok(order)
}
