//! Proven lists of solutions: all decisions by error bounds where these suffice, and in exact arithmetic where not.

mod continua;

use std::collections::BTreeSet;

use super::certificate::Certificates;
use super::contradiction::{Comparison, doubt_contradictions};
use super::enclosure::Enclosure;
use super::exhaustive::{self, Budget, ExactPoint};
use super::first::first_selections;
use super::lists::{Completeness, Continuum, Doubt, Extent, NAMED, Solution, SolutionSet};
use super::near;
use super::per_selection::{SelectionSolutions, decide};
use super::reduced::{reduced_directions, reduced_solutions};
use super::refutation::multipliers;
use super::search::SelectionSearch;
use super::shape::Shape;
use super::stated::{Beyond, Stated};
use super::{EnumerationError, EnumerationOptions};
use crate::clock::Deadline;
use crate::exact::Exact;
use crate::piecewise::{
    ExactConditions, ExactForm, PiecewiseSmooth, Selection, Selections, TestLayout, cell_margin,
};
use crate::tolerances::SELECTIONS;

/// Number of selections found beyond which each one is tested for a point that many of them share.
const MANY: usize = 32;
/// Number of negative tests after which no other is made.
const ATTEMPTS: usize = 4;

/// All solutions at a parameter of a map that gives exact conditions.
pub(super) fn proven_solutions(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    conditions: &ExactConditions,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Result<SolutionSet, EnumerationError> {
    let stated = Stated::new(conditions);
    let mut budget = Budget::new(options, deadline);
    let known = map.num_residuals();
    let parameter = (map.num_vars() > known).then_some(alpha);
    let mut gathered = Gathered::new(known, parameter, conditions, &stated, deadline);
    let (first, begun) = gathered.begin(map, alpha, options);
    let mut settle = |pieces: &[usize], budget: &mut Budget| gathered.settle(pieces, options, budget);
    // The unknowns may have no given bounds, while others of the same problem have some.
    let reduced = (!stated.bounded && exhaustive::elimination(conditions) <= exhaustive::MAX_WORK)
        .then(|| reduced_solutions(conditions, deadline))
        .flatten();
    let other = reduced.as_ref().map(Stated::new);
    let bounds = other.as_ref().unwrap_or(&stated);
    let mut found = Candidates::of(conditions, bounds, options, deadline, &mut budget, &mut settle);
    found.nodes += gathered.searched.0;
    found.pivots += gathered.searched.1;
    let settled = std::mem::take(&mut gathered.settled);
    let inside = |active: &Pieces, pieces: &[usize]| active.iter().zip(pieces).all(|(a, p)| a.contains(p));
    found
        .selections
        .retain(|pieces| !settled.iter().any(|active| inside(active, pieces)));
    // What the search has not reached counts as well.
    if let (Some(Completeness::Incomplete { examined, .. }), Some(pieces)) = (&mut found.incomplete, &begun)
        && !found.selections.contains(pieces)
        && !settled.iter().any(|active| inside(active, pieces))
    {
        *examined += 1.0;
    }
    for pieces in found.selections.iter().filter(|p| !first.contains(*p)) {
        let examined = !deadline.is_over() && gathered.examine(pieces, &mut budget);
        found.open += u64::from(!examined);
    }
    gathered.sharpen(&mut budget);
    gathered.drop_faces();
    gathered.drop_points_of_continua();
    let open = found.open + gathered.disagreeing();
    let completeness = match found.incomplete {
        Some(incomplete) => incomplete,
        None if open == 0 => Completeness::Complete,
        None => Completeness::Undecided {
            selections: open,
            doubt: if found.open > 0 {
                Doubt::Limit
            } else {
                Doubt::Discontinuous
            },
        },
    };
    let mut set = SolutionSet {
        solutions: Vec::new(),
        continua: Vec::new(),
        index_sum: None,
        completeness,
        nodes: found.nodes,
        pivots: found.pivots,
    };
    gathered.finish(map, &mut set);
    let units = stated.scaling.unscaled(&vec![1.0; conditions.unknowns]);
    doubt_contradictions(Comparison::new(map, units), &mut set, deadline);
    Ok(set)
}

/// A box of selections: the pieces of each site.
type Pieces = Vec<Vec<usize>>;

/// Selections that may hold solutions.
#[derive(Default)]
pub(super) struct Candidates {
    pub(super) selections: BTreeSet<Vec<usize>>,
    incomplete: Option<Completeness>,
    /// Partial selections that were neither searched nor excluded.
    open: u64,
    /// Whether error bounds were valid everywhere: no solution lies beyond the radii of the search.
    pub(super) bounded: bool,
    pub(super) nodes: u64,
    pivots: u64,
}

impl Candidates {
    /// Those given, and no others.
    pub(super) fn listed(selections: BTreeSet<Vec<usize>>) -> Self {
        Self {
            nodes: selections.len() as u64,
            selections,
            ..Self::default()
        }
    }

    /// Those of a completed search in the unknowns of `reduced`, the same conditions in few unknowns.
    pub(super) fn complete(
        conditions: &ExactConditions,
        reduced: &ExactConditions,
        options: &EnumerationOptions,
        deadline: Deadline<'_>,
        budget: &mut Budget,
    ) -> Result<Self, Doubt> {
        let stated = Stated::new(reduced);
        let found = Self::of(conditions, &stated, options, deadline, budget, &mut |_, _| None);
        if found.incomplete.is_some() || found.open > 0 {
            return Err(Doubt::Limit);
        }
        Ok(found)
    }

    /// The search is that of `stated`, which may be the same conditions in other unknowns. Where it proves nothing, the original conditions
    /// decide, since exact numbers are much longer after an elimination. `settle` may declare a box of selections that need not be searched
    /// further.
    fn of(
        conditions: &ExactConditions,
        stated: &Stated,
        options: &EnumerationOptions,
        deadline: Deadline<'_>,
        budget: &mut Budget,
        settle: &mut dyn FnMut(&[usize], &mut Budget) -> Option<Pieces>,
    ) -> Self {
        let mut found = Self::default();
        let whole = vec![vec![None; conditions.sites.len()]];
        let certificates = Certificates::new(&stated.system, stated.radii.clone());
        let mut search =
            SelectionSearch::new(&stated.system, Some(&certificates), options.max_nodes, deadline);
        let mut unproven = whole.clone();
        if let Ok(root) = search.root(&[]) {
            let mut leaf = |pieces: &[usize]| -> Result<_, EnumerationError> {
                let many = found.selections.len() >= MANY;
                let settled = many.then(|| settle(pieces, budget)).flatten();
                if settled.is_none() {
                    found.selections.insert(pieces.to_vec());
                }
                Ok(settled)
            };
            // The leaf gives no error.
            let _ = search.run(root, &mut leaf);
            unproven = std::mem::take(&mut search.unproven);
        }
        let contradiction = search.contradicted.take();
        let contradiction = contradiction.filter(|_| stated.is_exact() && stated.keeps_zeros);
        if contradiction.is_some_and(|(t, var)| multipliers(&stated.system, &t, var, deadline).is_some()) {
            found.bounded = true;
            (found.nodes, found.pivots) = (search.nodes, search.pivots);
            return found;
        }
        (found.nodes, found.pivots) = (search.nodes, search.pivots);
        if search.stopped {
            found.incomplete = Some(Completeness::Incomplete {
                examined: search.examined,
                total: search.total,
            });
            return found;
        }
        found.bounded = stated.bounded && found.nothing_beyond(stated, options, deadline);
        if !found.bounded {
            unproven = whole;
        }
        let mut leaf = |pieces| {
            found.selections.insert(pieces);
        };
        found.open += exhaustive::search(conditions, &unproven, budget, &mut leaf);
        found
    }

    /// Whether no solution lies beyond the radii of the search.
    fn nothing_beyond(
        &mut self,
        stated: &Stated,
        options: &EnumerationOptions,
        deadline: Deadline<'_>,
    ) -> bool {
        let Some(beyond) = &stated.beyond else {
            return true;
        };
        let (none, effort) = holds_nothing(beyond, options.max_nodes.saturating_sub(self.nodes), deadline);
        self.nodes += effort.0;
        self.pivots += effort.1;
        none
    }
}

/// Whether no solution lies beyond, and the nodes and pivots of this test.
fn holds_nothing(beyond: &Beyond, max_nodes: u64, deadline: Deadline<'_>) -> (bool, (u64, u64)) {
    let (mut nodes, mut pivots) = (0, 0);
    let none = beyond.systems().all(|(system, radii)| {
        let certificates = Certificates::new(&system, radii.to_vec());
        let left = max_nodes.saturating_sub(nodes);
        let mut search = SelectionSearch::new(&system, Some(&certificates), left, deadline);
        let Ok(root) = search.root(&[]) else {
            return false;
        };
        // The first point that is not excluded ends the search.
        let run = search.run(root, &mut |_: &[usize]| Err(()));
        nodes += search.nodes;
        pivots += search.pivots;
        run.is_ok() && !search.stopped && search.unproven.is_empty()
    });
    (none, (nodes, pivots))
}

/// The solutions of single selections.
pub(super) struct Gathered<'a> {
    /// The entries after y in a solution (α), if any.
    parameter: Option<f64>,
    conditions: &'a ExactConditions,
    stated: &'a Stated,
    pub(super) solutions: Vec<Solution>,
    /// Exact coordinates of those solutions that others may equal.
    points: Vec<Option<ExactPoint>>,
    /// Solutions whose coordinates are not known to many digits.
    blunt: Vec<usize>,
    pub(super) continua: Vec<Continuum>,
    extents: Vec<Option<Extent<ExactPoint>>>,
    shapes: Vec<Option<Shape>>,
    /// Of the forms of each site that are those of one unknown alone: the form, the unknown, and where it
    /// vanishes.
    bounds: Vec<Vec<(usize, usize, f64)>>,
    /// Whether a decision was taken in exact arithmetic.
    close: bool,
    /// How many of the unknowns are those of the map.
    known: usize,
    deadline: Deadline<'a>,
    /// Boxes of selections whose solutions are all known.
    settled: Vec<Pieces>,
    /// Number of selections, since the last success, whose points were not proven to be the only solution in the cells that contain them.
    attempts: usize,
    /// Nodes and pivots of the searches that prove a point to be the only solution in its cells.
    searched: (u64, u64),
}

