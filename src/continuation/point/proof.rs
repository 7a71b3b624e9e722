//! Proofs that no other arm leaves a point: by exact coefficients, or by enclosures of derivatives about it.

use super::Certainty;
use crate::continuation::Arm;
use crate::enumeration::{EnumerationOptions, all_arms};
use crate::linear::AutoSolver;
use crate::newton::{MoorePenrose, regular_radius, step_enclosure};
use crate::piecewise::{ActiveSet, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout};
use crate::sparse::norm;

/// Unknowns up to which lists are proven in exact arithmetic: each takes the time of a dense elimination.
const EXACT: usize = 200;
/// Selections and partial selections that a proof may examine.
const EXAMINED: u64 = 10_000;
/// Active selections whose derivatives are enclosed.
const ENCLOSED: u128 = 16;
/// Lengths, each an eighth of the one before, at which the enclosures of a selection are tried.
const TRIES: usize = 6;

/// How certain it is that these are all arms of a point; `active` are the selections that may have some.
pub(in crate::continuation) fn certainty(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    arms: &[Arm],
) -> Certainty {
    if x.len() <= EXACT && is_proven(map, x, arms) {
        return Certainty::Proven;
    }
    let radius = radius(map, x, active, arms);
    radius.map_or(Certainty::Estimated, |radius| Certainty::Within { radius })
}

/// Whether the exact coefficients of a map have these arms and no others.
fn is_proven(map: &dyn PiecewiseSmooth, x: &[f64], arms: &[Arm]) -> bool {
    if map.exact().is_none() {
        return false;
    }
    let options = EnumerationOptions::default().with_max_nodes(EXAMINED);
    let found = all_arms(map, x, &options);
    found.is_ok_and(|f| f.completeness.is_complete() && f.unresolved.is_empty() && f.arms.len() == arms.len())
}

/// A radius about x within which every active selection has one curve, along which each switching function is monotonic or keeps its sign,
/// so that its arms are those on whose side all of them hold: the arms given, and no others.
fn radius(map: &dyn PiecewiseSmooth, x: &[f64], active: &ActiveSet, arms: &[Arm]) -> Option<f64> {
    map.expansions()?;
    if active.total()? > ENCLOSED {
        return None;
    }
    let mut corrector = MoorePenrose::new(map, AutoSolver::default()).ok()?;
    let mut least = f64::INFINITY;
    let mut counted = 0;
    for selection in active.selections() {
        let (radius, inside) = of_selection(map, x, &selection, active, &mut corrector)?;
        least = least.min(radius);
        counted += inside;
    }
    (counted == arms.len()).then_some(least)
}

/// The radius of one selection, and on how many sides of x its curve runs in its cell.
fn of_selection(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    selection: &Selection,
    active: &ActiveSet,
    corrector: &mut MoorePenrose<AutoSolver>,
) -> Option<(f64, usize)> {
    let tangent = corrector
        .linearize(map, selection, x, None)
        .ok()?
        .tangent()
        .to_vec();
    let mut length = 0.5 * regular_radius(map, selection, x, &tangent)?;
    for _ in 0..TRIES {
        let mut ends = [1.0, -1.0].map(|sign| {
            let mut y: Vec<f64> = x
                .iter()
                .zip(&tangent)
                .map(|(x, t)| x + sign * length * t)
                .collect();
            let mut t = tangent.clone();
            let corrected =
                corrector.correct_in_plane(map, selection, (x, &tangent, sign * length), &mut y, &mut t);
            corrected.is_ok_and(|(c, _)| c.converged).then_some(y)
        });
        if let [Some(ahead), Some(behind)] = &mut ends
            && step_enclosure(map, selection, behind, ahead)
                .is_some_and(|e| e.regular && e.facets_told_by_ends)
        {
            let inside = [&*ahead, &*behind].map(|y| is_inside(map, selection, active, y));
            return Some((length / norm(&tangent), inside.iter().filter(|i| **i).count()));
        }
        length *= 0.125;
    }
    None
}

/// Whether the facets of a cell that meet at the point hold at y.
fn is_inside(map: &dyn PiecewiseSmooth, selection: &Selection, active: &ActiveSet, y: &[f64]) -> bool {
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.tests_of_selection(selection, y, None, &mut theta);
    active.vanishing().iter().all(|&k| {
        let (site, test) = layout.locate(k);
        let mut facets = map
            .cell(site, selection.piece(site))
            .iter()
            .filter(|f| f.test() == test);
        facets.all(|f| f.sign() * theta[k] > 0.0)
    })
}
