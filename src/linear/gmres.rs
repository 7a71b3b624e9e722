//! GMRES with a preconditioner on the right.

use super::{KrylovReport, LinearError};
use crate::parallel::{self, GRAIN, add_scaled, product};
use crate::run::Status;
use crate::sparse::dot;

/// Workspace of restarted, right-preconditioned GMRES (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986)).
#[derive(Debug, Clone)]
pub(crate) struct Gmres {
    /// Directions between restarts.
    directions: usize,
    /// Whether the preconditioned directions are kept: the preconditioner may then change from one call to the next (Y. Saad, SIAM J. Sci.
    /// Comput. 14 (1993)), and is not called once more at the end.
    flexible: bool,
    /// Orthonormal basis, column-major; as many columns as a solve has needed so far.
    basis: Vec<f64>,
    /// The preconditioned basis, if that is kept.
    images: Vec<f64>,
    /// Upper triangular factor by columns, `directions + 1` rows each.
    hessenberg: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    rhs: Vec<f64>,
    z: Vec<f64>,
    x: Vec<f64>,
}

impl Gmres {
    /// With a preconditioner that may change, or whose calls are expensive relative to the memory of a second set of directions.
    pub(crate) fn flexible(directions: usize) -> Self {
        Self {
            flexible: true,
            ..Self::new(directions)
        }
    }

    pub(crate) fn new(directions: usize) -> Self {
        Self {
            directions,
            flexible: false,
            images: Vec::new(),
            basis: Vec::new(),
            hessenberg: Vec::new(),
            rotations: Vec::new(),
            rhs: Vec::new(),
            z: Vec::new(),
            x: Vec::new(),
        }
    }

    /// Overwrites `b` by an approximation to A⁻¹ b, until the residual has fallen by the factor `aim` or `limit` iterations are done.
    /// `multiply(x, y)` adds A x to y, `near` overwrites its argument by the solution of a system near A. Without convergence the caller
    /// judges the residual reported. After an error `b` holds the last approximation, unless it was not finite at the start.
    pub(crate) fn solve(
        &mut self,
        mut multiply: impl FnMut(&[f64], &mut [f64]),
        mut near: impl FnMut(&mut [f64]) -> Result<(), LinearError>,
        b: &mut [f64],
        aim: f64,
        limit: usize,
    ) -> Result<KrylovReport, LinearError> {
        let n = b.len();
        let rows = self.directions + 1;
        at_least(n, &mut self.basis);
        self.hessenberg.resize(rows * self.directions, 0.0);
        self.z.resize(n, 0.0);
        self.x.clear();
        self.x.resize(n, 0.0);
        let size = product(b, b).sqrt();
        let residual = if size == 0.0 { 0.0 } else { 1.0 };
        let mut outcome = KrylovReport::new(Status::IterationLimit, 0, residual);
        // `b` is the residual from here on.
        while outcome.residual > aim && outcome.iterations < limit {
            let before = outcome.residual;
            self.rotations.clear();
            self.rhs.clear();
            self.rhs.resize(rows, 0.0);
            let norm = product(b, b).sqrt();
            if !norm.is_finite() {
                return Err(LinearError::Inaccurate { residual: norm });
            }
            self.rhs[0] = norm;
            for (v, b) in self.basis.iter_mut().zip(b.iter()) {
                *v = b / norm;
            }
            let (mut k, mut expanded) = (0, Ok(true));
            while k < self.directions && outcome.iterations < limit && self.rhs[k].abs() > aim * size {
                expanded = self.expand(k, n, &mut multiply, &mut near);
                if !matches!(expanded, Ok(true)) {
                    break;
                }
                k += 1;
                outcome.iterations += 1;
            }
            self.combine(k, n);
            let back = if self.flexible || k == 0 {
                Ok(())
            } else {
                near(&mut self.z)
            };
            if back.is_ok() {
                add_scaled(1.0, &self.z, &mut self.x);
            }
            let goes_on = match expanded.and_then(|goes_on| back.map(|()| goes_on)) {
                Ok(goes_on) => goes_on,
                Err(e) => {
                    b.copy_from_slice(&self.x);
                    return Err(e);
                }
            };
            outcome.residual = self.rhs[k].abs() / size;
            if !goes_on {
                // A direction that the matrix maps to those before.
                outcome.status = Status::Singular;
                break;
            }
            if outcome.residual > aim {
                // Basis vectors are scratch between cycles.
                let image = &mut self.basis[..n];
                image.fill(0.0);
                multiply(&self.z, image);
                add_scaled(-1.0, image, b);
                if outcome.residual > 0.999 * before {
                    outcome.status = Status::Stalled;
                    break;
                }
            }
        }
        b.copy_from_slice(&self.x);
        if outcome.residual <= aim {
            outcome.status = Status::Solved;
        }
        Ok(outcome)
    }

