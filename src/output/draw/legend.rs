//! The legend under the panels.

use super::label::width;
use super::shape::{Anchor, Shape};
use super::{CURVE, SMALL, mark, text};
use crate::output::diagram::{BranchDiagram, Colour, Marker, SegmentStyle};

/// Height of a row.
pub(super) const ROW: f64 = 22.0;
/// Width of the sample before a name, and the gap after it.
const SIGN: f64 = 30.0;
const GAP: f64 = 18.0;

pub(super) enum Entry<'a> {
    Class(&'a SegmentStyle),
    Negative,
    Mark(Marker),
}

impl Entry<'_> {
    fn label(&self) -> &str {
        match self {
            Self::Class(style) => &style.name,
            Self::Negative => "det < 0",
            Self::Mark(marker) => marker.name(),
        }
    }

    fn width(&self) -> f64 {
        SIGN + width(self.label(), SMALL) + GAP
    }
}

/// The classes in order of appearance, then the marks in use, in rows.
pub(super) fn rows(diagram: &BranchDiagram) -> Vec<Vec<Entry<'_>>> {
    let curves = || diagram.panels.iter().flat_map(|p| &p.curves);
    let mut classes: Vec<&SegmentStyle> = Vec::new();
    let named = diagram.panels.iter().flat_map(|p| &p.classes);
    for style in curves().flat_map(|c| &c.styles).chain(named) {
        if !style.name.is_empty() && !classes.iter().any(|c| c.name == style.name) {
            classes.push(style);
        }
    }
    let mut entries: Vec<Entry<'_>> = classes.into_iter().map(Entry::Class).collect();
    if curves().flat_map(|c| &c.styles).any(|s| s.dashed) {
        entries.push(Entry::Negative);
    }
    let used = |kind: &Marker| curves().flat_map(|c| &c.marks).any(|m| m.0 == *kind);
    entries.extend(Marker::ALL.into_iter().filter(used).map(Entry::Mark));
    let available = f64::from(diagram.size.0);
    let mut rows: Vec<Vec<Entry<'_>>> = Vec::new();
    let mut taken = available;
    for entry in entries {
        if taken + entry.width() > available || rows.is_empty() {
            rows.push(Vec::new());
            taken = 0.0;
        }
        taken += entry.width();
        if let Some(row) = rows.last_mut() {
            row.push(entry);
        }
    }
    rows
}

pub(super) fn draw(shapes: &mut Vec<Shape>, rows: &[Vec<Entry<'_>>], width: f64, top: f64) {
    let mut y = top + 0.5 * ROW;
    for row in rows {
        let total: f64 = row.iter().map(Entry::width).sum();
        let mut x = ((width - total + GAP) / 2.0).max(4.0);
        for entry in row {
            let sample = |colour: Colour, dashed: bool| Shape::Line {
                points: vec![(x, y), (x + SIGN - 6.0, y)],
                bends: Vec::new(),
                colour,
                width: CURVE + 0.5,
                dashed,
            };
            match entry {
                Entry::Class(class) => shapes.push(sample(class.colour, false)),
                Entry::Negative => shapes.push(sample(Colour::GREY, true)),
                Entry::Mark(marker) => shapes.extend(mark(*marker, (x + 0.55 * SIGN, y), 5.0)),
            }
            shapes.push(text(entry.label(), (x + SIGN, y), SMALL, Anchor::Start));
            x += entry.width();
        }
        y += ROW;
    }
}
