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

    /// The pattern of C over all rows of A, values zero.
    pub(super) fn pattern(&mut self, a: &Rows, p: &Prolongation) -> Rows {
        let mut start = vec![0_u32];
        let mut col: Vec<u32> = Vec::with_capacity(a.col.len());
        for c in 0..p.num_coarse() {
            let first = col.len();
            for &i in p.columns().row(c).0 {
                for &j in a.row(i as usize).0 {
                    for &k in p.rows().row(j as usize).0 {
                        if self.slot[k as usize] != c as u32 {
                            self.slot[k as usize] = c as u32;
                            col.push(k);
                        }
                    }
                }
            }
            col[first..].sort_unstable();
            start.push(col.len() as u32);
        }
        self.slot.fill(u32::MAX);
        Rows {
            ncols: p.num_coarse(),
            value: vec![0.0; col.len()],
            start,
            col,
        }
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
        for &row in &self.affected {
            let span = c.span(row);
            for k in span.clone() {
                self.slot[c.col[k] as usize] = k as u32;
                c.value[k] = 0.0;
            }
            let (fine, weights) = p.columns().row(row);
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
                    let (parents, parts) = p.rows().row(j as usize);
                    for (&k, u) in parents.iter().zip(parts) {
                        c.value[self.slot[k as usize] as usize] += wv * u;
                    }
                }
            }
        }
        &self.affected
    }
}
