//! Factors and solves of small matrices, with loops of fixed length.

use crate::linear::condition::arg_max_abs;

/// Elimination with partial pivoting in place; `true` for an odd number of exchanges, `None` at a pivot that is zero.
pub(in crate::linear) fn eliminate_small(n: usize, lu: &mut [f64], perm: &mut [usize]) -> Option<bool> {
    let mut odd = false;
    for k in 0..n {
        let pivot = k + arg_max_abs(&lu[k * n + k..(k + 1) * n]);
        let diagonal = lu[k * n + pivot];
        if diagonal == 0.0 {
            return None;
        }
        perm[k] = pivot;
        if pivot != k {
            odd = !odd;
            (0..n).for_each(|j| lu.swap(j * n + k, j * n + pivot));
        }
        let (done, rest) = lu.split_at_mut((k + 1) * n);
        let l = &mut done[k * n + k + 1..];
        let inverse = 1.0 / diagonal;
        l.iter_mut().for_each(|l| *l *= inverse);
        for column in rest.chunks_exact_mut(n) {
            let u = column[k];
            for (c, l) in column[k + 1..].iter_mut().zip(l.iter()) {
                *c -= l * u;
            }
        }
    }
    Some(odd)
}

/// As [`eliminate_small`], for a constant order.
#[inline]
pub(super) fn eliminate_fixed<const N: usize>(_: usize, lu: &mut [f64], perm: &mut [usize]) -> Option<bool> {
    let target = lu.as_chunks_mut::<N>().0.first_chunk_mut::<N>()?;
    let perm = perm.first_chunk_mut::<N>()?;
    let mut a = *target;
    let mut odd = false;
    for k in 0..N {
        let mut pivot = k;
        for i in k + 1..N {
            if a[k][i].abs() > a[k][pivot].abs() {
                pivot = i;
            }
        }
        if a[k][pivot] == 0.0 {
            return None;
        }
        perm[k] = pivot;
        if pivot != k {
            odd = !odd;
            (0..N).for_each(|j| a[j].swap(k, pivot));
        }
        let inverse = 1.0 / a[k][k];
        for i in k + 1..N {
            a[k][i] *= inverse;
        }
        for j in k + 1..N {
            for i in k + 1..N {
                a[j][i] -= a[k][i] * a[j][k];
            }
        }
    }
    *target = a;
    Some(odd)
}

pub(super) fn solve_small(lu: &[f64], perm: &[usize], b: &mut [f64], transpose: bool) {
    let n = b.len();
    if transpose {
        for k in 0..n {
            let (head, tail) = b.split_at_mut(k);
            let u = &lu[k * n..k * n + k];
            let dot: f64 = u.iter().zip(head.iter()).map(|(u, b)| u * b).sum();
            tail[0] = (tail[0] - dot) / lu[k * n + k];
        }
        for k in (0..n).rev() {
            let (head, tail) = b.split_at_mut(k + 1);
            let l = &lu[k * n + k + 1..(k + 1) * n];
            let dot: f64 = l.iter().zip(tail.iter()).map(|(l, b)| l * b).sum();
            head[k] -= dot;
        }
        (0..n).rev().for_each(|k| b.swap(k, perm[k]));
    } else {
        (0..n).for_each(|k| b.swap(k, perm[k]));
        for k in 0..n {
            let (head, tail) = b.split_at_mut(k + 1);
            for (b, l) in tail.iter_mut().zip(&lu[k * n + k + 1..(k + 1) * n]) {
                *b -= l * head[k];
            }
        }
        for k in (0..n).rev() {
            let (head, tail) = b.split_at_mut(k);
            tail[0] /= lu[k * n + k];
            for (b, u) in head.iter_mut().zip(&lu[k * n..k * n + k]) {
                *b -= u * tail[0];
            }
        }
    }
}
