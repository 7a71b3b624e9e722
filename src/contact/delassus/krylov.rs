//! GMRES with a Cholesky factorisation in front of it, for matrices that are symmetric but for a few rows.

use crate::linear::{Cholesky, LinearSolver};
use crate::sparse::{MatrixRef, dot};

/// Most directions; the basis is not restarted.
const DIRECTIONS: usize = 80;

/// Relative residual aimed at, and the worst that is handed out.
const AIM: f64 = 1e-12;
const ACCEPT: f64 = 1e-4;

/// Workspace of right-preconditioned GMRES (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986)).
#[derive(Debug, Default)]
pub(super) struct Gmres {
    /// Orthonormal basis, column-major.
    basis: Vec<f64>,
    /// Upper triangular factor by columns, `DIRECTIONS + 1` rows each.
    hessenberg: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    rhs: Vec<f64>,
    z: Vec<f64>,
}

impl Gmres {
    /// Overwrites `b` by A⁻¹ b; `near` holds the factors of a matrix near A. `None` without convergence.
    pub(super) fn solve(&mut self, a: MatrixRef<'_>, near: &mut Cholesky, b: &mut [f64]) -> Option<()> {
        const ROWS: usize = DIRECTIONS + 1;
        let n = b.len();
        self.basis.resize(n * ROWS, 0.0);
        self.hessenberg.resize(ROWS * DIRECTIONS, 0.0);
        self.rhs.clear();
        self.rhs.resize(ROWS, 0.0);
        self.rotations.clear();
        self.z.resize(n, 0.0);
        let size = dot(b, b).sqrt();
        if size == 0.0 {
            return Some(());
        }
        self.rhs[0] = size;
        for (v, b) in self.basis.iter_mut().zip(b.iter()) {
            *v = b / size;
        }
        let mut k = 0;
        while k < DIRECTIONS && self.rhs[k].abs() > AIM * size {
            let (old, new) = self.basis.split_at_mut(n * (k + 1));
            let w = &mut new[..n];
            self.z.copy_from_slice(&old[n * k..]);
            near.solve_in_place(&mut self.z).ok()?;
            w.fill(0.0);
            a.mul_add(1.0, &self.z, w);
            let h = &mut self.hessenberg[ROWS * k..ROWS * (k + 1)];
            for (i, v) in old.chunks_exact(n).enumerate() {
                let c = dot(v, w);
                h[i] = c;
                w.iter_mut().zip(v).for_each(|(w, v)| *w -= c * v);
            }
            let norm = dot(w, w).sqrt();
            if norm > 0.0 {
                w.iter_mut().for_each(|w| *w /= norm);
            }
            for (i, &(c, s)) in self.rotations.iter().enumerate() {
                (h[i], h[i + 1]) = (c * h[i] + s * h[i + 1], c * h[i + 1] - s * h[i]);
            }
            let length = h[k].hypot(norm);
            if length == 0.0 || !length.is_finite() {
                return None;
            }
            let (c, s) = (h[k] / length, norm / length);
            self.rotations.push((c, s));
            h[k] = length;
            (self.rhs[k], self.rhs[k + 1]) = (c * self.rhs[k], -s * self.rhs[k]);
            k += 1;
        }
        if self.rhs[k].abs() > ACCEPT * size {
            return None;
        }
        for i in (0..k).rev() {
            let tail: f64 = (i + 1..k)
                .map(|j| self.hessenberg[ROWS * j + i] * self.rhs[j])
                .sum();
            self.rhs[i] = (self.rhs[i] - tail) / self.hessenberg[ROWS * i + i];
        }
        b.fill(0.0);
        for (v, c) in self.basis.chunks_exact(n).zip(&self.rhs[..k]) {
            b.iter_mut().zip(v).for_each(|(b, v)| *b += c * v);
        }
        near.solve_in_place(b).ok()
    }
}
