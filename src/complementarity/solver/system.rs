//! Linear systems of steps: of the natural map, reduced to the free components, of Φ, and regularised.

use super::equations::Equations;
use crate::linear::{AutoSolver, LinearSolver, SmallLu};
use crate::sparse::{Matrix, Pattern};

/// Orders up to this one are eliminated by [`SmallLu`], reduced to the free components.
const SMALL: usize = 48;

/// A step d and what it is computed with. J is the equilibrated Jacobian in all of this.
#[derive(Debug, Clone)]
pub(super) struct System {
    n: usize,
    /// The step, in scaled variables.
    pub(super) d: Vec<f64>,
    /// −1, 0, +1: lower, interior, upper.
    pub(super) active: Vec<i8>,
    matrix: Matrix,
    solver: AutoSolver,
    /// Whether `solver` knows the pattern of `matrix`.
    analyzed: bool,
    small: SmallLu,
    /// Position in the reduced system of each free component, and the components of the reduced system.
    position: Vec<usize>,
    free: Vec<usize>,
    reduced: Vec<f64>,
    /// H as a full matrix, for normal equations.
    dense: Vec<f64>,
}

impl System {
    /// For Jacobians of a pattern with its diagonal.
    pub(super) fn new(pattern: Pattern) -> Self {
        let n = pattern.nrows();
        Self {
            n,
            d: vec![0.0; n],
            active: vec![0; n],
            matrix: Matrix::zeros(pattern),
            solver: AutoSolver::new(),
            analyzed: false,
            small: SmallLu::default(),
            position: vec![0; n],
            free: Vec::with_capacity(n),
            reduced: Vec::with_capacity(n),
            dense: Vec::new(),
        }
    }

    /// Solves the system built last, for the right-hand side in `d`, in place; `false` where it is singular.
    pub(super) fn solve(&mut self) -> bool {
        let n = self.n;
        if n <= SMALL {
            let m = self.small.matrix(n);
            for (i, j, v) in self.matrix.triplets() {
                m[j * n + i] = v;
            }
            if !self.small.factor() {
                return false;
            }
            self.small.solve(&mut self.d);
        } else {
            if !self.analyzed {
                if self.solver.analyze(self.matrix.pattern().as_ref()).is_err() {
                    return false;
                }
                self.analyzed = true;
            }
            if self.solver.factor(self.matrix.as_ref()).is_err()
                || self.solver.solve_in_place(&mut self.d).is_err()
            {
                return false;
            }
        }
        self.d.iter().all(|v| v.is_finite())
    }

    /// The Newton step of the natural map: d of the components at bounds is given in `d`, that of the free ones solves
    /// Σ_j J_ij d_j = −scaled_i.
    pub(super) fn solve_natural(&mut self, jac: &Matrix, scaled: &[f64]) -> bool {
        let n = self.n;
        self.reduce(jac, scaled);
        let k = self.free.len();
        if k == 0 {
            return true;
        }
        let pattern = jac.pattern();
        let (col_ptr, row_idx) = (pattern.col_ptr(), pattern.row_idx());
        let sparse = n > SMALL && !(pattern.is_full() || k <= SMALL);
        if sparse {
            self.build_natural(jac);
            for (k, &i) in self.free.iter().enumerate() {
                self.d[i] = self.reduced[k];
            }
            return self.solve();
        }
        let Self {
            small,
            free,
            active,
            position,
            ..
        } = self;
        let fill = |m: &mut [f64]| {
            for (q, &j) in free.iter().enumerate() {
                for e in col_ptr[j]..col_ptr[j + 1] {
                    let i = row_idx[e];
                    if active[i] == 0 {
                        m[q * k + position[i]] = jac.values()[e];
                    }
                }
            }
        };
        if k <= SMALL {
            fill(small.matrix(k));
            if !small.factor() {
                return false;
            }
            small.solve(&mut self.reduced);
        } else {
            let mut m = Matrix::zeros(Pattern::full(k, k));
            fill(m.values_mut());
            self.analyzed = false;
            if self.solver.analyze(m.pattern().as_ref()).is_err()
                || self.solver.factor(m.as_ref()).is_err()
                || self.solver.solve_in_place(&mut self.reduced).is_err()
            {
                return false;
            }
        }
        for (k, &i) in self.free.iter().enumerate() {
            self.d[i] = self.reduced[k];
        }
        self.d.iter().all(|v| v.is_finite())
    }

    /// Numbers the free components and makes their right-hand sides.
    fn reduce(&mut self, jac: &Matrix, scaled: &[f64]) {
        let n = self.n;
        self.free.clear();
        for i in 0..n {
            if self.active[i] == 0 {
                self.position[i] = self.free.len();
                self.free.push(i);
            }
        }
        self.reduced.clear();
        self.reduced.extend(self.free.iter().map(|&i| -scaled[i]));
        let pattern = jac.pattern();
        for j in 0..n {
            if self.active[j] == 0 || self.d[j] == 0.0 {
                continue;
            }
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                if self.active[i] == 0 {
                    self.reduced[self.position[i]] -= jac.values()[e] * self.d[j];
                }
            }
        }
    }

    /// The system of the free components, with the identity for the others.
    fn build_natural(&mut self, jac: &Matrix) {
        let pattern = jac.pattern();
        for j in 0..self.n {
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                let both = self.active[i] == 0 && self.active[j] == 0;
                self.matrix.values_mut()[e] = match both {
                    true => jac.values()[e],
                    false => f64::from(u8::from(i == j)),
                };
            }
        }
    }

    /// H = diag(∂Φ/∂x) + diag(∂Φ/∂F) J, with `shift` added to J on its diagonal.
    pub(super) fn build(&mut self, jac: &Matrix, phi: &Equations, shift: f64) {
        let pattern = jac.pattern();
        for j in 0..self.n {
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                let mut v = phi.by_f[i] * jac.values()[e];
                if i == j {
                    v += phi.by_x[i] + phi.by_f[i] * shift;
                }
                self.matrix.values_mut()[e] = v;
            }
        }
    }

    /// d = −(HᵀH + μ I)⁻¹ HᵀΦ, from the H built last and its `gradient` HᵀΦ.
    pub(super) fn solve_regularised(&mut self, mu: f64, gradient: &[f64]) -> bool {
        let n = self.n;
        self.dense.clear();
        self.dense.resize(n * n, 0.0);
        for (i, j, v) in self.matrix.triplets() {
            self.dense[j * n + i] = v;
        }
        let m = self.small.matrix(n);
        for j in 0..n {
            for i in 0..=j {
                let (a, b) = (&self.dense[i * n..(i + 1) * n], &self.dense[j * n..(j + 1) * n]);
                let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                m[j * n + i] = dot;
                m[i * n + j] = dot;
            }
            m[j * n + j] += mu;
        }
        if !self.small.factor() {
            return false;
        }
        for (d, g) in self.d.iter_mut().zip(gradient) {
            *d = -g;
        }
        self.small.solve(&mut self.d);
        self.d.iter().all(|v| v.is_finite())
    }

    /// HᵀΦ, from the H built last.
    pub(super) fn mul_transpose(&self, phi: &[f64], gradient: &mut [f64]) {
        self.matrix.mul_transpose_vec(phi, gradient);
    }
}
