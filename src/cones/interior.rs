//! An interior-point method for complementarity on products of symmetric cones: from any start into the neighbourhood of a solution.

use std::ops::Range;

use super::Cone;
use super::jordan::{Scaling, jordan, jordan_divide, reach};
use super::semidefinite::MatrixScaling;
use crate::linear::{AutoSolver, Cholesky, Gmres, LinearSolver};
use crate::sparse::{MatrixRef, PatternRef, dot, norm};
use crate::tolerances::{LOOSE, RESULT};

/// Directions of GMRES, which is not restarted. Matrices are symmetric but for a few rows, and a Cholesky
/// factorisation of a symmetric matrix near them is the preconditioner.
const DIRECTIONS: usize = 80;

/// Largest part of the step to the boundary of the cones that is taken.
const FRACTION: f64 = 0.995;

/// Added to the diagonal, whose typical size is 1: near the boundary W² vanishes on the kernel of the derivative.
const SHIFT: f64 = 1e-12;
const LARGEST_SHIFT: f64 = 1e-5;

/// The map x ↦ y, with derivatives whose typical size is 1.
pub(crate) trait Image {
    /// Writes y(x).
    fn image(&mut self, x: &[f64], y: &mut [f64]);

    /// Writes the derivative at the x of the last [`image`](Self::image) over the pattern.
    fn derivative(&self, values: &mut [f64]);

    /// Writes a symmetric matrix near the derivative. Called where the iteration was made with `symmetric`.
    fn near(&self, values: &mut [f64]) {
        self.derivative(values);
    }

    /// Size of the diagonal entry of a variable, relative to that of the others.
    fn unit(&self, _variable: usize) -> f64 {
        1.0
    }
}

/// A primal–dual interior-point iteration with Nesterov–Todd scaling and Mehrotra's corrector for x ∈ K, y(x) ∈ K*, x ∘ y = 0.
///
/// With W² x = y the Newton matrix is y′ + W², regular for monotone y however deficient the rank of y′, except for free variables. Compare
/// L. Vandenberghe, *The CVXOPT linear and quadratic cone program solvers* (2010).
#[derive(Debug)]
pub(crate) struct Interior {
    solver: AutoSolver,
    /// Whether a symmetric matrix is factored and preconditions GMRES.
    symmetric: bool,
    cholesky: Cholesky,
    gmres: Gmres,
    near: Vec<f64>,
    /// Cones with their variables; what is in none of them is free.
    cones: Vec<Range<usize>>,
    /// The scaling of those that hold matrices.
    matrices: Vec<Option<MatrixScaling>>,
    free: Vec<usize>,
    x: Vec<f64>,
    y: Vec<f64>,
    /// y(x).
    image: Vec<f64>,
    /// Of W, cone by cone.
    beta: Vec<f64>,
    v: Vec<f64>,
    w: Vec<f64>,
    rhs: Vec<f64>,
    dx: Vec<f64>,
    dy: Vec<f64>,
    target: Vec<f64>,
    /// Buffers for W x and the products of one cone.
    room: [Vec<f64>; 3],
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    /// In each column, the place of the first row of its cone.
    diagonal: Vec<usize>,
}

