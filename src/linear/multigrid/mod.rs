//! Multigrid as a preconditioner for symmetric positive definite matrices and their principal submatrices.

mod aggregation;
mod galerkin;
mod prolongation;
mod rows;

pub use prolongation::Prolongation;

use std::sync::Arc;

use self::galerkin::Galerkin;
use self::rows::Rows;
use super::LinearError;
use crate::sparse::{Matrix, MatrixRef, Pattern};

/// Coarsening stops at this many unknowns.
const COARSEST: usize = 60;
/// Sweeps on the coarsest level, forth and back.
const COARSEST_SWEEPS: usize = 6;

/// Prolongations found by smoothed aggregation, from the given matrix down to a few dozen unknowns, finest first. Offsets are
/// those of the affine problem A x + q = 0 where `q` is given. Empty when the matrix does not coarsen.
pub(crate) fn aggregation_hierarchy(
    a: MatrixRef<'_>,
    q: Option<&[f64]>,
) -> Result<Vec<Arc<Prolongation>>, LinearError> {
    let mut levels = Vec::new();
    let mut a = Rows::transposed(a);
    let mut q = q.map(<[f64]>::to_vec);
    while a.nrows() > COARSEST {
        let Some(p) = aggregation::smoothed_aggregation(&a, q.as_deref())? else {
            break;
        };
        let mut galerkin = Galerkin::new(p.num_coarse());
        let mut coarse = galerkin.pattern(&a, &p);
        galerkin.sum(&a, None, &p, None, &mut coarse);
        q = q.map(|mut q| coarse_vector(&a, &mut q, &p));
        a = coarse;
        levels.push(Arc::new(p));
    }
    Ok(levels)
}

/// Pᵀ(A b + q), with b the offset of the prolongation.
fn coarse_vector(a: &Rows, q: &mut [f64], p: &Prolongation) -> Vec<f64> {
    if !p.offset().is_empty() {
        for (i, q) in q.iter_mut().enumerate() {
            *q += a.dot(i, p.offset());
        }
    }
    let mut coarse = vec![0.0; p.num_coarse()];
    p.restrict(q, &mut coarse);
    coarse
}

/// The coarse affine problem: Pᵀ A P and Pᵀ(A b + q). A must be symmetric.
pub(crate) fn coarse_problem(
    a: MatrixRef<'_>,
    q: &[f64],
    p: &Prolongation,
) -> Result<(Matrix, Vec<f64>), LinearError> {
    let a = Rows::transposed(a);
    let mut galerkin = Galerkin::new(p.num_coarse());
    let mut c = galerkin.pattern(&a, p);
    galerkin.sum(&a, None, p, None, &mut c);
    let q = coarse_vector(&a, &mut q.to_vec(), p);
    let n = p.num_coarse();
    let start = c.start.iter().map(|&s| s as usize).collect();
    let col = c.col.iter().map(|&j| j as usize).collect();
    // C is symmetric: its rows are its columns.
    let refuse = |e: crate::sparse::SparseError| LinearError::Solver { what: e.to_string() };
    let pattern = Pattern::from_csc(n, n, start, col).map_err(refuse)?;
    Ok((Matrix::from_values(pattern, c.value).map_err(refuse)?, q))
}

/// One level: a matrix with the workspace of a cycle.
#[derive(Debug, Clone)]
struct Level {
    a: Rows,
    /// Place of the diagonal in each row.
    diagonal: Vec<u32>,
    /// 0 for unknowns that are left out.
    inverse_diagonal: Vec<f64>,
    x: Vec<f64>,
    b: Vec<f64>,
    r: Vec<f64>,
}

impl Level {
    fn new(a: Rows) -> Result<Self, LinearError> {
        let n = a.nrows();
        let place = |i: usize| {
            let span = a.span(i);
            let found = a.col[span.clone()].binary_search(&(i as u32));
            found
                .map(|k| (span.start + k) as u32)
                .map_err(|_| LinearError::NotPositiveDefinite)
        };
        let diagonal = (0..n).map(place).collect::<Result<_, _>>()?;
        Ok(Self {
            diagonal,
            inverse_diagonal: vec![0.0; n],
            x: vec![0.0; n],
            b: vec![0.0; n],
            r: vec![0.0; n],
            a,
        })
    }

