use super::prolongation::Prolongation;
use super::rows::{Rows, RowsRef};

/// Coarse matrices C = Pᵀ A P, row by row, with rows and columns of A left out where `free` says so.
#[derive(Debug, Clone)]
pub(super) struct Galerkin {
    /// Position of a column in the row of C being summed.
    slot: Vec<u32>,
    marked: Vec<bool>,
    affected: Vec<usize>,
    row: FineRow,
}

/// One row of Pᵀ A: columns in no order, values, and for each column of A where it might be among them.
#[derive(Debug, Clone)]
struct FineRow {
    place: Vec<u32>,
    col: Vec<u32>,
    value: Vec<f64>,
}

impl FineRow {
    fn sum(&mut self, a: RowsRef<'_>, coarse: RowsRef<'_>, c: usize, is_free: impl Fn(u32) -> bool) {
        self.col.clear();
        self.value.clear();
        let (rows, weights) = coarse.row(c);
        for (&i, w) in rows.iter().zip(weights) {
            if !is_free(i) {
                continue;
            }
            let (cols, values) = a.row(i as usize);
            for (&j, v) in cols.iter().zip(values) {
                let place = self.place[j as usize] as usize;
                if self.col.get(place) == Some(&j) {
                    self.value[place] += w * v;
                } else if is_free(j) {
                    self.place[j as usize] = self.col.len() as u32;
                    self.col.push(j);
                    self.value.push(w * v);
                }
            }
        }
    }
}

impl Galerkin {
    pub(super) fn new(p: &Prolongation) -> Self {
        Self {
            slot: vec![0; p.num_coarse()],
            marked: vec![false; p.num_coarse()],
            affected: Vec::new(),
            row: FineRow {
                place: vec![0; p.num_fine()],
                col: Vec::new(),
                value: Vec::new(),
            },
        }
    }

    /// C over all rows of A, pattern and values.
    pub(super) fn product(&mut self, a: &Rows, p: &Prolongation) -> Rows {
        let (a, coarse, interpolation) = (a.view(), p.columns(), p.rows());
        let mut start = Vec::with_capacity(p.num_coarse() + 1);
        start.push(0_u32);
        let (mut col, mut value): (Vec<u32>, Vec<f64>) = (Vec::new(), Vec::new());
        let (mut cols, mut sums): (Vec<u32>, Vec<f64>) = (Vec::new(), Vec::new());
        for c in 0..p.num_coarse() {
            self.row.sum(a, coarse, c, |_| true);
            cols.clear();
            sums.clear();
            for (&j, v) in self.row.col.iter().zip(&self.row.value) {
                let (parents, parts) = interpolation.row(j as usize);
                for (&k, u) in parents.iter().zip(parts) {
                    let place = self.slot[k as usize] as usize;
                    if cols.get(place) == Some(&k) {
                        sums[place] += v * u;
                    } else {
                        self.slot[k as usize] = cols.len() as u32;
                        cols.push(k);
                        sums.push(v * u);
                    }
                }
            }
            cols.sort_unstable();
            value.extend(cols.iter().map(|&k| sums[self.slot[k as usize] as usize]));
            col.extend_from_slice(&cols);
            start.push(col.len() as u32);
        }
        Rows::new(p.num_coarse(), start, col, value)
    }

    /// Sums the rows of C that depend on the given rows of A (all with `None`); tells which those are.
    pub(super) fn sum(
        &mut self,
        a: &Rows,
        free: Option<&[bool]>,
        p: &Prolongation,
        changed: Option<&[usize]>,
        c: &mut Rows,
    ) -> &[usize] {
        let (a, coarse, interpolation) = (a.view(), p.columns(), p.rows());
        self.affected.clear();
        match changed {
            None => self.affected.extend(0..p.num_coarse()),
            Some(rows) => {
                for &i in rows {
                    for &k in interpolation.row(i).0 {
                        if !self.marked[k as usize] {
                            self.marked[k as usize] = true;
                            self.affected.push(k as usize);
                        }
                    }
                }
                self.affected.iter().for_each(|&k| self.marked[k] = false);
            }
        }
        let (start, col, value) = c.parts_mut();
        for &row in &self.affected {
            match free {
                Some(free) => self.row.sum(a, coarse, row, |i| free[i as usize]),
                None => self.row.sum(a, coarse, row, |_| true),
            }
            for k in start[row] as usize..start[row + 1] as usize {
                self.slot[col[k] as usize] = k as u32;
                value[k] = 0.0;
            }
            for (&j, v) in self.row.col.iter().zip(&self.row.value) {
                let (parents, parts) = interpolation.row(j as usize);
                for (&k, u) in parents.iter().zip(parts) {
                    value[self.slot[k as usize] as usize] += v * u;
                }
            }
        }
        &self.affected
    }
}
