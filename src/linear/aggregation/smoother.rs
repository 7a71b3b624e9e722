//! Block Gauss–Seidel sweeps, and the direct solve at the bottom.

use std::ops::Range;

use super::dense::semi_inverse;
use super::transfer::Constraints;
use crate::clock::Until;
use crate::linear::{Cholesky, LinearError, LinearSolver};
use crate::parallel;
use crate::sparse::{Blocks, Matrix, Pattern, ROWS, add_product, subtract_transposed};

/// Entries of a matrix for which a thread pays off.
const GRAIN: usize = 1 << 18;

/// Sweeps over a symmetric matrix, and the vectors of its level.
///
/// Rows are relaxed strip by strip, first those of even numbers, then the odd ones (backward the other way round): a strip is coupled
/// to the two beside it alone, so that strips of one colour are relaxed at the same time, and the sweep is Gauss–Seidel's in another order.
#[derive(Debug, Clone)]
pub(super) struct Smoother<const B: usize> {
    /// Inverse diagonal blocks; zero rows and columns in fixed components.
    pub(super) inverse: Vec<[[f64; B]; B]>,
    pub(super) x: Vec<f64>,
    pub(super) b: Vec<f64>,
    pub(super) r: Vec<f64>,
    /// The first row of each strip, and the end.
    strips: Vec<usize>,
    /// The changes that a strip makes to the residuals of the rows beside it, the first of these rows, and their position here.
    halo: Vec<[f64; B]>,
    halo_first: Vec<usize>,
    halo_ends: Vec<usize>,
    /// Once it has passed strips are left as they are.
    pub(super) until: Until,
}

impl<const B: usize> Smoother<B> {
    pub(super) fn new(a: &Blocks<B, B>, constrained: impl Fn(usize) -> u8 + Sync) -> Self {
        let n = a.nrows();
        let mut inverse = vec![[[0.0; B]; B]; n];
        parallel::parts(&mut inverse, ROWS, &|first, part| {
            for (i, inverse) in (first..).zip(part) {
                *inverse = inverse_block(a, i, constrained(i), None);
            }
        });
        let strips = strips(a);
        let (mut halo_first, mut halo_ends) = (Vec::new(), vec![0]);
        for strip in strips.windows(2) {
            let rows = || (strip[0]..strip[1]).map(|i| a.row(i).0);
            let low = rows().filter_map(|cols| cols.first()).min();
            let high = rows().filter_map(|cols| cols.last()).max();
            let low = low.map_or(strip[0], |j| strip[0].min(*j as usize));
            let high = high.map_or(strip[1], |j| strip[1].max(*j as usize + 1));
            halo_first.push(low);
            halo_ends.push(halo_ends[halo_ends.len() - 1] + (strip[0] - low) + (high - strip[1]));
        }
        Self {
            inverse,
            x: vec![0.0; B * n],
            b: vec![0.0; B * n],
            r: vec![0.0; B * n],
            halo: vec![[0.0; B]; halo_ends[halo_ends.len() - 1]],
            strips,
            halo_first,
            halo_ends,
            until: Until::default(),
        }
    }

    pub(super) fn invert(
        &mut self,
        a: &Blocks<B, B>,
        node: usize,
        constrained: u8,
        added: Option<&[[f64; B]; B]>,
    ) {
        self.inverse[node] = inverse_block(a, node, constrained, added);
    }

