//! Semismooth Newton on the residual of Alart and Curnier, for M + αI and q − α c: one proximal step.

use super::cone::tangential_norm;
use super::scaled::{Block, ScaledProblem, Vector, add_product};
use super::tolerances::{HALVINGS, INEXACT, MEMORY};
use crate::clock::Deadline;
use crate::linear::{AutoSolver, LinearSolver};
use crate::sparse::{MatrixRef, PatternRef};
use crate::tolerances::ARMIJO;

/// How an inner iteration ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Inner {
    Converged,
    /// No decrease, too many iterations, a singular matrix or an overflow.
    Failed,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Piece {
    Open,
    Stick,
    Slip,
}

/// The residual F of one contact and its derivative dF = A dr + B du.
///
/// With z = r − u, u weighted: F_N = r_N − (z_N)₊, F_T = r_T − P(z_T) on the disc of radius μ (z_N)₊. P. Alart, A. Curnier, Comput. Methods
/// Appl. Mech. Engrg. 92 (1991), doi:10.1016/0045-7825(91)90022-X. All terms have the same unit, as the mean diagonal of M is 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local<const D: usize> {
    pub(super) piece: Piece,
    pub(super) f: [f64; D],
}

pub(super) fn alart_curnier<const D: usize>(mu: f64, r: &[f64; D], u: &[f64; D]) -> Local<D> {
    let z: [f64; D] = std::array::from_fn(|k| r[k] - u[k]);
    if z[0] <= 0.0 {
        return Local {
            piece: Piece::Open,
            f: *r,
        };
    }
    let radius = mu * z[0];
    let t = tangential_norm(&z);
    if t <= radius && mu > 0.0 {
        return Local {
            piece: Piece::Stick,
            f: *u,
        };
    }
    let scale = if t > 0.0 { radius / t } else { 0.0 };
    let mut f: [f64; D] = std::array::from_fn(|k| r[k] - scale * z[k]);
    f[0] = u[0];
    Local {
        piece: Piece::Slip,
        f,
    }
}

/// A and B of a slipping contact.
fn slip_derivative<const D: usize>(mu: f64, r: &[f64; D], u: &[f64; D]) -> (Block<D>, Block<D>) {
    let z: [f64; D] = std::array::from_fn(|k| r[k] - u[k]);
    let t = tangential_norm(&z);
    let mut a = [[0.0; D]; D];
    let mut b = [[0.0; D]; D];
    b[0][0] = 1.0;
    let scale = if t > 0.0 { mu * z[0] / t } else { 0.0 };
    for i in 1..D {
        a[i][i] = 1.0;
        if t == 0.0 {
            continue;
        }
        a[i][0] = -mu * z[i] / t;
        b[i][0] = mu * z[i] / t;
        for j in 1..D {
            let tangent = scale * (f64::from(i == j) - z[i] * z[j] / (t * t));
            a[i][j] -= tangent;
            b[i][j] = tangent;
        }
    }
    (a, b)
}

/// Workspace of the Newton iteration; nothing is allocated once the largest set of closed contacts has occurred.
#[derive(Debug)]
pub(super) struct Newton<const D: usize> {
    /// Created on first use: most small problems are solved without it.
    solver: Option<AutoSolver>,
    pub(super) factorisations: usize,
    pub(super) deadline: Deadline<'static>,
    /// Weight of velocities relative to reactions in the residual, for a mean diagonal of M of 1.
    pub(super) rho: f64,
    local: Vec<Local<D>>,
    a: Vec<Block<D>>,
    b: Vec<Block<D>>,
    u: Vector<D>,
    trial: Vector<D>,
    step: Vector<D>,
    closed: Vec<usize>,
    /// Index of each contact among the closed ones.
    index: Vec<usize>,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    rhs: Vec<f64>,
}

fn distance<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

impl<const D: usize> Newton<D> {
    pub(super) fn new(deadline: Deadline<'static>) -> Self {
        Self {
            solver: None,
            factorisations: 0,
            deadline,
            rho: 1.0,
            local: Vec::new(),
            a: Vec::new(),
            b: Vec::new(),
            u: Vec::new(),
            trial: Vec::new(),
            step: Vec::new(),
            closed: Vec::new(),
            index: Vec::new(),
            col_ptr: Vec::new(),
            row_idx: Vec::new(),
            values: Vec::new(),
            rhs: Vec::new(),
        }
    }

    /// Allocates for `nc` closed contacts, on first use: sweeps alone solve many problems.
    fn fit(&mut self, nc: usize, entries: usize) {
        if self.local.len() == nc {
            return;
        }
        let zero = [0.0; D];
        let open = Local {
            piece: Piece::Open,
            f: zero,
        };
        self.local.resize(nc, open);
        self.a.resize(nc, [[0.0; D]; D]);
        self.b.resize(nc, [[0.0; D]; D]);
        self.u.resize(nc, zero);
        self.trial.resize(nc, zero);
        self.step.resize(nc, zero);
        self.index.resize(nc, usize::MAX);
        self.closed.reserve(nc);
        self.rhs.reserve(nc * D);
        self.col_ptr.reserve(nc * D + 1);
        self.row_idx.reserve(entries);
        self.values.reserve(entries);
    }

