//! Smoothed prolongators and the coarse matrices that they make.

use super::aggregates::Aggregates;
use super::dense::{add_scaled_product, add_transposed_product, mask_rows};
use crate::sparse::{Blocks, add_product, subtract_transposed};

/// Columns of near-kernel vectors on an aggregate that are this much shorter once the others are taken off do not count.
const DEPENDENT: f64 = 1e-6;

/// Near-kernel vectors of the nodes of a level, a row each component.
pub(super) type Modes<const R: usize, const K: usize> = Vec<[[f64; K]; R]>;

/// What is known of the unknowns of a level beside its matrix: components that are held at zero, and what is added to diagonal
/// blocks.
pub(super) trait Constraints<const R: usize> {
    fn held(&self, node: usize) -> u8;
    fn added(&self, node: usize) -> Option<&[[f64; R]; R]>;
    fn inverse(&self, node: usize) -> &[[f64; R]; R];
}

/// A prolongation P = (I − ω D⁻¹ A) T from aggregates, with T orthonormal on each and K columns each.
#[derive(Debug, Clone)]
pub(super) struct Transfer<const R: usize, const K: usize> {
    pub(super) p: Blocks<R, K>,
    /// Rows of P with a block in a column, and the places of those blocks.
    first: Vec<u32>,
    rows: Vec<(u32, u32)>,
    aggregate: Vec<u32>,
    /// The inverse triangular factors with T = modes · inverse.
    triangular: Vec<[[f64; K]; K]>,
    omega: f64,
    scratch: Scratch<R, K>,
}

/// Positions of columns in the row at hand, and its blocks.
#[derive(Debug, Clone)]
struct Scratch<const R: usize, const K: usize> {
    fine: Vec<u32>,
    coarse: Vec<u32>,
    left_cols: Vec<u32>,
    left: Vec<[[f64; K]; R]>,
    cols: Vec<u32>,
    sums: Vec<[[f64; K]; K]>,
    raw: Vec<[[f64; K]; R]>,
}

const NONE: u32 = u32::MAX;

impl<const R: usize, const K: usize> Transfer<R, K> {
    /// The prolongation and the near-kernel vectors of the coarse level.
    pub(super) fn new(
        a: &Blocks<R, R>,
        modes: &Modes<R, K>,
        aggregates: Aggregates,
        omega: f64,
        constraints: &impl Constraints<R>,
    ) -> (Self, Modes<K, K>) {
        let n = a.nrows();
        let (coarse, triangular) = orthonormal(modes, &aggregates);
        let mut transfer = Self {
            p: Blocks::new(aggregates.count),
            first: Vec::new(),
            rows: Vec::new(),
            omega,
            scratch: Scratch {
                fine: vec![NONE; n],
                coarse: vec![NONE; aggregates.count],
                left_cols: Vec::new(),
                left: Vec::new(),
                cols: Vec::new(),
                sums: Vec::new(),
                raw: Vec::new(),
            },
            triangular,
            aggregate: aggregates.of,
        };
        for i in 0..n {
            transfer.smooth_row(a, modes, constraints, i);
            let s = &mut transfer.scratch;
            let mut order: Vec<usize> = (0..s.cols.len()).collect();
            order.sort_unstable_by_key(|&k| s.cols[k]);
            transfer.p.col.extend(order.iter().map(|&k| s.cols[k]));
            transfer.p.value.extend(order.iter().map(|&k| s.raw[k]));
            transfer.p.start.push(transfer.p.col.len());
        }
        transfer.p.col.shrink_to_fit();
        transfer.p.value.shrink_to_fit();
        transfer.transpose();
        (transfer, coarse)
    }

    fn transpose(&mut self) {
        let p = &self.p;
        let mut first = vec![0u32; p.ncols + 1];
        p.col.iter().for_each(|c| first[*c as usize + 1] += 1);
        for c in 0..p.ncols {
            first[c + 1] += first[c];
        }
        let mut next = first.clone();
        let mut rows = vec![(0, 0); p.col.len()];
        for i in 0..p.nrows() {
            for k in p.start[i]..p.start[i + 1] {
                let place = &mut next[p.col[k] as usize];
                rows[*place as usize] = (i as u32, k as u32);
                *place += 1;
            }
        }
        (self.first, self.rows) = (first, rows);
    }

    /// T of a node.
    fn tentative(&self, modes: &Modes<R, K>, node: usize, held: u8) -> [[f64; K]; R] {
        let mut t = [[0.0; K]; R];
        let factor = &self.triangular[self.aggregate[node] as usize];
        add_scaled_product(1.0, &modes[node], factor, &mut t);
        mask_rows(&mut t, held);
        t
    }

