//! The central path by arclength continuation, through its folds, at which the interior-point method, which only decreases ν, stalls.

use super::cone::tangential_norm;
use super::interior::Interior;
use super::scaled::{Block, ScaledProblem, Vector, add_product};
use super::tolerances::{
    CORRECTED, CORRECTIONS, FIRST, FIRST_HALVINGS, FIRST_RESIDUAL, FIRST_STEP, LARGEST_STEP, LEAST_STEP,
    LENGTHEN, SHORTEN,
};
use crate::clock::Deadline;
use crate::linear::{AutoSolver, LinearSolver};
use crate::sparse::{MatrixRef, PatternRef};
use crate::tolerances::ARMIJO;

/// Points (x, ν) with x ∘ y = ν e, y = M̃ x + q̃ + √(‖u_T‖² + ν²) e_N, in the variables of [`Interior`].
///
/// They are the zeros of x − P_ν(x − y), where P_ν(z) = (z + √(z² + 4ν e)) / 2 in the Jordan algebra of L (M. Fukushima, Z.-Q. Luo, P.
/// Tseng 2001) tends to the projection on L. The law is not monotone, so that ν does not parametrise this curve: for heaps of bodies it has
/// many folds before it reaches ν = 0. Arclength does.
#[derive(Debug)]
pub(super) struct CentralPath<const D: usize> {
    solver: AutoSolver,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    values: Vec<f64>,
    x: Vector<D>,
    log_nu: f64,
    /// Unit tangent, with the component of ln ν separate.
    tangent: Vector<D>,
    tangent_nu: f64,
    step: f64,
    trial: Vector<D>,
    reactions: Vector<D>,
    u: Vector<D>,
    /// P_ν′ of each contact, and the slope of De Saxcé's term there (first component unused).
    slope: Vec<Block<D>>,
    direction: Vector<D>,
    /// The residual and its derivative with respect to ln ν; then the Newton direction and dx/d ln ν.
    rhs: Vec<f64>,
}

/// (λ + √(λ² + 4ν)) / 2 without cancellation, and its derivatives with respect to λ and ν.
fn smoothed(lambda: f64, nu: f64) -> [f64; 3] {
    let root = (lambda * lambda + 4.0 * nu).sqrt();
    let value = if lambda >= 0.0 {
        0.5 * (lambda + root)
    } else {
        2.0 * nu / (root - lambda)
    };
    [value, value / root, root.recip()]
}

/// P_ν(z) and its derivatives with respect to z and ν; for μ = 0 that of a half-line.
fn smoothed_projection<const D: usize>(mu: f64, z: &[f64; D], nu: f64) -> ([f64; D], Block<D>, [f64; D]) {
    let mut slope = [[0.0; D]; D];
    let (mut value, mut rate) = ([0.0; D], [0.0; D]);
    if mu == 0.0 {
        [value[0], slope[0][0], rate[0]] = smoothed(z[0], nu);
        return (value, slope, rate);
    }
    let t = tangential_norm(z);
    let (low, high) = (smoothed(z[0] - t, nu), smoothed(z[0] + t, nu));
    let mean = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
    let half = [0, 1, 2].map(|k| 0.5 * (high[k] - low[k]));
    // The divided difference has lost its digits where both eigenvalues nearly agree.
    let across = if t > 1e-8 * z[0].abs() {
        half[0] / t
    } else {
        mean[1]
    };
    let c: [f64; D] = std::array::from_fn(|k| if t > 0.0 { z[k] / t } else { 0.0 });
    (value[0], rate[0], slope[0][0]) = (mean[0], mean[2], mean[1]);
    for a in 1..D {
        value[a] = half[0] * c[a];
        rate[a] = half[2] * c[a];
        slope[0][a] = half[1] * c[a];
        slope[a][0] = half[1] * c[a];
        for b in 1..D {
            slope[a][b] = (mean[1] - across) * c[a] * c[b] + across * f64::from(a == b);
        }
    }
    (value, slope, rate)
}

