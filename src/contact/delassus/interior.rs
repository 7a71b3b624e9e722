//! Interior points for the law with De Saxcé's term: from anywhere into the neighbourhood of a solution.

use super::nt::{Nt, jordan, jordan_divide, reach};
use super::scaled::{Scaled, add_product};
use crate::linear::{AutoSolver, Cholesky, Gmres, LinearSolver};
use crate::sparse::{MatrixRef, PatternRef};

/// Directions of GMRES, which is not restarted; the relative residual aimed at, and the worst that is handed out. Matrices are symmetric
/// but for a few rows, and a Cholesky factorisation of the rest is in front.
const DIRECTIONS: usize = 80;
const AIM: f64 = 1e-12;
const ACCEPT: f64 = 1e-4;

/// How far towards the boundary of the cones a step may go.
const FRACTION: f64 = 0.995;

/// A shorter step is one that De Saxcé's term has spoilt; the next few leave its derivative out. The iteration then is that of a
/// convex problem, slower but of longer steps.
pub(super) const SHORT: f64 = 0.1;
const FREEZE: usize = 5;

/// Added to the matrix against a mean diagonal of M of 1: near the boundary W² vanishes on the kernel of M.
const SHIFT: f64 = 1e-12;
const LARGEST_SHIFT: f64 = 1e-5;

/// Orders from here on are solved by Cholesky and GMRES where M is sparse: fill-in is a fraction of that of LU.
const LARGE: usize = 1500;

/// A primal–dual interior-point iteration with Nesterov–Todd scaling and Mehrotra's corrector.
///
/// In x = (μ r_N, r_T) and y = (û_N / μ, û_T) both cones are the second-order cone L, and the problem reads
/// y = M̃ x + q̃ + ‖u_T‖ e_N, x ∘ y = 0. The Newton matrix G M̃ + W², with W² x = y and G the derivative of De Saxcé's term, is
/// regular however deficient the rank of M, which makes the iteration a way through hyperstatic problems. Frictionless contacts
/// are half-lines.
/// Compare V. Acary, P. Armand, H. Minh Nguyen, M. Shpakovych, *Second order cone programming for frictional contact mechanics
/// using interior point algorithm* (2023); L. Vandenberghe, *The CVXOPT linear and quadratic cone program solvers* (2010).
#[derive(Debug)]
pub(super) struct Interior<const D: usize> {
    solver: AutoSolver,
    /// Whether the symmetric part is factored, and GMRES does the rest.
    symmetric: bool,
    cholesky: Cholesky,
    gmres: Gmres,
    /// M̃ + W² without De Saxcé's term.
    near: Vec<f64>,
    /// Steps left with De Saxcé's term frozen.
    frozen: usize,
    may_freeze: bool,
    pub(super) x: Vec<[f64; D]>,
    y: Vec<[f64; D]>,
    /// M̃ x + q̃ + ‖u_T‖ e_N.
    image: Vec<[f64; D]>,
    /// u_T / ‖u_T‖ (first component unused).
    direction: Vec<[f64; D]>,
    w: Vec<Nt<D>>,
    rhs: Vec<f64>,
    dx: Vec<[f64; D]>,
    dy: Vec<[f64; D]>,
    work: Vec<[f64; D]>,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
}

impl<const D: usize> Interior<D> {
    pub(super) fn new(p: &Scaled<D>) -> Self {
        let nc = p.contacts();
        let m = &p.matrix;
        let mut col_ptr = vec![0];
        let mut row_idx = Vec::with_capacity(m.blocks.len() * D * D);
        for j in 0..nc {
            for _ in 0..D {
                for &i in &m.row[m.col_ptr[j]..m.col_ptr[j + 1]] {
                    row_idx.extend((0..D).map(|a| i * D + a));
                }
                col_ptr.push(row_idx.len());
            }
        }
        let n = nc * D;
        let symmetric = n >= LARGE && row_idx.len() < n * n / 4 && m.is_structurally_symmetric();
        let zero = vec![[0.0; D]; nc];
        let unit = Nt {
            beta: 1.0,
            v: [0.0; D],
            w: [0.0; D],
        };
        Self {
            solver: AutoSolver::new(),
            symmetric,
            cholesky: Cholesky::new(),
            gmres: Gmres::new(DIRECTIONS),
            near: vec![0.0; if symmetric { row_idx.len() } else { 0 }],
            frozen: 0,
            may_freeze: false,
            x: zero.clone(),
            y: zero.clone(),
            image: zero.clone(),
            direction: zero.clone(),
            w: vec![unit; nc],
            rhs: vec![0.0; nc * D],
            dx: zero.clone(),
            dy: zero.clone(),
            work: zero,
            values: vec![0.0; row_idx.len()],
            col_ptr,
            row_idx,
        }
    }

    /// The pattern of the Newton matrix, whose columns are made of whole blocks: column pointers and row indices.
    pub(super) fn into_pattern(self) -> (Vec<usize>, Vec<usize>) {
        (self.col_ptr, self.row_idx)
    }

    /// Whether the order is one at which a factorisation that may be of no use is too dear.
    pub(super) fn is_large(&self) -> bool {
        self.rhs.len() >= LARGE
    }

