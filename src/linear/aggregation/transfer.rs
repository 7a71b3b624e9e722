//! Smoothed prolongators and the coarse matrices that they make.

use super::aggregates::{Aggregates, NONE};
use super::dense::{add_scaled_product, add_transposed_product, mask_rows};
use crate::clock::Until;
use crate::parallel;
use crate::sparse::{Blocks, Entry, MOST_PARTS, ROWS, Symmetric, add_product, add_transposed, wide};
use crate::tolerances::SIX_DIGITS;

/// Near-kernel vectors of the nodes of a level, a row each component.
pub(super) type Modes<const R: usize, const K: usize> = Vec<[[f32; K]; R]>;

/// Data on the unknowns of a level beside its matrix: components that are fixed at zero, and additions to diagonal blocks.
pub(super) trait Constraints<const R: usize>: Sync {
    fn constrained(&self, node: usize) -> u8;
    fn added(&self, node: usize) -> Option<&[[f64; R]; R]>;
    fn inverse(&self, node: usize) -> [[f64; R]; R];
}

/// A prolongation P = (I − ω D⁻¹ A) T from aggregates, with T orthonormal on each and K columns each, rounded to single precision. Coarse
/// matrices are `unit` Pᵀ A P, and coarse solutions count `unit` times.
#[derive(Debug, Clone)]
pub(super) struct Transfer<const R: usize, const K: usize> {
    pub(super) p: Blocks<R, K, f32>,
    /// A power of two.
    unit: f64,
    /// Rows of P with a block in a column, and the places of those blocks.
    first: Vec<u32>,
    rows: Vec<(u32, u32)>,
    aggregate: Vec<u32>,
    /// The inverse triangular factors with T = modes · inverse.
    triangular: Vec<[[f64; K]; K]>,
    pub(super) omega: f64,
    sums: Sums<K>,
    /// Once it has passed rows are left out.
    pub(super) until: Until,
}

/// Sums of Pᵀ x over parts of the rows of P.
#[derive(Debug, Clone)]
struct Sums<const K: usize> {
    /// The first row of each part, and the end.
    rows: Vec<usize>,
    /// Columns with blocks in the part: the first one, and where their sums are.
    columns: Vec<usize>,
    ends: Vec<usize>,
    values: Vec<[f32; K]>,
}

/// Blocks of a row in order of appearance, and the positions of columns among them.
struct Row<const R: usize, const K: usize> {
    position: Vec<u32>,
    cols: Vec<u32>,
    blocks: Vec<[[f64; K]; R]>,
    order: Vec<usize>,
}

/// Parts into which rows are cut while matrices are made, each with its own buffers: at most this many, of one row at least.
const LEAST_ROWS: usize = 64;

fn part_size(rows: usize) -> usize {
    rows.div_ceil(MOST_PARTS).max(LEAST_ROWS)
}

impl<const R: usize, const K: usize> Transfer<R, K> {
    /// The prolongation and the near-kernel vectors of the coarse level.
    pub(super) fn new(
        level: (&Symmetric<R>, &Modes<R, K>),
        aggregates: Aggregates,
        (omega, unit): (f64, f64),
        constraints: &impl Constraints<R>,
        until: Until,
    ) -> (Self, Modes<K, K>) {
        let (a, modes) = level;
        let n = a.nrows();
        let (coarse, triangular) = orthonormal(modes, &aggregates);
        let mut transfer = Self {
            p: Blocks::new(aggregates.count),
            unit,
            first: Vec::new(),
            rows: Vec::new(),
            omega,
            triangular,
            aggregate: aggregates.of,
            sums: Sums {
                rows: Vec::new(),
                columns: Vec::new(),
                ends: Vec::new(),
                values: Vec::new(),
            },
            until,
        };
        transfer.p = joined(parallel::collect(n, part_size(n), |rows| {
            transfer.smoothed(a, modes, constraints, rows)
        }));
        transfer.transpose();
        transfer.sums = Sums::new(&transfer.p);
        (transfer, coarse)
    }

