//! Arms by local search: the directional problem H'(x; (ẏ, ±1)) = 0 as a piecewise-linear equation, solved from many selections.

use std::borrow::Cow;
use std::collections::BTreeSet;

use super::EnumerationError;
use crate::clock::Deadline;
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::{ActiveSet, PiecewiseError, PiecewiseSmooth, Selection, TestLayout, Vanishing};
use crate::sparse::Matrix;
use crate::sparse::norm;
use crate::spread::Random;

/// Largest number of linear solves for one start.
const SOLVES: usize = 100;
/// Rate of a test function, relative to its gradient and the direction, that counts as zero.
const TANGENTIAL: f64 = 1e-9;

/// Selections that may have arms at a point with too many degenerate sites for a complete search: those at which Newton's method on
/// the directional problem stops, and singular ones among its iterates. It starts from `starts` random selections for either sign of α̇,
/// and from all that differ from one found at one site, at most `starts` times the number of sites.
pub(crate) fn local_selections(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    starts: usize,
    max_solves: usize,
    deadline: Deadline<'_>,
) -> Result<Vec<Selection>, EnumerationError> {
    let mut local = Local::new(map, x, active, deadline)?;
    let mut random = Random::new(1);
    let sites = active.degenerate_sites();
    for k in 0..starts {
        let mut start = active.first().clone();
        for (site, pieces) in sites {
            // The first start takes the first piece everywhere.
            let piece = if k == 0 { 0 } else { random.below(pieces.len()) };
            start.set(*site, pieces[piece]);
        }
        for sign in [1.0, -1.0] {
            if !local.explore(start.clone(), sign, max_solves)? {
                return Ok(local.found.into_iter().collect());
            }
        }
    }
    Ok(local.found.into_iter().collect())
}

struct Local<'a> {
    map: &'a dyn PiecewiseSmooth,
    x: &'a [f64],
    active: &'a ActiveSet,
    vanishing: VanishingTests,
    jac: Matrix,
    solver: AutoSolver,
    direction: Vec<f64>,
    found: BTreeSet<Selection>,
    solves: usize,
    deadline: Deadline<'a>,
}

/// The vanishing test functions of an active set, with their gradients.
pub(super) struct VanishingTests {
    layout: TestLayout,
    common: Vec<Vanishing>,
}

impl VanishingTests {
    pub(super) fn new(map: &dyn PiecewiseSmooth, x: &[f64], active: &ActiveSet) -> Self {
        let layout = TestLayout::new(map);
        let indices = active.vanishing().iter();
        let of = |&k: &usize| Vanishing::new(map, &layout, active.first(), k, x);
        Self {
            common: indices.map(of).collect(),
            layout,
        }
    }

    /// As those of a selection, on which they depend where kinks are nested.
    pub(super) fn of(
        &self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        x: &[f64],
    ) -> Cow<'_, [Vanishing]> {
        if !map.has_nested_kinks() {
            return Cow::Borrowed(&self.common);
        }
        let own = |v: &Vanishing| v.of_selection(map, &self.layout, selection, x);
        Cow::Owned(self.common.iter().map(own).collect())
    }
}

impl<'a> Local<'a> {
    fn new(
        map: &'a dyn PiecewiseSmooth,
        x: &'a [f64],
        active: &'a ActiveSet,
        deadline: Deadline<'a>,
    ) -> Result<Self, EnumerationError> {
        let jac = Matrix::zeros(map.pattern());
        let mut solver = AutoSolver::default();
        solver.analyze(jac.leading_columns(map.num_residuals()).pattern)?;
        Ok(Self {
            vanishing: VanishingTests::new(map, x, active),
            map,
            x,
            active,
            jac,
            solver,
            direction: Vec::new(),
            found: BTreeSet::new(),
            solves: 0,
            deadline,
        })
    }

