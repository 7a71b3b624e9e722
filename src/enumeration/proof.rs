//! Lists of solutions that are proven: all decisions by error bounds where these suffice, and in exact arithmetic where not.

use std::collections::BTreeSet;

use super::certificate::Certificates;
use super::enclosure::Enclosure;
use super::exhaustive::{self, ExactPoint, Held};
use super::proven_search::Search;
use super::solutions::{Completeness, Continuum, Doubt, Solution, SolutionSet};
use super::stated::Stated;
use super::{EnumerationError, EnumerationOptions};
use crate::clock::Deadline;
use crate::piecewise::{ExactConditions, PiecewiseSmooth, Selection, TestLayout, cell_margin};

/// Coefficients up to which conditions are stated exactly.
pub(super) const MAX_COEFFICIENTS: usize = 1 << 21;
/// Numbers that exact arithmetic may write for each node that the search may have, and at most: some seconds.
const WORK_PER_NODE: u64 = 20;
const MAX_WORK: u64 = 20_000_000;

/// All solutions at a parameter of a map that states its conditions.
pub(super) fn proven_solutions(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    conditions: &ExactConditions,
    options: &EnumerationOptions,
) -> Result<SolutionSet, EnumerationError> {
    let deadline = Deadline::after(options.max_time);
    let stated = Stated::new(conditions);
    let mut set = SolutionSet {
        solutions: Vec::new(),
        continua: Vec::new(),
        index_sum: None,
        completeness: Completeness::Complete,
        nodes: 0,
        pivots: 0,
    };
    let mut budget = MAX_WORK.min(options.max_nodes.saturating_mul(WORK_PER_NODE));
    let mut found = candidates(conditions, &stated, options, deadline, &mut set, &mut budget);
    let mut gathered = Gathered::new(map, alpha, conditions, &stated);
    for pieces in &found.selections {
        let examined = !deadline.is_over() && gathered.examine(pieces, &mut budget);
        found.open += u64::from(!examined);
    }
    gathered.drop_points_of_continua();
    let open = found.open + gathered.disagreeing();
    set.completeness = match found.incomplete {
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
    gathered.finish(&mut set);
    Ok(set)
}

/// Selections that may hold solutions.
struct Candidates {
    selections: BTreeSet<Vec<usize>>,
    incomplete: Option<Completeness>,
    /// Partial selections that were neither searched nor ruled out.
    open: u64,
}

fn candidates(
    conditions: &ExactConditions,
    stated: &Stated,
    options: &EnumerationOptions,
    deadline: Deadline,
    set: &mut SolutionSet,
    budget: &mut u64,
) -> Candidates {
    let mut found = Candidates {
        selections: BTreeSet::new(),
        incomplete: None,
        open: 0,
    };
    let whole = vec![vec![None; conditions.sites.len()]];
    let certificates = Certificates::new(&stated.system, stated.radii.clone());
    let mut search = Search::new(&stated.system, options.max_nodes, deadline).certified(&certificates);
    let mut unproven = whole.clone();
    if let Ok(root) = search.root() {
        let mut leaf = |pieces: &[usize]| -> Result<(), EnumerationError> {
            found.selections.insert(pieces.to_vec());
            Ok(())
        };
        // The leaf gives no error.
        let _ = search.run(root, &mut leaf);
        unproven = std::mem::take(&mut search.unproven);
    }
    (set.nodes, set.pivots) = (search.nodes, search.pivots);
    if search.stopped {
        found.incomplete = Some(Completeness::Incomplete {
            examined: search.examined,
            total: search.total,
        });
        return found;
    }
    if !stated.bounded || !nothing_beyond(stated, options, deadline, set) {
        unproven = whole;
    }
    for partial in &unproven {
        let mut leaf = |pieces| {
            found.selections.insert(pieces);
        };
        if deadline.is_over() || !exhaustive::search(conditions, partial, budget, &mut leaf) {
            found.open += 1;
        }
    }
    found
}

/// Whether no solution lies beyond the radii of the search.
fn nothing_beyond(
    stated: &Stated,
    options: &EnumerationOptions,
    deadline: Deadline,
    set: &mut SolutionSet,
) -> bool {
    let Some((system, radii)) = &stated.beyond else {
        return true;
    };
    let certificates = Certificates::new(system, radii.clone());
    let mut search = Search::new(system, options.max_nodes, deadline).certified(&certificates);
    let Ok(root) = search.root() else {
        return false;
    };
    // A first direction that is not ruled out ends the search.
    let run = search.run(root, &mut |_: &[usize]| Err(()));
    set.nodes += search.nodes;
    set.pivots += search.pivots;
    run.is_ok() && !search.stopped && search.unproven.is_empty()
}

/// The solutions of single selections.
struct Gathered<'a> {
    map: &'a dyn PiecewiseSmooth,
    alpha: f64,
    conditions: &'a ExactConditions,
    stated: &'a Stated,
    layout: TestLayout,
    solutions: Vec<Solution>,
    /// Exact coordinates of those solutions that others may equal.
    points: Vec<Option<ExactPoint>>,
    continua: Vec<Continuum>,
    ends: Vec<Vec<ExactPoint>>,
    /// Whether a decision was taken in exact arithmetic.
    close: bool,
}