impl<const D: usize> CentralPath<D> {
    /// The pattern is that of `interior`.
    pub(super) fn new(p: &ScaledProblem<D>, interior: Interior<D>) -> Self {
        let nc = p.contacts();
        let (col_ptr, row_idx) = interior.into_pattern();
        let mut one = [0.0; D];
        one[0] = 1.0;
        Self {
            solver: AutoSolver::new(),
            values: vec![0.0; row_idx.len()],
            col_ptr,
            row_idx,
            x: vec![one; nc],
            log_nu: 0.0,
            tangent: vec![[0.0; D]; nc],
            tangent_nu: -1.0,
            step: FIRST_STEP,
            trial: vec![one; nc],
            reactions: vec![[0.0; D]; nc],
            u: vec![[0.0; D]; nc],
            slope: vec![[[0.0; D]; D]; nc],
            direction: vec![[0.0; D]; nc],
            rhs: vec![0.0; 2 * nc * D],
        }
    }

    pub(super) fn nu(&self) -> f64 {
        self.log_nu.exp()
    }

    /// The reactions of the point of the path.
    pub(super) fn reactions(&self, p: &ScaledProblem<D>, r: &mut [[f64; D]]) {
        r.copy_from_slice(&self.x);
        for (r, &mu) in r.iter_mut().zip(&p.friction) {
            r[0] /= if mu > 0.0 { mu } else { 1.0 };
        }
    }

    /// The residual at `trial` into the first half of `rhs`, its derivative with respect to ln ν into the second; returns the norm of the
    /// residual.
    fn evaluate(&mut self, p: &ScaledProblem<D>, log_nu: f64) -> f64 {
        let nu = log_nu.exp();
        let half = self.trial.len() * D;
        let mut reactions = std::mem::take(&mut self.reactions);
        std::mem::swap(&mut self.x, &mut self.trial);
        self.reactions(p, &mut reactions);
        std::mem::swap(&mut self.x, &mut self.trial);
        p.velocities(&reactions, &mut self.u);
        self.reactions = reactions;
        let mut sum = 0.0;
        for i in 0..self.trial.len() {
            let (mu, x) = (p.friction[i], self.trial[i]);
            let mut y = self.u[i];
            let mut y_rate = 0.0;
            if mu > 0.0 {
                let length = tangential_norm(&y).hypot(nu);
                self.direction[i] = y.map(|v| v / length);
                y[0] = y[0] / mu + length;
                y_rate = nu * nu / length;
            }
            let z = std::array::from_fn(|k| x[k] - y[k]);
            let (value, slope, rate) = smoothed_projection(mu, &z, nu);
            for k in 0..D {
                let f = x[k] - value[k];
                self.rhs[i * D + k] = f;
                self.rhs[half + i * D + k] = slope[k][0] * y_rate - nu * rate[k];
                sum += f * f;
            }
            self.slope[i] = slope;
        }
        sum.sqrt()
    }

    /// −J⁻¹ of both halves of `rhs`, J = I − P′ + P′ G M̃ at the point evaluated last.
    fn solve(&mut self, p: &ScaledProblem<D>) -> Option<()> {
        let m = &p.matrix;
        let mut at = 0;
        for j in 0..self.trial.len() {
            let column = if p.friction[j] > 0.0 {
                p.friction[j].recip()
            } else {
                1.0
            };
            for c in 0..D {
                let s = if c == 0 { column } else { 1.0 };
                for (i, block) in m.column(j) {
                    let mut image: [f64; D] = std::array::from_fn(|a| s * block[a][c]);
                    if p.friction[i] > 0.0 {
                        let term: f64 = (1..D).map(|a| self.direction[i][a] * image[a]).sum();
                        image[0] = image[0] / p.friction[i] + term;
                    }
                    let mut entry = [0.0; D];
                    add_product(&self.slope[i], &image, &mut entry);
                    for a in 0..D {
                        let own = i == j;
                        let identity = f64::from(own && a == c) - if own { self.slope[i][a][c] } else { 0.0 };
                        self.values[at + a] = entry[a] + identity;
                    }
                    at += D;
                }
            }
        }
        let pattern = PatternRef::square(&self.col_ptr, &self.row_idx);
        let values = &self.values;
        self.solver.analyze(pattern).ok()?;
        self.solver.factor(MatrixRef { pattern, values }).ok()?;
        self.solver.solve_in_place(&mut self.rhs).ok()?;
        self.rhs.iter_mut().for_each(|v| *v = -*v);
        self.rhs.iter().all(|v| v.is_finite()).then_some(())
    }

