//! Loops that run on all cores where the feature `rayon` is on. Work is split by its size alone, never by the number of threads: results
//! are bitwise the same on any number of threads, and without the feature.

use std::ops::Range;

use crate::sparse::dot;

/// Numbers of a vector below which threads cost more than they bring.
pub(crate) const GRAIN: usize = 1 << 14;

/// Both results.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "rayon")]
    {
        rayon::join(a, b)
    }
    #[cfg(not(feature = "rayon"))]
    (a(), b())
}

/// Runs f on a thread of the pool, so that its parallel loops do not enter the pool from outside each time.
pub(crate) fn within<R: Send>(f: impl FnOnce() -> R + Send) -> R {
    join(f, || ()).0
}

/// Calls f with the position of the first entry and the entries of each part of length `size`; the last part may be shorter.
pub(crate) fn parts<T: Send>(v: &mut [T], size: usize, f: &(impl Fn(usize, &mut [T]) + Sync)) {
    parts_from(0, v, size, f);
}

fn parts_from<T: Send>(first: usize, v: &mut [T], size: usize, f: &(impl Fn(usize, &mut [T]) + Sync)) {
    if v.len() <= size {
        return f(first, v);
    }
    let half = v.len().div_ceil(size) / 2 * size;
    let (a, b) = v.split_at_mut(half);
    join(
        || parts_from(first, a, size, f),
        || parts_from(first + half, b, size, f),
    );
}

/// Calls f with the number and the entries of each span `ends[k]..ends[k + 1]` of v; the spans cover v.
pub(crate) fn spans<T: Send>(ends: &[usize], v: &mut [T], f: &(impl Fn(usize, &mut [T]) + Sync)) {
    spans_from(0, ends, v, f);
}

fn spans_from<T: Send>(first: usize, ends: &[usize], v: &mut [T], f: &(impl Fn(usize, &mut [T]) + Sync)) {
    match ends.len() {
        0 | 1 => {}
        2 => f(first, v),
        n => {
            let half = n / 2;
            let (a, b) = v.split_at_mut(ends[half] - ends[0]);
            join(
                || spans_from(first, &ends[..=half], a, f),
                || spans_from(first + half, &ends[half..], b, f),
            );
        }
    }
}

/// The sum of f over parts of 0..n of length `size`, in an order that depends on n and `size` alone.
pub(crate) fn sum(n: usize, size: usize, f: &(impl Fn(Range<usize>) -> f64 + Sync)) -> f64 {
    sum_over(0..n, size, f)
}

fn sum_over(range: Range<usize>, size: usize, f: &(impl Fn(Range<usize>) -> f64 + Sync)) -> f64 {
    if range.len() <= size {
        return f(range);
    }
    let middle = range.start + range.len().div_ceil(size) / 2 * size;
    let (a, b) = join(
        || sum_over(range.start..middle, size, f),
        || sum_over(middle..range.end, size, f),
    );
    a + b
}

/// The sum of f over parts of v of length `size`, which f may change.
pub(crate) fn sum_parts<T: Send>(
    v: &mut [T],
    size: usize,
    f: &(impl Fn(usize, &mut [T]) -> f64 + Sync),
) -> f64 {
    fold_parts(0, v, size, f, &|a, b| a + b)
}

/// The largest f over parts of v of length `size`, which f may change; NaN if any is.
pub(crate) fn largest_of_parts<T: Send>(
    v: &mut [T],
    size: usize,
    f: &(impl Fn(usize, &mut [T]) -> f64 + Sync),
) -> f64 {
    fold_parts(0, v, size, f, &|a, b| if b > a || b.is_nan() { b } else { a })
}

/// Combines f of the parts pairwise, in an order that depends on the length and `size` alone.
fn fold_parts<T: Send>(
    first: usize,
    v: &mut [T],
    size: usize,
    f: &(impl Fn(usize, &mut [T]) -> f64 + Sync),
    both: &(impl Fn(f64, f64) -> f64 + Sync),
) -> f64 {
    if v.len() <= size {
        return f(first, v);
    }
    let half = v.len().div_ceil(size) / 2 * size;
    let (a, b) = v.split_at_mut(half);
    let (a, b) = join(
        || fold_parts(first, a, size, f, both),
        || fold_parts(first + half, b, size, f, both),
    );
    both(a, b)
}

/// Σ aᵢ bᵢ.
pub(crate) fn product(a: &[f64], b: &[f64]) -> f64 {
    sum(a.len(), GRAIN, &|r| dot(&a[r.clone()], &b[r]))
}

/// y ← y + c x.
pub(crate) fn add_scaled(c: f64, x: &[f64], y: &mut [f64]) {
    parts(y, GRAIN, &|first, y| {
        y.iter_mut().zip(&x[first..]).for_each(|(y, x)| *y += c * x);
    });
}

/// f of each part of 0..n of length `size`, in order.
pub(crate) fn collect<R: Send>(n: usize, size: usize, f: impl Fn(Range<usize>) -> R + Sync) -> Vec<R> {
    let ranges: Vec<_> = (0..n)
        .step_by(size.max(1))
        .map(|first| first..n.min(first + size.max(1)))
        .collect();
    crate::sweep::sweep(&ranges, |r| f(r.clone()))
}
