//! The variables in which each contact node has displacements of its own: those along its frame, less those of what it touches.

use std::collections::BTreeMap;

use crate::contact::ContactError;
use crate::sparse::{Blocks, Matrix, NodalBlocks, NodalMatrix, Symmetric, own_nodes};
use crate::tolerances::CHECKED;

pub(super) type Block = [[f64; 3]; 3];

/// Columns and blocks of a row.
type BlockRow<const B: usize> = Vec<(usize, [[f64; B]; B])>;

const ZERO: Block = [[0.0; 3]; 3];

/// û_i = O_i u_i + Σ_j C_ij u_j at contact nodes i, û = u at all others. Where contact is between two bodies the j are nodes on the other
/// side, and of the own side where it carries no multiplier: none of them is the own node of a contact. So u_i = O_i⁻¹ (û_i − Σ_j C_ij u_j),
/// which is T û; A becomes Tᵀ A T, the forces f become Tᵀ f, and contact acts on single nodes again: the change of basis of mortar methods
/// with dual multipliers (B. Flemisch, B. Wohlmuth, Comput. Methods Appl. Mech. Engrg. 196 (2007), section 3).
#[derive(Debug, Clone)]
pub(super) struct Basis {
    dim: usize,
    /// The own node of each contact node.
    pub(super) nodes: Vec<usize>,
    /// O_i, and its inverse.
    own: Vec<Block>,
    back: Vec<Block>,
    /// The j and C_ij.
    others: Vec<Vec<(usize, Block)>>,
    /// Directions of the frames that are held, as bits; their components are prescribed.
    pub(super) held: Vec<u8>,
}

impl Basis {
    /// From the traces (normal first), each p × n with the unknowns of the stiffness matrix.
    pub(super) fn new(stiffness: &NodalMatrix, traces: &[&Matrix]) -> Result<Self, ContactError> {
        let (dim, p, places) = (stiffness.dim(), traces[0].nrows(), stiffness.places());
        let mut blocks: Vec<BTreeMap<usize, Block>> = vec![BTreeMap::new(); p];
        for (d, trace) in traces.iter().enumerate() {
            for (i, k, v) in trace.triplets().filter(|t| t.2 != 0.0) {
                let (node, component) = (places[k] as usize / dim, places[k] as usize % dim);
                blocks[i].entry(node).or_insert(ZERO)[d][component] += v;
            }
        }
        let mut prescribed = vec![true; dim * stiffness.num_nodes()];
        places.iter().for_each(|p| prescribed[*p as usize] = false);
        let refused = |node: usize, what: &'static str| ContactError::NotNodal { node, what };
        let nodes = own_nodes(traces, |k| places[k] as usize / dim, stiffness.num_nodes());
        let nodes = nodes.map_err(|(node, what)| refused(node, what))?;
        let mut basis = Self {
            dim,
            own: Vec::with_capacity(p),
            back: Vec::with_capacity(p),
            others: Vec::with_capacity(p),
            held: Vec::with_capacity(p),
            nodes,
        };
        for (i, mut blocks) in blocks.into_iter().enumerate() {
            let node = basis.nodes[i];
            let mut own = blocks.remove(&node).unwrap_or(ZERO);
            basis
                .held
                .push(complete(dim, &mut own, |k| prescribed[dim * node + k]));
            let (back, oblique) = match blocks.is_empty() {
                true => (
                    is_orthonormal(&own, dim).then(|| transpose(&own)),
                    "vectors that are not orthonormal, or of which components are prescribed",
                ),
                false => (
                    inverse(&own, dim),
                    "the displacements of several nodes, along directions that are not orthogonal",
                ),
            };
            basis.back.push(back.ok_or_else(|| refused(i, oblique))?);
            basis.own.push(own);
            basis.others.push(blocks.into_iter().collect());
        }
        Ok(basis)
    }

    /// Whether contact nodes are coupled with others.
    pub(super) fn is_coupled(&self) -> bool {
        self.others.iter().any(|o| !o.is_empty())
    }

    /// The frames of the contact nodes: O_i.
    pub(super) fn frames(&self) -> &[Block] {
        &self.own
    }

    /// û of displacements u of all nodes, by component.
    pub(super) fn local(&self, u: &mut [f64]) {
        for (i, &node) in self.nodes.iter().enumerate() {
            let mut sum = self.times(&self.own[i], self.at(u, node));
            for (other, block) in &self.others[i] {
                add(&mut sum, self.times(block, self.at(u, *other)), 1.0);
            }
            self.set(u, node, sum);
        }
    }

    /// u of û.
    pub(super) fn nodal(&self, u: &mut [f64]) {
        for (i, &node) in self.nodes.iter().enumerate() {
            let mut rest = self.at(u, node);
            for (other, block) in &self.others[i] {
                add(&mut rest, self.times(block, self.at(u, *other)), -1.0);
            }
            let own = self.times(&self.back[i], rest);
            self.set(u, node, own);
        }
    }

