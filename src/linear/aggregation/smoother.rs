//! Block Gauss–Seidel sweeps, and the direct solve at the bottom.

use std::collections::BTreeMap;
use std::ops::Range;

use super::dense::semi_inverse;
use super::transfer::Constraints;
use crate::clock::Until;
use crate::linear::{Cholesky, LinearError, LinearSolver};
use crate::parallel;
use crate::sparse::{
    Entry, Matrix, Pattern, ROWS, RowSum, Symmetric, add_all, add_product, subtract_transposed, wide,
};
use crate::tolerances::SHIFT;

/// Stored entries of a matrix for which a thread pays off.
const GRAIN: usize = 1 << 17;

/// Additions to the diagonal blocks of nodes.
pub(super) type Added<const B: usize> = BTreeMap<u32, [[f64; B]; B]>;

/// Sweeps over a symmetric matrix, and the vectors of its level.
///
/// A sweep solves for a step from zero and leaves the residual behind: by symmetry only the lower triangle is read, once where the sweep
/// goes forward. Rows are relaxed strip by strip, first those of even numbers, then the odd ones (backward the other way round): a strip is
/// coupled to the two beside it alone, so that strips of one colour are relaxed at the same time, and the sweep is Gauss–Seidel's in another
/// order.
#[derive(Debug, Clone)]
pub(super) struct Smoother<const B: usize, S = f64> {
    /// Inverse diagonal blocks; zero rows and columns in fixed components.
    pub(super) inverse: Vec<[[S; B]; B]>,
    pub(super) x: Vec<S>,
    pub(super) b: Vec<S>,
    pub(super) r: Vec<S>,
    /// The step of the last sweep.
    step: Vec<S>,
    /// The first row of each strip, and the end.
    strips: Vec<usize>,
    /// The changes that a strip makes to the residuals of the rows before it, the first of these rows, and their position here.
    halo: Vec<[S; B]>,
    halo_first: Vec<usize>,
    halo_ends: Vec<usize>,
    /// Once it has passed strips are left as they are.
    pub(super) until: Until,
}

impl<const B: usize, S: Entry> Smoother<B, S> {
    /// For a matrix, or for one that is rounded to S entries.
    pub(super) fn new<M: Entry>(a: &Symmetric<B, M>, constrained: impl Fn(usize) -> u8 + Sync) -> Self {
        let n = a.nrows();
        let mut inverse = vec![[[S::default(); B]; B]; n];
        parallel::parts(&mut inverse, ROWS, &|first, part| {
            for (i, inverse) in (first..).zip(part) {
                *inverse = inverse_block(a, i, constrained(i), None);
            }
        });
        let strips = strips(a);
        let (mut halo_first, mut halo_ends) = (Vec::new(), vec![0]);
        for strip in strips.windows(2) {
            let firsts = (strip[0]..strip[1]).filter_map(|i| a.lower().row(i).0.first());
            let low = firsts.fold(strip[0], |low, j| low.min(*j as usize));
            halo_first.push(low);
            halo_ends.push(halo_ends[halo_ends.len() - 1] + (strip[0] - low));
        }
        let zeros = || vec![S::default(); B * n];
        Self {
            inverse,
            x: zeros(),
            b: zeros(),
            r: zeros(),
            step: zeros(),
            halo: vec![[S::default(); B]; halo_ends[halo_ends.len() - 1]],
            strips,
            halo_first,
            halo_ends,
            until: Until::default(),
        }
    }

    pub(super) fn invert<M: Entry>(
        &mut self,
        a: &Symmetric<B, M>,
        node: usize,
        constrained: u8,
        added: Option<&[[f64; B]; B]>,
    ) {
        self.inverse[node] = inverse_block(a, node, constrained, added);
    }

    fn run(&mut self, a: &Symmetric<B, S>, passes: &[(Pass, usize)]) {
        for &(pass, colour) in passes {
            let all = Strips {
                a,
                inverse: &self.inverse,
                strips: &self.strips,
                halos: &self.halo_ends,
                halo_first: &self.halo_first,
                pass,
                until: self.until,
            };
            let x = match pass {
                Pass::Residual => &mut self.x,
                _ => &mut self.step,
            };
            let whole = Part {
                strips: 0..self.strips.len() - 1,
                before: &[],
                x: x.as_chunks_mut().0,
                r: self.r.as_chunks_mut().0,
                halo: &mut self.halo,
                after: &[],
            };
            all.colour(colour, whole);
        }
    }

