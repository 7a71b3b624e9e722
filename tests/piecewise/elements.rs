//! All elements of the B-subdifferential of semismooth maps, against derivatives at points nearby.

use semismooth::complementarity::{FischerBurmeister, Lcp, Mcp, McpFunction, WithJacobian};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::piecewise::{
    CertificateDoubt, Regularity, RegularityOptions, Selection, Semismooth, bd_regularity_semismooth,
    cd_regularity_semismooth,
};
use semismooth::sparse::Matrix;

use super::random::Random;

const CAP: u64 = 1000;

fn distance(a: &Matrix, b: &Matrix) -> f64 {
    let pairs = a.values().iter().zip(b.values());
    pairs.fold(0.0, |d, (a, b)| d.max((a - b).abs()))
}

/// The list holds the derivatives at random points near x, at which the map is differentiable, and nothing else, and so does the one
/// element that Newton's method uses. Returns the number of elements.
fn agrees_with_derivatives_nearby(map: &dyn Semismooth, x: &[f64], rng: &mut Random) -> usize {
    let list = map.b_subdifferential(x, 1e-12, CAP).unwrap();
    let mut met = vec![false; list.len()];
    let mut jac = Matrix::zeros(map.pattern());
    for _ in 0..600 {
        let near: Vec<f64> = x.iter().map(|x| x + 1e-8 * rng.symmetric()).collect();
        jac.clear();
        map.jacobian(&near, &mut jac);
        let close = (0..list.len()).filter(|&k| distance(&list[k], &jac) < 1e-6);
        let close: Vec<usize> = close.collect();
        assert!(!close.is_empty(), "{x:?}: {jac:?}");
        close.iter().for_each(|&k| met[k] = true);
    }
    assert!(met.iter().all(|m| *m), "{x:?}: {met:?}");
    jac.clear();
    map.jacobian(x, &mut jac);
    assert!(list.iter().any(|e| distance(e, &jac) < 1e-14), "{x:?}");
    list.len()
}

/// F(x) − F(z) + f, with kinks of the penalty at z: xᵢ at a bound where fᵢ ≠ 0, fᵢ = 0 between bounds.
fn curved(m: [[f64; 3]; 3], z: [f64; 3], f: [f64; 3]) -> impl McpFunction {
    let inner = move |x: &[f64], i: usize| -> f64 {
        (0..3).map(|j| m[i][j] * x[j]).sum::<f64>() + 0.25 * x[i] * x[(i + 1) % 3]
    };
    WithJacobian::new(
        3,
        move |x: &[f64], out: &mut [f64]| (0..3).for_each(|i| out[i] = inner(x, i) - inner(&z, i) + f[i]),
        move |x: &[f64], jac: &mut Matrix| {
            for i in 0..3 {
                (0..3).for_each(|j| jac.add(i, j, m[i][j]));
                jac.add(i, i, 0.25 * x[(i + 1) % 3]);
                jac.add(i, (i + 1) % 3, 0.25 * x[i]);
            }
        },
    )
}

#[test]
fn penalised_functions_know_all_elements() {
    let inf = f64::INFINITY;
    let mut rng = Random::new(8);
    let mut sizes = [0; 9];
    for _ in 0..60 {
        let m = std::array::from_fn(|i| {
            std::array::from_fn(|j| rng.symmetric() + if i == j { 2.0 } else { 0.0 })
        });
        let bounds: Vec<(f64, f64)> = (0..3)
            .map(|_| [(0.0, inf), (-inf, 2.0), (0.0, 2.0)][rng.below(3)])
            .collect();
        let z: [f64; 3] = std::array::from_fn(|_| rng.below(3) as f64);
        let f = std::array::from_fn(|i| {
            let closed = z[i] == bounds[i].0 || z[i] == bounds[i].1;
            if closed {
                [-1.0, 1.0][rng.below(2)]
            } else {
                [0.0, 1.5][rng.below(2)]
            }
        });
        let lower = bounds.iter().map(|b| b.0).collect();
        let upper = bounds.iter().map(|b| b.1).collect();
        let problem = Mcp::new(curved(m, z, f), lower, upper).unwrap();
        let map = FischerBurmeister::penalised(&problem, 0.8).unwrap();
        sizes[agrees_with_derivatives_nearby(&map, &z, &mut rng)] += 1;
        // Without the penalty there is one.
        let plain = FischerBurmeister::new(&problem).unwrap();
        assert_eq!(agrees_with_derivatives_nearby(&plain, &z, &mut rng), 1);
    }
    assert!([1, 2, 4, 8].iter().all(|k| sizes[*k] > 2), "{sizes:?}");
}

