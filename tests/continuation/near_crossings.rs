//! Curves that pass each other and curves that cross, at random: gaps down to 1e-5 of their length, in the plane, turned, in other
//! units, among further unknowns.

use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// Two curves that cross at the origin of (y, α), perturbed by ε.
#[derive(Clone, Copy, PartialEq)]
enum Pair {
    /// (α − a y)(α − b y) = ε.
    Lines,
    /// y³ − α y + ε = 0.
    Pitchfork,
    /// (α − a y)(α − b y − 0.3 y²) = ε.
    LineAndParabola,
    /// y² − α y + ε = 0.
    Transcritical,
}

/// A pair of curves in u = T z − c, where u₀ = y, u₁ = α, and each further unknown is a quadratic polynomial of these; the equations are
/// mixed by a regular matrix.
struct Crossing {
    pair: Pair,
    slopes: [f64; 2],
    gap: f64,
    turn: Vec<Vec<f64>>,
    offset: Vec<f64>,
    further: Vec<[f64; 3]>,
    mix: Vec<Vec<f64>>,
}

impl Crossing {
    /// Value, ∂/∂y and ∂/∂α.
    fn pair(&self, y: f64, alpha: f64) -> [f64; 3] {
        let ([a, b], e) = (self.slopes, self.gap);
        match self.pair {
            Pair::Lines => {
                let (p, q) = (alpha - a * y, alpha - b * y);
                [p * q - e, -a * q - b * p, p + q]
            }
            Pair::LineAndParabola => {
                let (p, q) = (alpha - a * y, alpha - b * y - 0.3 * y * y);
                [p * q - e, -a * q - (b + 0.6 * y) * p, p + q]
            }
            Pair::Pitchfork => [y * y * y - alpha * y + e, 3.0 * y * y - alpha, -y],
            Pair::Transcritical => [y * y - alpha * y + e, 2.0 * y - alpha, -y],
        }
    }

    fn unknowns(&self, z: &[f64]) -> Vec<f64> {
        let rows = self.turn.iter().zip(&self.offset);
        rows.map(|(row, c)| dot(row, z) - c).collect()
    }

    /// Which of the curves a point lies on: on neither does the sign of this factor change.
    fn side(&self, z: &[f64]) -> f64 {
        let u = self.unknowns(z);
        match self.pair {
            Pair::Lines | Pair::LineAndParabola => (u[1] - self.slopes[0] * u[0]).signum(),
            Pair::Pitchfork | Pair::Transcritical => u[0].signum(),
        }
    }

    /// The point z of the curve next to (y, α), moved along α or y.
    fn point(&self, mut y: f64, mut alpha: f64) -> Vec<f64> {
        for _ in 0..50 {
            let [f, dy, da] = self.pair(y, alpha);
            match self.pair {
                Pair::Lines | Pair::LineAndParabola => alpha -= f / da,
                Pair::Pitchfork | Pair::Transcritical => y -= f / dy,
            }
        }
        self.place(y, alpha)
    }

    fn place(&self, y: f64, alpha: f64) -> Vec<f64> {
        let mut u = vec![y, alpha];
        u.extend(
            self.further
                .iter()
                .map(|g| g[0] * y + g[1] * alpha + g[2] * y * y),
        );
        let right: Vec<f64> = u.iter().zip(&self.offset).map(|(u, c)| u + c).collect();
        solve(&self.turn, right)
    }
}

impl PiecewiseSmooth for Crossing {
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
        let mut r = vec![self.pair(u[0], u[1])[0]];
        let further = self.further.iter().zip(&u[2..]);
        r.extend(further.map(|(g, v)| v - g[0] * u[0] - g[1] * u[1] - g[2] * u[0] * u[0]));
        for (o, row) in out.iter_mut().zip(&self.mix) {
            *o = dot(row, &r);
        }
    }
    fn jacobian(&self, _: &Selection, z: &[f64], jac: &mut Matrix) {
        let u = self.unknowns(z);
        let (n, m) = (self.num_residuals(), self.num_vars());
        let [_, dy, da] = self.pair(u[0], u[1]);
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Gauss with pivoting.
fn solve(matrix: &[Vec<f64>], mut b: Vec<f64>) -> Vec<f64> {
    let (mut a, n) = (matrix.to_vec(), b.len());
    for k in 0..n {
        let pivot = (k..n)
            .max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))
            .unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        b[k] = (b[k] - dot(&a[k][k + 1..], &b[k + 1..])) / a[k][k];
    }
    b
}

/// Xorshift.
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        let mut this = Self(0x9E37_79B9_7F4A_7C15 ^ (seed + 1).wrapping_mul(0xD134_2543_DE82_EF95));
        for _ in 0..8 {
            this.between(0.0, 1.0);
        }
        this
    }

    fn between(&mut self, a: f64, b: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        a + (b - a) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }

    fn sign(&mut self) -> f64 {
        if self.between(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 }
    }
}

/// What the pair is embedded in.
#[derive(Clone, Copy)]
struct Setting {
    residuals: usize,
    /// y is measured in units that make its values this many times larger.
    unit: f64,
    turned: bool,
}

fn identity(n: usize) -> Vec<Vec<f64>> {
    let row = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect();
    (0..n).map(row).collect()
}

fn crossing(setting: Setting, pair: Pair, gap: f64, random: &mut Random) -> Crossing {
    let n = setting.residuals;
    let slopes = [random.between(0.2, 1.2), random.between(-1.2, -0.2)];
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
    Crossing {
        pair,
        slopes,
        gap,
        further: (1..n).map(further).collect(),
        turn,
        offset,
        mix,
    }
}

