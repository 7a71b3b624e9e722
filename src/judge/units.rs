//! Units of the rows and unknowns of M x + q that do not depend on those in which the problem was given.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::sparse::Matrix;

/// Sizes are logarithms to base 2 in 64ths, as whole numbers: sums and differences of them are exact.
const PARTS: i64 = 64;
/// The size of 0, and a weight below those of pairs with diagonals.
const NONE: i64 = i64::MIN;
const LEAST: i64 = i64::MIN / 2;
/// Rounds over all pairs in which the differences of mutual entries are spread evenly: where pairs are many, one suffices, and where they
/// are few, the tree does (`units::cone_problems`).
const ROUNDS: usize = 1;
/// Powers of two that are used: products of two of them and of a number of usual size are numbers.
const LARGEST: i64 = 400;

/// Exponents r and c, one for each block of unknowns, of the units in which a problem is solved: 2^r M 2^c and 2^r q take the places of M
/// and q, and x = 2^c x̃.
///
/// A problem in other units, 2^a M 2^b and 2^a q with a and b whole numbers for each block, has r − a and c − b: in these units it is the
/// same problem, to the last bit. Besides, as far as there is a choice,
///
/// * a matrix that differs from a symmetric (skew, monotone) one by units only becomes one: mutual entries M_IJ and M_JI become of one size,
/// * entries on the diagonal are in [1, 4), and the largest ones beside a diagonal that vanishes near 1,
/// * the largest of what constants and bounds say about the x of blocks that depend on each other is near 1.
#[derive(Debug, Clone, Default)]
pub(crate) struct Units {
    /// r and c.
    pub(crate) rows: Vec<i64>,
    pub(crate) unknowns: Vec<i64>,
    /// The largest entries of blocks, column by column.
    ptr: Vec<usize>,
    entries: Vec<Entry>,
    diagonal: Vec<i64>,
    /// r + c, r − c, twice the size of the constants.
    sum: Vec<i64>,
    difference: Vec<i64>,
    known: Vec<bool>,
    /// Blocks as they are reached, with the one through which, and where each set that is connected by pairs begins.
    order: Vec<(usize, usize)>,
    sets: Vec<usize>,
    odd: Vec<bool>,
    set_of: Vec<usize>,
    fresh: Vec<usize>,
    shift: Vec<f64>,
    next: Vec<usize>,
    best: Vec<i64>,
    waiting: BinaryHeap<(i64, Reverse<usize>, usize)>,
}

/// An entry M_IJ of column J, by its row, with its size and that of M_JI.
#[derive(Debug, Clone, Copy)]
struct Entry {
    row: usize,
    size: i64,
    mutual: i64,
}

/// The sizes of a problem by blocks; 0 stands for none.
pub(crate) struct Sizes<'a> {
    /// The block of each row and unknown; `None` where each is one.
    pub(crate) owner: Option<&'a [usize]>,
    pub(crate) blocks: usize,
    pub(crate) matrix: &'a Matrix,
    /// The largest constant of each block, and the largest of its bounds.
    pub(crate) constant: &'a dyn Fn(usize) -> f64,
    pub(crate) bound: &'a dyn Fn(usize) -> f64,
    /// Whether mutual entries keep their ratios, so that a monotone problem stays one.
    pub(crate) keep_ratios: bool,
}

/// log₂ |v| in 64ths, linear between powers of two: for numbers that differ by a power of two the results differ by exactly that.
fn size(v: f64) -> i64 {
    let v = v.abs();
    if v == 0.0 || !v.is_finite() {
        return NONE;
    }
    let (v, shift) = match v.is_normal() {
        true => (v, 0),
        false => (v * 64.0_f64.exp2(), -64),
    };
    (v.to_bits() >> (52 - 6)) as i64 + PARTS * (shift - 1023)
}

/// The number of a size, to two digits and up to 1.
fn share(size: i64) -> f64 {
    f64::from_bits(((size.clamp(-500 * PARTS, 0) + 1023 * PARTS) as u64) << (52 - 6))
}