    fn run(&mut self, a: &Blocks<B, B>, sweep: Sweep) {
        let all = Relaxation {
            a,
            inverse: &self.inverse,
            b: self.b.as_chunks::<B>().0,
            strips: &self.strips,
            halos: &self.halo_ends,
            halo_first: &self.halo_first,
            sweep,
            until: self.until,
        };
        let count = self.strips.len() - 1;
        let first = usize::from(count > 1 && sweep == Sweep::Backward);
        for (colour, last) in [(first, false), (1 - first, true)] {
            let whole = Part {
                strips: 0..count,
                before: &[],
                x: self.x.as_chunks_mut().0,
                after: &[],
                r: self.r.as_chunks_mut().0,
                halo: &mut self.halo,
            };
            all.colour(colour, last, whole);
        }
        // Changes by strips of the second colour to the rows beside them.
        let r = self.r.as_chunks_mut::<B>().0;
        for k in (1 - first..count).step_by(2) {
            let halo = &self.halo[self.halo_ends[k]..self.halo_ends[k + 1]];
            let (before, after) = halo.split_at(self.strips[k] - self.halo_first[k]);
            let rows = self.halo_first[k]..self.strips[k];
            for (r, h) in r[rows].iter_mut().zip(before) {
                r.iter_mut().zip(h).for_each(|(r, h)| *r += h);
            }
            for (r, h) in r[self.strips[k + 1]..].iter_mut().zip(after) {
                r.iter_mut().zip(h).for_each(|(r, h)| *r += h);
            }
        }
    }

    #[cfg(test)]
    pub(super) fn num_strips(&self) -> usize {
        self.strips.len() - 1
    }

    /// Before the coarse correction: x from zero, r its residual. Sweeps go forward and backward by turns.
    pub(super) fn smooth_before(&mut self, a: &Blocks<B, B>, sweeps: usize) {
        self.run(a, Sweep::FromZero);
        for k in 1..sweeps {
            self.run(
                a,
                if k % 2 == 1 {
                    Sweep::Backward
                } else {
                    Sweep::Forward
                },
            );
        }
    }

    /// After it, in reverse: the cycle stays symmetric.
    pub(super) fn smooth_after(&mut self, a: &Blocks<B, B>, sweeps: usize) {
        for k in (0..sweeps).rev() {
            self.run(
                a,
                if k % 2 == 0 {
                    Sweep::Backward
                } else {
                    Sweep::Forward
                },
            );
        }
    }
}

fn inverse_block<const B: usize>(
    a: &Blocks<B, B>,
    node: usize,
    constrained: u8,
    added: Option<&[[f64; B]; B]>,
) -> [[f64; B]; B] {
    let mut block = a.slot(node, node).map_or([[0.0; B]; B], |k| a.value[k]);
    if let Some(added) = added {
        for (row, more) in block.iter_mut().zip(added) {
            row.iter_mut().zip(more).for_each(|(v, m)| *v += m);
        }
    }
    semi_inverse(&block, constrained)
}

/// Rows cut so that a strip has no couplings but with the strips beside it; a single one if there would not be two of a colour. Wide strips
/// have fewer couplings with others, narrow ones are more.
fn strips<const B: usize>(a: &Blocks<B, B>) -> Vec<usize> {
    const ENOUGH: usize = 8;
    let found = [3, 2, 1].map(|width| cut(a, width));
    let [wide, middle, narrow] = found;
    let best = [wide, middle]
        .into_iter()
        .find(|s| s.len() > ENOUGH)
        .unwrap_or(narrow);
    if best.len() < 4 { vec![0, a.nrows()] } else { best }
}

/// Strips of `width` times the least width.
fn cut<const B: usize>(a: &Blocks<B, B>, width: usize) -> Vec<usize> {
    let n = a.nrows();
    let mut strips = vec![0];
    let (mut start, mut reach, mut row) = (0, 0, 0);
    while start < n {
        // All that rows before `start` are coupled to ends with the strip that begins there.
        while row < start {
            reach = a.row(row).0.last().map_or(reach, |j| reach.max(*j as usize + 1));
            row += 1;
        }
        let enough = a.start.partition_point(|k| *k < a.start[start] + GRAIN / (B * B));
        let least = start + width * reach.saturating_sub(start);
        start = enough.max(least).max(start + 1).min(n);
        strips.push(start);
    }
    strips
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sweep {
    /// Forward from x = 0.
    FromZero,
    Forward,
    Backward,
}

struct Relaxation<'a, const B: usize> {
    a: &'a Blocks<B, B>,
    inverse: &'a [[[f64; B]; B]],
    b: &'a [[f64; B]],
    strips: &'a [usize],
    halos: &'a [usize],
    halo_first: &'a [usize],
    sweep: Sweep,
    until: Until,
}