impl<'a> Gathered<'a> {
    fn new(
        map: &'a dyn PiecewiseSmooth,
        alpha: f64,
        conditions: &'a ExactConditions,
        stated: &'a Stated,
    ) -> Self {
        Self {
            map,
            alpha,
            conditions,
            stated,
            layout: TestLayout::new(map),
            solutions: Vec::new(),
            points: Vec::new(),
            continua: Vec::new(),
            ends: Vec::new(),
            close: false,
        }
    }

    /// Finds what a selection holds; `false` where exact arithmetic reached its cap.
    fn examine(&mut self, pieces: &[usize], budget: &mut u64) -> bool {
        match self.enclosed(pieces) {
            Some(None) => return true,
            Some(Some((y, sign))) => {
                let x = self.full(y);
                let margin = self.margin(pieces, &x);
                self.points.push(None);
                self.solutions.push(solution(x, pieces, sign, margin));
                return true;
            }
            None => self.close = true,
        }
        match exhaustive::decide(self.conditions, pieces, budget) {
            None => return false,
            Some(Held::Nothing) => {}
            Some(Held::Point { point, sign, touched }) => self.point(pieces, point, sign, touched.is_empty()),
            Some(Held::Continuum { dimension, ends }) => self.continuum(pieces, dimension, ends),
        }
        true
    }

    fn point(&mut self, pieces: &[usize], point: ExactPoint, sign: i8, inside: bool) {
        let x = self.full(point.to_f64());
        let margin = if inside && sign != 0 {
            self.margin(pieces, &x)
        } else {
            0.0
        };
        let same = |p: &Option<ExactPoint>| p.as_ref() == Some(&point);
        if let Some(k) = self.points.iter().position(same) {
            let known = &mut self.solutions[k];
            known
                .selections
                .push(Selection::from_pieces(pieces.iter().copied()));
            known.det_signs.push(Some(sign));
            known.num_selections += 1.0;
            known.margin = known.margin.min(margin);
        } else {
            self.solutions.push(solution(x, pieces, sign, margin));
            self.points.push(Some(point));
        }
    }

    fn continuum(&mut self, pieces: &[usize], dimension: usize, ends: Vec<ExactPoint>) {
        let selection = Selection::from_pieces(pieces.iter().copied());
        let known = (0..self.continua.len()).find(|&k| {
            let own = &self.ends[k];
            dimension == 1
                && self.continua[k].dimension == 1
                && !ends.is_empty()
                && own.len() == ends.len()
                && ends.iter().all(|e| own.contains(e))
        });
        if let Some(k) = known {
            return self.continua[k].selections.push(selection);
        }
        self.continua.push(Continuum {
            selections: vec![selection],
            dimension,
            ends: ends.iter().map(|e| self.full(e.to_f64())).collect(),
        });
        self.ends.push(ends);
    }

