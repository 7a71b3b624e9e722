//! The equations of a cone problem.

use std::ops::Range;

use super::{Cone, ConeProblem};
use crate::complementarity::{ComplementarityError, McpFunction};
use crate::sparse::Pattern;

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
