//! Shape functions of reference elements.

use super::element::{Reference, Shape};

/// Corners on either side of the middle nodes of a tetrahedron, of which the first three are those of a triangle.
const ENDS: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

impl Reference {
    /// Values and reference gradients of the shape functions, into room for as many that holds zeros.
    pub(super) fn functions(self, x: [f64; 3], value: &mut [f64], gradient: &mut [[f64; 3]]) {
        match self.shape {
            Shape::Triangle | Shape::Tetrahedron => self.of_simplex(x, value, gradient),
            Shape::Wedge => self.of_wedge(x, value, gradient),
            Shape::Pyramid => self.of_pyramid(x, value, gradient),
            Shape::Segment | Shape::Quadrilateral | Shape::Hexahedron => self.of_box(x, value, gradient),
        }
    }

    /// With barycentric coordinates λ of the triangle and c = ±1: λ (1 + c z) / 2, or at corners λ (1 + c z) (2 λ − 2 + c z) / 2, at the
    /// middles of edges 2 λ μ (1 + c z) and λ (1 − z²).
    fn of_wedge(self, x: [f64; 3], value: &mut [f64], gradient: &mut [[f64; 3]]) {
        let l = [1.0 - x[0] - x[1], x[0], x[1]];
        let slope = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
        let z = x[2];
        let mut set = |a: usize, v: f64, along: [f64; 2], up: f64| {
            value[a] = v;
            gradient[a] = [along[0], along[1], up];
        };
        for a in 0..6 {
            let (l, slope, c) = (l[a % 3], slope[a % 3], if a < 3 { -1.0 } else { 1.0 });
            let upwards = 0.5 * (1.0 + c * z);
            if self.is_linear() {
                set(a, l * upwards, slope.map(|s| s * upwards), 0.5 * c * l);
                continue;
            }
            let rest = 2.0 * l - 2.0 + c * z;
            set(
                a,
                l * upwards * rest,
                slope.map(|s| s * upwards * (rest + 2.0 * l)),
                c * l * (0.5 * rest + upwards),
            );
        }
        for a in 6..self.nodes {
            let k = a % 3;
            if a >= 12 {
                let bubble = 1.0 - z * z;
                set(a, l[k] * bubble, slope[k].map(|s| s * bubble), -2.0 * l[k] * z);
                continue;
            }
            let (c, m) = (if a < 9 { -1.0 } else { 1.0 }, (k + 1) % 3);
            let upwards = 2.0 * (1.0 + c * z);
            let product = std::array::from_fn(|d| slope[k][d] * l[m] + l[k] * slope[m][d]);
            set(
                a,
                l[k] * l[m] * upwards,
                product.map(|s: f64| s * upwards),
                2.0 * c * l[k] * l[m],
            );
        }
    }

