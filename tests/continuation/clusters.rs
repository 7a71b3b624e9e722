//! Kinks that lie close together: each is located exactly, and no spurious arms leave it.

use std::borrow::Cow;

use super::embedded::cases;
use crate::dense::eliminate;
use crate::maps::two_pieces;
use crate::random::Random;
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::piecewise::{Derivatives, Description, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// H_i(x) = c_i + g_i·x + q_i (w·x)² + Σ_k b_ki |θ_k(x)|, θ_k = s_k (w·x − d_k) + extra_k·x.
struct Kinked {
    w: Vec<f64>,
    constant: Vec<f64>,
    linear: Vec<Vec<f64>>,
    quadratic: Vec<f64>,
    kinks: Vec<Kink>,
}

struct Kink {
    scale: f64,
    place: f64,
    extra: Vec<f64>,
    jumps: Vec<f64>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Kinked {
    fn theta(&self, k: &Kink, x: &[f64]) -> f64 {
        k.scale * (dot(&self.w, x) - k.place) + dot(&k.extra, x)
    }
    fn gradient(&self, k: &Kink, j: usize) -> f64 {
        k.scale * self.w[j] + k.extra.get(j).copied().unwrap_or(0.0)
    }
}

impl PiecewiseSmooth for Kinked {
    two_pieces!(
        self,
        [positive, negative],
        self.w.len(),
        self.constant.len(),
        self.kinks.len()
    );
    fn is_piecewise_affine(&self) -> bool {
        self.quadratic.iter().all(|q| *q == 0.0)
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (o, k) in out.iter_mut().zip(&self.kinks) {
            *o = self.theta(k, x);
        }
    }
    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        for (i, o) in out.iter_mut().enumerate() {
            *o = self.constant[i] + dot(&self.linear[i], x) + self.quadratic[i] * dot(&self.w, x).powi(2);
            for (site, k) in self.kinks.iter().enumerate() {
                *o += [1.0, -1.0][selection.piece(site)] * k.jumps[i] * self.theta(k, x);
            }
        }
    }
    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        for i in 0..self.constant.len() {
            for j in 0..self.w.len() {
                let mut v = self.linear[i][j] + 2.0 * self.quadratic[i] * dot(&self.w, x) * self.w[j];
                for (site, k) in self.kinks.iter().enumerate() {
                    v += [1.0, -1.0][selection.piece(site)] * k.jumps[i] * self.gradient(k, j);
                }
                jac.add(i, j, v);
            }
        }
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl Derivatives for Kinked {
    fn test_gradient(&self, site: usize, _test: usize, _x: &[f64], gradient: &mut [f64]) {
        for (j, g) in gradient.iter_mut().enumerate() {
            *g = self.gradient(&self.kinks[site], j);
        }
    }
}

impl Description for Kinked {
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("kink {site}"))
    }
}

/// A curve parametrised by s = w·x, which cannot branch: 2 to 4 kinks within `spread`, a few others elsewhere.
fn random_graph(random: &mut Random, spread: f64) -> Kinked {
    let n = 1 + random.below(3);
    let w = random.vector(n + 1, 1.0);
    let length = dot(&w, &w).sqrt().max(0.1);
    let centre = 2.0 * random.symmetric();
    let mut places = vec![centre];
    for _ in 0..1 + random.below(3) {
        places.push(centre + 2.0 * spread * random.symmetric());
    }
    for _ in 0..random.below(5) {
        places.push(2.0 * random.symmetric());
    }
    let (affine, scaled) = (random.below(2) == 0, random.below(2) == 0);
    let kinks = places.into_iter().map(|place| {
        let scale = if scaled {
            10_f64.powf(2.0 * random.symmetric())
        } else {
            1.0
        };
        let jumps = random.vector(n, 1.1 / scale);
        Kink {
            scale,
            place,
            extra: Vec::new(),
            jumps,
        }
    });
    let kinks = kinks.collect();
    Kinked {
        w: w.iter().map(|v| v / length).collect(),
        constant: random.vector(n, 1.0),
        linear: (0..n).map(|_| random.vector(n + 1, 1.5)).collect(),
        quadratic: random.vector(n, if affine { 0.0 } else { 0.3 }),
        kinks,
    }
}

