//! Sizes of rows, and factors that bring rows and columns to one size.

use crate::sparse::MatrixRef;

/// Sweeps of equilibration; each halves the decimal exponents that remain.
const SWEEPS: usize = 6;

/// The size of the terms that cancel in each residual, S_i = Σ_j |∂H_i/∂x_j| |x_j|.
pub(crate) fn row_sizes(jac: MatrixRef<'_>, x: &[f64], size: &mut [f64]) {
    size.fill(0.0);
    jac.add_term_sizes(x, size);
}

/// The largest power of two that is not above a positive number; 1 for other ones, and beyond the range in which reciprocals are numbers.
pub(crate) fn power_below(v: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let power = f64::from_bits(v.to_bits() & EXPONENT);
    match v > 0.0 && power.is_normal() && power.recip().is_normal() {
        true => power,
        false => 1.0,
    }
}

/// Factors that bring the largest entry of every row and column of a matrix near 1 (D. Ruiz, RAL-TR-2001-034).
pub(crate) fn equilibrate(a: MatrixRef<'_>, row: &mut [f64], col: &mut [f64], max: &mut [f64]) {
    row.fill(1.0);
    col.fill(1.0);
    // Whether the largest entry was near 1 already.
    let divide = |factor: &mut f64, max: f64| {
        if max > 0.0 && max.is_finite() {
            *factor /= max.sqrt();
        }
        max == 0.0 || (max > 0.5 && max < 2.0)
    };
    for _ in 0..SWEEPS {
        let mut near = true;
        max.fill(0.0);
        for j in 0..a.pattern.ncols {
            let span = a.pattern.col_ptr[j]..a.pattern.col_ptr[j + 1];
            let mut column = 0.0_f64;
            let c = col[j];
            for (&i, v) in a.pattern.row_idx[span.clone()].iter().zip(&a.values[span]) {
                let entry = (v * row[i] * c).abs();
                if entry > column {
                    column = entry;
                }
                if entry > max[i] {
                    max[i] = entry;
                }
            }
            near &= divide(&mut col[j], column);
        }
        for (r, m) in row.iter_mut().zip(&*max) {
            near &= divide(r, *m);
        }
        if near {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{equilibrate, power_below};
    use crate::sparse::Matrix;

    #[test]
    fn powers_of_two_are_those_below() {
        for (v, power) in [
            (1.0, 1.0),
            (1.99, 1.0),
            (0.3, 0.25),
            (2.0_f64.powi(-300), 2.0_f64.powi(-300)),
            (1e-310, 1.0),
            (0.0, 1.0),
            (-3.0, 1.0),
            (f64::INFINITY, 1.0),
            (f64::NAN, 1.0),
        ] {
            assert_eq!(power_below(v), power, "{v:e}");
        }
    }

    /// Rows and columns in units from 1e-12 to 1e12.
    #[test]
    fn equilibration_brings_largest_entries_near_one() {
        for k in 0..50 {
            let n = 6;
            let unit = |i: usize, salt: usize| 10_f64.powf(12.0 * ((i * 7 + salt * 3 + k) as f64).sin());
            let entry = |i: usize, j: usize| ((i * n + j + k) as f64).cos() * unit(i, 1) * unit(j, 2);
            let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
            let a = Matrix::from_rows(&rows).unwrap();
            let (mut row, mut col, mut max) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
            equilibrate(a.as_ref(), &mut row, &mut col, &mut max);
            let (mut rows, mut cols) = (vec![0.0_f64; n], vec![0.0_f64; n]);
            for (i, j, v) in a.triplets() {
                let v = (v * row[i] * col[j]).abs();
                rows[i] = rows[i].max(v);
                cols[j] = cols[j].max(v);
            }
            assert!(
                rows.iter().chain(&cols).all(|v| (0.4..2.5).contains(v)),
                "{k}: {rows:?} {cols:?}"
            );
        }
    }
}
