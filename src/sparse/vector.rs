//! Products and norms of plain vectors.

/// Σ aᵢ bᵢ. Four partial sums let the compiler use wide registers; a single one would fix the order of additions.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let (head_a, tail_a) = a.split_at(n - n % 4);
    let (head_b, tail_b) = b.split_at(n - n % 4);
    let mut sums = [0.0; 4];
    for (x, y) in head_a.chunks_exact(4).zip(head_b.chunks_exact(4)) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let tail: f64 = tail_a.iter().zip(tail_b).map(|(x, y)| x * y).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + tail
}

/// ‖v‖₂, also where the squares leave the range of numbers.
pub(crate) fn norm(v: &[f64]) -> f64 {
    let squares = dot(v, v);
    if (1e-290..1e290).contains(&squares) || squares.is_nan() {
        return squares.sqrt();
    }
    let max = max_abs(v);
    if max == 0.0 || max.is_infinite() {
        return max;
    }
    max * v.iter().map(|x| (x / max).powi(2)).sum::<f64>().sqrt()
}

/// ‖a − b‖₂.
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

/// max |vᵢ|, 0 for an empty vector; NaN if there is one.
pub(crate) fn max_abs(v: &[f64]) -> f64 {
    v.iter().fold(
        0.0,
        |m: f64, x| if x.abs() > m || x.is_nan() { x.abs() } else { m },
    )
}
