//! Projections on polyhedra: nearest points, distances, proofs that a set is empty, constraints that nearly depend on each other.

use semismooth::complementarity::ComplementarityError;
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Projection};

use crate::random::Random;
use crate::{Data, INF, dot, matrix};

#[test]
fn empty_sets_are_proven_empty() {
    let rows = vec![vec![1.0, 1.0], vec![-1.0, -1.0]];
    let data = Data {
        a: rows,
        b: vec![1.0, -2.0],
        e: vec![],
        d: vec![],
        lower: vec![-INF; 2],
        upper: vec![INF; 2],
    };
    let Projection::Empty(certificate) = data.set().project(&[0.0, 0.0]).unwrap() else {
        panic!()
    };
    assert!(data.proves_empty(&certificate));
    // Within rounding of each other: x ≤ 1 and x ≥ 1 + 2⁻⁵¹ have no common point, x ≤ 1 and x ≥ 1 have one.
    for (gap, empty) in [(0.0, false), (1e-9, true)] {
        let near = Polyhedron::boxed(vec![1.0 + gap], vec![1.0]).unwrap();
        assert_eq!(
            matches!(near.project(&[7.0]).unwrap(), Projection::Empty(_)),
            empty
        );
        let rows = matrix(&[vec![3.0], vec![-3.0]], 1);
        let near = Polyhedron::space(1)
            .unwrap()
            .with_inequalities(rows, vec![3.0, -3.0 - gap])
            .unwrap();
        assert_eq!(
            matches!(near.project(&[7.0]).unwrap(), Projection::Empty(_)),
            empty
        );
    }
    // 0 x = 1, 0 x ≤ −1.
    let zero = Polyhedron::space(1)
        .unwrap()
        .with_equations(matrix(&[vec![0.0]], 1), vec![1.0])
        .unwrap();
    assert!(matches!(zero.project(&[0.0]).unwrap(), Projection::Empty(_)));
    let zero = Polyhedron::space(1)
        .unwrap()
        .with_inequalities(matrix(&[vec![0.0]], 1), vec![-1.0])
        .unwrap();
    assert!(matches!(zero.project(&[0.0]).unwrap(), Projection::Empty(_)));
    // 0 x ≤ 0, which says nothing, before 0 x ≤ −1.
    let rows = matrix(&[vec![0.0], vec![0.0]], 1);
    let zero = Polyhedron::space(1)
        .unwrap()
        .with_inequalities(rows, vec![0.0, -1.0])
        .unwrap();
    assert!(matches!(zero.project(&[0.0]).unwrap(), Projection::Empty(_)));
}

/// Where a set has one row or bound alone, its violation is the distance from the set, in all units of the row.
#[test]
fn violations_of_one_constraint_are_distances() {
    let mut random = Random::new(21);
    for k in 0..200 {
        let (x, row, unit) = (
            random.vector(3, 2.0),
            random.vector(3, 1.0),
            10_f64.powi(k % 7 - 3),
        );
        let rows = matrix(&[row.iter().map(|v| unit * v).collect()], 3);
        let (right, space) = (vec![unit * random.symmetric()], Polyhedron::space(3).unwrap());
        let (mut lower, mut upper) = (vec![-INF; 3], vec![INF; 3]);
        let set = match k % 4 {
            0 => space.with_inequalities(rows, right).unwrap(),
            1 => space.with_equations(rows, right).unwrap(),
            2 => {
                lower[1] = random.symmetric();
                Polyhedron::boxed(lower, upper).unwrap()
            }
            _ => {
                upper[1] = random.symmetric();
                Polyhedron::boxed(lower, upper).unwrap()
            }
        };
        let Projection::Nearest(nearest) = set.project(&x).unwrap() else {
            panic!("not empty");
        };
        let apart: Vec<f64> = nearest.x.iter().zip(&x).map(|(p, x)| p - x).collect();
        let (distance, violation) = (dot(&apart, &apart).sqrt(), set.violation(&x).unwrap());
        assert!(
            (distance - violation).abs() < 1e-14,
            "{k}: {distance} {violation}"
        );
    }
}

/// y ≤ 0 and y ≥ 10⁻⁶ − θ x meet at x = 10⁻⁶/θ, however far that is: never called empty, unless θ = 0.
#[test]
fn lines_that_meet_far_away_are_not_called_parallel() {
    for k in 0..60_i32 {
        let slope = 0.5_f64.powi(k);
        let rows = matrix(&[vec![0.0, 1.0], vec![-slope, -1.0]], 2);
        let set = Polyhedron::space(2)
            .unwrap()
            .with_inequalities(rows, vec![0.0, -1e-6])
            .unwrap();
        match set.project(&[0.0, 0.0]) {
            Ok(Projection::Nearest(nearest)) => {
                assert!(nearest.x[0] * slope >= 1e-6 * (1.0 - 1e-6) && nearest.x[1].abs() < 1e-12);
            }
            Err(ComplementarityError::Unresolved { .. }) => assert!(k > 40, "{k}"),
            other => panic!("{k}: {other:?}"),
        }
    }
    let rows = matrix(&[vec![0.0, 1.0], vec![0.0, -1.0]], 2);
    let set = Polyhedron::space(2)
        .unwrap()
        .with_inequalities(rows, vec![0.0, -1e-6])
        .unwrap();
    let Projection::Empty(certificate) = set.project(&[0.0, 0.0]).unwrap() else {
        panic!()
    };
    assert_eq!(certificate.radius, f64::INFINITY);
}