    /// Row i of P into the scratch: columns in order of appearance.
    fn smooth_row(
        &mut self,
        a: &Blocks<R, R>,
        modes: &Modes<R, K>,
        constraints: &impl Constraints<R>,
        i: usize,
    ) {
        let mut s = std::mem::replace(&mut self.scratch, Scratch::empty());
        s.cols.clear();
        s.left.clear();
        let (cols, values) = a.row(i);
        for (&j, block) in cols.iter().zip(values) {
            let t = self.tentative(modes, j as usize, constraints.held(j as usize));
            let at = s.place(self.aggregate[j as usize]);
            add_scaled_product(1.0, block, &t, &mut s.left[at]);
        }
        let own = self.tentative(modes, i, constraints.held(i));
        let at = s.place(self.aggregate[i]);
        if let Some(added) = constraints.added(i) {
            add_scaled_product(1.0, added, &own, &mut s.left[at]);
        }
        s.raw.clear();
        for (k, sum) in s.left.iter().enumerate() {
            let mut row = if k == at { own } else { [[0.0; K]; R] };
            add_scaled_product(-self.omega, constraints.inverse(i), sum, &mut row);
            s.raw.push(row);
        }
        for c in &s.cols {
            s.coarse[*c as usize] = NONE;
        }
        self.scratch = s;
    }

    /// Smooths rows of P anew; their patterns stay.
    pub(super) fn resmooth(
        &mut self,
        a: &Blocks<R, R>,
        modes: &Modes<R, K>,
        constraints: &impl Constraints<R>,
        rows: &[u32],
    ) {
        for &i in rows {
            self.smooth_row(a, modes, constraints, i as usize);
            for k in 0..self.scratch.cols.len() {
                if let Some(slot) = self.p.slot(i as usize, self.scratch.cols[k] as usize) {
                    self.p.value[slot] = self.scratch.raw[k];
                }
            }
        }
    }

    /// Row c of Pᵀ A P into the scratch.
    fn galerkin_row(&mut self, a: &Blocks<R, R>, constraints: &impl Constraints<R>, c: usize) {
        let s = &mut self.scratch;
        s.left_cols.clear();
        s.left.clear();
        for &(i, slot) in &self.rows[self.first[c] as usize..self.first[c + 1] as usize] {
            let p = &self.p.value[slot as usize];
            let (cols, values) = a.row(i as usize);
            for (&j, block) in cols.iter().zip(values) {
                let mut at = s.fine[j as usize];
                if at == NONE {
                    at = s.left.len() as u32;
                    s.fine[j as usize] = at;
                    s.left_cols.push(j);
                    s.left.push([[0.0; K]; R]);
                }
                add_transposed_product(block, p, &mut s.left[at as usize]);
            }
            if let Some(added) = constraints.added(i as usize)
                && s.fine[i as usize] != NONE
            {
                add_transposed_product(added, p, &mut s.left[s.fine[i as usize] as usize]);
            }
        }
        s.cols.clear();
        s.sums.clear();
        for (j, left) in s.left_cols.iter().zip(&s.left) {
            s.fine[*j as usize] = NONE;
            let (cols, values) = self.p.row(*j as usize);
            for (&k, block) in cols.iter().zip(values) {
                let mut at = s.coarse[k as usize];
                if at == NONE {
                    at = s.sums.len() as u32;
                    s.coarse[k as usize] = at;
                    s.cols.push(k);
                    s.sums.push([[0.0; K]; K]);
                }
                add_transposed_product(left, block, &mut s.sums[at as usize]);
            }
        }
        s.cols.iter().for_each(|k| s.coarse[*k as usize] = NONE);
    }

    /// Pᵀ A P.
    pub(super) fn galerkin(&mut self, a: &Blocks<R, R>, constraints: &impl Constraints<R>) -> Blocks<K, K> {
        let mut c = Blocks::new(self.p.ncols);
        let mut order: Vec<usize> = Vec::new();
        for row in 0..self.p.ncols {
            self.galerkin_row(a, constraints, row);
            let s = &self.scratch;
            order.clear();
            order.extend(0..s.cols.len());
            order.sort_unstable_by_key(|&k| s.cols[k]);
            c.col.extend(order.iter().map(|&k| s.cols[k]));
            c.value.extend(order.iter().map(|&k| s.sums[k]));
            c.start.push(c.col.len());
        }
        c
    }

    /// Sums rows of Pᵀ A P anew, over the pattern it has.
    pub(super) fn resum(
        &mut self,
        a: &Blocks<R, R>,
        constraints: &impl Constraints<R>,
        rows: &[u32],
        c: &mut Blocks<K, K>,
    ) {
        for &row in rows {
            self.galerkin_row(a, constraints, row as usize);
            for k in 0..self.scratch.cols.len() {
                if let Some(slot) = c.slot(row as usize, self.scratch.cols[k] as usize) {
                    c.value[slot] = self.scratch.sums[k];
                }
            }
        }
        // Rows that are not summed anew change in these columns.
        for &row in rows {
            for k in c.start[row as usize]..c.start[row as usize + 1] {
                let block = c.value[k];
                if let Some(mirror) = c.slot(c.col[k] as usize, row as usize) {
                    c.value[mirror] = std::array::from_fn(|i| std::array::from_fn(|j| block[j][i]));
                }
            }
        }
    }

