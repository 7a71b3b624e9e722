//! Refactorisation, and checks of the basic variables, of results and of rays.

use super::{Lemke, Var};
use crate::complementarity::accuracy::{drop_rounding, point};
use crate::complementarity::infeasible::Conditions;
use crate::complementarity::{ComplementarityError, Lcp};
use crate::linear::LinearError;
use crate::run::Status;
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::{CHECKED, SAME};

impl Lemke {
    /// The basis as a full matrix, and its inverse.
    pub(super) fn refactor(&mut self, lcp: &Lcp) -> Result<(), ComplementarityError> {
        let n = self.basic.len();
        let mut matrix = Matrix::zeros(Pattern::full(n, n));
        let pattern = lcp.matrix().pattern();
        for (column, var) in matrix.values_mut().chunks_exact_mut(n).zip(&self.basic) {
            match *var {
                Var::Slack(i) => column[i] = 1.0,
                Var::Cover => column.copy_from_slice(&self.cover),
                Var::Point(j) => {
                    for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                        column[pattern.row_idx()[k]] = -self.scaled[k];
                    }
                }
            }
        }
        self.refactorisations += 1;
        self.fresh = true;
        self.basis.factor(&matrix)?;
        Ok(())
    }

    /// Error of the basic variables in their equations, relative to the terms; the residual is left in `rhs`.
    pub(super) fn decay(&mut self, lcp: &Lcp) -> f64 {
        self.right_hand_side(lcp);
        let mut size = self.rhs.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let pattern = lcp.matrix().pattern();
        for (var, &v) in self.basic.iter().zip(&self.value) {
            size = size.max(v.abs());
            match *var {
                Var::Slack(i) => self.rhs[i] -= v,
                Var::Cover => self
                    .rhs
                    .iter_mut()
                    .zip(&self.cover)
                    .for_each(|(r, c)| *r -= c * v),
                Var::Point(j) => {
                    for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                        self.rhs[pattern.row_idx()[k]] += self.scaled[k] * v;
                    }
                }
            }
        }
        let worst = self
            .rhs
            .iter()
            .fold(0.0_f64, |m, v| if v.abs() <= m { m } else { v.abs() });
        if size == 0.0 { worst } else { worst / size }
    }

    /// Whether the basic variables satisfy their equations, with a new inverse if need be.
    pub(super) fn verify(&mut self, lcp: &Lcp) -> Result<bool, ComplementarityError> {
        if self.decay(lcp) <= SAME {
            return Ok(true);
        }
        match self.refactor(lcp) {
            Err(ComplementarityError::Linear(
                LinearError::Singular { .. } | LinearError::Inaccurate { .. },
            )) => {
                return Ok(false);
            }
            result => result?,
        }
        self.values(lcp);
        Ok(self.decay(lcp) <= SAME)
    }

    /// t has left the basis: refines the basic variables. The resulting point is checked later, within its bounds.
    pub(super) fn finish(&mut self, lcp: &Lcp) -> Result<Status, ComplementarityError> {
        if !self.verify(lcp)? {
            return Ok(Status::Inaccurate);
        }
        for _ in 0..2 {
            self.basis.apply(&self.rhs, &mut self.entering);
            self.value
                .iter_mut()
                .zip(&self.entering)
                .for_each(|(v, d)| *v += d);
            self.decay(lcp);
        }
        Ok(Status::Solved)
    }

    /// Whether z, with w = M z + q in `work`, is a solution.
    pub(super) fn is_solution(&mut self, lcp: &Lcp, z: &[f64]) -> bool {
        let point = point(lcp.into(), z, &self.work);
        self.judge.verdict(&point, CHECKED).is_solved(CHECKED)
    }

    /// Whether z without its rounding is a solution; otherwise z and `work` stay as they are.
    pub(super) fn is_solution_without_rounding(&mut self, lcp: &Lcp, z: &mut [f64]) -> bool {
        self.entering.copy_from_slice(z);
        if drop_rounding(lcp.into(), z) {
            lcp.value(z, &mut self.work);
            if self.is_solution(lcp, z) {
                return true;
            }
            z.copy_from_slice(&self.entering);
            lcp.value(z, &mut self.work);
        }
        false
    }

    /// z of the current basis, inside its bounds.
    pub(super) fn point(&mut self, lcp: &Lcp, z: &mut [f64]) {
        self.resting(lcp);
        z.copy_from_slice(&self.work);
        for (var, v) in self.basic.iter().zip(&self.value) {
            if let Var::Point(i) = *var {
                let (l, u) = (lcp.lower()[i], lcp.upper()[i]);
                let unit = self.columns[i];
                z[i] = match () {
                    () if *v <= l / unit + self.zero => l,
                    () if *v >= u / unit - self.zero => u,
                    () => v * unit,
                };
            }
        }
    }

    pub(super) fn record_ray(&mut self, entering: Var, direction: f64) {
        self.ray.fill(0.0);
        for (var, y) in self.basic.iter().zip(&self.entering) {
            if let Var::Point(i) = *var {
                self.ray[i] = -direction * y;
            }
        }
        if let Var::Point(i) = entering {
            self.ray[i] = direction;
        }
        let size = |ray: &[f64]| ray.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let rounding = CHECKED * size(&self.ray);
        for (v, unit) in self.ray.iter_mut().zip(&self.columns) {
            *v = if v.abs() <= rounding { 0.0 } else { *v * unit };
        }
        let largest = size(&self.ray);
        if largest > 0.0 {
            self.ray.iter_mut().for_each(|v| *v /= largest);
            self.has_ray = true;
        }
    }

    /// Whether v ≥ 0, Mᵀv ≤ 0 and qᵀv < 0 hold for the ray up to rounding, so that vᵀ(M z + q) < 0 for every z ≥ 0, and exact
    /// arithmetic confirms that no z ≥ 0 has M z + q ≥ 0.
    pub(super) fn proves_infeasibility(&self, lcp: &Lcp) -> bool {
        if !self.has_ray || !lcp.is_standard() {
            return false;
        }
        let v = &self.ray;
        if v.iter().any(|v| *v < 0.0) {
            return false;
        }
        let (mut gain, mut size) = (0.0, 0.0);
        for (q, v) in lcp.q().iter().zip(v.iter()) {
            gain += q * v;
            size += (q * v).abs();
        }
        // (Mᵀv)ⱼ ≤ 0 relative to its own terms: rows in small units count as much as others.
        let pattern = lcp.matrix().pattern();
        let nearly = gain < -CHECKED * size
            && (0..lcp.len()).all(|j| {
                let span = pattern.col_ptr()[j]..pattern.col_ptr()[j + 1];
                let terms = pattern.row_idx()[span.clone()]
                    .iter()
                    .zip(&lcp.matrix().values()[span]);
                let (sum, terms) =
                    terms.fold((0.0, 0.0), |(s, t), (&i, a)| (s + a * v[i], t + (a * v[i]).abs()));
                sum <= CHECKED * terms
            });
        let conditions = Conditions {
            matrix: lcp.matrix(),
            q: lcp.q(),
            lower: lcp.lower(),
            upper: lcp.upper(),
        };
        nearly && conditions.contradict(&self.ray)
    }
}
