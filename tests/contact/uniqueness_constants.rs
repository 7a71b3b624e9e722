//! Constants of the fixed-point map and of the multipliers, against independent digits.

use crate::squares;
use std::ops::ControlFlow;

use semismooth::contact::{
    ContactError, FixedPointOptions, FrictionCoefficient, FrictionCurve, Frictionless, PlanarCoulomb,
    UniquenessConstants, check_multipliers, critical_friction, fixed_point, fixed_point_observed,
    friction_bounds,
};
use semismooth::sparse::Matrix;

use crate::squares::Multipliers;

fn close(found: f64, expected: f64, absolute: f64) {
    assert!((found - expected).abs() <= absolute, "{found} {expected}");
}

#[test]
fn plane() {
    for (n, c1) in [(4, 4.729), (8, 6.788), (16, 9.642), (32, 13.653)] {
        let (problem, rows) = squares::plane(n, Frictionless::plane()).unwrap();
        let constants = UniquenessConstants::new(&problem, &rows.areas).unwrap();
        close(constants.c1(), c1, 5e-4);
        close(constants.guaranteed_friction() * constants.c1(), 1.0, 1e-14);
    }
}

#[test]
fn cube() {
    for (n, c1, c2) in [(2, 2.605, 6.17), (4, 3.907, 12.77), (8, 5.678, 25.6)] {
        let (problem, rows) = squares::cube(n, Frictionless::space()).unwrap();
        let constants = UniquenessConstants::new(&problem, &rows.areas).unwrap();
        close(constants.c1(), c1, 5e-4);
        close(constants.c2(), c2, 0.05);
    }
}

#[test]
fn inf_sup() {
    let mesh = squares::plane_mesh(128).unwrap();
    let reference = squares::traces(&mesh).unwrap();
    let beta = |n: usize, m: Multipliers| squares::inf_sup(n, m, &reference).unwrap();
    for (n, p0) in [(4, 0.147), (8, 0.074), (16, 0.037), (32, 0.019)] {
        close(beta(n, Multipliers::Constant(1)), p0, 6e-4);
        close(beta(n, Multipliers::Nodal), 1.0, 0.004);
        close(beta(n, Multipliers::Constant(2)), 0.85, 0.01);
    }
}

/// Under a constant coefficient below the guaranteed one the fixed point contracts at least as fast as the bound says.
#[test]
fn contraction_within_the_bound() {
    let law = |f: f64| PlanarCoulomb::new(FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap()));
    let (problem, rows) = squares::plane(8, law(0.1)).unwrap();
    let constants = UniquenessConstants::new(&problem, &rows.areas).unwrap();
    let critical = critical_friction(&problem).unwrap().unwrap();
    assert!(critical > constants.guaranteed_friction());
    for f in [0.05, 0.1, 0.14] {
        let problem = problem.with_law(law(f)).unwrap();
        let start = problem.stick_start(0.0).unwrap();
        let report = fixed_point(&problem, &start, &FixedPointOptions::default()).unwrap();
        assert!(report.converged);
        let mut seen = Vec::new();
        let options = FixedPointOptions::default();
        let stopped = fixed_point_observed(&problem, &start, &options, |so_far| {
            seen.push(so_far.changes.clone());
            match seen.len() {
                3 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        });
        let stopped = stopped.unwrap();
        assert!(!stopped.converged && stopped.changes == report.changes[..3]);
        assert!((1..=3).all(|k| seen[k - 1] == report.changes[..k]));
        let rate = report.contraction().unwrap();
        assert!(rate <= f * constants.c1(), "{rate} {}", f * constants.c1());
        // The same solution as by Newton on the whole law.
        let x = problem.solve(0.0, None).unwrap();
        assert!(x.iter().zip(&report.x).all(|(a, b)| (a - b).abs() < 1e-10));
    }
}

#[test]
fn bounds_of_a_law() {
    let curve = FrictionCurve::exponential(0.4, 0.1, 2.0).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::uniform(curve));
    let (problem, _) = squares::plane(2, law).unwrap();
    let (kappa, slope) = friction_bounds(&problem, 0.0, 10.0, 100_001).unwrap();
    assert_eq!(kappa, 1.0);
    close(slope, 0.15, 1e-4);
    assert!(friction_bounds(&problem, 0.0, 10.0, 1).is_err());
}

#[test]
fn invisible_multipliers() {
    let dependent = Matrix::from_rows(&[[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [2.0, 3.0, 2.0]]).unwrap();
    assert_eq!(
        check_multipliers(&dependent),
        Err(ContactError::InvisibleMultiplier { expected: 3, rank: 2 })
    );
    assert!(check_multipliers(&Matrix::identity(3)).is_ok());
}