    #[cfg(test)]
    pub(super) fn unit(&self) -> f64 {
        self.unit
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
    fn tentative(&self, modes: &Modes<R, K>, node: usize, constrained: u8) -> [[f64; K]; R] {
        let mut t = [[0.0; K]; R];
        let factor = &self.triangular[self.aggregate[node] as usize];
        add_scaled_product(1.0, &wide(&modes[node]), factor, &mut t);
        mask_rows(&mut t, constrained);
        t
    }

    /// Rows of P.
    fn smoothed(
        &self,
        a: &Symmetric<R>,
        modes: &Modes<R, K>,
        constraints: &impl Constraints<R>,
        rows: impl Iterator<Item = usize>,
    ) -> Blocks<R, K, f32> {
        let count = self.triangular.len();
        let (mut out, mut row) = (Blocks::new(count), Row::<R, K>::new(count));
        for i in rows.take_while(|_| !self.until.is_over()) {
            a.each(i, |j, block| {
                let t = self.tentative(modes, j, constraints.constrained(j));
                add_scaled_product(1.0, block, &t, row.at(self.aggregate[j]));
            });
            let own = self.tentative(modes, i, constraints.constrained(i));
            let sum = row.at(self.aggregate[i]);
            if let Some(added) = constraints.added(i) {
                add_scaled_product(1.0, added, &own, sum);
            }
            let at = row.position[self.aggregate[i] as usize] as usize;
            for (k, sum) in row.blocks.iter_mut().enumerate() {
                let mut smooth = if k == at { own } else { [[0.0; K]; R] };
                add_scaled_product(-self.omega, &constraints.inverse(i), sum, &mut smooth);
                *sum = smooth;
            }
            row.end(&mut out);
        }
        out
    }

    /// Smooths rows of P again; their patterns stay.
    pub(super) fn resmooth(
        &mut self,
        a: &Symmetric<R>,
        modes: &Modes<R, K>,
        constraints: &impl Constraints<R>,
        rows: &[u32],
    ) {
        let found = parallel::collect(rows.len(), part_size(rows.len()), |part| {
            self.smoothed(a, modes, constraints, rows[part].iter().map(|i| *i as usize))
        });
        if self.until.is_over() {
            return;
        }
        for (&i, (cols, values)) in rows.iter().zip(all_rows(&found)) {
            for (&j, block) in cols.iter().zip(values) {
                if let Some(slot) = self.p.slot(i as usize, j as usize) {
                    self.p.value[slot] = *block;
                }
            }
        }
    }

    /// Rows of Pᵀ A P, up to the diagonal or complete.
    fn summed<S: Entry>(
        &self,
        a: &Symmetric<R, S>,
        constraints: &impl Constraints<R>,
        rows: impl Iterator<Item = usize>,
        complete: bool,
    ) -> Blocks<K, K> {
        let (mut left, mut row) = (Row::<R, K>::new(self.p.nrows()), Row::<K, K>::new(self.p.ncols));
        let mut out = Blocks::new(self.p.ncols);
        for c in rows.take_while(|_| !self.until.is_over()) {
            for &(i, slot) in &self.rows[self.first[c] as usize..self.first[c + 1] as usize] {
                let p = wide(&self.p.value[slot as usize]);
                a.each(i as usize, |j, block| {
                    add_transposed_product(block, &p, left.at(j as u32))
                });
                if let Some(added) = constraints.added(i as usize) {
                    add_transposed_product(added, &p, left.at(i));
                }
            }
            let end = if complete { NONE } else { c as u32 };
            for (j, left) in left.cols.iter().zip(&left.blocks) {
                let mut scaled = *left;
                scaled.as_flattened_mut().iter_mut().for_each(|v| *v *= self.unit);
                let (cols, values) = self.p.row(*j as usize);
                for (&k, block) in cols.iter().zip(values).take_while(|(k, _)| **k <= end) {
                    add_transposed_product(&scaled, &wide(block), row.at(k));
                }
            }
            left.clear();
            row.end(&mut out);
        }
        out
    }

    /// Pᵀ A P.
    pub(super) fn galerkin<S: Entry>(
        &self,
        a: &Symmetric<R, S>,
        constraints: &impl Constraints<R>,
    ) -> Symmetric<K> {
        let n = self.p.ncols;
        Symmetric::of(joined(parallel::collect(n, part_size(n), |rows| {
            self.summed(a, constraints, rows, false)
        })))
    }

    /// Sums rows and columns of Pᵀ A P again, over the same pattern.
    pub(super) fn resum<S: Entry, C: Entry>(
        &self,
        a: &Symmetric<R, S>,
        constraints: &impl Constraints<R>,
        rows: &[u32],
        c: &mut Symmetric<K, C>,
    ) {
        let found = parallel::collect(rows.len(), part_size(rows.len()), |part| {
            self.summed(a, constraints, rows[part].iter().map(|i| *i as usize), true)
        });
        if self.until.is_over() {
            return;
        }
        for (&i, (cols, values)) in rows.iter().zip(all_rows(&found)) {
            for (&j, block) in cols.iter().zip(values) {
                c.set(i as usize, j as usize, block);
            }
        }
    }

    /// y ← Pᵀ x.
    pub(super) fn restrict<S: Entry>(&mut self, x: &[S], y: &mut [f32]) {
        let (p, sums, x) = (&self.p, &mut self.sums, x.as_chunks::<R>().0);
        parallel::spans(&sums.ends, &mut sums.values, &|part, values| {
            values.fill([0.0; K]);
            for i in sums.rows[part]..sums.rows[part + 1] {
                let x = x[i].map(|v| v.wide() as f32);
                let (cols, blocks) = p.row(i);
                for (&c, block) in cols.iter().zip(blocks) {
                    add_transposed(block, &x, &mut values[c as usize - sums.columns[part]]);
                }
            }
        });
        y.fill(0.0);
        let y = y.as_chunks_mut::<K>().0;
        for (first, span) in sums.columns.iter().zip(sums.ends.windows(2)) {
            for (y, sum) in y[*first..].iter_mut().zip(&sums.values[span[0]..span[1]]) {
                y.iter_mut().zip(sum).for_each(|(y, s)| *y += s);
            }
        }
    }

    /// x ← x + unit P y.
    pub(super) fn prolong<S: Entry>(&self, y: &[f32], x: &mut [S]) {
        let y = y.as_chunks::<K>().0;
        parallel::parts(x.as_chunks_mut::<R>().0, ROWS, &|first, x| {
            for (i, x) in (first..).zip(x) {
                let (cols, blocks) = self.p.row(i);
                let mut sum = [0.0; R];
                for (&c, block) in cols.iter().zip(blocks) {
                    add_product(block, &y[c as usize], &mut sum);
                }
                x.iter_mut()
                    .zip(sum)
                    .for_each(|(x, s)| *x += S::narrow(self.unit * f64::from(s)));
            }
        });
    }
}

impl<const K: usize> Sums<K> {
    fn new<const R: usize>(p: &Blocks<R, K, f32>) -> Self {
        let size = p.nrows().div_ceil(MOST_PARTS).max(ROWS);
        let mut rows: Vec<usize> = (0..p.nrows()).step_by(size).collect();
        rows.push(p.nrows());
        let (mut columns, mut ends) = (Vec::new(), vec![0]);
        for part in rows.windows(2) {
            let cols = &p.col[p.start[part[0]]..p.start[part[1]]];
            let first = cols.iter().min().map_or(0, |c| *c as usize);
            let last = cols.iter().max().map_or(0, |c| *c as usize + 1);
            columns.push(first);
            ends.push(ends[ends.len() - 1] + last - first);
        }
        Self {
            values: vec![[0.0; K]; ends[ends.len() - 1]],
            rows,
            columns,
            ends,
        }
    }
}

impl<const R: usize, const K: usize> Row<R, K> {
    fn new(columns: usize) -> Self {
        Self {
            position: vec![NONE; columns],
            cols: Vec::new(),
            blocks: Vec::new(),
            order: Vec::new(),
        }
    }

