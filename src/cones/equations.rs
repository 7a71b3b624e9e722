//! The equations of a cone problem, and their Newton step.

use std::ops::Range;

use super::run::Run;
use super::{Cone, ConeProblem};
use crate::complementarity::{ComplementarityError, McpFunction};
use crate::linear::{LinearError, LinearSolver};
use crate::sparse::{Pattern, max_abs, norm};

/// A second-order or semidefinite cone, or one half-line or free variable.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) cone: Cone,
    pub(super) range: Range<usize>,
    /// Unit of F, a power of two.
    pub(super) unit: f64,
    /// Where its derivatives begin.
    pub(super) at: usize,
}

/// The equations: smoothed Fischer–Burmeister functions, or the natural map.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Map {
    Smoothed(f64),
    Natural,
}

/// The part of each row.
pub(super) fn owners(parts: &[Part]) -> Vec<usize> {
    let of = |(k, part): (usize, &Part)| std::iter::repeat_n(k, part.range.len());
    parts.iter().enumerate().flat_map(of).collect()
}

/// Entries (row, column) of D ∇F and of D, where D has a diagonal block for each part; `rows` is the pattern of ∇Fᵀ.
pub(super) fn mixed(parts: &[Part], rows: &Pattern) -> Vec<(usize, usize)> {
    let (mut entries, mut columns) = (Vec::new(), Vec::new());
    for part in parts {
        let (first, end) = (part.range.start, part.range.end);
        columns.clear();
        columns.extend(part.range.clone());
        columns.extend_from_slice(&rows.row_idx()[rows.col_ptr()[first]..rows.col_ptr()[end]]);
        columns.sort_unstable();
        columns.dedup();
        for &j in &columns {
            entries.extend(part.range.clone().map(|i| (i, j)));
        }
    }
    entries
}

/// Bytes for each entry of the Jacobian of the equations: its place in lists, patterns and blocks of
/// derivatives, in the system of a step and in that of interior points, with factors that are as full.
/// Measured; `refutations::what_does_not_fit_is_refused` holds the order.
const PER_ENTRY: f64 = 100.0;

/// Refuses problems that take more memory than the limit, in bytes.
pub(super) fn check_memory<F: McpFunction>(
    problem: &ConeProblem<F>,
    limit: u64,
) -> Result<(), ComplementarityError> {
    let (n, pattern) = (problem.len() as f64, problem.function().pattern());
    let mut of_row = vec![0.0_f64; problem.len()];
    pattern.row_idx().iter().for_each(|&i| of_row[i] += 1.0);
    let each = problem.blocks().map(|(cone, range)| {
        let width = match cone {
            Cone::SecondOrder(_) | Cone::Semidefinite(_) => range.len() as f64,
            Cone::Nonnegative(_) | Cone::Free(_) => 1.0,
        };
        let stored: f64 = of_row[range.clone()].iter().sum();
        // All rows of a part have the columns of each of them, and those of the part.
        width * (stored + range.len() as f64).min(n * range.len() as f64 / width)
    });
    let (needed, limit) = (PER_ENTRY * each.sum::<f64>(), limit as f64);
    match needed <= limit {
        true => Ok(()),
        false => Err(ComplementarityError::Memory { needed, limit }),
    }
}

/// The parts of K, the number of entries of all their derivatives and of the widest of them.
pub(super) fn parts<F: McpFunction>(problem: &ConeProblem<F>) -> (Vec<Part>, usize, usize) {
    let (mut parts, mut at, mut widest) = (Vec::new(), 0, 0);
    for (cone, range) in problem.blocks() {
        let (cone, width) = match cone {
            Cone::SecondOrder(_) | Cone::Semidefinite(_) => (cone, cone.len()),
            Cone::Nonnegative(_) => (Cone::Nonnegative(1), 1),
            Cone::Free(_) => (Cone::Free(1), 1),
        };
        for first in range.step_by(width) {
            parts.push(Part {
                cone,
                range: first..first + width,
                unit: 1.0,
                at,
            });
            at += width * width;
        }
        widest = widest.max(width * width);
    }
    (parts, at, widest)
}

