//! Directions that prove that a monotone problem has no solution, by interior points of its homogeneous form.
//!
//! x ∈ K, τ ≥ 0, M x + q τ ∈ K*, −qᵀx − xᵀM x/τ ≥ 0 have inner starts whatever M and q are, and their maximal
//! complementary solutions have τ > 0 where the problem is solvable, else often −qᵀx > 0: then (M + Mᵀ) x =
//! 0, so that v = x proves that there is no solution (E. Andersen, Y. Ye, *On a homogeneous algorithm for the
//! monotone complementarity problem*, 1999). Unlike the certificate of least norm, which lies on the boundary
//! of its cones, these lie as far inside as they can, where rounding does not matter.

use std::ops::Range;

use super::interior::{Image, Interior};
use super::{Cone, ConeProblem};
use crate::complementarity::{ComplementarityError, McpFunction};
use crate::linear::{AutoSolver, LinearSolver};
use crate::sparse::{Matrix, Pattern, dot, max_abs, norm};
use crate::tolerances::HALF_DIGITS;

/// Most steps. On the central path of a homogeneous problem a step divides the gap by ten or more, from 1 to
/// its rounding: forty are enough, others only creep
/// (`refutations::strongly_infeasible_programs_are_refuted`).
const STEPS: usize = 60;
/// Certificates are tried each time τ has fallen by this factor relative to −qᵀx: at each tenth of the way to
/// rounding, or so.
const FALL: f64 = 0.05;
/// Corrections of one candidate, each of which divides what is left of its equations by 1/HALF_DIGITS.
const CORRECTIONS: usize = 3;

/// The homogeneous problem in (x, τ).
struct Homogeneous<'a> {
    matrix: &'a Matrix,
    q: &'a [f64],
    /// The places of the entries of M, of q (column of τ), and of the row of τ.
    slots: Vec<usize>,
    last_column: Vec<usize>,
    last_row: Vec<usize>,
    /// The last row of the derivative: −q − (M + Mᵀ) x/τ, and xᵀM x/τ².
    slope: Vec<f64>,
}

impl Image for Homogeneous<'_> {
    fn image(&mut self, x: &[f64], y: &mut [f64]) {
        let n = self.q.len();
        let (x, tau) = (&x[..n], x[n]);
        y.fill(0.0);
        self.matrix.as_ref().mul_add(1.0, x, &mut y[..n]);
        let square = if tau > 0.0 { dot(x, &y[..n]) / tau } else { 0.0 };
        let symmetric = if tau > 0.0 { 1.0 / tau } else { 0.0 };
        for (slope, (q, y)) in self.slope.iter_mut().zip(self.q.iter().zip(&*y)) {
            *slope = -q - symmetric * y;
        }
        self.matrix
            .as_ref()
            .mul_transpose_add(-symmetric, x, &mut self.slope[..n]);
        self.slope[n] = square * symmetric;
        y[n] = -dot(self.q, x) - square;
        y.iter_mut().zip(self.q).for_each(|(y, q)| *y += tau * q);
    }

    fn derivative(&self, values: &mut [f64]) {
        values.fill(0.0);
        for (slot, v) in self.slots.iter().zip(self.matrix.values()) {
            values[*slot] += v;
        }
        for (slot, v) in self.last_column.iter().zip(self.q) {
            values[*slot] += v;
        }
        for (slot, v) in self.last_row.iter().zip(&self.slope) {
            values[*slot] += v;
        }
    }
}

