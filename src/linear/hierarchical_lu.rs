use std::fmt;
use std::sync::Arc;

use faer::linalg::matmul::matmul;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::hierarchical::{Block, Hierarchical, Kind};
use super::memory::{check_finite, count_rhs};
use super::{DenseLu, LinearError, LinearSolver};
use crate::sparse::PatternRef;

/// The rows of −G C + H, and the column of the parameter beside it, where C is a large matrix and G and H have few entries: (row, column,
/// value), those of a row side by side.
#[derive(Debug, Clone, Default)]
pub(crate) struct CondensedRows {
    pub(crate) traces: Vec<(usize, usize, f64)>,
    pub(crate) multipliers: Vec<(usize, usize, f64)>,
    pub(crate) parameter: Vec<f64>,
}

/// Factors of −G C + H, where G and H couple nothing but indices in one leaf of a hierarchical C: the matrix has the blocks of C with their
/// rows combined.
#[derive(Clone)]
pub(crate) struct HierarchicalLu {
    of: Arc<Hierarchical>,
    /// As the blocks of C.
    parts: Vec<Part>,
    /// Divisors of the solutions; empty for ones.
    sizes: Vec<f64>,
    room: Room,
    work: Vec<f64>,
}

#[derive(Clone)]
enum Part {
    Leaf(Box<DenseLu>),
    /// A⁻¹ of the halves times the left factors of the blocks beside them, and the factors of the equations for their right factors.
    Halves {
        upper: Vec<f64>,
        lower: Vec<f64>,
        small: Box<DenseLu>,
    },
}

/// Scratch of solves.
#[derive(Debug, Clone, Default)]
struct Room {
    leaf: Vec<f64>,
    small: Vec<f64>,
}

/// Entries of G or H by position, in the order of their rows.
fn by_place(entries: &[(usize, usize, f64)], place: &[usize]) -> Option<Vec<(usize, usize, f64)>> {
    let moved = |&(i, k, v): &(usize, usize, f64)| Some((*place.get(i)?, *place.get(k)?, v));
    let mut moved: Vec<_> = entries.iter().map(moved).collect::<Option<_>>()?;
    moved.sort_by_key(|e| (e.0, e.1));
    Some(moved)
}

/// Those of the rows of a block, counted from its first; `None` where one couples it with what is outside.
fn within<'a>(
    entries: &'a [(usize, usize, f64)],
    first: usize,
    len: usize,
) -> impl Iterator<Item = Option<(usize, usize, f64)>> + 'a {
    let from = entries.partition_point(|e| e.0 < first);
    let to = entries.partition_point(|e| e.0 < first + len);
    entries[from..to].iter().map(move |&(i, k, v)| {
        let inside = (first..first + len).contains(&k);
        inside.then(|| (i - first, k - first, v))
    })
}

const COUPLED: LinearError = LinearError::NotAnalyzed;

impl HierarchicalLu {
    /// Factors (−G C + H) D, with the sizes D of the unknowns; none for ones.
    ///
    /// # Errors
    /// A block on the diagonal that is singular, though the matrix need not be; rows that couple two leaves.
    pub(crate) fn new(
        of: Arc<Hierarchical>,
        rows: &CondensedRows,
        sizes: &[f64],
    ) -> Result<Self, LinearError> {
        let traces = by_place(&rows.traces, of.place()).ok_or(COUPLED)?;
        let multipliers = by_place(&rows.multipliers, of.place()).ok_or(COUPLED)?;
        let mut lu = Self {
            parts: Vec::with_capacity(of.blocks().len()),
            of: Arc::clone(&of),
            sizes: sizes.to_vec(),
            room: Room::default(),
            work: Vec::new(),
        };
        for block in of.blocks() {
            let part = match &block.kind {
                Kind::Leaf(entries) => leaf(block, entries, &traces, &multipliers)?,
                Kind::Halves { halves, rank, x, y } => {
                    let middle = of.blocks()[halves[0]].len;
                    let below = block.len - middle;
                    let mut upper = combined(&traces, block.first, middle, x)?;
                    let mut lower = combined(&traces, block.first + middle, below, y)?;
                    let (a, b) = (
                        MatMut::from_column_major_slice_mut(&mut upper, middle, *rank),
                        MatMut::from_column_major_slice_mut(&mut lower, below, *rank),
                    );
                    solve(&of, &mut lu.parts, halves[0], a, &mut lu.room)?;
                    solve(&of, &mut lu.parts, halves[1], b, &mut lu.room)?;
                    let small = coupling(*rank, [x, y], [&upper, &lower])?;
                    Part::Halves { upper, lower, small }
                }
            };
            lu.parts.push(part);
        }
        Ok(lu)
    }
}

