//! Curves in the plane, rotated, in other units, among further unknowns.

use crate::dense::{dot, eliminate};
use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// A function of (y, α): its value, ∂/∂y and ∂/∂α.
pub(crate) trait Plane {
    fn at(&self, y: f64, alpha: f64) -> [f64; 3];
}

/// A function of the plane in u = T z − c, where u₀ = y, u₁ = α, and each further unknown is a quadratic polynomial of these; the equations
/// are mixed by a regular matrix.
pub(crate) struct Embedded<P> {
    pub(crate) plane: P,
    turn: Vec<Vec<f64>>,
    offset: Vec<f64>,
    further: Vec<[f64; 3]>,
    mix: Vec<Vec<f64>>,
}

/// `count` random cases, or PROPTEST_CASES if that is larger.
pub(crate) fn cases(count: u64) -> u64 {
    let asked = std::env::var("PROPTEST_CASES").ok().and_then(|v| v.parse().ok());
    asked.unwrap_or(0).max(count)
}

/// The embedding of a function of the plane.
#[derive(Clone, Copy)]
pub(crate) struct Setting {
    pub(crate) residuals: usize,
    /// y is measured in units that make its values this many times larger.
    pub(crate) unit: f64,
    pub(crate) turned: bool,
}

pub(crate) const PLANE: Setting = Setting {
    residuals: 1,
    unit: 1.0,
    turned: false,
};
pub(crate) const TURNED: Setting = Setting {
    turned: true,
    ..PLANE
};
pub(crate) const SPACE: Setting = Setting {
    residuals: 5,
    ..TURNED
};
pub(crate) const LARGE: Setting = Setting { unit: 1e6, ..PLANE };
pub(crate) const SMALL: Setting = Setting { unit: 1e-6, ..PLANE };

impl<P: Plane> Embedded<P> {
    pub(crate) fn new(setting: Setting, plane: P, random: &mut Random) -> Self {
        let n = setting.residuals;
        let (mut turn, mut mix, mut offset) = (identity(n + 1), identity(n), vec![0.0; n + 1]);
        if setting.turned {
            for i in 0..=n {
                for j in 0..i {
                    let (sin, cos) = random.between(-3.0, 3.0).sin_cos();
                    for k in 0..=n {
                        let (p, q) = (turn[i][k], turn[j][k]);
                        (turn[i][k], turn[j][k]) = (cos * p - sin * q, sin * p + cos * q);
                    }
                }
            }
            offset.iter_mut().for_each(|c| *c = random.between(-1.0, 1.0));
            for v in mix.iter_mut().flatten() {
                *v += random.between(-0.3, 0.3);
            }
        }
        turn.iter_mut().for_each(|row| row[0] /= setting.unit);
        let further = |_| [0.5, 0.5, 0.2].map(|size| random.between(-size, size));
        Self {
            plane,
            further: (1..n).map(further).collect(),
            turn,
            offset,
            mix,
        }
    }

    /// (y, α) and the further unknowns.
    pub(crate) fn unknowns(&self, z: &[f64]) -> Vec<f64> {
        let rows = self.turn.iter().zip(&self.offset);
        rows.map(|(row, c)| dot(row, z) - c).collect()
    }

    /// The point z of (y, α).
    pub(crate) fn place(&self, y: f64, alpha: f64) -> Vec<f64> {
        let mut u = vec![y, alpha];
        u.extend(
            self.further
                .iter()
                .map(|g| g[0] * y + g[1] * alpha + g[2] * y * y),
        );
        let right: Vec<f64> = u.iter().zip(&self.offset).map(|(u, c)| u + c).collect();
        eliminate(&self.turn, &right).2.expect("turns are regular")
    }
}

impl<P: Plane> PiecewiseSmooth for Embedded<P> {
    fn num_vars(&self) -> usize {
        self.turn.len()
    }
    fn num_residuals(&self) -> usize {
        self.mix.len()
    }
    fn num_sites(&self) -> usize {
        1
    }
    fn num_pieces(&self, _site: usize) -> usize {
        1
    }
    fn num_tests(&self, _site: usize) -> usize {
        0
    }
    fn cell(&self, _site: usize, _piece: usize) -> &[Facet] {
        &[]
    }
    fn test_functions(&self, _x: &[f64], _out: &mut [f64]) {}
    fn residual(&self, _: &Selection, z: &[f64], out: &mut [f64]) {
        let u = self.unknowns(z);
        let mut r = vec![self.plane.at(u[0], u[1])[0]];
        let further = self.further.iter().zip(&u[2..]);
        r.extend(further.map(|(g, v)| v - g[0] * u[0] - g[1] * u[1] - g[2] * u[0] * u[0]));
        for (o, row) in out.iter_mut().zip(&self.mix) {
            *o = dot(row, &r);
        }
    }
    fn jacobian(&self, _: &Selection, z: &[f64], jac: &mut Matrix) {
        let u = self.unknowns(z);
        let (n, m) = (self.num_residuals(), self.num_vars());
        let [_, dy, da] = self.plane.at(u[0], u[1]);
        let mut inner = vec![vec![0.0; m]; n];
        inner[0][..2].copy_from_slice(&[dy, da]);
        for (k, g) in self.further.iter().enumerate() {
            inner[k + 1][..2].copy_from_slice(&[-g[0] - 2.0 * g[2] * u[0], -g[1]]);
            inner[k + 1][k + 2] = 1.0;
        }
        for i in 0..n {
            for j in 0..m {
                let column: Vec<f64> = self.turn.iter().map(|row| row[j]).collect();
                let products = (0..n).map(|k| self.mix[i][k] * dot(&inner[k], &column));
                jac.add(i, j, products.sum());
            }
        }
    }
}

/// Xorshift.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        let mut this = Self(0x9E37_79B9_7F4A_7C15 ^ (seed + 1).wrapping_mul(0xD134_2543_DE82_EF95));
        for _ in 0..8 {
            this.between(0.0, 1.0);
        }
        this
    }

    pub(crate) fn between(&mut self, a: f64, b: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        a + (b - a) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }

    pub(crate) fn sign(&mut self) -> f64 {
        if self.between(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 }
    }
}

fn identity(n: usize) -> Vec<Vec<f64>> {
    let row = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect();
    (0..n).map(row).collect()
}
