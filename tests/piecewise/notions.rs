//! Generalised derivatives, regularity and index at a point, against determinants by hand and against each other.

use proptest::prelude::*;
use semismooth::complementarity::{Lcp, Mcp, McpOptions, McpSolver, NormalMap, strong_regularity};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::piecewise::{
    Activity, BElement, CertificateDoubt, CoherentOrientation, Derivatives, MinMap, PiecewiseError,
    PiecewiseSmooth, Regularity, RegularityOptions, Selection, active_set, b_subdifferential, bd_regularity,
    cd_regularity, clarke_element, coherent_orientation, local_index, local_uniqueness, select,
};
use semismooth::sparse::Matrix;

use super::certificates::Sectors;
use super::dense::eliminate;
use super::maps::two_pieces;
use super::random::Random;

const CAP: u64 = 1000;

/// min(x, M x), row by row: piece 0 is xᵢ.
struct Min(Vec<Vec<f64>>);

impl Min {
    fn row(&self, piece: usize, i: usize, j: usize) -> f64 {
        if piece == 0 {
            f64::from(u8::from(i == j))
        } else {
            self.0[i][j]
        }
    }

    fn lcp(&self, q: &[f64]) -> Lcp {
        Lcp::new(Matrix::from_rows(&self.0).unwrap(), q.to_vec()).unwrap()
    }

    /// Sign of the determinant of a selection, by elimination.
    fn det(&self, s: &Selection) -> i32 {
        let n = self.0.len();
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| self.row(s.piece(i), i, j)).collect())
            .collect();
        let (sign, pivot, _) = eliminate(&rows, &vec![0.0; n]);
        // Integers: what is not 0 is not small.
        if pivot > 1e-9 { sign } else { 0 }
    }
}

