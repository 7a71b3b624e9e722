use std::sync::OnceLock;

use super::{Mcp, McpFunction};
use crate::piecewise::is_ordinary;
use crate::sparse::Matrix;

/// Units of x and F(x) in affine problems, found when first asked for.
#[derive(Debug, Clone, Default)]
pub(super) struct Units(OnceLock<Found>);

#[derive(Debug, Clone)]
struct Found {
    /// Factors by which values of F are brought to the size of x; empty for 1.
    factors: Vec<f64>,
    /// Typical size of x; 1 where nothing tells.
    size: f64,
}

impl PartialEq for Units {
    /// What follows from the problem does not tell two problems apart.
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

impl<F: McpFunction> Mcp<F> {
    fn units(&self) -> &Found {
        self.units.0.get_or_init(|| self.find_units())
    }

    /// The factor of component i: minima of x and F mean the same in all units when both are measured alike.
    pub(super) fn factor(&self, i: usize) -> f64 {
        self.units().factors.get(i).copied().unwrap_or(1.0)
    }

    pub(super) fn size(&self) -> f64 {
        self.units().size
    }

    fn find_units(&self) -> Found {
        let n = self.len();
        let mut found = Found {
            factors: Vec::new(),
            size: 1.0,
        };
        if !self.function().is_affine() {
            return found;
        }
        let m = self.function().num_vars();
        let origin = vec![0.0; m];
        let mut jac = Matrix::zeros(self.jacobian_pattern().clone());
        self.function().jacobian(&origin, &mut jac);
        let mut offset = vec![0.0; n];
        self.function().value(&origin, &mut offset);
        let (mut rows, mut rates) = (vec![0.0_f64; n], vec![0.0_f64; n]);
        for (i, j, v) in jac.triplets() {
            let to = if j < n { &mut rows } else { &mut rates };
            to[i] = to[i].max(v.abs());
        }
        let factors: Vec<f64> = rows
            .iter()
            .map(|row| if row.is_normal() { row.recip() } else { 1.0 })
            .collect();
        let shift = |v: &[f64]| {
            factors
                .iter()
                .zip(v)
                .fold(0.0_f64, |a, (f, v)| a.max(f * v.abs()))
        };
        let bounds = self.lower().iter().chain(self.upper());
        let bound = bounds
            .filter(|b| b.is_finite())
            .fold(0.0_f64, |a, b| a.max(b.abs()));
        let size = shift(&offset).max(shift(&rates)).max(bound);
        if size.is_normal() {
            found.size = size;
        }
        if !factors.iter().all(|f| is_ordinary(*f)) {
            found.factors = factors.iter().map(|f| f.log2().round().exp2()).collect();
        }
        found
    }
}
