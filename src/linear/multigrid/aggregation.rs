use super::prolongation::Prolongation;
use super::rows::{Rows, RowsRef};
use crate::linear::LinearError;

/// Entries below this part of the geometric mean of their diagonals are weak.
const STRONG: f64 = 0.08;
/// Levels stop when coarsening gains less than this factor.
const MIN_COARSENING: f64 = 0.7;

/// Smoothed aggregation (P. Vaněk, J. Mandel, M. Brezina, 1996): unknowns are aggregated with their strong neighbours, and the constant on
/// each aggregate is smoothed by one damped Jacobi step. `None` when the matrix does not coarsen.
pub(super) fn smoothed_aggregation(a: &Rows) -> Result<Option<Prolongation>, LinearError> {
    let (n, a) = (a.nrows(), a.view());
    let diagonal = diagonal(a, n);
    if diagonal.iter().any(|d| d.is_nan() || *d <= 0.0) {
        return Ok(None);
    }
    let (aggregate, count) = aggregates(a, &diagonal);
    if count == 0 || count as f64 > MIN_COARSENING * n as f64 {
        return Ok(None);
    }
    let omega = damping(a, &diagonal);
    let mut start = vec![0_u32];
    let (mut col, mut value): (Vec<u32>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut slot = vec![usize::MAX; count];
    for i in 0..n {
        let first = col.len();
        let mut add = |k: usize, v: f64| {
            if slot[k] == usize::MAX || slot[k] < first {
                slot[k] = col.len();
                col.push(k as u32);
                value.push(v);
            } else {
                value[slot[k]] += v;
            }
        };
        if let Some(k) = aggregate[i] {
            add(k, 1.0);
        }
        let (cols, values) = a.row(i);
        for (&j, v) in cols.iter().zip(values) {
            if let Some(k) = aggregate[j as usize] {
                add(k, -omega * v / diagonal[i]);
            }
        }
        // A neighbour's part may cancel to nothing inside an aggregate.
        let mut keep = first;
        for k in first..col.len() {
            slot[col[k] as usize] = usize::MAX;
            if value[k].abs() > 1e-12 {
                (col[keep], value[keep]) = (col[k], value[k]);
                keep += 1;
            }
        }
        col.truncate(keep);
        value.truncate(keep);
        start.push(keep as u32);
    }
    let rows = Rows::new(count, start, col, value);
    // Twice transposed, columns are in order.
    Prolongation::from_columns(rows.transpose()).map(Some)
}

/// The factor of the Jacobi step: the largest eigenvalue of D⁻¹A is at most its largest row sum of absolute values.
fn damping(a: RowsRef<'_>, diagonal: &[f64]) -> f64 {
    let sum = |i: usize| a.row(i).1.iter().map(|v| v.abs()).sum::<f64>();
    let bound = (0..diagonal.len())
        .map(|i| sum(i) / diagonal[i])
        .fold(0.0, f64::max);
    4.0 / (3.0 * bound)
}

/// The offset of the prolongation for the affine problem A x + q = 0: the result of the same Jacobi step from 0.
pub(super) fn offset(a: &Rows, q: &[f64]) -> Vec<f64> {
    let a = a.view();
    let diagonal = diagonal(a, q.len());
    let omega = damping(a, &diagonal);
    q.iter().zip(&diagonal).map(|(q, d)| -omega * q / d).collect()
}

fn diagonal(a: RowsRef<'_>, n: usize) -> Vec<f64> {
    (0..n)
        .map(|i| {
            let (cols, values) = a.row(i);
            cols.binary_search(&(i as u32)).map_or(0.0, |k| values[k])
        })
        .collect()
}

/// The aggregate of each unknown (`None` for those without strong neighbours), and their number.
fn aggregates(a: RowsRef<'_>, diagonal: &[f64]) -> (Vec<Option<usize>>, usize) {
    let n = diagonal.len();
    let strong = |i: usize| {
        let (cols, values) = a.row(i);
        cols.iter().zip(values).filter_map(move |(&j, v)| {
            let j = j as usize;
            (j != i && v * v > STRONG * STRONG * diagonal[i] * diagonal[j]).then_some(j)
        })
    };
    let mut aggregate: Vec<Option<usize>> = vec![None; n];
    let mut count = 0;
    for i in 0..n {
        if aggregate[i].is_some() || strong(i).next().is_none() || strong(i).any(|j| aggregate[j].is_some()) {
            continue;
        }
        aggregate[i] = Some(count);
        strong(i).for_each(|j| aggregate[j] = Some(count));
        count += 1;
    }
    let roots = aggregate.clone();
    for i in 0..n {
        if aggregate[i].is_none() {
            aggregate[i] = strong(i).find_map(|j| roots[j]);
        }
    }
    for i in 0..n {
        if aggregate[i].is_none() && strong(i).next().is_some() {
            aggregate[i] = Some(count);
            for j in strong(i) {
                if aggregate[j].is_none() {
                    aggregate[j] = Some(count);
                }
            }
            count += 1;
        }
    }
    (aggregate, count)
}
