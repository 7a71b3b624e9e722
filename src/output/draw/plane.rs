//! Plane geometry of diagrams: ranges of axes and clipping, degenerate cases included.

/// Largest magnitude that is drawn: differences and products of such numbers stay finite.
pub(super) const LARGEST: f64 = 1e100;

pub(in crate::output) type Point = (f64, f64);

/// A range of an axis, (lower, upper).
pub(in crate::output) type Range = (f64, f64);

pub(super) fn drawable(p: Point) -> bool {
    p.0.abs() <= LARGEST && p.1.abs() <= LARGEST
}

/// The range of some values with a margin; degenerate ones are widened until tick marks are distinct in `f64`.
pub(super) fn padded_range(values: impl Iterator<Item = f64>) -> Option<Range> {
    let (lower, upper) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
        (a.min(v), b.max(v))
    });
    if lower > upper {
        return None;
    }
    let magnitude = lower.abs().max(upper.abs());
    let span = upper - lower;
    if span <= 1e-9 * magnitude || span < 1e-100 {
        let pad = if magnitude < 1e-100 { 1.0 } else { 0.5 * magnitude };
        return Some((lower - pad, upper + pad));
    }
    Some((lower - 0.06 * span, upper + 0.06 * span))
}

/// The part of the segment a–b inside the box (Liang–Barsky).
pub(super) fn clip(a: Point, b: Point, x: Range, y: Range) -> Option<(Point, Point)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let sides = [
        (-dx, a.0 - x.0),
        (dx, x.1 - a.0),
        (-dy, a.1 - y.0),
        (dy, y.1 - a.1),
    ];
    for (rate, room) in sides {
        if rate == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if rate < 0.0 {
            enter = enter.max(room / rate);
        } else {
            leave = leave.min(room / rate);
        }
    }
    let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
    (enter <= leave).then(|| {
        (
            if enter > 0.0 { at(enter) } else { a },
            if leave < 1.0 { at(leave) } else { b },
        )
    })
}

/// The part of a convex polygon inside the box (Sutherland–Hodgman); empty where there is none.
pub(super) fn clip_region(corners: &[Point], x: Range, y: Range) -> Vec<Point> {
    // (coordinate, sign, bound): the part kept satisfies sign · coordinate ≤ sign · bound.
    type Side = (fn(Point) -> f64, f64, f64);
    let sides: [Side; 4] = [
        (|p| p.0, -1.0, x.0),
        (|p| p.0, 1.0, x.1),
        (|p| p.1, -1.0, y.0),
        (|p| p.1, 1.0, y.1),
    ];
    let mut kept = corners.to_vec();
    for (coordinate, sign, bound) in sides {
        let room = |p: Point| sign * (bound - coordinate(p));
        let corners = std::mem::take(&mut kept);
        for (k, &b) in corners.iter().enumerate() {
            let a = corners[(k + corners.len() - 1) % corners.len()];
            let (ra, rb) = (room(a), room(b));
            if (ra < 0.0) != (rb < 0.0) {
                let t = ra / (ra - rb);
                kept.push((a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1)));
            }
            if rb >= 0.0 {
                kept.push(b);
            }
        }
    }
    kept
}

pub(super) fn inside(p: Point, x: Range, y: Range) -> bool {
    (x.0..=x.1).contains(&p.0) && (y.0..=y.1).contains(&p.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_ranges_are_widened() {
        assert_eq!(padded_range(std::iter::empty()), None);
        assert_eq!(padded_range([0.0].into_iter()), Some((-1.0, 1.0)));
        assert_eq!(padded_range([2.0, 2.0].into_iter()), Some((1.0, 3.0)));
        // Pixels are shares of the range, which must not underflow.
        assert_eq!(padded_range([0.0, 1e-320].into_iter()), Some((-1.0, 1.0)));
        let (a, b) = padded_range([1.0, 1.0 + 1e-15].into_iter()).unwrap();
        assert!(b - a > 0.5);
        let (a, b) = padded_range([-LARGEST, LARGEST].into_iter()).unwrap();
        assert!((b - a).is_finite());
    }

    #[test]
    fn clipping_keeps_what_is_inside() {
        let unit = (0.0, 1.0);
        assert_eq!(
            clip((-1.0, 0.5), (2.0, 0.5), unit, unit),
            Some(((0.0, 0.5), (1.0, 0.5)))
        );
        assert_eq!(clip((2.0, 0.0), (2.0, 1.0), unit, unit), None);
        assert_eq!(
            clip((0.5, 0.5), (0.5, 0.5), unit, unit),
            Some(((0.5, 0.5), (0.5, 0.5)))
        );
    }

    #[test]
    fn regions_are_cut_at_the_box() {
        let area = |p: &[Point]| -> f64 {
            let next = |k: usize| p[(k + 1) % p.len()];
            (0..p.len())
                .map(|k| p[k].0 * next(k).1 - next(k).0 * p[k].1)
                .sum::<f64>()
                / 2.0
        };
        let unit = (0.0, 1.0);
        let diamond = [(1.0, 0.0), (2.0, 1.0), (1.0, 2.0), (0.0, 1.0)];
        assert_eq!(clip_region(&diamond, (-1.0, 3.0), (-1.0, 3.0)), diamond);
        let corner = clip_region(&diamond, unit, unit);
        assert!((area(&corner) - 0.5).abs() < 1e-15, "{corner:?}");
        assert!(clip_region(&diamond, (5.0, 6.0), unit).is_empty());
        assert!(clip_region(&[], unit, unit).is_empty());
    }
}
