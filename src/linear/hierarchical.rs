//! Symmetric matrices whose entries vary smoothly away from the diagonal, as the compliance of a contact line does: halved again and again,
//! their blocks beside the diagonal have low rank (HODLR; Ambikasaran, Darve, J. Sci. Comput. 57, 2013).

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use crate::sparse::max_abs;

/// Indices in a block that is stored as it is.
const LEAF: usize = 128;
/// Columns of a block that are compared with its factors at a time.
const PANEL: usize = 64;
/// Largest difference from an entry, in rounding errors of the largest one: products of rows with a vector have as many.
const ACCURACY: f64 = 16.0;
/// Crosses with pivots below the tolerance after which a block is compared with its factors.
const SMALL: usize = 2;

/// A symmetric matrix in hierarchical form.
#[derive(Debug, Clone)]
pub(crate) struct Hierarchical {
    /// The index at each position, and the position of each index.
    order: Vec<usize>,
    place: Vec<usize>,
    /// Each after its halves; the last one is the whole.
    blocks: Vec<Block>,
    largest_rank: usize,
}

/// A block on the diagonal.
#[derive(Debug, Clone)]
pub(super) struct Block {
    pub(super) first: usize,
    pub(super) len: usize,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone)]
pub(super) enum Kind {
    /// Entries, column-major.
    Leaf(Vec<f64>),
    /// Two blocks on the diagonal and X Yᵀ beside it.
    Halves {
        halves: [usize; 2],
        rank: usize,
        x: Vec<f64>,
        y: Vec<f64>,
    },
}

/// The entries of a full symmetric matrix.
struct Entries<'a> {
    order: usize,
    values: &'a [f64],
    tolerance: f64,
}

impl Entries<'_> {
    fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.order..(i + 1) * self.order]
    }

    /// The square of the distance that the matrix, as one of scalar products, gives two indices.
    fn distance(&self, i: usize, j: usize) -> f64 {
        let row = self.row(i);
        row[i] + self.row(j)[j] - 2.0 * row[j]
    }

    /// Orders groups of indices so that the halves are far apart.
    fn cut(&self, groups: &mut [&[usize]]) {
        let at = |g: &[usize]| g.first().copied().unwrap_or(0);
        let farthest = |from: usize| {
            let far = |g: &&[usize]| self.distance(from, at(g));
            let found = groups.iter().max_by(|a, b| far(a).total_cmp(&far(b)));
            found.map_or(from, |g| at(g))
        };
        let a = farthest(at(groups[0]));
        let b = farthest(a);
        let side = |g: &[usize]| self.distance(a, at(g)) - self.distance(b, at(g));
        groups.sort_by(|g, h| side(g).total_cmp(&side(h)).then(at(g).cmp(&at(h))));
    }
}

impl Hierarchical {
    /// The matrix of the given entries, each of which it has to 16 rounding errors of the largest one. `groups` say which indices stay
    /// together. `None` where the groups are no partition, or blocks have no low rank.
    pub(crate) fn new(values: &[f64], groups: &[Vec<usize>]) -> Option<Self> {
        let order: usize = groups.iter().map(Vec::len).sum();
        let mut place = vec![usize::MAX; order];
        let indices = groups.iter().flatten();
        if order * order != values.len() || groups.iter().any(Vec::is_empty) || groups.is_empty() {
            return None;
        }
        for &k in indices {
            if std::mem::replace(place.get_mut(k)?, 0) == 0 {
                return None;
            }
        }
        let entries = Entries {
            order,
            values,
            tolerance: ACCURACY * f64::EPSILON * max_abs(values),
        };
        let mut found = Self {
            order: Vec::with_capacity(order),
            place,
            blocks: Vec::new(),
            largest_rank: 0,
        };
        let mut groups: Vec<&[usize]> = groups.iter().map(Vec::as_slice).collect();
        found.add(&entries, &mut groups)?;
        for (position, &k) in found.order.iter().enumerate() {
            found.place[k] = position;
        }
        Some(found)
    }

