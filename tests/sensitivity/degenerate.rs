//! Mixed complementarity problems, variational inequalities and lists at degenerate points, against the enumeration of all their pieces.

use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::sensitivity::{Differentiability, Directional, Sensitivity, SensitivityError};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

use super::random::Random;

/// Where a component is: at its lower bound, between, at its upper one; F positive, zero, negative there.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Place {
    Lower,
    LowerZero,
    Between,
    UpperZero,
    Upper,
    Fixed,
}

impl Place {
    fn random(random: &mut Random) -> Self {
        [
            Self::Lower,
            Self::LowerZero,
            Self::LowerZero,
            Self::Between,
            Self::UpperZero,
            Self::Upper,
            Self::Fixed,
        ][random.below(7)]
    }

    fn is_degenerate(self) -> bool {
        matches!(self, Self::LowerZero | Self::UpperZero)
    }
}

/// All directions v in which solutions of M v + δ = w leave along δ, by all choices of v = 0 or w = 0 at the degenerate components;
/// nothing where a choice is singular. Numbers are small integers, so that determinants of less than ½ are zero.
fn branches(m: &[Vec<f64>], places: &[Place], delta: &[f64]) -> Option<Vec<Vec<f64>>> {
    let n = places.len();
    let degenerate: Vec<usize> = (0..n).filter(|&i| places[i].is_degenerate()).collect();
    let mut list: Vec<Vec<f64>> = Vec::new();
    for choice in 0..1_u32 << degenerate.len() {
        let moves = |i: usize| match degenerate.iter().position(|d| *d == i) {
            Some(k) => choice >> k & 1 == 1,
            None => places[i] == Place::Between,
        };
        let free: Vec<usize> = (0..n).filter(|&i| moves(i)).collect();
        let rows: Vec<Vec<f64>> = free
            .iter()
            .map(|&i| free.iter().map(|&j| m[i][j]).collect())
            .collect();
        let right: Vec<f64> = free.iter().map(|&i| -delta[i]).collect();
        let part = solved(rows, right)?;
        let mut v = vec![0.0; n];
        free.iter().zip(part).for_each(|(&i, x)| v[i] = x);
        let w: Vec<f64> = (0..n)
            .map(|i| delta[i] + m[i].iter().zip(&v).map(|(a, b)| a * b).sum::<f64>())
            .collect();
        let sign = |i: usize| if places[i] == Place::LowerZero { 1.0 } else { -1.0 };
        let holds = degenerate.iter().all(|&i| {
            sign(i) * v[i] >= -1e-9 && (v[i].abs() < 1e-9 || w[i].abs() < 1e-9) && sign(i) * w[i] >= -1e-9
        });
        let is_known = |known: &Vec<f64>| known.iter().zip(&v).all(|(a, b)| (a - b).abs() < 1e-9);
        if holds && !list.iter().any(is_known) {
            list.push(v);
        }
    }
    Some(list)
}

/// By elimination with pivots; nothing where the matrix is singular.
pub fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    let mut determinant = 1.0;
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        determinant *= a[pivot][k];
        if determinant.abs() < 1e-9 {
            return None;
        }
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    Some(b)
}

