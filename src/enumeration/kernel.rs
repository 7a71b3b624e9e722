//! Gauss–Jordan elimination with full pivoting: a particular solution and the kernel of a small system of any rank.

use crate::tolerances::{CHECKED, ROUNDING, SAME};

/// Unknowns up to which the kernel of a singular matrix is computed: elimination is dense.
pub(super) const MAX_KERNEL: usize = 4000;

/// All solutions of a linear system: a particular one and a basis of the kernel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AffineSet {
    pub(super) point: Vec<f64>,
    pub(super) kernel: Vec<Vec<f64>>,
}

/// The solutions of A y + b = 0, `rows` holding the rows (A | b); `None` where the rows contradict each other.
pub(super) fn solutions(mut rows: Vec<Vec<f64>>, unknowns: usize) -> Option<AffineSet> {
    // Rows and columns are brought to size one, so that the rank does not depend on units.
    for row in &mut rows {
        let size = row[..unknowns].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if size > 0.0 {
            row.iter_mut().for_each(|v| *v /= size);
        }
    }
    let constants = rows.iter().fold(0.0f64, |m, r| m.max(r[unknowns].abs()));
    let mut scale = vec![0.0f64; unknowns];
    for row in &rows {
        for (s, v) in scale.iter_mut().zip(row) {
            *s = s.max(v.abs());
        }
    }
    for row in &mut rows {
        for (v, s) in row.iter_mut().zip(&scale) {
            *v = if *s <= ROUNDING { 0.0 } else { *v / s };
        }
    }
    for s in scale.iter_mut().filter(|s| **s <= ROUNDING) {
        *s = 1.0;
    }
    let mut pivots: Vec<usize> = Vec::new();
    let mut used = vec![false; unknowns];
    while pivots.len() < rows.len() {
        let rank = pivots.len();
        let mut best = (0.0, rank, 0);
        for (r, row) in rows.iter().enumerate().skip(rank) {
            for (c, v) in row[..unknowns].iter().enumerate() {
                if !used[c] && v.abs() > best.0 {
                    best = (v.abs(), r, c);
                }
            }
        }
        if best.0 <= CHECKED {
            break;
        }
        let (_, r, c) = best;
        rows.swap(rank, r);
        let inverse = 1.0 / rows[rank][c];
        rows[rank].iter_mut().for_each(|v| *v *= inverse);
        let pivot = rows[rank].clone();
        for (i, row) in rows.iter_mut().enumerate() {
            let m = row[c];
            if i != rank && m != 0.0 {
                for (a, b) in row.iter_mut().zip(&pivot) {
                    *a -= m * b;
                }
                row[c] = 0.0;
            }
        }
        used[c] = true;
        pivots.push(c);
    }
    // With rows of size one the constants are distances.
    // Equations whose inconsistency is less than this distance are consistent.
    let limit = SAME * (1.0 + constants);
    if rows[pivots.len()..].iter().any(|r| r[unknowns].abs() > limit) {
        return None;
    }
    let mut point = vec![0.0; unknowns];
    for (row, &c) in rows.iter().zip(&pivots) {
        point[c] = -row[unknowns] / scale[c];
    }
    let kernel = (0..unknowns).filter(|&c| !used[c]).map(|free| {
        let mut v = vec![0.0; unknowns];
        v[free] = 1.0 / scale[free];
        for (row, &c) in rows.iter().zip(&pivots) {
            v[c] = -row[free] / scale[c];
        }
        v
    });
    Some(AffineSet {
        point,
        kernel: kernel.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::solutions;

    #[test]
    fn rank_deficient_systems() {
        let line = solutions(vec![vec![1.0, 2.0, -3.0], vec![2.0, 4.0, -6.0]], 2).unwrap();
        assert_eq!(line.kernel.len(), 1);
        let (p, k) = (&line.point, &line.kernel[0]);
        assert!((p[0] + 2.0 * p[1] - 3.0).abs() < 1e-14 && (k[0] + 2.0 * k[1]).abs() < 1e-14);
        assert!(solutions(vec![vec![1.0, 2.0, -3.0], vec![2.0, 4.0, -5.0]], 2).is_none());
        // Rows of size one agree up to 1e-9 (1 + 3/2), whatever their units.
        for unit in [1e-9, 1.0, 1e9] {
            let missing = |by: f64| {
                vec![
                    vec![1.0, 2.0, -3.0],
                    vec![2.0 * unit, 4.0 * unit, (by - 6.0) * unit],
                ]
            };
            assert!(solutions(missing(1e-9), 2).is_some_and(|s| s.kernel.len() == 1));
            assert!(solutions(missing(1e-7), 2).is_none());
        }
    }
}
