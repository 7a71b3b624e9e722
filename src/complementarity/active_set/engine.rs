use std::ops::ControlFlow;

use super::{ActiveSetIteration, ActiveSetOptions, ActiveSetReport, Exchange, Start};
use crate::complementarity::accuracy::{LARGEST, drop_rounding, point, unit};
use crate::complementarity::blocks::Blocks;
use crate::complementarity::columns::BoxLcp;
use crate::complementarity::problem::natural;
use crate::complementarity::{BoundState, ComplementarityError};
use crate::input::{check_length, check_vector};
use crate::judge::{Columns, Judge};
use crate::linear::{LinearError, Scaling};
use crate::run::Status;
use crate::tolerances::{CHECKED, SUM};

/// Relative accuracy asked of iterative solves while the sets still change much.
const COARSE: f64 = 5e-2;
/// A start is replaced by one from coarser problems if more than this part of the components still change after the first iteration.
const FAR: f64 = 0.02;
/// Block exchanges before single ones; triangular matrices need as many as unknowns, while the number of wrong signs falls slowly or not at
/// all.
const MORE_BLOCKS: usize = 100;
/// Further solves with sets that no longer change, where rounding left too much of the residual (a start far out).
const REFINEMENTS: usize = 5;
/// Largest ratio of the largest entries of two columns for which iterative solves measure unknowns in one unit: an error may exceed the
/// tolerance by as much.
const COMPARE: f64 = 30.0;

/// The reduced systems of one problem; see [`ReducedSolver`](super::ReducedSolver).
pub(super) trait Systems {
    fn load(&mut self) -> Result<(), ComplementarityError>;

    fn select(&mut self, free: &[bool]) -> Result<(), ComplementarityError>;

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError>;

    fn is_direct(&self) -> bool;

    fn coarse_start(&mut self, options: &ActiveSetOptions) -> Result<Option<Start>, ComplementarityError>;
}

/// The iterations of [`ActiveSetSolver`](super::ActiveSetSolver), with their memory.
#[derive(Debug, Clone)]
pub(super) struct Engine {
    options: ActiveSetOptions,
    states: Vec<BoundState>,
    next: Vec<BoundState>,
    ranking: Vec<(f64, usize)>,
    free: Vec<bool>,
    scale: Vec<f64>,
    blocks: Blocks,
    balance: Scaling,
    /// Units of the unknowns: those in which M is balanced; empty for 1, where systems are solved iteratively and columns are of similar
    /// size.
    units: Vec<f64>,
    /// Largest |z| of each block, in these units.
    sizes: Vec<f64>,
    /// The same for each unknown, in its unit.
    spread: Vec<f64>,
    judge: Judge,
    w: Vec<f64>,
    r: Vec<f64>,
    step: Vec<f64>,
    history: Vec<ActiveSetIteration>,
}

/// Which components are exchanged; see [`ActiveSetSolver`](super::ActiveSetSolver).
struct Rule {
    exchange: Exchange,
    /// Fewest components whose sets differed, and the number of iterations that added components since.
    fewest: usize,
    stagnant: usize,
    /// Whether the exchanges of the largest violations have begun, and how many are exchanged at most.
    restarted: bool,
    at_most: usize,
}

impl Default for Rule {
    fn default() -> Self {
        Self {
            exchange: Exchange::Block,
            fewest: usize::MAX,
            stagnant: 0,
            restarted: false,
            at_most: 1,
        }
    }
}

impl Engine {
    pub(super) fn new(options: ActiveSetOptions) -> Self {
        Self {
            options,
            states: Vec::new(),
            next: Vec::new(),
            ranking: Vec::new(),
            free: Vec::new(),
            scale: Vec::new(),
            blocks: Blocks::default(),
            balance: Scaling::default(),
            units: Vec::new(),
            sizes: Vec::new(),
            spread: Vec::new(),
            judge: Judge::default(),
            w: Vec::new(),
            r: Vec::new(),
            step: Vec::new(),
            history: Vec::new(),
        }
    }

    pub(super) fn states(&self) -> &[BoundState] {
        &self.states
    }

    pub(super) fn history(&self) -> &[ActiveSetIteration] {
        &self.history
    }