/// −G C + H in a leaf.
fn leaf(
    block: &Block,
    entries: &[f64],
    traces: &[(usize, usize, f64)],
    multipliers: &[(usize, usize, f64)],
) -> Result<Part, LinearError> {
    let n = block.len;
    let mut values = combined(traces, block.first, n, entries)?;
    for entry in within(multipliers, block.first, n) {
        let (i, k, v) = entry.ok_or(COUPLED)?;
        values[k * n + i] += v;
    }
    let mut lu = Box::new(DenseLu::new());
    lu.factor_full(n, &values)?;
    Ok(Part::Leaf(lu))
}

/// −G X for the rows of a block.
fn combined(
    traces: &[(usize, usize, f64)],
    first: usize,
    len: usize,
    x: &[f64],
) -> Result<Vec<f64>, LinearError> {
    let mut out = vec![0.0; x.len()];
    for entry in within(traces, first, len) {
        let (i, k, v) = entry.ok_or(COUPLED)?;
        for (out, x) in out.chunks_exact_mut(len).zip(x.chunks_exact(len)) {
            out[i] -= v * x[k];
        }
    }
    Ok(out)
}

/// [I, Yᵀ Q; Xᵀ P, I], factored.
fn coupling(rank: usize, [x, y]: [&[f64]; 2], [p, q]: [&[f64]; 2]) -> Result<Box<DenseLu>, LinearError> {
    let mut small = vec![0.0; 4 * rank * rank];
    for k in 0..2 * rank {
        small[k * 2 * rank + k] = 1.0;
    }
    let view = MatMut::from_column_major_slice_mut(&mut small, 2 * rank, 2 * rank);
    let (left, right) = view.split_at_col_mut(rank);
    for (target, a, b) in [
        (right.subrows_mut(0, rank), y, q),
        (left.subrows_mut(rank, rank), x, p),
    ] {
        let rows = a.len() / rank.max(1);
        let a = MatRef::from_column_major_slice(a, rows, rank);
        let b = MatRef::from_column_major_slice(b, rows, rank);
        matmul(target, Accum::Replace, a.transpose(), b, 1.0, Par::Seq);
    }
    let mut lu = Box::new(DenseLu::new());
    lu.factor_full(2 * rank, &small)?;
    Ok(lu)
}

/// Overwrites b by the solution for the block with a number: with x̃ from the halves alone, s = Yᵀ x₂ and t = Xᵀ x₁ satisfy
/// x₁ = x̃₁ − P s and x₂ = x̃₂ − Q t.
fn solve(
    of: &Hierarchical,
    parts: &mut [Part],
    number: usize,
    b: MatMut<'_, f64>,
    room: &mut Room,
) -> Result<(), LinearError> {
    let block = &of.blocks()[number];
    let columns = b.ncols();
    let Kind::Halves { halves, rank, x, y } = &block.kind else {
        let Part::Leaf(lu) = &mut parts[number] else {
            return Err(LinearError::NotFactored);
        };
        room.leaf.clear();
        for column in b.rb().col_iter() {
            room.leaf.extend(column.iter());
        }
        lu.solve_in_place(&mut room.leaf)?;
        let solved = room.leaf.chunks_exact(block.len.max(1));
        for (column, solved) in b.col_iter_mut().zip(solved) {
            column.iter_mut().zip(solved).for_each(|(b, v)| *b = *v);
        }
        return Ok(());
    };
    let middle = of.blocks()[halves[0]].len;
    let below = block.len - middle;
    let (mut above, mut under) = b.split_at_row_mut(middle);
    solve(of, parts, halves[0], above.rb_mut(), room)?;
    solve(of, parts, halves[1], under.rb_mut(), room)?;
    let Part::Halves { upper, lower, small } = &mut parts[number] else {
        return Err(LinearError::NotFactored);
    };
    let rank = *rank;
    if rank == 0 {
        return Ok(());
    }
    room.small.resize(2 * rank * columns, 0.0);
    let view = MatMut::from_column_major_slice_mut(&mut room.small, 2 * rank, columns);
    let (s, t) = view.split_at_row_mut(rank);
    let as_matrix = |values, rows| MatRef::from_column_major_slice(values, rows, rank);
    let (x, y) = (as_matrix(x, middle), as_matrix(y, below));
    matmul(s, Accum::Replace, y.transpose(), under.rb(), 1.0, Par::Seq);
    matmul(t, Accum::Replace, x.transpose(), above.rb(), 1.0, Par::Seq);
    small.solve_in_place(&mut room.small)?;
    let view = MatRef::from_column_major_slice(&room.small, 2 * rank, columns);
    let (s, t) = view.split_at_row(rank);
    matmul(above, Accum::Add, as_matrix(upper, middle), s, -1.0, Par::Seq);
    matmul(under, Accum::Add, as_matrix(lower, below), t, -1.0, Par::Seq);
    Ok(())
}

