//! Maps with known curves.

use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
use semismooth::sparse::{Matrix, Pattern};

/// Value, ∂/∂y and ∂/∂α of a function of (y, α).
pub(crate) type Plane = fn(f64, f64) -> [f64; 3];

/// A curve in the plane with one site.
pub(crate) struct PlaneMap {
    pub(crate) pieces: Vec<Plane>,
    pub(crate) tests: Vec<Plane>,
    pub(crate) cells: Vec<Vec<Facet>>,
}

impl PlaneMap {
    pub(crate) fn smooth(f: Plane) -> Self {
        Self {
            pieces: vec![f],
            tests: vec![],
            cells: vec![vec![]],
        }
    }

    /// `above` where θ > 0, `below` where θ < 0.
    pub(crate) fn two(above: Plane, below: Plane, theta: Plane) -> Self {
        Self {
            pieces: vec![above, below],
            tests: vec![theta],
            cells: vec![vec![Facet::positive(0)], vec![Facet::negative(0)]],
        }
    }

    pub(crate) fn value(&self, x: &[f64]) -> f64 {
        let mut r = [0.0];
        semismooth::piecewise::value(self, x, &mut r);
        r[0]
    }
}

impl PiecewiseSmooth for PlaneMap {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn num_sites(&self) -> usize {
        1
    }
    fn num_pieces(&self, _site: usize) -> usize {
        self.pieces.len()
    }
    fn num_tests(&self, _site: usize) -> usize {
        self.tests.len()
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        &self.cells[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (o, f) in out.iter_mut().zip(&self.tests) {
            *o = f(x[0], x[1])[0];
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = self.pieces[s.piece(0)](x[0], x[1])[0];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let [_, dy, da] = self.pieces[s.piece(0)](x[0], x[1]);
        jac.add(0, 0, dy);
        jac.add(0, 1, da);
    }
}

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
    fn num_vars(&self) -> usize {
        self.n + 1
    }
    fn num_residuals(&self) -> usize {
        self.n
    }
    fn num_sites(&self) -> usize {
        self.sites.len()
    }
    fn num_pieces(&self, _site: usize) -> usize {
        2
    }
    fn num_tests(&self, _site: usize) -> usize {
        1
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        const CELLS: [[Facet; 1]; 2] = [[Facet::positive(0)], [Facet::negative(0)]];
        &CELLS[piece]
    }
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
    fn test_gradient(&self, site: usize, _test: usize, _x: &[f64], g: &mut [f64]) {
        g.fill(0.0);
        let i = self.sites[site].0;
        g[i] = -1.0;
        g[i - 1] = 1.0;
        g[i + 1] = 1.0;
        g[self.n] = -self.unit();
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
}

/// max(y² − 1, y/2) = α.
pub(crate) fn parabola_and_line() -> PlaneMap {
    PlaneMap::two(
        |y, a| [y * y - 1.0 - a, 2.0 * y, -1.0],
        |y, a| [0.5 * y - a, 0.5, -1.0],
        |y, _| [y * y - 1.0 - 0.5 * y, 2.0 * y - 0.5, 0.0],
    )
}

/// |y| + α² = 1.
pub(crate) fn lens() -> PlaneMap {
    PlaneMap::two(
        |y, a| [y + a * a - 1.0, 1.0, 2.0 * a],
        |y, a| [-y + a * a - 1.0, -1.0, 2.0 * a],
        |y, _| [y, 1.0, 0.0],
    )
}

/// y² + α² = 1 above y = 0.3, (y − ½)² + α² = 0.95 below: two arcs of circles.
pub(crate) fn two_arcs() -> PlaneMap {
    PlaneMap::two(
        |y, a| [y * y + a * a - 1.0, 2.0 * y, 2.0 * a],
        |y, a| [y * y - y + 0.3 + a * a - 1.0, 2.0 * y - 1.0, 2.0 * a],
        |y, _| [y - 0.3, 1.0, 0.0],
    )
}

pub(crate) fn within(range: (f64, f64)) -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range(range)
}

pub(crate) fn follow(map: &PlaneMap, x: [f64; 2], direction: Direction, o: ContinuationOptions) -> Branch {
    let branch = Branch::follow(map, &x, direction, o).unwrap();
    for (_, x) in branch.polyline() {
        assert!(map.value(x).abs() < 1e-9, "{x:?}");
    }
    branch
}

pub(crate) fn near(a: &[f64], b: [f64; 2], tolerance: f64) -> bool {
    (a[0] - b[0]).abs() <= tolerance && (a[1] - b[1]).abs() <= tolerance
}