impl Run<'_> {
    /// Units of F from the rows of ∇F at x.
    pub(super) fn choose_units(&mut self) {
        let largest = &mut self.terms;
        largest.fill(0.0);
        for (i, _, v) in self.jac.triplets() {
            largest[i] = largest[i].max(v.abs());
        }
        for part in &mut self.parts {
            let size = max_abs(&largest[part.range.clone()]);
            let size = if size > 0.0 {
                size
            } else {
                max_abs(&self.f[part.range.clone()])
            };
            part.unit = match size.is_normal() {
                true => size.log2().round().exp2().recip(),
                false => 1.0,
            };
        }
    }

    /// Evaluates the equations at x or at the trial point, with F there, into `phi`; returns their norm.
    pub(super) fn map(&mut self, map: Map, at_trial: bool) -> f64 {
        let x = if at_trial { &self.trial } else { &self.x };
        for part in &self.parts {
            let range = part.range.clone();
            let y = &mut self.y[range.clone()];
            y.iter_mut()
                .zip(&self.f[range.clone()])
                .for_each(|(y, f)| *y = part.unit * f);
            let (x, out) = (&x[range.clone()], &mut self.phi[range]);
            match map {
                Map::Smoothed(mu) => part.cone.smoothed(mu, x, y, out),
                Map::Natural => {
                    out.iter_mut()
                        .zip(x.iter().zip(&*y))
                        .for_each(|(o, (x, y))| *o = x - y);
                    part.cone.project(out);
                    out.iter_mut().zip(x).for_each(|(o, x)| *o = x - *o);
                }
            }
        }
        norm(&self.phi)
    }

    /// The Newton step of the equations at x, with `proximal` times the identity (in units of F) added to ∇F; `false` where the system
    /// is singular.
    pub(super) fn newton_step(&mut self, map: Map, proximal: f64) -> Result<bool, ComplementarityError> {
        self.map(map, false);
        self.system.clear();
        for part in &self.parts {
            let range = part.range.clone();
            let (n, first) = (range.len(), range.start);
            let (x, y) = (&self.x[range.clone()], &self.y[range.clone()]);
            let (by_x, by_y) = (&mut self.by_x[..n * n], &mut self.by_y[part.at..part.at + n * n]);
            match map {
                Map::Smoothed(mu) => {
                    let room = &mut self.room[..3 * n];
                    part.cone
                        .smoothed_derivatives(mu, [x, y], None, [by_x, by_y], room)
                }
                Map::Natural => {
                    // x − P(x − y): I − D by x, D by y.
                    let z = &mut self.trial[range];
                    z.iter_mut()
                        .zip(x.iter().zip(y))
                        .for_each(|(z, (x, y))| *z = x - y);
                    part.cone.projection_derivative(z, by_y);
                    for k in 0..n * n {
                        by_x[k] = f64::from(u8::from(k % (n + 1) == 0)) - by_y[k];
                    }
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let value = by_x[i * n + j] + proximal * by_y[i * n + j];
                    if value != 0.0 {
                        self.system.add(first + i, first + j, value);
                    }
                }
            }
        }
        for j in 0..self.x.len() {
            let pattern = self.jac.pattern();
            for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let (r, v) = (pattern.row_idx()[k], self.jac.values()[k]);
                let part = &self.parts[self.owner[r]];
                let (n, first) = (part.range.len(), part.range.start);
                // A column that has one row of a cone has all of its rows.
                let Some(at) = self.system.pattern().slot(first, j) else {
                    continue;
                };
                for (i, entry) in self.system.values_mut()[at..at + n].iter_mut().enumerate() {
                    *entry += self.by_y[part.at + i * n + (r - first)] * part.unit * v;
                }
            }
        }
        self.report.factorisations += 1;
        let known = |e: &LinearError| {
            matches!(
                e,
                LinearError::Singular { .. } | LinearError::Inaccurate { .. } | LinearError::NotFinite { .. }
            )
        };
        match self.solver.factor(self.system.as_ref()) {
            Err(e) if known(&e) => return Ok(false),
            result => result?,
        }
        self.step.iter_mut().zip(&self.phi).for_each(|(s, p)| *s = -p);
        match self.solver.solve_in_place(&mut self.step) {
            Err(e) if known(&e) => return Ok(false),
            result => result?,
        }
        Ok(self.step.iter().all(|v| v.is_finite()))
    }
}
