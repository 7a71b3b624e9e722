//! Points of a curve, from Newton's method with whatever Jacobian the map gives at each iterate.

use crate::linear::{AutoSolver, Bordered};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, select};
use crate::sparse::{Matrix, distance, dot, norm};

use super::super::{ContinuationError, ContinuationOptions};

/// A point of the curve in the variables in which lengths are measured.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) z: Vec<f64>,
    /// The unit tangent of the Jacobian there, in the direction of travel.
    pub(super) tangent: Vec<f64>,
    /// ‖H‖₂.
    pub(super) residual: f64,
    /// Corrections spent on it.
    pub(super) corrections: usize,
}

impl State {
    /// The rate of the parameter.
    pub(super) fn rate(&self) -> f64 {
        self.tangent.last().copied().unwrap_or(0.0)
    }

    pub(super) fn parameter(&self) -> f64 {
        self.z.last().copied().unwrap_or(f64::NAN)
    }

    pub(super) fn turned(mut self, forward: bool) -> Self {
        if !forward {
            self.tangent.iter_mut().for_each(|t| *t = -*t);
        }
        self
    }
}

/// The map, its variables measured in their typical sizes, and workspaces.
pub(super) struct System<'a> {
    map: Box<dyn PiecewiseSmooth + 'a>,
    /// Typical sizes relative to that of the parameter.
    sizes: Vec<f64>,
    bordered: Bordered<AutoSolver>,
    jac: Matrix,
    r: Vec<f64>,
    dz: Vec<f64>,
    pub(super) corrections: usize,
    step_tolerance: f64,
    residual_tolerance: f64,
    max_corrections: usize,
    pub(super) min_cos: f64,
}

impl<'a> System<'a> {
    pub(super) fn new(
        map: Box<dyn PiecewiseSmooth + 'a>,
        options: &ContinuationOptions,
    ) -> Result<Self, ContinuationError> {
        let (m, n) = (map.num_vars(), map.num_residuals());
        if n == 0 || m != n + 1 {
            return Err(ContinuationError::Map(PiecewiseError::Dimensions {
                vars: m,
                residuals: n,
                expected: "a curve has exactly one variable more than residuals",
            }));
        }
        let mut sizes = vec![1.0; m];
        match options.typical_sizes.is_empty() {
            true => {
                if let Some(description) = map.description() {
                    description.typical_sizes(&mut sizes);
                }
            }
            false => sizes.copy_from_slice(&options.typical_sizes),
        }
        let unit = sizes[n];
        sizes.iter_mut().for_each(|s| *s /= unit);
        let pattern = map.pattern();
        let linear = |e| ContinuationError::Map(PiecewiseError::Linear(e));
        Ok(Self {
            sizes,
            bordered: Bordered::new(&pattern, AutoSolver::new()).map_err(linear)?,
            jac: Matrix::zeros(pattern),
            r: vec![0.0; n],
            dz: vec![0.0; m],
            corrections: 0,
            step_tolerance: options.step_tolerance,
            residual_tolerance: options.residual_tolerance,
            max_corrections: options.max_corrections,
            min_cos: options.min_cos,
            map,
        })
    }

    pub(super) fn factorisations(&self) -> usize {
        self.bordered.factorisations()
    }

    pub(super) fn map(&self) -> &(dyn PiecewiseSmooth + 'a) {
        &*self.map
    }

    pub(super) fn sizes(&self) -> &[f64] {
        &self.sizes
    }

    pub(super) fn scaled(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.sizes).map(|(x, s)| x / s).collect()
    }

    pub(super) fn unscaled(&self, z: &[f64]) -> Vec<f64> {
        z.iter().zip(&self.sizes).map(|(z, s)| z * s).collect()
    }

    /// Evaluates and factors at z; returns the size of the terms of H, in which no variable counts as smaller than `length`.
    fn linearise(&mut self, z: &[f64], hint: &[f64], length: f64) -> Option<f64> {
        let x = self.unscaled(z);
        let selection = select(&self.map, &x);
        self.map.residual(&selection, &x, &mut self.r);
        self.jac.clear();
        self.map.jacobian(&selection, &x, &mut self.jac);
        self.jac.scale_columns(&self.sizes);
        let mut terms = vec![0.0; self.r.len()];
        for (i, j, v) in self.jac.triplets() {
            terms[i] += v.abs() * z[j].abs().max(length);
        }
        let finite = self.r.iter().chain(&terms).all(|v| v.is_finite()) && self.jac.stray().is_none();
        let factored = finite && self.bordered.factor(&self.jac, Some(hint)).is_ok();
        factored.then(|| norm(&terms))
    }

    /// The tangent of the Jacobian at any point, of either sign.
    pub(super) fn kernel(&mut self, z: &[f64], hint: &[f64]) -> Option<Vec<f64>> {
        self.linearise(z, hint, 0.0)?;
        Some(self.bordered.tangent().to_vec())
    }

    /// ‖H‖₂ at z, and the size of its terms.
    pub(super) fn error(&mut self, z: &[f64], hint: &[f64], length: f64) -> Option<(f64, f64)> {
        let terms = self.linearise(z, hint, length)?;
        Some((norm(&self.r), terms))
    }

    /// The point of the curve near `q` in the plane through it normal to `row`.
    pub(super) fn correct(&mut self, q: &[f64], row: &[f64], length: f64) -> Option<State> {
        let mut z = q.to_vec();
        let mut short = false;
        for corrections in 0..=self.max_corrections {
            let terms = self.linearise(&z, row, length)?;
            let residual = norm(&self.r);
            if residual == 0.0 || (short && residual <= self.residual_tolerance * terms) {
                return Some(State {
                    tangent: self.bordered.tangent().to_vec(),
                    z,
                    residual,
                    corrections,
                });
            }
            self.corrections += 1;
            self.bordered.solve(&self.r, row, 0.0, &mut self.dz).ok()?;
            z.iter_mut().zip(&self.dz).for_each(|(z, d)| *z -= d);
            short = norm(&self.dz) <= self.step_tolerance * (norm(&z) + length);
        }
        None
    }

    /// The point that a step of length h leads to, if the curve hardly bends on the way.
    pub(super) fn attempt(&mut self, from: &State, h: f64) -> Option<State> {
        let q = along(&from.z, h, &from.tangent);
        let found = self.correct(&q, &from.tangent, h)?;
        let cos = dot(&found.tangent, &from.tangent);
        // A curve whose tangents stay within that angle leaves its tangent no further.
        let sin = (1.0 - self.min_cos * self.min_cos).sqrt();
        let near = distance(&found.z, &q) <= h * sin / self.min_cos;
        (near && cos.abs() >= self.min_cos).then(|| found.turned(cos > 0.0))
    }

    /// The same, if the curve passes near the middle of the step, too.
    pub(super) fn step(&mut self, from: &State, h: f64) -> Option<State> {
        let end = self.attempt(from, h)?;
        let middle = self.attempt(from, 0.5 * h)?;
        let chord: Vec<f64> = end.z.iter().zip(&middle.z).map(|(b, a)| b - a).collect();
        (dot(&chord, &middle.tangent) >= self.min_cos * norm(&chord)).then_some(end)
    }
}

/// z + h t.
pub(super) fn along(z: &[f64], h: f64, t: &[f64]) -> Vec<f64> {
    z.iter().zip(t).map(|(z, t)| z + h * t).collect()
}