/// Follows the k-th random pair towards its crossing and past it.
fn follow(setting: Setting, k: u64, gap: f64) -> (Crossing, Vec<f64>, Branch) {
    let random = &mut Random::new(k);
    let pairs = [
        Pair::Lines,
        Pair::Pitchfork,
        Pair::LineAndParabola,
        Pair::Transcritical,
    ];
    // Half of them are hyperbolas.
    let pair = pairs[[0, 1, 0, 2, 0, 3][k as usize % 6]];
    let gap = random.sign() * gap;
    let map = crossing(setting, pair, gap, random);
    let (s, far) = (random.sign(), random.between(0.9, 1.6));
    let ([y, alpha], [dy, da]) = match pair {
        Pair::Lines | Pair::LineAndParabola => {
            let a = map.slopes[0];
            ([s * far, s * far * a], [-s, -s * a])
        }
        Pair::Pitchfork => ([0.0, -far], [0.0, 1.0]),
        Pair::Transcritical => ([0.0, s * far], [0.0, -s]),
    };
    let x = map.point(y, alpha);
    let (from, to) = (map.place(y, alpha), map.place(y + 1e-3 * dy, alpha + 1e-3 * da));
    let direction = to.iter().zip(&from).map(|(a, b)| a - b).collect();
    let mut options = ContinuationOptions::default()
        .with_max_arclength(4.0)
        .with_max_step([1.0, 0.1, 0.3][k as usize / 6 % 3]);
    if setting.unit != 1.0 {
        options.typical_sizes = vec![1.0; setting.residuals + 1];
        options.typical_sizes[0] = setting.unit;
    }
    let branch = Branch::follow(&map, &x, Direction::Along(direction), options).unwrap();
    (map, x, branch)
}

const PLANE: Setting = Setting {
    residuals: 1,
    unit: 1.0,
    turned: false,
};
const TURNED: Setting = Setting {
    turned: true,
    ..PLANE
};
const SPACE: Setting = Setting {
    residuals: 5,
    ..TURNED
};
const LARGE: Setting = Setting { unit: 1e6, ..PLANE };
const SMALL: Setting = Setting { unit: 1e-6, ..PLANE };

/// No branch point is reported where there is none, and no curve is left for the one that passes nearby.
fn passes(setting: Setting, count: u64) {
    for k in 0..count {
        let gap = 10f64.powi(-4 - (k / 18 % 7) as i32);
        let (map, x, branch) = follow(setting, k, gap);
        assert!(
            branch.branch_points.is_empty() && branch.transitions.is_empty(),
            "{k}: a branch point at a gap of {gap:e}"
        );
        let side = map.side(&x);
        for p in &branch.points {
            let u = map.unknowns(&p.x);
            assert!(
                map.side(&p.x) == side,
                "{k}: on the other curve at {u:?}, gap {gap:e}"
            );
            assert!(map.pair(u[0], u[1])[0].abs() < 1e-10);
        }
        assert!(
            matches!(
                branch.termination,
                Termination::MaxArclength | Termination::Closed
            ),
            "{k}: {} at a gap of {gap:e}",
            branch.termination
        );
    }
}

/// The crossing is found to rounding, and all four arms of it.
fn crosses(setting: Setting, count: u64) {
    for k in 0..count {
        let (map, _, branch) = follow(setting, k, 0.0);
        assert_eq!(branch.termination, Termination::MaxArclength, "{k}");
        let at_origin: Vec<_> = (branch.branch_points.iter())
            .filter(|b| {
                let u = map.unknowns(&b.point.x);
                u[0].hypot(u[1]) < 1e-12
            })
            .collect();
        assert_eq!(at_origin.len(), 1, "{k}: {:?}", branch.branch_points);
        assert!(at_origin[0].complete && at_origin[0].arms.len() == 3, "{k}");
        // A line meets a parabola once more.
        let others = branch.branch_points.len() - 1;
        assert!(
            others == 0 || (map.pair == Pair::LineAndParabola && others == 1),
            "{k}"
        );
    }
}

#[test]
fn curves_in_the_plane_pass_each_other() {
    passes(PLANE, 4000);
    passes(TURNED, 2500);
}

#[test]
fn curves_among_further_unknowns_pass_each_other() {
    passes(SPACE, 1000);
}

#[test]
fn curves_in_other_units_pass_each_other() {
    passes(LARGE, 1500);
    passes(SMALL, 1500);
}

#[test]
fn curves_cross() {
    for (setting, count) in [
        (PLANE, 300),
        (TURNED, 300),
        (SPACE, 60),
        (LARGE, 120),
        (SMALL, 120),
    ] {
        crosses(setting, count);
    }
}

/// Where no unit of y is told, curves 1e-6 of its size apart in angle may end in a doubt, never on the other curve, nor off their own.
#[test]
fn units_that_are_not_told() {
    for k in 0..600 {
        let unit = [1e-6, 1e-4, 1e6][k as usize % 3];
        let setting = Setting { unit, ..PLANE };
        let random = &mut Random::new(k);
        let map = crossing(setting, Pair::Lines, 10f64.powi(-4 - (k % 7) as i32), random);
        let x = map.point(1.2, 1.2 * map.slopes[0]);
        let options = ContinuationOptions::default().with_max_arclength(4.0);
        let branch = Branch::follow(&map, &x, Direction::Decreasing, options).unwrap();
        assert!(branch.branch_points.is_empty(), "{k}");
        let side = map.side(&x);
        for p in &branch.points {
            let u = map.unknowns(&p.x);
            assert!(map.side(&p.x) == side, "{k}");
            assert!(
                map.pair(u[0], u[1])[0].abs() < 1e-10 * (1.0 + u[0] * u[0] + u[1] * u[1]),
                "{k}: off"
            );
        }
    }
}