    /// Tᵀ f of forces on all nodes.
    pub(super) fn local_forces(&self, f: &mut [f64]) {
        for (i, &node) in self.nodes.iter().enumerate() {
            let own = self.times_transposed(&self.back[i], self.at(f, node));
            self.set(f, node, own);
            self.move_on(i, own, -1.0, f);
        }
    }

    /// f of Tᵀ f.
    pub(super) fn nodal_forces(&self, f: &mut [f64]) {
        for (i, &node) in self.nodes.iter().enumerate() {
            let local = self.at(f, node);
            self.move_on(i, local, 1.0, f);
            let own = self.times_transposed(&self.own[i], local);
            self.set(f, node, own);
        }
    }

    /// Adds the forces on the other nodes of contact i.
    fn move_on(&self, i: usize, local: [f64; 3], sign: f64, f: &mut [f64]) {
        for (other, block) in &self.others[i] {
            let mut sum = self.at(f, *other);
            add(&mut sum, self.times_transposed(block, local), sign);
            self.set(f, *other, sum);
        }
    }

    /// Tᵀ A T.
    pub(super) fn transform(&self, blocks: &mut NodalBlocks) {
        if !self.is_coupled() {
            match blocks {
                NodalBlocks::Plane(a) => turn(a, &self.nodes, &self.own),
                NodalBlocks::Space(a) => turn(a, &self.nodes, &self.own),
            }
            return;
        }
        match blocks {
            NodalBlocks::Plane(a) => *a = self.product(a),
            NodalBlocks::Space(a) => *a = self.product(a),
        }
    }

    /// A of Tᵀ A T, of nodes that are not coupled.
    pub(super) fn transform_back(&self, blocks: &mut NodalBlocks) {
        match blocks {
            NodalBlocks::Plane(a) => turn(a, &self.nodes, &self.back),
            NodalBlocks::Space(a) => turn(a, &self.nodes, &self.back),
        }
    }

    /// Tᵀ A T with its further blocks.
    fn product<const B: usize>(&self, a: &Symmetric<B>) -> Symmetric<B> {
        let n = a.nrows();
        let narrow =
            |m: &Block| -> [[f64; B]; B] { std::array::from_fn(|r| std::array::from_fn(|c| m[r][c])) };
        // The rows of T at contact nodes.
        let mut rows: Vec<Option<BlockRow<B>>> = vec![None; n];
        for (i, &node) in self.nodes.iter().enumerate() {
            let back = narrow(&self.back[i]);
            let mut row = vec![(node, back)];
            for (other, block) in &self.others[i] {
                row.push((*other, multiplied(&back, &narrow(block)).map(|r| r.map(|v| -v))));
            }
            rows[node] = Some(row);
        }
        let identity: [[f64; B]; B] =
            std::array::from_fn(|r| std::array::from_fn(|c| f64::from(u8::from(r == c))));
        let row_of = |k: usize| rows[k].clone().unwrap_or_else(|| vec![(k, identity)]);
        let mut added: Vec<BTreeMap<usize, [[f64; B]; B]>> = vec![BTreeMap::new(); n];
        let mut add = |x: usize, y: usize, m: &[[f64; B]; B]| {
            let sum = added[x].entry(y).or_insert([[0.0; B]; B]);
            sum.as_flattened_mut()
                .iter_mut()
                .zip(m.as_flattened())
                .for_each(|(s, v)| *s += v);
        };
        for &node in &self.nodes {
            a.each(node, |other, block| {
                // Pairs of two contact nodes are met twice.
                if rows[other].is_some() && other < node {
                    return;
                }
                for (x, left) in row_of(node) {
                    let product = multiplied(&transpose(&left), block);
                    for (y, right) in row_of(other) {
                        let m = multiplied(&product, &right);
                        match node == other {
                            true if x >= y => add(x, y, &m),
                            true => {}
                            false if x > y => add(x, y, &m),
                            false if x < y => add(y, x, &transpose(&m)),
                            // The pair and its mirror image both end in one diagonal block.
                            false => {
                                add(x, x, &m);
                                add(x, x, &transpose(&m));
                            }
                        }
                    }
                }
            });
        }
        let mut lower = Blocks::new(n);
        for (i, mut row) in added.into_iter().enumerate() {
            let (cols, values) = a.lower().row(i);
            for (&j, block) in cols.iter().zip(values) {
                if rows[i].is_none() && rows[j as usize].is_none() {
                    let sum = row.entry(j as usize).or_insert([[0.0; B]; B]);
                    sum.as_flattened_mut()
                        .iter_mut()
                        .zip(block.as_flattened())
                        .for_each(|(s, v)| *s += v);
                }
            }
            for (j, block) in row {
                lower.col.push(j as u32);
                lower.value.push(block);
            }
            lower.start.push(lower.col.len());
        }
        Symmetric::of(lower)
    }

