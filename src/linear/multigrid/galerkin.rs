use super::prolongation::Prolongation;
use super::rows::Rows;

/// Coarse matrices C = Pᵀ A P, row by row, with rows and columns of A left out where `free` says so.
#[derive(Debug, Clone)]
pub(super) struct Galerkin {
    /// Position of a column in the row being summed.
    slot: Vec<u32>,
    marked: Vec<bool>,
    affected: Vec<usize>,
}

impl Galerkin {
    pub(super) fn new(num_coarse: usize) -> Self {
        Self {
            slot: vec![u32::MAX; num_coarse],
            marked: vec![false; num_coarse],
            affected: Vec::new(),
        }
    }

    /// C over all rows of A, in one pass.
    pub(super) fn product(&mut self, a: &Rows, p: &Prolongation) -> Rows {
        let a = a.view();
        let (coarse, fine) = (p.columns(), p.rows());
        let mut start = Vec::with_capacity(p.num_coarse() + 1);
        start.push(0_u32);
        let mut col: Vec<u32> = Vec::with_capacity(a.col.len() / 2);
        let mut value: Vec<f64> = Vec::with_capacity(a.col.len() / 2);
        let mut sum = vec![0.0; p.num_coarse()];
        for c in 0..p.num_coarse() {
            let first = col.len();
            let (rows, weights) = coarse.row(c);
            for (&i, w) in rows.iter().zip(weights) {
                let (cols, values) = a.row(i as usize);
                for (&j, v) in cols.iter().zip(values) {
                    let wv = w * v;
                    let (parents, parts) = fine.row(j as usize);
                    for (&k, u) in parents.iter().zip(parts) {
                        let slot = &mut self.slot[k as usize];
                        if *slot == c as u32 {
                            sum[k as usize] += wv * u;
                        } else {
                            *slot = c as u32;
                            sum[k as usize] = wv * u;
                            col.push(k);
                        }
                    }
                }
            }
            col[first..].sort_unstable();
            value.extend(col[first..].iter().map(|&k| sum[k as usize]));
            start.push(col.len() as u32);
        }
        self.slot.fill(u32::MAX);
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
        self.affected.clear();
        match changed {
            None => self.affected.extend(0..p.num_coarse()),
            Some(rows) => {
                for &i in rows {
                    for &k in p.rows().row(i).0 {
                        if !self.marked[k as usize] {
                            self.marked[k as usize] = true;
                            self.affected.push(k as usize);
                        }
                    }
                }
                self.affected.iter().for_each(|&k| self.marked[k] = false);
            }
        }
        let is_free = |i: u32| free.is_none_or(|f| f[i as usize]);
        let (a, coarse, interpolation) = (a.view(), p.columns(), p.rows());
        let (start, col, value) = c.parts_mut();
        for &row in &self.affected {
            for k in start[row] as usize..start[row + 1] as usize {
                self.slot[col[k] as usize] = k as u32;
                value[k] = 0.0;
            }
            let (fine, weights) = coarse.row(row);
            for (&i, w) in fine.iter().zip(weights) {
                if !is_free(i) {
                    continue;
                }
                let (cols, values) = a.row(i as usize);
                for (&j, v) in cols.iter().zip(values) {
                    if !is_free(j) {
                        continue;
                    }
                    let wv = w * v;
                    let (parents, parts) = interpolation.row(j as usize);
                    for (&k, u) in parents.iter().zip(parts) {
                        value[self.slot[k as usize] as usize] += wv * u;
                    }
                }
            }
        }
        &self.affected
    }
}