impl PiecewiseSmooth for Min {
    two_pieces!(
        self,
        [negative, positive],
        self.0.len(),
        self.0.len(),
        self.0.len()
    );
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (i, row) in self.0.iter().enumerate() {
            out[i] = x[i] - row.iter().zip(x).map(|(m, x)| m * x).sum::<f64>();
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            out[i] = (0..x.len()).map(|j| self.row(s.piece(i), i, j) * x[j]).sum();
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let n = x.len();
        (0..n * n).for_each(|k| jac.add(k / n, k % n, self.row(s.piece(k / n), k / n, k % n)));
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl Derivatives for Min {
    fn test_gradient(&self, site: usize, _: usize, x: &[f64], gradient: &mut [f64]) {
        (0..x.len()).for_each(|j| gradient[j] = self.row(0, site, j) - self.0[site][j]);
    }
}

/// x + c (θ·x)₊: Clarke's generalised Jacobian is the segment between I and I + c θᵀ.
struct Kink {
    c: [f64; 2],
    theta: [f64; 2],
}

impl PiecewiseSmooth for Kink {
    two_pieces!(self, [negative, positive], 2, 2, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.theta[0] * x[0] + self.theta[1] * x[1];
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let theta = self.theta[0] * x[0] + self.theta[1] * x[1];
        (0..2).for_each(|i| out[i] = x[i] + s.piece(0) as f64 * self.c[i] * theta);
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let one = f64::from(u8::from(i == j));
            jac.add(i, j, one + s.piece(0) as f64 * self.c[i] * self.theta[j]);
        }
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

fn elements(map: &impl PiecewiseSmooth, x: &[f64]) -> Vec<BElement> {
    b_subdifferential(map, x, 1e-9)
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap()
}

/// A singular combination of matrices with entries up to `largest` maps a unit vector almost to zero, with the reported singular value.
fn check_witness(matrix: &Matrix, largest: f64, singular_value: Option<f64>, direction: &[f64]) {
    let mut image = vec![0.0; matrix.nrows()];
    matrix.mul_vec(direction, &mut image);
    let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    assert!((norm(direction) - 1.0).abs() < 1e-12);
    assert!((norm(&image) - singular_value.unwrap()).abs() < 1e-13 * largest);
    assert!(norm(&image) < 1e-10 * largest, "{image:?}");
}

/// The witness of strong regularity, a row-wise combination of active selections.
fn check_mixture(map: &impl PiecewiseSmooth, x: &[f64], found: &Regularity) {
    let Regularity::Fails {
        combination,
        singular_value,
        direction,
    } = found
    else {
        panic!("{found:?}");
    };
    let n = map.num_residuals();
    let (mut rows, mut largest) = (vec![vec![0.0; n]; n], 0.0_f64);
    for (selection, weight) in combination {
        assert!(*weight >= 0.0 && active_set(map, x, 1e-9).contains(selection));
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(selection, x, &mut jac);
        (0..n * n).for_each(|k| rows[k / n][k % n] += weight * jac.get(k / n, k % n));
        largest = jac.values().iter().fold(largest, |m, v| m.max(v.abs()));
    }
    assert!((combination.iter().map(|c| c.1).sum::<f64>() - 1.0).abs() < 1e-15);
    check_witness(
        &Matrix::from_rows(&rows).unwrap(),
        largest,
        *singular_value,
        direction,
    );
}

/// The witness is an element of Clarke's generalised Jacobian.
fn check_clarke(map: &impl PiecewiseSmooth, x: &[f64], found: &Regularity) {
    check_mixture(map, x, found);
    let Regularity::Fails { combination, .. } = found else {
        unreachable!();
    };
    clarke_element(map, x, combination, 1e-9).unwrap();
}

#[test]
fn b_subdifferentials_hold_the_gradients_nearby() {
    let map = Min(vec![
        vec![2.0, 1.0, 0.0],
        vec![-1.0, 3.0, 1.0],
        vec![0.5, 0.0, -1.0],
    ]);
    let found = elements(&map, &[0.0; 3]);
    assert_eq!(found.len(), 8);
    let mut seen = [false; 8];
    for k in 0..400 {
        let at = |j: usize| ((k * 7 + 1) as f64 * [0.61, 1.37, 2.23][j]).sin() * 1e-3;
        let x = [at(0), at(1), at(2)];
        // The gradient there, according to which function is smaller.
        let selection = select(&map, &x);
        let position = found.iter().position(|e| e.selection == selection).unwrap();
        seen[position] = true;
        for i in 0..3 {
            let other: f64 = (0..3).map(|j| map.0[i][j] * x[j]).sum();
            for j in 0..3 {
                let expected = map.row(usize::from(other < x[i]), i, j);
                assert_eq!(found[position].jacobian.get(i, j), expected);
            }
        }
        assert_eq!(found[position].activity, Activity::Essential);
    }
    assert_eq!(seen, [true; 8]);
    assert_eq!(elements(&map, &[1.0, -0.3, 0.7]).len(), 1);
    // Of 2⁶⁰ selections only a few are examined.
    let many = Min((0..60)
        .map(|i| (0..60).map(|j| if i == j { 2.0 } else { 0.0 }).collect())
        .collect());
    assert_eq!(
        b_subdifferential(&many, &[0.0; 60], 1e-9)
            .unwrap()
            .take(5)
            .count(),
        5
    );
}

/// M = I − (1, 1) ⊗ (2, −3): both rows change together, so that only two of four selections have points nearby.
fn together() -> Min {
    Min(vec![vec![-1.0, 3.0], vec![-2.0, 4.0]])
}

#[test]
fn selections_without_points_nearby_are_left_out() {
    let found = elements(&together(), &[0.0; 2]);
    let selections: Vec<Selection> = found.into_iter().map(|e| e.selection).collect();
    assert_eq!(selections, [Selection::uniform(2, 0), Selection::uniform(2, 1)]);
}

#[test]
fn clarke_elements_are_convex_combinations() {
    let map = together();
    let s = |piece: usize| Selection::uniform(2, piece);
    let quarter = clarke_element(&map, &[0.0; 2], &[(s(0), 0.75), (s(1), 0.25)], 1e-9).unwrap();
    assert_eq!(quarter.get(0, 0), 0.5);
    assert_eq!(quarter.get(1, 0), -0.5);
    let refused = |weights: &[(Selection, f64)]| {
        let found = clarke_element(&map, &[0.0; 2], weights, 1e-9);
        matches!(found, Err(PiecewiseError::Combination { .. }))
    };
    assert!(refused(&[(s(0), 0.75), (s(1), 0.35)]));
    assert!(refused(&[(s(0), 1.25), (s(1), -0.25)]));
    assert!(refused(&[(s(0), f64::NAN)]));
    assert!(refused(&[]));
    let mixed = Selection::from_pieces([0, 1]);
    assert!(refused(&[(mixed, 1.0)]));
    // Active at 0, but not elsewhere.
    assert!(clarke_element(&map, &[1.0, 0.0], &[(s(0), 1.0)], 1e-9).is_err());
}

/// A selection that is not essentially active may be singular; strong regularity, which concerns all perturbations, depends on it.
#[test]
fn strong_regularity_asks_for_more_than_clarke() {
    let map = together();
    assert!(bd_regularity(&map, &[0.0; 2], 1e-9, CAP).unwrap().is_regular());
    assert!(cd_regularity(&map, &[0.0; 2], 1e-9, CAP).unwrap().is_regular());
    let strong = strong_regularity(map.lcp(&[0.0; 2]).mcp(), &[0.0; 2], 1e-9, CAP).unwrap();
    assert!(strong.fails(), "{strong:?}");
}

#[test]
fn a_singular_selection_is_named() {
    // The principal minor of the second component is 0.
    let map = Min(vec![vec![1.0, 1.0], vec![-1.0, 0.0]]);
    let found = bd_regularity(&map, &[0.0; 2], 1e-9, CAP).unwrap();
    let Regularity::Fails { combination, .. } = &found else {
        panic!("{found:?}");
    };
    assert_eq!(*combination, [(Selection::from_pieces([0, 1]), 1.0)]);
    check_clarke(&map, &[0.0; 2], &found);
    assert_eq!(cd_regularity(&map, &[0.0; 2], 1e-9, CAP).unwrap(), found);
    // Next to the point the map is smooth and regular: the identity.
    let Regularity::Regular {
        selections,
        singular_value,
        weakest,
    } = bd_regularity(&map, &[-2.0, 1.0], 1e-9, CAP).unwrap()
    else {
        panic!();
    };
    assert_eq!(selections, 1);
    assert!((singular_value.unwrap() - 1.0).abs() < 1e-14);
    assert_eq!(weakest.unwrap().0, Selection::uniform(2, 0));
    // A list cut short before that selection decides nothing.
    let cut = bd_regularity(&map, &[0.0; 2], 1e-9, 1).unwrap();
    assert_eq!(
        cut,
        Regularity::Undecided {
            examined: 1,
            doubt: CertificateDoubt::Limit
        }
    );
}

/// det (I + t c θᵀ) = 1 + t θ·c, although a matrix with rows of both may have a determinant of the other sign.
#[test]
fn two_pieces_are_decided_by_eigenvalues() {
    let kink = |excess: f64| Kink {
        c: [10.0, excess - 11.0],
        theta: [1.0, 1.0],
    };
    let found = cd_regularity(&kink(0.5), &[0.0; 2], 1e-9, CAP).unwrap();
    let Regularity::Regular {
        selections: 2,
        singular_value,
        weakest,
    } = found
    else {
        panic!("{found:?}");
    };
    // σ₁σ₂ = det = ½, σ₁² + σ₂² = Σ of the squares.
    let squares: f64 = [11.0_f64, 10.0, -10.5, -9.5].map(|v| v * v).iter().sum();
    let expected = ((squares + 1.0).sqrt() - (squares - 1.0).sqrt()) / 2.0;
    assert!((singular_value.unwrap() - expected).abs() < 1e-13 * squares);
    let (selection, direction) = weakest.unwrap();
    let weakest = elements(&kink(0.5), &[0.0; 2])
        .into_iter()
        .find(|e| e.selection == selection);
    let mut image = [0.0; 2];
    weakest.unwrap().jacobian.mul_vec(&direction, &mut image);
    let length = |v: &[f64]| v[0].hypot(v[1]);
    assert!((length(&direction) - 1.0).abs() < 1e-14);
    assert!((length(&image) - expected).abs() < 1e-13 * squares);
    let map = kink(-0.5);
    let found = cd_regularity(&map, &[0.0; 2], 1e-9, CAP).unwrap();
    check_clarke(&map, &[0.0; 2], &found);
    let Regularity::Fails { combination, .. } = found else {
        unreachable!();
    };
    // 1 − 3/2 t = 0, up to a reciprocal condition of 1e-14 with a norm of 15.
    assert!((combination[1].1 - 2.0 / 3.0).abs() < 1e-11);
}

/// Maps that wind k times round 0 have the degree k, and more than once they are no homeomorphisms: Clarke's theorem says that
/// some convex combination is singular, although all signs agree.
#[test]
fn maps_that_wind_have_their_index() {
    let origin = [0.0; 2];
    for turns in [-3_i32, -2, -1, 1, 2, 3] {
        let map = Sectors::winding(f64::from(turns));
        assert_eq!(
            local_index(&map, &origin, 1e-9, CAP).unwrap(),
            Some(i64::from(turns))
        );
        let found = cd_regularity(&map, &origin, 1e-9, CAP).unwrap();
        match turns.abs() {
            1 => assert!(found.is_regular(), "{found:?}"),
            _ => check_clarke(&map, &origin, &found),
        }
        // Eight selections, whose rows combine in 64 ways: fewer prove nothing.
        let capped = cd_regularity(&map, &origin, 1e-9, 8).unwrap();
        assert!(turns.abs() == 1 || !capped.is_regular(), "{capped:?}");
        assert_eq!(local_index(&map, &origin, 1e-9, 7).unwrap(), None);
    }
    // Winding once with a step back: signs differ.
    let mut folded = Sectors::winding(1.0);
    folded.images[1] = [1.0, -0.3];
    assert!(matches!(
        coherent_orientation(&folded, &origin, 1e-9, CAP).unwrap(),
        CoherentOrientation::Incoherent { .. }
    ));
    assert_eq!(local_index(&folded, &origin, 1e-9, CAP).unwrap(), Some(1));
    let abs = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = -x[0];
    });
    assert_eq!(local_index(&abs, &[0.0], 1e-9, CAP).unwrap(), Some(0));
}

/// (x, y) for x > 0 and (x, −y) for x < 0: not continuous, so that the sums of signs over the preimages differ between values.
struct Torn;

impl PiecewiseSmooth for Torn {
    two_pieces!(self, [negative, positive], 2, 2, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0];
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let sign = if s.piece(0) == 1 { 1.0 } else { -1.0 };
        out.copy_from_slice(&[x[0], sign * x[1]]);
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, 1.0);
        jac.add(1, 1, if s.piece(0) == 1 { 1.0 } else { -1.0 });
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

#[test]
fn maps_that_jump_have_no_index() {
    assert_eq!(local_index(&Torn, &[0.0; 2], 1e-9, CAP).unwrap(), None);
    assert_eq!(local_index(&Torn, &[1.0, 0.0], 1e-9, CAP).unwrap(), Some(1));
    assert_eq!(local_index(&Torn, &[-1.0, 0.0], 1e-9, CAP).unwrap(), Some(-1));
}

/// Rotated back and forth by up to 60°: rows, or columns, of two of the matrices can combine to a negative determinant, but all have
/// definite symmetric parts, and so have their convex combinations.
#[test]
fn definite_symmetric_parts_are_seen() {
    let mut map = Sectors::winding(1.0);
    for (k, turn) in [0.0, 30.0, 60.0, 30.0, 0.0, -30.0, -60.0, -30.0_f64]
        .into_iter()
        .enumerate()
    {
        let (sin, cos) = (45.0 * k as f64 + turn).to_radians().sin_cos();
        map.images[k] = [cos, sin];
    }
    let found = elements(&map, &[0.0; 2]);
    let at = |k: usize, i: usize, j: usize| found[k].jacobian.get(i, j);
    let pairs = || (0..8).flat_map(|k| (0..8).map(move |l| (k, l)));
    assert!(pairs().any(|(k, l)| at(k, 0, 0) * at(l, 1, 1) < at(k, 0, 1) * at(l, 1, 0)));
    assert!(pairs().any(|(k, l)| at(k, 0, 0) * at(l, 1, 1) < at(l, 0, 1) * at(k, 1, 0)));
    assert!((0..8).all(|k| 4.0 * at(k, 0, 0) * at(k, 1, 1) > (at(k, 0, 1) + at(k, 1, 0)).powi(2)));
    let verdict = cd_regularity(&map, &[0.0; 2], 1e-9, CAP).unwrap();
    assert!(verdict.is_regular(), "{verdict:?}");
}

/// A singular selection does no harm where its kernel lies in another cell, and hides the index where it does not.
#[test]
fn kernels_outside_their_cells_are_no_zeros() {
    let isolated = Min(vec![vec![0.0, -1.0], vec![-1.0, 1.0]]);
    assert!(bd_regularity(&isolated, &[0.0; 2], 1e-9, CAP).unwrap().fails());
    let index = local_index(&isolated, &[0.0; 2], 1e-9, CAP).unwrap();
    for q in [[1.0, 0.3], [-0.4, 1.0], [0.7, -1.3], [-1.0, -0.8]] {
        let all = all_solutions(isolated.lcp(&q).mcp(), 0.0, &EnumerationOptions::default()).unwrap();
        assert_eq!(
            (all.completeness.is_complete(), all.index_sum),
            (true, index),
            "{q:?}"
        );
    }
    // (0, t), t ≥ 0, solves the problem.
    let ray = Min(vec![vec![0.0, 1.0], vec![-1.0, 0.0]]);
    assert_eq!(local_index(&ray, &[0.0; 2], 1e-9, CAP).unwrap(), None);
}

/// min(x₁, x₂, …) of components between, at and beside their bounds: boxed, with a parameter.
#[test]
fn strong_regularity_of_boxed_problems_with_a_parameter() {
    use semismooth::complementarity::WithJacobian;
    // F = M (x − x*) + s + (α − 2) e, with x* and slopes s that make components 0, 1 degenerate (lower and upper bound), 2 interior,
    // 3 at its upper bound with F < 0.
    let solution = [0.0, 1.0, 0.5, 1.0];
    let problem = |m: [[f64; 4]; 4]| {
        let f = WithJacobian::parametric(
            4,
            move |x: &[f64], out: &mut [f64]| {
                for i in 0..4 {
                    let sum: f64 = (0..4).map(|j| m[i][j] * (x[j] - solution[j])).sum();
                    out[i] = sum + [0.0, 0.0, 0.0, -3.0][i] + (x[4] - 2.0);
                }
            },
            move |_: &[f64], jac: &mut Matrix| {
                for i in 0..4 {
                    (0..4).for_each(|j| jac.add(i, j, m[i][j]));
                    jac.add(i, 4, 1.0);
                }
            },
        );
        Mcp::new(f, vec![0.0; 4], vec![1.0; 4]).unwrap()
    };
    let x = [solution.as_slice(), &[2.0]].concat();
    // Schur complement on β = {0, 1} with α = {2}: M_ββ − M_β2 M_2β / M_22.
    let with = |corner: [[f64; 2]; 2]| {
        let (column, row, pivot) = ([3.0, -1.0], [2.0, 1.0], 0.5);
        let mut m = [[9.0; 4]; 4];
        for i in 0..2 {
            for j in 0..2 {
                m[i][j] = corner[i][j] + column[i] * row[j] / pivot;
            }
            m[i][2] = column[i];
            m[2][i] = row[i];
        }
        m[2][2] = pivot;
        problem(m)
    };
    let found = strong_regularity(&with([[1.0, 4.0], [-1.0, 2.0]]), &x, 1e-9, CAP).unwrap();
    assert_eq!(
        found,
        Regularity::Regular {
            selections: 4,
            singular_value: None,
            weakest: None
        }
    );
    for corner in [
        [[1.0, 4.0], [1.0, 2.0]],
        [[-1.0, 0.0], [0.0, 2.0]],
        [[1.0, 2.0], [2.0, 4.0]],
    ] {
        let problem = with(corner);
        let found = strong_regularity(&problem, &x, 1e-9, CAP).unwrap();
        check_mixture(&problem, &x, &found);
    }
}

/// The determinant of an integer matrix, exactly.
fn integer_det(m: &[Vec<i64>]) -> i64 {
    let minor = |j: usize| -> Vec<Vec<i64>> {
        let without = |row: &Vec<i64>| [&row[..j], &row[j + 1..]].concat();
        m[1..].iter().map(without).collect()
    };
    let sign = |j: usize| if j.is_multiple_of(2) { 1 } else { -1 };
    match m {
        [] => 1,
        _ => (0..m.len())
            .map(|j| sign(j) * m[0][j] * integer_det(&minor(j)))
            .sum(),
    }
}

/// At the origin every active set of the normal map of LCP(0, M) has points nearby: all principal minors count, in exact arithmetic.
#[test]
fn verdicts_on_integer_matrices_are_those_of_their_minors() {
    let mut random = Random::new(5);
    let mut met = [0; 3];
    for _ in 0..2000 {
        let (n, bound) = (1 + random.below(4), [1, 2, 9][random.below(3)]);
        let mut m: Vec<Vec<i64>> = (0..n)
            .map(|_| {
                (0..n)
                    .map(|_| random.below(2 * bound + 1) as i64 - bound as i64)
                    .collect()
            })
            .collect();
        match random.below(3) {
            // Singular, or nearly so.
            0 => m[n - 1] = m[0].iter().map(|v| 2 * v).collect(),
            1 => (0..n).for_each(|i| m[i][i] = m[i].iter().map(|v| v.abs()).sum::<i64>().max(1)),
            _ => {}
        }
        let minors = (1..1_usize << n).map(|set| {
            let of = |v: &[i64]| {
                (0..n)
                    .filter(|i| set >> i & 1 == 1)
                    .map(|i| v[i])
                    .collect::<Vec<_>>()
            };
            let rows: Vec<_> = (0..n).filter(|i| set >> i & 1 == 1).map(|i| of(&m[i])).collect();
            integer_det(&rows)
        });
        let (positive, regular) = minors.fold((true, true), |(p, r), d| (p && d > 0, r && d != 0));
        let rows: Vec<Vec<f64>> = m
            .iter()
            .map(|row| row.iter().map(|v| *v as f64).collect())
            .collect();
        let lcp = Lcp::new(Matrix::from_rows(&rows).unwrap(), vec![0.0; n]).unwrap();
        let (map, origin) = (NormalMap::new(lcp.mcp()), vec![0.0; n]);
        let found = coherent_orientation(&map, &origin, 1e-12, CAP).unwrap();
        let (yes, no) = (
            matches!(found, CoherentOrientation::Coherent { .. }),
            matches!(found, CoherentOrientation::Incoherent { .. }),
        );
        assert_eq!((yes, no), (positive, !positive), "{m:?}");
        let found = bd_regularity(&map, &origin, 1e-12, CAP).unwrap();
        assert_eq!((found.is_regular(), found.fails()), (regular, !regular), "{m:?}");
        let found = strong_regularity(lcp.mcp(), &origin, 1e-12, CAP).unwrap();
        assert_eq!(
            (found.is_regular(), found.fails()),
            (positive, !positive),
            "{m:?}"
        );
        met[usize::from(positive) + usize::from(regular)] += 1;
    }
    assert!(met.iter().all(|count| *count > 200), "{met:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// min(x, M x) at 0: BD-regular exactly if no principal minor vanishes, CD-regular, strongly regular and coherently oriented exactly
    /// if all are positive; the normal map, which changes columns, says the same.
    #[test]
    fn p_matrices_are_recognised_in_all_ways(entries in proptest::collection::vec(-3..=3_i32, 9), shift in 0..=4_i32) {
        let m: Vec<Vec<f64>> = (0..3)
            .map(|i| (0..3).map(|j| f64::from(entries[3 * i + j] + if i == j { shift } else { 0 })).collect())
            .collect();
        let map = Min(m);
        // Rows e_i − M_i that depend on each other leave selections out.
        let difference: Vec<Vec<f64>> =
            (0..3).map(|i| (0..3).map(|j| map.row(0, i, j) - map.0[i][j]).collect()).collect();
        prop_assume!(eliminate(&difference, &[0.0; 3]).1 > 1e-9);
        let signs: Vec<i32> = semismooth::piecewise::Selections::all(&map).map(|s| map.det(&s)).collect();
        let (origin, no_kernel) = ([0.0; 3], signs.iter().all(|s| *s != 0));
        let p = signs.iter().all(|s| *s == 1);
        let bd = bd_regularity(&map, &origin, 1e-9, CAP).unwrap();
        prop_assert_eq!(bd.is_regular(), no_kernel);
        let cd = cd_regularity(&map, &origin, 1e-9, CAP).unwrap();
        prop_assert_eq!((cd.is_regular(), cd.fails()), (p, !p));
        if !p {
            check_clarke(&map, &origin, &cd);
        }
        let lcp = map.lcp(&origin);
        let strong = strong_regularity(lcp.mcp(), &origin, 1e-9, CAP).unwrap();
        prop_assert_eq!((strong.is_regular(), strong.fails()), (p, !p));
        if !p {
            check_mixture(lcp.mcp(), &origin, &strong);
        }
        // The same at upper bounds.
        let (lower, upper) = (vec![-1.0; 3], vec![0.0; 3]);
        let mirrored = Lcp::boxed(lcp.matrix().clone(), vec![0.0; 3], lower, upper).unwrap();
        let strong = strong_regularity(mirrored.mcp(), &origin, 1e-9, CAP).unwrap();
        prop_assert_eq!((strong.is_regular(), strong.fails()), (p, !p));
        let normal = cd_regularity(&NormalMap::new(lcp.mcp()), &origin, 1e-9, CAP).unwrap();
        prop_assert_eq!((normal.is_regular(), normal.fails()), (p, !p));
        let orientation = coherent_orientation(&map, &origin, 1e-9, CAP).unwrap();
        prop_assert_eq!(matches!(orientation, CoherentOrientation::Coherent { .. }), p);
    }

    /// The index of the solution 0 of LCP(0, M) is the sum over the solutions of LCP(q, M) for any q.
    #[test]
    fn indices_are_sums_over_perturbed_problems(
        entries in proptest::collection::vec(-3..=3_i32, 9),
        q in proptest::collection::vec(-1.0..1.0_f64, 3),
    ) {
        let m = (0..3).map(|i| (0..3).map(|j| f64::from(entries[3 * i + j])).collect()).collect();
        let map = Min(m);
        let index = local_index(&map, &[0.0; 3], 1e-9, CAP).unwrap();
        let all = all_solutions(map.lcp(&q).mcp(), 0.0, &EnumerationOptions::default()).unwrap();
        if semismooth::piecewise::Selections::all(&map).all(|s| map.det(&s) != 0) {
            prop_assert!(index.is_some());
        }
        if let (Some(index), Some(sum)) = (index, all.index_sum) {
            prop_assert_eq!(index, sum);
        }
    }
}

/// Solvers with the option set report what the functions find at the point returned, and nothing if the option is not set or the problem is
/// not solved.
#[test]
fn reports_contain_the_regularity_of_the_solution() {
    let wanted = RegularityOptions::default();
    let options = NewtonOptions::default().with_regularity(Some(wanted));
    // min(x, M x): 0 is the only solution, or one of many; det M = 11, 0 and −3.
    for m in [
        [[2.0, 1.0], [1.0, 6.0]],
        [[1.0, 1.0], [1.0, 1.0]],
        [[1.0, 2.0], [2.0, 1.0]],
    ] {
        let map = Min(m.iter().map(|row| row.to_vec()).collect());
        let (mut newton, mut x) = (Newton::new(options.clone()), vec![0.0; 2]);
        newton.solve(&map, &mut x).unwrap();
        let found = newton.report().regularity.clone().unwrap();
        let args = (wanted.tolerance, wanted.cap);
        assert_eq!(found.bd, bd_regularity(&map, &x, args.0, args.1).unwrap());
        assert_eq!(found.cd, cd_regularity(&map, &x, args.0, args.1).unwrap());
        let orientation = coherent_orientation(&map, &x, args.0, args.1).unwrap();
        assert_eq!(
            (found.orientation.as_ref(), &found.strong),
            (Some(&orientation), &None)
        );
        assert!(newton.report().to_string().ends_with(&found.to_string()));

        let lcp = map.lcp(&[0.0; 2]);
        let mut solver = McpSolver::new(McpOptions::default().with_regularity(Some(wanted)));
        let mut x = vec![0.0; 2];
        let report = solver.solve(lcp.mcp(), &mut x).unwrap();
        let found = report.regularity.clone().unwrap();
        assert_eq!(found.bd, bd_regularity(lcp.mcp(), &x, args.0, args.1).unwrap());
        let strong = strong_regularity(lcp.mcp(), &x, args.0, args.1).unwrap();
        assert_eq!(
            (strong.is_regular(), found.strong),
            (m[1][1] == 6.0, Some(strong))
        );
        assert!(report.to_string().contains("strongly regular: "), "{report}");
        // The next solve resets it.
        let plain = McpSolver::default()
            .solve(lcp.mcp(), &mut x)
            .unwrap()
            .regularity
            .clone();
        assert_eq!(plain, None);
    }
    // x² + 1 = 0 has no solution, x ≥ 0, −1 − x ≥ 0 neither.
    let none = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] * x[0] + 1.0;
        b[0] = a[0] + 1.0;
    });
    let mut newton = Newton::new(options);
    newton.solve(&none, &mut [0.5]).unwrap_err();
    assert_eq!(newton.report().regularity, None);
    let lcp = Min(vec![vec![-1.0]]).lcp(&[-1.0]);
    let mut solver = McpSolver::new(McpOptions::default().with_regularity(Some(wanted)));
    let report = solver.solve(lcp.mcp(), &mut [0.5]).unwrap();
    assert!(!report.is_solved() && report.regularity.is_none());
}