/// Strips in a row, with x on the strips beside them.
struct Part<'a, const B: usize> {
    strips: Range<usize>,
    before: &'a [[f64; B]],
    x: &'a mut [[f64; B]],
    after: &'a [[f64; B]],
    r: &'a mut [[f64; B]],
    halo: &'a mut [[f64; B]],
}

impl<const B: usize> Relaxation<'_, B> {
    /// Relaxes the strips of the part whose numbers are odd (1) or even (0), which are the first or the last ones of the sweep.
    fn colour(&self, odd: usize, last: bool, part: Part<'_, B>) {
        let (from, to) = (part.strips.start, part.strips.end);
        let first = from + (from + odd) % 2;
        if first >= to {
            return;
        }
        let (offset, shift) = (self.strips[from], self.halos[from]);
        let count = (to - first).div_ceil(2);
        if count == 1 {
            if self.until.is_over() {
                return;
            }
            let rows = self.strips[first]..self.strips[first + 1];
            let (x_before, x) = part.x.split_at_mut(rows.start - offset);
            let (x, x_after) = x.split_at_mut(rows.len());
            let strip = Strip {
                all: self,
                before: if first > from { x_before } else { part.before },
                x,
                after: if first + 1 < to { x_after } else { part.after },
                r: &mut part.r[rows.start - offset..rows.end - offset],
                halo: &mut part.halo[self.halos[first] - shift..self.halos[first + 1] - shift],
                first: self.halo_first[first],
                rows,
            };
            return match (self.sweep, last) {
                (Sweep::FromZero, false) => strip.relax_zero::<false>(),
                (Sweep::FromZero, true) => strip.relax_zero::<true>(),
                (_, false) => strip.relax::<false>(),
                (_, true) => strip.relax::<true>(),
            };
        }
        // A strip of the other colour is read from both sides.
        let middle = first + 2 * (count / 2) - 1;
        let (start, end) = (self.strips[middle] - offset, self.strips[middle + 1] - offset);
        let (x_low, x) = part.x.split_at_mut(start);
        let (between, x_high) = x.split_at_mut(end - start);
        let (r_low, r) = part.r.split_at_mut(start);
        let (halo_low, halo) = part.halo.split_at_mut(self.halos[middle] - shift);
        let between = &*between;
        let low = Part {
            strips: from..middle,
            before: part.before,
            x: x_low,
            after: between,
            r: r_low,
            halo: halo_low,
        };
        let high = Part {
            strips: middle + 1..to,
            before: between,
            x: x_high,
            after: part.after,
            r: &mut r[end - start..],
            halo: &mut halo[self.halos[middle + 1] - self.halos[middle]..],
        };
        parallel::join(|| self.colour(odd, last, low), || self.colour(odd, last, high));
    }
}

/// One strip: its rows, its part of x and r, x on the strips beside it, and the changes of their residuals.
struct Strip<'a, const B: usize> {
    all: &'a Relaxation<'a, B>,
    rows: Range<usize>,
    before: &'a [[f64; B]],
    x: &'a mut [[f64; B]],
    after: &'a [[f64; B]],
    r: &'a mut [[f64; B]],
    /// Rows from `first` on, without those of the strip.
    halo: &'a mut [[f64; B]],
    first: usize,
}