    /// Adds the block of these groups; its number.
    fn add(&mut self, entries: &Entries<'_>, groups: &mut [&[usize]]) -> Option<usize> {
        let len = groups.iter().map(|g| g.len()).sum();
        let first = self.order.len();
        let kind = if len <= LEAF || groups.len() == 1 {
            self.order.extend(groups.iter().copied().flatten());
            let own = &self.order[first..];
            let columns = own.iter().map(|&k| entries.row(k));
            Kind::Leaf(columns.flat_map(|row| own.iter().map(|&i| row[i])).collect())
        } else {
            entries.cut(groups);
            let (left, right) = groups.split_at_mut(groups.len() / 2);
            let halves = [self.add(entries, left)?, self.add(entries, right)?];
            let middle = first + self.blocks[halves[0]].len;
            let cross = Cross::new(entries, &self.order[first..middle], &self.order[middle..])?;
            self.largest_rank = self.largest_rank.max(cross.rank());
            Kind::Halves {
                halves,
                rank: cross.rank(),
                x: cross.x,
                y: cross.y,
            }
        };
        self.blocks.push(Block { first, len, kind });
        Some(self.blocks.len() - 1)
    }

    pub(super) fn order(&self) -> &[usize] {
        &self.order
    }

    pub(super) fn place(&self) -> &[usize] {
        &self.place
    }

    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Subtracts the product with `vector` from `out`; `room` is scratch.
    pub(crate) fn subtract_product(&self, vector: &[f64], out: &mut [f64], room: &mut Vec<f64>) {
        let n = self.order.len();
        room.clear();
        room.resize(2 * n + 2 * self.largest_rank, 0.0);
        let (from, rest) = room.split_at_mut(n);
        let (to, small) = rest.split_at_mut(n);
        from.iter_mut()
            .zip(&self.order)
            .for_each(|(v, &k)| *v = vector[k]);
        for block in &self.blocks {
            let (from, to) = (
                &from[block.first..][..block.len],
                &mut to[block.first..][..block.len],
            );
            match &block.kind {
                Kind::Leaf(entries) => {
                    let entries = MatRef::from_column_major_slice(entries, block.len, block.len);
                    multiply(1.0, entries, from, to, Accum::Add);
                }
                Kind::Halves { halves, rank, x, y } => {
                    let middle = self.blocks[halves[0]].len;
                    let x = MatRef::from_column_major_slice(x, middle, *rank);
                    let y = MatRef::from_column_major_slice(y, block.len - middle, *rank);
                    let (upper, lower) = from.split_at(middle);
                    let (s, t) = small[..2 * rank].split_at_mut(*rank);
                    multiply(1.0, x.transpose(), upper, s, Accum::Replace);
                    multiply(1.0, y.transpose(), lower, t, Accum::Replace);
                    let (upper, lower) = to.split_at_mut(middle);
                    multiply(1.0, x, t, upper, Accum::Add);
                    multiply(1.0, y, s, lower, Accum::Add);
                }
            }
        }
        self.order.iter().zip(to).for_each(|(&k, v)| out[k] -= *v);
    }
}

/// to = or += scale · matrix · from.
pub(super) fn multiply(scale: f64, matrix: MatRef<'_, f64>, from: &[f64], to: &mut [f64], accum: Accum) {
    let rows = to.len();
    matmul(
        MatMut::from_column_major_slice_mut(to, rows, 1),
        accum,
        matrix,
        MatRef::from_column_major_slice(from, from.len(), 1),
        scale,
        Par::Seq,
    );
}

/// A block as X Yᵀ, from crosses of its rows and columns (adaptive cross approximation; Bebendorf, Numer. Math. 86, 2000), compared with
/// all its entries.
struct Cross<'a> {
    entries: &'a Entries<'a>,
    rows: &'a [usize],
    columns: &'a [usize],
    x: Vec<f64>,
    y: Vec<f64>,
    row: Vec<f64>,
    column: Vec<f64>,
}

