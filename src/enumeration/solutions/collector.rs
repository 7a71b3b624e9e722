//! Solutions found selection by selection in floating-point numbers.

use crate::clock::Deadline;
use crate::enumeration::arms::level_selections;
use crate::enumeration::kernel::{AffineSet, MAX_KERNEL, solutions};
use crate::enumeration::lists::{Continuum, Extent, NAMED, Solution, SolutionSet};
use crate::enumeration::{EnumerationError, EnumerationOptions, system};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::{
    ActiveSet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, active_set,
    cell_margin,
};
use crate::sparse::{Matrix, dot, max_abs, norm};
use crate::tolerances::{DOUBTFUL, ROUNDING, SELECTIONS};

/// Part of the tolerance up to which a violated facet is taken for rounding in the solution.
const CLEAR: f64 = 1e-2;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rank {
    Full,
    Deficient,
}

/// Solves for single selections, verifies and collects their solutions.
pub(super) struct Collector<'a> {
    map: &'a dyn PiecewiseSmooth,
    options: &'a EnumerationOptions,
    layout: TestLayout,
    origin: Vec<f64>,
    probe: Vec<f64>,
    jac: Matrix,
    solver: AutoSolver,
    pub(super) solutions: Vec<Solution>,
    /// Whether a solution lies in the cell of one of its selections up to rounding, and not only by the tolerance.
    pub(super) clean: Vec<bool>,
    continua: Vec<Continuum>,
    extents: Vec<Option<Extent<Vec<f64>>>>,
    pub(super) undecided: u64,
}

impl<'a> Collector<'a> {
    pub(super) fn new(
        map: &'a dyn PiecewiseSmooth,
        origin: Vec<f64>,
        options: &'a EnumerationOptions,
    ) -> Result<Self, EnumerationError> {
        let jac = Matrix::zeros(map.pattern());
        let mut solver = AutoSolver::default();
        solver.analyze(jac.leading_columns(map.num_residuals()).pattern)?;
        Ok(Self {
            map,
            options,
            layout: TestLayout::new(map),
            probe: system::probe(&origin, map.num_residuals()),
            origin,
            jac,
            solver,
            solutions: Vec::new(),
            clean: Vec::new(),
            continua: Vec::new(),
            extents: Vec::new(),
            undecided: 0,
        })
    }

