//! Sparse matrices of small dense blocks.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Mul, Range, Sub, SubAssign};

use crate::InputError;
use crate::parallel;

/// Rows that one thread takes at a time.
pub(crate) const ROWS: usize = 1024;
/// Most parts of the rows of a symmetric product, each of which needs memory for what it adds to other rows.
pub(crate) const MOST_PARTS: usize = 32;

/// Entries of blocks: double precision, or single precision where half of the memory is worth more than the digits.
pub(crate) trait Entry:
    Copy
    + Default
    + PartialEq
    + Debug
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + SubAssign
{
    /// Pivots of a diagonal block below this part of the diagonal entry are rounding.
    const NEGLIGIBLE: f64;

    fn narrow(v: f64) -> Self;
    fn wide(self) -> f64;
}

impl Entry for f64 {
    const NEGLIGIBLE: f64 = 1e-12;

    #[inline(always)]
    fn narrow(v: f64) -> Self {
        v
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

impl Entry for f32 {
    const NEGLIGIBLE: f64 = 16.0 * f32::EPSILON as f64;

    #[inline(always)]
    fn narrow(v: f64) -> Self {
        v as f32
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

/// A sparse matrix of R × C blocks, by block rows: half the memory of single entries, and products without a look-up for each.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Blocks<const R: usize, const C: usize, S = f64> {
    pub(crate) ncols: usize,
    /// Row i owns the blocks `start[i]..start[i + 1]`.
    pub(crate) start: Vec<usize>,
    /// Column of each block, increasing in a row.
    pub(crate) col: Vec<u32>,
    pub(crate) value: Vec<[[S; C]; R]>,
}

impl<const R: usize, const C: usize, S: Entry> Blocks<R, C, S> {
    pub(crate) fn new(ncols: usize) -> Self {
        Self {
            ncols,
            start: vec![0],
            col: Vec::new(),
            value: Vec::new(),
        }
    }

    pub(crate) fn nrows(&self) -> usize {
        self.start.len() - 1
    }

    /// Columns and blocks of a row.
    #[inline]
    pub(crate) fn row(&self, i: usize) -> (&[u32], &[[[S; C]; R]]) {
        let span = self.start[i]..self.start[i + 1];
        (&self.col[span.clone()], &self.value[span])
    }

    /// Place of a block among the values.
    pub(crate) fn slot(&self, i: usize, j: usize) -> Option<usize> {
        let first = self.start[i];
        let cols = &self.col[first..self.start[i + 1]];
        cols.binary_search(&(j as u32)).ok().map(|k| first + k)
    }
}

/// A symmetric matrix of B × B blocks, of which the lower triangle is stored. All diagonal blocks are stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Symmetric<const B: usize, S = f64> {
    /// The diagonal block is the last one of each row.
    lower: Blocks<B, B, S>,
    /// The rows of the blocks below the diagonal of column j, and their places, `ends[j]..ends[j + 1]`.
    below: Vec<(u32, u32)>,
    ends: Vec<usize>,
}

impl<const B: usize, S: Entry> Symmetric<B, S> {
    /// From the lower triangle, with all diagonal blocks; at most 2³² blocks.
    pub(crate) fn of(lower: Blocks<B, B, S>) -> Self {
        let n = lower.nrows();
        let mut ends = vec![0usize; n + 1];
        lower.col.iter().for_each(|j| ends[*j as usize + 1] += 1);
        for j in 0..n {
            // Without the diagonal.
            ends[j + 1] = ends[j] + ends[j + 1] - 1;
        }
        let mut next = ends.clone();
        let mut below = vec![(0, 0); ends[n]];
        for i in 0..n {
            for k in lower.start[i]..lower.start[i + 1] - 1 {
                let place = &mut next[lower.col[k] as usize];
                below[*place] = (i as u32, k as u32);
                *place += 1;
            }
        }
        Self { lower, below, ends }
    }

    pub(crate) fn nrows(&self) -> usize {
        self.lower.nrows()
    }

    /// Number of stored blocks.
    pub(crate) fn len(&self) -> usize {
        self.lower.col.len()
    }

    pub(crate) fn lower(&self) -> &Blocks<B, B, S> {
        &self.lower
    }

    pub(crate) fn values_mut(&mut self) -> &mut [[[S; B]; B]] {
        &mut self.lower.value
    }

    pub(crate) fn diagonal(&self, i: usize) -> &[[S; B]; B] {
        &self.lower.value[self.lower.start[i + 1] - 1]
    }

    /// The rows of the blocks below the diagonal in a column, and their places.
    #[inline]
    pub(crate) fn below(&self, j: usize) -> &[(u32, u32)] {
        &self.below[self.ends[j]..self.ends[j + 1]]
    }

    /// The columns of a row, increasing, and the places of their blocks, where those beyond the diagonal are stored transposed.
    pub(crate) fn places(&self, i: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let span = self.lower.start[i]..self.lower.start[i + 1];
        let own = self.lower.col[span.clone()].iter().zip(span);
        let own = own.map(|(j, k)| (*j as usize, k));
        own.chain(self.below(i).iter().map(|(j, k)| (*j as usize, *k as usize)))
    }

    /// Calls `f` with the columns of a row, increasing, and their blocks.
    #[inline(always)]
    pub(crate) fn each(&self, i: usize, mut f: impl FnMut(usize, &[[f64; B]; B])) {
        let (cols, values) = self.lower.row(i);
        for (&j, block) in cols.iter().zip(values) {
            f(j as usize, &wide(block));
        }
        for &(j, k) in self.below(i) {
            f(j as usize, &transposed(&wide(&self.lower.value[k as usize])));
        }
    }

    /// Sets the block of a row and column and the one that mirrors it, if they are stored.
    pub(crate) fn set(&mut self, i: usize, j: usize, block: &[[f64; B]; B]) {
        let own = if i < j { transposed(block) } else { *block };
        if let Some(k) = self.lower.slot(i.max(j), i.min(j)) {
            self.lower.value[k] = own.map(|row| row.map(S::narrow));
        }
    }

    /// As [`Matrix::check_finite`](super::Matrix::check_finite), of the entries by component.
    pub(crate) fn check_finite(&self) -> Result<(), InputError> {
        for i in 0..self.nrows() {
            let (cols, values) = self.lower.row(i);
            for (&j, block) in cols.iter().zip(values) {
                for (e, value) in block.as_flattened().iter().enumerate() {
                    let value = value.wide();
                    if !value.is_finite() {
                        let (row, col) = (B * i + e / B, B * j as usize + e % B);
                        return Err(InputError::Entry { row, col, value });
                    }
                }
            }
        }
        Ok(())
    }

    /// The entries of a row of A x.
    #[inline]
    pub(crate) fn row_product(&self, i: usize, x: &[f64]) -> [f64; B] {
        let (x, mut sum) = (x.as_chunks::<B>().0, [0.0; B]);
        self.each(i, |j, block| add_product(block, &x[j], &mut sum));
        sum
    }
}

impl<const B: usize> Symmetric<B> {
    /// y ← A x.
    pub(crate) fn mul(&self, x: &[f64], y: &mut [f64]) {
        let rows = self.nrows().div_ceil(MOST_PARTS).max(ROWS);
        self.mul_rows(0..self.nrows(), rows, x.as_chunks().0, y.as_chunks_mut().0);
    }

    /// The products of some rows, and what these add to the rows just before them.
    fn mul_rows(&self, rows: Range<usize>, most: usize, x: &[[f64; B]], y: &mut [[f64; B]]) -> Vec<[f64; B]> {
        let start = rows.start;
        if rows.len() > most {
            let half = rows.len().div_ceil(most) / 2 * most;
            let (low, high) = y.split_at_mut(half);
            let (mut before, owed) = parallel::join(
                || self.mul_rows(start..start + half, most, x, low),
                || self.mul_rows(start + half..rows.end, most, x, high),
            );
            let inside = owed.len().min(half);
            let (outside, owed) = owed.split_at(owed.len() - inside);
            add_all(owed, &mut low[half - inside..]);
            if outside.len() > before.len() {
                let more = outside.len() - before.len();
                before.splice(0..0, std::iter::repeat_n([0.0; B], more));
            }
            let shift = before.len() - outside.len();
            add_all(outside, &mut before[shift..]);
            return before;
        }
        let firsts = rows.clone().filter_map(|i| self.lower.row(i).0.first());
        let first = firsts.fold(start, |first, j| first.min(*j as usize));
        let mut before = vec![[0.0; B]; start - first];
        y.fill([0.0; B]);
        for i in rows {
            let (cols, values) = self.lower.row(i);
            let (x_own, mut sum) = (&x[i], RowSum::new());
            for (&j, block) in cols.iter().zip(values) {
                let j = j as usize;
                sum.add(block, &x[j]);
                if j >= start && j < i {
                    add_transposed(block, x_own, &mut y[j - start]);
                } else if j < start {
                    add_transposed(block, x_own, &mut before[j - first]);
                }
            }
            let own = &mut y[i - start];
            own.iter_mut().zip(sum.total()).for_each(|(y, s)| *y += s);
        }
        before
    }

    /// The same matrix in single precision.
    pub(crate) fn rounded(&self) -> Symmetric<B, f32> {
        let lower = &self.lower;
        Symmetric {
            lower: Blocks {
                ncols: lower.ncols,
                start: lower.start.clone(),
                col: lower.col.clone(),
                value: (lower
                    .value
                    .iter()
                    .map(|b| b.map(|row| row.map(<f32 as Entry>::narrow))))
                .collect(),
            },
            below: self.below.clone(),
            ends: self.ends.clone(),
        }
    }
}

/// Entries in double precision; loops over closures are not always inlined here.
#[inline(always)]
pub(crate) fn wide<const R: usize, const C: usize, S: Entry>(m: &[[S; C]; R]) -> [[f64; C]; R] {
    let mut out = [[0.0; C]; R];
    for a in 0..R {
        for b in 0..C {
            out[a][b] = m[a][b].wide();
        }
    }
    out
}

#[inline(always)]
fn transposed<const B: usize>(m: &[[f64; B]; B]) -> [[f64; B]; B] {
    let mut out = [[0.0; B]; B];
    for a in 0..B {
        for b in 0..B {
            out[a][b] = m[b][a];
        }
    }
    out
}

/// y += M x.
#[inline(always)]
pub(crate) fn add_product<const R: usize, const C: usize, S: Entry>(
    m: &[[S; C]; R],
    x: &[S; C],
    y: &mut [S; R],
) {
    for a in 0..R {
        for b in 0..C {
            y[a] += m[a][b] * x[b];
        }
    }
}

/// Sums of the products of a row of blocks, column by column: few of the additions wait for another one, and they are done side by side.
#[derive(Clone, Copy)]
pub(crate) struct RowSum<const R: usize, const C: usize, S>([[S; C]; R]);

impl<const R: usize, const C: usize, S: Entry> RowSum<R, C, S> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self([[S::default(); C]; R])
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, m: &[[S; C]; R], x: &[S; C]) {
        for a in 0..R {
            for b in 0..C {
                self.0[a][b] += m[a][b] * x[b];
            }
        }
    }

