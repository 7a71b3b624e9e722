use std::fmt;

use super::StabilityError;
use crate::linear::eigenvalues;
use crate::sparse::{Matrix, Pattern};
use crate::spread::Random;
use crate::tolerances::{ALLOWANCE, NONE};
use crate::words::Count;

/// Matrices beside the given one whose eigenvalues tell what rounding hides.
const PROBES: usize = 2;

/// Eigenvalues of a linearisation.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Spectrum {
    /// The eigenvalues (real part, imaginary part), by decreasing real parts.
    pub eigenvalues: Vec<(f64, f64)>,
    /// How many have positive real parts.
    pub unstable: usize,
    /// How many have real parts that rounding hides: these are counted neither as positive nor as negative.
    pub undecided: usize,
    /// By how much rounding may move each real part.
    hidden: Vec<f64>,
}

impl Spectrum {
    pub(super) fn of(matrix: &Matrix) -> Result<Self, StabilityError> {
        let eigenvalues = sorted(matrix)?;
        let hidden = hidden(matrix, &eigenvalues)?;
        let pairs = || eigenvalues.iter().map(|z| z.0).zip(&hidden);
        let unstable = pairs().filter(|(real, hidden)| *real > **hidden).count();
        let undecided = pairs().filter(|(real, hidden)| real.abs() <= **hidden).count();
        Ok(Self {
            eigenvalues,
            unstable,
            undecided,
            hidden,
        })
    }

    /// Whether all real parts are negative: `None` where rounding hides it.
    #[must_use]
    pub fn is_stable(&self) -> Option<bool> {
        match (self.unstable, self.undecided) {
            (0, 0) => Some(true),
            (0, _) => None,
            _ => Some(false),
        }
    }

    /// The real parts by rank, 0 where they have no sign: rounding hides it, or it is one of those nearest to
    /// zero, where one `crosses`.
    pub(super) fn signed_parts(&self, crosses: bool) -> Vec<f64> {
        let parts = || self.eigenvalues.iter().map(|z| z.0);
        let least = parts().fold(f64::INFINITY, |m, real| m.min(real.abs()));
        let has_sign = |real: f64, hidden: f64| real.abs() > hidden && !(crosses && real.abs() == least);
        let signed = parts().zip(&self.hidden);
        signed
            .map(|(real, hidden)| if has_sign(real, *hidden) { real } else { 0.0 })
            .collect()
    }

    /// For each eigenvalue the one of another spectrum that continues it: pairs are made from the nearest on,
    /// each eigenvalue in one of them.
    pub(super) fn nearest_in(&self, other: &Self) -> Vec<usize> {
        let n = self.eigenvalues.len();
        let distance = |(i, j): (usize, usize)| {
            let (a, b) = (self.eigenvalues[i], other.eigenvalues[j]);
            (a.0 - b.0).hypot(a.1 - b.1)
        };
        let mut pairs: Vec<(usize, usize)> = (0..n * n).map(|k| (k / n, k % n)).collect();
        pairs.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let (mut of, mut taken) = (vec![NONE; n], vec![false; n]);
        for (i, j) in pairs {
            if of[i] == NONE && !taken[j] {
                (of[i], taken[j]) = (j, true);
            }
        }
        of
    }

    /// What changes its sign with the real part of the eigenvalue of a rank, where that belongs to a complex
    /// pair: the real part. A real eigenvalue vanishes at folds and branch points, which the curve tells:
    /// there it is the size of the spectrum with the sign of the eigenvalue, so that it jumps where others
    /// cross.
    pub(super) fn crossing(&self, rank: usize) -> f64 {
        let size = || {
            self.eigenvalues
                .iter()
                .fold(0.0, |m, z| f64::max(m, z.0.hypot(z.1)))
        };
        match self.eigenvalues.get(rank) {
            Some((real, 0.0)) => size().copysign(*real),
            Some((real, _)) => *real,
            None => f64::NAN,
        }
    }
}

/// The eigenvalues by decreasing real parts.
fn sorted(matrix: &Matrix) -> Result<Vec<(f64, f64)>, StabilityError> {
    let mut all = eigenvalues(matrix)?;
    all.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
    Ok(all)
}

/// By how much rounding may move each real part. Backward errors of the iteration are roundings of the Frobenius norm for each row. They move
/// k equal eigenvalues that share one eigenvector by their k-th root: where real parts are that near to zero for k ≤ 4, matrices that differ
/// by such errors are tried.
fn hidden(matrix: &Matrix, eigenvalues: &[(f64, f64)]) -> Result<Vec<f64>, StabilityError> {
    let n = matrix.nrows();
    let size = matrix.values().iter().map(|v| v * v).sum::<f64>().sqrt();
    let rounding = n as f64 * f64::EPSILON * size;
    let mut hidden = vec![rounding; n];
    let farthest = size * (n as f64 * f64::EPSILON).powf(0.25);
    let is_near = |z: &(f64, f64)| (rounding..=farthest).contains(&z.0.abs());
    if !eigenvalues.iter().any(is_near) {
        return Ok(hidden);
    }
    let mut random = Random::new(1);
    for _ in 0..PROBES {
        let errors: Vec<f64> = (0..n * n)
            .map(|_| rounding / n as f64 * random.symmetric())
            .collect();
        // Of both signs: one of them moves double eigenvalues along the imaginary axis alone.
        for sign in [1.0, -1.0] {
            let mut moved = Matrix::zeros(Pattern::full(n, n));
            matrix.triplets().for_each(|(i, j, v)| moved.add(i, j, v));
            let values = moved.values_mut().iter_mut().zip(&errors);
            values.for_each(|(v, error)| *v += sign * error);
            for ((hidden, z), moved) in hidden.iter_mut().zip(eigenvalues).zip(sorted(&moved)?) {
                *hidden = hidden.max(ALLOWANCE * (z.0 - moved.0).abs());
            }
        }
    }
    Ok(hidden)
}

impl fmt::Display for Spectrum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.is_stable() {
            Some(true) => f.write_str("stable"),
            Some(false) => write!(
                f,
                "unstable: {} with positive real parts",
                Count(self.unstable, "eigenvalue", "eigenvalues")
            ),
            None => f.write_str("not decided: rounding hides the sign of a real part"),
        }
    }
}