    /// The point with ν = 1, by damped Newton steps; counts factorisations. `None` if it was not reached.
    pub(super) fn start(
        &mut self,
        p: &ScaledProblem<D>,
        left: usize,
        deadline: Deadline<'static>,
        spent: &mut usize,
    ) -> Option<()> {
        let n = self.x.len() * D;
        let mut norm = self.evaluate(p, self.log_nu);
        for _ in 0..FIRST {
            if deadline.is_over() || *spent >= left {
                return None;
            }
            *spent += 1;
            self.solve(p)?;
            if norm <= FIRST_RESIDUAL {
                self.turn();
                return Some(());
            }
            let newton = self.rhs[..n].to_vec();
            let mut length = 1.0;
            let mut found = f64::INFINITY;
            for _ in 0..FIRST_HALVINGS {
                let moved = self.x.iter().zip(newton.chunks_exact(D));
                for (trial, (x, d)) in self.trial.iter_mut().zip(moved) {
                    *trial = std::array::from_fn(|k| x[k] + length * d[k]);
                }
                found = self.evaluate(p, self.log_nu);
                if found <= (1.0 - ARMIJO * length) * norm {
                    break;
                }
                length *= 0.5;
            }
            if found >= norm || found.is_nan() {
                return None;
            }
            self.x.copy_from_slice(&self.trial);
            norm = found;
        }
        None
    }

    /// Weight of x in arclength.
    fn weight(&self) -> f64 {
        let squares: f64 = self.x.iter().flatten().map(|v| v * v).sum();
        squares.max(1.0).recip()
    }

    /// The tangent from dx/d ln ν in the second half of `rhs`, oriented like the last one.
    fn turn(&mut self) {
        let rate = &self.rhs[self.x.len() * D..];
        let w = self.weight();
        let squares: f64 = rate.iter().map(|v| v * v).sum();
        let along: f64 = self.tangent.iter().flatten().zip(rate).map(|(t, v)| t * v).sum();
        let sense = (w * along + self.tangent_nu).signum();
        let scale = sense / (w * squares + 1.0).sqrt();
        for (t, v) in self.tangent.iter_mut().zip(rate.chunks_exact(D)) {
            *t = std::array::from_fn(|k| scale * v[k]);
        }
        self.tangent_nu = scale;
    }

    /// One step along the path, halved until its corrections converge; counts factorisations. `None` where no step converges.
    pub(super) fn advance(
        &mut self,
        p: &ScaledProblem<D>,
        left: usize,
        deadline: Deadline<'static>,
        spent: &mut usize,
    ) -> Option<()> {
        let w = self.weight();
        while self.step >= LEAST_STEP {
            let h = self.step;
            for (trial, (x, t)) in self.trial.iter_mut().zip(self.x.iter().zip(&self.tangent)) {
                *trial = std::array::from_fn(|k| x[k] + h * t[k]);
            }
            let mut log_nu = self.log_nu + h * self.tangent_nu;
            let mut last = f64::INFINITY;
            let mut corrected = None;
            for correction in 1..=CORRECTIONS {
                if deadline.is_over() || *spent >= left {
                    return None;
                }
                *spent += 1;
                let length = match self.correct(p, &mut log_nu, w) {
                    Some(length) if length <= 0.5 * last && length <= h => length,
                    _ => break,
                };
                last = length;
                if length <= CORRECTED * h {
                    corrected = Some(correction);
                    break;
                }
            }
            let Some(corrections) = corrected else {
                self.step *= 0.5;
                continue;
            };
            self.x.copy_from_slice(&self.trial);
            self.log_nu = log_nu;
            self.turn();
            if corrections <= 2 {
                self.step = (LENGTHEN * h).min(LARGEST_STEP);
            } else if corrections > 3 {
                self.step = SHORTEN * h;
            }
            return Some(());
        }
        None
    }

