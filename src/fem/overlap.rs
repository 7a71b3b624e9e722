//! Where two facets of a pair of boundaries lie opposite each other: exact pieces, with points of integration on both.

use super::Mesh;
use super::element::{MAX_FACET, Reference};
use super::place::Place;
use super::vectors::{cross, difference, dot, mean, norm};
use crate::tolerances::SAME;

/// Newton steps, and their tolerance in reference coordinates, for the inverse of a bilinear map; convex facets need few.
const STEPS: usize = 30;
const CONVERGED: f64 = 1e-15;
/// Gauss points in each direction of a triangle: exact for products of functions on triangles and parallelograms (degree 4, in which one
/// function is of second order 6), and for other quadrilaterals, where integrands are not polynomials, to rounding unless they are very
/// distorted.
const FEW: usize = 3;
const SECOND: usize = 4;
const MANY: usize = 10;

/// A facet with its geometry.
#[derive(Debug, Clone)]
pub(super) struct Side<'a> {
    pub(super) nodes: &'a [usize],
    reference: Reference,
    /// Positions of the nodes, the corners first.
    points: Vec<[f64; 3]>,
    /// The linear functions of the corners at the nodes.
    linear: Vec<[f64; 4]>,
    pub(super) centre: [f64; 3],
    /// Unit outward normal, and length or area, of the facet with straight edges between the corners.
    pub(super) normal: [f64; 3],
    pub(super) measure: f64,
    pub(super) radius: f64,
}

/// A point of integration on one facet and the point opposite on another.
pub(super) struct Meeting {
    /// Weight × measure on the first, and reference coordinates there.
    pub(super) weight: f64,
    pub(super) x: [f64; 2],
    /// Shape values of both.
    pub(super) own: [f64; MAX_FACET],
    pub(super) other: [f64; MAX_FACET],
    /// The point on the first facet, and the way to the other.
    pub(super) at: [f64; 3],
    pub(super) way: [f64; 3],
}

impl<'a> Side<'a> {
    pub(super) fn new(mesh: &'a Mesh, nodes: &'a [usize]) -> Self {
        let reference = Reference::of_facet(mesh.dim(), nodes.len());
        let area = mesh.area_vector(&nodes[..reference.num_corners()]);
        Self::of(reference, mesh.points(), nodes, area)
    }

    fn of(reference: Reference, points: &[[f64; 3]], nodes: &'a [usize], area: [f64; 3]) -> Self {
        let points: Vec<_> = nodes.iter().map(|&n| points[n]).collect();
        let (centre, measure) = (mean(points.iter().copied()), norm(area));
        let far = |c: &[f64; 3]| norm(difference(*c, centre));
        let hats = |x: &[f64; 3]| {
            let (mut values, mut slopes) = ([0.0; 4], [[0.0; 3]; 4]);
            reference.linear().functions(*x, &mut values, &mut slopes);
            values
        };
        Self {
            nodes,
            reference,
            centre,
            normal: area.map(|x| x / measure),
            measure,
            radius: points.iter().map(far).fold(0.0, f64::max),
            points,
            linear: reference.points().iter().map(hats).collect(),
        }
    }

    /// Number of corners; other nodes are the middles of edges and of the face.
    pub(super) fn num_corners(&self) -> usize {
        self.reference.num_corners()
    }

    fn corners(&self) -> &[[f64; 3]] {
        &self.points[..self.num_corners()]
    }

    /// The linear functions of the corners, from the shape values of all nodes.
    pub(super) fn hats(&self, shape: &[f64]) -> [f64; 4] {
        let mut hats = [0.0; 4];
        for (linear, s) in self.linear.iter().zip(shape) {
            (0..4).for_each(|k| hats[k] += linear[k] * s);
        }
        hats
    }

    /// Shape values at reference coordinates.
    fn shape(&self, x: [f64; 2]) -> [f64; MAX_FACET] {
        let (mut values, mut slopes) = ([0.0; MAX_FACET], [[0.0; 3]; MAX_FACET]);
        self.reference
            .functions([x[0], x[1], 0.0], &mut values, &mut slopes);
        values
    }