    /// A step from zero for the residual, which is updated: forward, or backward in the reverse order.
    fn sweep(&mut self, a: &Symmetric<B, S>, backward: bool) {
        let first = usize::from(backward && self.strips.len() > 2);
        self.run(
            a,
            &[
                (Pass::First { backward }, first),
                (Pass::Second { backward }, 1 - first),
                (Pass::Settle, first),
            ],
        );
    }

    fn add_step(&mut self) {
        let step = &self.step;
        parallel::parts(&mut self.x, parallel::GRAIN, &|first, x| {
            x.iter_mut().zip(&step[first..]).for_each(|(x, s)| *x += *s);
        });
    }

    #[cfg(test)]
    pub(super) fn num_strips(&self) -> usize {
        self.strips.len() - 1
    }

    /// Before the coarse correction: x from zero, r its residual. Sweeps go forward and backward by turns.
    pub(super) fn smooth_before(&mut self, a: &Symmetric<B, S>, sweeps: usize) {
        self.r.copy_from_slice(&self.b);
        self.sweep(a, false);
        std::mem::swap(&mut self.x, &mut self.step);
        for k in 1..sweeps {
            self.sweep(a, k % 2 == 1);
            self.add_step();
        }
    }

    /// After it, for A with additions: in reverse if the cycle is to be `symmetric`, else in the same order.
    pub(super) fn smooth_after(
        &mut self,
        a: &Symmetric<B, S>,
        added: &Added<B>,
        sweeps: usize,
        symmetric: bool,
    ) {
        self.r.copy_from_slice(&self.b);
        self.run(a, &[(Pass::Residual, 0), (Pass::Residual, 1)]);
        for (k, &first) in self.halo_first.iter().enumerate() {
            let halo = &self.halo[self.halo_ends[k]..self.halo_ends[k + 1]];
            add_all(halo, &mut self.r.as_chunks_mut().0[first..]);
        }
        for (&i, more) in added {
            let own = B * i as usize..B * (i as usize + 1);
            let x: [f64; B] = std::array::from_fn(|k| self.x[own.start + k].wide());
            let mut image = [0.0; B];
            add_product(more, &x, &mut image);
            (self.r[own].iter_mut().zip(image)).for_each(|(r, v)| *r -= S::narrow(v));
        }
        for k in (0..sweeps).rev() {
            self.sweep(a, (k % 2 == 0) == symmetric);
            self.add_step();
        }
    }
}

fn inverse_block<const B: usize, S: Entry, M: Entry>(
    a: &Symmetric<B, M>,
    node: usize,
    constrained: u8,
    added: Option<&[[f64; B]; B]>,
) -> [[S; B]; B] {
    let mut block = wide(a.diagonal(node));
    if let Some(added) = added {
        for (row, more) in block.iter_mut().zip(added) {
            row.iter_mut().zip(more).for_each(|(v, m)| *v += m);
        }
    }
    semi_inverse(&block, constrained, M::NEGLIGIBLE).map(|row| row.map(S::narrow))
}

/// Rows cut so that a strip has no couplings but with the strips beside it; a single one if there would not be two of a colour. Wide strips
/// have fewer couplings with others, narrow ones are more.
fn strips<const B: usize, S: Entry>(a: &Symmetric<B, S>) -> Vec<usize> {
    const ENOUGH: usize = 8;
    let wide = [3, 2].into_iter().map(|width| cut(a, width));
    let best = (wide.into_iter().find(|s| s.len() > ENOUGH)).unwrap_or_else(|| cut(a, 1));
    if best.len() < 4 { vec![0, a.nrows()] } else { best }
}

