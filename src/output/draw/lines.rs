//! Curves as straight lines and cubic Bézier curves, with arrows.

use super::plane::{Point, clip};
use super::shape::{Bend, Pixel, Shape, flat};
use super::{CURVE, Frame, distance};
use crate::output::diagram::{Colour, Curve, SegmentStyle};

/// Length of curve per arrow, and length below which a stretch has none.
const ARROW_EVERY: f64 = 170.0;
const ARROW_ROOM: f64 = 34.0;
/// Inner vertices of a stretch closer than this to the one before are left out.
const THIN: f64 = 0.3;
/// Distance in pixels from the chord up to which an arc is a straight line: no screen shows it, and a page
/// printed at 600 dots an inch has six dots a pixel.
const STRAIGHT: f64 = 0.05;

/// A part of a curve in one style.
#[derive(Default)]
struct Stretch {
    points: Vec<Pixel>,
    /// What runs from each point to the next.
    bends: Vec<Bend>,
}

impl Stretch {
    /// Appends what runs from the last point to another one; nothing where they are the same.
    fn push(&mut self, bend: Bend, to: Pixel) {
        if self.points.last() != Some(&to) {
            self.points.push(to);
            self.bends.push(bend);
        }
    }

    /// Without inner points that are close to those before; control points move by less than the distance.
    fn thinned(&self) -> Self {
        let mut kept = Self::default();
        for (k, &p) in self.points.iter().enumerate() {
            let near = kept.points.last().is_some_and(|q| distance(*q, p) <= THIN);
            if near && k + 1 < self.points.len() {
                continue;
            }
            kept.points.push(p);
            kept.bends
                .extend(k.checked_sub(1).and_then(|before| self.bends.get(before)));
        }
        kept
    }
}

/// The cubic from a to b with these directions at its ends: their lengths do not matter. On a parabola, which
/// short arcs of smooth curves are nearly, it is the parabola, whatever the scales of the axes: its control
/// points are at two thirds of the ways to the point where the tangents meet. Where they meet behind the
/// ends, as at a point of inflection, they are at a third of the chord. Straight where it hardly leaves the
/// chord, or where an end has no direction.
pub(super) fn bend(a: Pixel, b: Pixel, [from, to]: [Pixel; 2]) -> Bend {
    let unit = |d: Pixel| {
        let length = d.0.hypot(d.1);
        (length > 0.0 && length.is_finite()).then(|| (d.0 / length, d.1 / length))
    };
    let cross = |p: Pixel, q: Pixel| p.0 * q.1 - p.1 * q.0;
    let (from, to, along) = (unit(from)?, unit(to)?, unit((b.0 - a.0, b.1 - a.1))?);
    let chord = distance(a, b);
    // Distances to the common point of the tangents, in chords (law of sines).
    let turn = cross(from, to);
    let (ahead, behind) = (cross(along, to) / turn, cross(from, along) / turn);
    // Arcs of half a circle and more have no such point, or one far away.
    let (ahead, behind) = match ahead > 0.0 && behind > 0.0 {
        true => (ahead.min(1.0) * 2.0 / 3.0, behind.min(1.0) * 2.0 / 3.0),
        false => (1.0 / 3.0, 1.0 / 3.0),
    };
    let controls = [
        (a.0 + ahead * chord * from.0, a.1 + ahead * chord * from.1),
        (b.0 - behind * chord * to.0, b.1 - behind * chord * to.1),
    ];
    let away = |p: Pixel| cross((p.0 - a.0, p.1 - a.1), along).abs();
    // A cubic is at most ¾ as far away as its control points.
    let leaves = controls.iter().any(|p| 0.75 * away(*p) > STRAIGHT);
    leaves.then_some(controls)
}

impl Frame {
    /// Whether a pixel lies inside the axes.
    fn shows(&self, p: Pixel) -> bool {
        let (x, y) = (self.x.ends, self.y.ends);
        (x.0..=x.1).contains(&p.0) && (y.1..=y.0).contains(&p.1)
    }