impl LinearSolver for HierarchicalLu {
    fn analyze(&mut self, _pattern: PatternRef<'_>) -> Result<(), LinearError> {
        Ok(())
    }

    /// Never used: factors are made by [`new`](Self::new), which knows more of the matrix than its entries.
    fn factor(&mut self, _a: crate::sparse::MatrixRef<'_>) -> Result<(), LinearError> {
        Err(LinearError::NotAnalyzed)
    }

    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let n = self.of.order().len();
        let columns = count_rhs(n, b)?;
        check_finite(b, "the right-hand side")?;
        let mut work = std::mem::take(&mut self.work);
        work.clear();
        for b in b.chunks_exact(n) {
            work.extend(self.of.order().iter().map(|&k| b[k]));
        }
        let view = MatMut::from_column_major_slice_mut(&mut work, n, columns);
        let solved = solve(
            &self.of,
            &mut self.parts,
            self.of.blocks().len() - 1,
            view,
            &mut self.room,
        );
        if solved.is_ok() {
            for (b, work) in b.chunks_exact_mut(n).zip(work.chunks_exact(n)) {
                self.of.order().iter().zip(work).for_each(|(&k, v)| b[k] = *v);
                b.iter_mut().zip(&self.sizes).for_each(|(b, d)| *b /= d);
            }
        }
        self.work = work;
        solved
    }

    /// Never used.
    fn solve_transpose_in_place(&mut self, _b: &mut [f64]) -> Result<(), LinearError> {
        Err(LinearError::NotFactored)
    }

    fn log_det(&self) -> Option<(i8, f64)> {
        let mut factors = self.parts.iter().map(|part| match part {
            Part::Leaf(lu) | Part::Halves { small: lu, .. } => lu.log_det(),
        });
        let scale: f64 = self.sizes.iter().map(|d| d.ln()).sum();
        factors.try_fold((1, scale), |(sign, log), part| {
            let (own, more) = part?;
            Some((sign * own, log + more))
        })
    }
}

