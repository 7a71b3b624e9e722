//! Maps with known curves.

use crate::maps::{Plane, two_pieces};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::piecewise::{Derivatives, PiecewiseSmooth, Selection, Structure};
use semismooth::sparse::{Matrix, Pattern};

/// An elastic string with n nodes under the load α, above point obstacles at `sites` (node, gap): the rows are
/// K y + α/(n+1)² or, in contact, y + gap.
pub(crate) struct StringOnPoints {
    pub(crate) n: usize,
    pub(crate) sites: Vec<(usize, f64)>,
}

impl StringOnPoints {
    fn unit(&self) -> f64 {
        (self.n as f64 + 1.0).powi(-2)
    }

    fn force(&self, i: usize, x: &[f64]) -> f64 {
        let left = if i > 0 { x[i - 1] } else { 0.0 };
        let right = if i + 1 < self.n { x[i + 1] } else { 0.0 };
        2.0 * x[i] - left - right + x[self.n] * self.unit()
    }

    /// The parameters at which the sites come into contact, in order: between two supports the string is a parabola.
    pub(crate) fn contacts(&self) -> Vec<(f64, usize)> {
        let place = |node: usize| (node as f64 + 1.0) / (self.n as f64 + 1.0);
        let mut supports = vec![(0.0, 0.0), (1.0, 0.0)];
        let mut left: Vec<usize> = (0..self.sites.len()).collect();
        let mut order = Vec::new();
        while !left.is_empty() {
            let touch = |k: usize| {
                let (s, y) = (place(self.sites[k].0), -self.sites[k].1);
                let at = supports.iter().position(|p| p.0 > s).unwrap();
                let ((a, ya), (b, yb)) = (supports[at - 1], supports[at]);
                let chord = ya + (yb - ya) * (s - a) / (b - a);
                2.0 * (chord - y) / ((s - a) * (b - s))
            };
            let next = *left
                .iter()
                .min_by(|&&i, &&j| touch(i).total_cmp(&touch(j)))
                .unwrap();
            order.push((touch(next), next));
            left.retain(|&k| k != next);
            supports.push((place(self.sites[next].0), -self.sites[next].1));
            supports.sort_by(|p, q| p.0.total_cmp(&q.0));
        }
        order
    }
}

impl PiecewiseSmooth for StringOnPoints {
    two_pieces!(self, [positive, negative], self.n + 1, self.n, self.sites.len());
    fn pattern(&self) -> Pattern {
        let near = |i: usize| i.saturating_sub(1)..(i + 2).min(self.n);
        let entries = (0..self.n).flat_map(|i| near(i).map(move |j| (i, j)).chain([(i, self.n)]));
        Pattern::from_entries(self.n, self.n + 1, entries.collect::<Vec<_>>()).unwrap()
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (o, &(i, gap)) in out.iter_mut().zip(&self.sites) {
            *o = x[i] + gap - self.force(i, x);
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for i in 0..self.n {
            out[i] = self.force(i, x);
        }
        for (k, &(i, gap)) in self.sites.iter().enumerate() {
            if s.piece(k) == 1 {
                out[i] = x[i] + gap;
            }
        }
    }
    fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
        for i in 0..self.n {
            let site = self.sites.iter().position(|site| site.0 == i);
            if site.is_some_and(|k| s.piece(k) == 1) {
                jac.add(i, i, 1.0);
                continue;
            }
            jac.add(i, i, 2.0);
            if i > 0 {
                jac.add(i, i - 1, -1.0);
            }
            if i + 1 < self.n {
                jac.add(i, i + 1, -1.0);
            }
            jac.add(i, self.n, self.unit());
        }
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Derivatives for StringOnPoints {
    fn test_gradient(&self, site: usize, _test: usize, _x: &[f64], g: &mut [f64]) {
        g.fill(0.0);
        let i = self.sites[site].0;
        g[i] = -1.0;
        g[i - 1] = 1.0;
        g[i + 1] = 1.0;
        g[self.n] = -self.unit();
    }
}

impl Structure for StringOnPoints {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(self.sites[site].0);
    }
}

/// max(y² − 1, y/2) = α.
pub(crate) fn parabola_and_line() -> Plane {
    Plane::two(
        |y, a| [y * y - 1.0 - a, 2.0 * y, -1.0],
        |y, a| [0.5 * y - a, 0.5, -1.0],
        |y, _| [y * y - 1.0 - 0.5 * y, 2.0 * y - 0.5, 0.0],
    )
}

/// |y| + α² = 1.
pub(crate) fn lens() -> Plane {
    Plane::two(
        |y, a| [y + a * a - 1.0, 1.0, 2.0 * a],
        |y, a| [-y + a * a - 1.0, -1.0, 2.0 * a],
        |y, _| [y, 1.0, 0.0],
    )
}

/// y² + α² = 1 above y = 0.3, (y − ½)² + α² = 0.95 below: two arcs of circles.
pub(crate) fn two_arcs() -> Plane {
    Plane::two(
        |y, a| [y * y + a * a - 1.0, 2.0 * y, 2.0 * a],
        |y, a| [y * y - y + 0.3 + a * a - 1.0, 2.0 * y - 1.0, 2.0 * a],
        |y, _| [y - 0.3, 1.0, 0.0],
    )
}

pub(crate) fn within(range: (f64, f64)) -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range(range)
}

pub(crate) fn follow(map: &Plane, x: [f64; 2], direction: Direction, o: ContinuationOptions) -> Branch {
    let branch = Branch::follow(map, &x, direction, o).unwrap();
    for (_, x) in branch.polyline() {
        assert!(map.value(x).abs() < 1e-9, "{x:?}");
    }
    branch
}

pub(crate) fn near(a: &[f64], b: [f64; 2], tolerance: f64) -> bool {
    (a[0] - b[0]).abs() <= tolerance && (a[1] - b[1]).abs() <= tolerance
}