/// The same beside rows that have nothing to do with it, so many that exact arithmetic does not look at all of them.
#[test]
fn lines_that_meet_far_away_are_not_called_parallel_among_many_rows() {
    let (n, m) = (60, 120);
    for k in [20, 30, 36, 40, 44, 50] {
        let slope = 0.5_f64.powi(k);
        let mut entries = vec![(0, 1, 1.0), (1, 0, -slope), (1, 1, -1.0)];
        entries.extend(
            (0..m).flat_map(|i| [(2 + i, 2 + i % (n - 2), 1.0), (2 + i, 2 + (i + 1) % (n - 2), 1.0)]),
        );
        let mut right = vec![0.0, -1e-6];
        right.resize(2 + m, 1.0);
        let set = Polyhedron::space(n)
            .unwrap()
            .with_inequalities(Matrix::from_triplets(2 + m, n, &entries).unwrap(), right)
            .unwrap();
        match set.project(&vec![0.0; n]) {
            Ok(Projection::Nearest(nearest)) => {
                assert!(nearest.x[0] * slope >= 1e-6 * (1.0 - 1e-6) && nearest.x[1].abs() < 1e-12);
            }
            Err(ComplementarityError::Unresolved { .. }) => assert!(k > 40, "{k}"),
            other => panic!("{k}: {other:?}"),
        }
    }
}

/// x = i/10, y = j/10 and x + y = (i + j)/10, or the inequalities x ≤ i/10, y ≤ j/10 and x + y ≥ (i + j)/10, have the common point that
/// they state, although the numbers stored may contradict each other.
#[test]
fn decimal_fractions_that_do_not_add_up_exclude_no_point() {
    let mut contradictory = 0;
    for (i, j) in (1..10).flat_map(|i| (1..10).map(move |j| (f64::from(i), f64::from(j)))) {
        let [p, q, sum] = [i, j, i + j].map(|k| k / 10.0);
        contradictory += usize::from(p + q < sum);
        let rows = matrix(&[vec![1.0, 0.0], vec![0.0, 1.0], vec![-1.0, -1.0]], 2);
        let (right, space) = (vec![p, q, -sum], Polyhedron::space(2).unwrap());
        for set in [
            space.clone().with_equations(rows.clone(), right.clone()).unwrap(),
            space.with_inequalities(rows, right).unwrap(),
        ] {
            for start in [[0.0, 0.0], [3.0, -1.0], [2.0, 2.0]] {
                let Projection::Nearest(nearest) = set.project(&start).unwrap() else {
                    panic!("{p} + {q} = {sum} from {start:?}");
                };
                let [x, y] = nearest.x[..] else { panic!() };
                assert!((x - p).abs() < 1e-14 && (y - q).abs() < 1e-14, "{x} {y}");
            }
        }
    }
    assert!(contradictory > 3, "{contradictory}");
}

/// x = 0, x + η y = 0 and y + δ z = 0 leave z = 0, which is far outside of z ≥ 100: a point that violates the last equation, which nearly
/// depends on the others, is not the nearest, on whichever side of it the search begins.
#[test]
fn equations_that_nearly_depend_on_others_are_met_from_both_sides() {
    for exponent in 20..40 {
        let (eta, delta) = (1e-4, 0.5_f64.powi(exponent));
        let equations = [vec![1.0, 0.0, 0.0], vec![1.0, eta, 0.0], vec![0.0, 1.0, delta]];
        for (sign, start) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let rows = matrix(&[vec![0.0, 0.0, -sign]], 3);
            let set = Polyhedron::space(3)
                .unwrap()
                .with_equations(matrix(&equations, 3), vec![0.0; 3])
                .unwrap()
                .with_inequalities(rows, vec![-100.0])
                .unwrap();
            if let Ok(Projection::Nearest(nearest)) = set.project(&[0.0, 0.0, start]) {
                let violation = set.violation(&nearest.x).unwrap();
                assert!(violation < 5e-8, "{exponent}, {sign}, {start}: {violation:e}");
            }
        }
    }
}

/// The equations and x₃ ≥ 2 imply x₂ ≤ −23/3, and with the inequality, which nearly depends on them, δ x₂ ≥ 0: the set is empty, and a
/// point that violates the constraints by more than rounding is not reported as the nearest one.
#[test]
fn points_that_violate_a_nearly_dependent_row_are_not_the_nearest() {
    for k in 1..60 {
        let delta = 0.5_f64.powi(k);
        let equations = [vec![3.0, -3.0, 0.0], vec![-1.0, 2.0, 2.0]];
        let rows = [vec![3.0, 3.0, 1.0], vec![-1.0, 2.0 - delta, 2.0]];
        let set = Polyhedron::boxed(vec![-INF, -INF, 2.0], vec![INF; 3])
            .unwrap()
            .with_equations(matrix(&equations, 3), vec![-2.0, -3.0])
            .unwrap()
            .with_inequalities(matrix(&rows, 3), vec![3.0, -3.0])
            .unwrap();
        for x in [[-4096.0, -2048.0, -1024.0], [0.0; 3], [7.0, -1.0, 3.0]] {
            match set.project(&x) {
                Ok(Projection::Empty(certificate)) => assert_eq!(certificate.radius, INF),
                Ok(Projection::Nearest(nearest)) => {
                    let violation = set.violation(&nearest.x).unwrap();
                    assert!(k > 24 && violation < 1e-6, "{k}: {violation:e}, {nearest:?}");
                }
                Err(ComplementarityError::Unresolved { .. }) => assert!(k > 24, "{k}"),
                other => panic!("{k}: {other:?}"),
            }
        }
    }
}
