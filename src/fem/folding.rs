//! Whether cells are turned inside out, folded or flat.

use std::collections::HashMap;

use super::element::Jacobian;
use super::{CellKind, FemError, Mesh};
use crate::tolerances::ROUNDING;

/// Bisections along each axis after which a cell is flat where nothing else is known: bounds then lie within 1e-5 of the determinant.
const HALVES: usize = 8;

impl Mesh {
    /// Whether the cell is the mirror image of a proper one, by the determinants at its nodes.
    pub(super) fn is_turned_round(&self, cell: usize) -> bool {
        let (low, high) = self.at_nodes(cell);
        low.0 < 0.0 && high < 0.0
    }

    pub(super) fn check_cells(&self) -> Result<(), FemError> {
        let mut determinants = HashMap::new();
        for cell in 0..self.num_cells() {
            let kind = self.kind(cell);
            let (mut low, high) = self.at_nodes(cell);
            let least = ROUNDING * high.abs();
            // Of simplices and quadrilaterals of first order the determinants at the corners are all that is to know.
            if low.0 > least && Determinant::degree(kind) > 1 {
                let way = determinants.entry(kind).or_insert_with(|| Determinant::of(kind));
                low = way.below(self.nodes_at(cell), least).unwrap_or(low);
            }
            if low.0 <= least {
                return Err(self.folded(cell, low));
            }
        }
        self.check_neighbours()
    }

    fn folded(&self, cell: usize, (determinant, x): (f64, [f64; 3])) -> FemError {
        let shape = self.kind(cell).reference().sample(x, 0.0).value;
        let mut at = [0.0; 3];
        for (node, s) in self.nodes_at(cell).zip(shape) {
            (0..3).for_each(|d| at[d] += s * node[d]);
        }
        FemError::Jacobian {
            cell,
            nodes: self.cell(cell).to_vec(),
            determinant,
            at,
        }
    }

    /// The smallest Jacobian determinant at the nodes of a cell, the reference coordinates of its node, and the largest.
    fn at_nodes(&self, cell: usize) -> ((f64, [f64; 3]), f64) {
        let kind = self.kind(cell);
        let probes = if kind.has_constant_strain() {
            1
        } else {
            kind.num_nodes()
        };
        let (mut low, mut high) = ((f64::INFINITY, [0.0; 3]), f64::NEG_INFINITY);
        for sample in &kind.reference().table().nodes[..probes] {
            let det = Jacobian::of(kind.dim(), self.nodes_at(cell), &sample.gradient).det;
            if det < low.0 {
                low = (det, sample.at);
            }
            high = high.max(det);
        }
        (low, high)
    }
}

/// The Jacobian determinants of cells of a kind, polynomials in their reference coordinates: of the unit cube for boxes, of the cube with
/// collapsed sides for simplices. By their Bernstein coefficients, among which are the values at the corners, they are bounded from below in
/// all of the cell (A. Johnen, J.-F. Remacle, C. Geuzaine, J. Comput. Phys. 233 (2013)).
struct Determinant {
    kind: CellKind,
    dim: usize,
    /// Coefficients along each axis: the degree plus 1.
    count: usize,
    /// Values of the Bernstein polynomials at equidistant points, inverted.
    inverse: Vec<Vec<f64>>,
    /// Reference gradients of the shape functions at these points of the cell.
    gradients: Vec<Vec<[f64; 3]>>,
}

/// A box of the unit cube: its lower corner, its sides as powers of ½, and the coefficients of the determinant there.
struct Part {
    low: [f64; 3],
    halves: [usize; 3],
    coefficients: Vec<f64>,
}

impl Determinant {
    /// The degree along each axis, or a bound of it: derivatives of the map are of one less than its order along their own axis and, in
    /// boxes, of its order along the others. Wedges and pyramids have no more, the latter in the coordinates of the collapsed cube.
    const fn degree(kind: CellKind) -> usize {
        match kind.reference().is_simplex() {
            true => kind.dim() * (kind.order() - 1),
            false => kind.dim() * kind.order() - 1,
        }
    }

    fn of(kind: CellKind) -> Self {
        let (dim, degree) = (kind.dim(), Self::degree(kind));
        let polynomials = |i: usize| {
            let t = i as f64 / degree as f64;
            let mut row = vec![1.0];
            for _ in 0..degree {
                let below = row.iter().map(|b| (1.0 - t) * b).chain([0.0]);
                let above = [0.0].into_iter().chain(row.iter().map(|b| t * b));
                row = below.zip(above).map(|(a, b)| a + b).collect();
            }
            row
        };
        let mut way = Self {
            kind,
            dim,
            count: degree + 1,
            inverse: inverse((0..=degree).map(polynomials).collect()),
            gradients: Vec::new(),
        };
        let n = way.count;
        let gradient = |k: usize| {
            let place = [k % n, k / n % n, k / (n * n)].map(|i| i as f64 / degree as f64);
            kind.reference().sample(way.reference(place), 0.0).gradient
        };
        way.gradients = (0..n.pow(dim as u32)).map(gradient).collect();
        way
    }