    /// F at `r`; the squared norm.
    fn evaluate(&mut self, p: &ScaledProblem<D>, r: &[[f64; D]], alpha: f64, centre: &[[f64; D]]) -> f64 {
        p.velocities(r, &mut self.u);
        let mut sum = 0.0;
        for i in 0..r.len() {
            for k in 0..D {
                self.u[i][k] = self.rho * (self.u[i][k] + alpha * (r[i][k] - centre[i][k]));
            }
            self.local[i] = alart_curnier(p.friction[i], &r[i], &self.u[i]);
            sum += self.local[i].f.iter().map(|v| v * v).sum::<f64>();
        }
        sum
    }

    /// Improves `r` until ‖F‖₂ is at most `tolerance` or small relative to the proximal step; `r` is the last iterate in any case. The time
    /// limit is checked before each factorisation but the first.
    pub(super) fn solve(
        &mut self,
        p: &ScaledProblem<D>,
        r: &mut [[f64; D]],
        alpha: f64,
        centre: &[[f64; D]],
        tolerance: f64,
        max_iterations: usize,
    ) -> Inner {
        self.fit(r.len(), p.matrix.blocks.len() * D * D);
        let mut merit = self.evaluate(p, r, alpha, centre);
        let mut memory = [merit; MEMORY];
        for iteration in 0..max_iterations {
            if merit.sqrt() <= tolerance.max(INEXACT * alpha * distance(r, centre)) {
                return Inner::Converged;
            }
            let over = iteration > 0 && self.deadline.is_over();
            if over || !merit.is_finite() || !self.newton_step(p, r, alpha) {
                return Inner::Failed;
            }
            let limit = memory.iter().fold(0.0_f64, |a, b| a.max(*b));
            let mut length = 1.0;
            let mut accepted = false;
            let mut trial = std::mem::take(&mut self.trial);
            for _ in 0..HALVINGS {
                for i in 0..r.len() {
                    for k in 0..D {
                        trial[i][k] = r[i][k] + length * self.step[i][k];
                    }
                }
                let found = self.evaluate(p, &trial, alpha, centre);
                if found <= (1.0 - ARMIJO * length) * limit {
                    merit = found;
                    accepted = true;
                    break;
                }
                length *= 0.5;
            }
            if accepted {
                r.copy_from_slice(&trial);
            }
            self.trial = trial;
            if !accepted {
                return Inner::Failed;
            }
            memory[iteration % MEMORY] = merit;
        }
        if merit.sqrt() <= tolerance.max(INEXACT * alpha * distance(r, centre)) {
            Inner::Converged
        } else {
            Inner::Failed
        }
    }

    /// The Newton step from `r`, where F was evaluated last. False if the matrix is singular.
    fn newton_step(&mut self, p: &ScaledProblem<D>, r: &[[f64; D]], alpha: f64) -> bool {
        let m = &p.matrix;
        self.closed.clear();
        for i in 0..r.len() {
            self.index[i] = usize::MAX;
            match self.local[i].piece {
                Piece::Open => {
                    self.step[i] = r[i].map(|v| -v);
                    continue;
                }
                Piece::Stick => {
                    self.a[i] = [[0.0; D]; D];
                    self.b[i] = std::array::from_fn(|a| std::array::from_fn(|c| f64::from(a == c)));
                }
                Piece::Slip => {
                    (self.a[i], self.b[i]) = slip_derivative(p.friction[i], &r[i], &self.u[i]);
                }
            }
            for row in &mut self.b[i] {
                row.iter_mut().for_each(|v| *v *= self.rho);
            }
            self.index[i] = self.closed.len();
            self.closed.push(i);
        }
        if self.closed.is_empty() {
            return true;
        }
        // M times the steps of the open contacts.
        self.trial.fill([0.0; D]);
        for j in 0..r.len() {
            if self.index[j] == usize::MAX {
                m.add_column(j, &self.step[j], &mut self.trial);
            }
        }
        self.rhs.clear();
        for &i in &self.closed {
            let mut f = self.local[i].f;
            add_product(&self.b[i], &self.trial[i], &mut f);
            self.rhs.extend(f.iter().map(|v| -v));
        }
        self.assemble(p, alpha);
        let pattern = PatternRef::square(&self.col_ptr, &self.row_idx);
        let values = &self.values;
        self.factorisations += 1;
        let solver = self.solver.get_or_insert_with(AutoSolver::new);
        let solved = (solver.analyze(pattern))
            .and_then(|()| solver.factor(MatrixRef { pattern, values }))
            .and_then(|()| solver.solve_in_place(&mut self.rhs));
        if solved.is_err() {
            return false;
        }
        for (&i, d) in self.closed.iter().zip(self.rhs.chunks_exact(D)) {
            self.step[i].copy_from_slice(d);
        }
        true
    }