    /// The block in a column, zero if it is new.
    #[inline(always)]
    fn at(&mut self, col: u32) -> &mut [[f64; K]; R] {
        let place = &mut self.position[col as usize];
        if *place == NONE {
            *place = self.cols.len() as u32;
            self.cols.push(col);
            self.blocks.push([[0.0; K]; R]);
        }
        &mut self.blocks[*place as usize]
    }

    fn clear(&mut self) {
        self.cols.iter().for_each(|c| self.position[*c as usize] = NONE);
        self.cols.clear();
        self.blocks.clear();
    }

    /// Appends the row, by columns, and begins another one.
    fn end<S: Entry>(&mut self, out: &mut Blocks<R, K, S>) {
        self.order.clear();
        self.order.extend(0..self.cols.len());
        self.order.sort_unstable_by_key(|&k| self.cols[k]);
        out.col.extend(self.order.iter().map(|&k| self.cols[k]));
        let round = |k: &usize| self.blocks[*k].map(|row| row.map(S::narrow));
        out.value.extend(self.order.iter().map(round));
        out.start.push(out.col.len());
        self.clear();
    }
}

/// The rows of all parts, one part after another.
fn joined<const R: usize, const K: usize, S: Entry>(parts: Vec<Blocks<R, K, S>>) -> Blocks<R, K, S> {
    let mut all = Blocks::new(parts.first().map_or(0, |p| p.ncols));
    let count = parts.iter().map(|p| p.col.len()).sum();
    all.start.reserve_exact(parts.iter().map(Blocks::nrows).sum());
    all.col.reserve_exact(count);
    all.value.reserve_exact(count);
    for part in parts {
        let before = all.col.len();
        all.start.extend(part.start[1..].iter().map(|k| before + k));
        all.col.extend(part.col);
        all.value.extend(part.value);
    }
    all
}

/// The rows of all parts.
fn all_rows<const R: usize, const K: usize, S: Entry>(
    parts: &[Blocks<R, K, S>],
) -> impl Iterator<Item = (&[u32], &[[[S; K]; R]])> {
    parts
        .iter()
        .flat_map(|part| (0..part.nrows()).map(|k| part.row(k)))
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
    let found = parallel::collect(count, part_size(count), |part| {
        let mut rows: Vec<[f64; K]> = Vec::new();
        let mut factor = |k: usize| {
            rows.clear();
            for &i in &members[first[k] as usize..first[k + 1] as usize] {
                rows.extend_from_slice(&wide(&modes[i as usize]));
            }
            triangularise(&mut rows)
        };
        part.map(&mut factor).collect::<Vec<_>>()
    });
    let factors = found.concat();
    let inverses = factors.iter().map(triangular_inverse).collect();
    let single = |factor: &[[f64; K]; K]| factor.map(|row| row.map(|v| v as f32));
    (factors.iter().map(single).collect(), inverses)
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
        // Columns that depend on the others do not count.
        if left > SIX_DIGITS * before {
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