    #[inline(always)]
    pub(crate) fn total(&self) -> [S; R] {
        let mut total = [S::default(); R];
        for (t, row) in total.iter_mut().zip(&self.0) {
            row.iter().for_each(|v| *t += *v);
        }
        total
    }
}

/// Adds block by block.
pub(crate) fn add_all<const B: usize, S: Entry>(more: &[[S; B]], sums: &mut [[S; B]]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        sum.iter_mut().zip(more).for_each(|(s, m)| *s += *m);
    }
}

/// y += Mᵀ x; y is written once, as the compiler cannot know that M is not part of it.
#[inline(always)]
pub(crate) fn add_transposed<const R: usize, const C: usize, S: Entry>(
    m: &[[S; C]; R],
    x: &[S; R],
    y: &mut [S; C],
) {
    let mut sum = *y;
    for a in 0..R {
        for b in 0..C {
            sum[b] += m[a][b] * x[a];
        }
    }
    *y = sum;
}

/// y −= Mᵀ x; written out, as with −x and the sum above sweeps take longer.
#[inline(always)]
pub(crate) fn subtract_transposed<const R: usize, const C: usize, S: Entry>(
    m: &[[S; C]; R],
    x: &[S; R],
    y: &mut [S; C],
) {
    let mut sum = *y;
    for a in 0..R {
        for b in 0..C {
            sum[b] -= m[a][b] * x[a];
        }
    }
    *y = sum;
}
