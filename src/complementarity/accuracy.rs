//! When a point counts as a solution of a box LCP: the rule of [`judge`](crate::judge), stated in the documentation of this module.

use super::columns::BoxLcp;
use crate::judge::Point;
use crate::tolerances::ROUNDING;

/// Unknowns beyond 2⁴⁸ have hardly a digit after the point: an active set is not looked for there.
pub(super) const LARGEST: f64 = 281_474_976_710_656.0;

/// The unit of an unknown; 1 where no units are given.
pub(super) fn unit(units: &[f64], i: usize) -> f64 {
    units.get(i).copied().unwrap_or(1.0)
}

/// Sets components to zero that are rounding errors of the largest one, where the bounds allow it; returns whether there were any. In a row
/// whose terms are all of this size, neither signs nor relative residuals are meaningful.
pub(super) fn drop_rounding(lcp: BoxLcp<'_>, z: &mut [f64]) -> bool {
    let rounding = ROUNDING * z.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut any = false;
    for ((z, l), u) in z.iter_mut().zip(lcp.lower).zip(lcp.upper) {
        if *z != 0.0 && z.abs() <= rounding && *l <= 0.0 && *u >= 0.0 {
            *z = 0.0;
            any = true;
        }
    }
    any
}

/// A point z of an LCP and w = M z + q.
pub(super) fn point<'a>(lcp: BoxLcp<'a>, z: &'a [f64], w: &'a [f64]) -> Point<'a> {
    Point {
        x: z,
        f: w,
        jac: lcp.matrix,
        rest: Some(lcp.q),
        start: &[],
        typical: &[],
        sizes: None,
        lower: lcp.lower,
        upper: lcp.upper,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::complementarity::Lcp;
    use crate::judge::Judge;
    use crate::sparse::Matrix;

    #[test]
    fn a_point_where_the_rows_overflow_is_no_solution() {
        let lcp = Lcp::new(Matrix::from_rows(&[[1e308]]).unwrap(), vec![-1.0]).unwrap();
        for w in [f64::NAN, f64::INFINITY, 1e307] {
            let verdict = Judge::default().verdict(&point((&lcp).into(), &[10.0], &[w]), 1.0);
            assert!(!verdict.is_solved(1.0), "{w}");
        }
    }

    /// 0 ≤ z ⟂ 2 z − 3 ≥ 0: below its bound z is wrong by what moving back changes in the row, beside it by the residual.
    #[test]
    fn a_point_beside_its_bounds_is_none_within_them() {
        let lcp = Lcp::new(Matrix::from_rows(&[[2.0]]).unwrap(), vec![-3.0]).unwrap();
        let mut judge = Judge::default();
        let mut error = |z: f64| {
            let (z, w) = ([z], [2.0 * z - 3.0]);
            judge.verdict(&point((&lcp).into(), &z, &w), 1e-10).error
        };
        assert_eq!(error(1.5), 0.0);
        assert_eq!(error(0.0), 1.0);
        for d in [1e-3, 0.5, 2.0] {
            let expected = 2.0 * d / (2.0 * d + 3.0);
            assert!((error(-d) - expected).abs() < 1e-15, "{d}");
            let inside = 2.0 * d / (2.0 * (1.5 + d) + 3.0);
            assert!((error(1.5 + d) - inside).abs() < 1e-15, "{d}");
        }
    }

    /// Beside a component of 1 what is below 64 units in its last place is rounding, and nothing else is.
    #[test]
    fn only_rounding_is_dropped() {
        let mut z = [1.0, 63.0 * f64::EPSILON, 65.0 * f64::EPSILON, 1e-12];
        let identity = Matrix::from_triplets(4, 4, &[0, 1, 2, 3].map(|i| (i, i, 1.0))).unwrap();
        let lcp = Lcp::new(identity, vec![-1.0; 4]).unwrap();
        assert!(drop_rounding((&lcp).into(), &mut z));
        assert_eq!(z, [1.0, 0.0, 65.0 * f64::EPSILON, 1e-12]);
        assert!(!drop_rounding((&lcp).into(), &mut z));
    }
}
