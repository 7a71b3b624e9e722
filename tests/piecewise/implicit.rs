//! Implicit functions of a parameter: closed forms, and difference quotients of solutions.

use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::piecewise::{
    ImplicitFunction, LocalUniqueness, MinMap, PiecewiseSmooth, Selection, implicit_function,
};
use semismooth::sparse::Matrix;

use super::certificates::Sectors;
use super::dense::eliminate;
use super::maps::{hand_on, two_pieces};
use super::random::Random;

fn at(map: &dyn PiecewiseSmooth, x: &[f64]) -> ImplicitFunction {
    implicit_function(map, x, 1e-9, 1000).unwrap()
}

fn sides(found: &ImplicitFunction) -> [Vec<f64>; 2] {
    [found.right.clone().unwrap(), found.left.clone().unwrap()]
}

fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

/// slope·y + bend |y| + push·α + fold |α| = 0 with a kink in y and one in α.
struct Absolute {
    slope: f64,
    bend: f64,
    push: f64,
    fold: f64,
}

impl PiecewiseSmooth for Absolute {
    two_pieces!(self, [negative, positive], 2, 1, 2);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(x);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let sign = |site: usize| 2.0 * s.piece(site) as f64 - 1.0;
        out[0] = (self.slope + sign(0) * self.bend) * x[0] + (self.push + sign(1) * self.fold) * x[1];
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        let sign = |site: usize| 2.0 * s.piece(site) as f64 - 1.0;
        jac.add(0, 0, self.slope + sign(0) * self.bend);
        jac.add(0, 1, self.push + sign(1) * self.fold);
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

#[test]
fn absolute_values_have_closed_forms() {
    for (slope, bend, push, fold) in [
        (1.0, 0.5, -1.0, 0.0),
        (1.0, -0.5, -1.0, 0.0),
        (-2.0, 0.25, 3.0, 0.0),
        (1.0, 0.0, 0.0, 1.0),
        (2.0, 1.0, 0.5, 2.0),
        (2.0, 1.0, -0.5, -2.0),
    ] {
        let found = at(
            &Absolute {
                slope,
                bend,
                push,
                fold,
            },
            &[0.0, 0.0],
        );
        // y from slope·y + bend |y| = load.
        let solve = |load: f64| load / (slope + bend * (load / slope).signum());
        let expected = [vec![solve(-(push + fold))], vec![solve(push - fold)]];
        assert_eq!(sides(&found), expected, "{slope} {bend} {push} {fold}");
        let rates =
            [push + fold, push - fold].map(|p| [(p / (slope + bend)).abs(), (p / (slope - bend)).abs()]);
        let constant = rates.concat().into_iter().fold(0.0, f64::max);
        assert_eq!(found.constant(), Some(constant));
    }
    // y + 2 |y| = α: determinants 3 and −1. y + |y| = α: one vanishes.
    for bend in [2.0, 1.0] {
        let found = at(
            &Absolute {
                slope: 1.0,
                bend,
                push: -1.0,
                fold: 0.0,
            },
            &[0.0, 0.0],
        );
        assert!(found.verdict.fails() && found.right.is_none() && found.left.is_none());
    }
    // At y = 1 = α/3 the map is smooth.
    let found = at(
        &Absolute {
            slope: 2.0,
            bend: 1.0,
            push: -1.0,
            fold: 0.0,
        },
        &[1.0, 3.0],
    );
    assert_eq!(sides(&found), [vec![1.0 / 3.0], vec![-1.0 / 3.0]]);
}

/// Cells that no y reaches at fixed α count, as points with other α belong to them.
#[test]
fn cells_beside_the_parameter_count() {
    /// sign(α) (y − α), with the determinants −1 and 1.
    struct Turned;
    impl PiecewiseSmooth for Turned {
        two_pieces!(self, [negative, positive], 2, 1, 1);
        fn test_functions(&self, x: &[f64], out: &mut [f64]) {
            out[0] = x[1];
        }
        fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
            out[0] = (2.0 * s.piece(0) as f64 - 1.0) * (x[0] - x[1]);
        }
        fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
            let sign = 2.0 * s.piece(0) as f64 - 1.0;
            jac.add(0, 0, sign);
            jac.add(0, 1, -sign);
        }
        fn is_piecewise_affine(&self) -> bool {
            true
        }
    }
    assert!(at(&Turned, &[0.0, 0.0]).verdict.fails());
    assert!(at(&Turned, &[1.0, 1.0]).verdict.is_certified());
}

/// One contact node: k u + λ = α, λ = P_[−g, g](λ + u). It sticks up to α = g, and slips with u' = 1/k.
#[test]
fn friction_of_one_node_slips_at_its_bound() {
    for k in [0.5, 4.0] {
        let g = 2.0;
        // One side of the law: u ≥ 0, λ ≤ g, and one of them holds with equality.
        let map = MinMap::curve(2, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = k * x[0] + x[1] - x[2];
            b[0] = a[0] + 1.0;
            a[1] = g - x[1];
            b[1] = x[0];
        });
        let found = at(&map, &[0.0, g, g]);
        let [right, left] = sides(&found);
        assert!(
            close(&right, &[1.0 / k, 0.0], 1e-7) && close(&left, &[0.0, -1.0], 1e-7),
            "{found:?}"
        );
        assert!((found.constant().unwrap() - f64::max(1.0, 1.0 / k)).abs() < 1e-7);
    }
    // Softening springs reverse the orientation.
    let map = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - 0.5 * x[0] - x[2];
        b[0] = a[0] + 1.0;
        a[1] = 2.0 - x[1];
        b[1] = x[0];
    });
    assert!(at(&map, &[0.0, 2.0, 2.0]).verdict.fails());
}