    /// The linear functions of the corners at the point of this facet nearest to a point, as seen along the normal of the facet with straight
    /// edges.
    pub(super) fn hats_at(&self, at: [f64; 3]) -> [f64; 4] {
        let x = match self.corners() {
            [a, b] => {
                let along = difference(*b, *a);
                let s = dot(difference(at, *a), along) / self.measure.powi(2);
                Some([2.0 * s.clamp(0.0, 1.0) - 1.0, 0.0])
            }
            corners => {
                let axes = self.axes();
                let corners: Vec<_> = corners.iter().map(|c| self.flat(&axes, c)).collect();
                let x = inverted(&corners, self.flat(&axes, &at));
                x.map(|x| match self.reference.is_simplex() {
                    true => x,
                    false => x.map(|s| s.clamp(-1.0, 1.0)),
                })
            }
        };
        // Facets too skew to be inverted are no elements that a mesh can have.
        let shape = self.shape(x.unwrap_or_default());
        self.hats(&shape[..self.nodes.len()])
    }

    /// The unit normal at reference coordinates, and the measure there over that of the facet with straight edges.
    pub(super) fn stretched(&self, x: [f64; 2]) -> ([f64; 3], f64) {
        let (dim, x) = (1 + self.reference.dim(), [x[0], x[1], 0.0]);
        let area = |reference: Reference| {
            let (mut values, mut slopes) = ([0.0; MAX_FACET], [[0.0; 3]; MAX_FACET]);
            reference.functions(x, &mut values, &mut slopes);
            let nodes: [usize; MAX_FACET] = std::array::from_fn(|k| k);
            let nodes = &nodes[..reference.nodes];
            Place::of(&values[..nodes.len()], &slopes, &self.points, nodes).measure(dim)
        };
        let ((own, normal), (straight, _)) = (area(self.reference), area(self.reference.linear()));
        (normal, own / straight)
    }

    /// Axes in the plane of the facet.
    fn axes(&self) -> [[f64; 3]; 2] {
        let first = difference(self.points[1], self.points[0]);
        let first = first.map(|x| x / norm(first));
        let along = dot(first, self.normal);
        let first: [f64; 3] = std::array::from_fn(|d| first[d] - along * self.normal[d]);
        [first, cross(self.normal, first)].map(|a| a.map(|x| x / norm(a)))
    }

    /// Coordinates in the plane of the facet, in units of its size.
    fn flat(&self, axes: &[[f64; 3]; 2], c: &[f64; 3]) -> [f64; 2] {
        axes.map(|a| dot(difference(*c, self.centre), a) / self.radius)
    }

    /// Whether the other facet may lie opposite this one, along its normal and not further than `reach`.
    pub(super) fn may_face(&self, other: &Self, reach: f64) -> bool {
        let way = difference(other.centre, self.centre);
        let along = dot(way, self.normal);
        let beside = std::array::from_fn(|d| way[d] - along * self.normal[d]);
        dot(self.normal, other.normal) < 0.0
            && norm(beside) <= self.radius + other.radius
            && along.abs() <= reach + other.radius
    }

    fn at(&self, shape: &[f64]) -> [f64; 3] {
        let sum = |d: usize| self.points.iter().zip(shape).map(|(c, s)| s * c[d]).sum();
        std::array::from_fn(sum)
    }

    /// Calls `f` at points of integration of the part of this facet that `other` covers, seen along the normal of this one. Marks the
    /// corners that belong to this part.
    pub(super) fn meet(&self, other: &Self, covered: &mut [bool; 4], mut f: impl FnMut(Meeting)) {
        let mut add = |weight: f64, x: [f64; 2], y: [f64; 2]| {
            let (own, opposite) = (self.shape(x), other.shape(y));
            let at = self.at(&own);
            f(Meeting {
                weight,
                x,
                at,
                way: difference(other.at(&opposite), at),
                own,
                other: opposite,
            });
        };
        if self.reference.dim() == 1 {
            self.meet_segment(other, covered, &mut add);
        } else {
            self.meet_polygon(other, covered, &mut add);
        }
    }

