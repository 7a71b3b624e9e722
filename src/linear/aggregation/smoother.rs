//! Block Gauss–Seidel sweeps, and the direct solve at the bottom.

use super::dense::semi_inverse;
use super::transfer::Constraints;
use crate::linear::{Cholesky, LinearError, LinearSolver};
use crate::sparse::{Blocks, Matrix, Pattern, add_product, subtract_transposed};

/// Sweeps over a symmetric matrix, and the vectors of its level.
#[derive(Debug, Clone)]
pub(super) struct Smoother<const B: usize> {
    /// Inverse diagonal blocks; zero rows and columns where components are held.
    pub(super) inverse: Vec<[[f64; B]; B]>,
    pub(super) x: Vec<f64>,
    pub(super) b: Vec<f64>,
    pub(super) r: Vec<f64>,
}

impl<const B: usize> Smoother<B> {
    pub(super) fn new(a: &Blocks<B, B>, held: impl Fn(usize) -> u8) -> Self {
        let n = a.nrows();
        let mut smoother = Self {
            inverse: vec![[[0.0; B]; B]; n],
            x: vec![0.0; B * n],
            b: vec![0.0; B * n],
            r: vec![0.0; B * n],
        };
        (0..n).for_each(|i| smoother.invert(a, i, held(i), None));
        smoother
    }

    pub(super) fn invert(&mut self, a: &Blocks<B, B>, node: usize, held: u8, added: Option<&[[f64; B]; B]>) {
        let mut block = a.slot(node, node).map_or([[0.0; B]; B], |k| a.value[k]);
        if let Some(added) = added {
            for (row, more) in block.iter_mut().zip(added) {
                row.iter_mut().zip(more).for_each(|(v, m)| *v += m);
            }
        }
        self.inverse[node] = semi_inverse(&block, held);
    }

    /// x ← a forward sweep from x = 0, r ← b − A x: that residual is −(upper part) x, which by symmetry is gathered from the lower
    /// part, the only one that is read.
    fn forward_from_zero(&mut self, a: &Blocks<B, B>) {
        let x = self.x.as_chunks_mut::<B>().0;
        let r = self.r.as_chunks_mut::<B>().0;
        let b = self.b.as_chunks::<B>().0;
        for i in 0..b.len() {
            let (cols, values) = a.row(i);
            let lower = cols.partition_point(|j| (*j as usize) < i);
            let (cols, values) = (&cols[..lower], &values[..lower]);
            let mut sum = [0.0; B];
            for (&j, block) in cols.iter().zip(values) {
                add_product(block, &x[j as usize], &mut sum);
            }
            let rest: [f64; B] = std::array::from_fn(|k| b[i][k] - sum[k]);
            let mut step = [0.0; B];
            add_product(&self.inverse[i], &rest, &mut step);
            x[i] = step;
            r[i] = [0.0; B];
            for (&j, block) in cols.iter().zip(values) {
                subtract_transposed(block, &step, &mut r[j as usize]);
            }
        }
    }

    /// A sweep from the x at hand, and r ← b − A x: once a row is relaxed, what its residual becomes is gathered, by symmetry, from the
    /// rows that change later. Components that are held are arbitrary in r.
    fn sweep(&mut self, a: &Blocks<B, B>, backward: bool) {
        let x = self.x.as_chunks_mut::<B>().0;
        let r = self.r.as_chunks_mut::<B>().0;
        let b = self.b.as_chunks::<B>().0;
        let n = b.len();
        for k in 0..n {
            let i = if backward { n - 1 - k } else { k };
            let (cols, values) = a.row(i);
            let mut sum = [0.0; B];
            let mut diagonal = 0;
            for (k, (&j, block)) in cols.iter().zip(values).enumerate() {
                if j as usize == i {
                    diagonal = k;
                } else {
                    add_product(block, &x[j as usize], &mut sum);
                }
            }
            let rest: [f64; B] = std::array::from_fn(|k| b[i][k] - sum[k]);
            let mut new = [0.0; B];
            add_product(&self.inverse[i], &rest, &mut new);
            let step: [f64; B] = std::array::from_fn(|k| new[k] - x[i][k]);
            x[i] = new;
            r[i] = [0.0; B];
            let before = if backward {
                diagonal + 1..cols.len()
            } else {
                0..diagonal
            };
            for (&j, block) in cols[before.clone()].iter().zip(&values[before]) {
                subtract_transposed(block, &step, &mut r[j as usize]);
            }
        }
    }

