//! Placement of notes beside points, with the least overlap.

use super::label::width;
use super::plane::clip;
use super::shape::{Anchor, Pixel, Shape, flat};
use super::{Frame, SMALL, text};
use crate::output::diagram::Panel;

/// Left, right, top, bottom.
type Room = (f64, f64, f64, f64);

/// Distances of a note from its point, in the order tried.
const AWAY: [f64; 4] = [9.0, 15.0, 23.0, 34.0];
/// Directions from the point, in the order tried.
const SIDES: [(f64, f64); 8] = [
    (1.0, -1.0),
    (-1.0, -1.0),
    (1.0, 1.0),
    (-1.0, 1.0),
    (0.0, -1.0),
    (0.0, 1.0),
    (1.0, 0.0),
    (-1.0, 0.0),
];

fn overlap(a: Room, b: Room) -> bool {
    a.0 < b.1 && b.0 < a.1 && a.2 < b.3 && b.2 < a.3
}

/// Every note takes the nearest place around its point that is inside the axes and covers nothing; where there is none, the one that covers
/// least.
pub(super) fn place(panel: &Panel, frame: &Frame, drawn: &[Shape]) -> Vec<Shape> {
    let mut taken: Vec<Room> = Vec::new();
    let mut out = Vec::new();
    let notes = panel.notes.iter().filter(|n| frame.holds(n.0));
    for (at, note) in notes {
        let point = frame.pixel(*at);
        let (w, h) = (width(note, SMALL), 1.1 * SMALL);
        let room = |(dx, dy): (f64, f64), away: f64| -> Room {
            // Diagonal places are as far from the point as straight ones.
            let away = if dx != 0.0 && dy != 0.0 { 0.7 * away } else { away };
            let (x, y) = (point.0 + dx * (away + 0.5 * w), point.1 + dy * (away + 0.5 * h));
            (x - 0.5 * w, x + 0.5 * w, y - 0.5 * h, y + 0.5 * h)
        };
        let mut best: Option<(usize, Room)> = None;
        for (away, side) in AWAY.iter().flat_map(|a| SIDES.iter().map(move |s| (*a, *s))) {
            let room = room(side, away);
            let (x, y) = (frame.x.ends, frame.y.ends);
            let outside = room.0 < x.0 || room.1 > x.1 || room.2 < y.1 || room.3 > y.0;
            let covered = if outside { 1000 } else { 0 }
                + 100 * taken.iter().filter(|t| overlap(room, **t)).count()
                + drawn.iter().map(|s| crossings(s, room)).sum::<usize>();
            if best.is_none_or(|(least, _)| covered < least) {
                best = Some((covered, room));
            }
            if covered == 0 {
                break;
            }
        }
        let Some((_, room)) = best else { continue };
        taken.push(room);
        let middle = (0.5 * (room.0 + room.1), 0.5 * (room.2 + room.3));
        out.push(text(note, middle, SMALL, Anchor::Middle));
    }
    out
}

/// Number of segments or marks of a shape that a place covers.
fn crossings(shape: &Shape, room: Room) -> usize {
    let covers = |ends: &[Pixel]| {
        clip(
            ends[0],
            ends[1],
            (room.0 - 2.0, room.1 + 2.0),
            (room.2 - 1.0, room.3 + 1.0),
        )
        .is_some()
    };
    match shape {
        Shape::Line { points, bends, .. } => flat(points, bends).windows(2).filter(|w| covers(w)).count(),
        Shape::Polygon { corners, .. } => {
            usize::from((0..corners.len()).any(|k| covers(&[corners[k], corners[(k + 1) % corners.len()]])))
        }
        Shape::Circle { centre, radius, .. } => {
            let (x, y, r) = (centre.0, centre.1, *radius);
            usize::from(overlap(room, (x - r, x + r, y - r, y + r)))
        }
        Shape::Text { .. } => 0,
    }
}
