mod label;
mod ratio;
mod split;
mod verify;

use std::ops::ControlFlow;

use ratio::Block;

use super::basis::Basis;
use super::{LemkeOptions, LemkePivot, LemkeReport};
use crate::InputError;
use crate::complementarity::columns::BoxLcp;
use crate::complementarity::{ComplementarityError, Lcp};
use crate::input::check_options;
use crate::judge::Judge;
use crate::linear::LinearError;
use crate::piecewise::is_ordinary;
use crate::run::Status;
use crate::spread::golden;
use crate::tolerances::ROUNDING;

/// Exchanges after which the values of the basic variables are compared with the equations.
const CHECK_EVERY: usize = 32;
/// Largest order, to limit memory: the inverse takes 8 n² bytes, and five times that while it is recomputed.
const MAX_ORDER: usize = 20_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Var {
    /// wᵢ.
    Slack(usize),
    /// zᵢ.
    Point(usize),
    /// The covering variable t.
    Cover,
}

/// The bound at which zᵢ is while it is nonbasic, and with it the sign of wᵢ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Lower,
    Upper,
    /// No bounds: wᵢ is never basic.
    Free,
    /// Equal bounds: zᵢ is never basic, wᵢ has any sign.
    Fixed,
}

/// Lemke's complementary pivoting for the (box) LCP, with a lexicographic ratio test.
///
/// Starting at z = the bound nearest to minus infinity that is finite, the method follows the solutions of w
/// = M z + q + t d, complementary in (z, w), from large t to t = 0. The lexicographic rule excludes cycling,
/// so that the path ends at a solution or on a ray for any M. Bounds are handled as such: an upper bound
/// costs no extra unknown. It finds a solution whenever there is one for copositive-plus matrices (positive
/// semidefinite ones included), and always for P matrices, strictly copositive ones, and for finite boxes (C.
/// E. Lemke, 1965; R. W. Cottle, J.-S. Pang, R. E. Stone, *The Linear Complementarity Problem*, 1992,
/// algorithm 4.4.5 and section 4.9).
///
/// With [`LemkeOptions::label`] the path begins at the solution z = 0 of a problem with q ≥ 0 and leads to
/// another one (C. E. Lemke, J. T. Howson, 1964). A bimatrix game whose players have positive payoffs A and B
/// is M = −[0 A; Bᵀ 0], q = 1: the parts of z, each divided by its sum, are an equilibrium, and each label
/// leads to one, though not each equilibrium is found by a label.
///
/// Unknowns without bounds may have any block of M: where it is singular, as in the optimality conditions of
/// linear programs with equations, each of them counts as the difference of two that are not negative.
///
/// The inverse of the basis is updated (n² operations an exchange) and recomputed when it has become
/// inaccurate. A solver that is used again allocates nothing for problems that are not larger than the first.
///
/// ```
/// use semismooth::complementarity::{Lcp, pivoting::Lemke};
/// use semismooth::run::Status;
/// use semismooth::sparse::Matrix;
/// let lcp = Lcp::new(Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?, vec![-5.0, -1.0])?;
/// let mut z = [0.0; 2];
/// let report = Lemke::default().solve(&lcp, &mut z)?;
/// assert_eq!(report.status, Status::Solved);
/// assert_eq!(z, [2.5, 0.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A game of two players, each of whom mixes two strategies:
///
/// ```
/// use semismooth::complementarity::{Lcp, pivoting::{Lemke, LemkeOptions}};
/// use semismooth::sparse::Matrix;
/// let (a, b) = ([[3.0, 1.0], [1.0, 2.0]], [[1.0, 2.0], [3.0, 1.0]]);
/// let m = Matrix::from_rows(&[
///     [0.0, 0.0, -a[0][0], -a[0][1]],
///     [0.0, 0.0, -a[1][0], -a[1][1]],
///     [-b[0][0], -b[1][0], 0.0, 0.0],
///     [-b[0][1], -b[1][1], 0.0, 0.0],
/// ])?;
/// let game = Lcp::new(m, vec![1.0; 4])?;
/// let mut z = [0.0; 4];
/// let report = Lemke::new(LemkeOptions::default().with_label(0)).solve(&game, &mut z)?;
/// let (x, y) = (z[0] / (z[0] + z[1]), z[2] / (z[2] + z[3]));
/// assert!(report.residual < 1e-14 && (x - 2.0 / 3.0).abs() < 1e-14 && (y - 1.0 / 3.0).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Lemke {
    options: LemkeOptions,
    basis: Basis,
    side: Vec<Side>,
    basic: Vec<Var>,
    /// Values of the basic variables, slot by slot.
    value: Vec<f64>,
    /// The entering column in terms of the basis.
    entering: Vec<f64>,
    /// Rate of each basic variable as the entering one moves.
    rate: Vec<f64>,
    /// Column of t.
    cover: Vec<f64>,
    rhs: Vec<f64>,
    work: Vec<f64>,
    /// Directions in which the right-hand side is perturbed; 0 for equations without inequality.
    perturbation: Vec<f64>,
    /// Factors by which the rows of M and q are multiplied, so that slacks and unknowns are of one size whatever their units; powers of
    /// two. They do not change the problem, only the meaning of a covering vector of ones.
    units: Vec<f64>,
    /// The zᵢ of the basis are those of the problem divided by these, so that columns are of one size as well; powers of two.
    columns: Vec<f64>,
    /// Values of M, its rows multiplied by `units` and its columns by `columns`.
    scaled: Vec<f64>,
    judge: Judge,
    /// Distances to bounds up to this one are rounding.
    zero: f64,
    tied: Vec<usize>,
    ray: Vec<f64>,
    has_ray: bool,
    refactorisations: usize,
    fresh: bool,
    /// Number of restarts of the path with another covering vector.
    turn: usize,
}

