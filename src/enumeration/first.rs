//! What Newton's method finds before any search: a list that ends at a limit begins with it.

use std::collections::BTreeSet;

use super::EnumerationOptions;
use super::lists::NAMED;
use crate::clock::Deadline;
use crate::linear::{AutoSolver, LinearSolver};
use crate::piecewise::{ActiveSet, PiecewiseSmooth, Scaled, ScaledMap, Selection, TestLayout, cell_margin};
use crate::sparse::{Matrix, max_abs};
use crate::spread::Random;

/// Starts: the origin and random points near it, in the units of the map; steps from each, and those among
/// them that are singular, which cost more: a search of a few nodes takes as long. Which lists begin with a
/// solution is held by `polyhedra::lists_that_end_at_a_limit_begin_with_a_solution`.
const STARTS: usize = 3;
const STEPS: usize = 50;
const SINGULAR: usize = 10;

/// Newton's method for a piecewise-affine map: full steps from selection to selection; once one recurs, only
/// the first site at which the point leaves its cell changes (K. Murty, 1974).
struct Newton<'a> {
    map: &'a dyn PiecewiseSmooth,
    layout: TestLayout,
    x: Vec<f64>,
    theta: Vec<f64>,
    jac: Matrix,
    solver: AutoSolver,
    tolerance: f64,
    /// Singular steps since the start.
    singular: usize,
}

/// Selections in whose cells Newton's method ends, and with each those that are active there as well; nothing
/// is proven of them.
pub(super) fn first_selections(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Vec<Vec<Selection>> {
    let Ok(scaled) = Scaled::new(map, &[], (alpha, alpha)) else {
        return Vec::new();
    };
    let (m, n) = (scaled.num_vars(), scaled.num_residuals());
    let layout = TestLayout::new(&scaled);
    let mut newton = Newton {
        jac: Matrix::zeros(scaled.pattern()),
        x: vec![0.0; m],
        theta: vec![0.0; layout.total()],
        layout,
        solver: AutoSolver::new(),
        tolerance: options.tolerance,
        singular: 0,
        map: &scaled,
    };
    let mut random = Random::new(1);
    let mut found = Vec::new();
    for start in 0..STARTS {
        for x in &mut newton.x[..n] {
            *x = if start == 0 { 0.0 } else { random.symmetric() };
        }
        if m > n {
            newton.x[n] = alpha / scaled.parameter_size();
        }
        if let Some(selection) = newton.run(deadline) {
            found.push(newton.beside(selection));
            break;
        }
    }
    found
}

impl Newton<'_> {
    /// The selection in whose cell the iteration ends.
    fn run(&mut self, deadline: Deadline<'_>) -> Option<Selection> {
        self.singular = 0;
        self.map.test_functions(&self.x, &mut self.theta);
        let start = ActiveSet::from_tests(self.map, &self.layout, &self.theta, Vec::new());
        let mut selection = start.first().clone();
        let (mut seen, mut singly) = (BTreeSet::new(), false);
        for _ in 0..STEPS {
            if deadline.is_over() {
                return None;
            }
            if !seen.insert(selection.clone()) {
                if singly {
                    return None;
                }
                singly = true;
                seen.clear();
            }
            self.step(&selection)?;
            if !self.change(&mut selection, singly) {
                return Some(selection);
            }
        }
        None
    }

    /// The step to the solution of a selection, or where it is singular to a point nearby that has the least
    /// residual.
    fn step(&mut self, selection: &Selection) -> Option<()> {
        let n = self.map.num_residuals();
        self.jac.clear();
        self.map.jacobian(selection, &self.x, &mut self.jac);
        let mut d = vec![0.0; n];
        self.map.residual(selection, &self.x, &mut d);
        let finite = d.iter().chain(self.jac.values()).all(|v| v.is_finite());
        if !finite || self.jac.stray().is_some() {
            return None;
        }
        d.iter_mut().for_each(|v| *v = -*v);
        let square = self.jac.leading_columns(n);
        let solved = (self.solver.analyze(square.pattern))
            .and_then(|()| self.solver.factor(square))
            .and_then(|()| self.solver.solve_in_place(&mut d));
        if solved.is_err() {
            self.singular += 1;
            if self.singular > SINGULAR {
                return None;
            }
            d = self.least_squares(selection)?;
        }
        self.x.iter_mut().zip(&d).for_each(|(x, d)| *x += d);
        self.map.test_functions(&self.x, &mut self.theta);
        self.x.iter().all(|v| v.is_finite()).then_some(())
    }

    /// The step of least ‖J d + r‖² + δ² ‖d‖², δ = √ε ‖J‖.
    fn least_squares(&mut self, selection: &Selection) -> Option<Vec<f64>> {
        let n = self.map.num_residuals();
        let shift = f64::EPSILON.sqrt() * max_abs(self.jac.values());
        let mut entries: Vec<_> = (0..n).map(|k| (k, k, shift)).collect();
        entries.extend((n..2 * n).map(|k| (k, k, -shift)));
        for (i, j, v) in self.jac.triplets().filter(|t| t.1 < n) {
            entries.extend([(n + i, j, v), (j, n + i, v)]);
        }
        let system = Matrix::from_triplets(2 * n, 2 * n, &entries).ok()?;
        let mut right = vec![0.0; 2 * n];
        self.map.residual(selection, &self.x, &mut right[n..]);
        right.iter_mut().for_each(|v| *v = -*v);
        let mut solver = AutoSolver::new();
        solver.analyze(system.pattern().as_ref()).ok()?;
        solver.factor(system.as_ref()).ok()?;
        solver.solve_in_place(&mut right).ok()?;
        right.truncate(n);
        Some(right)
    }

    /// Moves to the pieces in whose cells the point lies, where it left those of the selection; `false` where
    /// it is in all of them.
    fn change(&self, selection: &mut Selection, singly: bool) -> bool {
        let slack = self.tolerance * (1.0 + max_abs(&self.x));
        let mut changed = false;
        for site in 0..self.layout.num_sites() {
            let tests = &self.theta[self.layout.range(site)];
            let margin = |piece: usize| cell_margin(self.map.cell(site, piece), tests);
            let own = selection.piece(site);
            if margin(own) >= -slack {
                continue;
            }
            let best = (0..self.map.num_pieces(site)).max_by(|a, b| margin(*a).total_cmp(&margin(*b)));
            if let Some(best) = best.filter(|b| *b != own) {
                selection.set(site, best);
                changed = true;
                if singly {
                    break;
                }
            }
        }
        changed
    }

    /// The selection, and others that are active within the tolerance.
    fn beside(&self, selection: Selection) -> Vec<Selection> {
        let slack = self.tolerance * (1.0 + max_abs(&self.x));
        let vanishing = (0..self.theta.len()).filter(|&k| self.theta[k].abs() <= slack);
        let active = ActiveSet::from_tests(self.map, &self.layout, &self.theta, vanishing.collect());
        std::iter::once(selection)
            .chain(active.selections().take(NAMED))
            .collect()
    }
}
