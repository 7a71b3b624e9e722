//! Small dense linear algebra for the tests, independent of the crate's solvers.
#![allow(dead_code)]

/// Gaussian elimination with partial pivoting. Returns the sign of det A, the smallest pivot relative to the largest entry,
/// and, unless a pivot vanishes, the solution of A x = b.
pub(crate) fn eliminate(a: &[Vec<f64>], b: &[f64]) -> (i32, f64, Option<Vec<f64>>) {
    let n = b.len();
    let mut m: Vec<Vec<f64>> = a
        .iter()
        .zip(b)
        .map(|(r, b)| [r.as_slice(), &[*b]].concat())
        .collect();
    let largest = a.iter().flatten().fold(0.0f64, |s, v| s.max(v.abs()));
    let (mut sign, mut smallest) = (1, f64::INFINITY);
    for k in 0..n {
        let p = (k..n)
            .max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()))
            .unwrap();
        if p != k {
            m.swap(p, k);
            sign = -sign;
        }
        let pivot = m[k][k];
        smallest = smallest.min(pivot.abs() / largest);
        if pivot == 0.0 {
            return (0, 0.0, None);
        }
        if pivot < 0.0 {
            sign = -sign;
        }
        for i in k + 1..n {
            let factor = m[i][k] / pivot;
            if factor != 0.0 {
                for j in k..=n {
                    m[i][j] -= factor * m[k][j];
                }
            }
        }
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|j| m[i][j] * x[j]).sum();
        x[i] = (m[i][n] - sum) / m[i][i];
    }
    (sign, smallest, Some(x))
}

/// Sign of det A and the smallest relative pivot.
pub(crate) fn det_sign(a: &[Vec<f64>]) -> (i32, f64) {
    let (sign, pivot, _) = eliminate(a, &vec![0.0; a.len()]);
    (sign, pivot)
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}
