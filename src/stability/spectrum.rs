use std::fmt;

use super::StabilityError;
use crate::linear::eigenvalues;
use crate::sparse::{Matrix, Pattern};
use crate::spread::Random;
use crate::words::Count;

/// Matrices beside the given one whose eigenvalues tell what rounding hides, and the factor from the largest move of a real part to a bound.
const PROBES: usize = 2;
const ALLOWANCE: f64 = 8.0;

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

    /// A function that vanishes where the sum of two eigenvalues does, and changes its sign where a pair ±iω crosses the imaginary axis: the
    /// sign of the determinant of the bialternate product 2 A ⊙ I, Π (λᵢ + λⱼ), and the size of its least factor relative to |λᵢ| + |λⱼ|.
    pub(super) fn hopf_test(&self) -> f64 {
        let (mut sign, mut least) = (1.0, f64::INFINITY);
        self.pairs(|sum, is_real_pair| {
            least = f64::min(least, sum.abs());
            // Others come with their conjugates.
            if is_real_pair {
                sign *= sum.signum();
            }
        });
        sign * least
    }

    /// ω, if the pair with the least relative sum is complex.
    pub(super) fn frequency(&self) -> Option<f64> {
        let (mut least, mut found) = (f64::INFINITY, None);
        let all = &self.eigenvalues;
        for (i, a) in all.iter().enumerate() {
            for b in &all[i + 1..] {
                let sum = relative_sum(*a, *b).abs();
                if sum < least {
                    least = sum;
                    found = (a.1 != 0.0 && a.1 == -b.1).then_some(a.1.abs());
                }
            }
        }
        found
    }

    fn pairs(&self, mut with: impl FnMut(f64, bool)) {
        let all = &self.eigenvalues;
        for (i, a) in all.iter().enumerate() {
            for b in &all[i + 1..] {
                with(relative_sum(*a, *b), a.1 == -b.1);
            }
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

/// |λ + μ| / (|λ| + |μ|), with the sign of the sum where that is real.
fn relative_sum(a: (f64, f64), b: (f64, f64)) -> f64 {
    let size = a.0.hypot(a.1) + b.0.hypot(b.1);
    let sum = (a.0 + b.0).hypot(a.1 + b.1);
    match size {
        0.0 => 0.0,
        _ => (sum / size).copysign(a.0 + b.0),
    }
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