    /// y ← Pᵀ x.
    pub(super) fn restrict(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        let y = y.as_chunks_mut::<K>().0;
        for (i, x) in x.as_chunks::<R>().0.iter().enumerate() {
            let x = x.map(|v| -v);
            let (cols, values) = self.p.row(i);
            for (&k, block) in cols.iter().zip(values) {
                subtract_transposed(block, &x, &mut y[k as usize]);
            }
        }
    }

    /// x ← x + P y.
    pub(super) fn prolong(&self, y: &[f64], x: &mut [f64]) {
        let y = y.as_chunks::<K>().0;
        for (i, x) in x.as_chunks_mut::<R>().0.iter_mut().enumerate() {
            let (cols, values) = self.p.row(i);
            for (&k, block) in cols.iter().zip(values) {
                add_product(block, &y[k as usize], x);
            }
        }
    }
}

impl<const R: usize, const K: usize> Scratch<R, K> {
    fn empty() -> Self {
        Self {
            fine: Vec::new(),
            coarse: Vec::new(),
            left_cols: Vec::new(),
            left: Vec::new(),
            cols: Vec::new(),
            sums: Vec::new(),
            raw: Vec::new(),
        }
    }

    /// Position of a coarse column in the row at hand.
    fn place(&mut self, c: u32) -> usize {
        let known = self.coarse[c as usize];
        if known != NONE {
            return known as usize;
        }
        self.coarse[c as usize] = self.cols.len() as u32;
        self.cols.push(c);
        self.left.push([[0.0; K]; R]);
        self.cols.len() - 1
    }
}

/// For each aggregate the triangular factor of its near-kernel vectors, modes = T · factor with orthonormal T, and the inverse of it.
/// Columns that depend on those before them are left out: zero in T.
fn orthonormal<const R: usize, const K: usize>(
    modes: &Modes<R, K>,
    aggregates: &Aggregates,
) -> (Modes<K, K>, Vec<[[f64; K]; K]>) {
    let count = aggregates.count;
    let mut first = vec![0u32; count + 1];
    aggregates.of.iter().for_each(|k| first[*k as usize + 1] += 1);
    for k in 0..count {
        first[k + 1] += first[k];
    }
    let mut members = vec![0u32; modes.len()];
    let mut next = first.clone();
    for (i, k) in aggregates.of.iter().enumerate() {
        members[next[*k as usize] as usize] = i as u32;
        next[*k as usize] += 1;
    }
    let (mut factors, mut inverses) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut rows: Vec<[f64; K]> = Vec::new();
    for k in 0..count {
        rows.clear();
        for &i in &members[first[k] as usize..first[k + 1] as usize] {
            rows.extend_from_slice(&modes[i as usize]);
        }
        let factor = triangularise(&mut rows);
        inverses.push(triangular_inverse(&factor));
        factors.push(factor);
    }
    (factors, inverses)
}

/// Modified Gram–Schmidt: the columns become orthonormal, the factor is upper triangular; its diagonal is 0 where a column is left out.
fn triangularise<const K: usize>(rows: &mut [[f64; K]]) -> [[f64; K]; K] {
    let mut factor = [[0.0; K]; K];
    for c in 0..K {
        let before: f64 = rows.iter().map(|r| r[c] * r[c]).sum::<f64>().sqrt();
        for b in 0..c {
            if factor[b][b] == 0.0 {
                continue;
            }
            let s: f64 = rows.iter().map(|r| r[b] * r[c]).sum();
            factor[b][c] = s;
            rows.iter_mut().for_each(|r| r[c] -= s * r[b]);
        }
        let left: f64 = rows.iter().map(|r| r[c] * r[c]).sum::<f64>().sqrt();
        if left > DEPENDENT * before {
            factor[c][c] = left;
            rows.iter_mut().for_each(|r| r[c] /= left);
        }
    }
    factor
}

/// The inverse of an upper triangular matrix; columns whose diagonal is 0 are 0.
fn triangular_inverse<const K: usize>(factor: &[[f64; K]; K]) -> [[f64; K]; K] {
    let mut inverse = [[0.0; K]; K];
    for c in (0..K).filter(|&c| factor[c][c] != 0.0) {
        inverse[c][c] = 1.0 / factor[c][c];
        for r in (0..c).rev().filter(|&r| factor[r][r] != 0.0) {
            let s: f64 = (r + 1..=c).map(|k| factor[r][k] * inverse[k][c]).sum();
            inverse[r][c] = -s / factor[r][r];
        }
    }
    inverse
}
