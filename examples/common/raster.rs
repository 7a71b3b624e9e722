//! Values at points of a square as pictures.
#![allow(dead_code)]

use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};

/// Cells of a picture each way; finer grids are thinned out.
const MOST: usize = 250;

/// Adds the colours of m × m points, numbered line by line from below, to a panel that shows the box from `low` to `high`: runs of equal
/// ones are one region.
pub(crate) fn raster(
    mut panel: Panel,
    m: usize,
    [low, high]: [[f64; 2]; 2],
    colour: impl Fn(usize) -> Option<Colour>,
) -> Panel {
    let cells = m.min(MOST);
    let at = |i: usize, j: usize| colour((j * m / cells) * m + i * m / cells);
    let place = |d: usize, k: usize| low[d] + (high[d] - low[d]) * k as f64 / cells as f64;
    for j in 0..cells {
        let mut i = 0;
        while i < cells {
            let (first, kind) = (i, at(i, j));
            while i < cells && at(i, j) == kind {
                i += 1;
            }
            if let Some(colour) = kind {
                let [left, right] = [first, i].map(|k| place(0, k));
                let [below, above] = [j, j + 1].map(|k| place(1, k));
                let corners = vec![(left, below), (right, below), (right, above), (left, above)];
                panel = panel.with_region(corners, colour);
            }
        }
    }
    panel.with_x_range(low[0], high[0]).with_y_range(low[1], high[1])
}

/// The unit square.
pub(crate) const UNIT: [[f64; 2]; 2] = [[0.0, 0.0], [1.0, 1.0]];

/// Between two colours, `share` of the second, in 32 steps: few shades make long runs of equal cells.
pub(crate) fn blend(a: Colour, b: Colour, share: f64) -> Colour {
    let share = (share.clamp(0.0, 1.0) * 32.0).round() / 32.0;
    let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
    Colour::new(mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue))
}

/// Names in the legend.
pub(crate) fn with_classes(panel: Panel, classes: &[(&'static str, Colour)]) -> Panel {
    let classes = classes
        .iter()
        .map(|&(name, colour)| SegmentStyle::new(name, colour));
    classes.fold(panel, Panel::with_class)
}

/// A picture whose axes are of about equal length.
pub(crate) fn square(panel: Panel, title: &str) -> BranchDiagram {
    BranchDiagram::new(panel).with_title(title).with_size(600, 640)
}
