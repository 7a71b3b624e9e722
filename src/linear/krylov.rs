//! Krylov methods behind one interface.

use std::cell::RefCell;
use std::fmt;

use super::gmres::Gmres;
use super::{LinearError, LinearOperator};
use crate::input::check_length;
use crate::run::Status;
use crate::sparse::{distance, dot, norm};

/// Which Krylov method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum KrylovMethod {
    /// Conjugate gradients (Hestenes, Stiefel 1952): A and the preconditioner symmetric positive definite. Seven vectors.
    Cg,
    /// Minimal residuals (Paige, Saunders 1975): A symmetric, the preconditioner symmetric positive definite. Eleven vectors.
    Minres,
    /// Generalized minimal residuals (Saad, Schultz 1986), preconditioned from the right: any regular A.
    Gmres {
        /// Directions between restarts, at least 1; as many vectors are kept, and five more.
        directions: usize,
    },
    /// Flexible GMRES (Saad 1993): the preconditioner may change from one call to the next, as another iteration does. Twice the vectors.
    FlexibleGmres {
        /// Directions between restarts, at least 1.
        directions: usize,
    },
}

/// Report on a solve by a Krylov method.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KrylovReport {
    /// Number of products with A that made a new direction.
    pub iterations: usize,
    /// ‖b − A x‖₂ / ‖b‖₂, measured at the x returned; 0 for b = 0.
    pub residual: f64,
    /// How it ended: [`Singular`](Status::Singular) also where A (for CG) or the preconditioner (for CG and MINRES) is not positive
    /// definite, [`Stalled`](Status::Stalled) where a cycle of GMRES between restarts made no progress.
    pub status: Status,
}

impl KrylovReport {
    /// For methods of your own.
    #[must_use]
    pub const fn new(status: Status, iterations: usize, residual: f64) -> Self {
        Self {
            iterations,
            residual,
            status,
        }
    }

    /// Whether the residual fell by the requested factor.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status.is_solved()
    }
}

impl fmt::Display for KrylovReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        crate::words::ended(f, &self.status, self.iterations, self.residual)
    }
}

/// A Krylov method with its workspace, for systems A x = b known by [products](LinearOperator).
///
/// Reused for systems of the same order it allocates nothing.
///
/// ```
/// use semismooth::linear::{Krylov, Multigrid, Preconditioned, Preconditioner};
/// use semismooth::sparse::Matrix;
/// // −Δu = 1 on 30 × 30 points.
/// let m = 30;
/// let mut entries = vec![];
/// for k in 0..m * m {
///     entries.push((k, k, 4.0));
///     if k % m > 0 { entries.extend([(k, k - 1, -1.0), (k - 1, k, -1.0)]); }
///     if k >= m { entries.extend([(k, k - m, -1.0), (k - m, k, -1.0)]); }
/// }
/// let mut a = Matrix::from_triplets(m * m, m * m, &entries)?;
/// let mut multigrid = Multigrid::algebraic();
/// multigrid.prepare(a.as_ref())?;
/// let mut cg = Krylov::cg();
/// let mut x = vec![1.0; m * m];
/// let with = cg.solve(&mut Preconditioned::new(&a, &mut multigrid), &mut x, 1e-10)?;
/// let without = cg.solve(&mut a, &mut vec![1.0; m * m], 1e-10)?;
/// assert!(with.is_solved() && without.is_solved());
/// assert!(2 * with.iterations < without.iterations);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Krylov {
    method: KrylovMethod,
    max_iterations: usize,
    gmres: Gmres,
    vectors: [Vec<f64>; 9],
    /// b and x, of unit b.
    rhs: Vec<f64>,
    x: Vec<f64>,
}

impl Krylov {
    /// A method without a workspace, with at most 1000 iterations.
    #[must_use]
    pub fn new(method: KrylovMethod) -> Self {
        let gmres = match method {
            KrylovMethod::Gmres { directions } => Gmres::new(directions.max(1)),
            KrylovMethod::FlexibleGmres { directions } => Gmres::flexible(directions.max(1)),
            _ => Gmres::new(1),
        };
        Self {
            method,
            max_iterations: 1000,
            gmres,
            vectors: Default::default(),
            rhs: Vec::new(),
            x: Vec::new(),
        }
    }