/// 0 ≤ y ⟂ M y + α r ≥ 0 at 0: y'(0; ±1) solve the problem with q = ±r, found by trying all active sets.
#[test]
fn complementarity_problems_have_derivatives_that_solve_one() {
    let mut rng = Random::new(3);
    for _ in 0..60 {
        let n = 3;
        // Diagonally dominant: a P-matrix.
        let m: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                (0..n)
                    .map(|j| rng.symmetric() + if i == j { 3.5 } else { 0.0 })
                    .collect()
            })
            .collect();
        let r: Vec<f64> = (0..n).map(|_| rng.symmetric()).collect();
        let rows: Vec<Vec<f64>> = m
            .iter()
            .zip(&r)
            .map(|(row, r)| [row.as_slice(), &[*r]].concat())
            .collect();
        let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![0.0; n]).unwrap();
        let problem = Mcp::new(f, vec![0.0; n], vec![f64::INFINITY; n]).unwrap();
        let found = at(&problem, &vec![0.0; n + 1]);
        let mut constant = 0.0_f64;
        for (side, sign) in sides(&found).iter().zip([1.0, -1.0]) {
            let mut solution = None;
            for set in 0..1_usize << n {
                let free = |i: usize| set >> i & 1 == 1;
                let a: Vec<Vec<f64>> = (0..n)
                    .map(|i| {
                        (0..n)
                            .map(|j| {
                                if free(i) {
                                    m[i][j]
                                } else {
                                    f64::from(u8::from(i == j))
                                }
                            })
                            .collect()
                    })
                    .collect();
                let b: Vec<f64> = (0..n).map(|i| if free(i) { -sign * r[i] } else { 0.0 }).collect();
                let y = eliminate(&a, &b).2.unwrap();
                constant = y.iter().fold(constant, |c, v| c.max(v.abs()));
                let w = |i: usize| (0..n).map(|j| m[i][j] * y[j]).sum::<f64>() + sign * r[i];
                if (0..n).all(|i| if free(i) { y[i] >= 0.0 } else { w(i) >= 0.0 }) {
                    solution = Some(y);
                }
            }
            assert!(close(side, &solution.unwrap(), 1e-12), "{m:?} {r:?}");
        }
        assert!((found.constant().unwrap() - constant).abs() < 1e-12);
    }
}

/// A curved map with both kinks at a solution: difference quotients of solutions on both sides of α tend to the derivatives.
#[test]
fn derivatives_are_limits_of_difference_quotients() {
    let map = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        let (y, z, alpha) = (x[0], x[1], x[2]);
        a[0] = 2.0 * y + y * z + z - alpha.sin();
        b[0] = 3.0 * y + 0.5 * z - 2.0 * alpha;
        a[1] = z - y + alpha * y - alpha;
        b[1] = 2.0 * z + y.exp() - 1.0 + alpha * alpha;
    });
    let found = at(&map, &[0.0, 0.0, 0.0]);
    // The rounding of eʸ − 1 does not fall with y.
    let mut newton = Newton::new(NewtonOptions::default().with_tolerances(1e-15, 1e-13));
    for (side, sign) in sides(&found).iter().zip([1.0, -1.0]) {
        let mut errors = Vec::new();
        for t in [1e-2, 1e-3, 1e-4] {
            let mut x = [0.0, 0.0, sign * t];
            newton.solve(&map, &mut x).unwrap();
            let quotient = [x[0] / t, x[1] / t];
            errors.push((quotient[0] - side[0]).hypot(quotient[1] - side[1]));
            assert!(
                errors[errors.len() - 1] < 20.0 * t,
                "{sign} {t}: {quotient:?} {side:?}"
            );
            assert!(x[0].hypot(x[1]) <= 1.05 * std::f64::consts::SQRT_2 * found.constant().unwrap() * t);
        }
    }
}

/// Sectors that wind twice round the origin, shifted by α: every value but one is taken twice.
#[test]
fn maps_that_wind_have_no_implicit_function() {
    struct Pushed(Sectors);
    impl PiecewiseSmooth for Pushed {
        fn num_vars(&self) -> usize {
            3
        }
        hand_on! {
            0:
            fn num_residuals(&self) -> usize;
            fn num_sites(&self) -> usize;
            fn num_pieces(&self, site: usize) -> usize;
            fn num_tests(&self, site: usize) -> usize;
            fn cell(&self, site: usize, piece: usize) -> &[semismooth::piecewise::Facet];
            fn is_piecewise_affine(&self) -> bool;
        }
        fn test_functions(&self, x: &[f64], out: &mut [f64]) {
            self.0.test_functions(&x[..2], out);
        }
        fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
            self.0.residual(s, &x[..2], out);
            out[0] -= x[2];
        }
        fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
            self.0.jacobian(s, &x[..2], jac);
            jac.add(0, 2, -1.0);
        }
    }
    let found = at(&Pushed(Sectors::winding(2.0)), &[0.0; 3]);
    match &found.verdict {
        LocalUniqueness::Winds { first, second } => {
            // Two directions of (y, α) with one image, α̇ included.
            assert_eq!((first.1.len(), first.1[2]), (3, second.1[2]));
        }
        other => panic!("{other:?}"),
    }
    assert!(found.right.is_none());
    let once = at(&Pushed(Sectors::winding(1.0)), &[0.0; 3]);
    let [right, left] = sides(&once);
    assert!(close(&right, &[1.0, 0.0], 1e-12) && close(&left, &[-1.0, 0.0], 1e-12));
}
