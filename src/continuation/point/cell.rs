//! The arms that lie in the cell of one selection.

use super::arc::{Arc, leading};
use super::extension::{Extension, Frame};
use super::reduced::Reduced;
use super::{Found, PointDoubt};
use crate::continuation::Arm;
use crate::piecewise::{Facet, PiecewiseError, Selection, TestLayout};
use crate::sparse::norm;

/// What a selection contributes to a point.
pub(super) enum InCell {
    Arms(Vec<Found>),
    Undecided(PointDoubt),
}

/// The arms of a selection at the point of the frame, by the expansions of its arms in its switching functions; the point may have been located as
/// one where the selection is `singular`.
///
/// # Errors
/// Entries outside the pattern, values that are not finite.
pub(super) fn in_cell(
    frame: &Frame<'_>,
    layout: &TestLayout,
    selection: &Selection,
    singular: bool,
) -> Result<InCell, PiecewiseError> {
    let mut extension = Extension::new(frame, selection)?;
    let mut located = Frame { ..*frame };
    if singular {
        let rank = extension.rank;
        extension.rank = extension.doubtful_rank(true).unwrap_or(rank);
        located.off = extension.location_error()?;
        extension.rank = rank;
    }
    if located.off > extension.error {
        extension = Extension::new(&located, selection)?;
    }
    let found = inside(&extension, layout);
    let Some(other) = extension.doubtful_rank(singular) else {
        return Ok(found);
    };
    // Rounding does not tell the two ranks apart. The reading with more arms contains those of the other one: where curves that meet are torn
    // apart by rounding, both are right nearby. Corrected points along its arms confirm it.
    extension.rank = other;
    Ok(match (found, inside(&extension, layout)) {
        (InCell::Arms(a), InCell::Arms(b)) => InCell::Arms(if b.len() > a.len() { b } else { a }),
        (InCell::Arms(a), InCell::Undecided(_)) | (InCell::Undecided(_), InCell::Arms(a))
            if !a.is_empty() =>
        {
            InCell::Arms(a)
        }
        _ => InCell::Undecided(PointDoubt::Rank),
    })
}

fn inside(extension: &Extension<'_>, layout: &TestLayout) -> InCell {
    let arms = match extension.reduced() {
        Reduced::Arms(arms) => arms,
        Reduced::Degenerate | Reduced::Large => {
            return InCell::Undecided(PointDoubt::kernel(extension.kernel(), &extension.units));
        }
    };
    let found = arms.iter().filter_map(|arcs| within(extension, layout, arcs));
    InCell::Arms(found.collect())
}

/// The facets of the cell of a selection whose test functions vanish: place in the list of these, and facet.
pub(super) fn facets<'f>(
    frame: &Frame<'f>,
    layout: &'f TestLayout,
    selection: &'f Selection,
) -> impl Iterator<Item = (usize, Facet)> + 'f {
    let (map, vanishing) = (frame.map, frame.vanishing);
    vanishing.iter().enumerate().flat_map(move |(place, &index)| {
        let (site, test) = layout.locate(index);
        let cell = map.cell(site, selection.piece(site)).iter();
        cell.filter(move |f| f.test() == test).map(move |f| (place, *f))
    })
}

/// An arm of the extension, if the first order of each switching function that does not vanish along it keeps it in the cell.
fn within(extension: &Extension<'_>, layout: &TestLayout, arcs: &[Arc]) -> Option<Found> {
    let frame = extension.frame;
    let followed = extension.values(arcs);
    let mut grazing = Vec::new();
    for (place, facet) in facets(frame, layout, extension.selection) {
        let sign = leading(&followed.tests[place], followed.roundings[place]);
        match f64::from(sign) * facet.sign() {
            s if s < 0.0 => return None,
            0.0 => grazing.push(frame.vanishing[place]),
            _ => {}
        }
    }
    grazing.dedup();
    let direction = leading(&followed.alpha, 0.0);
    let arc = extension.unscaled(&arcs[0]);
    let unit = norm(arc.tangent());
    let mut sites: Vec<usize> = grazing.iter().map(|&k| layout.locate(k).0).collect();
    sites.dedup();
    Some(Found {
        arm: Arm {
            selection: extension.selection.clone(),
            tangent: arc.tangent().iter().map(|t| t / unit).collect(),
            grazing: sites,
            direction,
            det_sign: None,
            probe: Vec::new(),
            order: arcs[0].order,
        },
        facets: grazing,
        arc: Some(arc),
        units: extension.units.clone(),
        unit: Some(unit),
    })
}
