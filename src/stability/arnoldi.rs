use super::{Dynamics, StabilityError};
use crate::input::check_options;
use crate::linear::{AutoSolver, LinearError, LinearSolver, eigenvalues};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::{Matrix, dot, norm};
use crate::spread::Random;

/// An approximation of an eigenvalue.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Ritz {
    /// Its real and imaginary part.
    pub value: (f64, f64),
    /// How far it moved when the last quarter of the Krylov space was added, relative to its distance from the shift.
    pub change: f64,
}

impl<P: PiecewiseSmooth + ?Sized> Dynamics<'_, P> {
    /// Approximations of the eigenvalues next to a real shift σ at x = (y, α), nearest first, at most `count`: by Arnoldi's method with (A − σ
    /// M)⁻¹ M, one sparse factorisation and a solve for each vector of the Krylov space. That there are no others near σ is not certified, and
    /// eigenvalues far from σ, also those with positive real parts, are not seen.
    ///
    /// # Errors
    /// As [`spectrum`](Self::spectrum), but for the limit on equations; a shift that is not finite, or an eigenvalue.
    pub fn nearest(&self, x: &[f64], shift: f64, count: usize) -> Result<Vec<Ritz>, StabilityError> {
        check_options(&[("shift", shift, shift.is_finite(), "finite")])?;
        let derivative = self.derivative(&self.selection(x)?, x)?;
        let n = derivative.nrows();
        let mass = |i: usize| self.mass.as_ref().map_or(1.0, |m| m[i]);
        let shifts = (0..n).map(|i| (i, i, -shift * mass(i)));
        let entries: Vec<_> = derivative.triplets().chain(shifts).collect();
        let shifted = Matrix::from_triplets(n, n, &entries).map_err(LinearError::from)?;
        let mut solver = AutoSolver::new();
        solver.analyze(shifted.pattern().as_ref())?;
        solver.factor(shifted.as_ref())?;
        let dimension = n.min(4 * count + 30);
        let mut random = Random::new(1);
        let mut v: Vec<f64> = (0..n).map(|_| random.symmetric()).collect();
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let mut h: Vec<(usize, usize, f64)> = Vec::new();
        for k in 0..dimension {
            let length = norm(&v);
            if k > 0 {
                h.push((k, k - 1, length));
            }
            // The space is invariant.
            if length <= f64::EPSILON * h.iter().fold(0.0_f64, |m, e| m.max(e.2.abs())) {
                h.pop();
                break;
            }
            v.iter_mut().for_each(|v| *v /= length);
            basis.push(v.clone());
            v.iter_mut().enumerate().for_each(|(i, v)| *v *= mass(i));
            solver.solve_in_place(&mut v)?;
            // Twice is enough for orthogonality to rounding.
            for _ in 0..2 {
                for (j, b) in basis.iter().enumerate() {
                    let part = dot(b, &v);
                    v.iter_mut().zip(b).for_each(|(v, b)| *v -= part * b);
                    h.push((j, k, part));
                }
            }
        }
        let values = |size: usize| -> Result<Vec<(f64, f64)>, StabilityError> {
            let own: Vec<_> = h.iter().copied().filter(|e| e.0 < size && e.1 < size).collect();
            let own = Matrix::from_triplets(size, size, &own).map_err(LinearError::from)?;
            let mut all = eigenvalues(&own)?;
            all.sort_by(|a, b| b.0.hypot(b.1).total_cmp(&a.0.hypot(a.1)));
            // μ = 1 / (λ − σ), where μ is not 0, as it is for infinite λ.
            let inverse = |z: &(f64, f64)| {
                let square = z.0 * z.0 + z.1 * z.1;
                (square > 0.0).then(|| (shift + z.0 / square, -z.1 / square))
            };
            Ok(all.iter().filter_map(inverse).collect())
        };
        let size = basis.len();
        let (fine, coarse) = (
            values(size)?,
            values(if size < dimension { size } else { size * 3 / 4 })?,
        );
        let ritz = |z: &(f64, f64)| {
            let apart = |w: &(f64, f64)| (z.0 - w.0).hypot(z.1 - w.1);
            let moved = coarse.iter().map(apart).fold(f64::INFINITY, f64::min);
            Ritz {
                value: *z,
                change: moved / (z.0 - shift).hypot(z.1),
            }
        };
        Ok(fine.iter().take(count).map(ritz).collect())
    }
}