    /// Solves from a selection and from all that differ at one site from one found, the last one found first; `false` at the cap on solves
    /// or time.
    fn explore(&mut self, start: Selection, rate: f64, max_solves: usize) -> Result<bool, EnumerationError> {
        let sites = self.active.degenerate_sites();
        // A selection found, and how many sites and pieces of the next site remain.
        let mut finds: Vec<(Selection, usize, usize)> = Vec::new();
        let mut next = Some(start);
        loop {
            if let Some(selection) = next.take() {
                if self.solves >= max_solves || self.deadline.is_over() {
                    return Ok(false);
                }
                if let Some(found) = self.solve(selection, rate)? {
                    finds.push((found, sites.len(), 0));
                }
            }
            let Some((found, below, left)) = finds.last_mut() else {
                return Ok(true);
            };
            if *left == 0 {
                let Some(site) = below.checked_sub(1) else {
                    finds.pop();
                    continue;
                };
                (*below, *left) = (site, sites[site].1.len());
            }
            let (site, pieces) = &sites[*below];
            *left -= 1;
            if pieces[*left] != found.piece(*site) {
                let mut near = found.clone();
                near.set(*site, pieces[*left]);
                next = Some(near);
            }
        }
    }

    /// The direction of a selection with the given α̇; `false` where ∇_yH^(σ) is singular.
    fn linear(&mut self, selection: &Selection, rate: f64) -> Result<bool, EnumerationError> {
        let n = self.map.num_residuals();
        self.solves += 1;
        self.jac.clear();
        self.map.jacobian(selection, self.x, &mut self.jac);
        if let Some((row, col)) = self.jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col }.into());
        }
        self.direction.clear();
        self.direction.resize(n, 0.0);
        for (i, _, v) in self.jac.triplets().filter(|t| t.1 == n) {
            self.direction[i] -= rate * v;
        }
        let factored = self.solver.factor(self.jac.leading_columns(n));
        match factored.and_then(|()| self.solver.solve_in_place(&mut self.direction)) {
            Ok(()) => {
                self.direction.push(rate);
                Ok(true)
            }
            Err(LinearError::Singular { .. } | LinearError::Inaccurate { .. }) => Ok(false),
            Err(e) => Err(e.into()),
        }
    }

    /// Newton's method from a selection; once a selection recurs, only the first violated site changes its piece (Murty 1974).
    /// Returns a selection that has its direction in its cell, if it is new.
    fn solve(&mut self, start: Selection, rate: f64) -> Result<Option<Selection>, EnumerationError> {
        let mut selection = start;
        let mut seen = BTreeSet::new();
        let mut one_at_a_time = false;
        for _ in 0..SOLVES {
            if self.deadline.is_over() {
                return Ok(None);
            }
            if !seen.insert(selection.clone()) {
                if one_at_a_time {
                    return Ok(None);
                }
                one_at_a_time = true;
                seen.clear();
            }
            if !self.linear(&selection, rate)? {
                let new = self.found.insert(selection.clone());
                return Ok(new.then_some(selection));
            }
            if !self.correct(&mut selection, one_at_a_time) {
                let new = self.found.insert(selection.clone());
                return Ok(new.then_some(selection));
            }
        }
        Ok(None)
    }

    /// Changes the selection to the pieces whose cells the direction enters; `false` if they are the present ones.
    fn correct(&self, selection: &mut Selection, only_one: bool) -> bool {
        let length = norm(&self.direction);
        let vanishing = self.vanishing.of(self.map, selection, self.x);
        let margin = |site: usize, piece: usize| -> f64 {
            let mut least = f64::INFINITY;
            for v in vanishing.iter().filter(|v| v.site == site) {
                let rate = v.rate(&self.direction);
                for facet in self.map.cell(site, piece).iter().filter(|f| f.test() == v.test) {
                    least =
                        least.min(facet.sign() * rate / (v.gradient_norm * length).max(f64::MIN_POSITIVE));
                }
            }
            least
        };
        let mut changed = false;
        for (site, pieces) in self.active.degenerate_sites() {
            if margin(*site, selection.piece(*site)) >= -TANGENTIAL {
                continue;
            }
            let best = pieces
                .iter()
                .max_by(|a, b| margin(*site, **a).total_cmp(&margin(*site, **b)));
            if let Some(&piece) = best.filter(|p| **p != selection.piece(*site)) {
                selection.set(*site, piece);
                changed = true;
                if only_one {
                    break;
                }
            }
        }
        changed
    }
}