/// The point of the curve at s.
fn over(map: &Kinked, s: f64) -> Option<Vec<f64>> {
    let mut rows = map.linear.clone();
    rows.push(map.w.clone());
    let mut right: Vec<f64> = (0..map.constant.len())
        .map(|i| {
            let kinks = map
                .kinks
                .iter()
                .map(|k| k.jumps[i] * (k.scale * (s - k.place)).abs());
            -(map.constant[i] + map.quadratic[i] * s * s + kinks.sum::<f64>())
        })
        .collect();
    right.push(s);
    let largest = rows.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    let (_, pivot, x) = eliminate(&rows, &right);
    x.filter(|_| pivot * largest >= 0.05)
}

#[test]
fn curves_that_cannot_branch_pass_clusters_of_kinks_one_by_one() {
    let mut followed = 0;
    for seed in 0..cases(3000) {
        let mut random = Random::new(seed);
        let exponent = 6 + random.below(8) as i32;
        let map = random_graph(&mut random, 10_f64.powi(-exponent));
        let up = random.below(2) == 0;
        let sign = if up { 1.0 } else { -1.0 };
        let (Some(start), Some(next)) = (over(&map, -3.0 * sign), over(&map, -2.99 * sign)) else {
            continue;
        };
        let ahead = next.iter().zip(&start).map(|(a, b)| a - b).collect();
        let options = ContinuationOptions::default()
            .with_max_arclength(40.0)
            .with_max_points(3000);
        let branch = Branch::follow(&map, &start, Direction::Along(ahead), options).unwrap();
        followed += 1;
        let case = format!("seed {seed}, kinks 1e-{exponent} apart: {:?}", branch.termination);
        assert!(
            matches!(
                branch.termination,
                Termination::ArclengthLimit | Termination::Unbounded
            ),
            "{case}"
        );
        assert!(branch.branch_points.is_empty(), "{case}");
        let reached = dot(&map.w, &branch.points.last().unwrap().x);
        for (k, kink) in map.kinks.iter().enumerate() {
            let met: Vec<_> = branch
                .transitions
                .iter()
                .filter(|t| t.vanishing.contains(&k))
                .collect();
            let distance = sign * (kink.place - reached);
            if distance.abs() > 1e-3 {
                assert_eq!(met.len(), usize::from(distance < 0.0), "{case}, kink {k}");
            }
            for t in met {
                assert!((dot(&map.w, &t.x) - kink.place).abs() < 1e-9, "{case}, kink {k}");
                assert_eq!(t.arms.len(), 1, "{case}");
            }
        }
        if exponent <= 8 {
            assert!(
                branch.transitions.iter().all(|t| t.vanishing.len() == 1),
                "{case}"
            );
        }
    }
    assert!(followed > 2000);
}

/// α = s + Σ c_k |s − d_k| in the plane.
fn graph(kinks: &[(f64, f64)]) -> Kinked {
    let kink = |&(place, jump): &(f64, f64)| Kink {
        scale: 1.0,
        place,
        extra: Vec::new(),
        jumps: vec![jump],
    };
    Kinked {
        w: vec![1.0, 0.0],
        constant: vec![0.0],
        linear: vec![vec![1.0, -1.0]],
        quadratic: vec![0.0],
        kinks: kinks.iter().map(kink).collect(),
    }
}

