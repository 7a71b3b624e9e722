//! Rays, segments and lines of solutions, and selections of degenerate ones: the same whether or not coefficients are stated.

use semismooth::complementarity::Lcp;
use semismooth::enumeration::{
    Completeness, Continuum, Doubt, EnumerationOptions, SolutionSet, all_solutions,
};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

use super::list;
use crate::maps::{hand_on, same_cells};

/// A map that does not state its coefficients.
struct Unstated<'a>(&'a dyn PiecewiseSmooth);

impl PiecewiseSmooth for Unstated<'_> {
    same_cells!(0);
    hand_on! {
        0:
        fn test_functions(&self, x: &[f64], out: &mut [f64]);
        fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]);
        fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix);
    }
}

const INFINITE: f64 = f64::INFINITY;

fn boxed(rows: &[Vec<f64>], q: &[f64], lower: &[f64], upper: &[f64]) -> Lcp {
    let matrix = Matrix::from_rows(rows).unwrap();
    Lcp::boxed(matrix, q.to_vec(), lower.to_vec(), upper.to_vec()).unwrap()
}

/// The proven list and the unproven one.
fn both(lcp: &Lcp) -> [SolutionSet; 2] {
    let [stated, not] = [list(lcp.mcp(), 0.0), list(&Unstated(lcp.mcp()), 0.0)];
    assert_eq!(stated.completeness, Completeness::Complete);
    let doubt = Doubt::NoCoefficients;
    assert_eq!(not.completeness, Completeness::Undecided { selections: 0, doubt });
    [stated, not]
}

fn near(a: &[f64], b: &[f64]) -> bool {
    a.iter()
        .zip(b)
        .all(|(a, b)| (a - b).abs() <= 1e-14 * (1.0 + b.abs()))
}

fn is_at(continuum: &Continuum, ends: &[&[f64]]) -> bool {
    continuum.ends.len() == ends.len()
        && ends
            .iter()
            .all(|end| continuum.ends.iter().any(|own| near(own, end)))
}

/// a ≤ z₁ ⟂ s (z₂ − b) ≥ 0 and b ≤ z₂ ⟂ s (z₁ − a) ≥ 0: two rays from (a, b), at a right angle.
#[test]
fn rays_from_one_point_are_distinguished() {
    for (a, b, s) in [(0.0, 0.0, 1.0), (3.0, -2.0, 1.0 / 1024.0), (-100.0, 10.0, 1024.0)] {
        let rows = [vec![0.0, s], vec![s, 0.0]];
        let lcp = boxed(&rows, &[-s * b, -s * a], &[a, b], &[INFINITE; 2]);
        for found in both(&lcp) {
            assert_eq!(found.continua.len(), 2, "{found:?}");
            for ray in &found.continua {
                assert!(is_at(ray, &[&[a, b]]) && ray.selections.len() == 1);
            }
            assert_ne!(found.continua[0].selections, found.continua[1].selections);
        }
    }
}

/// z₁ = c and every z₂ between its bounds: a segment, rays or a line, which both selections of z₁ contain.
#[test]
fn what_two_selections_share_is_listed_once() {
    for c in [0.0, 0.3, -7e3] {
        for (lower, upper) in [
            (-1.0, 2.0),
            (-1.0, INFINITE),
            (-INFINITE, 2.0),
            (-INFINITE, INFINITE),
        ] {
            let rows = [vec![2.0, 0.0], vec![0.0, 0.0]];
            let lcp = boxed(&rows, &[-2.0 * c, 0.0], &[c, lower], &[INFINITE, upper]);
            let ends: Vec<[f64; 2]> = [lower, upper]
                .into_iter()
                .filter(|v| v.is_finite())
                .map(|v| [c, v])
                .collect();
            let ends: Vec<&[f64]> = ends.iter().map(|e| e.as_slice()).collect();
            for found in both(&lcp) {
                let [continuum] = found.continua.as_slice() else {
                    panic!("{c} {lower} {upper}: {found:?}");
                };
                assert!(is_at(continuum, &ends), "{continuum:?}");
                assert_eq!((continuum.dimension, continuum.selections.len()), (1, 2));
            }
        }
    }
}