    /// Conjugate gradients.
    #[must_use]
    pub fn cg() -> Self {
        Self::new(KrylovMethod::Cg)
    }

    /// Minimal residuals.
    #[must_use]
    pub fn minres() -> Self {
        Self::new(KrylovMethod::Minres)
    }

    /// GMRES with so many directions between restarts (1 for 0).
    #[must_use]
    pub fn gmres(directions: usize) -> Self {
        Self::new(KrylovMethod::Gmres { directions })
    }

    /// Flexible GMRES with so many directions between restarts (1 for 0).
    #[must_use]
    pub fn flexible_gmres(directions: usize) -> Self {
        Self::new(KrylovMethod::FlexibleGmres { directions })
    }

    /// Sets the number of iterations after which a solve ends.
    #[must_use]
    pub fn with_max_iterations(mut self, max_iterations: usize) -> Self {
        self.max_iterations = max_iterations;
        self
    }

    /// The method.
    #[must_use]
    pub fn method(&self) -> KrylovMethod {
        self.method
    }

    /// Overwrites `b` by an approximation x to A⁻¹ b, from x = 0 until ‖b − A x‖₂ ≤ `tolerance` ‖b‖₂.
    ///
    /// The report tells whether the method converged; if not, `b` holds the best x all the same.
    ///
    /// # Errors
    /// [`InputError::Length`](crate::InputError::Length) for a `b` of another length; [`LinearError::NotFinite`] where `b`, a product or a result of the
    /// preconditioner is NaN or infinite, or the solution overflows; errors of the preconditioner. `b` then holds the last finite x, or 0,
    /// unless it contained such numbers.
    pub fn solve(
        &mut self,
        a: &mut dyn LinearOperator,
        b: &mut [f64],
        tolerance: f64,
    ) -> Result<KrylovReport, LinearError> {
        let n = a.order();
        check_length("the right-hand side", b.len(), n)?;
        let size = norm(b);
        if !size.is_finite() {
            return Err(NOT_FINITE_RHS);
        }
        if size == 0.0 {
            return Ok(KrylovReport {
                iterations: 0,
                residual: 0.0,
                status: Status::Solved,
            });
        }
        // Squares of numbers far from 1 would overflow or underflow.
        b.iter_mut().for_each(|b| *b /= size);
        let result = self.rounds(a, b, tolerance);
        for x in b.iter_mut() {
            *x *= size;
        }
        if b.iter().all(|x| x.is_finite()) {
            return result;
        }
        b.fill(0.0);
        result.and(Err(NOT_FINITE_SOLUTION))
    }

