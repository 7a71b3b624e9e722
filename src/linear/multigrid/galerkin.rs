use super::prolongation::Prolongation;
use super::rows::{Rows, RowsRef};

/// Coarse matrices C = Pᵀ A P, row by row, with rows and columns of A left out where `free` says so.
#[derive(Debug, Clone)]
pub(super) struct Galerkin {
    /// Position of a column in the row of C being summed.
    slot: Vec<u32>,
    marked: Vec<bool>,
    affected: Vec<u32>,
    /// The row of Pᵀ A.
    left: RowSum,
}

/// A sum of sparse rows: columns in order of appearance, values, and for each column where it might be among them (P. Briggs,
/// L. Torczon, 1993), so that nothing is cleared between rows.
#[derive(Debug, Clone)]
struct RowSum {
    place: Vec<u32>,
    len: usize,
    col: Vec<u32>,
    value: Vec<f64>,
}

impl RowSum {
    fn new(ncols: usize) -> Self {
        Self {
            place: vec![0; ncols],
            len: 0,
            col: Vec::new(),
            value: Vec::new(),
        }
    }

    /// Adds `factor` times a row, except in columns that are not free.
    #[inline(always)]
    fn add(&mut self, cols: &[u32], values: &[f64], factor: f64, is_free: impl Fn(u32) -> bool) {
        let mut len = self.len;
        if self.col.len() < len + cols.len() {
            self.col.resize(2 * (len + cols.len()), 0);
            self.value.resize(2 * (len + cols.len()), 0.0);
        }
        let (place, col, value) = (&mut self.place[..], &mut self.col[..], &mut self.value[..]);
        for (&j, v) in cols.iter().zip(values) {
            let at = place[j as usize] as usize;
            if at < len && col[at] == j {
                value[at] += factor * v;
            } else if is_free(j) {
                place[j as usize] = len as u32;
                col[len] = j;
                value[len] = factor * v;
                len += 1;
            }
        }
        self.len = len;
    }

    /// Row c of Pᵀ A.
    fn left(&mut self, a: RowsRef<'_>, coarse: RowsRef<'_>, c: usize, is_free: impl Fn(u32) -> bool + Copy) {
        self.len = 0;
        let (rows, weights) = coarse.row(c);
        for (&i, w) in rows.iter().zip(weights) {
            if is_free(i) {
                let (cols, values) = a.row(i as usize);
                self.add(cols, values, *w, is_free);
            }
        }
    }

    fn entries(&self) -> (&[u32], &[f64]) {
        (&self.col[..self.len], &self.value[..self.len])
    }
}

impl Galerkin {
    pub(super) fn new(p: &Prolongation) -> Self {
        Self {
            slot: vec![0; p.num_coarse()],
            marked: vec![false; p.num_coarse()],
            affected: Vec::new(),
            left: RowSum::new(p.num_fine()),
        }
    }

    /// C over all rows of A, pattern and values.
    pub(super) fn product(&mut self, a: &Rows, p: &Prolongation) -> Rows {
        let (a, coarse, interpolation) = (a.view(), p.columns(), p.rows());
        let mut start = Vec::with_capacity(p.num_coarse() + 1);
        start.push(0_u32);
        // Fits interpolation on regular grids, where C has a quarter of the rows of A and twice as many entries in each.
        let mut col: Vec<u32> = Vec::with_capacity(a.col.len() / 2);
        let mut value: Vec<f64> = Vec::with_capacity(a.col.len() / 2);
        let mut sum = RowSum::new(p.num_coarse());
        for c in 0..p.num_coarse() {
            self.left.left(a, coarse, c, |_| true);
            sum.len = 0;
            let (cols, values) = self.left.entries();
            for (&j, v) in cols.iter().zip(values) {
                let (parents, parts) = interpolation.row(j as usize);
                sum.add(parents, parts, *v, |_| true);
            }
            let first = col.len();
            col.extend_from_slice(sum.entries().0);
            col[first..].sort_unstable();
            value.extend(
                col[first..]
                    .iter()
                    .map(|&k| sum.value[sum.place[k as usize] as usize]),
            );
            start.push(col.len() as u32);
        }
        Rows::new(p.num_coarse(), start, col, value)
    }