impl<'a> Gathered<'a> {
    pub(super) fn new(
        known: usize,
        parameter: Option<f64>,
        conditions: &'a ExactConditions,
        stated: &'a Stated,
        deadline: Deadline<'a>,
    ) -> Self {
        Self {
            known,
            deadline,
            settled: Vec::new(),
            attempts: 0,
            searched: (0, 0),
            parameter,
            conditions,
            stated,
            solutions: Vec::new(),
            points: Vec::new(),
            blunt: Vec::new(),
            continua: Vec::new(),
            extents: Vec::new(),
            shapes: Vec::new(),
            bounds: conditions.sites.iter().map(continua::bounds_of).collect(),
            close: false,
        }
    }

    /// Finds what a cheap solver finds, with a budget of its own: the selections that are examined thereby,
    /// and the one that has solutions.
    fn begin(
        &mut self,
        map: &dyn PiecewiseSmooth,
        alpha: f64,
        options: &EnumerationOptions,
    ) -> (BTreeSet<Vec<usize>>, Option<Vec<usize>>) {
        let mut budget = Budget::new(options, self.deadline);
        let mut examined = BTreeSet::new();
        for active in first_selections(map, alpha, options, self.deadline) {
            for selection in active {
                let pieces: Vec<usize> = selection.pieces().collect();
                if !examined.contains(&pieces) && self.examine(&pieces, &mut budget) {
                    examined.insert(pieces.clone());
                }
                if !(self.solutions.is_empty() && self.continua.is_empty()) {
                    return (examined, Some(pieces));
                }
            }
        }
        (examined, None)
    }

