//! Constants of the fixed-point map and of the multipliers, against independent digits.

use crate::{bars::problems as bars, squares};
use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, FixedPointOptions, FrictionCoefficient, FrictionCurve,
    Frictionless, LoadPath, PlanarCoulomb, UniquenessConstants, check_multipliers, critical_friction,
    fixed_point, fixed_point_observed, friction_bounds, friction_derivative, inf_sup_constant, pressure_norm,
};
use semismooth::continuation::{ContinuationOptions, certify_with};
use semismooth::piecewise::{LocalUniqueness, Selection};
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
        close(beta(n, Multipliers::Constant(2)), 0.85, 0.01);
    }
    for (n, nodal) in [(4, 0.806), (8, 0.806), (16, 0.810)] {
        close(beta(n, Multipliers::Nodal), nodal, 5e-4);
    }
}

/// a⁻¹ b by Gaussian elimination with partial pivoting, by columns of b.
fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = a.len();
    for k in 0..n {
        let pivot = (k..n)
            .max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))
            .unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in (0..n).filter(|&i| i != k) {
            let f = a[i][k] / a[k][k];
            if f != 0.0 {
                let (row, other) = (a[k].clone(), b[k].clone());
                a[i].iter_mut().zip(&row).for_each(|(x, y)| *x -= f * y);
                b[i].iter_mut().zip(&other).for_each(|(x, y)| *x -= f * y);
            }
        }
    }
    (0..n)
        .map(|k| b[k].iter().map(|v| v / a[k][k]).collect())
        .collect()
}

/// S = Q K⁻¹ Qᵀ with m cells per unit length for the nodal multipliers of n of them, all by hand except the metric K.
fn schur(m: usize, n: usize) -> Vec<Vec<f64>> {
    let mesh = squares::plane_mesh(m).unwrap();
    let space = squares::traces(&mesh).unwrap();
    let k = space.gram();
    let order = k.nrows();
    let metric = (0..order)
        .map(|i| (0..order).map(|j| k.get(i, j)).collect())
        .collect();
    // The numbers of the free nodes of the ground among all free nodes.
    let free = mesh.points().iter().filter(|p| p[0] > 1e-9);
    let ground: Vec<(usize, f64)> = free
        .enumerate()
        .filter(|(_, p)| p[1] < 1e-9)
        .map(|(i, p)| (i, p[0]))
        .collect();
    assert_eq!(ground.len(), 2 * m);
    let hat = |centre: f64, h: f64, x: f64| (1.0 - ((x - centre) / h).abs()).max(0.0);
    let (h, fine) = (1.0 / n as f64, 1.0 / m as f64);
    let mut q = vec![vec![0.0; 2 * n]; order];
    for &(i, x) in &ground {
        for (mu, entry) in q[i].iter_mut().enumerate() {
            for left in [x - fine, x].into_iter().filter(|l| *l < 2.0 - 1e-9) {
                // Simpson's rule is exact for the product of two linear functions.
                let at =
                    |t: f64| hat(x, fine, left + t * fine) * hat(h * (mu + 1) as f64, h, left + t * fine);
                *entry += fine / 6.0 * (at(0.0) + 4.0 * at(0.5) + at(1.0));
            }
        }
    }
    let response = solved(metric, q.clone());
    (0..2 * n)
        .map(|a| {
            (0..2 * n)
                .map(|b| (0..order).map(|i| q[i][a] * response[i][b]).sum())
                .collect()
        })
        .collect()
}

/// β² = 1 / λmax(S⁻¹ S_ref), by the power method.
#[test]
fn inf_sup_by_hand() {
    let (n, m) = (2, 8);
    let product = solved(schur(n, n), schur(m, n));
    let mut v = vec![1.0, -0.3, 0.7, -0.9];
    let mut largest = 0.0;
    for _ in 0..5000 {
        let w: Vec<f64> = product
            .iter()
            .map(|row| row.iter().zip(&v).map(|(a, b)| a * b).sum())
            .collect();
        largest = w.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
        v = w.iter().map(|x| x / largest).collect();
    }
    let beta = (1.0_f64 / largest).sqrt();
    let mesh = squares::plane_mesh(m).unwrap();
    let found = squares::inf_sup(n, Multipliers::Nodal, &squares::traces(&mesh).unwrap()).unwrap();
    assert!(beta < 1.0 && (found - beta).abs() < 1e-9, "{found} {beta}");
}

