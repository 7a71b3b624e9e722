use super::linearisation::Linearisation;
use crate::complementarity::ComplementarityError;
use crate::complementarity::accuracy::Accuracy;
use crate::complementarity::affine::with_diagonal;
use crate::linear::{AutoSolver, LinearSolver, SmallLu};
use crate::sparse::{Matrix, Pattern};

/// Orders up to this one are eliminated by [`SmallLu`], reduced to the free components.
pub(super) const SMALL: usize = 48;

/// Orders up to this one have least-squares steps from normal equations.
pub(super) const NORMAL_EQUATIONS: usize = 200;

/// Everything a solve needs, made once for problems of one shape.
#[derive(Debug, Clone)]
pub(super) struct Work {
    pub(super) n: usize,
    pub(super) lin: Linearisation,
    pub(super) accuracy: Accuracy,
    /// Matrix of the system at hand.
    pub(super) system: Matrix,
    solver: AutoSolver,
    /// Whether `solver` knows the pattern of `system`.
    analyzed: bool,
    small: SmallLu,
    /// Position in the reduced system of each free component, and the components of the reduced system.
    position: Vec<usize>,
    free: Vec<usize>,
    reduced: Vec<f64>,
    pub(super) x: Vec<f64>,
    pub(super) f: Vec<f64>,
    pub(super) trial_x: Vec<f64>,
    pub(super) trial_f: Vec<f64>,
    /// Scaled values of F, proximal term included.
    pub(super) scaled: Vec<f64>,
    pub(super) phi: Vec<f64>,
    /// ∂Φ/∂x and ∂Φ/∂F.
    pub(super) da: Vec<f64>,
    pub(super) db: Vec<f64>,
    pub(super) d: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    pub(super) rate: Vec<f64>,
    pub(super) scratch: Vec<f64>,
    pub(super) centre: Vec<f64>,
    /// Start of a solve, as given and projected.
    pub(super) start: Vec<f64>,
    /// Point with the smallest natural residual.
    pub(super) best: Vec<f64>,
    /// Point with the smallest error relative to the terms of rows.
    pub(super) nearest: Vec<f64>,
    /// Point with the smallest merit in an attempt.
    pub(super) kept: Vec<f64>,
    /// −1, 0, +1: lower, interior, upper.
    pub(super) active: Vec<i8>,
    /// The same of the natural map at the iterate recorded last.
    pub(super) pieces: Vec<i8>,
    pub(super) visited: Vec<u64>,
    pub(super) merits: Vec<f64>,
    /// H as a full matrix, for normal equations.
    dense: Vec<f64>,
}

impl Work {
    pub(super) fn new(pattern: &Pattern) -> Result<Self, ComplementarityError> {
        let n = pattern.nrows();
        let pattern = with_diagonal(pattern)?;
        let zeros = || vec![0.0; n];
        Ok(Self {
            n,
            lin: Linearisation::new(pattern.clone()),
            accuracy: Accuracy::default(),
            system: Matrix::zeros(pattern),
            solver: AutoSolver::new(),
            analyzed: false,
            small: SmallLu::default(),
            position: vec![0; n],
            free: Vec::with_capacity(n),
            reduced: Vec::with_capacity(n),
            x: zeros(),
            f: zeros(),
            trial_x: zeros(),
            trial_f: zeros(),
            scaled: zeros(),
            phi: zeros(),
            da: zeros(),
            db: zeros(),
            d: zeros(),
            gradient: zeros(),
            rate: zeros(),
            scratch: zeros(),
            centre: zeros(),
            start: zeros(),
            best: zeros(),
            nearest: zeros(),
            kept: zeros(),
            active: vec![0; n],
            pieces: vec![0; n],
            visited: Vec::new(),
            merits: Vec::new(),
            dense: Vec::new(),
        })
    }

    pub(super) fn fits(&self, pattern: &Pattern) -> bool {
        self.lin.jac().pattern() == pattern
    }

    /// Solves `system` d = d in place; `false` where it is singular.
    pub(super) fn solve_system(&mut self) -> bool {
        let n = self.n;
        if n <= SMALL {
            let m = self.small.matrix(n);
            for (i, j, v) in self.system.triplets() {
                m[j * n + i] = v;
            }
            if !self.small.factor() {
                return false;
            }
            self.small.solve(&mut self.d);
        } else {
            if !self.analyzed {
                if self.solver.analyze(self.system.pattern().as_ref()).is_err() {
                    return false;
                }
                self.analyzed = true;
            }
            if self.solver.factor(self.system.as_ref()).is_err()
                || self.solver.solve_in_place(&mut self.d).is_err()
            {
                return false;
            }
        }
        self.d.iter().all(|v| v.is_finite())
    }

    /// The Newton step of the natural map: d of the components at bounds is given in `d`, that of the free ones solves
    /// Σ_j J_ij d_j = −scaled_i.
    pub(super) fn solve_reduced(&mut self) -> bool {
        let n = self.n;
        self.reduce();
        let k = self.free.len();
        if k == 0 {
            return true;
        }
        let pattern = self.lin.scaled().pattern().clone();
        let (col_ptr, row_idx) = (pattern.col_ptr(), pattern.row_idx());
        let sparse = n > SMALL && !(pattern.is_full() || k <= SMALL);
        if sparse {
            self.build_natural();
            for (k, &i) in self.free.iter().enumerate() {
                self.d[i] = self.reduced[k];
            }
            return self.solve_system();
        }
        let Self {
            small,
            lin,
            free,
            active,
            position,
            ..
        } = self;
        let jac = lin.scaled();
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
    fn reduce(&mut self) {
        let n = self.n;
        self.free.clear();
        for i in 0..n {
            if self.active[i] == 0 {
                self.position[i] = self.free.len();
                self.free.push(i);
            }
        }
        self.reduced.clear();
        self.reduced.extend(self.free.iter().map(|&i| -self.scaled[i]));
        let jac = self.lin.scaled();
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

    /// The system of the free components, with the identity for the others, into `system`.
    pub(super) fn build_natural(&mut self) {
        let pattern = self.lin.scaled().pattern().clone();
        for j in 0..self.n {
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                let both = self.active[i] == 0 && self.active[j] == 0;
                self.system.values_mut()[e] = match both {
                    true => self.lin.scaled().values()[e],
                    false => f64::from(u8::from(i == j)),
                };
            }
        }
    }

    /// H = diag(∂Φ/∂x) + diag(∂Φ/∂F) J, into `system`, with `shift` added to J on its diagonal.
    pub(super) fn build_fischer(&mut self, shift: f64) {
        let pattern = self.lin.scaled().pattern().clone();
        for j in 0..self.n {
            for e in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[e];
                let mut v = self.db[i] * self.lin.scaled().values()[e];
                if i == j {
                    v += self.da[i] + self.db[i] * shift;
                }
                self.system.values_mut()[e] = v;
            }
        }
    }

    /// d = −(HᵀH + μ I)⁻¹ HᵀΦ, from H in `system` and HᵀΦ in `gradient`.
    pub(super) fn solve_regularised(&mut self, mu: f64) -> bool {
        let n = self.n;
        self.dense.clear();
        self.dense.resize(n * n, 0.0);
        for (i, j, v) in self.system.triplets() {
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
        for (d, g) in self.d.iter_mut().zip(&self.gradient) {
            *d = -g;
        }
        self.small.solve(&mut self.d);
        self.d.iter().all(|v| v.is_finite())
    }
}