/// The exponent of the power of two below.
fn whole(size: i64) -> i64 {
    size.div_euclid(PARTS)
}

impl Units {
    /// Those of a problem; false where all are 0, or where they would be no numbers, and the problem is best solved as it is.
    pub(crate) fn find(&mut self, sizes: &Sizes<'_>) -> bool {
        self.read(sizes);
        self.reach_all();
        match sizes.keep_ratios {
            true => self.difference.fill(0),
            false => self.balance(),
        }
        self.level();
        self.level_halves(sizes);
        if sizes.keep_ratios {
            self.sets.truncate(1);
            self.sets.push(self.order.len());
        }
        self.settle();
        self.settle_sizes(sizes);
        let in_range = |r: &i64| r.abs() <= LARGEST;
        let kept = self.rows.iter().chain(&self.unknowns).all(in_range);
        kept && self.rows.iter().chain(&self.unknowns).any(|r| *r != 0)
    }

    /// The entries between blocks: row, column and size.
    fn all(&self) -> impl Iterator<Item = (usize, usize, i64)> + '_ {
        let columns = self.ptr.windows(2).enumerate();
        columns.flat_map(|(j, span)| {
            self.entries[span[0]..span[1]]
                .iter()
                .map(move |e| (e.row, j, e.size))
        })
    }

    /// Neighbours J of I with both entries M_IJ and M_JI, and the sizes of these.
    fn pairs(&self, i: usize) -> impl Iterator<Item = (usize, i64, i64)> + '_ {
        let column = self.entries[self.ptr[i]..self.ptr[i + 1]].iter();
        column
            .filter(move |e| e.row != i && e.mutual != NONE)
            .map(|e| (e.row, e.mutual, e.size))
    }

    fn read(&mut self, sizes: &Sizes<'_>) {
        let pattern = sizes.matrix.pattern();
        let of = |i: usize| sizes.owner.map_or(i, |owner| owner[i]);
        self.entries.clear();
        self.ptr.clear();
        self.diagonal.clear();
        let mut first = 0;
        for block in 0..sizes.blocks {
            let begin = self.entries.len();
            self.ptr.push(begin);
            while first < pattern.ncols() && of(first) == block {
                for e in pattern.col_ptr()[first]..pattern.col_ptr()[first + 1] {
                    let v = size(sizes.matrix.values()[e]);
                    if v != NONE {
                        self.entries.push(Entry {
                            row: of(pattern.row_idx()[e]),
                            size: v,
                            mutual: NONE,
                        });
                    }
                }
                first += 1;
            }
            self.add_up(begin);
            let column = &self.entries[begin..];
            let own = column.binary_search_by_key(&block, |e| e.row);
            self.diagonal.push(own.map_or(NONE, |e| column[e].size));
        }
        self.ptr.push(self.entries.len());
        // Columns J in their order meet the entries of row J in theirs: where each column has been read to.
        self.next.clear();
        self.next.extend_from_slice(&self.ptr[..sizes.blocks]);
        for j in 0..sizes.blocks {
            for e in self.ptr[j]..self.ptr[j + 1] {
                let i = self.entries[e].row;
                let next = &mut self.next[i];
                while *next < self.ptr[i + 1] && self.entries[*next].row < j {
                    *next += 1;
                }
                if *next < self.ptr[i + 1] && self.entries[*next].row == j {
                    self.entries[e].mutual = self.entries[*next].size;
                }
            }
        }
        for list in [
            &mut self.rows,
            &mut self.unknowns,
            &mut self.sum,
            &mut self.difference,
        ] {
            list.clear();
            list.resize(sizes.blocks, 0);
        }
        self.set_of.clear();
        self.set_of.resize(sizes.blocks, 0);
        for list in [&mut self.known, &mut self.odd] {
            list.clear();
            list.resize(sizes.blocks, false);
        }
    }

    /// The norm of each block of the last column, from its largest entry on: what is added depends on ratios only.
    fn add_up(&mut self, begin: usize) {
        let column = &mut self.entries[begin..];
        if column.windows(2).all(|e| e[0].row < e[1].row) {
            return;
        }
        column.sort_unstable_by_key(|e| (e.row, Reverse(e.size)));
        let (mut end, mut first) = (0, 0);
        while first < column.len() {
            let largest = column[first];
            let same = column[first..].iter().take_while(|e| e.row == largest.row);
            let (mut count, mut squares) = (0, 0.0);
            for e in same {
                squares += share(2 * (e.size - largest.size));
                count += 1;
            }
            column[end] = largest;
            column[end].size += size(squares) / 2;
            (end, first) = (end + 1, first + count);
        }
        self.entries.truncate(begin + end);
    }

    /// The size of a pair of mutual entries beside the diagonals, which is the same in all units.
    fn weight(&self, i: usize, j: usize, pair: i64) -> i64 {
        match (self.diagonal[i], self.diagonal[j]) {
            (NONE, _) | (_, NONE) => LEAST,
            (a, b) => pair - a - b,
        }
    }

    /// Sets of blocks that pairs connect, each along a tree of the largest ones.
    fn reach_all(&mut self) {
        self.order.clear();
        self.sets.clear();
        self.best.clear();
        self.best.resize(self.diagonal.len(), NONE);
        let mut waiting = std::mem::take(&mut self.waiting);
        for root in 0..self.diagonal.len() {
            if self.known[root] {
                continue;
            }
            self.sets.push(self.order.len());
            waiting.push((0, Reverse(root), root));
            while let Some((_, Reverse(i), through)) = waiting.pop() {
                if std::mem::replace(&mut self.known[i], true) {
                    continue;
                }
                self.order.push((i, through));
                self.odd[i] = i != root && !self.odd[through];
                for e in self.ptr[i]..self.ptr[i + 1] {
                    let Entry { row: j, size, mutual } = self.entries[e];
                    if mutual == NONE || self.known[j] {
                        continue;
                    }
                    let weight = self.weight(i, j, size + mutual);
                    if weight > self.best[j] {
                        self.best[j] = weight;
                        self.difference[j] = self.difference[i] + mutual - size;
                        waiting.push((weight, Reverse(j), i));
                    }
                }
            }
        }
        self.waiting = waiting;
        self.sets.push(self.order.len());
    }

    /// r − c, such that mutual entries M_IJ and M_JI become of one size: along the trees, then evenly over all pairs.
    fn balance(&mut self) {
        // What the differences miss, which is the same in all units.
        self.shift.clear();
        self.shift.resize(self.diagonal.len(), 0.0);
        let missed = |units: &Self, (j, here, there): (usize, i64, i64), i: usize| {
            here + units.difference[i] - there - units.difference[j]
        };
        for _ in 0..ROUNDS {
            for place in 0..self.order.len() {
                let i = self.order[place].0;
                let (mut sum, mut weights) = (0.0, 0.0);
                for pair in self.pairs(i) {
                    // Pairs count by their size beside the diagonals, as in the definiteness of M.
                    let w = self.weight(i, pair.0, pair.1 + pair.2);
                    let w = if w == LEAST { 1.0 } else { share(w / 2) };
                    sum += w * (self.shift[pair.0] - missed(self, pair, i) as f64);
                    weights += w;
                }
                if weights > 0.0 {
                    self.shift[i] = sum / weights;
                }
            }
        }
        // Whole powers of two, relative to the first block of each set.
        for set in self.sets.windows(2) {
            let members = &self.order[set[0]..set[1]];
            let first = self.shift[members[0].0];
            for &(i, _) in members {
                let exact = self.difference[i] as f64 + (self.shift[i] - first);
                self.difference[i] = (exact / PARTS as f64 + 0.5).floor() as i64;
            }
        }
    }

    /// r + c from the diagonal, and where it vanishes from the largest pair.
    fn level(&mut self) {
        for (i, d) in self.diagonal.iter().enumerate() {
            self.known[i] = *d != NONE;
            self.sum[i] = if self.known[i] { -whole(*d) } else { 0 };
        }
        for set in 0..self.sets.len() - 1 {
            let (first, end) = (self.sets[set], self.sets[set + 1]);
            if !(first..end).any(|at| self.known[self.order[at].0]) {
                self.level_by_pairs(first..end);
                continue;
            }
            // Forwards along the tree, and back where the first ones are not known.
            for place in (first..end).chain((first..end).rev()).chain(first..end) {
                let i = self.order[place].0;
                if self.known[i] {
                    continue;
                }
                let neighbours = self.pairs(i).filter(|e| self.known[e.0]);
                let largest = neighbours
                    .map(|(j, here, there)| whole(here + there) + self.sum[j])
                    .max();
                if let Some(largest) = largest {
                    (self.known[i], self.sum[i]) = (true, -largest);
                }
            }
        }
    }

    /// r + c where the whole diagonal vanishes: along the tree, and from the first pair that closes an odd circle, where there is one.
    fn level_by_pairs(&mut self, members: std::ops::Range<usize>) {
        let mut circle = None;
        for at in members.clone() {
            let (i, through) = self.order[at];
            if at > members.start {
                let found = self.pairs(i).find(|e| e.0 == through);
                let pair = found.map_or(0, |e| e.1 + e.2);
                self.sum[i] = -whole(pair) - self.sum[through];
            }
        }
        for at in members.clone() {
            let i = self.order[at].0;
            let closing = self.pairs(i).find(|e| self.odd[e.0] == self.odd[i]);
            if let Some((j, here, there)) = closing {
                let missed = (whole(here + there) + self.sum[i] + self.sum[j]).div_euclid(2);
                circle = Some(if self.odd[i] { -missed } else { missed });
                break;
            }
        }
        // In halves that no odd circle connects the constants decide, later.
        let Some(missed) = circle else { return };
        for at in members {
            let i = self.order[at].0;
            self.sum[i] -= if self.odd[i] { -missed } else { missed };
            self.known[i] = true;
        }
    }

    /// Where no diagonal entry fixes r + c, the constants of both halves of a set become of one size.
    fn level_halves(&mut self, sizes: &Sizes<'_>) {
        for set in 0..self.sets.len() - 1 {
            let members = &self.order[self.sets[set]..self.sets[set + 1]];
            if self.known[members[0].0] {
                continue;
            }
            let mut largest = [NONE; 2];
            for &(i, _) in members {
                let q = size((sizes.constant)(i));
                if q != NONE {
                    let half = &mut largest[usize::from(self.odd[i])];
                    *half = (*half).max(2 * whole(q) + self.sum[i] + self.difference[i]);
                }
            }
            if largest.contains(&NONE) {
                continue;
            }
            let apart = (largest[1] - largest[0]).div_euclid(2);
            for &(i, _) in members {
                self.sum[i] += if self.odd[i] { -apart } else { apart };
            }
        }
    }

    /// r and c from sum and difference.
    fn settle(&mut self) {
        for set in self.sets.windows(2) {
            let members = &self.order[set[0]..set[1]];
            // Which sums are odd depends on the units, whether two are alike does not.
            let parity = self.sum[members[0].0].rem_euclid(2);
            for &(i, _) in members {
                self.difference[i] += parity;
                self.sum[i] -= (self.sum[i] + self.difference[i]).rem_euclid(2);
                self.rows[i] = (self.sum[i] + self.difference[i]) / 2;
                self.unknowns[i] = (self.sum[i] - self.difference[i]) / 2;
            }
        }
    }

    /// The largest of what bounds and constants say about x becomes 1 in each set, and where there are none, that of the entries that lead
    /// to sets whose sizes are known.
    fn settle_sizes(&mut self, sizes: &Sizes<'_>) {
        let (mut largest, mut given) = (
            std::mem::take(&mut self.sum),
            std::mem::take(&mut self.difference),
        );
        largest.fill(NONE);
        given.fill(NONE);
        self.known.fill(false);
        for set in 0..self.sets.len() - 1 {
            for at in self.sets[set]..self.sets[set + 1] {
                self.set_of[self.order[at].0] = set;
            }
        }
        for (i, j, v) in self.all() {
            if self.set_of[i] == self.set_of[j] {
                largest[i] = largest[i].max(whole(v) + self.rows[i] + self.unknowns[j]);
            }
        }
        for (i, given) in given.iter_mut().enumerate() {
            let q = size((sizes.constant)(i));
            if q != NONE {
                *given = whole(q) + self.rows[i];
            }
        }
        // First what constants and bounds say, then level by level what is known through others.
        let mut unknown = self.order.len();
        self.next.clear();
        self.next.extend(0..self.sets.len() - 1);
        while !self.next.is_empty() {
            for at in 0..self.next.len() {
                let set = self.next[at];
                let members = self.sets[set]..self.sets[set + 1];
                let first = self.order[members.start].0;
                if members.len() == 1 && self.diagonal[first] == NONE {
                    self.take_alone(sizes, first, given[first]);
                } else if !self.known[first] {
                    self.take_size(sizes, members, (&largest, &given));
                }
            }
            self.next.clear();
            unknown -= self.fresh.len().min(unknown);
            if unknown == 0 {
                self.fresh.clear();
            }
            for j in self.fresh.drain(..) {
                for e in &self.entries[self.ptr[j]..self.ptr[j + 1]] {
                    if !self.known[e.row] {
                        given[e.row] = given[e.row].max(whole(e.size) + self.rows[e.row] + self.unknowns[j]);
                        self.next.push(self.set_of[e.row]);
                    }
                }
            }
            self.next.sort_unstable();
            self.next.dedup();
        }
        self.take_lone_columns();
        (self.sum, self.difference) = (largest, given);
    }

    /// The unit of a row that does not depend on its own unknown, and that of this unknown from its bounds: independent of each other.
    fn take_alone(&mut self, sizes: &Sizes<'_>, i: usize, given: i64) {
        if !self.known[i] && given != NONE {
            self.rows[i] -= given;
            self.known[i] = true;
        }
        let bound = size((sizes.bound)(i));
        // Its own flag: `odd` has no other use for a set of one.
        if bound != NONE && !self.odd[i] {
            self.odd[i] = true;
            self.unknowns[i] = whole(bound);
            self.fresh.push(i);
        }
    }

    /// Unknowns on which their own rows do not depend, without bounds: in the units in which the largest entry of the column is near 1.
    fn take_lone_columns(&mut self) {
        for set in self.sets.windows(2).filter(|set| set[1] == set[0] + 1) {
            let j = self.order[set[0]].0;
            if self.diagonal[j] == NONE && !self.odd[j] {
                let rows = self.entries[self.ptr[j]..self.ptr[j + 1]].iter();
                let used = rows.filter(|e| self.known[e.row]);
                let largest = used.map(|e| whole(e.size) + self.rows[e.row]).max();
                self.unknowns[j] = -largest.unwrap_or(0);
            }
        }
    }

    /// The size of one set, if something is known about it.
    fn take_size(&mut self, sizes: &Sizes<'_>, members: std::ops::Range<usize>, known: (&[i64], &[i64])) {
        let (largest, given) = known;
        let mut reach = NONE;
        for at in members.clone() {
            let i = self.order[at].0;
            let bound = size((sizes.bound)(i));
            if bound != NONE {
                reach = reach.max(whole(bound) - self.unknowns[i]);
            }
            if given[i] != NONE && largest[i] != NONE {
                reach = reach.max(given[i] - largest[i]);
            }
        }
        if reach == NONE {
            return;
        }
        for at in members {
            let i = self.order[at].0;
            self.rows[i] -= reach;
            self.unknowns[i] += reach;
            self.known[i] = true;
            self.fresh.push(i);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spread::Random;

    fn units(m: &Matrix, q: &[f64], bounds: &[f64], owner: &[usize]) -> Option<Units> {
        let of = |v: &[f64], block: usize| {
            let own = v.iter().zip(owner).filter(|e| *e.1 == block);
            own.fold(0.0_f64, |a, e| a.max(e.0.abs()))
        };
        let mut units = Units::default();
        let found = units.find(&Sizes {
            owner: Some(owner),
            blocks: owner.last().map_or(0, |b| b + 1),
            matrix: m,
            constant: &|i| of(q, i),
            bound: &|i| of(bounds, i),
            keep_ratios: false,
        });
        (found || units.rows.iter().chain(&units.unknowns).all(|r| *r == 0)).then_some(units)
    }

    fn scaled(m: &Matrix, rows: &dyn Fn(usize) -> i64, columns: &dyn Fn(usize) -> i64) -> Matrix {
        let power = |k: i64| (k as f64).exp2();
        let entries: Vec<_> = m
            .triplets()
            .map(|(i, j, v)| (i, j, v * power(rows(i)) * power(columns(j))))
            .collect();
        Matrix::from_triplets(m.nrows(), m.ncols(), &entries).unwrap()
    }

    /// Dense and sparse matrices, with diagonals and without, with blocks: in any units the problem that is solved is the same one.
    #[test]
    fn a_problem_in_any_units_becomes_the_same() {
        let mut random = Random::new(5);
        let mut whole = |n: i64| (random.symmetric() * n as f64).round() as i64;
        for case in 0..400 {
            let n = 1 + case % 9;
            let owner: Vec<usize> = (0..n).map(|i| i / (1 + case % 3)).collect();
            let is_kept = |i: usize, j: usize| match case % 4 {
                0 => true,
                1 => i == j || (i * j + case).is_multiple_of(3),
                2 => i != j && (i + j + case).is_multiple_of(2),
                _ => (3 * i + 5 * j + case) % 4 < 2,
            };
            let mut entries = Vec::new();
            for i in 0..n {
                for j in (0..n).filter(|j| is_kept(i, *j)) {
                    entries.push((i, j, whole(1000) as f64 / 64.0));
                }
            }
            let m = Matrix::from_triplets(n, n, &entries).unwrap();
            let q: Vec<f64> = (0..n).map(|_| whole(100) as f64).collect();
            let bounds: Vec<f64> = (0..n).map(|_| whole(1) as f64).collect();
            let a: Vec<i64> = (0..n).map(|_| whole(30)).collect();
            let b: Vec<i64> = (0..n).map(|_| whole(30)).collect();
            let given = scaled(&m, &|i| a[owner[i]], &|j| b[owner[j]]);
            let power = |k: i64| (k as f64).exp2();
            let moved: Vec<f64> = (0..n).map(|i| q[i] * power(a[owner[i]])).collect();
            let limits: Vec<f64> = (0..n).map(|i| bounds[i] / power(b[owner[i]])).collect();
            let first = units(&m, &q, &bounds, &owner).unwrap();
            let second = units(&given, &moved, &limits, &owner).unwrap();
            let own = |u: &Units, m: &Matrix, q: &[f64], l: &[f64]| {
                let matrix = scaled(m, &|i| u.rows[owner[i]], &|j| u.unknowns[owner[j]]);
                let q: Vec<f64> = (0..n).map(|i| q[i] * power(u.rows[owner[i]])).collect();
                let l: Vec<f64> = (0..n).map(|i| l[i] / power(u.unknowns[owner[i]])).collect();
                (matrix, q, l)
            };
            let (one, other) = (
                own(&first, &m, &q, &bounds),
                own(&second, &given, &moved, &limits),
            );
            assert_eq!(one, other, "case {case}");
        }
    }
}