    fn invert_diagonal(&mut self, i: usize, free: bool) {
        let d = self.a.value[self.diagonal[i] as usize];
        self.inverse_diagonal[i] = if free && d > f64::MIN_POSITIVE {
            1.0 / d
        } else {
            0.0
        };
    }

    /// x ← a forward Gauss–Seidel sweep from x = 0, and r ← b − A x, which then is the upper part alone.
    fn smooth_from_zero(&mut self) {
        let Self {
            a,
            diagonal,
            inverse_diagonal,
            x,
            b,
            r,
        } = self;
        for i in 0..b.len() {
            let inverse = inverse_diagonal[i];
            if inverse == 0.0 {
                x[i] = 0.0;
                continue;
            }
            let lower = a.start[i] as usize..diagonal[i] as usize;
            let sum: f64 = (a.col[lower.clone()].iter().zip(&a.value[lower]))
                .map(|(&j, v)| v * x[j as usize])
                .sum();
            x[i] = (b[i] - sum) * inverse;
        }
        for i in 0..b.len() {
            if inverse_diagonal[i] == 0.0 {
                r[i] = 0.0;
                continue;
            }
            let upper = diagonal[i] as usize + 1..a.start[i + 1] as usize;
            let sum: f64 = (a.col[upper.clone()].iter().zip(&a.value[upper]))
                .map(|(&j, v)| v * x[j as usize])
                .sum();
            r[i] = -sum;
        }
    }

    fn relax(&mut self, i: usize) {
        let inverse = self.inverse_diagonal[i];
        if inverse != 0.0 {
            let r = self.b[i] - self.a.dot(i, &self.x);
            self.x[i] += r * inverse;
        }
    }

    fn smooth_backward(&mut self) {
        (0..self.b.len()).rev().for_each(|i| self.relax(i));
    }

    fn smooth_forward(&mut self) {
        (0..self.b.len()).for_each(|i| self.relax(i));
    }
}

/// A V-cycle for the principal submatrix of a symmetric matrix over a set of free unknowns, and conjugate gradients with it.
///
/// Interpolation is truncated to the free unknowns, coarse matrices are its Galerkin products (the linear part of truncated
/// nonsmooth Newton multigrid; R. Kornhuber, 1994; C. Gräser, R. Kornhuber, 2009). When few unknowns become free or are left out,
/// only the rows of the coarse matrices that depend on them are summed again.
#[derive(Debug, Clone)]
pub(crate) struct TruncatedMultigrid {
    prolongations: Vec<Arc<Prolongation>>,
    galerkin: Vec<Galerkin>,
    levels: Vec<Level>,
    free: Vec<bool>,
    ready: bool,
    direction: Vec<f64>,
    product: Vec<f64>,
    changed: Vec<usize>,
    marked: Vec<bool>,
}

impl TruncatedMultigrid {
    /// For the symmetric matrix `a`; prolongations finest first. All unknowns are left out until [`set_free`](Self::set_free).
    pub(crate) fn new(a: MatrixRef<'_>, prolongations: &[Arc<Prolongation>]) -> Result<Self, LinearError> {
        let n = a.pattern.ncols;
        let mut levels = vec![Level::new(Rows::transposed(a))?];
        let mut all = Vec::new();
        for p in prolongations {
            let fine = &levels[levels.len() - 1].a;
            if p.num_fine() != fine.nrows() {
                return Err(LinearError::Shape {
                    what: "the prolongation (rows)",
                    expected: fine.nrows(),
                    found: p.num_fine(),
                });
            }
            let mut galerkin = Galerkin::new(p.num_coarse());
            let coarse = galerkin.pattern(fine, p);
            levels.push(Level::new(coarse)?);
            all.push(galerkin);
        }
        Ok(Self {
            prolongations: prolongations.to_vec(),
            galerkin: all,
            levels,
            free: vec![false; n],
            ready: false,
            direction: vec![0.0; n],
            product: vec![0.0; n],
            changed: Vec::new(),
            marked: vec![false; n],
        })
    }

    /// Replaces the values of the matrix (over the same pattern).
    pub(crate) fn set_values(&mut self, values: &[f64]) {
        self.levels[0].a.value.copy_from_slice(values);
        self.ready = false;
    }

