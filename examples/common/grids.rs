//! m × m interior points of a square, numbered line by line from below: differences, nested grids.
#![allow(dead_code)]

use std::error::Error;

use semismooth::linear::Prolongation;
use semismooth::sparse::{Matrix, Pattern};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// 4 v − its neighbours, 0 beyond the boundary: −h² Δ by five points.
pub(crate) fn five_point(m: usize) -> Result<Matrix> {
    let n = m * m;
    let (mut start, mut rows, mut values) = (vec![0], Vec::with_capacity(5 * n), Vec::with_capacity(5 * n));
    for j in 0..m {
        for i in 0..m {
            let k = j * m + i;
            let mut put = |there: bool, k: usize, v: f64| {
                if there {
                    rows.push(k);
                    values.push(v);
                }
            };
            put(j > 0, k.wrapping_sub(m), -1.0);
            put(i > 0, k.wrapping_sub(1), -1.0);
            put(true, k, 4.0);
            put(i + 1 < m, k + 1, -1.0);
            put(j + 1 < m, k + m, -1.0);
            start.push(rows.len());
        }
    }
    Ok(Matrix::from_values(
        Pattern::from_csc(n, n, start, rows)?,
        values,
    )?)
}

/// `out = scale` times [`five_point`] `v`, without its matrix.
pub(crate) fn apply_five_point(m: usize, scale: f64, v: &[f64], out: &mut [f64]) {
    for j in 0..m {
        let line = &v[j * m..(j + 1) * m];
        let out = &mut out[j * m..(j + 1) * m];
        for (out, v) in out.iter_mut().zip(line) {
            *out = 4.0 * v;
        }
        for i in 1..m {
            out[i] -= line[i - 1];
            out[i - 1] -= line[i];
        }
        for (there, from) in [(j > 0, j.wrapping_sub(1)), (j + 1 < m, j + 1)] {
            if there {
                for (out, v) in out.iter_mut().zip(&v[from * m..(from + 1) * m]) {
                    *out -= v;
                }
            }
        }
        out.iter_mut().for_each(|out| *out *= scale);
    }
}

/// Bilinear interpolation from the lines 2, 4, … (1 to m/2 of the coarse grid), 0 on the boundary.
pub(crate) fn bilinear(m: usize) -> Result<Matrix> {
    let coarse = m / 2;
    let most = 9 * coarse * coarse;
    let (mut start, mut rows, mut weights) = (vec![0], Vec::with_capacity(most), Vec::with_capacity(most));
    for b in 1..=coarse {
        for a in 1..=coarse {
            for j in 2 * b - 1..=(2 * b + 1).min(m) {
                for i in 2 * a - 1..=(2 * a + 1).min(m) {
                    rows.push((j - 1) * m + i - 1);
                    weights.push(weight(i, a) * weight(j, b));
                }
            }
            start.push(rows.len());
        }
    }
    let pattern = Pattern::from_csc(m * m, coarse * coarse, start, rows)?;
    Ok(Matrix::from_values(pattern, weights)?)
}

/// Weight of coarse line a, which is fine line 2a, at fine line i.
pub(crate) fn weight(i: usize, a: usize) -> f64 {
    if i == 2 * a { 1.0 } else { 0.5 }
}

/// Interpolation from each grid to the next finer one, finest first, for m = 2ᵏ − 1.
pub(crate) fn nested_grids(mut m: usize) -> Result<Vec<Prolongation>> {
    let mut all = Vec::new();
    while m > 3 {
        all.push(Prolongation::new(&bilinear(m)?)?);
        m /= 2;
    }
    Ok(all)
}