impl Interior {
    /// For a derivative with entries at `row_idx`, column by column, increasing, the whole diagonal blocks of the cones among them. If
    /// `symmetric`, a symmetric matrix near it is factored as long as it is definite.
    pub(crate) fn new(
        parts: impl IntoIterator<Item = Cone>,
        col_ptr: Vec<usize>,
        row_idx: Vec<usize>,
        symmetric: bool,
    ) -> Self {
        let (mut cones, mut matrices, mut free, mut n) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for cone in parts {
            let range = n..n + cone.len();
            n = range.end;
            match cone {
                Cone::SecondOrder(_) => cones.push(range),
                Cone::Nonnegative(_) => cones.extend(range.map(|k| k..k + 1)),
                Cone::Free(_) => free.extend(range),
                Cone::Semidefinite(order) => {
                    cones.push(range);
                    matrices.resize(cones.len() - 1, None);
                    matrices.push(Some(MatrixScaling::identity(order)));
                }
            }
        }
        matrices.resize(cones.len(), None);
        let mut first: Vec<usize> = (0..n).collect();
        for range in &cones {
            first[range.clone()].fill(range.start);
        }
        let place = |j: usize| {
            let rows = &row_idx[col_ptr[j]..col_ptr[j + 1]];
            col_ptr[j] + rows.partition_point(|&i| i < first[j])
        };
        let widest = cones.iter().map(Range::len).max().unwrap_or(0);
        Self {
            solver: AutoSolver::new(),
            symmetric,
            cholesky: Cholesky::new(),
            gmres: Gmres::new(DIRECTIONS),
            near: vec![0.0; if symmetric { row_idx.len() } else { 0 }],
            diagonal: (0..n).map(place).collect(),
            beta: vec![1.0; cones.len()],
            cones,
            matrices,
            free,
            x: vec![0.0; n],
            y: vec![0.0; n],
            image: vec![0.0; n],
            v: vec![0.0; n],
            w: vec![0.0; n],
            rhs: vec![0.0; n],
            dx: vec![0.0; n],
            dy: vec![0.0; n],
            target: vec![0.0; n],
            room: std::array::from_fn(|_| vec![0.0; widest]),
            values: vec![0.0; row_idx.len()],
            col_ptr,
            row_idx,
        }
    }

    /// The pattern: column pointers and row indices.
    pub(crate) fn into_pattern(self) -> (Vec<usize>, Vec<usize>) {
        (self.col_ptr, self.row_idx)
    }

    pub(crate) fn x(&self) -> &[f64] {
        &self.x
    }

    /// Puts x and y well inside of the cones near the given x, at least `least` from their boundaries.
    pub(crate) fn start(&mut self, map: &mut impl Image, x: &[f64], least: f64) {
        self.x.copy_from_slice(x);
        map.image(&self.x, &mut self.image);
        self.y.copy_from_slice(&self.image);
        for z in [&mut self.x, &mut self.y] {
            let sum: f64 = self.cones.iter().map(|r| z[r.start].abs()).sum();
            let inside = (sum / self.cones.len() as f64).max(least);
            for (range, matrix) in self.cones.iter().zip(&self.matrices) {
                let z = &mut z[range.clone()];
                match matrix {
                    Some(m) => m.lift(inside, z),
                    None => z[0] = z[0].max(norm(&z[1..]) + inside),
                }
            }
        }
        for &k in &self.free {
            self.y[k] = 0.0;
        }
    }

    /// Complementarity, mean of x·y over the cones and the rows of matrices.
    pub(crate) fn gap(&self) -> f64 {
        let rows = |m: &Option<MatrixScaling>| m.as_ref().map_or(1, MatrixScaling::order);
        let degree: usize = self.matrices.iter().map(rows).sum();
        dot(&self.x, &self.y) / degree.max(1) as f64
    }

