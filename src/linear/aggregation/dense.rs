//! Small dense blocks.

/// The inverse of a symmetric positive semidefinite block on the components of which the pivots are not negligible, relative to the
/// diagonal; zero rows and columns for the others, and for those masked.
pub(super) fn semi_inverse<const B: usize>(m: &[[f64; B]; B], masked: u8, negligible: f64) -> [[f64; B]; B] {
    let mut w = *m;
    let mut live = [false; B];
    // Sweeps of pivots, in which the leading part of w becomes minus its inverse.
    for k in 0..B {
        let pivot = w[k][k];
        if masked >> k & 1 == 1 || pivot.is_nan() || pivot <= negligible * m[k][k] || pivot <= 0.0 {
            continue;
        }
        live[k] = true;
        let row = w[k];
        for i in (0..B).filter(|&i| i != k) {
            let factor = w[i][k] / pivot;
            for j in (0..B).filter(|&j| j != k) {
                w[i][j] -= factor * row[j];
            }
        }
        for j in (0..B).filter(|&j| j != k) {
            w[k][j] = row[j] / pivot;
            w[j][k] = w[k][j];
        }
        w[k][k] = -1.0 / pivot;
    }
    let mut inverse = [[0.0; B]; B];
    for i in (0..B).filter(|&i| live[i]) {
        for j in (0..B).filter(|&j| live[j]) {
            inverse[i][j] = -0.5 * (w[i][j] + w[j][i]);
        }
    }
    inverse
}

/// C += s Aᵀ B, all of them stored by rows.
#[inline(always)]
pub(super) fn add_transposed_product<const R: usize, const C: usize, const K: usize>(
    a: &[[f64; C]; R],
    b: &[[f64; K]; R],
    c: &mut [[f64; K]; C],
) {
    for r in 0..R {
        for i in 0..C {
            for k in 0..K {
                c[i][k] += a[r][i] * b[r][k];
            }
        }
    }
}

/// C += s A B.
#[inline(always)]
pub(super) fn add_scaled_product<const R: usize, const C: usize, const K: usize>(
    s: f64,
    a: &[[f64; C]; R],
    b: &[[f64; K]; C],
    c: &mut [[f64; K]; R],
) {
    for i in 0..R {
        for j in 0..C {
            let factor = s * a[i][j];
            for k in 0..K {
                c[i][k] += factor * b[j][k];
            }
        }
    }
}

/// Sets the masked rows to zero.
pub(super) fn mask_rows<const R: usize, const K: usize>(m: &mut [[f64; K]; R], masked: u8) {
    for (i, row) in m.iter_mut().enumerate() {
        if masked >> i & 1 == 1 {
            *row = [0.0; K];
        }
    }
}
