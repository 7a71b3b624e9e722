//! Numeric supernodal Cholesky factorisation, on all cores: supernodes one after another, left-looking (E. G. Ng, B. W. Peyton, SIAM
//! J. Sci. Comput. 14 (1993)), the columns of each in parts that are summed at the same time, each part in one order by one thread.

use std::mem::MaybeUninit;

use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::{Accum, MatMut, MatRef, Par};

use super::LinearError;
use crate::clock::Until;
use crate::parallel;
use crate::tolerances::NONE;

/// Columns that are summed by one thread at a time, and columns and rows of dense factors.
const COLUMNS: usize = 128;
const ROWS: usize = 256;

/// The lower triangle of a matrix by columns, in the order of elimination.
struct Lower {
    start: Vec<usize>,
    row: Vec<usize>,
    value: Vec<f64>,
}

impl Lower {
    /// From a matrix whose entries below the diagonal are read; `place` is the position of each unknown in the order of elimination.
    fn new(place: Option<&[usize]>, (col_ptr, row_idx, values): (&[usize], &[usize], &[f64])) -> Self {
        let n = col_ptr.len() - 1;
        let at = |i: usize| place.map_or(i, |place| place[i]);
        let entries = || {
            (0..n).flat_map(move |j| {
                let span = col_ptr[j]..col_ptr[j + 1];
                let below = row_idx[span.clone()].iter().zip(&values[span]);
                below.filter(move |(i, _)| **i >= j).map(move |(i, v)| {
                    let (a, b) = (at(*i), at(j));
                    (a.max(b), a.min(b), *v)
                })
            })
        };
        let mut start = vec![0; n + 1];
        entries().for_each(|(_, j, _)| start[j + 1] += 1);
        (0..n).for_each(|j| start[j + 1] += start[j]);
        let (mut next, count) = (start.clone(), start[n]);
        let (mut row, mut value) = (vec![0; count], vec![0.0; count]);
        for (i, j, v) in entries() {
            (row[next[j]], value[next[j]]) = (i, v);
            next[j] += 1;
        }
        Self { start, row, value }
    }
}

/// A supernode that an earlier one changes: the earlier one, and which of its rows are columns of the later one.
struct Update<'a> {
    pattern: &'a [usize],
    values: MatRef<'a, f64>,
    rows: std::ops::Range<usize>,
}

/// Overwrites `factor` by the numbers of L. Entries above diagonals are arbitrary.
///
/// # Errors
/// A pivot that is not positive; the time limit, for which the clock is read between supernodes and between parts of large ones.
pub(super) fn factorize(
    symbolic: &SymbolicSupernodalCholesky<usize>,
    place: Option<&[usize]>,
    a: (&[usize], &[usize], &[f64]),
    factor: &mut [f64],
    until: Until,
) -> Result<(), LinearError> {
    let (n, count) = (symbolic.nrows(), symbolic.n_supernodes());
    let lower = Lower::new(place, a);
    let (begin, end) = (symbolic.supernode_begin(), symbolic.supernode_end());
    let at = symbolic.col_ptr_for_val();
    let pattern = |s: usize| {
        let rows = &symbolic.row_idx()[symbolic.col_ptr_for_row_idx()[s]..];
        &rows[..symbolic.nnz_per_super()[s]]
    };
    let mut owner = vec![0; n];
    (0..count).for_each(|s| owner[begin[s]..end[s]].fill(s));
    // The supernodes that change a given one next, as lists, and how many of their rows are done.
    let (mut first, mut next, mut done) = (vec![NONE; count], vec![NONE; count], vec![0; count]);
    let mut local = vec![0; n];
    let mut scratch = Box::new_uninit_slice(
        cholesky_in_place_scratch::<f64>(COLUMNS, Par::Seq, Default::default()).unaligned_bytes_required(),
    );
    for s in 0..count {
        if until.is_over() {
            return Err(LinearError::TimeLimit);
        }
        let (start, width) = (begin[s], end[s] - begin[s]);
        let below = pattern(s);
        let rows = width + below.len();
        (0..width).for_each(|k| local[start + k] = k);
        below.iter().zip(width..).for_each(|(i, k)| local[*i] = k);
        let (before, own) = factor.split_at_mut(at[s]);
        let own = &mut own[..rows * width];
        parallel::parts(own, rows * COLUMNS, &|_, part| part.fill(0.0));
        for j in 0..width {
            for k in lower.start[start + j]..lower.start[start + j + 1] {
                own[j * rows + local[lower.row[k]]] += lower.value[k];
            }
        }
        let (mut updates, mut d) = (Vec::new(), first[s]);
        while d != NONE {
            let (pattern, columns) = (pattern(d), end[d] - begin[d]);
            let from = done[d];
            let to = from + pattern[from..].partition_point(|i| *i < end[s]);
            let height = columns + pattern.len();
            updates.push(Update {
                pattern,
                values: MatRef::from_column_major_slice(
                    &before[at[d]..][..height * columns],
                    height,
                    columns,
                )
                .subrows(columns, pattern.len()),
                rows: from..to,
            });
            done[d] = to;
            let after = next[d];
            if let Some(row) = pattern.get(to) {
                (next[d], first[owner[*row]]) = (first[owner[*row]], d);
            }
            d = after;
        }
        parallel::parts(own, rows * COLUMNS, &|place, part| {
            let columns = start + place / rows..start + (place + part.len()) / rows;
            let mut product = Vec::new();
            for update in updates.iter().take_while(|_| !until.is_over()) {
                update.subtract(columns.clone(), &local, rows, part, &mut product);
            }
        });
        dense(
            MatMut::from_column_major_slice_mut(own, rows, width),
            &mut scratch,
            until,
        )?;
        if let Some(row) = below.first() {
            (next[s], first[owner[*row]]) = (first[owner[*row]], s);
        }
    }
    Ok(())
}