    fn scaling(&self, cone: usize) -> CurrentScaling<'_> {
        let range = self.cones[cone].clone();
        match &self.matrices[cone] {
            Some(m) => CurrentScaling::Matrix(m),
            None => CurrentScaling::SecondOrder(Scaling {
                beta: self.beta[cone],
                v: &self.v[range.clone()],
                w: &self.w[range],
            }),
        }
    }

    /// One step with one factorisation; its length, or `None` if the matrix was singular.
    pub(crate) fn step(&mut self, map: &mut impl Image) -> Option<f64> {
        map.image(&self.x, &mut self.image);
        for (k, range) in self.cones.iter().enumerate() {
            let (x, y) = (&self.x[range.clone()], &self.y[range.clone()]);
            match &mut self.matrices[k] {
                Some(m) => {
                    if !m.between(x, y) {
                        return None;
                    }
                }
                None => {
                    let (v, w) = (&mut self.v[range.clone()], &mut self.w[range.clone()]);
                    self.beta[k] = Scaling::between(x, y, v, w);
                }
            }
        }
        // Near the boundary the matrix may be singular to working precision: a larger shift makes the step inexact, no more.
        let mut shift = SHIFT;
        loop {
            self.assemble(map, shift);
            if self.predict_and_correct().is_some() {
                break;
            }
            if self.symmetric {
                self.symmetric = false;
                continue;
            }
            shift *= 1e2;
            if shift > LARGEST_SHIFT {
                return None;
            }
        }
        let length = (FRACTION * self.longest()).min(1.0);
        for (z, d) in [(&mut self.x, &self.dx), (&mut self.y, &self.dy)] {
            z.iter_mut().zip(d).for_each(|(z, d)| *z += length * d);
        }
        Some(length)
    }

    fn assemble(&mut self, map: &impl Image, shift: f64) {
        let (mut all, mut near) = (std::mem::take(&mut self.values), std::mem::take(&mut self.near));
        map.derivative(&mut all);
        if self.symmetric {
            map.near(&mut near);
        }
        for values in [Some(&mut all), self.symmetric.then_some(&mut near)] {
            let Some(values) = values else { continue };
            for (k, range) in self.cones.iter().enumerate() {
                let scaling = self.scaling(k);
                for (c, j) in range.clone().enumerate() {
                    let at = self.diagonal[j];
                    for (a, value) in values[at..at + range.len()].iter_mut().enumerate() {
                        *value += scaling.square(a, c);
                    }
                    values[at + c] += shift * map.unit(j);
                }
            }
            for &j in &self.free {
                values[self.diagonal[j]] += shift * map.unit(j);
            }
        }
        (self.values, self.near) = (all, near);
    }

    /// Mehrotra's direction with the matrix assembled last.
    fn predict_and_correct(&mut self) -> Option<()> {
        self.factor()?;
        let gap = self.gap();
        self.direction_for(0.0, 1.0, false)?;
        let affine = self.longest();
        let centring = (1.0 - affine).powi(3).clamp(1e-6, 1.0);
        self.direction_for(centring * gap, 1.0 - centring, true)
    }

    fn factor(&mut self) -> Option<()> {
        let pattern = PatternRef::square(&self.col_ptr, &self.row_idx);
        if self.symmetric {
            self.cholesky.analyze(pattern).ok()?;
            let values = &self.near;
            return self.cholesky.factor(MatrixRef { pattern, values }).ok();
        }
        self.solver.analyze(pattern).ok()?;
        let values = &self.values;
        self.solver.factor(MatrixRef { pattern, values }).ok()
    }

    fn solve(&mut self) -> Option<()> {
        if self.symmetric {
            let matrix = MatrixRef {
                pattern: PatternRef::square(&self.col_ptr, &self.row_idx),
                values: &self.values,
            };
            let cholesky = &mut self.cholesky;
            let outcome = self.gmres.solve(
                |x, y| matrix.mul_add(1.0, x, y),
                |b| cholesky.solve_in_place(b),
                &mut self.rhs,
                RESULT,
                DIRECTIONS,
            );
            return outcome.ok().filter(|o| o.residual <= LOOSE).map(|_| ());
        }
        self.solver.solve_in_place(&mut self.rhs).ok()
    }

    /// dx, dy towards x ∘ y = σ e; with the second-order term of the last direction if `correct`.
    fn direction_for(&mut self, sigma: f64, weight: f64, correct: bool) -> Option<()> {
        let mut room = std::mem::take(&mut self.room);
        let mut target = std::mem::take(&mut self.target);
        for (k, range) in self.cones.iter().enumerate() {
            let scaling = self.scaling(k);
            let n = range.len();
            let [lambda, d, other] = &mut room;
            let (lambda, d, other) = (&mut lambda[..n], &mut d[..n], &mut other[..n]);
            let target = &mut target[range.clone()];
            // The second-order term first: its products need all the room.
            target.fill(0.0);
            if correct {
                scaling.apply(&self.dx[range.clone()], lambda);
                scaling.apply_inverse_transposed(&self.dy[range.clone()], other);
                scaling.product(lambda, other, target);
            }
            scaling.apply(&self.x[range.clone()], lambda);
            scaling.product(lambda, lambda, d);
            d.iter_mut()
                .zip(&*target)
                .for_each(|(d, second)| *d = -*d - second);
            scaling.add_unit(sigma, d);
            scaling.divide(lambda, d);
            scaling.apply_transposed(d, target);
        }
        for &k in &self.free {
            target[k] = 0.0;
        }
        for k in 0..self.rhs.len() {
            self.rhs[k] = target[k] - weight * (self.image[k] - self.y[k]);
        }
        (self.room, self.target) = (room, target);
        self.solve()?;
        self.dx.copy_from_slice(&self.rhs);
        self.dy.copy_from_slice(&self.target);
        let mut dy = std::mem::take(&mut self.dy);
        for (k, range) in self.cones.iter().enumerate() {
            self.scaling(k)
                .subtract_square(&self.dx[range.clone()], &mut dy[range.clone()]);
        }
        self.dy = dy;
        Some(())
    }

    fn longest(&self) -> f64 {
        let pairs = [(&self.x, &self.dx), (&self.y, &self.dy)];
        let reaches = self.cones.iter().zip(&self.matrices).flat_map(|(range, matrix)| {
            pairs.map(|(z, d)| {
                let (z, d) = (&z[range.clone()], &d[range.clone()]);
                match matrix {
                    Some(m) => m.reach(z, d),
                    None => reach(z, d),
                }
            })
        });
        reaches.fold(1.0, f64::min)
    }
}