/// Strips of `width` times the least width.
fn cut<const B: usize, S: Entry>(a: &Symmetric<B, S>, width: usize) -> Vec<usize> {
    let (n, starts) = (a.nrows(), &a.lower().start);
    let mut strips = vec![0];
    let (mut start, mut reach, mut row) = (0, 0, 0);
    while start < n {
        // All that rows before `start` are coupled to ends with the strip that begins there.
        while row < start {
            let last = a.below(row).last().map_or(row, |(j, _)| *j as usize);
            reach = reach.max(last + 1);
            row += 1;
        }
        let enough = starts.partition_point(|k| *k < starts[start] + GRAIN / (B * B));
        let least = start + width * reach.saturating_sub(start);
        start = enough.max(least).max(start + 1).min(n);
        strips.push(start);
    }
    strips
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pass {
    /// Relaxes the strips of the first colour from x = 0, while those beside them are zero: r ← r − A x in these strips.
    First { backward: bool },
    /// Relaxes those of the second colour, in view of what the first one has found.
    Second { backward: bool },
    /// What strips of the second colour change in the residuals of the first one.
    Settle,
    /// r ← r − A x, but for what strips change in the rows before them, which is in their halos.
    Residual,
}

struct Strips<'a, const B: usize, S> {
    a: &'a Symmetric<B, S>,
    inverse: &'a [[[S; B]; B]],
    strips: &'a [usize],
    halos: &'a [usize],
    halo_first: &'a [usize],
    pass: Pass,
    until: Until,
}

/// Strips in a row, with x on the strip before them and the halo of the strip after them.
struct Part<'a, const B: usize, S> {
    strips: Range<usize>,
    before: &'a [[S; B]],
    x: &'a mut [[S; B]],
    r: &'a mut [[S; B]],
    halo: &'a mut [[S; B]],
    after: &'a [[S; B]],
}

impl<const B: usize, S: Entry> Strips<'_, B, S> {
    /// Goes through the strips of the part whose numbers are odd (1) or even (0).
    fn colour(&self, odd: usize, part: Part<'_, B, S>) {
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
            let (before, x) = part.x.split_at_mut(rows.start - offset);
            let (halo, after) = part.halo.split_at_mut(self.halos[first + 1] - shift);
            let after = if first + 1 < to { after } else { part.after };
            let strip = Strip {
                all: self,
                before: if first > from { before } else { part.before },
                x: &mut x[..rows.len()],
                r: &mut part.r[rows.start - offset..rows.end - offset],
                halo: &mut halo[self.halos[first] - shift..],
                first: self.halo_first[first],
                rows,
            };
            // Where the rows that the next strip changes begin.
            let next = self.halo_first.get(first + 1).map_or(0, |k| k - strip.rows.start);
            return match self.pass {
                Pass::First { backward: false } => strip.forward::<false>(),
                Pass::First { backward: true } => strip.backward::<false>(),
                Pass::Second { backward } => {
                    add_all(after, &mut strip.r[next..]);
                    if backward {
                        strip.backward::<true>();
                    } else {
                        strip.forward::<true>();
                    }
                }
                Pass::Settle => {
                    add_all(after, &mut strip.r[next..]);
                    strip.settle();
                }
                Pass::Residual => strip.subtract(),
            };
        }
        // A strip of the other colour is read by the one after it, its halo by the one before it.
        let middle = first + 2 * (count / 2) - 1;
        let (start, end) = (self.strips[middle] - offset, self.strips[middle + 1] - offset);
        let (x_low, x) = part.x.split_at_mut(start);
        let (between, x_high) = x.split_at_mut(end - start);
        let (r_low, r) = part.r.split_at_mut(start);
        let (halo_low, halo) = part.halo.split_at_mut(self.halos[middle] - shift);
        let (after, halo_high) = halo.split_at_mut(self.halos[middle + 1] - self.halos[middle]);
        let low = Part {
            strips: from..middle,
            before: part.before,
            x: x_low,
            r: r_low,
            halo: halo_low,
            after,
        };
        let high = Part {
            strips: middle + 1..to,
            before: between,
            x: x_high,
            r: &mut r[end - start..],
            halo: halo_high,
            after: part.after,
        };
        parallel::join(|| self.colour(odd, low), || self.colour(odd, high));
    }
}

/// One strip: its rows, its part of x and r, x on the strip before it, and the changes of the residuals there.
struct Strip<'a, const B: usize, S> {
    all: &'a Strips<'a, B, S>,
    rows: Range<usize>,
    before: &'a [[S; B]],
    x: &'a mut [[S; B]],
    r: &'a mut [[S; B]],
    /// Rows from `first` up to the strip.
    halo: &'a mut [[S; B]],
    first: usize,
}