    /// Solves the problem from the start in `z`, from given sets if there are any.
    pub(super) fn solve(
        &mut self,
        lcp: BoxLcp<'_>,
        systems: &mut dyn Systems,
        z: &mut [f64],
        sets: Option<&[BoundState]>,
        observe: &mut dyn FnMut(&ActiveSetIteration) -> ControlFlow<()>,
    ) -> Result<ActiveSetReport, ComplementarityError> {
        self.options.validate()?;
        check_vector("the start", z, lcp.len())?;
        if let Some(sets) = sets {
            check_length("the array of sets", sets.len(), lcp.len())?;
        }
        systems.load()?;
        self.prepare(lcp, systems.is_direct());
        let status = match self.iterate(lcp, systems, z, sets, observe) {
            Ok(status) => status,
            Err(ComplementarityError::Linear(
                LinearError::Singular { .. } | LinearError::NotPositiveDefinite,
            )) => Status::Singular,
            Err(ComplementarityError::Linear(LinearError::Inaccurate { .. })) => Status::Inaccurate,
            Err(e) => return Err(e),
        };
        lcp.value(z, &mut self.w);
        Ok(ActiveSetReport {
            status,
            residual: lcp.natural_residual(z, &self.w),
            iterations: self.history.len(),
            linear_iterations: self.history.iter().map(|i| i.linear_iterations).sum(),
        })
    }

    /// Starts again from coarser problems, if there are any; returns whether there are.
    fn coarse_start(
        &mut self,
        lcp: BoxLcp<'_>,
        systems: &mut dyn Systems,
        z: &mut [f64],
    ) -> Result<bool, ComplementarityError> {
        let Some(start) = systems.coarse_start(&self.options)? else {
            return Ok(false);
        };
        z.copy_from_slice(&start.z);
        self.start_from(lcp, &start.states);
        lcp.value(z, &mut self.w);
        Ok(true)
    }

    /// Starts from given sets; components at a bound that they do not have count as free.
    fn start_from(&mut self, lcp: BoxLcp<'_>, sets: &[BoundState]) {
        for (i, next) in self.next.iter_mut().enumerate() {
            let (lower, upper) = (lcp.lower[i], lcp.upper[i]);
            *next = match sets[i] {
                BoundState::Upper if upper.is_finite() => BoundState::Upper,
                BoundState::Lower if lower.is_finite() => BoundState::Lower,
                _ if lower == upper => BoundState::Lower,
                _ => BoundState::Interior,
            };
        }
    }

    fn prepare(&mut self, lcp: BoxLcp<'_>, direct: bool) {
        let n = lcp.len();
        self.blocks.find(lcp.matrix, n);
        self.history.clear();
        self.ranking.reserve(n);
        for sets in [&mut self.states, &mut self.next] {
            sets.clear();
            sets.resize(n, BoundState::Interior);
        }
        self.free.resize(n, true);
        for v in [&mut self.scale, &mut self.w, &mut self.r, &mut self.step] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.units.clear();
        if let Columns::Long(a) = lcp.matrix
            && (direct || !columns_compare(lcp.matrix, n))
        {
            self.balance.resize(n);
            (self.balance).balance(a.pattern.col_ptr, a.pattern.row_idx, a.values);
            self.units.extend_from_slice(self.balance.col());
        }
        // Positive diagonals are the natural size of a row; largest entries stand in for others.
        let unit = |i| unit(&self.units, i);
        for j in 0..n {
            lcp.matrix.each(j, |i, v| {
                if i == j && v > 0.0 {
                    self.scale[i] = v;
                } else {
                    self.r[i] = (v.abs() * unit(j) / unit(i)).max(self.r[i]);
                }
            });
        }
        for (s, largest) in self.scale.iter_mut().zip(&self.r) {
            if *s <= 1e-3 * largest {
                *s = *largest;
            }
            if *s == 0.0 {
                *s = 1.0;
            }
        }
    }

