//! The arms of the solution set at a point: those of each active selection that stay in its cell.

use std::collections::BTreeSet;

use super::active::gradient_sizes;
use super::cone::{Cone, cone};
use super::extension::Frame;
use super::large::MAX_BRANCHING;
use super::units::Units;
use super::{Found, InCell, PointDoubt, in_cell};
use crate::clock::Deadline;
use crate::continuation::error::if_solved;
use crate::continuation::point::{Wanted, one_arm};
use crate::continuation::{Arm, ContinuationOptions};
use crate::enumeration::{EnumerationError, directional_selections, local_selections};
use crate::linear::{LinearError, LinearSolver};
use crate::newton::MoorePenrose;
use crate::piecewise::{
    ActiveSet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, Vanishing,
};
use crate::sparse::norm;

/// Singular values below this, relative to the largest, count as zero in the branching equation.
pub(in crate::continuation) const RANK: f64 = 1e-9;
/// Ratio of a test function's value to what its rates account for, above which the value is a rounding error.
pub(in crate::continuation) const UNEXPLAINED: f64 = 1e3;
/// Up to this number of active selections all are tried; beyond it the pruned search excludes most of them first.
const PLAIN: u128 = 16;
/// Partial selections that a search may try on the way of a curve, in multiples of those on the straight way to one arm.
const DETOURS: u64 = 4;

/// The arms found at a point.
#[derive(Debug, Clone, Default)]
pub(in crate::continuation) struct Arms {
    pub(in crate::continuation) list: Vec<Arm>,
    /// Dimensions of continua through the point.
    pub(in crate::continuation) continua: Vec<usize>,
    /// Whether every active selection was examined and the arms in its kernel were determined.
    pub(in crate::continuation) complete: bool,
    /// The first reason for which they were not, if there is one.
    pub(in crate::continuation) undecided: Option<PointDoubt>,
}

impl Arms {
    pub(super) fn doubt(&mut self, doubt: PointDoubt) {
        self.complete = false;
        self.undecided.get_or_insert(doubt);
    }
}

/// Arms at a simple crossing of two curves.
const CROSSING: usize = 4;
/// Number of residuals up to which the extensions of selections are examined by dense decompositions.
pub(super) const DENSE: usize = 60;

/// How a pruned search for arms ended.
#[derive(PartialEq)]
enum Pruned {
    /// No other selection has arms.
    All,
    /// At its limit.
    Some,
    /// The selections have to be tried one by one.
    Impossible,
    Failed,
}

/// Whether so few selections are active that all are tried.
fn is_plain(active: &ActiveSet) -> bool {
    active.total().is_some_and(|total| total <= PLAIN)
}

pub(in crate::continuation) struct ArmSearch<'a, P: ?Sized, L> {
    pub(in crate::continuation) map: &'a P,
    pub(in crate::continuation) corrector: &'a mut MoorePenrose<L>,
    pub(in crate::continuation) options: &'a ContinuationOptions,
    pub(in crate::continuation) layout: &'a TestLayout,
    pub(in crate::continuation) x: &'a [f64],
    /// Values of the test functions at x.
    pub(in crate::continuation) theta: &'a [f64],
    pub(in crate::continuation) vanishing: &'a [Vanishing],
    /// A selection known to be singular at (or within rounding of) x, where the computed kernel vector is arbitrary.
    pub(in crate::continuation) singular: Option<Selection>,
    /// Distance up to which the curve that arrived is known: points on the arms are to be no farther, if that tells them apart.
    pub(in crate::continuation) within: f64,
    pub(in crate::continuation) deadline: Deadline<'a>,
    /// Whether any selection may be singular at x, as at a start.
    pub(in crate::continuation) unknown: bool,
    /// Whether a kernel was found by a dense decomposition, which takes far longer than a step.
    pub(in crate::continuation) decomposed: bool,
    pub(super) found: Vec<Found>,
    /// The selections that were examined.
    pub(super) seen: BTreeSet<Selection>,
    /// Affine cells with continua: the selection, and the kernel in which the continuum lies.
    pub(super) solids: Vec<Solid>,
}

/// A continuum in an affine cell.
pub(super) struct Solid {
    pub(super) selection: Selection,
    pub(super) kernel: Vec<Vec<f64>>,
    pub(super) dimension: usize,
}