    /// Chooses the free unknowns.
    pub(crate) fn set_free(&mut self, free: &[bool]) {
        let Self {
            levels,
            free: known,
            changed,
            marked,
            ..
        } = self;
        changed.clear();
        let fine = &mut levels[0];
        if self.ready {
            // Rows of the truncated matrix change with their own unknown and with those of their neighbours.
            for i in (0..free.len()).filter(|&i| free[i] != known[i]) {
                for &j in fine.a.row(i).0 {
                    if !marked[j as usize] {
                        marked[j as usize] = true;
                        changed.push(j as usize);
                    }
                }
            }
            changed.iter().for_each(|&j| marked[j] = false);
        }
        known.copy_from_slice(free);
        let anew = !self.ready || changed.len() > free.len() / 2;
        (0..free.len()).for_each(|i| fine.invert_diagonal(i, free[i]));
        for k in 0..self.prolongations.len() {
            let (above, below) = levels.split_at_mut(k + 1);
            let mask = (k == 0).then_some(&**known);
            let rows = (!anew).then_some(&**changed);
            let coarse = &mut below[0];
            let affected =
                self.galerkin[k].sum(&above[k].a, mask, &self.prolongations[k], rows, &mut coarse.a);
            affected.iter().for_each(|&i| coarse.invert_diagonal(i, true));
            if !anew {
                changed.clear();
                changed.extend_from_slice(affected);
            }
        }
        self.ready = true;
    }

    /// One cycle: x₀ ← approximately A⁻¹ b₀.
    fn cycle(&mut self) {
        let last = self.levels.len() - 1;
        for k in 0..last {
            let (above, below) = self.levels.split_at_mut(k + 1);
            let fine = &mut above[k];
            fine.smooth_from_zero();
            self.prolongations[k].restrict(&fine.r, &mut below[0].b);
        }
        let coarsest = &mut self.levels[last];
        coarsest.x.fill(0.0);
        let sweeps = if last == 0 { 1 } else { COARSEST_SWEEPS };
        (0..sweeps).for_each(|_| coarsest.smooth_forward());
        (0..sweeps).for_each(|_| coarsest.smooth_backward());
        for k in (0..last).rev() {
            let (above, below) = self.levels.split_at_mut(k + 1);
            let fine = &mut above[k];
            let p = &self.prolongations[k].rows;
            for i in 0..fine.x.len() {
                if fine.inverse_diagonal[i] != 0.0 {
                    fine.x[i] += p.dot(i, &below[0].x);
                }
            }
            fine.smooth_backward();
        }
    }

    /// Conjugate gradients for A_FF d = r_F: stops when the energy norm of the preconditioned residual has fallen by `tolerance`.
    /// `d` is overwritten, zero where unknowns are left out; `r` becomes the residual. Tells the number of iterations; stops at
    /// `limit`.
    pub(crate) fn solve(
        &mut self,
        r: &mut [f64],
        d: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Result<usize, LinearError> {
        let n = r.len();
        d.fill(0.0);
        for i in 0..n {
            if !self.free[i] {
                r[i] = 0.0;
            }
        }
        self.levels[0].b.copy_from_slice(r);
        self.cycle();
        self.direction.copy_from_slice(&self.levels[0].x);
        let mut rho = inner(r, &self.direction);
        let goal = rho * tolerance * tolerance;
        for iteration in 0..limit {
            if rho <= goal || rho == 0.0 {
                return Ok(iteration);
            }
            if !(rho > 0.0) {
                return Err(LinearError::NotPositiveDefinite);
            }
            let a = &self.levels[0].a;
            for i in 0..n {
                self.product[i] = if self.free[i] {
                    a.dot(i, &self.direction)
                } else {
                    0.0
                };
            }
            let curvature = inner(&self.direction, &self.product);
            if !(curvature > 0.0) {
                return Err(LinearError::NotPositiveDefinite);
            }
            let alpha = rho / curvature;
            for i in 0..n {
                d[i] += alpha * self.direction[i];
                r[i] -= alpha * self.product[i];
            }
            self.levels[0].b.copy_from_slice(r);
            self.cycle();
            let z = &self.levels[0].x;
            let next = inner(r, z);
            let beta = next / rho;
            rho = next;
            self.direction
                .iter_mut()
                .zip(z)
                .for_each(|(p, z)| *p = z + beta * *p);
        }
        Ok(limit)
    }
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