    /// Finds the solutions of a selection; `false` where exact arithmetic reached its cap.
    fn examine(&mut self, pieces: &[usize], budget: &mut Budget) -> bool {
        if let Some(found) = self.enclosure(pieces)
            && let Some(inside) = self.inside(pieces, &found)
        {
            if inside {
                self.add(pieces, &found);
            }
            return true;
        }
        self.decide(pieces, budget)
    }

    /// As [`examine`](Self::examine), in exact arithmetic.
    pub(super) fn decide(&mut self, pieces: &[usize], budget: &mut Budget) -> bool {
        self.close = true;
        match decide(self.conditions, pieces, budget) {
            None => return false,
            Some(SelectionSolutions::None) => {}
            Some(SelectionSolutions::Point { point, sign, touched }) => {
                let margin = if touched.is_empty() && sign != 0 {
                    f64::INFINITY
                } else {
                    0.0
                };
                self.point(pieces, point, sign, margin);
            }
            Some(SelectionSolutions::Continuum {
                dimension,
                extent,
                shape,
            }) => self.continuum(pieces, (dimension, extent), shape),
        }
        true
    }

    pub(super) fn point(&mut self, pieces: &[usize], point: ExactPoint, sign: i8, margin: f64) {
        let same = |p: &Option<ExactPoint>| p.as_ref() == Some(&point);
        if let Some(k) = self.points.iter().position(same) {
            let known = &mut self.solutions[k];
            let selection = Selection::from_pieces(pieces.iter().copied());
            if known.selections.contains(&selection) {
                return;
            }
            known.selections.push(selection);
            known.det_signs.push(Some(sign));
            known.num_selections = known.num_selections.max(known.selections.len() as f64);
            known.margin = known.margin.min(margin);
        } else {
            let x = self.full(self.within(pieces, point.to_f64()));
            self.solutions.push(solution(x, pieces, sign, margin));
            self.points.push(Some(point));
        }
    }