/// On random degenerate problems with bounds: where a solution is called differentiable, all one-sided derivatives along ± directions
/// agree and are those of one linear function; where it is called not differentiable, two of them differ along the direction named; one
/// directional derivative is given only where there is one branch, and it is that one.
#[test]
fn what_is_said_of_degenerate_mixed_problems_holds() {
    let random = &mut Random::new(11);
    let mut counts = [0; 3];
    for _ in 0..600 {
        let n = 1 + random.below(4);
        let m: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                (0..n)
                    .map(|j| random.below(7) as f64 - 3.0 + if i == j { 3.0 } else { 0.0 })
                    .collect()
            })
            .collect();
        let places: Vec<Place> = (0..n).map(|_| Place::random(random)).collect();
        let (mut x, mut w, mut upper) = (vec![0.0; n], vec![0.0; n], vec![2.0; n]);
        for i in 0..n {
            (x[i], w[i]) = match places[i] {
                Place::Lower => (0.0, 1.0),
                Place::LowerZero => (0.0, 0.0),
                Place::Between => (1.0, 0.0),
                Place::UpperZero => (2.0, 0.0),
                Place::Upper => (2.0, -1.0),
                Place::Fixed => (0.0, random.below(3) as f64 - 1.0),
            };
            if places[i] == Place::Fixed {
                upper[i] = 0.0;
            }
        }
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                m[i].iter()
                    .copied()
                    .chain((0..n).map(|j| if i == j { 1.0 } else { 0.0 }))
                    .collect()
            })
            .collect();
        let q: Vec<f64> = (0..n)
            .map(|i| w[i] - (0..n).map(|j| m[i][j] * x[j]).sum::<f64>())
            .collect();
        let function = AffineFunction::with_parameters(Matrix::from_rows(&rows).unwrap(), q).unwrap();
        let problem = Mcp::with_parameters(function, vec![0.0; n], upper).unwrap();
        let mut found = match Sensitivity::new(&problem, &x, &vec![0.0; n]) {
            Ok(found) => found,
            // A parameter of a fixed component does not enter; a singular piece away from kinks.
            Err(SensitivityError::NotEntering { parameter }) if places[parameter] == Place::Fixed => continue,
            Err(SensitivityError::Irregular { .. }) => continue,
            Err(e) => panic!("{e}"),
        };
        let verdict = found.differentiable().unwrap();
        let directions: Vec<Vec<f64>> = (0..8)
            .map(|_| (0..n).map(|_| random.below(5) as f64 - 2.0).collect())
            .collect();
        for delta in &directions {
            let listed = branches(&m, &places, delta);
            if let Directional::Derivative(v) = found.directional(delta).unwrap() {
                let list = listed.expect("a derivative where a piece is singular");
                assert_eq!(list.len(), 1, "{m:?} {places:?} {delta:?}");
                assert!(v.iter().zip(&list[0]).all(|(a, b)| (a - b).abs() < 1e-9));
            }
        }
        let one = |delta: &[f64]| {
            let list = branches(&m, &places, delta).expect("a verdict where a piece is singular");
            assert_eq!(list.len(), 1, "{m:?} {places:?} {delta:?}");
            list[0].clone()
        };
        match verdict {
            Differentiability::Yes { .. } => {
                counts[0] += 1;
                let matrix = found.derivative().unwrap();
                for delta in &directions {
                    for sign in [1.0, -1.0] {
                        let delta: Vec<f64> = delta.iter().map(|d| sign * d).collect();
                        let v = one(&delta);
                        let linear = |i: usize| (0..n).map(|j| matrix.get(i, j) * delta[j]).sum::<f64>();
                        assert!(
                            (0..n).all(|i| (linear(i) - v[i]).abs() < 1e-9),
                            "{m:?} {places:?}"
                        );
                    }
                }
            }
            Differentiability::No { direction, .. } => {
                counts[1] += 1;
                let opposite: Vec<f64> = direction.iter().map(|d| -d).collect();
                let (ahead, behind) = (one(&direction), one(&opposite));
                assert!(
                    (0..n).any(|i| (ahead[i] + behind[i]).abs() > 1e-9),
                    "{m:?} {places:?}"
                );
            }
            _ => counts[2] += 1,
        }
    }
    assert!(counts.iter().all(|c| *c > 30), "{counts:?}");
}