    pub(super) fn examine(&mut self, selection: &Selection) -> Result<(), EnumerationError> {
        let n = self.map.num_residuals();
        self.jac.clear();
        self.map.jacobian(selection, &self.origin, &mut self.jac);
        if let Some((row, col)) = self.jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col }.into());
        }
        let doubtful = match self.solver.factor(self.jac.leading_columns(n)) {
            Ok(()) => self.solver.rcond().is_some_and(|rcond| rcond < DOUBTFUL),
            Err(LinearError::Singular { .. }) => true,
            Err(e) => return Err(e.into()),
        };
        if doubtful {
            match self.singular(selection) {
                Rank::Deficient => return Ok(()),
                Rank::Full => {}
            }
        }
        let sign = self.solver.log_det().map(|d| d.0);
        let mut x = self.origin.clone();
        let mut r = vec![0.0; n];
        // The first solve is the solution; the others remove the rounding of approximate Jacobians.
        for _ in 0..3 {
            self.map.residual(selection, &x, &mut r);
            if self.solver.solve_in_place(&mut r).is_err() {
                self.undecided += 1;
                return Ok(());
            }
            for (x, d) in x.iter_mut().zip(&r) {
                *x -= d;
            }
        }
        // Test functions say nothing at infinity.
        if !x.iter().all(|v| v.is_finite()) {
            self.undecided += 1;
            return Ok(());
        }
        self.check_affine(selection, &x)?;
        if let Some(clean) = self.lies_in_cell(selection, &x) {
            self.add(selection, x, sign, clean);
        }
        Ok(())
    }

    /// An affine piece has no residual left after the solve, wherever its solution is.
    fn check_affine(&self, selection: &Selection, x: &[f64]) -> Result<(), EnumerationError> {
        let n = self.map.num_residuals();
        let (mut r, mut at_probe, mut base) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        self.map.residual(selection, x, &mut r);
        self.map.residual(selection, &self.probe, &mut at_probe);
        self.map.residual(selection, &self.origin, &mut base);
        let mut terms = vec![0.0; n];
        for (i, j, v) in self.jac.triplets().filter(|t| t.1 < n) {
            terms[i] += v.abs() * (x[j].abs() + self.probe[j].abs());
            at_probe[i] -= v * self.probe[j];
        }
        for i in 0..n {
            let size = terms[i] + base[i].abs();
            if r[i].abs() > 1e-7 * size || (at_probe[i] - base[i]).abs() > 1e-7 * size {
                return Err(EnumerationError::NotAffine {
                    what: format!("residual {i}"),
                });
            }
        }
        Ok(())
    }

    /// Whether all facets of the selection hold at x, within the tolerance as a distance; if so, whether they hold up to rounding.
    fn lies_in_cell(&self, selection: &Selection, x: &[f64]) -> Option<bool> {
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(x, &mut theta);
        let mut gradient = vec![0.0; x.len()];
        let mut clean = true;
        let inside = (0..self.layout.num_sites()).all(|site| {
            let tests = &theta[self.layout.range(site)];
            // A test function may vanish identically up to rounding, with its gradient.
            let rounding = ROUNDING * max_abs(tests);
            self.map.cell(site, selection.piece(site)).iter().all(|facet| {
                let margin = facet.margin(tests);
                margin >= -rounding || {
                    self.map.test_gradient(site, facet.test(), x, &mut gradient);
                    let size = norm(&gradient) * (1.0 + norm(x));
                    clean &= margin >= -CLEAR * self.options.tolerance * size;
                    margin >= -self.options.tolerance * size
                }
            })
        });
        inside.then_some(clean)
    }

    /// Where the solution of a selection lies in so many cells that the search would list them one by one: adds any other solutions of
    /// their selections, and returns the pieces of all these cells.
    pub(super) fn settle(
        &mut self,
        selection: &Selection,
        deadline: Deadline<'_>,
    ) -> Result<Option<Vec<Vec<usize>>>, EnumerationError> {
        let of = |s: &Solution| s.selections.last() == Some(selection);
        let Some(k) = self.solutions.iter().rposition(of) else {
            return Ok(None);
        };
        let x = self.solutions[k].x.clone();
        let active = self.active(&x);
        let count = active.degenerate_sites().iter().map(|s| s.1.len() as f64);
        let count: f64 = count.product();
        if count <= SELECTIONS as f64 || !active.contains(selection) || !active.outside().is_empty() {
            return Ok(None);
        }
        let level = level_selections(self.map, &x, &active, self.options.max_nodes, deadline);
        let Ok(Some(level)) = level else {
            return Ok(None);
        };
        if !level.complete {
            return Ok(None);
        }
        // Selections with a direction along which they remain solutions, and some of the others.
        for other in level
            .selections
            .iter()
            .cloned()
            .chain(active.selections().take(NAMED))
        {
            if deadline.is_over() {
                return Ok(None);
            }
            if other != *selection && !self.solutions[k].selections.contains(&other) {
                self.examine(&other)?;
            }
        }
        let s = &mut self.solutions[k];
        s.num_selections = s.num_selections.max(count);
        let pieces = (0..self.layout.num_sites()).map(|site| vec![active.first().piece(site)]);
        let mut pieces: Vec<Vec<usize>> = pieces.collect();
        for (site, several) in active.degenerate_sites() {
            pieces[*site].clone_from(several);
        }
        Ok(Some(pieces))
    }

    /// The selections in whose closed cells a point lies, by the measure of [`lies_in_cell`](Self::lies_in_cell).
    fn active(&self, x: &[f64]) -> ActiveSet {
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(x, &mut theta);
        let mut gradient = vec![0.0; x.len()];
        let vanishes = |k: &usize| {
            let (site, test) = self.layout.locate(*k);
            let rounding = ROUNDING * max_abs(&theta[self.layout.range(site)]);
            theta[*k].abs() <= rounding || {
                self.map.test_gradient(site, test, x, &mut gradient);
                theta[*k].abs() <= self.options.tolerance * norm(&gradient) * (1.0 + norm(x))
            }
        };
        let vanishing = (0..theta.len()).filter(vanishes).collect();
        ActiveSet::from_tests(self.map, &self.layout, &theta, vanishing)
    }

    /// Whether the point lies on a facet, up to rounding, and a regular selection from across has its solution elsewhere, which
    /// continuity forbids: the directions of the problem are so different in stiffness that rounding decides.
    pub(super) fn is_torn(&mut self, k: usize) -> bool {
        let solution = &self.solutions[k];
        if solution.margin > 0.0 {
            return false;
        }
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(&solution.x, &mut theta);
        let first = solution.selections[0].clone();
        let mut across = Vec::new();
        for site in 0..self.layout.num_sites() {
            let tests = &theta[self.layout.range(site)];
            let margin = |piece: usize| cell_margin(self.map.cell(site, piece), tests);
            let own = margin(first.piece(site));
            let known = |piece: usize| solution.selections.iter().any(|s| s.piece(site) == piece);
            let met = |piece: &usize| own <= 0.0 && margin(*piece) >= -own.abs() && !known(*piece);
            across.extend(
                (0..self.map.num_pieces(site))
                    .filter(met)
                    .map(|piece| (site, piece)),
            );
        }
        let x = solution.x.clone();
        let mut d = vec![0.0; self.map.num_residuals()];
        across.into_iter().any(|(site, piece)| {
            let mut other = first.clone();
            other.set(site, piece);
            self.jac.clear();
            self.map.jacobian(&other, &self.origin, &mut self.jac);
            let factored = self.solver.factor(self.jac.leading_columns(d.len()));
            if factored.is_err() || self.solver.rcond().is_some_and(|rcond| rcond < DOUBTFUL) {
                return false;
            }
            self.map.residual(&other, &x, &mut d);
            self.solver.solve_in_place(&mut d).is_err() || norm(&d) > self.reach(&x)
        })
    }

    fn margin(&self, selection: &Selection, x: &[f64]) -> f64 {
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(x, &mut theta);
        let margins = (0..self.layout.num_sites()).map(|site| {
            let cell = self.map.cell(site, selection.piece(site));
            cell_margin(cell, &theta[self.layout.range(site)])
        });
        margins.fold(f64::INFINITY, f64::min).max(0.0)
    }

    fn same(&self, a: &[f64], b: &[f64]) -> bool {
        let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        norm(&apart) <= self.reach(a)
    }

    /// Distance within which points are one.
    fn reach(&self, x: &[f64]) -> f64 {
        self.options.merge_distance * (1.0 + norm(x))
    }

    fn add(&mut self, selection: &Selection, x: Vec<f64>, sign: Option<i8>, clean: bool) {
        let margin = self.margin(selection, &x);
        let known = (0..self.solutions.len()).find(|&k| self.same(&self.solutions[k].x, &x));
        match known {
            Some(k) => {
                let s = &mut self.solutions[k];
                s.selections.push(selection.clone());
                s.det_signs.push(sign);
                s.num_selections = s.num_selections.max(s.selections.len() as f64);
                s.margin = s.margin.min(margin);
                self.clean[k] |= clean;
            }
            None => {
                self.clean.push(clean);
                self.solutions.push(Solution {
                    x,
                    selections: vec![selection.clone()],
                    num_selections: 1.0,
                    det_signs: vec![sign],
                    margin,
                    index: None,
                    continuum: None,
                });
            }
        }
    }

    /// A selection with a singular Jacobian: no solution, a segment, or a larger polyhedron.
    fn singular(&mut self, selection: &Selection) -> Rank {
        let n = self.map.num_residuals();
        if n > MAX_KERNEL {
            self.undecided += 1;
            return Rank::Deficient;
        }
        let mut r = vec![0.0; n];
        self.map.residual(selection, &self.origin, &mut r);
        let mut rows: Vec<Vec<f64>> = r
            .into_iter()
            .map(|c| {
                let mut row = vec![0.0; n + 1];
                row[n] = c;
                row
            })
            .collect();
        for (i, j, v) in self.jac.triplets().filter(|t| t.1 < n) {
            rows[i][j] += v;
        }
        let Some(set) = solutions(rows, n) else {
            return Rank::Deficient;
        };
        match set.kernel.as_slice() {
            [] => return Rank::Full,
            [direction] => self.segment(selection, &set, direction),
            _ => {
                self.continua.push(Continuum {
                    selections: vec![selection.clone()],
                    dimension: set.kernel.len(),
                    point: Vec::new(),
                    ends: Vec::new(),
                    directions: Vec::new(),
                    described: false,
                });
                self.extents.push(None);
            }
        }
        Rank::Deficient
    }

    /// The part of the line y + t d that lies in the cell.
    fn segment(&mut self, selection: &Selection, set: &AffineSet, direction: &[f64]) {
        let at = |t: f64| -> Vec<f64> {
            let mut x = self.origin.clone();
            for (x, (p, d)) in x.iter_mut().zip(set.point.iter().zip(direction)) {
                *x = p + t * d;
            }
            x
        };
        let total = self.layout.total();
        let (mut here, mut there) = (vec![0.0; total], vec![0.0; total]);
        self.map.test_functions(&at(0.0), &mut here);
        self.map.test_functions(&at(1.0), &mut there);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for site in 0..self.layout.num_sites() {
            let range = self.layout.range(site);
            for facet in self.map.cell(site, selection.piece(site)) {
                let (a, b) = (
                    facet.margin(&here[range.clone()]),
                    facet.margin(&there[range.clone()]),
                );
                let (rate, slack) = (b - a, self.options.tolerance * (a.abs() + b.abs()));
                if rate.abs() <= slack {
                    if a < -1e3 * slack.max(f64::EPSILON) {
                        return;
                    }
                } else if rate > 0.0 {
                    low = low.max(-a / rate);
                } else {
                    high = high.min(-a / rate);
                }
            }
        }
        let rounding = self.reach(&set.point) / norm(direction);
        if low > high + rounding {
            return;
        }
        if high - low <= rounding {
            let x = at(0.5 * (low + high));
            return self.add(selection, x, Some(0), true);
        }
        let square: f64 = direction.iter().map(|d| d * d).sum();
        let foot = -dot(&set.point, direction) / square;
        // At a distance of 1 + ‖x‖ from an end x, or from the point x nearest to the origin.
        let away = |t: f64, way: f64| at(t + way * (1.0 + norm(&at(t))) / square.sqrt());
        let beyond = match (low.is_finite(), high.is_finite()) {
            (true, true) => Vec::new(),
            (true, false) => vec![away(low, 1.0)],
            (false, true) => vec![away(high, -1.0)],
            (false, false) => vec![away(foot, 1.0), away(foot, -1.0)],
        };
        let ends = [low, high].into_iter().filter(|t| t.is_finite()).map(at);
        let extent = Extent {
            ends: ends.collect(),
            beyond,
        };
        let unit = max_abs(direction);
        let turned = |sign: f64| -> Vec<f64> { direction.iter().map(|d| sign * d / unit).collect() };
        let ways = [(high, 1.0), (low, -1.0)]
            .into_iter()
            .filter(|w| w.0.is_infinite());
        let directions = ways.map(|w| turned(w.1)).collect();
        let agrees = |other: &Option<Extent<Vec<f64>>>| {
            let other = other.as_ref();
            other.is_some_and(|other| extent.agrees(other, |a, b| self.same(a, b)))
        };
        match self.extents.iter().position(agrees) {
            Some(k) => self.continua[k].selections.push(selection.clone()),
            None => {
                self.continua.push(Continuum {
                    selections: vec![selection.clone()],
                    dimension: 1,
                    point: match extent.beyond.first() {
                        Some(beyond) => beyond.clone(),
                        None => at(0.5 * (low + high)),
                    },
                    ends: extent.ends.clone(),
                    directions,
                    described: true,
                });
                self.extents.push(Some(extent));
            }
        }
    }

    /// Orders the list and finds the local indices, as far as time allows.
    pub(super) fn finish(mut self, set: &mut SolutionSet, deadline: Deadline<'_>) {
        for s in &mut self.solutions {
            s.sort();
            s.find_index();
            // Other active selections that do not determine a single point leave the solution without an index.
            let tolerance = self.options.merge_distance * s.x.iter().fold(1.0f64, |m, v| m.max(v.abs()));
            let all = |_: &i8| {
                !deadline.is_over()
                    && active_set(self.map, &s.x, tolerance).total() == Some(s.selections.len() as u128)
            };
            s.index = s.index.filter(all);
        }
        self.solutions.sort_by(|a, b| a.selections.cmp(&b.selections));
        set.solutions = self.solutions;
        set.continua = self.continua;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::complementarity::Mcp;

    /// 0 y₀ = 0 beside y_k = 0: a selection that is singular, and too large for its kernel to be found, leaves the list incomplete.
    #[test]
    fn large_singular_selections_are_undecided() {
        let n = MAX_KERNEL + 1;
        let entries: Vec<_> = (1..n).map(|k| (k, k, 1.0)).collect();
        let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
        let free = [f64::NEG_INFINITY, f64::INFINITY].map(|bound| vec![bound; n]);
        let [lower, upper] = free;
        let map = Mcp::affine(matrix, vec![0.0; n], lower, upper).unwrap();
        let options = EnumerationOptions::default();
        let mut collector = Collector::new(&map, vec![0.0; n], &options).unwrap();
        let selection = Selection::uniform(collector.layout.num_sites(), 0);
        collector.examine(&selection).unwrap();
        assert_eq!(collector.undecided, 1);
        assert!(collector.solutions.is_empty() && collector.continua.is_empty());
    }
}
