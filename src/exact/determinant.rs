use super::{Dictionary, Exact};

/// The sign of the determinant of a square matrix, row by row; `None` if that takes more work than is left in `work`, which is reduced by
/// the work done (numbers written, a long one counted as several).
pub(crate) fn determinant_sign(rows: &[&[Exact]], work: &mut u64) -> Option<i8> {
    let n = rows.len();
    let zero = Exact::default();
    let mut table = Dictionary::new(n, rows.iter().map(|row| (&zero, *row)));
    // Rows of few entries first: those of one cost nothing.
    let entries = |i: &usize| rows[*i].iter().filter(|e| !e.is_zero()).count();
    let mut sequence: Vec<usize> = (0..n).collect();
    sequence.sort_by_key(entries);
    let (mut sign, mut columns) = (1, vec![0; n]);
    for i in sequence {
        let Some((column, pivot)) = table.fix(i).ok()? else {
            return Some(0);
        };
        sign *= pivot;
        columns[i] = column - n;
        table.forget(column);
        *work = work.checked_sub(table.take_work())?;
    }
    Some(sign * parity(columns))
}

/// The sign of a permutation.
pub(crate) fn parity(mut order: Vec<usize>) -> i8 {
    let mut sign = 1;
    for k in 0..order.len() {
        while order[k] != k {
            let other = order[k];
            order.swap(k, other);
            sign = -sign;
        }
    }
    sign
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sign(rows: &[&[f64]], mut work: u64) -> Option<i8> {
        let exact: Vec<Vec<Exact>> = rows
            .iter()
            .map(|row| row.iter().map(|v| Exact::new(*v).unwrap()).collect())
            .collect();
        let rows: Vec<&[Exact]> = exact.iter().map(Vec::as_slice).collect();
        determinant_sign(&rows, &mut work)
    }

    #[test]
    fn the_last_bit_decides() {
        let thin = |d: f64| sign(&[&[1.0 + d, 1.0], &[1.0, 1.0]], 1000);
        let e = f64::EPSILON;
        assert_eq!([thin(e), thin(0.0), thin(-e)], [Some(1), Some(0), Some(-1)]);
        // A cyclic permutation of three is even, an exchange of two is odd.
        assert_eq!(
            sign(&[&[0.0, 1e300, 0.0], &[0.0, 0.0, 1e-300], &[3.0, 1.0, 7.0]], 1000),
            Some(1)
        );
        assert_eq!(sign(&[&[0.0, 2.0], &[2.0, 5.0]], 1000), Some(-1));
        assert_eq!(sign(&[], 0), Some(1));
        // One number is written.
        let limited = |work| sign(&[&[1.0, 2.0], &[3.0, 4.0]], work);
        assert_eq!([limited(0), limited(1)], [None, Some(-1)]);
    }
}