    /// Puts x and y well inside of the cones near the reactions `r`.
    pub(super) fn start(&mut self, p: &Scaled<D>, r: &[[f64; D]], may_freeze: bool) {
        self.may_freeze = may_freeze;
        self.frozen = 0;
        for i in 0..r.len() {
            let mu = p.friction[i];
            self.x[i] = r[i];
            if mu > 0.0 {
                self.x[i][0] *= mu;
            } else {
                self.x[i] = std::array::from_fn(|k| if k == 0 { r[i][0] } else { 0.0 });
            }
        }
        self.evaluate(p);
        let mean = |v: &[[f64; D]]| v.iter().map(|z| z[0].abs()).sum::<f64>() / v.len() as f64;
        let (dx, dy) = (mean(&self.x).max(1e-3), mean(&self.image).max(1e-3));
        for i in 0..r.len() {
            let t = super::cone::tangential_norm(&self.x[i]);
            self.x[i][0] = self.x[i][0].max(t + dx);
            self.y[i] = self.image[i];
            if p.friction[i] == 0.0 {
                self.y[i] = [0.0; D];
                self.y[i][0] = self.image[i][0].max(dy);
            } else {
                let t = super::cone::tangential_norm(&self.y[i]);
                self.y[i][0] = self.y[i][0].max(t + dy);
            }
        }
    }

    /// The reactions of x.
    pub(super) fn reactions(&self, p: &Scaled<D>, r: &mut [[f64; D]]) {
        for i in 0..r.len() {
            r[i] = self.x[i];
            if p.friction[i] > 0.0 {
                r[i][0] /= p.friction[i];
            }
        }
    }

    /// Complementarity, mean of x·y over the contacts.
    pub(super) fn gap(&self) -> f64 {
        let sum: f64 = self
            .x
            .iter()
            .flatten()
            .zip(self.y.iter().flatten())
            .map(|(a, b)| a * b)
            .sum();
        sum / self.x.len() as f64
    }

    fn evaluate(&mut self, p: &Scaled<D>) {
        self.reactions_into_work(p);
        for i in 0..self.x.len() {
            let mut u = p.q[i];
            p.matrix.add_row(i, &self.work, &mut u);
            let mu = p.friction[i];
            let t = super::cone::tangential_norm(&u);
            self.direction[i] = if t > 0.0 { u.map(|v| v / t) } else { [0.0; D] };
            if mu > 0.0 {
                u[0] = u[0] / mu + t;
            }
            self.image[i] = u;
        }
    }

    fn reactions_into_work(&mut self, p: &Scaled<D>) {
        let mut work = std::mem::take(&mut self.work);
        self.reactions(p, &mut work);
        self.work = work;
    }

    fn assemble(&mut self, p: &Scaled<D>, shift: f64) {
        let m = &p.matrix;
        let mut at = 0;
        let slope = f64::from(self.frozen == 0);
        for j in 0..self.x.len() {
            let column = if p.friction[j] > 0.0 {
                p.friction[j].recip()
            } else {
                1.0
            };
            for c in 0..D {
                let s = if c == 0 { column } else { 1.0 };
                for k in m.col_ptr[j]..m.col_ptr[j + 1] {
                    let i = m.row[k];
                    let block = &m.blocks[m.slot[k]];
                    let mu = p.friction[i];
                    if mu > 0.0 {
                        let term: f64 = (1..D).map(|a| self.direction[i][a] * block[a][c]).sum();
                        self.values[at] = s * (block[0][c] / mu + slope * term);
                        for a in 1..D {
                            self.values[at + a] = s * block[a][c];
                        }
                    } else {
                        self.values[at] = s * block[0][c];
                        self.values[at + 1..at + D].fill(0.0);
                    }
                    if self.symmetric {
                        for a in 0..D {
                            let row = match (mu > 0.0, a) {
                                (true, 0) => mu.recip(),
                                (false, a) if a > 0 => 0.0,
                                _ => 1.0,
                            };
                            let kept = p.friction[j] > 0.0 || c == 0;
                            self.near[at + a] = if kept { s * row * block[a][c] } else { 0.0 };
                        }
                    }
                    if i == j {
                        let w = if mu > 0.0 {
                            self.w[i].square()
                        } else {
                            let mut w = [[0.0; D]; D];
                            w[0][0] = self.y[i][0] / self.x[i][0];
                            for a in 1..D {
                                w[a][a] = 1.0;
                            }
                            w
                        };
                        for a in 0..D {
                            self.values[at + a] += w[a][c];
                        }
                        self.values[at + c] += shift * s * s;
                        if self.symmetric {
                            for a in 0..D {
                                self.near[at + a] += w[a][c];
                            }
                            self.near[at + c] += shift * s * s;
                        }
                    }
                    at += D;
                }
            }
        }
    }