/// Calls `accept` with directions that are certificates of the problem M x + q up to rounding, until it
/// returns true or the iteration ends. M must be monotone. `proceed` is asked before each step.
pub(super) fn directions(
    problem: &ConeProblem<&dyn McpFunction>,
    (matrix, q): (&Matrix, &[f64]),
    proceed: &mut dyn FnMut() -> bool,
    accept: &mut dyn FnMut(Vec<f64>) -> Result<bool, ComplementarityError>,
) -> Result<bool, ComplementarityError> {
    let n = q.len();
    let blocks: Vec<(Cone, Range<usize>)> = problem.blocks().flat_map(split).collect();
    let dense = blocks.iter().flat_map(|(_, range)| {
        let rows = range.clone();
        rows.flat_map(|j| range.clone().map(move |i| (i, j)))
    });
    let border = (0..=n).flat_map(|k| [(k, n), (n, k)]);
    let entries = matrix
        .triplets()
        .map(|(i, j, _)| (i, j))
        .chain(dense)
        .chain(border);
    let pattern = Pattern::from_entries(n + 1, n + 1, entries)?;
    let mut map = Homogeneous {
        matrix,
        q,
        slots: matrix
            .triplets()
            .filter_map(|(i, j, _)| pattern.slot(i, j))
            .collect(),
        last_column: (0..n).filter_map(|i| pattern.slot(i, n)).collect(),
        last_row: (0..=n).filter_map(|j| pattern.slot(n, j)).collect(),
        slope: vec![0.0; n + 1],
    };
    let cones = problem.cones().iter().copied().chain([Cone::Nonnegative(1)]);
    let (col_ptr, row_idx) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
    let mut engine = Interior::new(cones, col_ptr, row_idx, false);
    engine.start(&mut map, &vec![0.0; n + 1], 1.0);
    let mut next = FALL;
    for _ in 0..STEPS {
        if !proceed() || engine.step(&mut map).is_none() {
            break;
        }
        let (x, tau) = (&engine.x()[..n], engine.x()[n]);
        let rate = -dot(q, x);
        let part = tau / rate;
        // On the central path τ times the last entry of F is the gap: beside τ that entry has become
        // rounding.
        if engine.gap() <= f64::EPSILON * tau * tau {
            break;
        }
        if rate > 0.0 && part <= next {
            next = FALL * part;
            if let Some(v) = settled(&blocks, matrix, x, part.sqrt())?
                && accept(v)?
            {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// A product of half-lines, or of free variables, as its factors.
fn split((cone, range): (Cone, Range<usize>)) -> Vec<(Cone, Range<usize>)> {
    let each = |one: Cone| range.clone().map(|i| (one, i..i + 1)).collect();
    match cone {
        Cone::Nonnegative(_) => each(Cone::Nonnegative(1)),
        Cone::Free(_) => each(Cone::Free(1)),
        _ => vec![(cone, range)],
    }
}

/// v with the blocks that vanish in the limit set to zero, and corrected such that those blocks of −Mᵀv
/// vanish that do so in the limit. Of a block of v and that of −Mᵀv, one vanishes if it is less than the
/// given part of the other one.
fn settled(
    blocks: &[(Cone, Range<usize>)],
    matrix: &Matrix,
    x: &[f64],
    part: f64,
) -> Result<Option<Vec<f64>>, ComplementarityError> {
    let n = x.len();
    let largest = max_abs(x);
    let mut v: Vec<f64> = x.iter().map(|v| v / largest).collect();
    let mut image = vec![0.0; n];
    matrix.as_ref().mul_transpose_add(-1.0, &v, &mut image);
    let (mut kept, mut zero) = (Vec::new(), Vec::new());
    for (cone, range) in blocks {
        let (own, other) = (norm(&v[range.clone()]), norm(&image[range.clone()]));
        let free = matches!(cone, Cone::Free(_));
        if !free && own < part * other {
            v[range.clone()].fill(0.0);
            continue;
        }
        kept.extend(range.clone());
        if free || other < part * own {
            zero.extend(range.clone());
        }
    }
    if !zero.is_empty() && !correct(&mut v, matrix, &kept, &zero)? {
        return Ok(None);
    }
    Ok(v.iter().all(|v| v.is_finite()).then_some(v))
}

/// The least change of the entries `kept` of v after which the entries `zero` of Mᵀv vanish; `false` where
/// its system is singular.
fn correct(
    v: &mut [f64],
    matrix: &Matrix,
    kept: &[usize],
    zero: &[usize],
) -> Result<bool, ComplementarityError> {
    let (n, m) = (kept.len(), zero.len());
    let mut place = vec![None; v.len()];
    kept.iter().enumerate().for_each(|(k, &i)| place[i] = Some(k));
    let mut equation = vec![None; v.len()];
    zero.iter()
        .enumerate()
        .for_each(|(k, &j)| equation[j] = Some(n + k));
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|k| (k, k, 1.0)).collect();
    // Equations, whose coefficients are of size one, may depend on each other.
    entries.extend((n..n + m).map(|k| (k, k, -HALF_DIGITS)));
    for (i, j, a) in matrix.triplets() {
        if let (Some(k), Some(e)) = (place[i], equation[j]) {
            entries.extend([(k, e, a), (e, k, a)]);
        }
    }
    let system = Matrix::from_triplets(n + m, n + m, &entries)?;
    let mut solver = AutoSolver::new();
    if solver.analyze(system.pattern().as_ref()).is_err() || solver.factor(system.as_ref()).is_err() {
        return Ok(false);
    }
    let (mut image, mut rest) = (vec![0.0; v.len()], vec![0.0; n + m]);
    for _ in 0..CORRECTIONS {
        image.fill(0.0);
        matrix.as_ref().mul_transpose_add(-1.0, v, &mut image);
        rest[..n].fill(0.0);
        rest[n..].iter_mut().zip(zero).for_each(|(r, &j)| *r = image[j]);
        if solver.solve_in_place(&mut rest).is_err() {
            return Ok(false);
        }
        kept.iter().zip(&rest).for_each(|(&i, d)| v[i] += d);
    }
    Ok(true)
}
