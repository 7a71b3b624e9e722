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
}

impl Arc {
    pub(super) fn new(terms: Vec<Vec<f64>>) -> Self {
        Self { terms, half: None }
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

/// The first coefficient that does not vanish: its sign and its place from 1; 0 where all that are known vanish.
pub(super) fn leading(values: &[Value]) -> (i8, u8) {
    for (k, value) in values.iter().enumerate() {
        let sign = value.sign();
        if sign != 0 {
            return (sign, k as u8 + 1);
        }
    }
    (0, 0)
}