    /// Solves for `b` of length 1; where the residual of the recurrence has departed from the true one, once more for the remaining
    /// residual.
    fn rounds(
        &mut self,
        a: &mut dyn LinearOperator,
        b: &mut [f64],
        tolerance: f64,
    ) -> Result<KrylovReport, LinearError> {
        let n = b.len();
        for v in [&mut self.rhs, &mut self.x] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.rhs.copy_from_slice(b);
        let size = norm(b);
        let (mut iterations, mut left) = (0, 1.0);
        loop {
            // `b` is the residual, divided by its norm `left`.
            let limit = self.max_iterations - iterations;
            let result = match self.method {
                KrylovMethod::Cg => self.conjugate_gradients(a, b, tolerance / left, limit),
                KrylovMethod::Minres => self.minimal_residuals(a, b, tolerance / left, limit),
                _ => self.generalized(a, b, tolerance / left, limit),
            };
            let end = match result {
                Ok(report) => {
                    iterations += report.iterations;
                    report.status
                }
                Err(e) => {
                    b.iter_mut().zip(&self.x).for_each(|(b, x)| *b = x + left * *b);
                    return Err(e);
                }
            };
            let image = &mut self.vectors[0];
            image.resize(n, 0.0);
            for (b, x) in b.iter_mut().zip(&self.x) {
                *b = x + left * *b;
            }
            a.product(b, image);
            let found = distance(&self.rhs, image) / size;
            if !found.is_finite() {
                b.copy_from_slice(&self.x);
                return Err(NOT_FINITE_PRODUCT);
            }
            // Rounding may give an x that is worse than 0.
            if found > left {
                b.copy_from_slice(&self.x);
                return Ok(KrylovReport {
                    iterations,
                    residual: left,
                    status: match end {
                        Status::Solved => Status::Stalled,
                        end => end,
                    },
                });
            }
            let stagnates = found > 0.5 * left;
            if found <= tolerance || end != Status::Solved || stagnates || iterations == self.max_iterations {
                return Ok(KrylovReport {
                    iterations,
                    residual: found,
                    status: match end {
                        _ if found <= tolerance => Status::Solved,
                        Status::Solved if stagnates => Status::Stalled,
                        Status::Solved => Status::IterationLimit,
                        end => end,
                    },
                });
            }
            left = found;
            self.x.copy_from_slice(b);
            for ((b, rhs), image) in b.iter_mut().zip(&self.rhs).zip(&*image) {
                *b = (rhs - image) / left;
            }
        }
    }