impl<P: PiecewiseSmooth + ?Sized, L: LinearSolver> ArmSearch<'_, P, L> {
    /// All arms of the active selections at x.
    pub(in crate::continuation) fn all(&mut self, active: &ActiveSet) -> Result<Arms, PiecewiseError> {
        let mut arms = Arms {
            complete: true,
            ..Arms::default()
        };
        self.examine(active, &mut arms)?;
        self.settle(&mut arms)?;
        Ok(arms)
    }

    fn examine(&mut self, active: &ActiveSet, arms: &mut Arms) -> Result<(), PiecewiseError> {
        if !is_plain(active) {
            match self.pruned(active, self.options.max_nodes, arms)? {
                Pruned::All => return Ok(()),
                Pruned::Some => {
                    arms.doubt(PointDoubt::Budget);
                    return self.locally(active, arms);
                }
                Pruned::Impossible => {}
                Pruned::Failed => arms.doubt(PointDoubt::Budget),
            }
        }
        for (examined, selection) in active.selections().enumerate() {
            if examined as u64 == self.options.max_selections || self.is_late(examined) {
                arms.doubt(PointDoubt::Budget);
                return self.locally(active, arms);
            }
            self.of_selection(&selection, None, arms)?;
        }
        Ok(())
    }

    /// The arms that a pruned search finds within a limit of partial selections.
    fn pruned(&mut self, active: &ActiveSet, limit: u64, arms: &mut Arms) -> Result<Pruned, PiecewiseError> {
        if self.map.has_nested_kinks() {
            return Ok(Pruned::Impossible);
        }
        let found = match directional_selections(&self.map, self.x, active, limit, self.deadline) {
            Ok(Some(found)) => found,
            // Rows that depend on several sites, or too large a table: the selections are tried one by one.
            Ok(None) | Err(EnumerationError::TooLarge { .. }) => return Ok(Pruned::Impossible),
            Err(EnumerationError::Map(e)) => return Err(e),
            Err(_) => return Ok(Pruned::Failed),
        };
        self.of_selections(found.selections.iter(), arms)?;
        Ok(if found.complete { Pruned::All } else { Pruned::Some })
    }

    /// The arm along which a curve goes on, and with it all others where few selections are active; after an arrival also where a search
    /// that hardly branches finds them. Only then is the list complete. Where α̇ is prescribed it may be empty.
    pub(in crate::continuation) fn following(
        &mut self,
        active: &ActiveSet,
        wanted: Wanted<'_>,
        start: &Selection,
    ) -> Result<Arms, PiecewiseError> {
        if is_plain(active) {
            return self.all(active);
        }
        let complete = true;
        if let Wanted::After(_) = wanted {
            let pieces = active.degenerate_sites().iter().map(|s| s.1.len() as u64);
            let limit = self.options.max_nodes.min(DETOURS * pieces.sum::<u64>());
            let mut arms = Arms {
                complete,
                ..Arms::default()
            };
            if self.is_small(active) && self.pruned(active, limit, &mut arms)? == Pruned::All {
                self.settle(&mut arms)?;
                return Ok(arms);
            }
            self.found.clear();
            self.seen.clear();
            self.solids.clear();
        }
        let mut arms = Arms {
            complete,
            ..Arms::default()
        };
        arms.doubt(PointDoubt::NotSearched);
        let meeting = (active, self.vanishing);
        if let Some(found) = one_arm(&self.map, self.x, meeting, wanted, start, self.deadline)? {
            self.of_selection(&found, None, &mut arms)?;
            self.settle(&mut arms)?;
        }
        match wanted {
            Wanted::After(_) if arms.list.is_empty() => {
                self.seen.clear();
                self.all(active)
            }
            _ => Ok(arms),
        }
    }

    /// Whether the table of a pruned search has no more entries than ∇H of a moderate number of unknowns: it is eliminated densely.
    fn is_small(&self, active: &ActiveSet) -> bool {
        let forms = self.map.num_residuals() + active.vanishing().len();
        forms <= MAX_BRANCHING
    }

    /// The arms that a local search finds, where not all selections can be examined.
    fn locally(&mut self, active: &ActiveSet, arms: &mut Arms) -> Result<(), PiecewiseError> {
        let starts = self.options.local_starts;
        // The search takes no longer than a few hundred steps of the curve.
        let each = if self.map.num_residuals() > MAX_BRANCHING {
            4
        } else {
            80
        };
        let found = local_selections(&self.map, self.x, active, starts, each * starts, self.deadline);
        match found {
            Ok(selections) => self.of_selections(selections.iter(), arms),
            Err(EnumerationError::Map(e)) => Err(e),
            Err(_) => Ok(()),
        }
    }

    /// The arms of a list of selections, until the time limit.
    fn of_selections<'s>(
        &mut self,
        selections: impl Iterator<Item = &'s Selection>,
        arms: &mut Arms,
    ) -> Result<(), PiecewiseError> {
        for (examined, selection) in selections.enumerate() {
            // Each is compared with the arms that were found before.
            if self.is_late(examined.max(self.found.len())) {
                arms.doubt(PointDoubt::Budget);
                break;
            }
            self.of_selection(selection, None, arms)?;
        }
        Ok(())
    }

    /// Whether the time limit has passed. Regular points are examined regardless of it.
    fn is_late(&self, examined: usize) -> bool {
        (examined as u128 >= PLAIN || self.decomposed) && self.deadline.is_over()
    }

    /// The arms of one selection, appended to those found.
    pub(in crate::continuation) fn of_selection(
        &mut self,
        selection: &Selection,
        hint: Option<&[f64]>,
        arms: &mut Arms,
    ) -> Result<(), PiecewiseError> {
        if !self.seen.insert(selection.clone()) {
            return Ok(());
        }
        // Test functions of nested kinks that vanish to third order are met by rounding far before their zero: along a curve the first order
        // decides which of them count.
        let expanded = self.unknown || !self.map.has_nested_kinks();
        if expanded && !self.map.is_piecewise_affine() && self.map.num_residuals() <= DENSE {
            return self.in_cell(selection, arms);
        }
        if self.singular.as_ref() == Some(selection)
            && let Ok(directions) = self.branching_directions(selection)?
        {
            for d in &directions {
                self.both_ways(selection, d);
            }
            return Ok(());
        }
        if self.unknown && self.is_singular(selection)? {
            return self.at_singular_point(selection, arms);
        }
        match self.corrector.linearize(self.map, selection, self.x, hint) {
            Ok(at) => {
                let tangent = at.tangent().to_vec();
                self.both_ways(selection, &tangent);
                Ok(())
            }
            Err(PiecewiseError::Linear(LinearError::Kernel { .. } | LinearError::Singular { .. })) => {
                self.at_singular_point(selection, arms)
            }
            Err(e) => Err(e),
        }
    }

    /// The only arm of a selection that is regular at x, if it crosses the facets that meet here
    /// transversally, with its orientation.
    pub(in crate::continuation) fn regular_arm(
        &mut self,
        selection: &Selection,
        hint: &[f64],
    ) -> Result<Option<(Arm, Option<i8>)>, PiecewiseError> {
        let at = if_solved((self.corrector).linearize(self.map, selection, self.x, Some(hint)))?;
        let Some((tangent, along)) = at.map(|at| (at.tangent().to_vec(), at.orientation(at.tangent())))
        else {
            return Ok(None);
        };
        self.both_ways(selection, &tangent);
        let mut arm = match self.found.as_slice() {
            [found] if found.facets.is_empty() => found.arm.clone(),
            _ => return Ok(None),
        };
        // The arm is the tangent or its opposite.
        let orientation = if arm.tangent == tangent {
            along
        } else {
            along.map(|o| -o)
        };
        arm.det_sign = match arm.direction {
            0 => Some(0),
            direction => orientation.map(|o| o * direction),
        };
        Ok(Some((arm, orientation)))
    }

    /// The arms of a selection by expansions to higher order.
    fn in_cell(&mut self, selection: &Selection, arms: &mut Arms) -> Result<(), PiecewiseError> {
        let vanishing: Vec<usize> = self.vanishing.iter().map(|v| v.index).collect();
        let frame = Frame {
            map: &self.map,
            x: self.x,
            vanishing: &vanishing,
            tests: self.layout.total(),
            met: self.vanishing,
            theta: self.theta,
            off: 0.0,
        };
        let singular = self.singular.as_ref() == Some(selection);
        let found = match in_cell(&frame, self.layout, selection, singular)? {
            InCell::Arms(found) => found,
            InCell::Undecided(doubt) => {
                arms.doubt(doubt);
                return Ok(());
            }
        };
        // Where two curves of a selection cross there are four arms. If rounding hides them, the branching equation may still have them.
        if singular
            && self.vanishing.is_empty()
            && found.len() < CROSSING
            && found
                .iter()
                .all(|f| f.arc.as_ref().is_none_or(|arc| arc.half.is_none()))
            && let Ok(directions) = self.branching_directions(selection)?
            && 2 * directions.len() > found.len()
        {
            directions.iter().for_each(|d| self.both_ways(selection, d));
            return Ok(());
        }
        self.found.extend(found);
        Ok(())
    }

    /// The arms of a selection that is singular at x, if its branching equation determines them.
    fn at_singular_point(&mut self, selection: &Selection, arms: &mut Arms) -> Result<(), PiecewiseError> {
        match self.branching_directions(selection)? {
            Ok(directions) => {
                for d in &directions {
                    self.both_ways(selection, d);
                }
            }
            Err(kernel) if self.map.is_piecewise_affine() && !kernel.is_empty() => {
                self.in_affine_cell(selection, kernel, arms);
            }
            Err(kernel) => arms.doubt(PointDoubt::kernel(&kernel, &vec![1.0; self.x.len()])),
        }
        Ok(())
    }

    /// The part of the kernel of an affine piece in its cell.
    fn in_affine_cell(&mut self, selection: &Selection, kernel: Vec<Vec<f64>>, arms: &mut Arms) {
        let mut normals = Vec::new();
        for v in self.vanishing {
            let own = v.of_selection(self.map, self.layout, selection, self.x);
            let rates: Vec<f64> = kernel.iter().map(|d| own.rate(d)).collect();
            let size = norm(&rates);
            // A facet that contains the kernel bounds nothing.
            if size <= RANK * own.gradient_norm {
                continue;
            }
            for facet in self
                .map
                .cell(v.site, selection.piece(v.site))
                .iter()
                .filter(|f| f.test() == v.test)
            {
                normals.push(rates.iter().map(|r| facet.sign() * r / size).collect());
            }
        }
        match cone(kernel.len(), &normals) {
            Cone::Rays(rays) => {
                for ray in rays {
                    let mut direction = vec![0.0; self.x.len()];
                    for (basis, c) in kernel.iter().zip(&ray) {
                        direction.iter_mut().zip(basis).for_each(|(d, b)| *d += c * b);
                    }
                    self.one_way(selection, direction);
                }
            }
            Cone::Solid(dimension) => self.solids.push(Solid {
                selection: selection.clone(),
                kernel,
                dimension,
            }),
            Cone::Large => arms.doubt(PointDoubt::Budget),
        }
    }

    fn both_ways(&mut self, selection: &Selection, tangent: &[f64]) {
        for sign in [1.0, -1.0] {
            self.one_way(selection, tangent.iter().map(|t| sign * t).collect());
        }
    }

    fn one_way(&mut self, selection: &Selection, tangent: Vec<f64>) {
        let Some(facets) = self.enters(selection, &tangent) else {
            return;
        };
        let mut units = Units::new(self.map, selection, self.x);
        let direction = units.direction(&tangent);
        let mut grazing: Vec<usize> = facets.iter().map(|&k| self.layout.locate(k).0).collect();
        grazing.dedup();
        self.found.push(Found {
            arm: Arm {
                selection: selection.clone(),
                tangent,
                grazing,
                direction,
                det_sign: None,
                probe: Vec::new(),
                order: 0.0,
            },
            facets,
            arc: None,
            units: Vec::new(),
            unit: None,
        });
    }

    /// Whether a direction leads into the closed cell of a selection; if so, the test functions in whose zero sets it stays.
    fn enters(&self, selection: &Selection, direction: &[f64]) -> Option<Vec<usize>> {
        const AHEAD: f64 = 1e-4;
        let tests = self.layout.total();
        let (mut own, mut sizes) = (Vec::new(), Vec::new());
        if self.map.has_nested_kinks() {
            own.resize(tests, 0.0);
            self.map
                .tests_of_selection(selection, self.x, Some(direction), &mut own);
            sizes = gradient_sizes(self.map, selection, self.x, tests);
        }
        let curved = !self.vanishing.is_empty() && !self.map.is_piecewise_affine();
        let (mut step, mut theta, mut rates) = (0.0, Vec::new(), Vec::new());
        if curved {
            step = AHEAD * (1.0 + norm(self.x));
            theta.resize(tests, 0.0);
            rates.resize(tests, 0.0);
            let ahead: Vec<f64> = self.x.iter().zip(direction).map(|(x, d)| x + step * d).collect();
            self.map.tests_of_selection(selection, &ahead, None, &mut theta);
            self.map
                .tests_of_selection(selection, &ahead, Some(direction), &mut rates);
        }
        let mut grazing = Vec::new();
        let mut units = Units::new(self.map, selection, self.x);
        for v in self.vanishing {
            let (rate, size) = match sizes.get(v.index) {
                Some(&size) => (own[v.index], size),
                None => (v.rate(direction), v.gradient_norm),
            };
            // A rate that is rounding relative to the change over the distance 1 + ‖x‖: the second derivative decides, unless it is
            // rounding, too.
            let flat = curved && size <= RANK * AHEAD.recip() * (rates[v.index] - rate).abs();
            let least = units.least_rate(v, rate, size, direction);
            let cell = self.map.cell(v.site, selection.piece(v.site));
            for facet in cell.iter().filter(|f| f.test() == v.test) {
                let rate = facet.sign() * rate;
                let leaves = if flat {
                    let explained = theta[v.index].abs() <= UNEXPLAINED * step * rates[v.index].abs();
                    explained && facet.sign() * theta[v.index] < 0.0
                } else {
                    rate < -least
                };
                if leaves {
                    return None;
                }
                if (flat || rate <= least) && !grazing.contains(&v.index) {
                    grazing.push(v.index);
                }
            }
        }
        grazing.sort_unstable();
        Some(grazing)
    }
}