    /// Adds a direction and its rotation; `false` where the direction adds nothing.
    fn expand(
        &mut self,
        k: usize,
        n: usize,
        multiply: &mut impl FnMut(&[f64], &mut [f64]),
        near: &mut impl FnMut(&mut [f64]) -> Result<(), LinearError>,
    ) -> Result<bool, LinearError> {
        let rows = self.directions + 1;
        at_least(n * (k + 2), &mut self.basis);
        let (old, new) = self.basis.split_at_mut(n * (k + 1));
        let w = &mut new[..n];
        let z = if self.flexible {
            at_least(n * (k + 1), &mut self.images);
            &mut self.images[n * k..n * (k + 1)]
        } else {
            &mut self.z[..]
        };
        z.copy_from_slice(&old[n * k..]);
        near(z)?;
        w.fill(0.0);
        multiply(z, w);
        let h = &mut self.hessenberg[rows * k..rows * (k + 1)];
        // Each subtraction is combined with the scalar product for the next direction.
        let mut last: Option<(f64, &[f64])> = None;
        for (i, v) in old.chunks_exact(n).enumerate() {
            let c = parallel::sum_parts(w, GRAIN, &|first, w| {
                take_off(last, first, w);
                dot(&v[first..first + w.len()], w)
            });
            h[i] = c;
            last = Some((c, v));
        }
        let norm = parallel::sum_parts(w, GRAIN, &|first, w| {
            take_off(last, first, w);
            dot(w, w)
        });
        let norm = norm.sqrt();
        let whole = h[..=k].iter().fold(norm, |size, h| size.hypot(*h));
        if norm > 0.0 {
            parallel::parts(w, GRAIN, &|_, w| w.iter_mut().for_each(|w| *w /= norm));
        }
        for (i, &(c, s)) in self.rotations.iter().enumerate() {
            (h[i], h[i + 1]) = (c * h[i] + s * h[i + 1], c * h[i + 1] - s * h[i]);
        }
        let length = h[k].hypot(norm);
        if !length.is_finite() {
            return Err(LinearError::Inaccurate { residual: f64::NAN });
        }
        if length <= 4.0 * f64::EPSILON * whole {
            return Ok(false);
        }
        let (c, s) = (h[k] / length, norm / length);
        self.rotations.push((c, s));
        h[k] = length;
        (self.rhs[k], self.rhs[k + 1]) = (c * self.rhs[k], -s * self.rhs[k]);
        Ok(true)
    }

    /// The best combination of k directions, into `z`, of preconditioned ones where these were kept.
    fn combine(&mut self, k: usize, n: usize) {
        let rows = self.directions + 1;
        for i in (0..k).rev() {
            let tail: f64 = (i + 1..k)
                .map(|j| self.hessenberg[rows * j + i] * self.rhs[j])
                .sum();
            self.rhs[i] = (self.rhs[i] - tail) / self.hessenberg[rows * i + i];
        }
        self.z.fill(0.0);
        let directions = match self.flexible {
            true => &self.images,
            false => &self.basis,
        };
        for (v, c) in directions.chunks_exact(n.max(1)).zip(&self.rhs[..k]) {
            add_scaled(*c, v, &mut self.z);
        }
    }
}

/// Most solves need few columns, so memory grows with the longest one.
fn at_least(len: usize, columns: &mut Vec<f64>) {
    if columns.len() < len {
        columns.reserve_exact(len - columns.len());
        columns.resize(len, 0.0);
    }
}

/// w ← w − c v from an entry on.
fn take_off(direction: Option<(f64, &[f64])>, first: usize, w: &mut [f64]) {
    if let Some((c, v)) = direction {
        w.iter_mut().zip(&v[first..]).for_each(|(w, v)| *w -= c * v);
    }
}

#[cfg(test)]
mod tests {
    use super::Gmres;

    /// Bidiagonal and far from symmetric: restarts are needed.
    fn multiply(x: &[f64], y: &mut [f64]) {
        for i in 0..x.len() {
            y[i] += (2.0 + (i % 5) as f64) * x[i] - if i > 0 { 1.5 * x[i - 1] } else { 0.0 };
        }
    }

    #[test]
    fn restarts_reach_the_solution() {
        let x: Vec<f64> = (0..60).map(|i| (i as f64).sin()).collect();
        let mut b = vec![0.0; 60];
        multiply(&x, &mut b);
        let outcome = Gmres::new(8)
            .solve(multiply, |_| Ok(()), &mut b, 1e-12, 500)
            .unwrap();
        assert!(outcome.residual <= 1e-12 && outcome.iterations > 8);
        for (b, x) in b.iter().zip(&x) {
            assert!((b - x).abs() < 1e-10);
        }
    }

    /// One call a direction; without kept preconditioned directions one more each time that directions are combined.
    #[test]
    fn kept_images_spare_the_last_calls() {
        let x: Vec<f64> = (0..60).map(|i| (i as f64).sin()).collect();
        let mut image = vec![0.0; 60];
        multiply(&x, &mut image);
        let solve = |mut gmres: Gmres| {
            let (mut b, mut calls) = (image.clone(), 0);
            let near = |z: &mut [f64]| {
                calls += 1;
                (0..60).for_each(|i| z[i] /= 2.0 + (i % 5) as f64);
                Ok(())
            };
            let outcome = gmres.solve(multiply, near, &mut b, 1e-12, 500).unwrap();
            (b, outcome.iterations, calls)
        };
        let (x_plain, n_plain, plain) = solve(Gmres::new(8));
        let (x_kept, n_kept, kept) = solve(Gmres::flexible(8));
        assert!(n_plain > 8 && n_plain == n_kept);
        assert_eq!((plain, kept), (n_plain + n_plain.div_ceil(8), n_kept));
        for (a, b) in x_plain.iter().zip(&x_kept) {
            assert!((a - b).abs() < 1e-11);
        }
    }

    #[test]
    fn gives_up_where_nothing_moves() {
        // A cyclic shift: no progress before the last of n directions.
        let shift = |x: &[f64], y: &mut [f64]| {
            for i in 0..x.len() {
                y[(i + 1) % x.len()] += x[i];
            }
        };
        let mut b = vec![0.0; 20];
        b[0] = 1.0;
        let outcome = Gmres::new(5)
            .solve(shift, |_| Ok(()), &mut b, 1e-10, 1000)
            .unwrap();
        assert!(outcome.residual > 0.5 && outcome.iterations <= 10);
    }
}
