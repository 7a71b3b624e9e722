//! Strong regularity: principal minors in closed form.

use semismooth::complementarity::{Lcp, strong_regularity};
use semismooth::sparse::Matrix;

/// [[1, a], [b, 1]] with a b = 1 − d has the minors 1, 1 and d, and an indefinite symmetric part.
#[test]
fn small_minors_decide_by_their_sign() {
    for a in [4.0, 64.0, -1024.0] {
        for d in [0.5, 1e-3, 1e-6, 1e-9] {
            for (d, regular) in [(d, true), (-d, false)] {
                let matrix = Matrix::from_rows(&[[1.0, a], [(1.0 - d) / a, 1.0]]).unwrap();
                let lcp = Lcp::new(matrix, vec![0.0; 2]).unwrap();
                let found = strong_regularity(lcp.mcp(), &[0.0; 2], 1e-12, 100).unwrap();
                assert_eq!(
                    (found.is_regular(), found.fails()),
                    (regular, !regular),
                    "{a} {d:e}: {found}"
                );
            }
        }
    }
}

/// Positive factors of rows and columns change no sign of a minor. Those of order 1 and 2 are positive here, and the determinant is 6 + 7 a
/// b with the entries a = ±9 and b = ±½ in the corners.
#[test]
fn units_do_not_decide_about_minors() {
    let cases = [
        ([[1.0, 9.0, 0.0], [0.0, 2.0, 7.0], [-0.5, 0.0, 3.0]], false),
        ([[1.0, 9.0, 0.0], [0.0, 2.0, 7.0], [0.5, 0.0, 3.0]], true),
        ([[1.0, -9.0, 0.0], [0.0, 2.0, 7.0], [0.5, 0.0, 3.0]], false),
    ];
    for (m, regular) in cases {
        for turn in 0..3 {
            let unit = |i: usize, first: i32| 2_f64.powi(first * [30, -30, 7][(i + turn) % 3]);
            for (row, col) in [(0, 1), (1, 0), (1, 1), (1, -1)] {
                let rows: Vec<Vec<f64>> = (0..3)
                    .map(|i| {
                        (0..3)
                            .map(|j| m[i][j] * unit(i, row) * unit(j + 1, col))
                            .collect()
                    })
                    .collect();
                let lcp = Lcp::new(Matrix::from_rows(&rows).unwrap(), vec![0.0; 3]).unwrap();
                let found = strong_regularity(lcp.mcp(), &[0.0; 3], 1e-12, 100).unwrap();
                assert_eq!(
                    (found.is_regular(), found.fails()),
                    (regular, !regular),
                    "{rows:?}: {found}"
                );
            }
        }
    }
}