impl<'a> Cross<'a> {
    fn new(entries: &'a Entries<'a>, rows: &'a [usize], columns: &'a [usize]) -> Option<Self> {
        let (m, n) = (rows.len(), columns.len());
        let mut cross = Self {
            entries,
            rows,
            columns,
            x: Vec::new(),
            y: Vec::new(),
            row: vec![0.0; n],
            column: vec![0.0; m],
        };
        // Beyond, the two factors of a large block take more memory than a quarter of it and its mirror image.
        let limit = (m.min(n) / 8).max(LEAF);
        let mut next = 0;
        loop {
            let mut small = 0;
            while small < SMALL && cross.rank() < m.min(n) {
                if cross.rank() > limit {
                    return None;
                }
                let Some((pivot, row)) = cross.add(next) else {
                    break;
                };
                next = row;
                small = if pivot > entries.tolerance { 0 } else { small + 1 };
            }
            let (worst, row) = cross.compare();
            // Written so that NaN fails.
            if worst <= entries.tolerance {
                return Some(cross);
            }
            if cross.rank() >= limit.min(m).min(n) || !worst.is_finite() {
                return None;
            }
            next = row;
        }
    }

    fn rank(&self) -> usize {
        self.x.len() / self.rows.len()
    }

    /// Row i of the difference.
    fn take_row(&mut self, i: usize) {
        let (m, n) = (self.rows.len(), self.columns.len());
        let row = self.entries.row(self.rows[i]);
        (self.row.iter_mut().zip(self.columns)).for_each(|(v, &k)| *v = row[k]);
        for (x, y) in self.x.chunks_exact(m).zip(self.y.chunks_exact(n)) {
            self.row.iter_mut().zip(y).for_each(|(v, y)| *v -= x[i] * y);
        }
    }

    /// Adds the cross of the column with the largest difference in row i and the row with the largest one in that column: the modulus of
    /// its pivot, and the row to go on with. `None` where the row is exact.
    fn add(&mut self, i: usize) -> Option<(f64, usize)> {
        let (m, n) = (self.rows.len(), self.columns.len());
        self.take_row(i);
        let j = largest(&self.row, None)?;
        let column = self.entries.row(self.columns[j]);
        (self.column.iter_mut().zip(self.rows)).for_each(|(v, &k)| *v = column[k]);
        for (x, y) in self.x.chunks_exact(m).zip(self.y.chunks_exact(n)) {
            self.column.iter_mut().zip(x).for_each(|(v, x)| *v -= y[j] * x);
        }
        let pivot_row = largest(&self.column, None)?;
        if pivot_row != i {
            self.take_row(pivot_row);
        }
        let pivot = self.column[pivot_row];
        let next = largest(&self.column, Some(pivot_row)).unwrap_or(pivot_row);
        self.x.extend(self.column.iter().map(|v| v / pivot));
        self.y.extend_from_slice(&self.row);
        Some((pivot.abs(), next))
    }

    /// The largest difference of an entry, and its row.
    fn compare(&self) -> (f64, usize) {
        let (m, n, rank) = (self.rows.len(), self.columns.len(), self.rank());
        let x = MatRef::from_column_major_slice(&self.x, m, rank);
        let y = MatRef::from_column_major_slice(&self.y, n, rank);
        let mut panel = vec![0.0; m * PANEL];
        let mut worst = (0.0, 0);
        for (place, columns) in self.columns.chunks(PANEL).enumerate() {
            let part = &mut panel[..m * columns.len()];
            for (part, &k) in part.chunks_exact_mut(m).zip(columns) {
                let column = self.entries.row(k);
                part.iter_mut().zip(self.rows).for_each(|(v, &i)| *v = column[i]);
            }
            matmul(
                MatMut::from_column_major_slice_mut(part, m, columns.len()),
                Accum::Add,
                x,
                y.subrows(place * PANEL, columns.len()).transpose(),
                -1.0,
                Par::Seq,
            );
            for part in part.chunks_exact(m) {
                for (i, v) in part.iter().enumerate() {
                    if v.abs() > worst.0 || v.is_nan() {
                        worst = (v.abs(), i);
                    }
                }
            }
        }
        worst
    }
}

/// The place of the largest modulus, but for one; `None` where all are 0.
fn largest(values: &[f64], except: Option<usize>) -> Option<usize> {
    let others = values
        .iter()
        .enumerate()
        .filter(|(k, v)| Some(*k) != except && **v != 0.0);
    others.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map(|v| v.0)
}