    /// Where the solution of a selection lies in so many cells that a search would list them one by one: if it is proven to be the only
    /// solution in all of them, it is added and the pieces of all these cells are returned.
    fn settle(
        &mut self,
        pieces: &[usize],
        options: &EnumerationOptions,
        budget: &mut Budget,
    ) -> Option<Pieces> {
        if self.attempts >= ATTEMPTS {
            return None;
        }
        let found = self.enclosure(pieces)?;
        let close = (0..pieces.len()).filter(|&site| self.side(pieces, site, &found) == Some(None));
        if (close.count() as f64).exp2() <= SELECTIONS as f64 {
            return None;
        }
        self.attempts += 1;
        let Some(SelectionSolutions::Point { point, .. }) = decide(self.conditions, pieces, budget) else {
            return None;
        };
        let active = exhaustive::active(self.conditions, &point);
        let count: f64 = active.iter().map(|p| p.len() as f64).product();
        if count <= SELECTIONS as f64 || !self.is_alone(&point, &active, options) {
            return None;
        }
        self.attempts = 0;
        self.close = true;
        self.point(pieces, point.clone(), found.sign, 0.0);
        let base = Selection::from_pieces(active.iter().map(|p| p[0]));
        let several = active.iter().cloned().enumerate().filter(|p| p.1.len() > 1);
        for other in Selections::new(base, several.collect()).take(NAMED) {
            let other: Vec<usize> = other.pieces().collect();
            // The point satisfies all its conditions.
            if let Some(enclosure) = self.enclosure(&other) {
                self.point(&other, point.clone(), enclosure.sign, 0.0);
            }
        }
        let same = self.points.iter().position(|p| p.as_ref() == Some(&point))?;
        self.solutions[same].num_selections = count;
        self.settled.push(active.clone());
        Some(active)
    }

    /// Whether no other solution lies in the cells of the given pieces, in all of which a point lies: there is no direction to one.
    fn is_alone(&mut self, point: &ExactPoint, active: &[Vec<usize>], options: &EnumerationOptions) -> bool {
        let level = |form: &ExactForm| ExactForm {
            constant: Exact::default(),
            ..form.clone()
        };
        let sites = self.conditions.sites.iter().zip(active);
        let directions = ExactConditions {
            unknowns: self.conditions.unknowns,
            common: self.conditions.common.iter().map(level).collect(),
            sites: sites
                .map(|(site, pieces)| {
                    let vanishes = |form: usize| point.sign_of(&site.forms[form]) == 0;
                    near::directional(site, pieces, vanishes, level)
                })
                .collect(),
            bounds: Vec::new(),
        };
        let Some(reduced) = reduced_directions(&directions, self.deadline) else {
            return false;
        };
        let stated = Stated::new(&reduced);
        let Some(beyond) = stated.beyond.filter(|_| stated.bounded) else {
            return reduced.unknowns == 0;
        };
        let (none, effort) = holds_nothing(
            &beyond,
            options.max_nodes.saturating_sub(self.searched.0),
            self.deadline,
        );
        self.searched.0 += effort.0;
        self.searched.1 += effort.1;
        none
    }

    /// The solution of a selection without its cell, where error bounds prove that there is just one.
    pub(super) fn enclosure(&self, pieces: &[usize]) -> Option<Enclosure> {
        let (system, m) = (&self.stated.system, self.conditions.unknowns);
        let mut rows = vec![None; m];
        for (site, &piece) in pieces.iter().enumerate() {
            let exact = exhaustive::piece_of(self.conditions, site, piece)?;
            for &(row, form) in &exact.equalities {
                let place = rows.get_mut(row).filter(|r| r.is_none())?;
                *place = Some((&system.sites[site].forms[form], self.stated.error(site, form)));
            }
        }
        let mut common = system.common.iter().enumerate();
        for row in rows.iter_mut().filter(|r| r.is_none()) {
            let (k, form) = common.next()?;
            *row = Some((form, self.stated.common_error(k)));
        }
        if common.next().is_some() {
            return None;
        }
        let (mut matrix, mut constants) = (Vec::with_capacity(m * m), Vec::with_capacity(m));
        let mut errors = Vec::new();
        for (form, error) in rows.into_iter().flatten() {
            matrix.extend_from_slice(&form.coefficients);
            constants.push(form.constant);
            errors.push(error);
        }
        Enclosure::of(&matrix, &constants, &errors, self.deadline)
    }

