use std::fmt;

use super::StabilityError;
use crate::linear::eigenvalues;
use crate::sparse::Matrix;
use crate::words::Count;

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
        let mut eigenvalues = eigenvalues(matrix)?;
        eigenvalues.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
        // Backward errors of the iteration are roundings of the Frobenius norm for each row.
        let size = matrix.values().iter().map(|v| v * v).sum::<f64>().sqrt();
        let hidden = matrix.nrows() as f64 * f64::EPSILON * size;
        let unstable = eigenvalues.iter().filter(|z| z.0 > hidden).count();
        let undecided = eigenvalues.iter().filter(|z| z.0.abs() <= hidden).count();
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
