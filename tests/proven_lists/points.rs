//! The data of each listed solution: its margin, and the ends of continua.

use semismooth::complementarity::Lcp;
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::sparse::Matrix;

use super::list;

/// z₁ = 1/k and ±(k z₁ − 1) + z₂ = 0 with z₂ = 0: degenerate, although k times the rounded 1/k is not 1.
#[test]
fn degenerate_solutions_have_no_margin() {
    for k in [49.0, 98.0, 103.0, 107.0, 161.0] {
        assert!(k * (1.0 / k) != 1.0);
        for sign in [1.0, -1.0] {
            let m = Matrix::from_rows(&[[k, 0.0], [sign * k, 1.0]]).unwrap();
            let lcp = Lcp::new(m, vec![-1.0, -sign]).unwrap();
            let found = list(lcp.mcp(), 0.0);
            assert!(found.completeness.is_complete());
            let [solution] = found.solutions.as_slice() else {
                panic!("{found:?}");
            };
            assert_eq!((solution.x[0], solution.x[1]), (1.0 / k, 0.0));
            assert_eq!(
                (solution.margin, solution.selections.len()),
                (0.0, 2),
                "{k} {sign}"
            );
        }
    }
}

/// ½ − z in [0, 1] has the solutions 0, ½ and 1; beside an undetermined unknown each is a line.
#[test]
fn lines_without_ends_are_distinguished() {
    let m = Matrix::from_rows(&[[-1.0, 0.0], [0.0, 0.0]]).unwrap();
    let infinite = f64::INFINITY;
    let lcp = Lcp::boxed(m, vec![0.5, 0.0], vec![0.0, -infinite], vec![1.0, infinite]).unwrap();
    let found = list(lcp.mcp(), 0.0);
    assert!(found.completeness.is_complete() && found.solutions.is_empty());
    assert_eq!(found.continua.len(), 3, "{found:?}");
    for line in &found.continua {
        assert_eq!(
            (line.dimension, line.ends.len(), line.selections.len()),
            (1, 0, 1)
        );
    }
    assert_eq!(found.index_sum, None);
}

/// [[a, b], [b, a]] with b > a > 0 has three solutions; the list states for each the distance to its nearest kink, proven in floating-point
/// or, close to singular, in exact arithmetic.
#[test]
fn margins_are_distances_to_the_nearest_kink() {
    for gap in [1.0, 1e-3, 1e-9, 4.0 * f64::EPSILON] {
        let (a, b) = (1.0, 1.0 + gap);
        let lcp = Lcp::new(Matrix::from_rows(&[[a, b], [b, a]]).unwrap(), vec![-1.0; 2]).unwrap();
        let found = list(lcp.mcp(), 0.0);
        assert!(
            found.completeness.is_complete() && found.solutions.len() == 3,
            "{found:?}"
        );
        assert!(found.pivots > 0 && found.nodes >= 3);
        for s in &found.solutions {
            let mut tests = [0.0; 2];
            lcp.mcp().test_functions(&s.x, &mut tests);
            let nearest = tests.iter().fold(f64::INFINITY, |m, t| m.min(t.abs()));
            assert!(
                (s.margin - nearest).abs() <= 1e-9 * nearest,
                "{gap:e}: {} {nearest:e}",
                s.margin
            );
        }
    }
}

/// z₁ = 1/3 and z₂ = b − z₁, where b is 2⁻ᵏ above the rounded 1/3: all but the last few digits of z₂ cancel, and yet z₂ has the digits of
/// the exact difference.
#[test]
fn small_components_have_digits_of_their_own() {
    let third: f64 = 1.0 / 3.0;
    for k in [30, 40, 44] {
        let b = third + f64::powi(2.0, -k);
        let m = Matrix::from_rows(&[[3.0, 0.0], [1.0, 1.0]]).unwrap();
        let found = list(Lcp::new(m, vec![-1.0, -b]).unwrap().mcp(), 0.0);
        assert!(found.completeness.is_complete());
        // 1/3 is 2⁻⁵⁴/3 above the nearest floating-point number.
        let exact = f64::powi(2.0, -k) - f64::powi(2.0, -54) / 3.0;
        let [solution] = found.solutions.as_slice() else {
            panic!("{found:?}");
        };
        let error = (solution.x[1] - exact).abs() / exact;
        assert!(error <= 1e-8, "{k}: {error:e}");
    }
}
