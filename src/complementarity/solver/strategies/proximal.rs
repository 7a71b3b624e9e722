//! Proximal points, and what their displacement proves.

use super::weights::{CERTIFICATE, PROXIMAL_AFFINE, PROXIMAL_SMOOTH, Proximal};
use crate::complementarity::solver::McpStatus;
use crate::complementarity::solver::engine::{Engine, Plan};
use crate::sparse::max_abs;

impl Engine<'_> {
    /// Proximal points with ε → 0, the centre moving along.
    pub(super) fn proximal_points(&mut self) -> McpStatus {
        if !self.evaluate() || !self.jacobian() {
            return McpStatus::Stalled;
        }
        let size = max_abs(self.work.lin.jac().values()).clamp(Proximal::SIZES.0, Proximal::SIZES.1);
        let mut epsilon = size;
        let mut outcome = McpStatus::Stalled;
        let mut last = f64::INFINITY;
        let weights = match self.affine {
            true => PROXIMAL_AFFINE,
            false => PROXIMAL_SMOOTH,
        };
        for k in 0..weights.rounds {
            let w = &mut *self.work;
            w.centre.copy_from_slice(&w.x);
            let plan = Plan::proximal(epsilon);
            outcome = McpStatus::Stalled;
            if self.affine {
                outcome = self.affine_newton(&plan);
                if outcome != McpStatus::Solved {
                    let w = &mut *self.work;
                    w.x.copy_from_slice(&w.centre);
                    if self.affine_path(&plan) {
                        outcome = McpStatus::Solved;
                    }
                }
            }
            if outcome != McpStatus::Solved {
                outcome = self.descend(&plan);
            }
            if let Some(status) = self.exhausted() {
                return status;
            }
            if outcome != McpStatus::Solved {
                // Too little regularisation, or a centre too far away.
                let w = &mut *self.work;
                w.x.copy_from_slice(&w.centre);
                epsilon *= Proximal::GROWTH;
                if epsilon > Proximal::MOST * size {
                    return outcome;
                }
                continue;
            }
            let residual = self.residual();
            if self.affine && self.certify() {
                return McpStatus::Infeasible;
            }
            if residual <= Proximal::FALL * last || (k + 1) % Proximal::EVERY == 0 {
                let w = &mut *self.work;
                w.centre.copy_from_slice(&w.x);
                if self.descend(&Plan::newton(Proximal::FINISH)) == McpStatus::Solved {
                    return McpStatus::Solved;
                }
                let w = &mut *self.work;
                w.x.copy_from_slice(&w.centre);
            }
            last = last.min(residual);
            epsilon = (epsilon * weights.shrink).max(weights.least * size);
        }
        match outcome {
            McpStatus::Solved => McpStatus::Stalled,
            other => other,
        }
    }

    /// Whether x − centre proves an affine problem infeasible: v along no finite bound, so that vᵀF ≥ 0 at solutions, and
    /// sup (Mᵀv)ᵀx + qᵀv < 0 over the bounds.
    fn certify(&mut self) -> bool {
        let n = self.n();
        let mut v: Vec<f64> = (0..n)
            .map(|i| {
                let d = self.work.x[i] - self.work.centre[i];
                match (self.lower[i].is_finite(), self.upper[i].is_finite()) {
                    (true, true) => 0.0,
                    (true, false) => d.max(0.0),
                    (false, true) => d.min(0.0),
                    (false, false) => d,
                }
            })
            .collect();
        let norm = max_abs(&v);
        if norm <= CERTIFICATE.displacement * (1.0 + max_abs(&self.work.x)) || norm.is_nan() {
            return false;
        }
        for v in &mut v {
            *v /= norm;
            if v.abs() < CERTIFICATE.zero {
                *v = 0.0;
            }
        }
        if !self.jacobian() {
            return false;
        }
        let w = &mut *self.work;
        // q = F(0), as M x + q would lose it far out.
        w.trial_x.fill(0.0);
        self.function.value(&w.trial_x, &mut w.trial_f);
        self.report.evaluations += 1;
        let jac = w.lin.jac();
        let mut sum: f64 = w.trial_f.iter().zip(&v).map(|(q, v)| q * v).sum();
        let mut size: f64 = w.trial_f.iter().zip(&v).map(|(q, v)| (q * v).abs()).sum();
        let pattern = jac.pattern();
        for j in 0..n {
            let span = pattern.col_ptr()[j]..pattern.col_ptr()[j + 1];
            let terms = pattern.row_idx()[span.clone()].iter().zip(&jac.values()[span]);
            let (s, terms) = terms.fold((0.0, 0.0), |(s, t), (&i, a)| (s + a * v[i], t + (a * v[i]).abs()));
            let bound = if s > 0.0 { self.upper[j] } else { self.lower[j] };
            if bound.is_finite() {
                sum += s * bound;
                size += terms * bound.abs();
            } else if s.abs() > CERTIFICATE.orthogonal * terms {
                return false;
            }
        }
        let proven = sum < -CERTIFICATE.margin * size;
        if proven {
            self.report.certificate = v;
        }
        proven
    }
}