    /// Sums the rows of C that depend on the given rows of A (all with `None`); returns which those are.
    pub(super) fn sum(
        &mut self,
        a: &Rows,
        free: Option<&[bool]>,
        p: &Prolongation,
        changed: Option<&[u32]>,
        c: &mut Rows,
    ) -> &[u32] {
        let (a, coarse, interpolation) = (a.view(), p.columns(), p.rows());
        self.affected.clear();
        match changed {
            None => self.affected.extend(0..p.num_coarse() as u32),
            Some(rows) => {
                for &i in rows {
                    for &k in interpolation.row(i as usize).0 {
                        if !self.marked[k as usize] {
                            self.marked[k as usize] = true;
                            self.affected.push(k);
                        }
                    }
                }
                self.affected
                    .iter()
                    .for_each(|&k| self.marked[k as usize] = false);
            }
        }
        let (start, col, value) = c.parts_mut();
        for &row in &self.affected {
            let row = row as usize;
            match free {
                Some(free) => self.left.left(a, coarse, row, |i| free[i as usize]),
                None => self.left.left(a, coarse, row, |_| true),
            }
            for k in start[row] as usize..start[row + 1] as usize {
                self.slot[col[k] as usize] = k as u32;
                value[k] = 0.0;
            }
            let (cols, values) = self.left.entries();
            for (&j, v) in cols.iter().zip(values) {
                let (parents, parts) = interpolation.row(j as usize);
                for (&k, u) in parents.iter().zip(parts) {
                    value[self.slot[k as usize] as usize] += v * u;
                }
            }
        }
        &self.affected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::Matrix;

    /// Σ over free i, j of P[i, c] A[i, j] P[j, k], entry by entry.
    fn dense(a: &Matrix, p: &Matrix, free: &[bool]) -> Vec<f64> {
        let n = p.ncols();
        let mut c = vec![0.0; n * n];
        for (i, j, v) in a.triplets().filter(|t| free[t.0] && free[t.1]) {
            for (row, entry) in c.iter_mut().enumerate() {
                *entry += p.get(i, row / n) * v * p.get(j, row % n);
            }
        }
        c
    }

    fn unfold(c: &Rows) -> Vec<f64> {
        let n = c.nrows();
        let mut full = vec![0.0; n * n];
        for i in 0..n {
            let (cols, values) = c.view().row(i);
            assert!(cols.windows(2).all(|w| w[0] < w[1]));
            cols.iter()
                .zip(values)
                .for_each(|(&j, v)| full[i * n + j as usize] = *v);
        }
        full
    }

    #[test]
    fn products_are_those_of_the_dense_matrices_as_the_sets_change() {
        let (n, m) = (40, 13);
        let mut entries = Vec::new();
        for i in 0..n {
            entries.push((i, i, 4.0 + 0.1 * i as f64));
            for j in [(i * 7 + 3) % n, (i + 1) % n] {
                if i != j {
                    entries.extend([(i, j, -0.3 - 0.01 * j as f64), (j, i, -0.3 - 0.01 * j as f64)]);
                }
            }
        }
        let a = Matrix::from_triplets(n, n, &entries).unwrap();
        let weights: Vec<_> = (0..n)
            .flat_map(|i| [(i, i % m, 0.7), (i, (i * 5 + 1) % m, 0.3)])
            .collect();
        let p = Matrix::from_triplets(n, m, &weights).unwrap();
        let prolongation = Prolongation::new(&p).unwrap();
        let rows = Rows::transposed(a.as_ref());
        let mut galerkin = Galerkin::new(&prolongation);
        let mut c = galerkin.product(&rows, &prolongation);
        let close = |c: &Rows, free: &[bool]| {
            let expected = dense(&a, &p, free);
            unfold(c)
                .iter()
                .zip(&expected)
                .all(|(x, y)| (x - y).abs() < 1e-13)
        };
        let mut free = vec![true; n];
        assert!(close(&c, &free));
        for flipped in [[3, 4], [17, 3], [30, 31]] {
            let mut changed = Vec::new();
            for i in flipped {
                free[i] = !free[i];
                changed.extend_from_slice(rows.view().row(i).0);
            }
            galerkin.sum(&rows, Some(&free), &prolongation, Some(&changed), &mut c);
            assert!(close(&c, &free));
        }
        // A clone shares its arrays until it is written.
        let kept = c.clone();
        galerkin.sum(&rows, None, &prolongation, None, &mut c);
        assert!(close(&kept, &free) && close(&c, &vec![true; n]));
    }
}
