//! Arms as power series, and the signs of functions along them.

use crate::sparse::norm;

/// A number with a bound of its error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Value {
    pub(super) value: f64,
    pub(super) error: f64,
}

impl Value {
    /// Its sign; 0 within the error.
    pub(super) fn sign(self) -> i8 {
        if self.value.abs() <= self.error || self.value.is_nan() {
            0
        } else if self.value > 0.0 {
            1
        } else {
            -1
        }
    }
}

/// An arm x + Σ terms[k − 1] s^k, s ≥ 0, up to the order known, or x + terms[0] s + half s^{3/2} + …
#[derive(Debug, Clone)]
pub(super) struct Arc {
    pub(super) terms: Vec<Vec<f64>>,
    pub(super) half: Option<Vec<f64>>,
    /// The power of s with which the Jacobian becomes regular.
    pub(super) order: f64,
}

impl Arc {
    pub(super) fn new(terms: Vec<Vec<f64>>, order: f64) -> Self {
        Self {
            terms,
            half: None,
            order,
        }
    }

    pub(super) fn tangent(&self) -> &[f64] {
        &self.terms[0]
    }

    /// The arc that leaves in the opposite direction along the same smooth curve.
    pub(super) fn reversed(&self) -> Self {
        let mut arc = self.clone();
        for term in arc.terms.iter_mut().step_by(2) {
            term.iter_mut().for_each(|t| *t = -*t);
        }
        arc
    }

    /// Size of the coefficient k (from 0) and of what it was computed from.
    pub(super) fn size(&self, k: usize) -> f64 {
        match &self.half {
            Some(half) if k == 1 => norm(half),
            _ => self.terms.iter().take(k + 1).map(|t| norm(t)).fold(0.0, f64::max),
        }
    }

    /// The displacement at s.
    pub(super) fn at(&self, s: f64) -> Vec<f64> {
        let mut x = vec![0.0; self.terms[0].len()];
        let mut add = |weight: f64, term: &[f64]| x.iter_mut().zip(term).for_each(|(x, t)| *x += weight * t);
        for (k, term) in self.terms.iter().enumerate() {
            add(s.powi(k as i32 + 1), term);
        }
        if let Some(half) = &self.half {
            add(s * s.sqrt(), half);
        }
        x
    }
}

/// The sign of a function of s > 0 with these coefficients of s, s², …, at first: that of the first coefficient that does not vanish; 0 where
/// all that are known vanish. Where the function changes its sign again before it exceeds its rounding at the point, the point is within
/// rounding of one where the coefficient vanishes, and the next decides.
pub(super) fn leading(values: &[Value], rounding: f64) -> i8 {
    for (k, value) in values.iter().enumerate() {
        let sign = value.sign();
        let hidden = |(j, other): (usize, &Value)| {
            let (k, j) = (k as f64 + 1.0, (k + j) as f64 + 2.0);
            // a sᵏ − b sʲ is largest where k a = j b sʲ⁻ᵏ.
            let place = (k * value.value / (j * other.value)).abs().powf((j - k).recip());
            sign * other.sign() < 0 && value.value.abs() * place.powf(k) * (1.0 - k / j) <= rounding
        };
        if sign != 0 && !values[k + 1..].iter().enumerate().any(hidden) {
            return sign;
        }
    }
    0
}

#[cfg(test)]
mod tests {
    use super::{Value, leading};

    fn values(coefficients: &[f64]) -> Vec<Value> {
        let value = |&value: &f64| Value { value, error: 1e-12 };
        coefficients.iter().map(value).collect()
    }

    /// s − b s² is at most 1/(4 b), s − b s³ at most 2/(3 √(3 b)), and s² − b s³ at most 4/(27 b²).
    #[test]
    fn signs_that_change_within_rounding_are_those_beyond() {
        for (coefficients, most) in [
            ([1.0, -1e8, 0.0], 0.25e-8),
            ([1.0, 0.0, -1e8], 2.0 / (3.0 * 3e8_f64.sqrt())),
            ([0.0, 1.0, -1e3], 4.0 / 27.0 * 1e-6),
        ] {
            let (f, mirrored) = (values(&coefficients), values(&coefficients.map(|c| -c)));
            for (rounding, sign) in [(0.0, 1), (0.999 * most, 1), (1.001 * most, -1)] {
                assert_eq!(
                    (leading(&f, rounding), leading(&mirrored, rounding)),
                    (sign, -sign)
                );
            }
        }
        assert_eq!(leading(&values(&[1e-13, 2.0, 3.0]), 1.0), 1);
        assert_eq!(leading(&values(&[1e-13, -1e-12, 0.0]), 0.0), 0);
    }
}