    /// What is seen of a segment of a curve: its parts, from one pixel to another.
    fn parts(&self, ends: &[Point], tangents: Option<&[Point; 2]>) -> Vec<(Pixel, Bend, Pixel)> {
        let (a, b) = (self.pixel(ends[0]), self.pixel(ends[1]));
        let scale = |axis: super::Axis| (axis.ends.1 - axis.ends.0) / (axis.range.1 - axis.range.0);
        let (x, y) = (scale(self.x), scale(self.y));
        let bent = tangents.and_then(|t| bend(a, b, t.map(|(dx, dy)| (x * dx, y * dy))));
        let Some(controls) = bent else {
            let seen = self.clip(ends[0], ends[1]);
            return seen.map(|(a, b)| (a, None, b)).into_iter().collect();
        };
        if [a, controls[0], controls[1], b].iter().all(|p| self.shows(*p)) {
            return vec![(a, bent, b)];
        }
        let chords = flat(&[a, b], &[bent]);
        let (x, y) = (self.x.ends, (self.y.ends.1, self.y.ends.0));
        let seen = chords.windows(2).filter_map(|w| clip(w[0], w[1], x, y));
        seen.map(|(a, b)| (a, None, b)).collect()
    }
}

pub(super) fn draw(shapes: &mut Vec<Shape>, curve: &Curve, frame: &Frame) {
    let mut stretch = Stretch::default();
    let mut current: Option<&SegmentStyle> = None;
    for (k, (ends, style)) in curve.vertices.windows(2).zip(&curve.styles).enumerate() {
        let parts = frame.parts(ends, curve.tangents.get(k));
        if parts.is_empty() {
            finish(shapes, &mut stretch, current, curve.arrows);
        }
        for (a, bend, b) in parts {
            if current != Some(style) || stretch.points.last() != Some(&a) {
                finish(shapes, &mut stretch, current, curve.arrows);
                current = Some(style);
                stretch.points.push(a);
            }
            stretch.push(bend, b);
        }
    }
    finish(shapes, &mut stretch, current, curve.arrows);
}

fn finish(shapes: &mut Vec<Shape>, stretch: &mut Stretch, style: Option<&SegmentStyle>, arrows: bool) {
    let stretch = std::mem::take(stretch);
    let Some(style) = style.filter(|_| stretch.points.len() > 1) else {
        return;
    };
    let Stretch { points, bends } = stretch.thinned();
    shapes.push(Shape::Line {
        points,
        bends,
        colour: style.colour,
        width: CURVE,
        dashed: style.dashed,
    });
    if arrows {
        draw_arrows(shapes, &flat(&stretch.points, &stretch.bends), style.colour);
    }
}

/// Arrow heads in the direction of the curve, evenly spaced along the stretch.
fn draw_arrows(shapes: &mut Vec<Shape>, stretch: &[Pixel], colour: Colour) {
    let total: f64 = stretch.windows(2).map(|w| distance(w[0], w[1])).sum();
    if total < ARROW_ROOM {
        return;
    }
    let count = (total / ARROW_EVERY).round().max(1.0);
    let mut travelled = 0.0;
    let mut next = 0.5 * total / count;
    for w in stretch.windows(2) {
        let step = distance(w[0], w[1]);
        let (c, s) = ((w[1].0 - w[0].0) / step, (w[1].1 - w[0].1) / step);
        while next < travelled + step {
            let t = next - travelled;
            let at = (w[0].0 + t * c, w[0].1 + t * s);
            let corner =
                |along: f64, across: f64| (at.0 + along * c - across * s, at.1 + along * s + across * c);
            shapes.push(Shape::Polygon {
                corners: vec![corner(7.0, 0.0), corner(-5.0, 5.0), corner(-5.0, -5.0)],
                fill: colour,
                outline: None,
            });
            next += total / count;
        }
        travelled += step;
    }
}
