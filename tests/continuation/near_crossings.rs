//! Curves that pass each other and curves that cross, at random: gaps down to 1e-10 of their length, in the plane, rotated, in other units,
//! among further unknowns. PROPTEST_CASES runs more.

use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

use super::embedded::{Embedded, LARGE, PLANE, Plane, Random, SMALL, SPACE, Setting, TURNED, cases};
use super::maps::one_piece;

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

/// A pair of curves, α = a y + … and α = b y + … where it is made of lines.
struct Curves {
    pair: Pair,
    slopes: [f64; 2],
    gap: f64,
}

type Crossing = Embedded<Curves>;

impl Plane for Curves {
    fn at(&self, y: f64, alpha: f64) -> [f64; 3] {
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
}

impl Crossing {
    /// Which of the curves a point lies on: this factor keeps its sign along each of them.
    fn side(&self, z: &[f64]) -> f64 {
        let u = self.unknowns(z);
        match self.plane.pair {
            Pair::Lines | Pair::LineAndParabola => (u[1] - self.plane.slopes[0] * u[0]).signum(),
            Pair::Pitchfork | Pair::Transcritical => u[0].signum(),
        }
    }

    /// The point z of the curve near (y, α), moved along α or y.
    fn point(&self, mut y: f64, mut alpha: f64) -> Vec<f64> {
        for _ in 0..50 {
            let [f, dy, da] = self.plane.at(y, alpha);
            match self.plane.pair {
                Pair::Lines | Pair::LineAndParabola => alpha -= f / da,
                Pair::Pitchfork | Pair::Transcritical => y -= f / dy,
            }
        }
        self.place(y, alpha)
    }
}

fn crossing(setting: Setting, pair: Pair, gap: f64, random: &mut Random) -> Crossing {
    let slopes = [random.between(0.2, 1.2), random.between(-1.2, -0.2)];
    Embedded::new(setting, Curves { pair, slopes, gap }, random)
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
            let a = map.plane.slopes[0];
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

/// No spurious branch point is reported, and no curve is left for one that passes nearby.
fn passes(setting: Setting, count: u64) {
    for k in 0..cases(count) {
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
            assert!(map.plane.at(u[0], u[1])[0].abs() < 1e-10);
        }
        assert!(
            matches!(
                branch.termination,
                Termination::ArclengthLimit | Termination::Closed
            ),
            "{k}: {} at a gap of {gap:e}",
            branch.termination
        );
    }
}

/// The crossing is found to rounding, and all four arms of it.
fn crosses(setting: Setting, count: u64) {
    for k in 0..cases(count) {
        let (map, _, branch) = follow(setting, k, 0.0);
        assert_eq!(branch.termination, Termination::ArclengthLimit, "{k}");
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
            others == 0 || (map.plane.pair == Pair::LineAndParabola && others == 1),
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

/// Where the unit of y is not given, curves may lie within an angle of 1e-6: runs may end in doubt, but never on the other curve or off
/// both.
#[test]
fn units_that_are_not_given() {
    for k in 0..600 {
        let unit = [1e-6, 1e-4, 1e6][k as usize % 3];
        let setting = Setting { unit, ..PLANE };
        let random = &mut Random::new(k);
        let map = crossing(setting, Pair::Lines, 10f64.powi(-4 - (k % 7) as i32), random);
        let x = map.point(1.2, 1.2 * map.plane.slopes[0]);
        let options = ContinuationOptions::default().with_max_arclength(4.0);
        let branch = Branch::follow(&map, &x, Direction::Decreasing, options).unwrap();
        assert!(branch.branch_points.is_empty(), "{k}");
        let side = map.side(&x);
        for p in &branch.points {
            let u = map.unknowns(&p.x);
            assert!(map.side(&p.x) == side, "{k}");
            assert!(
                map.plane.at(u[0], u[1])[0].abs() < 1e-10 * (1.0 + u[0] * u[0] + u[1] * u[1]),
                "{k}: off"
            );
        }
    }
}

/// y₀² = α² + ε and y₁ = y₀ − α, the equations in either order: two branches that pass each other, whichever row shows it.
struct Beside {
    gap: f64,
    first: usize,
}

impl PiecewiseSmooth for Beside {
    one_piece!(self, 3, 2);
    fn residual(&self, _s: &Selection, x: &[f64], out: &mut [f64]) {
        out[self.first] = x[0] * x[0] - x[2] * x[2] - self.gap;
        out[1 - self.first] = x[1] - x[0] + x[2];
    }
    fn jacobian(&self, _s: &Selection, x: &[f64], jac: &mut Matrix) {
        jac.add(self.first, 0, 2.0 * x[0]);
        jac.add(self.first, 2, -2.0 * x[2]);
        for (j, v) in [-1.0, 1.0, 1.0].into_iter().enumerate() {
            jac.add(1 - self.first, j, v);
        }
    }
}

#[test]
fn a_gap_is_seen_in_either_row() {
    for gap in [1e-3, 1e-5, 1e-7, 1e-9, 0.0] {
        for first in [0, 1] {
            let map = Beside { gap, first };
            let y = (1.0_f64 + gap).sqrt();
            let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
            let branch = Branch::follow(&map, &[y, y + 1.0, -1.0], Direction::Increasing, options).unwrap();
            let crossings = branch.branch_points.len();
            assert_eq!(crossings, usize::from(gap == 0.0), "{gap:e} {first}");
            let end = &branch.points.last().unwrap().x;
            assert_eq!(branch.termination, Termination::ParameterRange);
            // Straight on where the curves cross, along the same branch where they do not.
            let sign = if gap == 0.0 { -1.0 } else { 1.0 };
            assert!((end[0] - sign * y).abs() < 1e-10, "{gap:e} {first}: {end:?}");
        }
    }
}