/// Bytes that [`factorize`] takes beside the factor, for a matrix with so many entries: a copy of it, lists, and a product for each of the
/// threads assumed.
pub(super) fn memory(symbolic: &SymbolicSupernodalCholesky<usize>, entries: usize) -> usize {
    const THREADS: usize = 4;
    let (begin, end) = (symbolic.supernode_begin(), symbolic.supernode_end());
    let heights = (begin.iter().zip(end).zip(symbolic.nnz_per_super())).map(|((b, e), below)| e - b + below);
    let product = THREADS * COLUMNS * heights.max().unwrap_or(0);
    size_of::<f64>() * (2 * entries + 4 * symbolic.nrows() + 3 * begin.len() + product)
}

impl Update<'_> {
    /// Subtracts the products with these columns from a part of the later supernode that consists of them.
    fn subtract(
        &self,
        columns: std::ops::Range<usize>,
        local: &[usize],
        rows: usize,
        part: &mut [f64],
        product: &mut Vec<f64>,
    ) {
        let wanted = &self.pattern[self.rows.clone()];
        let from = self.rows.start + wanted.partition_point(|i| *i < columns.start);
        let to = self.rows.start + wanted.partition_point(|i| *i < columns.end);
        if from == to {
            return;
        }
        let (height, width) = (self.pattern.len() - from, to - from);
        product.resize((height * width).max(product.len()), 0.0);
        let product = &mut product[..height * width];
        matmul(
            MatMut::from_column_major_slice_mut(product, height, width),
            Accum::Replace,
            self.values.subrows(from, height),
            self.values.subrows(from, width).transpose(),
            1.0,
            Par::Seq,
        );
        for (c, product) in product.chunks_exact(height).enumerate() {
            let column = &mut part[(self.pattern[from + c] - columns.start) * rows..][..rows];
            for (i, v) in self.pattern[from + c..].iter().zip(&product[c..]) {
                column[local[*i]] -= v;
            }
        }
    }
}

/// The factor of the columns of a supernode, after all of its updates.
fn dense(mut own: MatMut<'_, f64>, scratch: &mut [MaybeUninit<u8>], until: Until) -> Result<(), LinearError> {
    let (rows, width) = (own.nrows(), own.ncols());
    for k in (0..width).step_by(COLUMNS) {
        if until.is_over() {
            return Err(LinearError::TimeLimit);
        }
        let w = COLUMNS.min(width - k);
        let (left, right) = own.as_mut().split_at_col_mut(k + w);
        let (mut diagonal, mut below) = left.submatrix_mut(k, k, rows - k, w).split_at_row_mut(w);
        let stack = MemStack::new(scratch);
        let done = cholesky_in_place(
            diagonal.as_mut(),
            Default::default(),
            Par::Seq,
            stack,
            Default::default(),
        );
        done.map_err(|_| LinearError::NotPositiveDefinite)?;
        let diagonal = diagonal.as_ref();
        by_rows(below.as_mut(), &|part| {
            solve_lower_triangular_in_place(diagonal, part.transpose_mut(), Par::Seq);
        });
        let below = below.as_ref();
        let (count, height) = (width - k - w, rows - k - w);
        by_columns(0, right.submatrix_mut(k + w, 0, height, count), &|first, part| {
            let columns = part.ncols();
            matmul(
                part.submatrix_mut(first, 0, height - first, columns),
                Accum::Add,
                below.subrows(first, height - first),
                below.subrows(first, columns).transpose(),
                -1.0,
                Par::Seq,
            );
        });
    }
    Ok(())
}