    fn meet_segment(
        &self,
        other: &Self,
        covered: &mut [bool; 4],
        add: &mut impl FnMut(f64, [f64; 2], [f64; 2]),
    ) {
        let along = difference(self.points[1], self.points[0]);
        let place = |c: usize| dot(difference(other.points[c], self.points[0]), along) / self.measure.powi(2);
        let ends = [place(0), place(1)];
        let (low, high) = (ends[0].min(ends[1]).max(0.0), ends[0].max(ends[1]).min(1.0));
        if low >= high {
            return;
        }
        covered[0] |= low <= SAME;
        covered[1] |= high >= 1.0 - SAME;
        for (x, weight) in gauss(FEW) {
            let s = low + (high - low) * x;
            let t = (s - ends[0]) / (ends[1] - ends[0]);
            let weight = weight * (high - low) * self.measure;
            add(weight, [2.0 * s - 1.0, 0.0], [2.0 * t - 1.0, 0.0]);
        }
    }

    fn meet_polygon(
        &self,
        other: &Self,
        covered: &mut [bool; 4],
        add: &mut impl FnMut(f64, [f64; 2], [f64; 2]),
    ) {
        let axes = self.axes();
        let flat = |c: &[f64; 3]| self.flat(&axes, c);
        let own: Vec<_> = self.corners().iter().map(flat).collect();
        let opposite: Vec<_> = other.corners().iter().map(flat).collect();
        let part = clipped(&opposite, &own);
        if part.len() < 3 {
            return;
        }
        for (corner, covered) in own.iter().zip(covered.iter_mut()) {
            *covered |= part
                .iter()
                .any(|p| (p[0] - corner[0]).hypot(p[1] - corner[1]) <= SAME);
        }
        let is_second = self.nodes.len() > own.len() || other.nodes.len() > opposite.len();
        let points = gauss(match is_affine(&own) && is_affine(&opposite) {
            true if is_second => SECOND,
            true => FEW,
            false => MANY,
        });
        for k in 1..part.len() - 1 {
            let [a, b, c] = [part[0], part[k], part[k + 1]];
            let twice = turn(a, b, c) * self.radius * self.radius;
            if twice <= 0.0 {
                continue;
            }
            // The unit square with one side collapsed.
            for &(x, wx) in &points {
                for &(y, wy) in &points {
                    let p = [0, 1].map(|d| (1.0 - x) * a[d] + x * ((1.0 - y) * b[d] + y * c[d]));
                    if let (Some(x0), Some(y0)) = (inverted(&own, p), inverted(&opposite, p)) {
                        add(wx * wy * x * twice, x0, y0);
                    }
                }
            }
        }
    }
}

/// Twice the signed area of a triangle.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The part of a convex polygon inside another one that is numbered counter-clockwise (I. Sutherland, G. Hodgman, Comm. ACM 17 (1974)),
/// counter-clockwise if the first is clockwise, as facets opposite each other are.
fn clipped(subject: &[[f64; 2]], window: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut part: Vec<[f64; 2]> = subject.iter().rev().copied().collect();
    for (k, &a) in window.iter().enumerate() {
        let b = window[(k + 1) % window.len()];
        let side: Vec<f64> = part.iter().map(|p| turn(a, b, *p)).collect();
        let mut kept = Vec::with_capacity(part.len() + 1);
        for i in 0..part.len() {
            let j = (i + 1) % part.len();
            if side[i] >= 0.0 {
                kept.push(part[i]);
            }
            if (side[i] > 0.0 && side[j] < 0.0) || (side[i] < 0.0 && side[j] > 0.0) {
                let s = side[i] / (side[i] - side[j]);
                kept.push([0, 1].map(|d| part[i][d] + s * (part[j][d] - part[i][d])));
            }
        }
        part = kept;
    }
    part
}

/// Whether shape functions are polynomials in the plane: triangles and parallelograms.
fn is_affine(corners: &[[f64; 2]]) -> bool {
    let skew = |d: usize| (corners[0][d] + corners[2][d] - corners[1][d] - corners[3][d]).abs();
    corners.len() == 3 || skew(0).max(skew(1)) <= SAME
}