#[test]
fn verdicts_on_solutions_are_printed_in_words() {
    let told = |m: [[f64; 2]; 2]| {
        let map = Min(m.iter().map(|row| row.to_vec()).collect());
        let wanted = RegularityOptions::default();
        let mut solver = McpSolver::new(McpOptions::default().with_regularity(Some(wanted)));
        let report = solver.solve(map.lcp(&[0.0; 2]).mcp(), &mut [0.0; 2]).unwrap();
        report.regularity.as_ref().unwrap().to_string()
    };
    assert_eq!(
        told([[2.0, 1.0], [1.0, 6.0]]),
        "BD-regular: yes (4 selections); CD-regular: yes (4 selections); coherently oriented: yes, sign +1; \
         strongly regular: yes (4 selections)"
    );
    assert_eq!(
        told([[1.0, 2.0], [2.0, 1.0]]),
        "BD-regular: yes (4 selections); CD-regular: no, a convex combination of selections is singular; \
         coherently oriented: no, determinants differ in sign; \
         strongly regular: no, a convex combination of selections is singular"
    );
    assert!(told([[1.0, 1.0], [1.0, 1.0]]).starts_with(
        "BD-regular: no, a selection is singular; CD-regular: no, a selection is singular; \
         coherently oriented: no, a selection is singular;"
    ));
}

