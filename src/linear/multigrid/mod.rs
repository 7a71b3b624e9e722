//! Multigrid as a preconditioner for symmetric positive definite matrices and their principal submatrices.

mod aggregation;
mod galerkin;
mod preconditioner;
mod prolongation;
mod rows;

pub use preconditioner::Multigrid;
pub use prolongation::Prolongation;

use std::sync::Arc;

use self::galerkin::Galerkin;
pub(crate) use self::rows::{Rows, RowsRef};
use super::LinearError;
use crate::input::check_length;
use crate::sparse::MatrixRef;

/// Number of unknowns from which cycles take less time than sparse factors, of matrices of grids in the plane.
pub(crate) const WORTH: usize = 5000;

/// Coarsening stops at this many unknowns.
const COARSEST: usize = 60;
/// Sweeps on the coarsest level, forth and back.
const COARSEST_SWEEPS: usize = 6;

/// Prolongations found by smoothed aggregation, from the given matrix down to a few dozen unknowns, finest first, with the matrix
/// and its Galerkin products. No prolongations when the matrix does not coarsen.
pub(crate) fn aggregation_hierarchy(
    a: MatrixRef<'_>,
) -> Result<(Vec<Arc<Prolongation>>, Vec<Rows>), LinearError> {
    let mut levels = Vec::new();
    let mut matrices = vec![Rows::transposed(a)];
    loop {
        let a = &matrices[matrices.len() - 1];
        if a.nrows() <= COARSEST {
            break;
        }
        let Some(p) = aggregation::smoothed_aggregation(a)? else {
            break;
        };
        let coarse = Galerkin::new(&p).product(a, &p);
        matrices.push(coarse);
        levels.push(Arc::new(p));
    }
    Ok((levels, matrices))
}

/// An aggregation prolongation with the offset that fits the affine problem A x + q = 0, and the vector q of the coarse problem.
pub(crate) fn affine_prolongation(
    a: &Rows,
    q: &[f64],
    p: &Prolongation,
) -> Result<(Prolongation, Vec<f64>), LinearError> {
    let p = p.clone().with_offset(aggregation::offset(a, q))?;
    let q = coarse_vector(a, &mut q.to_vec(), &p);
    Ok((p, q))
}

/// Pᵀ(A b + q), with b the offset of the prolongation.
fn coarse_vector(a: &Rows, q: &mut [f64], p: &Prolongation) -> Vec<f64> {
    if !p.offset().is_empty() {
        let a = a.view();
        for (i, q) in q.iter_mut().enumerate() {
            *q += a.dot(i, p.offset());
        }
    }
    let mut coarse = vec![0.0; p.num_coarse()];
    p.restrict(q, &mut coarse);
    coarse
}