    /// One correction of `trial` orthogonal to the tangent; returns its length.
    fn correct(&mut self, p: &ScaledProblem<D>, log_nu: &mut f64, w: f64) -> Option<f64> {
        self.evaluate(p, *log_nu);
        self.solve(p)?;
        let (newton, rate) = self.rhs.split_at(self.x.len() * D);
        let along = |v: &[f64]| -> f64 {
            let pairs = self.tangent.iter().flatten().zip(v);
            w * pairs.map(|(t, v)| t * v).sum::<f64>()
        };
        let change = -along(newton) / (along(rate) + self.tangent_nu);
        let mut squares = 0.0;
        for (k, x) in self.trial.iter_mut().flatten().enumerate() {
            let d = newton[k] + change * rate[k];
            *x += d;
            squares += d * d;
        }
        *log_nu += change;
        let length = (w * squares + change * change).sqrt();
        length.is_finite().then_some(length)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::DelassusProblem;
    use super::*;
    use crate::cones::jordan;
    use crate::sparse::Matrix;

    proptest! {
        /// x = P_ν(z) and y = x − z have x ∘ y = ν e; the derivatives are those of this equation.
        #[test]
        fn smoothed_projections_are_points_of_the_path(
            z in prop::array::uniform3(-5.0..5.0_f64),
            log_nu in -12.0..2.0_f64,
        ) {
            let nu = log_nu.exp();
            let (x, slope, rate) = smoothed_projection(1.0, &z, nu);
            let y: [f64; 3] = std::array::from_fn(|k| x[k] - z[k]);
            let jordan = |a: &[f64; 3], b: &[f64; 3]| {
                let mut product = [0.0; 3];
                jordan(a, b, &mut product);
                product
            };
            let product = jordan(&x, &y);
            let by_nu = [jordan(&rate, &y), jordan(&x, &rate)];
            let size = 1.0 + tangential_norm(&rate) + rate[0].abs();
            for k in 0..3 {
                let unit = f64::from(k == 0);
                prop_assert!((product[k] - nu * unit).abs() <= 1e-12);
                prop_assert!((by_nu[0][k] + by_nu[1][k] - unit).abs() <= 1e-12 * size);
            }
            for c in 0..3 {
                let dx: [f64; 3] = std::array::from_fn(|a| slope[a][c]);
                let dy: [f64; 3] = std::array::from_fn(|a| slope[a][c] - f64::from(a == c));
                let (left, right) = (jordan(&dx, &y), jordan(&x, &dy));
                for k in 0..3 {
                    prop_assert!((left[k] + right[k]).abs() <= 1e-10);
                }
            }
        }
    }

    /// Contacts that slip, stick, are open, and one without friction; the path ends where Coulomb's law holds, and its points are on it.
    #[test]
    fn the_path_ends_at_a_solution() {
        let n = 12;
        let entry = |i: usize, j: usize| {
            if i == j {
                3.0
            } else {
                0.1 * ((i * j % 5) as f64 - 2.0)
            }
        };
        let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let m: Vec<_> = all.map(|(i, j)| (i, j, entry(i.min(j), i.max(j)))).collect();
        let q = vec![-5.0, -4.0, 1.0, -3.0, 0.1, 0.2, 4.0, 1.0, 1.0, -2.0, 1.0, 0.0];
        let m = Matrix::from_triplets(n, n, &m).unwrap();
        let problem = DelassusProblem::new(3, m, q, vec![0.3, 0.8, 0.5, 0.0]).unwrap();
        let p = ScaledProblem::<3>::new(&problem);
        let mut path = CentralPath::new(&p, Interior::new(&p));
        let (deadline, mut spent) = (Deadline::after(None), 0);
        path.start(&p, 1000, deadline, &mut spent).unwrap();
        while path.nu() > 1e-13 {
            path.advance(&p, 1000, deadline, &mut spent).unwrap();
            path.trial.copy_from_slice(&path.x);
            assert!(path.evaluate(&p, path.log_nu) <= 1e-4);
        }
        let (mut r, mut u) = (vec![[0.0; 3]; 4], vec![[0.0; 3]; 4]);
        path.reactions(&p, &mut r);
        let law = p.law(&r, &mut u, &mut [[0.0; 2]; 4]);
        assert!(law.residual <= 1e-6, "{law:?}");
    }
}
