//! Arms by local search: the directional problem H'(x; (ẏ, ±1)) = 0 as a piecewise-linear equation, solved from many selections.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;

use super::EnumerationError;
use crate::clock::Deadline;
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::{
    ActiveSet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, Vanishing,
};
use crate::sparse::Matrix;
use crate::sparse::norm;
use crate::spread::Random;
use crate::tolerances::TANGENTIAL;

/// Largest number of linear solves for one start.
pub(super) const SOLVES: usize = 100;

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
    newton: Directional<'a>,
    found: BTreeSet<Selection>,
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
        Ok(Self {
            newton: Directional::new(map, x, active, deadline)?,
            found: BTreeSet::new(),
        })
    }

    /// Solves from a selection and from all that differ at one site from one found, the last one found first; `false` at the cap on solves
    /// or time.
    fn explore(&mut self, start: Selection, rate: f64, max_solves: usize) -> Result<bool, EnumerationError> {
        let sites = self.newton.active.degenerate_sites();
        // A selection found, and how many sites and pieces of the next site remain.
        let mut finds: Vec<(Selection, usize, usize)> = Vec::new();
        let mut next = Some(start);
        loop {
            if let Some(mut selection) = next.take() {
                if self.newton.solves >= max_solves || self.newton.deadline.is_over() {
                    return Ok(false);
                }
                let stop = self.newton.solve(&mut selection, rate)?;
                if stop != NewtonStop::Nowhere && self.found.insert(selection.clone()) {
                    finds.push((selection, sites.len(), 0));
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
}

/// Newton's method on the directional problem H'(x; (ẏ, α̇)) = 0 with a given α̇: each iterate solves the linear problem of one selection,
/// and the next selection is the one into whose cell its direction points.
pub(crate) struct Directional<'a> {
    map: &'a dyn PiecewiseSmooth,
    x: &'a [f64],
    active: &'a ActiveSet,
    vanishing: VanishingTests,
    /// For each degenerate site the positions of its vanishing test functions.
    tests: Vec<Range<usize>>,
    jac: Matrix,
    solver: AutoSolver,
    direction: Vec<f64>,
    /// Derivatives of the vanishing test functions along the direction, relative to their gradients and to the direction.
    rates: Vec<f64>,
    solves: usize,
    deadline: Deadline<'a>,
}

/// Where Newton's method on the directional problem ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NewtonStop {
    /// At a selection with its direction in its cell.
    Arm,
    /// At a selection with a singular ∇_yH^(σ), which may have arms of its own.
    Singular,
    /// In a cycle, or at a limit.
    Nowhere,
}

impl<'a> Directional<'a> {
    pub(crate) fn new(
        map: &'a dyn PiecewiseSmooth,
        x: &'a [f64],
        active: &'a ActiveSet,
        deadline: Deadline<'a>,
    ) -> Result<Self, EnumerationError> {
        let jac = Matrix::zeros(map.pattern());
        let mut solver = AutoSolver::default();
        solver.analyze(jac.leading_columns(map.num_residuals()).pattern)?;
        let vanishing = VanishingTests::new(map, x, active);
        let of_site = |&(site, _): &(usize, Vec<usize>)| {
            let first = vanishing.common.partition_point(|v| v.site < site);
            first..vanishing.common.partition_point(|v| v.site <= site)
        };
        Ok(Self {
            tests: active.degenerate_sites().iter().map(of_site).collect(),
            vanishing,
            map,
            x,
            active,
            jac,
            solver,
            direction: Vec::new(),
            rates: Vec::new(),
            solves: 0,
            deadline,
        })
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

    /// Moves the selection to one that has its direction in its cell; once a selection recurs, only the first violated site changes its
    /// piece (Murty 1974).
    pub(crate) fn solve(
        &mut self,
        selection: &mut Selection,
        rate: f64,
    ) -> Result<NewtonStop, EnumerationError> {
        let mut seen = BTreeSet::new();
        let mut one_at_a_time = false;
        for _ in 0..SOLVES {
            if self.deadline.is_over() {
                break;
            }
            if !seen.insert(selection.clone()) {
                if one_at_a_time {
                    break;
                }
                one_at_a_time = true;
                seen.clear();
            }
            if !self.linear(selection, rate)? {
                return Ok(NewtonStop::Singular);
            }
            if !self.correct(selection, one_at_a_time) {
                return Ok(NewtonStop::Arm);
            }
        }
        Ok(NewtonStop::Nowhere)
    }

    /// Changes the selection to the pieces whose cells the direction enters; `false` if they are the present ones.
    fn correct(&mut self, selection: &mut Selection, only_one: bool) -> bool {
        let length = norm(&self.direction);
        let vanishing = self.vanishing.of(self.map, selection, self.x);
        let relative =
            |v: &Vanishing| v.rate(&self.direction) / (v.gradient_norm * length).max(f64::MIN_POSITIVE);
        self.rates.clear();
        self.rates.extend(vanishing.iter().map(relative));
        let mut changed = false;
        for ((site, pieces), tests) in self.active.degenerate_sites().iter().zip(&self.tests) {
            let margin = |piece: usize| -> f64 {
                let cell = self.map.cell(*site, piece);
                let known = vanishing[tests.clone()].iter().zip(&self.rates[tests.clone()]);
                let of_test = |(v, rate): (&Vanishing, &f64)| {
                    let facets = cell.iter().filter(|f| f.test() == v.test);
                    facets.fold(f64::INFINITY, |least, f| least.min(f.sign() * rate))
                };
                known.map(of_test).fold(f64::INFINITY, f64::min)
            };
            if margin(selection.piece(*site)) >= -TANGENTIAL {
                continue;
            }
            let best = pieces.iter().max_by(|a, b| margin(**a).total_cmp(&margin(**b)));
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