    /// The trace along direction d of the frames, for a number of unknowns at `places`.
    pub(super) fn trace(&self, d: usize, nodes: usize, places: &[u32]) -> Vec<(usize, usize, f64)> {
        let mut unknown = vec![usize::MAX; self.dim * nodes];
        for (k, place) in places.iter().enumerate() {
            unknown[*place as usize] = k;
        }
        let mut entries = Vec::new();
        for (i, (node, own)) in self.nodes.iter().zip(&self.own).enumerate() {
            let others = self.others[i].iter().map(|(j, block)| (*j, block));
            for (node, block) in std::iter::once((*node, own)).chain(others) {
                let moves = |k: &usize| block[d][*k] != 0.0 && unknown[self.dim * node + k] != usize::MAX;
                for k in (0..self.dim).filter(moves) {
                    entries.push((i, unknown[self.dim * node + k], block[d][k]));
                }
            }
        }
        entries
    }

    fn at(&self, v: &[f64], node: usize) -> [f64; 3] {
        std::array::from_fn(|d| if d < self.dim { v[self.dim * node + d] } else { 0.0 })
    }

    fn set(&self, v: &mut [f64], node: usize, value: [f64; 3]) {
        v[self.dim * node..self.dim * (node + 1)].copy_from_slice(&value[..self.dim]);
    }

    fn times(&self, m: &Block, v: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|r| (0..self.dim).map(|k| m[r][k] * v[k]).sum())
    }

    fn times_transposed(&self, m: &Block, v: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|r| (0..self.dim).map(|k| m[k][r] * v[k]).sum())
    }
}

fn add(sum: &mut [f64; 3], v: [f64; 3], factor: f64) {
    sum.iter_mut().zip(v).for_each(|(s, v)| *s += factor * v);
}

fn multiplied<const B: usize>(a: &[[f64; B]; B], b: &[[f64; B]; B]) -> [[f64; B]; B] {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..B).map(|k| a[r][k] * b[k][c]).sum()))
}

fn transpose<const B: usize>(m: &[[f64; B]; B]) -> [[f64; B]; B] {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

fn is_orthonormal(frame: &Block, dim: usize) -> bool {
    (0..dim * dim).all(|e| {
        let (i, j) = (e / dim, e % dim);
        let product: f64 = (0..dim).map(|d| frame[i][d] * frame[j][d]).sum();
        (product - f64::from(u8::from(i == j))).abs() <= CHECKED
    })
}

/// The inverse of a block with orthogonal rows; `None` for others.
fn inverse(own: &Block, dim: usize) -> Option<Block> {
    let product = |i: usize, j: usize| (0..dim).map(|d| own[i][d] * own[j][d]).sum::<f64>();
    let mut back = ZERO;
    for i in 0..dim {
        let square = product(i, i);
        if square == 0.0 || (0..dim).any(|j| j != i && product(i, j).abs() > CHECKED * square) {
            return None;
        }
        (0..dim).for_each(|d| back[d][i] = own[i][d] / square);
    }
    Some(back)
}

/// Completes a frame whose tangents of zeros are held: by directions along which only prescribed components move. Returns these as
/// bits. Frames that cannot be completed so are left as they are.
fn complete(dim: usize, frame: &mut Block, prescribed: impl Fn(usize) -> bool) -> u8 {
    let empty = |row: &[f64; 3]| row.iter().all(|v| *v == 0.0);
    let mut held = 0;
    for d in (1..dim).filter(|&d| empty(&frame[d])).collect::<Vec<_>>() {
        let mut row = [0.0; 3];
        // The first prescribed component orthogonal to the other directions.
        let Some(k) = (0..dim).find(|&k| prescribed(k) && frame.iter().all(|f| f[k].abs() <= CHECKED)) else {
            continue;
        };
        row[k] = 1.0;
        frame[d] = row;
        held |= 1 << d;
    }
    held
}

/// A ← Q A Qᵀ with Q the frames at the given nodes.
fn turn<const B: usize>(a: &mut Symmetric<B>, nodes: &[usize], frames: &[Block]) {
    for (&node, frame) in nodes.iter().zip(frames) {
        let places: Vec<_> = a.places(node).collect();
        for (other, k) in places {
            let block = &mut a.values_mut()[k];
            let old = *block;
            if other <= node {
                *block = std::array::from_fn(|r| {
                    std::array::from_fn(|c| (0..B).map(|d| frame[r][d] * old[d][c]).sum())
                });
            }
            let old = *block;
            if other >= node {
                *block = std::array::from_fn(|r| {
                    std::array::from_fn(|c| (0..B).map(|d| old[r][d] * frame[c][d]).sum())
                });
            }
        }
    }
}