    /// Before the coarse correction: x from zero, r its residual.
    pub(super) fn smooth_before(&mut self, a: &Blocks<B, B>, sweeps: usize) {
        self.forward_from_zero(a);
        for _ in 1..sweeps {
            self.sweep(a, true);
            self.sweep(a, false);
        }
    }

    /// After it, in reverse: the cycle stays symmetric.
    pub(super) fn smooth_after(&mut self, a: &Blocks<B, B>, sweeps: usize) {
        self.sweep(a, true);
        for _ in 1..sweeps {
            self.sweep(a, false);
            self.sweep(a, true);
        }
    }
}

/// Share of a diagonal entry that is added where a coarse matrix is singular by rounding.
const SHIFT: f64 = 1e-9;

/// A direct solver for the coarsest matrix. Unknowns without a pivot of their own are left out.
#[derive(Debug, Clone)]
pub(super) struct Direct {
    cholesky: Cholesky,
    matrix: Matrix,
}

impl Direct {
    pub(super) fn new<const B: usize>(a: &Blocks<B, B>) -> Result<Self, LinearError> {
        let n = a.nrows();
        let entries = (0..n).flat_map(|i| {
            let blocks = a.row(i).0.iter().map(|j| *j as usize).filter(move |j| *j <= i);
            blocks.flat_map(move |j| (0..B * B).map(move |e| (B * i + e / B, B * j + e % B)))
        });
        let pattern = Pattern::from_entries(B * n, B * n, entries);
        let pattern = pattern.map_err(|e| LinearError::Solver { what: e.to_string() })?;
        let mut cholesky = Cholesky::new();
        cholesky.analyze(pattern.as_ref())?;
        Ok(Self {
            cholesky,
            matrix: Matrix::zeros(pattern),
        })
    }

    /// As [`factor_nearly`](Self::factor_nearly), but a singular matrix is an error.
    pub(super) fn factor<const B: usize>(
        &mut self,
        a: &Blocks<B, B>,
        constraints: &impl Constraints<B>,
    ) -> Result<(), LinearError> {
        self.fill(a, constraints, 0.0)
    }

    /// Factors the matrix, with a little added to its diagonal where constraints have made it singular.
    pub(super) fn factor_nearly<const B: usize>(
        &mut self,
        a: &Blocks<B, B>,
        constraints: &impl Constraints<B>,
    ) -> Result<(), LinearError> {
        if self.fill(a, constraints, 0.0).is_ok() {
            return Ok(());
        }
        self.fill(a, constraints, SHIFT)
    }

    fn fill<const B: usize>(
        &mut self,
        a: &Blocks<B, B>,
        constraints: &impl Constraints<B>,
        shift: f64,
    ) -> Result<(), LinearError> {
        self.matrix.clear();
        let live = |node: usize, k: usize| constraints.inverse(node)[k][k] > 0.0;
        for i in 0..a.nrows() {
            let (cols, values) = a.row(i);
            for (&j, block) in cols.iter().zip(values).filter(|c| *c.0 as usize <= i) {
                let j = j as usize;
                for (r, c) in (0..B * B).map(|e| (e / B, e % B)) {
                    if live(i, r) && live(j, c) {
                        let added = constraints.added(i).filter(|_| i == j).map_or(0.0, |s| s[r][c]);
                        let value = block[r][c] + added;
                        let more = if i == j && r == c { shift * value } else { 0.0 };
                        self.matrix.add(B * i + r, B * j + c, value + more);
                    }
                }
            }
            for k in (0..B).filter(|&k| !live(i, k)) {
                self.matrix.add(B * i + k, B * i + k, 1.0);
            }
        }
        self.cholesky.factor(self.matrix.as_ref())
    }

    pub(super) fn solve(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.cholesky.solve_in_place(b)
    }
}