    fn iterate(
        &mut self,
        lcp: BoxLcp<'_>,
        systems: &mut dyn Systems,
        z: &mut [f64],
        sets: Option<&[BoundState]>,
        observe: &mut dyn FnMut(&ActiveSetIteration) -> ControlFlow<()>,
    ) -> Result<Status, ComplementarityError> {
        let n = z.len();
        // A start so far out gives no information on the solution, and F may overflow there.
        if z.iter().any(|z| z.abs() > LARGEST) {
            lcp.nearest_to_zero(z);
        }
        lcp.value(z, &mut self.w);
        match sets {
            Some(sets) => {
                self.start_from(lcp, sets);
            }
            None => {
                self.guess(lcp, systems.is_direct(), z);
            }
        }
        let mut changes = n;
        let mut rule = Rule::default();
        let (mut residual, mut progress) = (f64::INFINITY, 1.0);
        let mut refinements = 0;
        // Starting from zero removes the rounding errors of much larger iterates.
        let (mut largest, mut afresh) = (self.size(z), false);
        let mut may_restart = sets.is_none();
        loop {
            if self.history.len() == self.options.max_iterations {
                return Ok(Status::IterationLimit);
            }
            if changes > 0 {
                self.states.copy_from_slice(&self.next);
                for i in 0..n {
                    self.free[i] = self.states[i] == BoundState::Interior;
                }
                systems.select(&self.free)?;
            }
            if std::mem::take(&mut afresh) {
                for (z, _) in z.iter_mut().zip(&self.free).filter(|(_, free)| **free) {
                    *z = 0.0;
                }
                lcp.value(z, &mut self.w);
            }
            let linear = self.newton_step(lcp, systems, z, changes, residual, progress)?;
            lcp.value(z, &mut self.w);
            let earlier = residual;
            residual = self.scaled_residual(lcp, z);
            progress = if earlier.is_finite() {
                residual / earlier
            } else {
                1.0
            };
            let iteration = ActiveSetIteration {
                residual: lcp.natural_residual(z, &self.w),
                changes,
                inactive: self.free.iter().filter(|f| **f).count(),
                linear_iterations: linear,
                exchange: rule.exchange,
            };
            self.history.push(iteration);
            if observe(&iteration).is_break() {
                return Ok(Status::Interrupted);
            }
            if !residual.is_finite() {
                return Ok(Status::Inaccurate);
            }
            let reached = self.size(z);
            if reached <= SUM * largest {
                (largest, afresh) = (0.0, true);
            }
            largest = largest.max(reached);
            let before = changes;
            changes = self.guess(lcp, systems.is_direct(), z);
            let direct = systems.is_direct();
            let settled = changes == 0 && direct;
            if settled || residual <= self.options.tolerance * self.size(z) {
                if let Some(status) = self.judge(lcp, z, direct, &mut refinements) {
                    return Ok(status);
                }
                if settled {
                    continue;
                }
            }
            let part = changes as f64 / n as f64;
            // A layer of a set in the plane has about √n components; to peel off one by one is slow. Along a line layers are single ones, and
            // what tells is that there is no end to them.
            let passed = self.history.len();
            let is_layer = passed > 3 && changes * changes > n || passed > self.options.patience;
            let peeling = is_layer && 2 * changes > before;
            // Where factors are cheap a first iteration tells less than the ones that follow.
            if may_restart && (part > FAR && !direct || peeling) {
                may_restart = false;
                if self.coarse_start(lcp, systems, z)? {
                    changes = n;
                    residual = f64::INFINITY;
                    continue;
                }
            }
            changes = self.exchange(&mut rule, lcp, z, direct, [before, changes]);
        }
    }

    /// Solved, or no more accurate after as many refinements as are worth while; `None`: another iteration refines the solution.
    fn judge(
        &mut self,
        lcp: BoxLcp<'_>,
        z: &mut [f64],
        direct: bool,
        refinements: &mut usize,
    ) -> Option<Status> {
        self.clamp(lcp, z);
        lcp.value(z, &mut self.w);
        if self.is_solution(lcp, direct, z) {
            return Some(Status::Solved);
        }
        *refinements += 1;
        (*refinements > REFINEMENTS).then(|| match self.is_solution_without_rounding(lcp, direct, z) {
            true => Status::Solved,
            false => Status::Inaccurate,
        })
    }