/// F₁ = x₁ − 1 and F₂ = 1 − x₁: two of four combinations of sides contain points.
#[test]
fn sides_without_common_points_give_no_element() {
    let m = Matrix::from_rows(&[[1.0, 0.0], [-1.0, 0.0]]).unwrap();
    let lcp = Lcp::new(m, vec![-1.0, 1.0]).unwrap();
    let map = FischerBurmeister::penalised(lcp.mcp(), 0.5).unwrap();
    assert_eq!(
        agrees_with_derivatives_nearby(&map, &[1.0, 1.0], &mut Random::new(1)),
        2
    );
    assert_eq!(map.b_subdifferential(&[1.0, 1.0], 1e-12, 3), None);
    // If F were not known to be affine, the other two could contain points.
    let bent = WithJacobian::new(
        2,
        |x: &[f64], out: &mut [f64]| (out[0], out[1]) = (x[0] - 1.0, 1.0 - x[0] + (x[1] - 1.0).powi(2)),
        |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1.0);
            jac.add(1, 0, -1.0);
            jac.add(1, 1, 2.0 * (x[1] - 1.0));
        },
    );
    let problem = Mcp::ncp(bent).unwrap();
    let map = FischerBurmeister::penalised(&problem, 0.5).unwrap();
    assert_eq!(map.b_subdifferential(&[1.0, 1.0], 1e-12, CAP), None);
}

/// 0 ≤ x ⟂ m x + q ≥ 0 of one unknown: Φ' = F' at a solution between its bounds, a ball of elements at a degenerate one.
#[test]
fn regularity_of_semismooth_maps() {
    let at = |m: f64, q: f64, x: f64| {
        let lcp = Lcp::new(Matrix::from_rows(&[[m]]).unwrap(), vec![q]).unwrap();
        let map = FischerBurmeister::new(lcp.mcp()).unwrap();
        bd_regularity_semismooth(&map, &[x], 1e-9, CAP).unwrap()
    };
    match at(3.0, -3.0, 1.0) {
        Regularity::Regular {
            selections: 1,
            singular_value,
            weakest,
        } => {
            assert!((singular_value.unwrap() - 3.0).abs() < 1e-14);
            assert_eq!(weakest.unwrap().0, Selection::from_pieces([0]));
        }
        other => panic!("{other:?}"),
    }
    assert!(at(0.0, 0.0, 1.0).fails());
    let degenerate = Regularity::Undecided {
        examined: 0,
        doubt: CertificateDoubt::Elements,
    };
    assert_eq!(at(1.0, 0.0, 0.0), degenerate);

    /// The rows aᵢ x₁ + bᵢ x₂ + (x₁)₊ cᵢ, with declared derivatives.
    struct Planar([[f64; 3]; 2]);
    impl Planar {
        fn element(&self, positive: bool) -> Matrix {
            let row = |i: usize| {
                [
                    self.0[i][0] + if positive { self.0[i][2] } else { 0.0 },
                    self.0[i][1],
                ]
            };
            Matrix::from_rows(&[row(0), row(1)]).unwrap()
        }
    }
    impl Semismooth for Planar {
        fn num_vars(&self) -> usize {
            2
        }
        fn residual(&self, x: &[f64], out: &mut [f64]) {
            self.element(x[0] > 0.0).mul_vec(x, out);
        }
        fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
            self.element(x[0] > 0.0)
                .triplets()
                .for_each(|(i, j, v)| jac.add(i, j, v));
        }
        fn b_subdifferential(&self, x: &[f64], tolerance: f64, _: u64) -> Option<Vec<Matrix>> {
            let sides = [false, true].into_iter();
            let near = sides.filter(|s| x[0].abs() <= tolerance || *s == (x[0] > 0.0));
            Some(near.map(|s| self.element(s)).collect())
        }
    }
    // Determinants 1 and 1 + c₁ b₂ − c₂ b₁ with a = I.
    for (c, bd, cd) in [
        ([1.0, 0.0], true, true),
        ([-1.0, 5.0], false, false),
        ([-2.0, 0.0], true, false),
    ] {
        let map = Planar([[1.0, 0.0, c[0]], [0.0, 1.0, c[1]]]);
        let found = bd_regularity_semismooth(&map, &[0.0; 2], 1e-9, CAP).unwrap();
        assert_eq!((found.is_regular(), found.fails()), (bd, !bd), "{c:?}");
        let hull = cd_regularity_semismooth(&map, &[0.0; 2], 1e-9, CAP).unwrap();
        assert_eq!((hull.is_regular(), hull.fails()), (cd, !cd), "{c:?} {hull:?}");
        if let Regularity::Fails {
            combination,
            singular_value,
            ..
        } = hull
        {
            // 1 + t c₁ = 0.
            let share: f64 = combination
                .iter()
                .filter(|e| e.0.piece(0) == 1)
                .map(|e| e.1)
                .sum();
            assert!((1.0 + share * c[0]).abs() < 1e-9 && singular_value.unwrap() < 1e-9);
        }
        // Newton's method reports the same of its solution.
        let options = NewtonOptions::default().with_regularity(Some(RegularityOptions::default()));
        let mut newton = Newton::new(options);
        newton.solve_semismooth(&map, &mut [0.0, 0.5]).unwrap();
        let told = newton.report().regularity.clone().unwrap();
        assert_eq!((told.bd, told.orientation, told.strong), (found, None, None));
    }
}
