//! A prescribed augmentation parameter affects Newton's method and printed values only: nothing that is followed, classified or listed
//! depends on it.

use crate::random::Random;
use semismooth::contact::{
    CondensedContact, Contact, ContactError, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Diagram, DiagramOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::interface::View;
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sparse::Matrix;

/// A definite body of stiffness `unit` with two contact nodes.
fn problem(seed: u64, unit: f64) -> FullContact<PlanarCoulomb> {
    let mut random = Random::new(seed);
    let n = 5;
    let factor: Vec<Vec<f64>> = (0..n)
        .map(|_| (0..n).map(|_| random.symmetric()).collect())
        .collect();
    let entry = |i: usize, j: usize| {
        let product: f64 = (0..n).map(|k| factor[i][k] * factor[j][k]).sum();
        unit * (product + if i == j { 1.0 } else { 0.0 })
    };
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| entry(i.min(j), i.max(j))).collect())
        .collect();
    let pick = |k: usize| -> Vec<f64> { (0..n).map(|j| if j == k { 1.0 } else { 0.0 }).collect() };
    let mut forces = || -> Vec<f64> { (0..n).map(|_| 2.0 * unit * random.symmetric()).collect() };
    let load = LoadPath::affine(forces(), forces());
    let friction = 0.3 + 0.7 * random.symmetric().abs();
    FullContact::planar(
        Matrix::from_rows(&rows).unwrap(),
        Matrix::from_rows(&[pick(0), pick(2)]).unwrap(),
        Matrix::from_rows(&[pick(1), pick(3)]).unwrap(),
        load,
        FrictionCoefficient::constant(friction).unwrap(),
    )
    .unwrap()
}

fn follow<P: PiecewiseSmooth + ?Sized>(map: &P, x: &[f64]) -> Branch {
    let options = ContinuationOptions::default().with_parameter_range((-4.0, 4.0));
    Branch::follow(map, x, Direction::Increasing, options).unwrap()
}

/// Branch, solutions and diagram of the problem, without the printed test functions.
fn account<P: PiecewiseSmooth>(map: &P, x: &[f64]) -> String {
    let mut branch = follow(map, x);
    for t in &mut branch.transitions {
        t.test_functions.clear();
    }
    let solutions = all_solutions(map, 0.3, &EnumerationOptions::default()).unwrap();
    let options = DiagramOptions::default().with_parameter_range((-4.0, 4.0));
    let diagram = Diagram::explore(map, &[x], &options).unwrap();
    let graph = (diagram.vertices(), diagram.edges().len(), diagram.completeness());
    format!("{branch:?} {solutions:?} {graph:?}")
}

/// λν + r (u_ν − gap) at each node, by hand.
fn first_tests<V: View>(map: &Contact<V, PlanarCoulomb>, x: &[f64], r: f64) -> Vec<(f64, f64)> {
    let nodes = map.nodes(x);
    let terms = nodes.iter().map(|v| (v.pressure, r * v.penetration));
    terms.map(|(a, b)| (a + b, a.abs() + b.abs())).collect()
}

fn is_the_same_at_every_r<V: View>(own: &Contact<V, PlanarCoulomb>) {
    let x = own.solve(0.3, None).unwrap();
    let expected = account(own, &x);
    for exponent in [-12, -9, -6, -3, -1, 1, 3, 6, 9, 12] {
        let r = own.r() * 10_f64.powi(exponent) * if exponent > 0 { 0.999 } else { 1.001 };
        let map = own.clone().with_r(r).unwrap();
        assert_eq!(
            account(&map, &x),
            expected,
            "r = 10^{exponent} times the stiffness"
        );
        // Newton's method with this r.
        let other = map.solve(0.3, None).unwrap();
        let size = x.iter().fold(1.0_f64, |a, v| a.max(v.abs()));
        let listed = all_solutions(own, 0.3, &EnumerationOptions::default()).unwrap();
        let near = |y: &[f64]| y.iter().zip(&other).all(|(a, b)| (a - b).abs() <= 1e-9 * size);
        assert!(
            listed.solutions.iter().any(|s| near(&s.x)),
            "r = 10^{exponent} times the stiffness"
        );
        // Test functions are reported with this r.
        for t in &follow(&map, &x).transitions {
            let theta = map.theta(&t.x);
            let tests = t.test_functions.chunks_exact(t.test_functions.len() / 2);
            for ((told, (first, size)), theta) in tests.zip(first_tests(own, &t.x, r)).zip(theta) {
                assert!((told[0] - first).abs() <= 1e-12 * size);
                assert!(told[0] == theta[0]);
            }
        }
    }
    for factor in [1e-13, 1e13, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = own.clone().with_r(factor * own.r());
        let Err(ContactError::Augmentation { lowest, highest, .. }) = refused else {
            panic!("r = {factor} times the stiffness is taken");
        };
        assert!(lowest < own.r() && own.r() < highest);
    }
}

#[test]
fn nothing_that_is_found_depends_on_r() {
    let mut transitions = 0;
    for seed in 0..6 {
        let unit = [1.0, 1e9, 1e-6][seed as usize % 3];
        let full = problem(seed, unit);
        let condensed = CondensedContact::new(full.body().clone(), full.node_law().clone()).unwrap();
        is_the_same_at_every_r(&full);
        is_the_same_at_every_r(&condensed);
        transitions += follow(&condensed, &condensed.solve(0.3, None).unwrap())
            .transitions
            .len();
    }
    assert!(transitions >= 6, "{transitions}");
}

/// If the mean stiffness of the nodes is not positive, there is no scale for r: r is that of the stiffness 1.
#[test]
fn bodies_without_stiffness_have_a_scale() {
    let of = |diagonal: [f64; 4]| {
        let unit = |k: usize| (0..4).map(|j| f64::from(u8::from(j == k))).collect::<Vec<f64>>();
        let pick = |k: [usize; 2]| Matrix::from_rows(&k.map(unit)).unwrap();
        let rows: Vec<Vec<f64>> = (0..4)
            .map(|k| unit(k).iter().map(|v| v * diagonal[k]).collect())
            .collect();
        let body = FullContact::planar(
            Matrix::from_rows(&rows).unwrap(),
            pick([0, 2]),
            pick([1, 3]),
            LoadPath::constant(vec![1.0; 4]),
            FrictionCoefficient::constant(0.5).unwrap(),
        );
        body.unwrap().r()
    };
    let one = of([1.0; 4]);
    assert!(one > 0.0);
    assert_eq!(of([3.0; 4]), 3.0 * one);
    for none in [[0.0; 4], [-2.0; 4], [1.0, -1.0, 1.0, -1.5]] {
        assert_eq!(of(none), one, "{none:?}");
    }
}