impl<const B: usize, S: Entry> Strip<'_, B, S> {
    /// x ← a forward sweep from x = 0; r, the right-hand side, becomes the residual: −(upper part) x, which by symmetry is gathered from
    /// the lower part. With `COUPLED` x on the strip before this one counts, which is zero otherwise.
    fn forward<const COUPLED: bool>(mut self) {
        self.halo.fill([S::default(); B]);
        let start = self.rows.start;
        for i in self.rows.clone() {
            let (cols, values) = self.all.a.lower().row(i);
            let last = cols.len() - 1;
            let low = count_before(cols, start);
            let mut sum = RowSum::new();
            if COUPLED {
                self.add_before(&cols[..low], values, &mut sum);
            }
            for (&j, block) in cols[low..last].iter().zip(&values[low..]) {
                sum.add(block, &self.x[j as usize - start]);
            }
            let step = self.relax(i, &values[last], &sum);
            self.owe(&cols[..low], values, &step);
            for (&j, block) in cols[low..last].iter().zip(&values[low..]) {
                subtract_transposed(block, &step, &mut self.r[j as usize - start]);
            }
        }
    }

    /// The same backward: what a row changes in those before it is found by symmetry, what these change in it by another reading.
    fn backward<const COUPLED: bool>(mut self) {
        self.halo.fill([S::default(); B]);
        let start = self.rows.start;
        for i in self.rows.clone().rev() {
            let (cols, values) = self.all.a.lower().row(i);
            let last = cols.len() - 1;
            let low = count_before(cols, start);
            let mut sum = RowSum::new();
            if COUPLED {
                self.add_before(&cols[..low], values, &mut sum);
            }
            let step = self.relax(i, &values[last], &sum);
            self.owe(&cols[..low], values, &step);
            for (&j, block) in cols[low..last].iter().zip(&values[low..]) {
                subtract_transposed(block, &step, &mut self.r[j as usize - start]);
            }
        }
        for i in self.rows.clone() {
            let (cols, values) = self.all.a.lower().row(i);
            let low = count_before(cols, start);
            let mut sum = RowSum::new();
            for (&j, block) in cols[low..cols.len() - 1].iter().zip(&values[low..]) {
                sum.add(block, &self.x[j as usize - start]);
            }
            self.take_off(i, &sum);
        }
    }

    /// Solves for x in a row. Its residual is then zero but for fixed components.
    #[inline(always)]
    fn relax(&mut self, i: usize, diagonal: &[[S; B]; B], sum: &RowSum<B, B, S>) -> [S; B] {
        let (own, sum) = (&mut self.r[i - self.rows.start], sum.total());
        let mut rest = *own;
        rest.iter_mut().zip(sum).for_each(|(r, s)| *r -= s);
        let inverse = &self.all.inverse[i];
        let mut step = [S::default(); B];
        add_product(inverse, &rest, &mut step);
        self.x[i - self.rows.start] = step;
        *own = [S::default(); B];
        for k in (0..B).filter(|&k| inverse[k][k] == S::default()) {
            own[k] = (0..B).fold(rest[k], |left, l| left - diagonal[k][l] * step[l]);
        }
        step
    }

    /// Adds the products of a row with x on the strip before this one.
    #[inline(always)]
    fn add_before(&self, cols: &[u32], values: &[[[S; B]; B]], sum: &mut RowSum<B, B, S>) {
        let shift = self.rows.start - self.before.len();
        for (&j, block) in cols.iter().zip(values) {
            sum.add(block, &self.before[j as usize - shift]);
        }
    }

    /// What a step changes in the residuals of the rows before this strip.
    #[inline(always)]
    fn owe(&mut self, cols: &[u32], values: &[[[S; B]; B]], step: &[S; B]) {
        for (&j, block) in cols.iter().zip(values) {
            subtract_transposed(block, step, &mut self.halo[j as usize - self.first]);
        }
    }

    #[inline(always)]
    fn take_off(&mut self, i: usize, sum: &RowSum<B, B, S>) {
        let own = &mut self.r[i - self.rows.start];
        own.iter_mut().zip(sum.total()).for_each(|(r, s)| *r -= s);
    }

    /// Subtracts the products of its rows with x on the strip before this one.
    fn settle(mut self) {
        let start = self.rows.start;
        for i in self.rows.clone() {
            let (cols, values) = self.all.a.lower().row(i);
            let low = count_before(cols, start);
            if low > 0 {
                let mut sum = RowSum::new();
                self.add_before(&cols[..low], values, &mut sum);
                self.take_off(i, &sum);
            }
        }
    }

    /// r ← r − A x in this strip, and its part of that in the rows before it.
    fn subtract(mut self) {
        self.halo.fill([S::default(); B]);
        let start = self.rows.start;
        for i in self.rows.clone() {
            let (cols, values) = self.all.a.lower().row(i);
            let last = cols.len() - 1;
            let low = count_before(cols, start);
            let x = self.x[i - start];
            let mut sum = RowSum::new();
            self.add_before(&cols[..low], values, &mut sum);
            self.owe(&cols[..low], values, &x);
            for (&j, block) in cols[low..last].iter().zip(&values[low..]) {
                sum.add(block, &self.x[j as usize - start]);
                subtract_transposed(block, &x, &mut self.r[j as usize - start]);
            }
            sum.add(&values[last], &x);
            self.take_off(i, &sum);
        }
    }
}

