//! Shapes of pictures. Coordinates are pixels from the upper left corner.

use super::label::Level;
use crate::output::diagram::Colour;

pub(super) type Pixel = (f64, f64);

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
