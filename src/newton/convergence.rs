//! When a residual counts as zero: relative to the terms that cancel in it, whatever the units of equations and unknowns.

pub(super) use crate::judge::{equilibrate, row_sizes};
use crate::sparse::MatrixRef;
use crate::sparse::norm;
use crate::tolerances::UNCANCELLED;

/// Result of [`is_small`].
#[derive(PartialEq, Clone, Copy)]
pub(super) enum Small {
    No,
    /// Only if rows whose terms vanish with them are at the rounding level of other rows, which `settled` does not confirm for all of them.
    Perhaps,
    Yes,
}

/// Room for [`is_small`]: three vectors as long as the residual.
pub(super) struct Scratch<'a> {
    pub(super) row: &'a mut [f64],
    pub(super) col: &'a mut [f64],
    pub(super) max: &'a mut [f64],
}

/// Whether |r| ≤ tolerance · size: in the norm and row by row.
///
/// The norm alone would accept a row in small units unsolved. Row by row alone is too strict for a row such as H_i = x_i at x_i ≈ 0,
/// whose terms vanish with it; such a row is compared, after equilibration, with the largest row that shares an unknown with it, whose
/// rounding limits the accuracy of that unknown. Where other rows determine the unknown more accurately, the residual of this row still
/// decreases: the row is exempted only where `settled` says that Newton steps no longer reduce it.
pub(super) fn is_small(
    r: &[f64],
    size: &[f64],
    tolerance: f64,
    jac: MatrixRef<'_>,
    settled: &[bool],
    work: Scratch<'_>,
) -> Small {
    // Terms above the largest number would hide any residual.
    if size.iter().any(|s| !s.is_finite()) || norm(r) > tolerance * norm(size) {
        return Small::No;
    }
    if r.iter().zip(size).all(|(r, s)| r.abs() <= tolerance * s) {
        return Small::Yes;
    }
    let Scratch { row, col, max } = work;
    equilibrate(jac, row, col, max);
    let entries = |j: usize| {
        let span = jac.pattern.col_ptr[j]..jac.pattern.col_ptr[j + 1];
        jac.pattern.row_idx[span.clone()].iter().zip(&jac.values[span])
    };
    // The largest row of each unknown, by its share in it.
    for (j, largest) in max.iter_mut().enumerate() {
        *largest = entries(j).fold(0.0, |m: f64, (&i, v)| {
            m.max((v * row[i] * col[j]).abs() * (size[i] * row[i]))
        });
    }
    for (j, largest) in max.iter().enumerate() {
        for (&i, v) in entries(j) {
            let share = (v * row[i] * col[j]).abs();
            if *v != 0.0 && r[i].abs() * row[i] <= tolerance * share * largest {
                row[i] = 0.0;
            }
        }
    }
    let mut small = Small::Yes;
    for i in 0..r.len() {
        let (r, s) = (r[i].abs(), size[i]);
        if r <= tolerance * s {
            continue;
        }
        if r < UNCANCELLED * s || row[i] != 0.0 {
            return Small::No;
        }
        if !settled[i] {
            small = Small::Perhaps;
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::{Scratch, Small, is_small, row_sizes};
    use crate::sparse::Matrix;

    /// x₀ is in one row with terms of 1e12 and in another with terms of 1. The rounding of the first exempts the residual of the second
    /// only where its terms vanish as well, not where they cancel to some digits.
    #[test]
    fn rows_whose_terms_cancel_are_not_excused_by_larger_ones() {
        let jac =
            Matrix::from_rows(&[vec![1.0, 0.0, 1.0], vec![1.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]]).unwrap();
        let small = |x: [f64; 3], left: f64, settled: bool| {
            let mut size = [0.0; 3];
            row_sizes(jac.as_ref(), &x, &mut size);
            let (mut row, mut col, mut max) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            let work = Scratch {
                row: &mut row,
                col: &mut col,
                max: &mut max,
            };
            is_small(&[0.0, left, 0.0], &size, 1e-12, jac.as_ref(), &[settled; 3], work)
        };
        let cancelling = [1.0, 1.0, 1e12];
        assert!(small(cancelling, 1e-13, false) == Small::Yes);
        for left in [1e-11, 1e-6, 1e-3] {
            assert!(small(cancelling, left, true) == Small::No, "{left:e}");
        }
        let vanishing = [1e-5, 1e-5, 1e12];
        assert!(small(vanishing, 1e-5, true) == Small::Yes);
        assert!(small(vanishing, 1e-5, false) == Small::Perhaps);
        assert!(small([1e3, 1e3, 1e12], 100.0, true) == Small::No);
    }

    /// A row with terms that are NaN is not exempted by another one, however large, nor one by terms that overflow.
    #[test]
    fn rows_without_sizes_are_not_solved() {
        let jac = Matrix::from_rows(&[[1.0, f64::NAN], [1.0, 0.0]]).unwrap();
        let (mut row, mut col, mut max) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let work = Scratch {
            row: &mut row,
            col: &mut col,
            max: &mut max,
        };
        let sizes = [f64::NAN, 1e15];
        assert!(is_small(&[1e-3, 0.0], &sizes, 1e-12, jac.as_ref(), &[true; 2], work) == Small::No);
        let work = Scratch {
            row: &mut row,
            col: &mut col,
            max: &mut max,
        };
        let sizes = [f64::INFINITY, 1e15];
        assert!(is_small(&[1e307, 0.0], &sizes, 1e-12, jac.as_ref(), &[true; 2], work) == Small::No);
    }

    /// x₀ is rounded in a row with terms of 1, of which it has a share of 1e-3: its own row, whose terms vanish, may have a residual as
    /// large.
    #[test]
    fn rows_are_excused_by_what_others_see_of_their_unknown() {
        let (share, tolerance) = (1e-3, 1e-8);
        let jac = Matrix::from_rows(&[[1.0, 0.0], [share, 1.0]]).unwrap();
        let small = |left: f64, settled: bool| {
            let (mut row, mut col, mut max) = ([0.0; 2], [0.0; 2], [0.0; 2]);
            let work = Scratch {
                row: &mut row,
                col: &mut col,
                max: &mut max,
            };
            is_small(
                &[left, 0.0],
                &[left, 1.0],
                tolerance,
                jac.as_ref(),
                &[settled; 2],
                work,
            )
        };
        let excused = tolerance * share;
        assert!(small(0.9 * excused, true) == Small::Yes);
        assert!(small(0.9 * excused, false) == Small::Perhaps);
        for left in [1.1 * excused, 0.9 * tolerance, 1.1 * tolerance] {
            assert!(small(left, true) == Small::No, "{left:e}");
        }
    }
}
