//! Certificates of local uniqueness: they fail exactly at folds and branchings.

use crate::common;
use proptest::prelude::*;
use semismooth::contact::{FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
use semismooth::piecewise::{LocalUniqueness, MinMap};
use semismooth::sparse::Matrix;

fn check(map: &FullContact<PlanarCoulomb>, branch: &Branch, options: &ContinuationOptions) {
    let load = map.load_derivative().unwrap();
    for t in &branch.transitions {
        let found = t.certify(map, &load, options).unwrap();
        match t.kind {
            TransitionKind::PassThrough => assert!(found.is_certified(), "{} {found:?}", t.parameter()),
            TransitionKind::End => {}
            _ => assert!(found.fails(), "{} {:?} {found:?}", t.parameter(), t.kind),
        }
    }
    for point in branch
        .points
        .iter()
        .filter(|p| p.grazing.is_empty() && p.det_sign != Some(0))
    {
        let found = semismooth::continuation::certify(map, &point.x, &load, options).unwrap();
        assert!(found.is_certified(), "{} {found:?}", point.parameter());
    }
    for b in &branch.branch_points {
        let found = semismooth::continuation::certify(map, &b.point.x, &load, options).unwrap();
        assert!(found.fails(), "{} {found:?}", b.point.parameter());
    }
}

#[test]
fn printed_examples_lose_uniqueness_at_folds_and_branchings_only() {
    let options = ContinuationOptions::default().with_parameter_range((0.01, 10.0));
    for case in common::cases().iter().filter(|c| c.name.contains("_ex")) {
        for states in ["O", "K", "OO", "KK", "OK"] {
            let states = common::states(states);
            if states.len() != case.problem.num_contacts() {
                continue;
            }
            let Ok(x) = case.problem.solve_from_states(10.0, &states) else {
                continue;
            };
            let branch = Branch::follow(&case.problem, &x, Direction::Decreasing, options.clone()).unwrap();
            check(&case.problem, &branch, &options);
        }
    }
}

/// Moving the load of a certified point moves the solution by no more than the constant allows.
#[test]
fn the_constant_bounds_the_motion() {
    let problem = |f: [f64; 2]| {
        FullContact::planar(
            Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap(),
            Matrix::from_rows(&[[1.0, 0.0]]).unwrap(),
            Matrix::from_rows(&[[0.0, 1.0]]).unwrap(),
            LoadPath::constant(f.to_vec()),
            FrictionCoefficient::nodal(vec![2.0]).unwrap(),
        )
        .unwrap()
    };
    // On the line |f_t| = F f_ν stick and slip+ are both active.
    let (map, options) = (problem([1.0, 2.0]), ContinuationOptions::default());
    let x = map.solve(0.0, None).unwrap();
    let load = map.load_derivative().unwrap();
    let found = semismooth::continuation::certify(&map, &x, &load, &options).unwrap();
    let LocalUniqueness::Lipschitz {
        constant,
        selections: 2,
        ..
    } = found
    else {
        panic!("{found:?}");
    };
    let mut largest = 0.0_f64;
    for (a, b) in [
        (1.0, 1.0),
        (1.0, -1.0),
        (-1.0, 1.0),
        (-1.0, -1.0),
        (0.0, 1.0),
        (1.0, 0.0),
    ] {
        let moved = problem([1.0 + 1e-3 * a, 2.0 + 1e-3 * b]);
        let y = moved.solve(0.0, None).unwrap();
        let motion = x.iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(motion <= 1e-3 * constant * (1.0 + 1e-9));
        largest = largest.max(motion);
    }
    assert!(largest > 0.3e-3 * constant);
}

/// c y ± u / 2 on the two sides of u = s y + t α = 0: where |s| > 2 |c| the slopes of y differ in sign. Within the vanishing distance both
/// pieces are active, whatever the direction of the kink.
#[test]
fn kinks_of_all_directions_are_seen() {
    let options = ContinuationOptions::default();
    for k in 0..180 {
        let (t, s) = f64::from(k).to_radians().sin_cos();
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            let u = s * x[0] + t * x[1];
            a[0] = 0.1 * s * x[0] + 0.5 * u;
            b[0] = 0.1 * s * x[0] - 0.5 * u;
        });
        let at = |d: f64| {
            let point = [
                d * options.vanishing_distance * s,
                d * options.vanishing_distance * t,
            ];
            semismooth::continuation::certify(&map, &point, &Matrix::identity(1), &options).unwrap()
        };
        // Slopes are a multiple of s: at s = 0 there is no solution to be unique.
        if s.abs() > 1e-3 {
            assert!(at(0.9).fails() && at(-0.9).fails(), "{k}°");
            assert!(at(1e3).is_certified() && at(-1e3).is_certified(), "{k}°");
        }
    }
}

#[test]
fn smooth_folds_fail() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + x[1];
        b[0] = 1e9;
    });
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let branch = Branch::follow(&map, &[1.0, -1.0], Direction::Increasing, options.clone()).unwrap();
    let list = branch.certify(&map, &Matrix::identity(1), &options).unwrap();
    let failing: Vec<f64> = list.iter().filter(|c| c.1.fails()).map(|c| c.0).collect();
    assert_eq!(failing, [branch.smooth_folds[0].arclength]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn random_problems(
        entries in prop::collection::vec(-1.0..1.0f64, 16),
        f0 in prop::collection::vec(-2.0..2.0f64, 4),
        f1 in prop::collection::vec(-2.0..2.0f64, 4),
        friction in prop::collection::vec(0.1..4.0f64, 2),
    ) {
        let g = |i: usize, j: usize| entries[4 * i + j];
        let rows: Vec<Vec<f64>> = (0..4)
            .map(|i| {
                (0..4)
                    .map(|j| (0..4).map(|k| g(i, k) * g(j, k)).sum::<f64>() + f64::from(u8::from(i == j)))
                    .collect()
            })
            .collect();
        let map = FullContact::planar(
            Matrix::from_rows(&rows).unwrap(),
            Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]).unwrap(),
            Matrix::from_rows(&[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]).unwrap(),
            LoadPath::affine(f0, f1),
            FrictionCoefficient::nodal(friction).unwrap(),
        ).unwrap();
        let options = ContinuationOptions::default().with_parameter_range((-3.0, 3.0));
        if let Ok(x) = map.solve(-3.0, None)
            && let Ok(branch) = Branch::follow(&map, &x, Direction::Increasing, options.clone())
        {
            check(&map, &branch, &options);
        }
    }
}