impl<const B: usize> Strip<'_, B> {
    /// x ← a forward sweep from x = 0, r ← b − A x: that residual is −(upper part) x, which by symmetry is gathered from the lower
    /// part, the only one that is read. Beside the first strips x is still zero.
    fn relax_zero<const LAST: bool>(mut self) {
        if LAST {
            self.halo.fill([0.0; B]);
        }
        let (start, end) = (self.rows.start, self.rows.end);
        for i in start..end {
            let (cols, values) = self.all.a.row(i);
            let mut sum = [0.0; B];
            let low = if LAST {
                self.add_before(cols, values, &mut sum)
            } else {
                cols.iter().take_while(|j| (**j as usize) < start).count()
            };
            let mut diagonal = low;
            while diagonal < cols.len() && (cols[diagonal] as usize) < i {
                add_product(
                    &values[diagonal],
                    &self.x[cols[diagonal] as usize - start],
                    &mut sum,
                );
                diagonal += 1;
            }
            let mut high = cols.len();
            if LAST {
                high = self.add_after(cols, values, &mut sum);
            }
            let rest: [f64; B] = std::array::from_fn(|k| self.all.b[i][k] - sum[k]);
            let mut step = [0.0; B];
            add_product(&self.all.inverse[i], &rest, &mut step);
            self.x[i - start] = step;
            self.r[i - start] = [0.0; B];
            for (&j, block) in cols[low..diagonal].iter().zip(&values[low..diagonal]) {
                subtract_transposed(block, &step, &mut self.r[j as usize - start]);
            }
            if LAST {
                self.owe(cols, values, low, high, &step);
            }
        }
    }

    /// A sweep from the current x, and r ← b − A x: once a row is relaxed, later changes of its residual are gathered, by symmetry, from
    /// the rows that are relaxed after it. Fixed components are arbitrary in r.
    fn relax<const LAST: bool>(mut self) {
        if LAST {
            self.halo.fill([0.0; B]);
        }
        let (start, end) = (self.rows.start, self.rows.end);
        let backward = self.all.sweep == Sweep::Backward;
        for k in 0..end - start {
            let i = if backward { end - 1 - k } else { start + k };
            let (cols, values) = self.all.a.row(i);
            let mut sum = [0.0; B];
            let low = self.add_before(cols, values, &mut sum);
            let high = self.add_after(cols, values, &mut sum);
            let mut diagonal = low;
            for k in low..high {
                let j = cols[k] as usize;
                if j == i {
                    diagonal = k;
                } else {
                    add_product(&values[k], &self.x[j - start], &mut sum);
                }
            }
            let rest: [f64; B] = std::array::from_fn(|k| self.all.b[i][k] - sum[k]);
            let mut new = [0.0; B];
            add_product(&self.all.inverse[i], &rest, &mut new);
            let own = &mut self.x[i - start];
            let step: [f64; B] = std::array::from_fn(|k| new[k] - own[k]);
            *own = new;
            self.r[i - start] = [0.0; B];
            let earlier = if backward {
                diagonal + 1..high
            } else {
                low..diagonal
            };
            for (&j, block) in cols[earlier.clone()].iter().zip(&values[earlier]) {
                subtract_transposed(block, &step, &mut self.r[j as usize - start]);
            }
            if LAST {
                self.owe(cols, values, low, high, &step);
            }
        }
    }

    /// Adds the products of a row with x on the strip before this one; returns where the columns of this one begin.
    #[inline(always)]
    fn add_before(&self, cols: &[u32], values: &[[[f64; B]; B]], sum: &mut [f64; B]) -> usize {
        let first = self.rows.start - self.before.len();
        let mut k = 0;
        while k < cols.len() && (cols[k] as usize) < self.rows.start {
            add_product(&values[k], &self.before[cols[k] as usize - first], sum);
            k += 1;
        }
        k
    }

    /// The same with the strip after this one; returns where the columns of this one end.
    #[inline(always)]
    fn add_after(&self, cols: &[u32], values: &[[[f64; B]; B]], sum: &mut [f64; B]) -> usize {
        let mut k = cols.len();
        while k > 0 && cols[k - 1] as usize >= self.rows.end {
            k -= 1;
            add_product(&values[k], &self.after[cols[k] as usize - self.rows.end], sum);
        }
        k
    }

    /// The changes that a step makes to the residuals of the rows beside this strip, whose columns end at `low` and begin at `high`.
    #[inline(always)]
    fn owe(&mut self, cols: &[u32], values: &[[[f64; B]; B]], low: usize, high: usize, step: &[f64; B]) {
        for (&j, block) in cols[..low].iter().zip(values) {
            subtract_transposed(block, step, &mut self.halo[j as usize - self.first]);
        }
        for (&j, block) in cols[high..].iter().zip(&values[high..]) {
            let place = j as usize - self.first - self.rows.len();
            subtract_transposed(block, step, &mut self.halo[place]);
        }
    }
}

