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

/// Prolongations found by smoothed aggregation, from the given matrix down to a few dozen unknowns, finest first, with the
/// Galerkin products. Empty when the matrix does not coarsen.
pub(crate) fn aggregation_hierarchy(
    a: MatrixRef<'_>,
) -> Result<(Vec<Arc<Prolongation>>, Vec<Matrix>), LinearError> {
    let (mut levels, mut matrices) = (Vec::new(), Vec::new());
    let mut a = Rows::transposed(a);
    while a.nrows() > COARSEST {
        let Some(p) = aggregation::smoothed_aggregation(&a)? else {
            break;
        };
        let mut galerkin = Galerkin::new(p.num_coarse());
        let mut coarse = galerkin.pattern(&a, &p);
        galerkin.sum(&a, None, &p, None, &mut coarse);
        matrices.push(into_matrix(&coarse)?);
        a = coarse;
        levels.push(Arc::new(p));
    }
    Ok((levels, matrices))
}

/// An aggregation prolongation with the offset that fits the affine problem A x + q = 0, and the vector q of the coarse problem.
pub(crate) fn affine_prolongation(
    a: MatrixRef<'_>,
    q: &[f64],
    p: &Prolongation,
) -> Result<(Prolongation, Vec<f64>), LinearError> {
    let a = Rows::transposed(a);
    let p = p.clone().with_offset(aggregation::offset(&a, q))?;
    let q = coarse_vector(&a, &mut q.to_vec(), &p);
    Ok((p, q))
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
    Ok((into_matrix(&c)?, q))
}

/// A symmetric matrix by rows is one by columns.
fn into_matrix(c: &Rows) -> Result<Matrix, LinearError> {
    let n = c.nrows();
    let start = c.start.iter().map(|&s| s as usize).collect();
    let col = c.col.iter().map(|&j| j as usize).collect();
    let refuse = |e: crate::sparse::SparseError| LinearError::Solver { what: e.to_string() };
    let pattern = Pattern::from_csc(n, n, start, col).map_err(refuse)?;
    Matrix::from_values(pattern, c.value.clone()).map_err(refuse)
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

    /// x ← a forward Gauss–Seidel sweep from x = 0, and r ← b − A x. That residual is −(upper part) x; by symmetry it is gathered in
    /// the same pass over the lower part.
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
            r[i] = 0.0;
            if inverse == 0.0 {
                x[i] = 0.0;
                continue;
            }
            let lower = a.start[i] as usize..diagonal[i] as usize;
            let (cols, values) = (&a.col[lower.clone()], &a.value[lower]);
            let mut sum = b[i];
            for (&j, v) in cols.iter().zip(values) {
                sum -= v * x[j as usize];
            }
            let step = sum * inverse;
            x[i] = step;
            for (&j, v) in cols.iter().zip(values) {
                r[j as usize] -= v * step;
            }
        }
    }

    fn relax(&mut self, i: usize) {
        let inverse = self.inverse_diagonal[i];
        if inverse != 0.0 {
            let r = self.b[i] - self.a.dot(i, &self.x);
            self.x[i] += r * inverse;
        }
    }

    fn clear_left_out(&mut self) {
        for (r, d) in self.r.iter_mut().zip(&self.inverse_diagonal) {
            if *d == 0.0 {
                *r = 0.0;
            }
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
    /// For the symmetric matrix `a`; prolongations finest first. With `coarse` the Galerkin products over all unknowns, if they are
    /// known; else they are summed when unknowns are first chosen.
    pub(crate) fn new(
        a: MatrixRef<'_>,
        prolongations: &[Arc<Prolongation>],
        coarse: Option<&[MatrixRef<'_>]>,
    ) -> Result<Self, LinearError> {
        let n = a.pattern.ncols;
        let mut levels = vec![Level::new(Rows::transposed(a))?];
        let mut all = Vec::new();
        for (k, p) in prolongations.iter().enumerate() {
            let fine = &levels[levels.len() - 1].a;
            if p.num_fine() != fine.nrows() {
                return Err(LinearError::Shape {
                    what: "the prolongation (rows)",
                    expected: fine.nrows(),
                    found: p.num_fine(),
                });
            }
            let mut galerkin = Galerkin::new(p.num_coarse());
            let next = match coarse.and_then(|c| c.get(k)) {
                Some(known) => Rows::transposed(*known),
                None => galerkin.pattern(fine, p),
            };
            levels.push(Level::new(next)?);
            all.push(galerkin);
        }
        let ready = coarse.is_some_and(|c| c.len() >= prolongations.len());
        if ready {
            for level in &mut levels {
                (0..level.b.len()).for_each(|i| level.invert_diagonal(i, true));
            }
        }
        Ok(Self {
            prolongations: prolongations.to_vec(),
            galerkin: all,
            levels,
            // As long as nothing is left out, all coarse matrices are right.
            free: vec![true; n],
            ready,
            direction: vec![0.0; n],
            product: vec![0.0; n],
            changed: Vec::new(),
            marked: vec![false; n],
        })
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
            fine.clear_left_out();
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
            let p = &self.prolongations[k].rows();
            for i in 0..fine.x.len() {
                if fine.inverse_diagonal[i] != 0.0 {
                    fine.x[i] += p.dot(i, &below[0].x);
                }
            }
            fine.smooth_backward();
        }
    }

    /// Conjugate gradients for A_FF d = r_F: stops when ‖r_F‖₂ has fallen by `tolerance`. `d` is overwritten, zero where unknowns
    /// are left out; `r` becomes the residual. Tells the number of iterations; stops at `limit`.
    pub(crate) fn solve(
        &mut self,
        r: &mut [f64],
        d: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Result<usize, LinearError> {
        let n = r.len();
        d.fill(0.0);
        for (r, free) in r.iter_mut().zip(&self.free) {
            if !free {
                *r = 0.0;
            }
        }
        let mut size = inner(r, r);
        let goal = size * tolerance * tolerance;
        self.direction.fill(0.0);
        let mut rho = 1.0;
        for iteration in 0..limit {
            if size <= goal || size == 0.0 {
                return Ok(iteration);
            }
            self.levels[0].b.copy_from_slice(r);
            self.cycle();
            let z = &self.levels[0].x;
            let next = inner(r, z);
            if !(next > 0.0 && next.is_finite()) {
                return Err(LinearError::NotPositiveDefinite);
            }
            let beta = if iteration == 0 { 0.0 } else { next / rho };
            rho = next;
            (self.direction.iter_mut().zip(z)).for_each(|(p, z)| *p = z + beta * *p);
            let a = &self.levels[0].a;
            let mut curvature = 0.0;
            for i in 0..n {
                let product = if self.free[i] {
                    a.dot(i, &self.direction)
                } else {
                    0.0
                };
                self.product[i] = product;
                curvature += product * self.direction[i];
            }
            if !(curvature > 0.0 && curvature.is_finite()) {
                return Err(LinearError::NotPositiveDefinite);
            }
            let alpha = rho / curvature;
            size = 0.0;
            for (((d, p), r), product) in d
                .iter_mut()
                .zip(&self.direction)
                .zip(r.iter_mut())
                .zip(&self.product)
            {
                *d += alpha * p;
                *r -= alpha * product;
                size += *r * *r;
            }
        }
        Ok(if size <= goal { limit - 1 } else { limit })
    }
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
