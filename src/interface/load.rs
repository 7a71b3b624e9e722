use std::fmt;
use std::sync::Arc;

use super::InterfaceError;
use super::error::{check_size, check_vector};
use super::sizes::largest;

type Amplitudes = Arc<dyn Fn(f64, &mut [f64], &mut [f64]) + Send + Sync>;

/// A load f(α) = f₀ + Σ_k φ_k(α) f_k: load cases f_k (length n) with smooth amplitudes φ_k.
///
/// Any load that does not turn without end in new directions has this form; each case costs one solve when the problem is
/// condensed, and nothing afterwards.
#[derive(Clone)]
pub struct InterfaceLoad {
    pub(super) constant: Vec<f64>,
    pub(super) cases: Vec<Vec<f64>>,
    /// `None`: one case with φ(α) = α.
    amplitudes: Option<Amplitudes>,
}

impl InterfaceLoad {
    /// The same load at every α.
    #[must_use]
    pub fn constant(load: Vec<f64>) -> Self {
        Self {
            constant: load,
            cases: Vec::new(),
            amplitudes: Some(Arc::new(|_, _, _| {})),
        }
    }

    /// f₀ + α f₁.
    #[must_use]
    pub fn affine(constant: Vec<f64>, slope: Vec<f64>) -> Self {
        Self {
            constant,
            cases: vec![slope],
            amplitudes: None,
        }
    }

    /// f₀ + Σ_k φ_k(α) f_k; `amplitudes(α, φ, φ')` fills both vectors, of the length of `cases`.
    #[must_use]
    pub fn cases(
        constant: Vec<f64>,
        cases: Vec<Vec<f64>>,
        amplitudes: impl Fn(f64, &mut [f64], &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        Self {
            constant,
            cases,
            amplitudes: Some(Arc::new(amplitudes)),
        }
    }

    /// Sizes of the constant part and of the cases.
    pub(super) fn sizes(&self) -> [f64; 2] {
        let cases = &mut self.cases.iter().flatten().copied();
        [largest(&mut self.constant.iter().copied()), largest(cases)]
    }

    pub(super) fn is_affine(&self) -> bool {
        self.amplitudes.is_none() || self.cases.is_empty()
    }

    pub(super) fn check(&self, n: usize) -> Result<(), InterfaceError> {
        check_vector("the length of the load", n, &self.constant)?;
        for case in &self.cases {
            check_vector("the length of a load case", n, case)?;
        }
        if self.amplitudes.is_none() {
            check_size("the number of load cases", 1, self.cases.len())?;
        }
        Ok(())
    }

    /// φ(α) and φ'(α).
    pub(super) fn amplitudes(&self, alpha: f64, value: &mut [f64], rate: &mut [f64]) {
        match &self.amplitudes {
            Some(f) => f(alpha, value, rate),
            None => {
                value.fill(alpha);
                rate.fill(1.0);
            }
        }
    }

    /// out = base + Σ_k c_k parts_k.
    pub(super) fn combine(base: &[f64], parts: &[Vec<f64>], c: &[f64], out: &mut [f64]) {
        out.copy_from_slice(base);
        Self::accumulate(parts, c, out);
    }

    /// out += Σ_k c_k parts_k.
    pub(super) fn accumulate(parts: &[Vec<f64>], c: &[f64], out: &mut [f64]) {
        for (part, c) in parts.iter().zip(c) {
            for (o, p) in out.iter_mut().zip(part) {
                *o += c * p;
            }
        }
    }
}

impl fmt::Debug for InterfaceLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InterfaceLoad")
            .field("n", &self.constant.len())
            .field("cases", &self.cases.len())
            .field("affine", &self.is_affine())
            .finish()
    }
}
