//! How far a piece holds.

use semismooth::complementarity::Lcp;
use semismooth::sensitivity::{Sensitivity, SensitivityError, Validity, valid_along};
use semismooth::sparse::Matrix;
use semismooth::{parametric, solve_lcp};

use super::random::Random;

/// The ratio test of random problems: just before its end the solution is the extrapolated one, just after it
/// is not.
#[test]
fn affine_problems_hold_exactly_up_to_the_next_kink() {
    let mut finite = 0;
    for seed in 0..50 {
        let random = &mut Random::new(seed);
        let n = 4;
        let mut rows = random.square(n);
        (0..n).for_each(|i| rows[i][i] += 4.0);
        let matrix = Matrix::from_rows(&rows).unwrap();
        let q = random.vector(n, 1.0);
        let delta = random.vector(n, 1.0);
        let z = solve_lcp(matrix.clone(), &q).unwrap().x;
        let lcp = Lcp::new(matrix.clone(), q.clone()).unwrap();
        let map = lcp.in_constants(&Matrix::identity(n)).unwrap();
        let mut found = Sensitivity::new(map, &z, &vec![0.0; n]).unwrap();
        let rate = found.jvp(&delta).unwrap();
        let Validity::Exact(until) = found.valid_until(&delta, 1.0).unwrap() else {
            panic!("the problem is affine");
        };
        let gap = |s: f64| {
            let moved: Vec<f64> = q.iter().zip(&delta).map(|(q, d)| q + s * d).collect();
            let solved = solve_lcp(matrix.clone(), &moved).unwrap().x;
            (0..n).fold(0.0_f64, |m, i| m.max((solved[i] - z[i] - s * rate[i]).abs()))
        };
        if until.is_infinite() {
            assert!(gap(1e3) < 1e-9, "seed {seed}");
            continue;
        }
        finite += 1;
        assert!(gap(until * (1.0 - 1e-9)) < 1e-10, "seed {seed}");
        assert!(
            gap(1.1 * until) > 1e-6 * until,
            "seed {seed}: {}",
            gap(1.1 * until)
        );
    }
    assert!(finite > 20);
}

/// x = max(eᵖ − 2, 0) leaves its kink's side at p = ln 2; p = x² + 1 folds at p = 1.
#[test]
fn curved_problems_hold_up_to_the_first_event() {
    let map = parametric(1, 1, |x, p| vec![x[0] - (p[0].exp() - 2.0).max(0.0)]);
    let mut found = Sensitivity::new(map, &[0.0], &[0.0]).unwrap();
    let Validity::Followed(until) = found.valid_until(&[0.5], 10.0).unwrap() else {
        panic!("there is a kink");
    };
    assert!((until - 2.0 * 2.0_f64.ln()).abs() < 1e-9);
    assert_eq!(found.valid_until(&[-1.0], 10.0).unwrap(), Validity::Beyond(10.0));

    let fold = parametric(1, 1, |x, p| vec![x[0] * x[0] + 1.0 - p[0]]);
    let mut found = Sensitivity::new(fold, &[1.0], &[2.0]).unwrap();
    let Validity::Followed(until) = found.valid_until(&[-1.0], 5.0).unwrap() else {
        panic!("there is a fold");
    };
    assert!((until - 1.0).abs() < 1e-9);
}

/// At a kink the range is that of the piece that the direction enters.
#[test]
fn at_kinks_the_range_is_that_of_the_piece_entered() {
    let map = || parametric(1, 1, |x, p| vec![x[0] - p[0].max(2.0 * p[0]).min(3.0)]);
    let mut found = Sensitivity::new(map(), &[0.0], &[0.0]).unwrap();
    // Nested kinks are followed.
    assert!((found.valid_until(&[1.0], 10.0).unwrap().until() - 1.5).abs() < 1e-9);
    assert_eq!(found.valid_until(&[-1.0], 10.0).unwrap().until(), 10.0);
    let fold = parametric(1, 1, |x, p| vec![x[0].abs() - p[0]]);
    let mut fold = Sensitivity::new(fold, &[0.0], &[0.0]).unwrap();
    assert!(matches!(
        fold.valid_until(&[1.0], 1.0),
        Err(SensitivityError::NotUnique { .. })
    ));
    assert!(found.valid_until(&[1.0], 0.0).is_err());
}

