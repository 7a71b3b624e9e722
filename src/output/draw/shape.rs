//! Shapes of pictures. Coordinates are pixels from the upper left corner.

use super::label::Level;
use crate::output::diagram::Colour;

pub(super) type Pixel = (f64, f64);

/// What runs from one point to the next: a cubic Bézier curve with these control points, or a straight line.
pub(super) type Bend = Option<[Pixel; 2]>;

/// Chords for a cubic where only straight lines serve: of a half circle of 100 pixels they are ½ pixel away.
const CHORDS: usize = 16;

pub(super) const BLACK: Colour = Colour::new(0, 0, 0);
pub(super) const WHITE: Colour = Colour::new(255, 255, 255);

/// Lengths of dashes and of gaps between them.
pub(super) const DASHES: (f64, f64) = (7.0, 4.0);

/// The horizontal anchor of a text; vertically it is the middle of lower-case letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

#[derive(Debug)]
pub(super) enum Shape {
    Line {
        points: Vec<Pixel>,
        /// One for each but the last point; none is as good as all straight.
        bends: Vec<Bend>,
        colour: Colour,
        width: f64,
        dashed: bool,
    },
    Polygon {
        corners: Vec<Pixel>,
        fill: Colour,
        outline: Option<(Colour, f64)>,
    },
    Circle {
        centre: Pixel,
        radius: f64,
        fill: Colour,
        outline: Option<(Colour, f64)>,
    },
    Text {
        at: Pixel,
        size: f64,
        anchor: Anchor,
        /// Whether it is rotated to read upwards.
        upwards: bool,
        runs: Vec<(Level, String)>,
    },
}

/// Distance of the base line of a text below its middle, relative to its size.
pub(super) const BASE_LINE: f64 = 0.35;

/// A line with bends as a line of chords.
pub(super) fn flat(points: &[Pixel], bends: &[Bend]) -> Vec<Pixel> {
    let mut chords: Vec<Pixel> = points.first().copied().into_iter().collect();
    for (k, ends) in points.windows(2).enumerate() {
        if let Some([p, q]) = bends.get(k).copied().flatten() {
            let inner = 1..CHORDS;
            chords.extend(inner.map(|c| cubic([ends[0], p, q, ends[1]], c as f64 / CHORDS as f64)));
        }
        chords.push(ends[1]);
    }
    chords
}

/// A point of a cubic Bézier curve (de Casteljau's algorithm).
fn cubic(controls: [Pixel; 4], t: f64) -> Pixel {
    let between = |a: Pixel, b: Pixel| (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1));
    let [a, b, c, d] = controls;
    let (ab, bc, cd) = (between(a, b), between(b, c), between(c, d));
    between(between(ab, bc), between(bc, cd))
}