    /// Drops what only singular selections hold as points, where it belongs to a continuum of another one.
    fn drop_points_of_continua(&mut self) {
        let held: Vec<Vec<usize>> = self
            .continua
            .iter()
            .flat_map(|c| &c.selections)
            .map(|s| s.pieces().collect())
            .collect();
        let conditions = self.conditions;
        let kept = self.solutions.iter().zip(&self.points).map(|(s, point)| {
            let singular = s.det_signs.iter().all(|d| *d == Some(0));
            let inside = |p: &ExactPoint| held.iter().any(|h| exhaustive::contains(conditions, h, p));
            !(singular && point.as_ref().is_some_and(inside))
        });
        let kept: Vec<bool> = kept.collect();
        let mut next = kept.iter();
        self.solutions.retain(|_| next.next() == Some(&true));
        let mut next = kept.iter();
        self.points.retain(|_| next.next() == Some(&true));
    }

    /// The solution of a selection (or that there is none) and the sign of its determinant, if error bounds decide everything.
    fn enclosed(&self, pieces: &[usize]) -> Option<Option<(Vec<f64>, i8)>> {
        let (system, m) = (&self.stated.system, self.conditions.unknowns);
        let mut rows = vec![None; m];
        for (site, &piece) in pieces.iter().enumerate() {
            let exact = exhaustive::piece_of(self.conditions, site, piece)?;
            for &(row, form) in &exact.equalities {
                let place = rows.get_mut(row).filter(|r| r.is_none())?;
                *place = Some(&system.sites[site].forms[form]);
            }
        }
        let mut common = system.common.iter();
        for row in rows.iter_mut().filter(|r| r.is_none()) {
            *row = Some(common.next()?);
        }
        if common.next().is_some() {
            return None;
        }
        let (mut matrix, mut constants) = (Vec::with_capacity(m * m), Vec::with_capacity(m));
        for form in rows.into_iter().flatten() {
            matrix.extend_from_slice(&form.coefficients);
            constants.push(form.constant);
        }
        let found = Enclosure::of(&matrix, &constants)?;
        let mut unsure = false;
        for (site, &piece) in pieces.iter().enumerate() {
            for &(form, wanted) in &exhaustive::piece_of(self.conditions, site, piece)?.facets {
                let form = &system.sites[site].forms[form];
                match found.sign_of(&form.coefficients, form.constant) {
                    Some(sign) if sign != wanted => return Some(None),
                    Some(_) => {}
                    None => unsure = true,
                }
            }
        }
        if unsure {
            return None;
        }
        let scaling = &self.stated.scaling;
        let unscaled = |(k, z): (usize, &f64)| {
            let exact = crate::piecewise::Exact::new(*z)?;
            Some(exact.scaled(scaling.shift(k)))
        };
        let y: Option<Vec<f64>> = found.point.iter().enumerate().map(unscaled).collect();
        Some(Some((y?, found.sign)))
    }

    fn full(&self, mut y: Vec<f64>) -> Vec<f64> {
        if self.map.num_vars() > y.len() {
            y.push(self.alpha);
        }
        y
    }

    fn margin(&self, pieces: &[usize], x: &[f64]) -> f64 {
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(x, &mut theta);
        let margins = pieces
            .iter()
            .enumerate()
            .map(|(site, &piece)| cell_margin(self.map.cell(site, piece), &theta[self.layout.range(site)]));
        margins.fold(f64::INFINITY, f64::min).max(0.0)
    }

    /// Sites whose pieces disagree where they meet; asked only where something was decided by the last bits.
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
    fn finish(mut self, set: &mut SolutionSet) {
        self.solutions.iter_mut().for_each(Solution::find_index);
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
    }
}