    /// A + B (M + αI) of the closed contacts.
    fn assemble(&mut self, p: &ScaledProblem<D>, alpha: f64) {
        let m = &p.matrix;
        self.col_ptr.clear();
        self.row_idx.clear();
        self.values.clear();
        self.col_ptr.push(0);
        for &j in &self.closed {
            for c in 0..D {
                for (i, block) in m.column(j) {
                    let row = self.index[i];
                    if row == usize::MAX {
                        continue;
                    }
                    for a in 0..D {
                        let mut v: f64 = (0..D).map(|e| self.b[i][a][e] * block[e][c]).sum();
                        if i == j {
                            v += self.a[i][a][c] + alpha * self.b[i][a][c];
                        }
                        self.row_idx.push(row * D + a);
                        self.values.push(v);
                    }
                }
                self.col_ptr.push(self.row_idx.len());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::delassus::DelassusProblem;
    use crate::sparse::Matrix;

    /// F is r less the projection of z = r − u on z_N ≥ 0 and on the disc of radius μ z_N, which pieces name; A and B are its derivatives.
    #[test]
    fn residuals_are_those_of_projections() {
        let mut random = crate::spread::Random::new(5);
        let at = |mu: f64, r: &[f64; 3], u: &[f64; 3]| {
            let z: [f64; 3] = std::array::from_fn(|k| r[k] - u[k]);
            let (normal, t) = (z[0].max(0.0), z[1].hypot(z[2]));
            let share = if t > mu * normal { mu * normal / t } else { 1.0 };
            let piece = match () {
                () if z[0] <= 0.0 => Piece::Open,
                () if share < 1.0 => Piece::Slip,
                () => Piece::Stick,
            };
            (piece, [r[0] - normal, r[1] - share * z[1], r[2] - share * z[2]])
        };
        let mut seen = [0; 3];
        for _ in 0..300 {
            let mu = 0.7 + 0.6 * random.symmetric();
            let [r, u]: [[f64; 3]; 2] = [(); 2].map(|()| [(); 3].map(|()| random.symmetric()));
            let (piece, f) = at(mu, &r, &u);
            let local = alart_curnier(mu, &r, &u);
            assert_eq!(local.piece, piece);
            seen[piece as usize] += 1;
            for (a, b) in local.f.iter().zip(f) {
                assert!((a - b).abs() < 1e-15, "{mu} {r:?} {u:?}");
            }
            if piece == Piece::Slip {
                let (a, b) = slip_derivative(mu, &r, &u);
                for k in 0..3 {
                    let small = 1e-6;
                    let moved =
                        |v: &[f64; 3], h: f64| std::array::from_fn(|j| v[j] + if j == k { h } else { 0.0 });
                    let of_r = [small, -small].map(|h| alart_curnier(mu, &moved(&r, h), &u).f);
                    let of_u = [small, -small].map(|h| alart_curnier(mu, &r, &moved(&u, h)).f);
                    for i in 0..3 {
                        let slope = |f: &[[f64; 3]; 2]| 0.5 * (f[0][i] - f[1][i]) / small;
                        let near = |s: f64, d: f64| (s - d).abs() < 1e-4 * (1.0 + d.abs());
                        let curved = r[0] - u[0] < 1e-2 || (r[1] - u[1]).hypot(r[2] - u[2]) < 1e-2;
                        assert!(curved || near(slope(&of_r), a[i][k]) && near(slope(&of_u), b[i][k]));
                    }
                }
            }
        }
        assert!(seen.iter().all(|n| *n > 10), "{seen:?}");
    }

    /// A proximal problem that counts as solved is solved to a tenth of α times its step, or to the tolerance; at its centre the residual
    /// is much larger, and one Newton step is not enough.
    #[test]
    fn proximal_problems_are_solved_as_well_as_their_steps_need() {
        let n = 12;
        let entry = |i: usize, j: usize| match i == j {
            true => 2.0,
            false => 0.3 * ((i * j % 7) as f64 - 3.0) / 3.0,
        };
        let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let m: Vec<_> = all.map(|(i, j)| (i, j, entry(i.min(j), i.max(j)))).collect();
        let m = Matrix::from_triplets(n, n, &m).unwrap();
        let mut most = 0;
        for shift in 0..20 {
            let q = (0..n)
                .map(|i| (1.7 * i as f64 + f64::from(shift)).sin() - if i % 3 == 0 { 0.8 } else { 0.0 });
            let problem = DelassusProblem::new(3, m.clone(), q.collect(), vec![0.3, 0.8, 0.5, 1.1]).unwrap();
            let p = ScaledProblem::<3>::new(&problem);
            let mut newton = Newton::<3>::new(Deadline::after(None));
            let centre = vec![[1.0, 0.0, 0.0]; 4];
            for alpha in [10.0, 1.0, 0.1] {
                let mut r = centre.clone();
                let before = newton.factorisations;
                let end = newton.solve(&p, &mut r, alpha, &centre, 1e-12, 50);
                if end == Inner::Converged {
                    let residual = newton.evaluate(&p, &r, alpha, &centre).sqrt();
                    let step = distance(&r, &centre);
                    assert!(
                        residual <= f64::max(1e-12, 0.1 * alpha * step),
                        "{residual:e} {step:e} at {alpha}"
                    );
                    most = most.max(newton.factorisations - before);
                }
            }
        }
        assert!(most > 1, "{most}");
    }
}