    /// Applies the exchange rule to the sets in `next`, of which `changes` components differ from the current ones, `before` an iteration
    /// ago; returns how many are exchanged.
    fn exchange(
        &mut self,
        rule: &mut Rule,
        lcp: BoxLcp<'_>,
        z: &[f64],
        direct: bool,
        [before, changes]: [usize; 2],
    ) -> usize {
        if changes < rule.fewest {
            (rule.fewest, rule.stagnant) = (changes, 0);
        } else if self.adds() {
            // Releases alone cannot go on for ever, however few they are at a time.
            rule.stagnant += 1;
        }
        let patience = self.options.patience;
        rule.exchange = if !direct || rule.stagnant <= patience {
            Exchange::Block
        } else if rule.stagnant <= 3 * patience {
            Exchange::Largest
        } else if rule.stagnant <= 3 * patience + z.len().min(MORE_BLOCKS) {
            Exchange::Block
        } else {
            Exchange::Single
        };
        match rule.exchange {
            Exchange::Block => {}
            // The sets reached by block exchanges are no better than all components at bounds.
            Exchange::Largest if !rule.restarted => {
                rule.restarted = true;
                let bounds = lcp.lower.iter().zip(lcp.upper);
                for (next, (lower, upper)) in self.next.iter_mut().zip(bounds) {
                    *next = match (lower.is_finite(), upper.is_finite()) {
                        (true, _) => BoundState::Lower,
                        (false, true) => BoundState::Upper,
                        (false, false) => BoundState::Interior,
                    };
                }
                return z.len();
            }
            Exchange::Largest => {
                rule.at_most = if changes < before {
                    rule.at_most.saturating_mul(2)
                } else {
                    1
                };
                self.keep_largest(lcp, z, rule.at_most);
            }
            Exchange::Single => self.keep_one(),
        }
        changes
    }

    /// Moves the active components to their bounds and solves for the others; returns the number of iterations of the linear solver.
    fn newton_step(
        &mut self,
        lcp: BoxLcp<'_>,
        systems: &mut dyn Systems,
        z: &mut [f64],
        changes: usize,
        residual: f64,
        progress: f64,
    ) -> Result<usize, ComplementarityError> {
        for j in 0..z.len() {
            let bound = match self.states[j] {
                BoundState::Lower => lcp.lower[j],
                BoundState::Upper => lcp.upper[j],
                BoundState::Interior => continue,
            };
            let move_by = bound - z[j];
            if move_by != 0.0 {
                z[j] = bound;
                lcp.matrix.each(j, |i, v| self.w[i] += v * move_by);
            }
        }
        self.r.iter_mut().zip(&self.w).for_each(|(r, w)| *r = -*w);
        let goal = 0.3 * self.options.tolerance * self.size(z) / residual;
        // While sets change, accuracy is wasted: the forcing term is the square of the last progress (S. C. Eisenstat, H. F. Walker, 1996,
        // choice 2), which falls quickly as the sets settle.
        let tolerance = if !(residual.is_finite() && goal.is_finite()) {
            COARSE
        } else if changes == 0 {
            goal.clamp(CHECKED, COARSE)
        } else {
            (progress * progress).clamp(goal.clamp(CHECKED, COARSE), COARSE)
        };
        let count = systems.solve(&mut self.r, &mut self.step, tolerance)?;
        z.iter_mut().zip(&self.step).for_each(|(z, d)| *z += d);
        Ok(count)
    }

    /// Writes the sets that follow from `z` and `w` to `next`; returns how many components differ from the current sets.
    fn guess(&mut self, lcp: BoxLcp<'_>, direct: bool, z: &[f64]) -> usize {
        let (lower, upper) = (lcp.lower, lcp.upper);
        (self.blocks).largest(in_units(z, &self.units), &mut self.sizes);
        let mut changes = 0;
        for i in 0..z.len() {
            let rounding = SUM * self.sizes[self.blocks.of(i)] * unit(&self.units, i);
            let now = self.states[i];
            let reach = self.w[i] / self.scale[i];
            self.next[i] = if lower[i] == upper[i] {
                BoundState::Lower
            } else if direct && now != BoundState::Interior && reach.abs() <= rounding {
                // Degenerate: the component may stay where it is.
                now
            } else {
                // For exact solves one of the two terms is zero.
                let position = z[i] - reach;
                let slack = if now == BoundState::Interior {
                    rounding
                } else {
                    0.0
                };
                if position < lower[i] - slack || (position <= lower[i] && now == BoundState::Lower) {
                    BoundState::Lower
                } else if position > upper[i] + slack || (position >= upper[i] && now == BoundState::Upper) {
                    BoundState::Upper
                } else {
                    BoundState::Interior
                }
            };
            changes += usize::from(self.next[i] != now);
        }
        changes
    }

    /// Whether a component in `next` moves to a bound.
    fn adds(&self) -> bool {
        let moves = |(next, now): (&BoundState, &BoundState)| next != now && *next != BoundState::Interior;
        self.next.iter().zip(&self.states).any(moves)
    }