/// Reference coordinates of a point in a triangle or quadrilateral of first order.
fn inverted(corners: &[[f64; 2]], p: [f64; 2]) -> Option<[f64; 2]> {
    if let &[a, b, c] = corners {
        let all = turn(a, b, c);
        return (all != 0.0).then(|| [turn(a, p, c) / all, turn(a, b, p) / all]);
    }
    let mut x = [0.5; 2];
    for _ in 0..STEPS {
        let [s, t] = x;
        let at = |w: [f64; 4]| [0, 1].map(|d| (0..4).map(|k| w[k] * corners[k][d]).sum::<f64>());
        let (q, u, v) = (
            at([(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]),
            at([t - 1.0, 1.0 - t, t, -t]),
            at([s - 1.0, -s, s, 1.0 - s]),
        );
        let (r, det) = ([p[0] - q[0], p[1] - q[1]], u[0] * v[1] - u[1] * v[0]);
        if det == 0.0 {
            return None;
        }
        let step = [
            (r[0] * v[1] - r[1] * v[0]) / det,
            (u[0] * r[1] - u[1] * r[0]) / det,
        ];
        x = [s + step[0], t + step[1]];
        if step[0].abs().max(step[1].abs()) <= CONVERGED {
            break;
        }
    }
    let x = x.map(|s| 2.0 * s - 1.0);
    x.iter().all(|s| s.is_finite()).then_some(x)
}

/// Gauss points and weights on (0, 1).
fn gauss(n: usize) -> Vec<(f64, f64)> {
    let point = |k: usize| {
        let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..STEPS {
            // Legendre polynomials by their recursion, and the derivative of the last one.
            let (mut p, mut before) = (x, 1.0);
            for m in 2..=n {
                let m = m as f64;
                (p, before) = (((2.0 * m - 1.0) * x * p - (m - 1.0) * before) / m, p);
            }
            slope = n as f64 * (before - x * p) / (1.0 - x * x);
            let step = p / slope;
            x -= step;
            if step.abs() <= CONVERGED {
                break;
            }
        }
        (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_rules_are_exact_to_their_degree() {
        for n in [1, 2, FEW, MANY] {
            let rule = gauss(n);
            for degree in 0..2 * n {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                // The weights contain 1 − x², which is about 1/n² at the outermost points and has lost digits.
                assert!(
                    (sum * (degree as f64 + 1.0) - 1.0).abs() < 4.0 * (n * n) as f64 * f64::EPSILON,
                    "{n} {degree} {sum}"
                );
            }
        }
    }

    /// The common part of a square and a turned one is an octagon; integrals over it come from both descriptions of its points.
    #[test]
    fn clipped_squares_have_the_common_area() {
        let h = 0.5f64.sqrt() * 2.0 * 0.9;
        let points = [
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [h, 0.0, 0.25],
            [0.0, -h, 0.25],
            [-h, 0.0, 0.25],
            [0.0, h, 0.25],
        ];
        let own = Side::of(Reference::of_facet(3, 4), &points, &[0, 1, 2, 3], [0.0, 0.0, 4.0]);
        let other = Side::of(
            Reference::of_facet(3, 4),
            &points,
            &[4, 5, 6, 7],
            [0.0, 0.0, -2.0 * h * h],
        );
        assert!(own.may_face(&other, 0.25) && !own.may_face(&own, 1.0));
        let (mut area, mut second, mut covered) = (0.0, 0.0, [false; 4]);
        own.meet(&other, &mut covered, |m| {
            area += m.weight;
            second += m.weight * (m.at[0].powi(2) + m.at[1].powi(2));
            assert!((m.way[0].abs() + m.way[1].abs()) < 1e-13 && (m.way[2] - 0.25).abs() < 1e-14);
        });
        // Four corners of legs 2 − h are cut off the square.
        let leg = 2.0 - h;
        assert!((area - (4.0 - 2.0 * leg * leg)).abs() < 1e-13);
        let corner = leg * leg / 2.0;
        let centre = 1.0 - leg / 3.0;
        let moment = 2.0 * (corner * centre * centre + leg.powi(4) / 36.0);
        assert!((second - (8.0 / 3.0 - 4.0 * moment)).abs() < 1e-13);
        assert_eq!(covered, [false; 4]);
    }

    #[test]
    fn quadrilaterals_are_inverted() {
        let corners = [[-1.0, -0.8], [1.2, -1.0], [0.7, 1.0], [-0.9, 0.6]];
        for (s, t) in [(0.0, 0.0), (1.0, 0.3), (0.4, 0.9)] {
            let shape = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
            let p = [0, 1].map(|d| (0..4).map(|k| shape[k] * corners[k][d]).sum::<f64>());
            let found = inverted(&corners, p).unwrap();
            assert!((found[0] - (2.0 * s - 1.0)).abs() < 1e-14 && (found[1] - (2.0 * t - 1.0)).abs() < 1e-14);
        }
    }
}