    /// Whether it lies in the cell, if error bounds decide.
    pub(super) fn inside(&self, pieces: &[usize], found: &Enclosure) -> Option<bool> {
        let mut unsure = false;
        for site in 0..pieces.len() {
            match self.side(pieces, site, found)? {
                Some(false) => return Some(false),
                Some(true) => {}
                None => unsure = true,
            }
        }
        (!unsure).then_some(true)
    }

    /// The same for one site.
    fn side(&self, pieces: &[usize], site: usize, found: &Enclosure) -> Option<Option<bool>> {
        let mut unsure = false;
        for &(form, wanted) in &exhaustive::piece_of(self.conditions, site, pieces[site])?.facets {
            let error = self.stated.error(site, form);
            let form = &self.stated.system.sites[site].forms[form];
            match found.sign_of(&form.coefficients, form.constant, error) {
                Some(sign) if sign != wanted => return Some(Some(false)),
                Some(_) => {}
                None => unsure = true,
            }
        }
        Some((!unsure).then_some(true))
    }

    /// Computes in exact arithmetic, within the budget, the coordinates of solutions that error bounds do not determine accurately enough.
    fn sharpen(&mut self, budget: &mut Budget) {
        for k in std::mem::take(&mut self.blunt) {
            let pieces: Vec<usize> = self.solutions[k].selections[0].pieces().collect();
            if let Some(SelectionSolutions::Point { point, .. }) = decide(self.conditions, &pieces, budget) {
                self.solutions[k].x = self.full(self.within(&pieces, point.to_f64()));
            }
        }
    }

    pub(super) fn add(&mut self, pieces: &[usize], found: &Enclosure) {
        let x = self.full(self.within(pieces, self.stated.scaling.unscaled(&found.point)));
        if !found.is_sharp() {
            self.blunt.push(self.solutions.len());
        }
        self.points.push(None);
        self.solutions
            .push(solution(x, pieces, found.sign, f64::INFINITY));
    }

    fn full(&self, mut y: Vec<f64>) -> Vec<f64> {
        y.truncate(self.known);
        y.extend(self.parameter);
        y
    }

    /// Sites whose pieces disagree where they meet; tested only if a decision depended on the last bits.
    fn disagreeing(&self) -> u64 {
        if !self.close {
            return 0;
        }
        let sites = 0..self.conditions.sites.len();
        sites
            .filter(|&s| !exhaustive::is_continuous(self.conditions, s))
            .count() as u64
    }

    /// Orders the list, finds the local indices and their sum.
    fn finish(mut self, map: &dyn PiecewiseSmooth, set: &mut SolutionSet) {
        let layout = TestLayout::new(map);
        let mut theta = vec![0.0; layout.total()];
        let on_continua = self.on_continua();
        for (solution, continuum) in self.solutions.iter_mut().zip(on_continua) {
            if solution.margin > 0.0 {
                map.test_functions(&solution.x, &mut theta);
                let pieces = solution.selections[0].pieces().enumerate();
                let margins =
                    pieces.map(|(s, piece)| cell_margin(map.cell(s, piece), &theta[layout.range(s)]));
                solution.margin = margins.fold(f64::INFINITY, f64::min).max(0.0);
            }
            solution.sort();
            solution.find_index();
            solution.index = solution.index.filter(|_| continuum.is_none());
            solution.continuum = continuum;
        }
        self.solutions.sort_by(|a, b| a.selections.cmp(&b.selections));
        let indices: Option<i64> = self.solutions.iter().map(|s| s.index.map(i64::from)).sum();
        let decided = set.completeness.is_complete() && self.continua.is_empty();
        set.index_sum = indices.filter(|_| decided);
        set.solutions = self.solutions;
        set.continua = self.continua;
    }
}

fn solution(x: Vec<f64>, pieces: &[usize], sign: i8, margin: f64) -> Solution {
    Solution {
        x,
        selections: vec![Selection::from_pieces(pieces.iter().copied())],
        num_selections: 1.0,
        det_signs: vec![Some(sign)],
        margin,
        index: None,
        continuum: None,
    }
}