    /// Keeps only the last of the changes in `next` (Murty's rule, in the order from the end), one step between bounds at a time.
    fn keep_one(&mut self) {
        let last = (0..self.next.len())
            .rev()
            .find(|&i| self.next[i] != self.states[i]);
        let Some(last) = last else { return };
        self.next[..last].copy_from_slice(&self.states[..last]);
        if self.states[last] != BoundState::Interior {
            self.next[last] = BoundState::Interior;
        }
    }

    /// Keeps only the changes with the largest violations, measured so that scaling M and q by DMD, Dq does not matter; among equal
    /// ones those of the least indices.
    fn keep_largest(&mut self, lcp: BoxLcp<'_>, z: &[f64], at_most: usize) {
        self.ranking.clear();
        for i in 0..z.len() {
            let now = self.states[i];
            if self.next[i] == now {
                continue;
            }
            let violation = match now {
                BoundState::Interior => (lcp.lower[i] - z[i]).max(z[i] - lcp.upper[i]) * self.scale[i].sqrt(),
                _ => self.w[i].abs() / self.scale[i].sqrt(),
            };
            self.ranking.push((violation, i));
        }
        (self.ranking).sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(_, i) in self.ranking.iter().skip(at_most) {
            self.next[i] = self.states[i];
        }
    }

    /// The largest |z| in the units of the unknowns.
    fn size(&self, z: &[f64]) -> f64 {
        in_units(z, &self.units).fold(0.0_f64, f64::max)
    }

    /// maxᵢ |zᵢ − mid(lᵢ, uᵢ, zᵢ − wᵢ/mᵢ)| in the units of the unknowns.
    fn scaled_residual(&self, lcp: BoxLcp<'_>, z: &[f64]) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..z.len() {
            let r = natural(z[i], lcp.lower[i], lcp.upper[i], self.w[i] / self.scale[i]).abs()
                / unit(&self.units, i);
            if r > worst || r.is_nan() {
                worst = r;
            }
        }
        worst
    }

    /// Whether z, with w = M z + q already computed, is a solution; see [`ActiveSetOptions::tolerance`].
    fn is_solution(&mut self, lcp: BoxLcp<'_>, direct: bool, z: &[f64]) -> bool {
        let mut point = point(lcp, z, &self.w);
        let tolerance = self.options.tolerance;
        if self.judge.verdict(&point, tolerance).is_solved(tolerance) {
            return true;
        }
        // Direct solves are accurate row by row, iterative ones relative to a whole block.
        if direct {
            return false;
        }
        (self.blocks).largest(in_units(z, &self.units), &mut self.sizes);
        let size = |j: usize| self.sizes[self.blocks.of(j)] * unit(&self.units, j);
        self.spread.clear();
        self.spread.extend((0..z.len()).map(size));
        point.sizes = Some(&self.spread);
        self.judge.verdict(&point, tolerance).is_solved(tolerance)
    }

    /// Whether z without its rounding is a solution; otherwise z stays as it is.
    fn is_solution_without_rounding(&mut self, lcp: BoxLcp<'_>, direct: bool, z: &mut [f64]) -> bool {
        self.step.copy_from_slice(z);
        if drop_rounding(lcp, z) {
            lcp.value(z, &mut self.w);
            if self.is_solution(lcp, direct, z) {
                return true;
            }
            z.copy_from_slice(&self.step);
        }
        false
    }

    fn clamp(&self, lcp: BoxLcp<'_>, z: &mut [f64]) {
        for ((z, l), u) in z.iter_mut().zip(lcp.lower).zip(lcp.upper) {
            *z = z.max(*l).min(*u);
        }
    }
}

/// Whether the largest entries of columns are of similar size. Then balancing, which costs as much as many products with M, is not needed.
fn columns_compare(matrix: Columns<'_>, n: usize) -> bool {
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for j in 0..n {
        let mut largest = 0.0_f64;
        matrix.each(j, |_, v| largest = largest.max(v.abs()));
        if largest > 0.0 {
            least = least.min(largest);
            most = most.max(largest);
        }
    }
    most <= COMPARE * least
}

/// |z| in the units of the unknowns.
fn in_units(z: &[f64], units: &[f64]) -> impl Iterator<Item = f64> {
    z.iter().enumerate().map(|(i, z)| z.abs() / unit(units, i))
}
