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
