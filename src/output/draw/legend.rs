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
    Unstable,
    Mark(Marker),
}

impl Entry<'_> {
    fn label(&self) -> &str {
        match self {
            Self::Class(style) => &style.name,
            Self::Negative => "det < 0",
            Self::Unstable => "unstable",
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
    let named = diagram.panels.iter().flat_map(|p| &p.classes);
    let classes = named_once(curves().flat_map(|c| &c.styles).chain(named));
    let mut entries: Vec<Entry<'_>> = classes.into_iter().map(Entry::Class).collect();
    let dashed = |by_stability| {
        let mut own = curves().filter(|c| c.by_stability == by_stability);
        own.any(|c| c.styles.iter().any(|s| s.dashed))
    };
    entries.extend(dashed(false).then_some(Entry::Negative));
    entries.extend(dashed(true).then_some(Entry::Unstable));
    let used = |kind: &Marker| curves().flat_map(|c| &c.marks).any(|m| m.0 == *kind);
    entries.extend(Marker::ALL.into_iter().filter(used).map(Entry::Mark));
    in_rows(entries, f64::from(diagram.size.0))
}

/// The classes in order of appearance, each name once, in rows.
pub(super) fn classes<'a>(
    styles: impl Iterator<Item = &'a SegmentStyle>,
    available: f64,
) -> Vec<Vec<Entry<'a>>> {
    in_rows(named_once(styles).into_iter().map(Entry::Class), available)
}

fn named_once<'a>(styles: impl Iterator<Item = &'a SegmentStyle>) -> Vec<&'a SegmentStyle> {
    let mut classes: Vec<&SegmentStyle> = Vec::new();
    for style in styles {
        if !style.name.is_empty() && !classes.iter().any(|c| c.name == style.name) {
            classes.push(style);
        }
    }
    classes
}

fn in_rows<'a>(entries: impl IntoIterator<Item = Entry<'a>>, available: f64) -> Vec<Vec<Entry<'a>>> {
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
                Entry::Negative | Entry::Unstable => shapes.push(sample(Colour::GREY, true)),
                Entry::Mark(marker) => shapes.extend(mark(*marker, (x + 0.55 * SIGN, y), 5.0)),
            }
            shapes.push(text(entry.label(), (x + SIGN, y), SMALL, Anchor::Start));
            x += entry.width();
        }
        y += ROW;
    }
}