/// How many columns of a row are before the strip that begins at `start`.
#[inline(always)]
fn count_before(cols: &[u32], start: usize) -> usize {
    cols.iter().take_while(|j| (**j as usize) < start).count()
}

/// A direct solver for the coarsest matrix, in double precision. Unknowns without a positive pivot are left out.
#[derive(Debug, Clone)]
pub(super) struct Direct {
    cholesky: Cholesky,
    matrix: Matrix,
    x: Vec<f64>,
}

impl Direct {
    pub(super) fn new<const B: usize>(a: &Symmetric<B>) -> Result<Self, LinearError> {
        let n = a.nrows();
        let entries = (0..n).flat_map(|i| {
            let blocks = a.lower().row(i).0.iter().map(|j| *j as usize);
            blocks.flat_map(move |j| (0..B * B).map(move |e| (B * i + e / B, B * j + e % B)))
        });
        let pattern = Pattern::from_entries(B * n, B * n, entries)?;
        let mut cholesky = Cholesky::new();
        cholesky.analyze(pattern.as_ref())?;
        Ok(Self {
            cholesky,
            matrix: Matrix::zeros(pattern),
            x: vec![0.0; B * n],
        })
    }

    /// As [`factor_nearly`](Self::factor_nearly), but a singular matrix is an error.
    pub(super) fn factor<const B: usize>(
        &mut self,
        a: &Symmetric<B>,
        constraints: &impl Constraints<B>,
    ) -> Result<(), LinearError> {
        self.fill(a, constraints, 0.0)
    }

    /// Factors the matrix, with a little added to its diagonal where constraints have made it singular.
    pub(super) fn factor_nearly<const B: usize>(
        &mut self,
        a: &Symmetric<B>,
        constraints: &impl Constraints<B>,
    ) -> Result<(), LinearError> {
        if self.fill(a, constraints, 0.0).is_ok() {
            return Ok(());
        }
        self.fill(a, constraints, SHIFT)
    }

    fn fill<const B: usize>(
        &mut self,
        a: &Symmetric<B>,
        constraints: &impl Constraints<B>,
        shift: f64,
    ) -> Result<(), LinearError> {
        self.matrix.clear();
        let live = |node: usize, k: usize| constraints.inverse(node)[k][k] > 0.0;
        for i in 0..a.nrows() {
            let (cols, values) = a.lower().row(i);
            for (&j, block) in cols.iter().zip(values) {
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

    /// x ← A⁻¹ b.
    pub(super) fn solve<S: Entry>(&mut self, b: &[S], x: &mut [S]) -> Result<(), LinearError> {
        self.x.iter_mut().zip(b).for_each(|(x, b)| *x = b.wide());
        self.cholesky.solve_in_place(&mut self.x)?;
        x.iter_mut().zip(&self.x).for_each(|(x, v)| *x = S::narrow(*v));
        Ok(())
    }
}