#[test]
fn a_kink_far_away_does_not_change_what_happens_at_a_cluster() {
    for gap in [1e-7, 2e-8, 5e-9, 2e-9, 1e-9, 5e-10, 1e-10, 1e-12] {
        for (first, second) in [(2.0, -2.5), (-2.5, 2.0), (0.9, 0.9), (-1.4, 1.0)] {
            let lists = [None, Some((5.0, 0.1))].map(|far| {
                let mut kinks = vec![(0.0, first), (gap, second)];
                kinks.extend(far);
                let map = graph(&kinks);
                let start = over(&map, -1.0).unwrap();
                let slope = 1.0 - kinks.iter().map(|k| k.1).sum::<f64>();
                let direction = if slope > 0.0 {
                    Direction::Increasing
                } else {
                    Direction::Decreasing
                };
                let options = ContinuationOptions::default().with_max_arclength(2.5);
                let branch = Branch::follow(&map, &start, direction, options).unwrap();
                assert_eq!(branch.termination, Termination::ArclengthLimit);
                let told = branch.transitions.iter().map(|t| (t.kind, t.vanishing.clone()));
                told.collect::<Vec<_>>()
            });
            assert_eq!(lists[0], lists[1], "gap {gap:e}, jumps {first}, {second}");
            assert_eq!(
                lists[0].iter().map(|t| &t.1[..]).collect::<Vec<_>>(),
                [&[0][..], &[1]]
            );
        }
    }
}

/// x = (y, z, α) on the line y = 0: the facet of the second kink crosses it at an angle of 1e-6.
#[test]
fn a_facet_almost_along_the_curve_is_met_where_the_curve_crosses_it() {
    for behind in [2e-7, 1e-6, 1e-3] {
        let kinks = vec![
            Kink {
                scale: 1.0,
                place: 0.5,
                extra: Vec::new(),
                jumps: vec![0.0, -1.0],
            },
            Kink {
                scale: 1e-6,
                place: 0.5 + behind,
                extra: vec![1.0, 0.0, 0.0],
                jumps: vec![0.0, -0.5],
            },
        ];
        let map = Kinked {
            w: vec![0.0, 0.0, 1.0],
            constant: vec![0.0; 2],
            linear: vec![vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0]],
            quadratic: vec![0.0; 2],
            kinks,
        };
        let start = [0.0, 0.5 + 0.5e-6 * (0.5 + behind), 0.0];
        let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
        let branch = Branch::follow(&map, &start, Direction::Increasing, options).unwrap();
        let met: Vec<_> = branch
            .transitions
            .iter()
            .map(|t| (t.vanishing.clone(), t.parameter()))
            .collect();
        assert_eq!(met.len(), 2, "{met:?}");
        assert_eq!((&met[0].0, &met[1].0), (&vec![0], &vec![1]));
        assert!((met[0].1 - 0.5).abs() < 1e-14);
        assert!((met[1].1 - 0.5 - behind).abs() < 1e-9);
    }
}

/// α = s + Σ c_k |s| with 24 kinks at one point, far more than can be tried: the curve goes on along the only other arm, at a fold where
/// |Σ c_k| > 1.
#[test]
fn a_curve_goes_on_where_more_kinks_meet_than_can_be_searched() {
    for jump in [-0.2, -0.03, 0.01, 0.15] {
        let kinks: Vec<(f64, f64)> = (0..24).map(|_| (0.0, jump)).collect();
        let map = graph(&kinks);
        let sum = 24.0 * jump;
        let (before, after) = (1.0 - sum, 1.0 + sum);
        let start = [-1.0, -1.0 + sum];
        let direction = if before > 0.0 {
            Direction::Increasing
        } else {
            Direction::Decreasing
        };
        let options = ContinuationOptions::default()
            .with_max_arclength(before.hypot(1.0) + after.hypot(1.0))
            .with_max_step(0.5);
        let branch = Branch::follow(&map, &start, direction, options).unwrap();
        assert_eq!(branch.termination, Termination::ArclengthLimit, "{jump}");
        let [t] = branch.transitions.as_slice() else {
            panic!("{:?}", branch.transitions)
        };
        assert!(t.x.iter().all(|v| v.abs() < 1e-14), "{:?}", t.x);
        assert_eq!(t.is_fold(), before * after < 0.0);
        let last = branch.points.last().unwrap();
        assert!(
            last.x[0] > 1.0 - 1e-12
                && (last.x[1] - after * last.x[0]).abs() < 1e-12 * last.x[0] * after.abs()
        );
    }
}