    fn generalized(
        &mut self,
        a: &mut dyn LinearOperator,
        b: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Result<KrylovReport, LinearError> {
        let a = RefCell::new(a);
        let outcome = self.gmres.solve(
            |x, y| a.borrow_mut().product(x, y),
            |b| a.borrow_mut().precondition(b),
            b,
            tolerance,
            limit,
        );
        outcome.map_err(|e| match e {
            LinearError::Inaccurate { residual } if !residual.is_finite() => NOT_FINITE_PRODUCT,
            e => e,
        })
    }

    /// `b` is of length 1.
    fn conjugate_gradients(
        &mut self,
        a: &mut dyn LinearOperator,
        b: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Result<KrylovReport, LinearError> {
        let [r, z, p, q, ..] = &mut self.vectors;
        [&mut *r, z, p, q]
            .into_iter()
            .for_each(|v| v.resize(b.len(), 0.0));
        r.copy_from_slice(b);
        let x = b;
        x.fill(0.0);
        let mut report = Progress::new(tolerance, limit);
        let mut rho = 0.0;
        while report.goes_on() {
            z.copy_from_slice(r);
            a.precondition(z)?;
            let next = finite(dot(r, z))?;
            if next <= 0.0 {
                return Ok(report.ended(Status::Singular));
            }
            let beta = if report.iterations == 0 { 0.0 } else { next / rho };
            rho = next;
            for (p, z) in p.iter_mut().zip(&*z) {
                *p = if beta == 0.0 { *z } else { z + beta * *p };
            }
            a.product(p, q);
            let curvature = finite(dot(p, q))?;
            if curvature <= 0.0 {
                return Ok(report.ended(Status::Singular));
            }
            let alpha = rho / curvature;
            add(x, alpha, p);
            add(r, -alpha, q);
            report.step(norm(r));
        }
        Ok(report.limit())
    }

    /// Elman, Silvester, Wathen (2014), algorithm 4.1; the residual itself is carried along beside its norm in P⁻¹.
    fn minimal_residuals(
        &mut self,
        a: &mut dyn LinearOperator,
        b: &mut [f64],
        tolerance: f64,
        limit: usize,
    ) -> Result<KrylovReport, LinearError> {
        let [r, z, next_z, v, before, w, w_before, q, ..] = &mut self.vectors;
        for y in [&mut *r, z, next_z, v, before, w, w_before, q] {
            y.clear();
            y.resize(b.len(), 0.0);
        }
        r.copy_from_slice(b);
        v.copy_from_slice(b);
        z.copy_from_slice(b);
        let x = b;
        x.fill(0.0);
        let mut report = Progress::new(tolerance, limit);
        a.precondition(z)?;
        let square = finite(dot(z, v))?;
        if square <= 0.0 {
            return Ok(report.ended(Status::Singular));
        }
        let (mut gamma, mut gamma_before) = (square.sqrt(), 1.0);
        let mut eta = gamma;
        let (mut s, mut s_before, mut c, mut c_before) = (0.0, 0.0, 1.0, 1.0);
        let mut largest = 0.0_f64;
        while report.goes_on() {
            z.iter_mut().for_each(|z| *z /= gamma);
            a.product(z, q);
            let delta = finite(dot(q, z))?;
            for ((q, v), before) in q.iter_mut().zip(&*v).zip(&*before) {
                *q -= delta / gamma * v + gamma / gamma_before * before;
            }
            next_z.copy_from_slice(q);
            a.precondition(next_z)?;
            let square = finite(dot(next_z, q))?;
            // Rounding apart, 0 means that the residual vanishes.
            let done = square <= (f64::EPSILON * gamma).powi(2);
            if square < 0.0 && -square > 1e-12 * norm(next_z) * norm(q) {
                return Ok(report.ended(Status::Singular));
            }
            let next = if done { 0.0 } else { square.sqrt() };
            let diagonal = c * delta - c_before * s * gamma;
            let length = diagonal.hypot(next);
            largest = largest.max(delta.abs()).max(next);
            if length <= 4.0 * f64::EPSILON * largest {
                return Ok(report.ended(Status::Singular));
            }
            let (above, far) = (s * delta + c_before * c * gamma, s_before * gamma);
            (c_before, c) = (c, diagonal / length);
            (s_before, s) = (s, next / length);
            for ((old, w), z) in w_before.iter_mut().zip(&*w).zip(&*z) {
                *old = (z - far * *old - above * w) / length;
            }
            std::mem::swap(w_before, w);
            add(x, c * eta, w);
            eta *= -s;
            let share = if done { 0.0 } else { eta * c / next };
            for (r, q) in r.iter_mut().zip(&*q) {
                *r = s * s * *r + share * q;
            }
            std::mem::swap(before, v);
            std::mem::swap(v, q);
            std::mem::swap(z, next_z);
            (gamma_before, gamma) = (gamma, next);
            report.step(norm(r));
            if done && report.goes_on() {
                return Ok(report.ended(Status::Singular));
            }
        }
        Ok(report.limit())
    }
}

const NOT_FINITE_RHS: LinearError = LinearError::NotFinite {
    what: "the right-hand side",
};

const NOT_FINITE_SOLUTION: LinearError = LinearError::NotFinite { what: "the solution" };

const NOT_FINITE_PRODUCT: LinearError = LinearError::NotFinite {
    what: "a product with the operator or its preconditioner",
};

fn finite(value: f64) -> Result<f64, LinearError> {
    match value.is_finite() {
        true => Ok(value),
        false => Err(NOT_FINITE_PRODUCT),
    }
}

fn add(x: &mut [f64], scale: f64, d: &[f64]) {
    x.iter_mut().zip(d).for_each(|(x, d)| *x += scale * d);
}

/// Counts iterations of a method for a right-hand side of length 1.
struct Progress {
    tolerance: f64,
    limit: usize,
    iterations: usize,
    residual: f64,
}

impl Progress {
    fn new(tolerance: f64, limit: usize) -> Self {
        Self {
            tolerance,
            limit,
            iterations: 0,
            residual: 1.0,
        }
    }

    fn goes_on(&self) -> bool {
        self.residual > self.tolerance && self.iterations < self.limit
    }

    fn step(&mut self, residual: f64) {
        self.iterations += 1;
        self.residual = residual;
    }

    fn ended(&self, status: Status) -> KrylovReport {
        KrylovReport {
            iterations: self.iterations,
            residual: self.residual,
            status,
        }
    }

    fn limit(&self) -> KrylovReport {
        self.ended(match self.residual <= self.tolerance {
            true => Status::Solved,
            false => Status::IterationLimit,
        })
    }
}