/// 0 ≤ z ⟂ M z ≥ 0 for a nondegenerate M: z = 0 is isolated, and all selections give it. Their determinants are the principal minors.
#[test]
fn selections_come_in_order_with_the_signs_of_their_minors() {
    let matrices = [
        [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[1.0, 0.0, 3.0], [0.0, 2.0, 3.0], [3.0, 3.0, 1.0]],
        [[4.0, 1.0, 2.0], [1.0, 3.0, 5.0], [2.0, 5.0, 2.0]],
        [[2.0, -3.0, 1.0], [-4.0, 1.0, 2.0], [3.0, 1.0, 5.0]],
    ];
    for m in matrices {
        let rows = m.map(|row| row.to_vec());
        let lcp = boxed(&rows, &[0.0; 3], &[0.0; 3], &[INFINITE; 3]);
        let minor = |free: &Selection| {
            let entry = |i: usize, j: usize| match free.piece(i) {
                1 => m[i][j],
                _ => f64::from(u8::from(i == j)),
            };
            let two = |i: usize, j: usize, k: usize, l: usize| {
                entry(i, k) * entry(j, l) - entry(i, l) * entry(j, k)
            };
            entry(0, 0) * two(1, 2, 1, 2) - entry(0, 1) * two(1, 2, 0, 2) + entry(0, 2) * two(1, 2, 0, 1)
        };
        for found in both(&lcp) {
            let zero = found.solutions.iter().find(|s| s.x == [0.0; 3]);
            let zero = zero.unwrap_or_else(|| panic!("{found:?}"));
            assert_eq!(zero.selections.len(), 8, "{found:?}");
            assert!(zero.selections.is_sorted(), "{:?}", zero.selections);
            for (selection, sign) in zero.selections.iter().zip(&zero.det_signs) {
                assert_eq!(sign.map(f64::from), Some(minor(selection).signum()));
            }
        }
    }
}

/// The same for a triangular matrix, so that minors are products of its diagonal entries. Of more than 256 selections some are listed.
#[test]
fn selections_of_triangular_problems_come_in_order() {
    const DIAGONAL: [f64; 9] = [1.0, -2.0, 3.0, -1.0, 0.5, -4.0, 2.0, -1.0, 1.5];
    for n in [6, 9] {
        let entry = |i: usize, j: usize| match i.cmp(&j) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => DIAGONAL[i],
            std::cmp::Ordering::Greater => 0.25 * ((i * 3 + j * 5) % 7) as f64 - 0.5,
        };
        let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        let lcp = boxed(&rows, &vec![0.0; n], &vec![0.0; n], &vec![INFINITE; n]);
        for found in both(&lcp) {
            let [zero] = found.solutions.as_slice() else {
                panic!("{found:?}");
            };
            assert_eq!(
                (&zero.x, zero.num_selections),
                (&vec![0.0; n], f64::powi(2.0, n as i32))
            );
            assert!(zero.selections.len() >= 48, "{}", zero.selections.len());
            assert!(zero.selections.is_sorted(), "{:?}", zero.selections);
            for (selection, sign) in zero.selections.iter().zip(&zero.det_signs) {
                let free = (0..n).filter(|&i| selection.piece(i) == 1);
                let minor: f64 = free.map(|i| DIAGONAL[i]).product();
                assert_eq!(sign.map(f64::from), Some(minor.signum()));
            }
        }
    }
}

/// F(z) = 0.01 − z + E z in [−1, 1]ⁿ with a small E ≥ 0: each of the 3ⁿ selections has its own solution, so that none can be ruled out, and
/// as many are examined as are found.
#[test]
fn a_search_that_stops_reports_its_progress() {
    const N: usize = 4;
    let entry = |i: usize, j: usize| match i == j {
        true => -1.0,
        false => 0.02 * (1 + i + 2 * j) as f64,
    };
    let rows: Vec<Vec<f64>> = (0..N).map(|i| (0..N).map(|j| entry(i, j)).collect()).collect();
    let lcp = boxed(&rows, &[0.01; N], &[-1.0; N], &[1.0; N]);
    for map in [lcp.mcp() as &dyn PiecewiseSmooth, &Unstated(lcp.mcp())] {
        let all = list(map, 0.0);
        assert_eq!(all.solutions.len(), 81);
        let mut found = 0;
        for limit in (1..all.nodes).step_by(5) {
            let options = EnumerationOptions::default().with_max_nodes(limit);
            let set = all_solutions(map, 0.0, &options).unwrap();
            let listed = set.solutions.len();
            let (examined, total) = (listed as f64, 81.0);
            assert_eq!(set.completeness, Completeness::Incomplete { examined, total });
            assert!(set.nodes <= limit && listed >= found);
            found = listed;
        }
        assert!(found > 40, "{found}");
    }
}