fn by_rows(m: MatMut<'_, f64>, f: &(impl Fn(MatMut<'_, f64>) + Sync)) {
    if m.nrows() <= ROWS {
        return f(m);
    }
    let half = m.nrows().div_ceil(ROWS) / 2 * ROWS;
    let (a, b) = m.split_at_row_mut(half);
    parallel::join(|| by_rows(a, f), || by_rows(b, f));
}

/// f of the number of the first column and the columns of each part.
fn by_columns(first: usize, m: MatMut<'_, f64>, f: &(impl Fn(usize, MatMut<'_, f64>) + Sync)) {
    if m.ncols() <= COLUMNS {
        return f(first, m);
    }
    let half = m.ncols().div_ceil(COLUMNS) / 2 * COLUMNS;
    let (a, b) = m.split_at_col_mut(half);
    parallel::join(|| by_columns(first, a, f), || by_columns(first + half, b, f));
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::linear::{Cholesky, LinearSolver};
    use crate::sparse::Matrix;

    /// A chain of cubes whose last separators have several parts: seven-point differences on m × m × 3m points, with a diagonal that
    /// varies.
    fn blocks(m: usize) -> Matrix {
        let at = |i: usize, j: usize, k: usize| (k * m + j) * m + i;
        let mut entries = Vec::new();
        for (i, j, k) in (0..3 * m).flat_map(|k| (0..m).flat_map(move |j| (0..m).map(move |i| (i, j, k)))) {
            entries.push((at(i, j, k), at(i, j, k), 6.01 + 0.1 * (at(i, j, k) % 7) as f64));
            let more = [
                (i + 1 < m, at(i + 1, j, k)),
                (j + 1 < m, at(i, j + 1, k)),
                (k + 1 < 3 * m, at(i, j, k + 1)),
            ];
            for (_, other) in more.into_iter().filter(|(inside, _)| *inside) {
                entries.push((at(i, j, k), other, -1.0));
                entries.push((other, at(i, j, k), -1.0));
            }
        }
        Matrix::from_triplets(3 * m * m * m, 3 * m * m * m, &entries).unwrap()
    }

    fn solved(a: &Matrix, b: &[f64]) -> Vec<f64> {
        let mut cholesky = Cholesky::new();
        cholesky.analyze(a.pattern().as_ref()).unwrap();
        cholesky.factor(a.as_ref()).unwrap();
        let mut x = b.to_vec();
        cholesky.solve_in_place(&mut x).unwrap();
        x
    }

    #[test]
    fn factors_solve_systems_with_the_same_bits_on_any_number_of_threads() {
        let a = blocks(14);
        let exact: Vec<f64> = (0..a.nrows()).map(|i| 1.0 + (i % 11) as f64).collect();
        let mut b = vec![0.0; exact.len()];
        a.mul_vec(&exact, &mut b);
        let x = solved(&a, &b);
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-10));
        #[cfg(feature = "rayon")]
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            assert_eq!(pool.install(|| solved(&a, &b)), x);
        }
    }

    /// A late pivot moves the least eigenvalue below 0.
    #[test]
    fn indefinite_matrices_and_time_that_is_over_are_told() {
        let mut a = blocks(10);
        let n = a.nrows();
        let mut cholesky = Cholesky::new();
        cholesky.analyze(a.pattern().as_ref()).unwrap();
        let over = Until::after(Some(Duration::ZERO));
        assert!(matches!(
            cholesky.factor_by_pivots(a.as_ref(), over),
            Err(LinearError::TimeLimit)
        ));
        cholesky.factor_by_pivots(a.as_ref(), Until::default()).unwrap();
        let span = a.pattern().col_ptr()[n / 2]..a.pattern().col_ptr()[n / 2 + 1];
        let diagonal = span.start + a.pattern().row_idx()[span].binary_search(&(n / 2)).unwrap();
        a.values_mut()[diagonal] = 0.3;
        assert!(matches!(
            cholesky.factor_by_pivots(a.as_ref(), Until::default()),
            Err(LinearError::NotPositiveDefinite)
        ));
    }
}