/// The nearest point of a triangle is differentiable in the point itself inside, along an edge, and beyond a corner; on the line that a
/// corner's normals bound it has two sides. Multipliers are differentiated with it.
#[test]
fn projections_onto_a_polygon() {
    // x ≥ 0, x₁ + x₂ ≤ 1, as rows.
    let triangle = || {
        let a = Matrix::from_rows(&[[-1.0, 0.0], [0.0, -1.0], [1.0, 1.0]]).unwrap();
        Polyhedron::space(2)
            .unwrap()
            .with_inequalities(a, vec![0.0, 0.0, 1.0])
            .unwrap()
    };
    let rows = Matrix::from_rows(&[[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]]).unwrap();
    let function = AffineFunction::with_parameters(rows, vec![0.0; 2]).unwrap();
    let vi = Vi::with_parameters(function, triangle()).unwrap();
    let cases = [
        ([0.25, 0.25], Some(true), [[1.0, 0.0], [0.0, 1.0]]),
        ([0.25, -0.5], Some(true), [[1.0, 0.0], [0.0, 0.0]]),
        ([1.0, 1.0], Some(true), [[0.5, -0.5], [-0.5, 0.5]]),
        ([-1.0, -2.0], Some(true), [[0.0, 0.0], [0.0, 0.0]]),
        ([0.0, 0.25], Some(false), [[0.0; 2]; 2]),
        ([0.0, -1.0], Some(false), [[0.0; 2]; 2]),
    ];
    for (theta, known, expected) in cases {
        let identity = AffineFunction::new(Matrix::identity(2), theta.map(|t| -t).to_vec()).unwrap();
        let own = Vi::new(identity, triangle()).unwrap();
        let mut x = vec![0.0; 2];
        let report = ViSolver::default().solve(&own, &mut x).unwrap();
        let y: Vec<f64> = x
            .iter()
            .chain(&report.multipliers.inequalities)
            .copied()
            .collect();
        let mut found = Sensitivity::new(vi.kkt().unwrap(), &y, &theta).unwrap();
        assert_eq!(found.differentiable().unwrap().known(), known, "{theta:?}");
        if known == Some(true) {
            let derivative = found.derivative().unwrap();
            for i in 0..2 {
                assert!(
                    (0..2).all(|j| (derivative.get(i, j) - expected[i][j]).abs() < 1e-9),
                    "{theta:?}"
                );
            }
        }
    }
    // Where it enters the triangle through an edge, and where it passes from the edge to the corner.
    let mut edge = Sensitivity::new(vi.kkt().unwrap(), &[0.0, 0.25, 0.0, 0.0, 0.0], &[0.0, 0.25]).unwrap();
    let rate = |found: &mut Sensitivity<_>, d: [f64; 2]| found.jvp(&d).unwrap()[..2].to_vec();
    assert!(
        rate(&mut edge, [1.0, 1.0])
            .iter()
            .all(|v| (v - 1.0).abs() < 1e-12)
    );
    let outwards = rate(&mut edge, [-1.0, 1.0]);
    assert!(outwards[0].abs() < 1e-12 && (outwards[1] - 1.0).abs() < 1e-12);
}

/// The solutions listed of a problem with several are differentiated one by one: |x| = θ has x = ± θ, and the kink at 0 has none.
#[test]
fn each_listed_solution_has_its_own_derivative() {
    let map = semismooth::parametric(2, 1, |x, p| {
        vec![x[0].abs() - p[0], x[1] + x[0].max(0.0) - 2.0 * p[0]]
    });
    let set = all_solutions(&map, 0.75, &EnumerationOptions::default()).unwrap();
    assert!(set.completeness.is_complete() && set.solutions.len() == 2);
    for solution in &set.solutions {
        let mut found = Sensitivity::new(&map, &solution.x[..2], &[0.75]).unwrap();
        let sign = solution.x[0].signum();
        let rate = found.jvp(&[1.0]).unwrap();
        let expected = [sign, if sign > 0.0 { 1.0 } else { 2.0 }];
        assert!(rate.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
    }
    // At 0 both meet, and neither goes on to θ < 0.
    let mut kink = Sensitivity::new(&map, &[0.0, 0.0], &[0.0]).unwrap();
    assert_eq!(kink.differentiable().unwrap().known(), None);
    assert!(matches!(
        kink.jvp(&[1.0]),
        Err(SensitivityError::NotUnique { .. })
    ));
}
