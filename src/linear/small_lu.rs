/// Pivots below this share of the largest entry of their column count as zero.
const SINGULAR: f64 = 1e-13;

/// LU with partial pivoting of a small dense matrix whose order changes from call to call; no scaling, no condition estimate, no
/// allocation up to the largest order seen. Meant for the reduced systems of active-set methods, which are equilibrated.
#[derive(Debug, Clone, Default)]
pub(crate) struct SmallLu {
    order: usize,
    /// Column-major.
    entries: Vec<f64>,
    exchanged: Vec<usize>,
}

impl SmallLu {
    /// A zeroed matrix of order k to be filled, column-major.
    pub(crate) fn matrix(&mut self, k: usize) -> &mut [f64] {
        self.order = k;
        self.entries.clear();
        self.entries.resize(k * k, 0.0);
        &mut self.entries
    }

    /// Factors what [`matrix`](Self::matrix) was filled with; `false` when it is singular or not finite.
    pub(crate) fn factor(&mut self) -> bool {
        let k = self.order;
        self.exchanged.clear();
        for j in 0..k {
            // Left-looking: bring column j up to date with the columns before it.
            let (done, rest) = self.entries.split_at_mut(j * k);
            let column = &mut rest[..k];
            let largest = column.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            // The columns before it are in the order of all exchanges so far.
            for (i, &p) in self.exchanged.iter().enumerate() {
                column.swap(i, p);
            }
            for i in 0..j {
                let head = column[i];
                if head != 0.0 {
                    let factors = &done[i * k + i + 1..(i + 1) * k];
                    for (c, l) in column[i + 1..].iter_mut().zip(factors) {
                        *c -= head * l;
                    }
                }
            }
            let mut pivot = j;
            for i in j + 1..k {
                if column[i].abs() > column[pivot].abs() {
                    pivot = i;
                }
            }
            let value = column[pivot];
            // Written so that NaN fails.
            if !(value.abs() > SINGULAR * largest && value.is_finite()) {
                return false;
            }
            column.swap(j, pivot);
            for c in &mut column[j + 1..] {
                *c /= value;
            }
            if pivot != j {
                for i in 0..j {
                    done.swap(i * k + j, i * k + pivot);
                }
            }
            self.exchanged.push(pivot);
        }
        true
    }

    /// Overwrites b by A⁻¹ b.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        let k = self.order;
        for (i, &p) in self.exchanged.iter().enumerate() {
            b.swap(i, p);
        }
        for i in 0..k {
            let head = b[i];
            if head != 0.0 {
                for (x, l) in b[i + 1..]
                    .iter_mut()
                    .zip(&self.entries[i * k + i + 1..(i + 1) * k])
                {
                    *x -= head * l;
                }
            }
        }
        for i in (0..k).rev() {
            b[i] /= self.entries[i * k + i];
            let head = b[i];
            for (x, u) in b[..i].iter_mut().zip(&self.entries[i * k..i * k + i]) {
                *x -= head * u;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::SmallLu;

    #[test]
    fn solves_after_exchanges_of_rows() {
        let a = [[0.0, 2.0, 1.0], [1.0, 1.0, 4.0], [3.0, -1.0, 0.5]];
        let x = [1.0, -2.0, 3.0];
        let mut lu = SmallLu::default();
        let m = lu.matrix(3);
        for (i, row) in a.iter().enumerate() {
            for (j, v) in row.iter().enumerate() {
                m[j * 3 + i] = *v;
            }
        }
        assert!(lu.factor());
        let mut b: Vec<f64> = a
            .iter()
            .map(|r| r.iter().zip(&x).map(|(a, x)| a * x).sum())
            .collect();
        lu.solve(&mut b);
        for (b, x) in b.iter().zip(&x) {
            assert!((b - x).abs() < 1e-14);
        }
        let m = lu.matrix(2);
        m.copy_from_slice(&[1.0, 2.0, 2.0, 4.0]);
        assert!(!lu.factor());
    }
}