    /// Polynomials in s = 1 − z, ξ = x / s and η = y / s, in which s (1 ± ξ) (1 ± η) / 4 belong to the corners below, z to the apex; of
    /// second order times (± s ξ ± s η − 1) and (2 z − 1), at the middles of edges s² (1 − ξ²) (1 ± η) / 2 and so on, upwards
    /// s z (1 ± ξ) (1 ± η). At the apex gradients depend on the direction; they are those along the axis.
    fn of_pyramid(self, x: [f64; 3], value: &mut [f64], gradient: &mut [[f64; 3]]) {
        let s = 1.0 - x[2];
        let [xi, eta] = [x[0], x[1]].map(|x| if s == 0.0 { 0.0 } else { x / s });
        // A function s f with the derivatives of f in ξ, η and s.
        let mut set = |a: usize, f: f64, [of_xi, of_eta, of_s]: [f64; 3]| {
            value[a] = s * f;
            gradient[a] = [of_xi, of_eta, xi * of_xi + eta * of_eta - f - s * of_s];
        };
        for a in 0..4 {
            let [c, d, _] = self.points()[a];
            let (p, q) = (1.0 + c * xi, 1.0 + d * eta);
            let (f, of_xi, of_eta) = (0.25 * p * q, 0.25 * c * q, 0.25 * d * p);
            if self.is_linear() {
                set(a, f, [of_xi, of_eta, 0.0]);
                continue;
            }
            let sum = c * xi + d * eta;
            let factor = s * sum - 1.0;
            set(
                a,
                f * factor,
                [of_xi * factor + f * s * c, of_eta * factor + f * s * d, f * sum],
            );
            let z = x[2];
            set(a + 9, 4.0 * f * z, [4.0 * of_xi * z, 4.0 * of_eta * z, -4.0 * f]);
        }
        for a in 5..self.nodes.min(9) {
            let [c, d, _] = self.points()[a];
            // The one along the edge is a bubble, the other one linear.
            let factor = |side: f64, t: f64| match side {
                0.0 => (1.0 - t * t, -2.0 * t),
                side => (1.0 + side * t, side),
            };
            let ((p, of_p), (q, of_q)) = (factor(c, xi), factor(d, eta));
            set(
                a,
                0.5 * s * p * q,
                [0.5 * s * of_p * q, 0.5 * s * p * of_q, 0.5 * p * q],
            );
        }
        let z = x[2];
        (value[4], gradient[4]) = match self.is_linear() {
            true => (z, [0.0, 0.0, 1.0]),
            false => (z * (2.0 * z - 1.0), [0.0, 0.0, 4.0 * z - 1.0]),
        };
    }

    /// By barycentric coordinates: λ, or λ (2 λ − 1) at corners and 4 λ μ at the middles of edges.
    fn of_simplex(self, x: [f64; 3], value: &mut [f64], gradient: &mut [[f64; 3]]) {
        let dim = self.dim();
        let mut l = [1.0, x[0], x[1], x[2]];
        let mut slope = [[0.0; 3]; 4];
        for d in 0..dim {
            l[0] -= x[d];
            slope[0][d] = -1.0;
            slope[d + 1][d] = 1.0;
        }
        let corners = dim + 1;
        value[..corners].copy_from_slice(&l[..corners]);
        gradient[..corners].copy_from_slice(&slope[..corners]);
        if self.nodes == corners {
            return;
        }
        for a in 0..corners {
            value[a] *= 2.0 * l[a] - 1.0;
            (0..dim).for_each(|d| gradient[a][d] *= 4.0 * l[a] - 1.0);
        }
        for (a, [p, q]) in (corners..self.nodes).zip(ENDS) {
            value[a] = 4.0 * l[p] * l[q];
            (0..dim).for_each(|d| gradient[a][d] = 4.0 * (l[p] * slope[q][d] + l[q] * slope[p][d]));
        }
    }

    /// Products of functions of each coordinate, which for serendipity are linear at corners and corrected as a whole.
    fn of_box(self, x: [f64; 3], value: &mut [f64], gradient: &mut [[f64; 3]]) {
        let dim = self.dim();
        let is_linear = self.is_linear();
        let is_product = is_linear || self.nodes == 3usize.pow(dim as u32);
        for (a, node) in self.points().iter().enumerate() {
            // Value and slope along each coordinate.
            let factor = |d: usize| match (node[d], x[d]) {
                (0.0, x) => (1.0 - x * x, -2.0 * x),
                (c, x) if is_linear || !is_product => (0.5 * (1.0 + c * x), 0.5 * c),
                (c, x) => (0.5 * x * (x + c), x + 0.5 * c),
            };
            let mut factors = [(1.0, 0.0); 3];
            (0..dim).for_each(|d| factors[d] = factor(d));
            value[a] = factors[0].0 * factors[1].0 * factors[2].0;
            for d in 0..dim {
                gradient[a][d] = factors[d].1 * factors[(d + 1) % 3].0 * factors[(d + 2) % 3].0;
            }
            if !is_product && a < self.num_corners() {
                let correction = (0..dim).map(|d| node[d] * x[d]).sum::<f64>() - (dim as f64 - 1.0);
                for d in 0..dim {
                    gradient[a][d] = gradient[a][d] * correction + value[a] * node[d];
                }
                value[a] *= correction;
            }
        }
    }
}
