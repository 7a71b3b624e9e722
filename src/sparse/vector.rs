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

/// ‖v‖₂, also where the squares overflow or underflow.
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
    let apart = || a.iter().zip(b).map(|(a, b)| a - b);
    let squares: f64 = apart().map(|d| d * d).sum();
    if (1e-290..1e290).contains(&squares) || squares.is_nan() {
        return squares.sqrt();
    }
    let max = apart().fold(0.0, |m: f64, d| m.max(d.abs()));
    if max == 0.0 || max.is_infinite() {
        return max;
    }
    max * apart().map(|d| (d / max).powi(2)).sum::<f64>().sqrt()
}

/// max |vᵢ|, 0 for an empty vector; NaN if any entry is.
pub(crate) fn max_abs(v: &[f64]) -> f64 {
    in_lanes(
        v,
        v,
        |v, _| v.abs(),
        |m, x| if x > m || x.is_nan() { x } else { m },
    )
}

/// max |vᵢ| fᵢ of finite numbers and factors that are not negative.
pub(crate) fn max_abs_scaled(v: &[f64], factors: &[f64]) -> f64 {
    in_lanes(v, factors, |v, f| v.abs() * f, |m, x| if x > m { x } else { m })
}

/// Σ |vᵢ|.
pub(crate) fn sum_abs(v: &[f64]) -> f64 {
    in_lanes(v, v, |v, _| v.abs(), |sum, x| sum + x)
}

/// Combines the terms of pairs from 0 on, in an order that allows wide registers.
#[inline(always)]
fn in_lanes(a: &[f64], b: &[f64], term: impl Fn(f64, f64) -> f64, join: impl Fn(f64, f64) -> f64) -> f64 {
    const LANES: usize = 8;
    let (wide_a, tail_a) = a.as_chunks::<LANES>();
    let (wide_b, tail_b) = b.as_chunks::<LANES>();
    let mut whole = 0.0;
    if !wide_a.is_empty() {
        let mut lanes = [0.0; LANES];
        for (a, b) in wide_a.iter().zip(wide_b) {
            for k in 0..LANES {
                lanes[k] = join(lanes[k], term(a[k], b[k]));
            }
        }
        whole = lanes.into_iter().fold(whole, &join);
    }
    (tail_a.iter().zip(tail_b)).fold(whole, |sum, (a, b)| join(sum, term(*a, *b)))
}

#[cfg(test)]
mod tests {
    use super::{max_abs, max_abs_scaled, sum_abs};

    /// Whole numbers, whose sums are exact, in every length around the width of the lanes.
    #[test]
    fn lanes_leave_no_entry_out() {
        for n in 0..35_usize {
            let mut v: Vec<f64> = (0..n).map(|i| (7 * i % 11) as f64 - 5.0).collect();
            let factors: Vec<f64> = (0..n).map(|i| (5 * i % 13) as f64).collect();
            let max = |terms: &mut dyn Iterator<Item = f64>| terms.fold(0.0, f64::max);
            assert_eq!(sum_abs(&v), v.iter().map(|v| v.abs()).sum::<f64>());
            assert_eq!(max_abs(&v), max(&mut v.iter().map(|v| v.abs())));
            let scaled = max_abs_scaled(&v, &factors);
            assert_eq!(scaled, max(&mut v.iter().zip(&factors).map(|(v, f)| v.abs() * f)));
            for i in 0..n {
                let kept = std::mem::replace(&mut v[i], f64::NAN);
                assert!(max_abs(&v).is_nan(), "{n} {i}");
                v[i] = -100.0;
                assert_eq!(max_abs(&v), 100.0, "{n} {i}");
                v[i] = kept;
            }
        }
    }
}
