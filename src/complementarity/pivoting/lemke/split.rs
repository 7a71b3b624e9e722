//! Unknowns without bounds whose block of M is singular: each is the difference of two that are not negative.

use std::ops::ControlFlow;

use super::{Lemke, LemkeOptions, LemkePivot, LemkeReport};
use crate::complementarity::columns::BoxLcp;
use crate::complementarity::{ComplementarityError, Lcp};
use crate::run::Status;
use crate::sparse::Matrix;

impl Lemke {
    /// Solves the problem in z⁺ and z⁻ with zᵢ = zᵢ⁺ − zᵢ⁻ and the conditions wᵢ ≥ 0, −wᵢ ≥ 0 for each
    /// unknown without bounds. With M that of the larger problem is copositive-plus, too.
    pub(super) fn solve_split(
        &mut self,
        lcp: &Lcp,
        z: &mut [f64],
        observe: &mut dyn FnMut(&LemkePivot) -> ControlFlow<()>,
    ) -> Result<LemkeReport, ComplementarityError> {
        let n = lcp.len();
        let free = |i: &usize| lcp.lower()[*i].is_infinite() && lcp.upper()[*i].is_infinite();
        let split: Vec<usize> = (0..n).filter(free).collect();
        let mut second = vec![None; n];
        split
            .iter()
            .enumerate()
            .for_each(|(k, &i)| second[i] = Some(n + k));
        let mut entries = Vec::new();
        for (i, j, v) in lcp.matrix().triplets() {
            entries.push((i, j, v));
            entries.extend(second[i].map(|i| (i, j, -v)));
            entries.extend(second[j].map(|j| (i, j, -v)));
            entries.extend(second[i].zip(second[j]).map(|(i, j)| (i, j, v)));
        }
        let longer = |values: &[f64], sign: f64| -> Vec<f64> {
            let others = split.iter().map(|&i| sign * values[i]);
            values.iter().copied().chain(others).collect()
        };
        let total = n + split.len();
        let (mut lower, mut upper) = (longer(lcp.lower(), 1.0), longer(lcp.upper(), 1.0));
        for &i in split.iter().chain(&(n..total).collect::<Vec<_>>()) {
            (lower[i], upper[i]) = (0.0, f64::INFINITY);
        }
        let larger = Lcp::boxed(
            Matrix::from_triplets(total, total, &entries)?,
            longer(lcp.q(), -1.0),
            lower,
            upper,
        )?;
        let mut solver = Self::new(LemkeOptions {
            covering: self.options.covering.as_ref().map(|d| longer(d, 1.0)),
            ..self.options.clone()
        });
        let mut found = vec![0.0; total];
        let mut report = solver.solve_observed(&larger, &mut found, observe)?;
        let difference = |v: &[f64], i: usize| v[i] - second[i].map_or(0.0, |k| v[k]);
        (0..n).for_each(|i| z[i] = difference(&found, i));
        self.has_ray = solver.has_ray;
        (0..n).for_each(|i| {
            self.ray[i] = if solver.has_ray {
                difference(&solver.ray, i)
            } else {
                0.0
            }
        });
        lcp.value(z, &mut self.work);
        let wrong = report.status == Status::Solved
            && !self.is_solution(lcp, z)
            && !self.is_solution_without_rounding(lcp, z);
        if wrong {
            report.status = Status::Inaccurate;
        }
        report.residual = BoxLcp::from(lcp).natural_residual(z, &self.work);
        Ok(report)
    }
}