/// The coarse affine problem: Pᵀ A P and Pᵀ(A b + q). A must be symmetric.
pub(crate) fn coarse_problem(a: &Rows, q: &[f64], p: &Prolongation) -> (Rows, Vec<f64>) {
    let c = Galerkin::new(p).product(a, p);
    let q = coarse_vector(a, &mut q.to_vec(), p);
    (c, q)
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
        let (n, rows) = (a.nrows(), a.view());
        let place = |i: usize| {
            let span = rows.span(i);
            let found = rows.col[span.clone()].binary_search(&(i as u32));
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
        let d = self.a.view().value[self.diagonal[i] as usize];
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
        let a = a.view();
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

    /// A backward Gauss–Seidel sweep, and r ← b − A x: the residual of a row after its relaxation comes from the rows before it, and by
    /// symmetry is gathered from their upper parts in the same pass. In rows left out, r is 0 or arbitrary.
    fn smooth_backward_to_residual(&mut self) {
        let Self {
            a,
            diagonal,
            inverse_diagonal,
            x,
            b,
            r,
        } = self;
        let a = a.view();
        for i in (0..b.len()).rev() {
            r[i] = 0.0;
            let inverse = inverse_diagonal[i];
            if inverse == 0.0 {
                continue;
            }
            let step = (b[i] - a.dot(i, x)) * inverse;
            x[i] += step;
            let upper = diagonal[i] as usize + 1..a.start[i + 1] as usize;
            for (&j, v) in a.col[upper.clone()].iter().zip(&a.value[upper]) {
                r[j as usize] -= v * step;
            }
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
        let (a, inverse) = (self.a.view(), &self.inverse_diagonal);
        for i in (0..self.b.len()).rev().filter(|&i| inverse[i] != 0.0) {
            self.x[i] += (self.b[i] - a.dot(i, &self.x)) * inverse[i];
        }
    }

    fn smooth_forward(&mut self) {
        let (a, inverse) = (self.a.view(), &self.inverse_diagonal);
        for i in (0..self.b.len()).filter(|&i| inverse[i] != 0.0) {
            self.x[i] += (self.b[i] - a.dot(i, &self.x)) * inverse[i];
        }
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
    direction: Vec<f64>,
    changed: Vec<u32>,
    marked: Vec<bool>,
}

impl TruncatedMultigrid {
    /// For a symmetric matrix; prolongations finest first. `matrices` are the matrix and, as far as they are known, its Galerkin products
    /// over all unknowns; their arrays are shared until unknowns are left out.
    pub(crate) fn new(matrices: &[Rows], prolongations: &[Arc<Prolongation>]) -> Result<Self, LinearError> {
        let Some(a) = matrices.first() else {
            return Err(LinearError::NotAnalyzed);
        };
        let n = a.nrows();
        let mut levels = vec![Level::new(a.clone())?];
        let mut all = Vec::new();
        for (k, p) in prolongations.iter().enumerate() {
            let fine = &levels[levels.len() - 1].a;
            check_length("the prolongation (rows)", p.num_fine(), fine.nrows())?;
            let mut galerkin = Galerkin::new(p);
            let next = match matrices.get(k + 1) {
                Some(known) => known.clone(),
                None => galerkin.product(fine, p),
            };
            levels.push(Level::new(next)?);
            all.push(galerkin);
        }
        for level in &mut levels {
            (0..level.b.len()).for_each(|i| level.invert_diagonal(i, true));
        }
        Ok(Self {
            prolongations: prolongations.to_vec(),
            galerkin: all,
            levels,
            // As long as nothing is left out, all coarse matrices are right.
            free: vec![true; n],
            direction: vec![0.0; n],
            changed: Vec::new(),
            marked: vec![false; n],
        })
    }

    /// Number of unknowns.
    pub(crate) fn order(&self) -> usize {
        self.free.len()
    }

    /// Replaces the values of the matrix of the finest level, over the same pattern, and sums all coarse matrices again.
    pub(crate) fn revalue(&mut self, values: &[f64]) {
        self.levels[0].a.parts_mut().2.copy_from_slice(values);
        for k in 0..self.prolongations.len() {
            let (above, below) = self.levels.split_at_mut(k + 1);
            let mask = (k == 0).then_some(&*self.free);
            self.galerkin[k].sum(&above[k].a, mask, &self.prolongations[k], None, &mut below[0].a);
        }
        for (k, level) in self.levels.iter_mut().enumerate() {
            (0..level.b.len()).for_each(|i| level.invert_diagonal(i, k > 0 || self.free[i]));
        }
    }

    /// Whether all free unknowns have a positive entry on the diagonal, without which no cycle moves them.
    fn has_positive_diagonal(&self) -> bool {
        let inverse = &self.levels[0].inverse_diagonal;
        self.free.iter().zip(inverse).all(|(free, d)| !free || *d > 0.0)
    }

    /// Overwrites b by the result of one cycle from zero.
    fn precondition(&mut self, b: &mut [f64]) {
        self.levels[0].b.copy_from_slice(b);
        self.cycle();
        b.copy_from_slice(&self.levels[0].x);
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
        // Rows of the truncated matrix change with their own unknown and with those of their neighbours.
        for i in (0..free.len()).filter(|&i| free[i] != known[i]) {
            fine.invert_diagonal(i, free[i]);
            for &j in fine.a.view().row(i).0 {
                if !marked[j as usize] {
                    marked[j as usize] = true;
                    changed.push(j);
                }
            }
        }
        changed.iter().for_each(|&j| marked[j as usize] = false);
        known.copy_from_slice(free);
        let anew = changed.len() > free.len() / 2;
        for k in 0..self.prolongations.len() {
            let (above, below) = levels.split_at_mut(k + 1);
            let mask = (k == 0).then_some(&**known);
            let rows = (!anew).then_some(&**changed);
            let coarse = &mut below[0];
            let affected =
                self.galerkin[k].sum(&above[k].a, mask, &self.prolongations[k], rows, &mut coarse.a);
            affected
                .iter()
                .for_each(|&i| coarse.invert_diagonal(i as usize, true));
            if !anew {
                changed.clear();
                changed.extend_from_slice(affected);
            }
        }
    }

    /// One cycle: x₀ ← approximately A⁻¹ b₀, r₀ ← b₀ − A x₀ over the free unknowns.
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
        (1..sweeps).for_each(|_| coarsest.smooth_backward());
        coarsest.smooth_backward_to_residual();
        for k in (0..last).rev() {
            let (above, below) = self.levels.split_at_mut(k + 1);
            let fine = &mut above[k];
            let p = self.prolongations[k].rows();
            for (i, (x, inverse)) in fine.x.iter_mut().zip(&fine.inverse_diagonal).enumerate() {
                if *inverse != 0.0 {
                    *x += p.dot(i, &below[0].x);
                }
            }
            if k == 0 {
                fine.smooth_backward_to_residual();
            } else {
                fine.smooth_backward();
            }
        }
    }

    /// Conjugate gradients for A_FF d = r_F: stops when ‖r_F‖₂ has fallen by `tolerance`. `d` is overwritten, zero where unknowns are left
    /// out, and so is `r`. Returns the number of iterations; stops at `limit`.
    pub(crate) fn solve(
        &mut self,
        r: &mut [f64],
        d: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Result<usize, LinearError> {
        if !self.has_positive_diagonal() {
            return Err(LinearError::NotPositiveDefinite);
        }
        d.fill(0.0);
        let residual = &mut self.levels[0].b;
        for ((b, r), free) in residual.iter_mut().zip(&*r).zip(&self.free) {
            *b = if *free { *r } else { 0.0 };
        }
        let mut size = inner(residual, residual);
        let goal = size * tolerance * tolerance;
        self.direction.fill(0.0);
        let product = r;
        product.fill(0.0);
        let mut rho = 1.0;
        for iteration in 0..limit {
            if size <= goal || size == 0.0 {
                return Ok(iteration);
            }
            self.cycle();
            let Level { x: z, b, r: rest, .. } = &mut self.levels[0];
            let next = inner(b, z);
            if !(next > 0.0 && next.is_finite()) {
                return Err(LinearError::NotPositiveDefinite);
            }
            let beta = if iteration == 0 { 0.0 } else { next / rho };
            rho = next;
            // The cycle leaves A z = b − rest behind, so that A times the direction follows by recurrence, without another product.
            let mut curvature = 0.0;
            for (((((p, image), z), b), rest), free) in (self.direction.iter_mut())
                .zip(&mut *product)
                .zip(&*z)
                .zip(&*b)
                .zip(&*rest)
                .zip(&self.free)
            {
                *p = z + beta * *p;
                *image = if *free { b - rest } else { 0.0 } + beta * *image;
                curvature += *image * *p;
            }
            if !(curvature > 0.0 && curvature.is_finite()) {
                return Err(LinearError::NotPositiveDefinite);
            }
            let alpha = rho / curvature;
            size = 0.0;
            for (((d, p), b), product) in d.iter_mut().zip(&self.direction).zip(b).zip(&*product) {
                *d += alpha * p;
                *b -= alpha * product;
                size += *b * *b;
            }
        }
        Ok(if size <= goal { limit - 1 } else { limit })
    }
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