/// The scaling W of one cone, W x = W⁻ᵀ y, and its algebra.
enum CurrentScaling<'a> {
    SecondOrder(Scaling<'a>),
    Matrix(&'a MatrixScaling),
}

impl CurrentScaling<'_> {
    fn apply(&self, z: &[f64], out: &mut [f64]) {
        match self {
            Self::SecondOrder(s) => s.apply(z, out),
            Self::Matrix(m) => m.apply(z, out),
        }
    }

    fn apply_transposed(&self, z: &[f64], out: &mut [f64]) {
        match self {
            Self::SecondOrder(s) => s.apply(z, out),
            Self::Matrix(m) => m.apply_transposed(z, out),
        }
    }

    fn apply_inverse_transposed(&self, z: &[f64], out: &mut [f64]) {
        match self {
            Self::SecondOrder(s) => s.apply_inverse(z, out),
            Self::Matrix(m) => m.apply_inverse_transposed(z, out),
        }
    }

    /// out − WᵀW z.
    fn subtract_square(&self, z: &[f64], out: &mut [f64]) {
        match self {
            Self::SecondOrder(s) => s.subtract_square(z, out),
            Self::Matrix(m) => m.subtract_square(z, out),
        }
    }

    /// Entry (i, j) of WᵀW.
    fn square(&self, i: usize, j: usize) -> f64 {
        match self {
            Self::SecondOrder(s) => s.square(i, j),
            Self::Matrix(m) => m.square(i, j),
        }
    }

    /// a ∘ b.
    fn product(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        match self {
            Self::SecondOrder(_) => jordan(a, b, out),
            Self::Matrix(m) => m.product(a, b, out),
        }
    }

    /// Overwrites b by z with λ ∘ z = b, λ = W x.
    fn divide(&self, lambda: &[f64], b: &mut [f64]) {
        match self {
            Self::SecondOrder(_) => jordan_divide(lambda, b),
            Self::Matrix(m) => m.divide(b),
        }
    }

    /// z + s e; x ∘ y = σ e has x·y = σ in a second-order cone: the gap counts one for it.
    fn add_unit(&self, s: f64, z: &mut [f64]) {
        match self {
            Self::SecondOrder(_) => z[0] += s,
            Self::Matrix(m) => m.add_unit(s, z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Zero;

    impl Image for Zero {
        fn image(&mut self, _: &[f64], y: &mut [f64]) {
            y.fill(0.0);
        }

        fn derivative(&self, values: &mut [f64]) {
            values.fill(0.0);
        }
    }

    /// x = y = s e, whatever the cones: x ∘ y = s² e.
    #[test]
    fn gaps_on_the_central_path_are_its_parameter() {
        for cones in [
            vec![Cone::SecondOrder(3)],
            vec![Cone::Semidefinite(3)],
            vec![
                Cone::Free(2),
                Cone::Nonnegative(2),
                Cone::SecondOrder(2),
                Cone::Semidefinite(4),
            ],
        ] {
            let n: usize = cones.iter().map(|c| c.len()).sum();
            let mut engine = Interior::new(cones, vec![0; n + 1], Vec::new(), false);
            engine.start(&mut Zero, &vec![0.0; n], 3.0);
            assert!((engine.gap() - 9.0).abs() < 1e-14);
        }
    }
}