/// Largest number of such restarts.
const TURNS: usize = 4;

impl Lemke {
    /// A solver with the given options.
    #[must_use]
    pub fn new(options: LemkeOptions) -> Self {
        Self {
            options,
            ..Self::default()
        }
    }

    /// The z part of the direction of the ray on which the last path ended, scaled to largest entry 1.
    #[must_use]
    pub fn ray(&self) -> Option<&[f64]> {
        self.has_ray.then_some(&self.ray)
    }

    /// Solves the problem; `z` is overwritten by the solution or the end of the path. Its content before does
    /// not matter.
    ///
    /// # Errors
    /// [`InputError::Length`] for `z` or the covering vector, [`InputError::Option`] for
    /// a covering vector that is not positive or a label that is none, [`ComplementarityError::Unsuitable`]
    /// for more than 20 000 unknowns (where the block of those without bounds is singular, these count
    /// twice), or for a label where z at its bounds is no solution or the unknown has not just one bound.
    pub fn solve(&mut self, lcp: &Lcp, z: &mut [f64]) -> Result<LemkeReport, ComplementarityError> {
        self.solve_observed(lcp, z, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting each exchange to `observe`, which may stop the run; it then ends as [`Status::Interrupted`].
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_observed(
        &mut self,
        lcp: &Lcp,
        z: &mut [f64],
        mut observe: impl FnMut(&LemkePivot) -> ControlFlow<()>,
    ) -> Result<LemkeReport, ComplementarityError> {
        let n = lcp.len();
        self.check(lcp, z)?;
        self.scale(lcp);
        let limit = self.options.max_pivots.unwrap_or(50 * n + 1000);
        let mut pivots = 0;
        self.turn = 0;
        let status = loop {
            self.prepare(n);
            if !self.start(lcp)? {
                return self.solve_split(lcp, z, &mut observe);
            }
            let mut count = 0;
            let status = self.follow(lcp, limit, &mut count, &mut observe)?;
            pivots += count;
            // Ties with opposite bounds may cycle whatever the order of rows: another covering vector avoids them.
            let LemkeOptions {
                max_pivots,
                covering,
                label,
            } = &self.options;
            let chosen = covering.is_some() || max_pivots.is_some() || label.is_some();
            if status != Status::IterationLimit || chosen || self.turn == TURNS {
                break status;
            }
            self.turn += 1;
        };
        self.point(lcp, z);
        lcp.value(z, &mut self.work);
        let wrong = status == Status::Solved
            && !self.is_solution(lcp, z)
            && !self.is_solution_without_rounding(lcp, z);
        let mut report = LemkeReport {
            status: if wrong { Status::Inaccurate } else { status },
            pivots,
            refactorisations: self.refactorisations,
            residual: BoxLcp::from(lcp).natural_residual(z, &self.work),
        };
        if status == Status::Ray && self.proves_infeasibility(lcp) {
            report.status = Status::NoSolution;
        }
        Ok(report)
    }

    /// The units of rows, then of columns; 1 where all are of moderate size.
    fn scale(&mut self, lcp: &Lcp) {
        self.units.clear();
        self.units.resize(lcp.len(), 0.0);
        for (i, _, v) in lcp.matrix().triplets() {
            self.units[i] = self.units[i].max(v.abs());
        }
        for (unit, q) in self.units.iter_mut().zip(lcp.q()) {
            let size = if *unit == 0.0 { q.abs() } else { *unit };
            *unit = if size.is_normal() { size } else { 1.0 };
        }
        balance(&mut self.units);
        self.columns.clear();
        self.columns.resize(lcp.len(), 0.0);
        for (i, j, v) in lcp.matrix().triplets() {
            self.columns[j] = self.columns[j].max((v * self.units[i]).abs());
        }
        for size in self.columns.iter_mut().filter(|size| !size.is_normal()) {
            *size = 1.0;
        }
        balance(&mut self.columns);
        let values = lcp.matrix().triplets();
        self.scaled.clear();
        self.scaled
            .extend(values.map(|(i, j, v)| v * self.units[i] * self.columns[j]));
    }

    /// Entry k of the covering vector: the one chosen, or ones, spread by golden fractions in later turns.
    fn covering(&self, k: usize) -> f64 {
        match &self.options.covering {
            Some(d) => d[k] * self.units[k],
            None => 1.0 + golden(self.turn * (k + 1)),
        }
    }

    fn check(&self, lcp: &Lcp, z: &[f64]) -> Result<(), ComplementarityError> {
        let n = lcp.len();
        let length = |what, found| {
            ComplementarityError::Input(InputError::Length {
                what,
                expected: n,
                found,
            })
        };
        if z.len() != n {
            return Err(length("the point", z.len()));
        }
        if n > MAX_ORDER {
            return Err(ComplementarityError::Unsuitable {
                method: "Lemke's method",
                reason: format!("its dense inverse for {n} unknowns would not fit; use an active-set method"),
            });
        }
        let label = self.options.label.unwrap_or(0);
        check_options(&[(
            "label",
            label as f64,
            label < n,
            "the number of an unknown, from 0",
        )])?;
        let Some(d) = &self.options.covering else {
            return Ok(());
        };
        if d.len() != n {
            return Err(length("the covering vector", d.len()));
        }
        let range = "finite and positive in every entry";
        let checks = d
            .iter()
            .map(|&d| ("covering", d, d > 0.0 && d.is_finite(), range));
        Ok(check_options(&checks.collect::<Vec<_>>())?)
    }

    fn prepare(&mut self, n: usize) {
        self.basis.reset(n);
        self.side.clear();
        self.basic.clear();
        for v in [
            &mut self.value,
            &mut self.entering,
            &mut self.rate,
            &mut self.cover,
            &mut self.rhs,
            &mut self.work,
            &mut self.perturbation,
            &mut self.ray,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.tied.clear();
        self.tied.reserve(n);
        self.has_ray = false;
        self.refactorisations = 0;
        self.fresh = true;
    }

    /// The basis of all wᵢ, with the zᵢ that have no bounds in place of theirs; `false` where it is singular.
    fn start(&mut self, lcp: &Lcp) -> Result<bool, ComplementarityError> {
        let (lower, upper) = (lcp.lower(), lcp.upper());
        for i in 0..lcp.len() {
            let side = match (lower[i].is_finite(), upper[i].is_finite()) {
                (true, true) if lower[i] == upper[i] => Side::Fixed,
                (true, _) => Side::Lower,
                (false, true) => Side::Upper,
                (false, false) => Side::Free,
            };
            self.side.push(side);
            self.perturbation[i] = match side {
                Side::Lower => 1.0,
                Side::Upper => -1.0,
                Side::Free | Side::Fixed => 0.0,
            };
            self.basic.push(match side {
                Side::Free => Var::Point(i),
                _ => Var::Slack(i),
            });
        }
        if self.side.contains(&Side::Free) {
            match self.refactor(lcp) {
                Err(ComplementarityError::Linear(
                    LinearError::Singular { .. } | LinearError::Inaccurate { .. },
                )) => return Ok(false),
                result => result?,
            }
        }
        self.values(lcp);
        self.zero = ROUNDING * self.rhs.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        Ok(true)
    }

    /// Right-hand side q + Σ M_j z_j over the z_j at bounds, then the basic variables (without t in the basis, or with it).
    fn values(&mut self, lcp: &Lcp) {
        self.right_hand_side(lcp);
        self.basis.apply(&self.rhs, &mut self.value);
    }

    fn right_hand_side(&mut self, lcp: &Lcp) {
        self.rhs.copy_from_slice(lcp.q());
        self.resting(lcp);
        lcp.matrix().as_ref().mul_add(1.0, &self.work, &mut self.rhs);
        self.rhs.iter_mut().zip(&self.units).for_each(|(v, u)| *v *= u);
    }

    /// Writes z with zeros at the basic positions into `work`.
    fn resting(&mut self, lcp: &Lcp) {
        for i in 0..lcp.len() {
            self.work[i] = match self.side[i] {
                Side::Lower | Side::Fixed => lcp.lower()[i],
                Side::Upper => lcp.upper()[i],
                Side::Free => 0.0,
            };
        }
        for var in &self.basic {
            if let Var::Point(i) = *var {
                self.work[i] = 0.0;
            }
        }
    }

    fn follow(
        &mut self,
        lcp: &Lcp,
        limit: usize,
        pivots: &mut usize,
        observe: &mut dyn FnMut(&LemkePivot) -> ControlFlow<()>,
    ) -> Result<Status, ComplementarityError> {
        let mut at_upper = false;
        let mut leaving = match self.options.label {
            Some(label) => self.check_label(lcp, label)?,
            None => {
                let Some(slot) = self.enter_cover() else {
                    return Ok(Status::Solved);
                };
                let leaving = self.basic[slot];
                self.exchange(slot, Var::Cover);
                *pivots = 1;
                leaving
            }
        };
        let unit = match self.options.covering {
            Some(_) => 1.0,
            None => self.units.iter().fold(0.0_f64, |m, u| m.max(*u)),
        };
        self.fresh = false;
        loop {
            let (entering, direction) = self.complement(leaving, at_upper);
            if pivots.is_multiple_of(CHECK_EVERY) && !self.verify(lcp)? {
                return Ok(Status::Inaccurate);
            }
            if *pivots >= limit {
                return Ok(Status::IterationLimit);
            }
            let cover = self.basic.iter().position(|v| *v == Var::Cover);
            let pivot = LemkePivot {
                index: *pivots,
                path: self.turn,
                cover: cover.map_or(0.0, |slot| self.value[slot]) / unit,
            };
            if observe(&pivot).is_break() {
                return Ok(Status::Interrupted);
            }
            self.column(lcp, entering);
            *pivots += 1;
            match self.ratio_test(lcp, entering, direction) {
                Block::Nothing => {
                    if !self.fresh {
                        // A ray is claimed only with a recomputed inverse.
                        self.refactor(lcp)?;
                        self.values(lcp);
                        *pivots -= 1;
                        continue;
                    }
                    self.record_ray(entering, direction);
                    return Ok(Status::Ray);
                }
                Block::Flip { step } => {
                    self.advance(step, direction);
                    let Var::Point(i) = entering else {
                        return Ok(Status::Inaccurate);
                    };
                    at_upper = direction > 0.0;
                    self.side[i] = if at_upper { Side::Upper } else { Side::Lower };
                    leaving = entering;
                }
                Block::Slot {
                    slot: k,
                    step,
                    at_upper: upper,
                } => {
                    at_upper = upper;
                    leaving = self.basic[k];
                    let from = self.position(lcp, entering);
                    self.advance(step, direction);
                    self.value[k] = from + direction * step;
                    if let Var::Point(i) = leaving {
                        self.side[i] = if at_upper { Side::Upper } else { Side::Lower };
                    }
                    self.exchange(k, entering);
                    self.fresh = false;
                    if self.is_last(leaving) {
                        return self.finish(lcp);
                    }
                }
            }
        }
    }

    /// Makes t basic in the slot with the largest violation; `None` when no bound is violated.
    fn enter_cover(&mut self) -> Option<usize> {
        let n = self.basic.len();
        for k in 0..n {
            let d = self.covering(k);
            // B⁻¹ times the column of t: the basic variables grow by d an unit of t.
            self.entering[k] = match (self.basic[k], self.side[k]) {
                (Var::Slack(_), Side::Lower) => -d,
                (Var::Slack(_), Side::Upper) => d,
                _ => 0.0,
            };
        }
        let mut worst = 0.0;
        let mut slot = None;
        for k in 0..n {
            let c = self.entering[k];
            if c == 0.0 {
                continue;
            }
            let needed = self.value[k] / c;
            let first = match slot {
                // Equal violations: the lexicographically smaller row counts as the larger one.
                Some(p) if needed == worst => self.lexicographically_less((k, -c), (p, -self.entering[p])),
                _ => needed > worst,
            };
            if first {
                worst = needed;
                slot = Some(k);
            }
        }
        let slot = slot?;
        // The column itself, for later factorisations: −B d̂ (slack columns are unit vectors).
        self.cover.fill(0.0);
        for k in 0..n {
            if let Var::Slack(i) = self.basic[k] {
                self.cover[i] = self.entering[k];
            }
            if k != slot {
                self.value[k] -= worst * self.entering[k];
            }
        }
        self.value[slot] = worst;
        Some(slot)
    }

    fn exchange(&mut self, slot: usize, entering: Var) {
        self.basis.exchange(slot, &self.entering);
        self.basic[slot] = entering;
    }

    /// The variable that enters after `leaving` left at its lower or upper bound, and whether it grows or falls.
    fn complement(&self, leaving: Var, at_upper: bool) -> (Var, f64) {
        match leaving {
            Var::Slack(i) if self.side[i] == Side::Upper => (Var::Point(i), -1.0),
            Var::Slack(i) => (Var::Point(i), 1.0),
            Var::Point(i) if at_upper => (Var::Slack(i), -1.0),
            Var::Point(i) => (Var::Slack(i), 1.0),
            Var::Cover => (Var::Cover, 1.0),
        }
    }

    /// The value of a variable that is about to enter.
    fn position(&self, lcp: &Lcp, var: Var) -> f64 {
        match var {
            Var::Point(i) if self.side[i] == Side::Upper => lcp.upper()[i] / self.columns[i],
            Var::Point(i) => lcp.lower()[i] / self.columns[i],
            _ => 0.0,
        }
    }

    /// B⁻¹ times the column of `var`.
    fn column(&mut self, lcp: &Lcp, var: Var) {
        match var {
            Var::Slack(i) => self.basis.column(i, 1.0, &mut self.entering),
            Var::Point(i) => {
                let pattern = lcp.matrix().pattern();
                let span = pattern.col_ptr()[i]..pattern.col_ptr()[i + 1];
                let values = &self.scaled[span.clone()];
                if values.len() == self.rhs.len() {
                    self.basis.apply(values, &mut self.entering);
                    self.entering.iter_mut().for_each(|v| *v = -*v);
                } else {
                    let rows = &pattern.row_idx()[span];
                    self.basis.apply_sparse(rows, values, -1.0, &mut self.entering);
                }
            }
            Var::Cover => self.basis.apply(&self.cover, &mut self.entering),
        }
    }

    fn bounds(&self, lcp: &Lcp, var: Var) -> (f64, f64) {
        match var {
            Var::Point(i) => (lcp.lower()[i] / self.columns[i], lcp.upper()[i] / self.columns[i]),
            Var::Cover => (0.0, f64::INFINITY),
            Var::Slack(i) => match self.side[i] {
                Side::Upper => (f64::NEG_INFINITY, 0.0),
                Side::Fixed => (f64::NEG_INFINITY, f64::INFINITY),
                _ => (0.0, f64::INFINITY),
            },
        }
    }

    fn advance(&mut self, step: f64, direction: f64) {
        let length = direction * step;
        for (v, y) in self.value.iter_mut().zip(&self.entering) {
            *v -= length * y;
        }
    }
}

/// Turns sizes into factors; 1 where all are of moderate size.
fn balance(sizes: &mut [f64]) {
    const LARGEST: f64 = 1000.0;
    match sizes.iter().all(|size| is_ordinary(*size)) {
        true => sizes.fill(1.0),
        false => sizes
            .iter_mut()
            .for_each(|size| *size = (-size.log2().round()).clamp(-LARGEST, LARGEST).exp2()),
    }
}

#[cfg(test)]
mod tests;