/// A lumped pairing against an exact one: β is not defined, and the error says so.
#[test]
fn pairings_that_do_not_belong_together_are_refused() {
    let (coarse, fine) = (squares::plane_mesh(4).unwrap(), squares::plane_mesh(32).unwrap());
    let (own, reference) = (squares::traces(&coarse).unwrap(), squares::traces(&fine).unwrap());
    let lumped = own.lumped_pairing().unwrap();
    let exact = reference
        .pairing(8, |x, out| {
            let left = ((4.0 * x[0]).floor() as usize).min(7);
            let t = 4.0 * x[0] - left as f64;
            if left > 0 {
                out.push((left - 1, 1.0 - t));
            }
            out.push((left, t));
        })
        .unwrap();
    let found = inf_sup_constant((own.gram(), &lumped), (reference.gram(), &exact));
    assert!(matches!(found, Err(ContactError::Invalid { .. })), "{found:?}");
    // A space against itself.
    let same = inf_sup_constant((own.gram(), &lumped), (own.gram(), &lumped)).unwrap();
    close(same, 1.0, 1e-7);
}

/// The bar of the talk on 40 × 4 cells at ζ = 1.4: without the motion of the slip C₂ is 684.6, with it 704.8.
#[test]
fn the_lipschitz_constant_has_all_its_parts() {
    let bar = bars::bar2d(40).unwrap();
    let (problem, areas) = (&bar.problem, &bar.rows.areas);
    let c = UniquenessConstants::new(problem, areas).unwrap();
    let x = problem
        .solve(1.4, Some(&problem.stick_start(1.4).unwrap()))
        .unwrap();
    let pressure = pressure_norm(areas, &x[..areas.len()]).unwrap();
    let direct: f64 = areas.iter().zip(&x).map(|(m, f)| f / m * f).sum();
    close(pressure, direct.sqrt(), 1e-12);
    // |F′| is largest at ξ = 5 mm / √2.
    let slope = 1.4 * 0.3 * (2.0_f64).sqrt() / 0.005 * (-0.5_f64).exp();
    let (kappa, sampled) = friction_bounds(problem, 1.4, 0.05, 20_001).unwrap();
    assert!(kappa == 1.0 && (sampled / slope - 1.0).abs() < 1e-5);
    let bound = c.lipschitz(0.56, slope, kappa, pressure);
    close(slope * pressure * c.c2(), 684.6, 0.05);
    close(bound.c2, 704.8, 0.05);
    close(bound.c1, 0.56 * c.c_t * (c.c_inv + c.c_t), 1e-12);
    assert_eq!(bound.c(), bound.c1.max(bound.c2));
    close(c.critical_slope(kappa, pressure) * bound.c2 / slope, 1.0, 1e-12);
    // The rate is the spectral radius of the parts [φ → φ′, g → φ′; φ → λν, g → λν], of rank one.
    let (a, b) = (slope * pressure * c.c_inf, 0.56 * c.c_t);
    close(bound.rate, a * c.c_t + b * c.c_inv, 1e-9 * bound.rate);
    // Without a slope C₂ vanishes, and C₁ is that of the contraction in g alone.
    let still = c.lipschitz(0.56, 0.0, 1.0, pressure);
    assert_eq!((still.c2, still.c1), (0.0, 0.56 * c.c_t * c.c_inv));
    assert!(c.critical_slope(1.0, 0.0).is_infinite());
}

/// On the boundary of stick and slip+ with F = 2, in closed form: λν = 1 + δ/(4 − δ), λt = F λν for F = 2 − δ, no change for δ < 0.
#[test]
fn certificates_for_the_coefficient_of_friction() {
    let problem = |friction: f64| {
        let body = ContactBody::new(
            Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap(),
            Matrix::from_rows(&[[1.0, 0.0]]).unwrap(),
            vec![Matrix::from_rows(&[[0.0, 1.0]]).unwrap()],
            LoadPath::constant(vec![1.0, 2.0]),
        )
        .unwrap();
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(
            FrictionCurve::constant(friction).unwrap(),
        ));
        CondensedContact::new(body, law).unwrap()
    };
    let map = problem(2.0);
    let x = map.solve(0.0, None).unwrap();
    let derivative = |s: &Selection| friction_derivative(&map, s, &x).unwrap();
    let found = certify_with(&map, &x, derivative, &ContinuationOptions::default()).unwrap();
    let LocalUniqueness::Lipschitz {
        constant,
        selections: 2,
        ..
    } = found
    else {
        panic!("{found:?}");
    };
    close(constant, 0.5, 1e-9);
    for delta in [1e-4, -1e-4] {
        let y = problem(2.0 - delta).solve(0.0, None).unwrap();
        let motion = x.iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let expected = if delta > 0.0 { 0.5 * delta } else { 0.0 };
        assert!((motion - expected).abs() < 1e-8, "{motion:e} {expected:e}");
    }
    assert!(matches!(
        friction_derivative(&problem(0.0), &Selection::uniform(1, 0), &x),
        Err(ContactError::Invalid { .. })
    ));
    assert!(friction_derivative(&map, &Selection::uniform(2, 0), &x).is_err());
    assert!(friction_derivative(&map, &Selection::uniform(1, 0), &x[..1]).is_err());
}

/// Under a constant coefficient below the guaranteed one the fixed-point iteration contracts at least as fast as the bound.
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