/// x₁ = 1 + 0.3 x₀ − 0.3 θ stays where it is, but for rounding, and so does x₂ = max(x₁, 0): no kink is ahead, however far.
#[test]
fn test_functions_that_rounding_moves_are_never_met() {
    for theta in [0.1, 0.7, 3.3, 1e3] {
        let map = parametric(3, 1, |x, p| {
            vec![
                x[0] - p[0],
                x[1] - 0.3 * x[0] + 0.3 * p[0] - 1.0,
                x[2] - x[1].max(0.0),
            ]
        });
        let mut found = Sensitivity::new(map, &[theta, 1.0, 1.0], &[theta]).unwrap();
        for side in [1.0, -1.0] {
            let range = found.valid_until(&[side], 1.0).unwrap();
            assert_eq!(range, Validity::Exact(f64::INFINITY), "{theta} {side}");
        }
    }
}

/// A stretched spring of stiffness 4 (1 − s)(2 − s) under the load 12, with its stop at distance 6: x = 3/((1 − s)(2 − s)) meets it where
/// s² − 3 s + 3/2 = 0.
#[test]
fn families_hold_up_to_the_first_kink_of_their_solutions() {
    let family = |s: f64, at: f64| {
        let stiffness = 4.0 * (1.0 - s) * (2.0 - s);
        let map = parametric(1, 1, move |x, p| {
            vec![stiffness * x[0] - 12.0 - p[0] + 100.0 * (x[0] - at).max(0.0)]
        });
        Ok::<_, SensitivityError>((map, vec![0.0]))
    };
    let exact = (3.0 - 3.0_f64.sqrt()) / 2.0;
    let until = valid_along(|s| family(s, 6.0), &[1.5], 0.9).unwrap();
    assert!(
        matches!(until, Validity::Followed(s) if (s - exact).abs() < 2e-9),
        "{until} {exact}"
    );
    assert_eq!(
        valid_along(|s| family(s, 6.0), &[1.5], 0.5).unwrap(),
        Validity::Beyond(0.5)
    );
    // From a kink to the stiff side, and back after 1: the load is 1 + s − s².
    let bump = |s: f64| {
        let map = parametric(1, 1, move |x, p| {
            vec![x[0] + (x[0] - 1.0).max(0.0) - 1.0 - s + s * s - p[0]]
        });
        Ok::<_, SensitivityError>((map, vec![0.0]))
    };
    let until = valid_along(bump, &[1.0], 1.75).unwrap();
    assert!(
        matches!(until, Validity::Followed(s) if (s - 1.0).abs() < 4e-9),
        "{until}"
    );
}

/// A gap of (s − 0.3)² − 1/1000 is open at the ends of the horizon and halfway, and closed between.
#[test]
fn families_meet_what_happens_between_the_points_computed() {
    let dip = |s: f64| {
        let gap = (s - 0.3).powi(2) - 1e-3;
        let map = parametric(1, 1, move |x, p| vec![x[0] - (p[0] - gap).max(0.0)]);
        Ok::<_, SensitivityError>((map, vec![0.0]))
    };
    let until = valid_along(dip, &[0.0], 1.0).unwrap();
    let exact = 0.3 - 1e-3_f64.sqrt();
    assert!(
        matches!(until, Validity::Followed(s) if (s - exact).abs() < 2e-9),
        "{until} {exact}"
    );
}

/// x = 1/(1 − p) goes to infinity, before the horizon of the search.
#[test]
fn curves_that_go_to_infinity_are_lost_where_they_do() {
    let map = parametric(1, 1, |x, p| vec![x[0] * (1.0 - p[0]) - 1.0]);
    let mut found = Sensitivity::new(map, &[1.0], &[0.0]).unwrap();
    let until = found.valid_until(&[1.0], 2.0).unwrap();
    assert!(
        matches!(until, Validity::Lost(s, _) if s > 0.9 && s <= 1.0),
        "{until}"
    );
}