    /// A determinant not above `least`, with its reference coordinates; `None` if all of them are above.
    fn below(&self, nodes: impl Iterator<Item = [f64; 3]> + Clone, least: f64) -> Option<(f64, [f64; 3])> {
        let mut parts = vec![Part {
            low: [0.0; 3],
            halves: [0; 3],
            coefficients: self.coefficients(nodes),
        }];
        while let Some(part) = parts.pop() {
            if part.coefficients.iter().all(|c| *c > least) {
                continue;
            }
            let (value, corner) = self.least_corner(&part);
            let axis = (0..self.dim).fold(0, |best, d| {
                if part.halves[d] < part.halves[best] {
                    d
                } else {
                    best
                }
            });
            if value <= least || part.halves[axis] == HALVES {
                // A part that stays undecided is told as flat: by its bound.
                let bound = part.coefficients.iter().copied().fold(value, f64::min);
                let told = if value <= least { value } else { bound };
                return Some((told, self.reference(corner)));
            }
            parts.extend(self.halved(part, axis));
        }
        None
    }

    fn coefficients(&self, nodes: impl Iterator<Item = [f64; 3]> + Clone) -> Vec<f64> {
        let n = self.count;
        let determinant = |g: &Vec<[f64; 3]>| Jacobian::of(self.dim, nodes.clone(), g).det;
        let mut values: Vec<f64> = self.gradients.iter().map(determinant).collect();
        for axis in 0..self.dim {
            let old = values.clone();
            self.for_lines(axis, |line| {
                for (i, row) in self.inverse.iter().enumerate() {
                    values[line(i)] = (0..n).map(|j| row[j] * old[line(j)]).sum();
                }
            });
        }
        values
    }

    /// Reference coordinates of a point of the unit cube.
    fn reference(&self, p: [f64; 3]) -> [f64; 3] {
        match self.kind {
            CellKind::Wedge | CellKind::Wedge15 => [p[0], (1.0 - p[0]) * p[1], 2.0 * p[2] - 1.0],
            CellKind::Pyramid | CellKind::Pyramid13 => {
                // At the apex itself the directions from it would be lost.
                let width = (1.0 - p[2]).max(f64::EPSILON);
                [
                    (2.0 * p[0] - 1.0) * width,
                    (2.0 * p[1] - 1.0) * width,
                    1.0 - width,
                ]
            }
            kind if kind.reference().is_simplex() => {
                [p[0], (1.0 - p[0]) * p[1], (1.0 - p[0]) * (1.0 - p[1]) * p[2]]
            }
            _ => std::array::from_fn(|d| if d < self.dim { 2.0 * p[d] - 1.0 } else { 0.0 }),
        }
    }

    /// Calls `f` with the places of the coefficients along each line in the direction of an axis.
    fn for_lines(&self, axis: usize, mut f: impl FnMut(&dyn Fn(usize) -> usize)) {
        let n = self.count;
        let stride = n.pow(axis as u32);
        for k in (0..n.pow(self.dim as u32)).filter(|k| (k / stride).is_multiple_of(n)) {
            f(&|i| k + i * stride);
        }
    }

    fn least_corner(&self, part: &Part) -> (f64, [f64; 3]) {
        let n = self.count;
        let mut best = (f64::INFINITY, [0.0; 3]);
        for corner in 0..1usize << self.dim {
            let side = |d: usize| corner >> d & 1;
            let place: usize = (0..self.dim).map(|d| side(d) * (n - 1) * n.pow(d as u32)).sum();
            if part.coefficients[place] < best.0 {
                let at = |d: usize| part.low[d] + side(d) as f64 * 0.5f64.powi(part.halves[d] as i32);
                best = (part.coefficients[place], std::array::from_fn(at));
            }
        }
        best
    }

    /// Both halves along an axis, by the construction of de Casteljau.
    fn halved(&self, part: Part, axis: usize) -> [Part; 2] {
        let n = self.count;
        let (mut lower, mut upper) = (part.coefficients.clone(), part.coefficients);
        self.for_lines(axis, |line| {
            for round in 1..n {
                // Means of neighbours: the first of each round belong to the lower half, the last remain in the upper one.
                for i in 0..n - round {
                    upper[line(i)] = 0.5 * (upper[line(i)] + upper[line(i + 1)]);
                }
                lower[line(round)] = upper[line(0)];
            }
        });
        let mut halves = part.halves;
        halves[axis] += 1;
        let mut middle = part.low;
        middle[axis] += 0.5f64.powi(halves[axis] as i32);
        [(part.low, lower), (middle, upper)].map(|(low, coefficients)| Part {
            low,
            halves,
            coefficients,
        })
    }
}

/// The inverse of a small regular matrix.
fn inverse(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = a.len();
    for (i, row) in a.iter_mut().enumerate() {
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    for k in 0..n {
        let pivot = (k..n).fold(k, |p, i| if a[i][k].abs() > a[p][k].abs() { i } else { p });
        a.swap(k, pivot);
        let scale = a[k][k];
        a[k].iter_mut().for_each(|x| *x /= scale);
        let own = a[k].clone();
        for (i, row) in a.iter_mut().enumerate() {
            let factor = if i == k { 0.0 } else { row[k] };
            row.iter_mut().zip(&own).for_each(|(x, o)| *x -= factor * o);
        }
    }
    a.into_iter().map(|row| row[n..].to_vec()).collect()
}