    /// One step with one factorisation; the length of the step, or `None` if the matrix was singular.
    pub(super) fn step(&mut self, p: &Scaled<D>) -> Option<f64> {
        let nc = self.x.len();
        self.evaluate(p);
        for i in 0..nc {
            if p.friction[i] > 0.0 {
                self.w[i] = Nt::new(&self.x[i], &self.y[i]);
            }
        }
        // Near the boundary the matrix may be singular to working precision: a larger shift makes the step inexact, no more.
        let mut shift = SHIFT;
        loop {
            self.assemble(p, shift);
            if self.predict_and_correct(p).is_some() {
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
        let length = (FRACTION * self.longest(p)).min(1.0);
        for i in 0..nc {
            for k in 0..D {
                self.x[i][k] += length * self.dx[i][k];
                self.y[i][k] += length * self.dy[i][k];
            }
        }
        if self.frozen > 0 {
            self.frozen -= 1;
        } else if self.may_freeze && length < SHORT {
            self.frozen = FREEZE;
        }
        Some(length)
    }

    /// Mehrotra's direction with the matrix assembled last.
    fn predict_and_correct(&mut self, p: &Scaled<D>) -> Option<()> {
        self.factor()?;
        let gap = self.gap();
        self.direction_for(p, 0.0, 1.0, false)?;
        let affine = self.longest(p);
        let centring = (1.0 - affine).powi(3).clamp(1e-6, 1.0);
        self.direction_for(p, centring * gap, 1.0 - centring, true)
    }

    fn factor(&mut self) -> Option<()> {
        let pattern = PatternRef::square(&self.col_ptr, &self.row_idx);
        if self.symmetric {
            let near = &self.near;
            let factored = self.cholesky.analyze(pattern).and_then(|()| {
                let matrix = MatrixRef {
                    pattern,
                    values: near,
                };
                self.cholesky.factor(matrix)
            });
            if factored.is_ok() {
                return Some(());
            }
            return None;
        }
        self.solver.analyze(pattern).ok()?;
        let values = &self.values;
        self.solver.factor(MatrixRef { pattern, values }).ok()
    }

    fn solve(&mut self) -> Option<()> {
        if self.symmetric {
            let pattern = PatternRef::square(&self.col_ptr, &self.row_idx);
            let matrix = MatrixRef {
                pattern,
                values: &self.values,
            };
            let cholesky = &mut self.cholesky;
            let outcome = self.gmres.solve(
                |x, y| matrix.mul_add(1.0, x, y),
                |b| cholesky.solve_in_place(b),
                &mut self.rhs,
                AIM,
                DIRECTIONS,
            );
            return outcome.ok().filter(|o| o.residual <= ACCEPT).map(|_| ());
        }
        self.solver.solve_in_place(&mut self.rhs).ok()
    }

    /// dx, dy towards x ∘ y = σ e; with the second-order term of the last direction if `correct`.
    fn direction_for(&mut self, p: &Scaled<D>, sigma: f64, weight: f64, correct: bool) -> Option<()> {
        for i in 0..self.x.len() {
            let (x, y) = (&self.x[i], &self.y[i]);
            let infeasible: [f64; D] = std::array::from_fn(|k| self.image[i][k] - y[k]);
            let target = &mut self.work[i];
            if p.friction[i] > 0.0 {
                let w = &self.w[i];
                let lambda = w.apply(x);
                let mut d = jordan(&lambda, &lambda).map(|v| -v);
                // x ∘ y = σ e has x·y = σ: the gap counts one for a contact.
                d[0] += sigma;
                if correct {
                    let second = jordan(&w.apply(&self.dx[i]), &w.apply_inverse(&self.dy[i]));
                    for k in 0..D {
                        d[k] -= second[k];
                    }
                }
                *target = w.apply(&jordan_divide(&lambda, &d));
            } else {
                let second = if correct {
                    self.dx[i][0] * self.dy[i][0]
                } else {
                    0.0
                };
                *target = [0.0; D];
                target[0] = (sigma - x[0] * y[0] - second) / x[0];
            }
            for k in 0..D {
                let used = p.friction[i] > 0.0 || k == 0;
                self.rhs[i * D + k] = if used {
                    target[k] - weight * infeasible[k]
                } else {
                    0.0
                };
            }
        }
        self.solve()?;
        for i in 0..self.x.len() {
            self.dx[i].copy_from_slice(&self.rhs[i * D..(i + 1) * D]);
            let mut dy = self.work[i];
            if p.friction[i] > 0.0 {
                let minus = self.w[i].square().map(|row| row.map(|v| -v));
                add_product(&minus, &self.dx[i], &mut dy);
            } else {
                dy[0] -= self.y[i][0] / self.x[i][0] * self.dx[i][0];
            }
            self.dy[i] = dy;
        }
        Some(())
    }

    fn longest(&self, p: &Scaled<D>) -> f64 {
        let mut t = 1.0_f64;
        for i in 0..self.x.len() {
            if p.friction[i] > 0.0 {
                t = t
                    .min(reach(&self.x[i], &self.dx[i]))
                    .min(reach(&self.y[i], &self.dy[i]));
            } else {
                for (z, d) in [(self.x[i][0], self.dx[i][0]), (self.y[i][0], self.dy[i][0])] {
                    if d < 0.0 {
                        t = t.min(-z / d);
                    }
                }
            }
        }
        t
    }
}