/// Share of a diagonal entry that is added where a coarse matrix is singular by rounding.
const SHIFT: f64 = 1e-9;

/// A direct solver for the coarsest matrix. Unknowns without a positive pivot are left out.
#[derive(Debug, Clone)]
pub(super) struct Direct {
    cholesky: Cholesky,
    matrix: Matrix,
}

impl Direct {
    pub(super) fn new<const B: usize>(a: &Blocks<B, B>) -> Result<Self, LinearError> {
        let n = a.nrows();
        let entries = (0..n).flat_map(|i| {
            let blocks = a.row(i).0.iter().map(|j| *j as usize).filter(move |j| *j <= i);
            blocks.flat_map(move |j| (0..B * B).map(move |e| (B * i + e / B, B * j + e % B)))
        });
        let pattern = Pattern::from_entries(B * n, B * n, entries)?;
        let mut cholesky = Cholesky::new();
        cholesky.analyze(pattern.as_ref())?;
        Ok(Self {
            cholesky,
            matrix: Matrix::zeros(pattern),
        })
    }

    /// As [`factor_nearly`](Self::factor_nearly), but a singular matrix is an error.
    pub(super) fn factor<const B: usize>(
        &mut self,
        a: &Blocks<B, B>,
        constraints: &impl Constraints<B>,
    ) -> Result<(), LinearError> {
        self.fill(a, constraints, 0.0)
    }

    /// Factors the matrix, with a little added to its diagonal where constraints have made it singular.
    pub(super) fn factor_nearly<const B: usize>(
        &mut self,
        a: &Blocks<B, B>,
        constraints: &impl Constraints<B>,
    ) -> Result<(), LinearError> {
        if self.fill(a, constraints, 0.0).is_ok() {
            return Ok(());
        }
        self.fill(a, constraints, SHIFT)
    }

    fn fill<const B: usize>(
        &mut self,
        a: &Blocks<B, B>,
        constraints: &impl Constraints<B>,
        shift: f64,
    ) -> Result<(), LinearError> {
        self.matrix.clear();
        let live = |node: usize, k: usize| constraints.inverse(node)[k][k] > 0.0;
        for i in 0..a.nrows() {
            let (cols, values) = a.row(i);
            for (&j, block) in cols.iter().zip(values).filter(|c| *c.0 as usize <= i) {
                let j = j as usize;
                for (r, c) in (0..B * B).map(|e| (e / B, e % B)) {
                    if live(i, r) && live(j, c) {
                        let added = constraints.added(i).filter(|_| i == j).map_or(0.0, |s| s[r][c]);
                        let value = block[r][c] + added;
                        let more = if i == j && r == c { shift * value } else { 0.0 };
                        self.matrix.add(B * i + r, B * j + c, value + more);
                    }
                }
            }
            for k in (0..B).filter(|&k| !live(i, k)) {
                self.matrix.add(B * i + k, B * i + k, 1.0);
            }
        }
        self.cholesky.factor(self.matrix.as_ref())
    }

    pub(super) fn solve(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.cholesky.solve_in_place(b)
    }
}
