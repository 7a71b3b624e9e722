//! Proven lists of arms: the solutions of the directional problem at the exact point that the given one approximates.

use std::collections::BTreeSet;

use super::EnumerationOptions;
use super::arms::{DirectionalArm, DirectionalArms};
use super::contradiction::Comparison;
use super::exhaustive::{self, Budget};
use super::lists::Doubt;
use super::near::{Directions, Near};
use super::per_selection::{SelectionSolutions, decide};
use super::proof::{Candidates, Gathered};
use super::reduced::{normalised, reduced_directions, with_constants};
use super::stated::Stated;
use crate::clock::Deadline;
use crate::exact::Exact;
use crate::piecewise::{ActiveSet, ExactConditions, PiecewiseSmooth, Selection, Selections};

/// Active selections up to which all are examined without a search.
pub(super) const FEW: u128 = 256;

/// The arms at the exact point where all equalities that are active according to `active` hold; `near` says whether a point, given by
/// bounds of its distance in each variable, is near enough.
pub(super) fn proven_arms(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    near: &dyn Fn(&[f64]) -> bool,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Result<DirectionalArms, Doubt> {
    let given = Near::new(map, x).ok_or(Doubt::NoCoefficients)?;
    if meets_wall(map, active) {
        return Err(Doubt::NoCoefficients);
    }
    let mut supposed: Vec<Vec<usize>> = active.first().pieces().map(|p| vec![p]).collect();
    for (site, pieces) in active.degenerate_sites() {
        supposed[*site].clone_from(pieces);
    }
    let mut doubt = Doubt::Rounding;
    // By error bounds, or exactly where these leave a decision open.
    for exactly in [false, true] {
        match at_point(&given, &supposed, exactly, near, options, deadline) {
            Ok(Some(found)) => {
                compare(Comparison::new(map, given.units()), x, &found, deadline)?;
                return Ok(found);
            }
            Ok(None) => {}
            Err(Doubt::Rounding) if !exactly => {}
            Err(why) => {
                doubt = why;
                break;
            }
        }
    }
    Err(doubt)
}

/// An error where an arm does not solve H'(x; τ) = 0 for the pieces of the map themselves, or where time is over before that is known.
fn compare(
    mut comparison: Comparison<'_>,
    x: &[f64],
    found: &DirectionalArms,
    deadline: Deadline<'_>,
) -> Result<(), Doubt> {
    for arm in &found.arms {
        if deadline.is_over() {
            return Err(Doubt::Limit);
        }
        if comparison.along(&arm.selections[0], x, &arm.tangent) {
            return Err(Doubt::Contradiction);
        }
    }
    Ok(())
}

fn at_point(
    given: &Near,
    supposed: &[Vec<usize>],
    exactly: bool,
    near: &dyn Fn(&[f64]) -> bool,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Result<Option<DirectionalArms>, Doubt> {
    let Some(point) = given.point(supposed, exactly, deadline)? else {
        return Ok(None);
    };
    if !near(&given.distance(&point)) {
        return Err(Doubt::Coincidence);
    }
    let Some(pieces) = given.active(&point) else {
        return Ok(None);
    };
    if pieces.iter().any(Vec::is_empty) {
        return Err(Doubt::Coincidence);
    }
    let mut several = (0..pieces.len()).filter(|site| pieces[*site].len() > 1);
    if !several.all(|site| given.is_continuous(site)) {
        return Err(Doubt::Discontinuous);
    }
    let arms = Arms::new(given.known, given.directions(&point, &pieces), &pieces);
    arms.find(options, deadline).map(Some)
}

/// Whether a test function of a wall counts as vanishing: there the conditions may change.
fn meets_wall(map: &dyn PiecewiseSmooth, active: &ActiveSet) -> bool {
    let layout = crate::piecewise::TestLayout::new(map);
    active.vanishing().iter().any(|&k| {
        let (site, test) = layout.locate(k);
        let cells = (0..map.num_pieces(site)).flat_map(|piece| map.cell(site, piece));
        cells.into_iter().any(|f| f.is_wall() && f.test() == test)
    })
}

/// The directions with α̇ = 1, −1 and 0 that have been found.
struct Arms<'p> {
    pieces: &'p [Vec<usize>],
    /// In this order.
    conditions: [ExactConditions; 3],
    stated: [Stated; 3],
    /// How many of the unknowns are those of the map.
    known: usize,
}

/// α̇ of the directions.
const RATES: [f64; 3] = [1.0, -1.0, 0.0];

impl<'p> Arms<'p> {
    fn new(known: usize, directions: Directions, pieces: &'p [Vec<usize>]) -> Self {
        let Directions { conditions, errors } = directions;
        let back = with_constants(&conditions, |c| -c);
        let level = with_constants(&conditions, |_| Exact::default());
        let conditions = [conditions, back, level];
        let stated = conditions.each_ref().map(|c| {
            let stated = Stated::new(c);
            if errors.is_empty() {
                stated
            } else {
                stated.with_errors(c, &errors)
            }
        });
        Self {
            pieces,
            conditions,
            stated,
            known,
        }
    }

    fn find(&self, options: &EnumerationOptions, deadline: Deadline<'_>) -> Result<DirectionalArms, Doubt> {
        let mut budget = Budget::new(options, deadline);
        let candidates = self.candidates(options, deadline, &mut budget)?;
        let each = |k: usize| {
            let (conditions, stated) = (&self.conditions[k], &self.stated[k]);
            Gathered::new(self.known, Some(RATES[k]), conditions, stated, deadline)
        };
        let mut found = [each(0), each(1), each(2)];
        let mut unresolved = BTreeSet::new();
        for pieces in &candidates.selections {
            if deadline.is_over() {
                return Err(Doubt::Limit);
            }
            self.examine(pieces, &mut found, &mut unresolved, &mut budget)?;
        }
        let mut arms = Vec::new();
        for gathered in &mut found {
            gathered.drop_points_of_continua();
            let continua = gathered.continua.iter().flat_map(|c| &c.selections);
            unresolved.extend(continua.cloned());
            arms.extend(std::mem::take(&mut gathered.solutions));
        }
        let arms = arms.into_iter().map(|s| DirectionalArm {
            tangent: unit(s.x),
            selections: s.selections,
            det_signs: s.det_signs,
        });
        let unresolved: Vec<Selection> = unresolved.into_iter().collect();
        Ok(DirectionalArms::new(arms.collect(), unresolved, candidates.nodes))
    }

    /// The selections that may have arms.
    fn candidates(
        &self,
        options: &EnumerationOptions,
        deadline: Deadline<'_>,
        budget: &mut Budget,
    ) -> Result<Candidates, Doubt> {
        let base = Selection::from_pieces(self.pieces.iter().map(|p| p[0]));
        let several = self.pieces.iter().enumerate().filter(|p| p.1.len() > 1);
        let all = Selections::new(base, several.map(|(s, p)| (s, p.clone())).collect());
        if let Some(total) = all.total().filter(|t| *t <= FEW) {
            if total > u128::from(options.max_nodes) {
                return Err(Doubt::Limit);
            }
            return Ok(Candidates::listed(all.map(|s| s.pieces().collect()).collect()));
        }
        if !self.stated[0].is_exact() {
            return Err(Doubt::Rounding);
        }
        let reduced = reduced_directions(&self.conditions[0], deadline).ok_or(Doubt::Limit)?;
        let mut found = Candidates::complete(&self.conditions[0], &reduced, options, deadline, budget)?;
        let back = with_constants(&reduced, |c| -c);
        let other = Candidates::complete(&self.conditions[1], &back, options, deadline, budget)?;
        if !found.bounded {
            let level = normalised(&reduced).ok_or(Doubt::Limit)?;
            let anything = [vec![None; level.sites.len()]];
            let mut leaf = |pieces| {
                found.selections.insert(pieces);
            };
            if exhaustive::search(&level, &anything, budget, &mut leaf) > 0 {
                return Err(Doubt::Limit);
            }
        }
        found.selections.extend(other.selections);
        found.nodes += other.nodes;
        Ok(found)
    }

    fn examine(
        &self,
        pieces: &[usize],
        found: &mut [Gathered<'_>; 3],
        unresolved: &mut BTreeSet<Selection>,
        budget: &mut Budget,
    ) -> Result<(), Doubt> {
        let [ahead, back, level] = found;
        let enclosure = ahead.enclosure(pieces);
        if let Some(one) = &enclosure {
            let other = one.mirrored();
            if let (Some(a), Some(b)) = (ahead.inside(pieces, one), back.inside(pieces, &other)) {
                if a {
                    ahead.add(pieces, one);
                }
                if b {
                    back.add(pieces, &other);
                }
                return Ok(());
            }
        }
        if !self.stated[0].is_exact() {
            return Err(Doubt::Rounding);
        }
        if !(ahead.decide(pieces, budget) && back.decide(pieces, budget)) {
            return Err(Doubt::Limit);
        }
        if enclosure.is_some() {
            return Ok(());
        }
        match decide(&self.conditions[2], pieces, budget) {
            None => return Err(Doubt::Limit),
            // A ray from 0, or a line through it.
            Some(SelectionSolutions::Continuum {
                extent: Some(extent), ..
            }) => {
                for direction in extent.beyond {
                    level.point(pieces, direction, 0, 0.0);
                }
            }
            Some(SelectionSolutions::Continuum { .. }) => {
                unresolved.insert(Selection::from_pieces(pieces.iter().copied()));
            }
            Some(_) => {}
        }
        Ok(())
    }
}

/// A vector of length one; no component becomes 0.
fn unit(mut v: Vec<f64>) -> Vec<f64> {
    for _ in 0..2 {
        // Squares of large components overflow.
        let largest = crate::sparse::max_abs(&v);
        let size = if largest > 1e100 {
            largest
        } else {
            crate::sparse::norm(&v)
        };
        for a in v.iter_mut().filter(|a| **a != 0.0) {
            let scaled = *a / size;
            *a = if scaled == 0.0 {
                f64::MIN_POSITIVE.copysign(*a)
            } else {
                scaled
            };
        }
    }
    v
}

#[cfg(test)]
mod tests {
    use super::unit;

    /// A component that underflows on normalisation keeps its sign: cells are decided by signs.
    #[test]
    fn unit_vectors_keep_the_signs_of_all_components() {
        for large in [1.0, 1e90, 1e160, 1e300] {
            let v = unit(vec![3.0 * large, 0.0, -4.0 * large, 1e-200, -1e-300]);
            assert!((v[0] - 0.6).abs() < 1e-15 && (v[2] + 0.8).abs() < 1e-15, "{v:?}");
            assert!(v[1] == 0.0 && v[3] > 0.0 && v[4] < 0.0, "{v:?}");
        }
    }
}