/// min(x, M x) with M = k (−1, 1; 1, −1): all x with x₁ = x₂ ≥ 0 are zeros, and determinants have both signs, whatever the unit k of M is.
/// The cells of two selections are as narrow as 1/k: where that is near rounding nothing is claimed.
#[test]
fn narrow_cells_are_not_overlooked() {
    for k in [1.0, 1e6, 1e9, 1e11, 1e12, 1e13, 1e14] {
        let map = Min(vec![vec![-k, k], vec![k, -k]]);
        let x = [0.0; 2];
        let active = active_set(&map, &x, 0.0);
        let found = local_uniqueness(&map, &x, &active, &Matrix::identity(2), CAP).unwrap();
        assert!(!found.is_certified(), "{k:e}: {found}");
        let orientation = coherent_orientation(&map, &x, 0.0, CAP).unwrap();
        assert!(
            !matches!(orientation, CoherentOrientation::Coherent { .. }),
            "{k:e}: {orientation}"
        );
        for verdict in [
            bd_regularity(&map, &x, 0.0, CAP),
            cd_regularity(&map, &x, 0.0, CAP),
        ] {
            let verdict = verdict.unwrap();
            assert!(!verdict.is_regular(), "{k:e}: {verdict}");
        }
        // All four selections are listed.
        assert_eq!(elements(&map, &x).len(), 4, "{k:e}");
    }
}