impl fmt::Debug for HierarchicalLu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HierarchicalLu")
            .field("order", &self.of.order().len())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::dense_zeros;
    use crate::sparse::max_abs;
    use crate::spread::Random;

    /// The compliance of a line of p points, each with two components: a logarithm of the distance in both, and its sign between them. Points
    /// are numbered at random.
    fn line(p: usize) -> (Vec<f64>, Vec<Vec<usize>>) {
        let mut random = Random::new(7);
        let mut points: Vec<(f64, usize)> = (0..p).map(|k| (random.symmetric(), k)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut place = vec![0.0; p];
        points
            .iter()
            .enumerate()
            .for_each(|(at, &(_, k))| place[k] = at as f64 / p as f64);
        let mut c = dense_zeros(2 * p, 2 * p).unwrap();
        for i in 0..p {
            for j in 0..p {
                let d = place[i] - place[j];
                let same = 3.0 - (d.abs() + 0.5 / p as f64).ln();
                let across = 0.3 * d / (d.abs() + 0.01);
                c[j * 2 * p + i] = same;
                c[(p + j) * 2 * p + p + i] = 1.25 * same;
                c[j * 2 * p + p + i] = across;
                c[(p + i) * 2 * p + j] = across;
            }
        }
        (c, (0..p).map(|k| vec![k, p + k]).collect())
    }

    fn vector(n: usize, seed: u64) -> Vec<f64> {
        let mut random = Random::new(seed);
        (0..n).map(|_| random.symmetric()).collect()
    }

    /// Products are those of the entries, to 16 rounding errors of the largest one in each.
    #[test]
    fn products_are_those_of_the_entries() {
        for p in [3, 100, 400] {
            let (c, groups) = line(p);
            let n = 2 * p;
            let found = Hierarchical::new(&c, &groups).unwrap();
            let x = vector(n, 1);
            let (mut y, mut room) = (vec![0.5; n], Vec::new());
            found.subtract_product(&x, &mut y, &mut room);
            let sum: f64 = x.iter().map(|v| v.abs()).sum();
            for (i, y) in y.iter().enumerate() {
                let product: f64 = (0..n).map(|j| c[i * n + j] * x[j]).sum();
                assert!((y - (0.5 - product)).abs() < 32.0 * f64::EPSILON * max_abs(&c) * sum);
            }
        }
    }

    /// Matrices without the structure, and groups that are no partition, are refused.
    #[test]
    fn other_matrices_are_refused() {
        let (c, mut groups) = line(400);
        let mut rough = c.clone();
        for i in 0..800 {
            for j in 0..i {
                let noise = 1e-3 * ((i * j) as f64).sin();
                rough[i * 800 + j] += noise;
                rough[j * 800 + i] += noise;
            }
        }
        assert!(Hierarchical::new(&rough, &groups).is_none());
        groups[3][0] = 4;
        assert!(Hierarchical::new(&c, &groups).is_none());
        groups.pop();
        assert!(Hierarchical::new(&c, &groups).is_none());
    }

    /// Solutions and determinants of −G C + H agree with those of a dense factorisation, for nodes that are open (λ = 0), stick (given
    /// motion) and slip (given normal motion, tangential force by friction), in scaled unknowns, many right-hand sides at a time.
    #[test]
    fn solutions_agree_with_those_of_dense_factors() {
        let p = 300;
        let (c, groups) = line(p);
        let n = 2 * p;
        let of = Arc::new(Hierarchical::new(&c, &groups).unwrap());
        let mut rows = CondensedRows::default();
        for k in 0..p {
            match (k * k + k / 3) % 3 {
                0 => rows.multipliers.extend([(k, k, 1.0), (p + k, p + k, 1.0)]),
                1 => rows.traces.extend([(k, k, 1.0), (p + k, p + k, 1.0)]),
                _ => {
                    rows.traces.push((k, k, -2.0));
                    rows.multipliers.extend([(p + k, p + k, 1.0), (p + k, k, 0.4)]);
                }
            }
        }
        let sizes: Vec<f64> = (0..n).map(|k| if k % 2 == 0 { 0.25 } else { 8.0 }).collect();
        let mut dense = vec![0.0; n * n];
        for &(i, k, g) in &rows.traces {
            (0..n).for_each(|j| dense[j * n + i] -= g * c[k * n + j] * sizes[j]);
        }
        for &(i, k, h) in &rows.multipliers {
            dense[k * n + i] += h * sizes[k];
        }
        let mut exact = DenseLu::new();
        exact.factor_full(n, &dense).unwrap();
        let mut found = HierarchicalLu::new(of, &rows, &sizes).unwrap();
        let (mut x, mut y) = (vector(5 * n, 2), vector(5 * n, 2));
        exact.solve_in_place(&mut x).unwrap();
        found.solve_in_place(&mut y).unwrap();
        let size = max_abs(&x);
        assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-11 * size));
        let ((sign, log), (expected, exact)) = (found.log_det().unwrap(), exact.log_det().unwrap());
        assert_eq!(sign, expected);
        assert!((log - exact).abs() < 1e-10 * exact.abs());
    }

    /// Rows that couple far points cannot be factored by blocks, nor can singular blocks.
    #[test]
    fn rows_beyond_the_structure_are_refused() {
        let p = 300;
        let (c, groups) = line(p);
        let of = Arc::new(Hierarchical::new(&c, &groups).unwrap());
        let far = of.order()[2 * p - 1];
        let first = of.order()[0];
        let mut rows = CondensedRows::default();
        rows.traces.extend((0..2 * p).map(|k| (k, k, 1.0)));
        assert!(HierarchicalLu::new(Arc::clone(&of), &rows, &[]).is_ok());
        rows.traces.push((first, far, 0.5));
        assert!(HierarchicalLu::new(Arc::clone(&of), &rows, &[]).is_err());
        rows.traces.pop();
        rows.traces.retain(|e| e.0 != first);
        assert!(HierarchicalLu::new(of, &rows, &[]).is_err());
    }
}
