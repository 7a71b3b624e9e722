use super::LinearError;
use crate::InputError;
use crate::input::check_length;
use crate::sparse::{MatrixRef, PatternRef};

/// Order of the largest square array of numbers, 20 GB: elimination of it takes a day.
const MAX_DENSE: usize = 50_000;

/// A dense array of zeros, if it fits.
pub(crate) fn dense_zeros(nrows: usize, ncols: usize) -> Result<Vec<f64>, LinearError> {
    let size = nrows
        .checked_mul(ncols)
        .filter(|size| *size <= MAX_DENSE * MAX_DENSE);
    size.and_then(zeros).ok_or(LinearError::TooLarge { nrows, ncols })
}

/// So many zeros, if they fit: pages come from the system when they are first written to.
pub(super) fn zeros(size: usize) -> Option<Vec<f64>> {
    Vec::<f64>::new().try_reserve_exact(size).ok()?;
    Some(vec![0.0; size])
}

/// The pattern a solver has analysed, by its contents.
#[derive(Clone, Default)]
pub(super) struct PatternMemory {
    known: bool,
    n: usize,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
    /// Full, and the numbers of the rows are not written down.
    implied: bool,
}

impl PatternMemory {
    /// Stores a pattern; `false` when it is the one already stored.
    pub(super) fn learn(&mut self, p: PatternRef<'_>) -> Result<bool, LinearError> {
        if p.nrows != p.ncols {
            return Err(LinearError::NotSquare {
                nrows: p.nrows,
                ncols: p.ncols,
            });
        }
        if self.known && self.is(p) {
            return Ok(false);
        }
        self.known = false;
        validate(p)?;
        self.n = p.ncols;
        self.col_ptr.clear();
        self.col_ptr.extend_from_slice(p.col_ptr);
        self.row_idx.clear();
        self.row_idx.extend_from_slice(p.row_idx);
        self.implied = false;
        self.known = true;
        Ok(true)
    }

    /// [`learn`](Self::learn) of a full pattern, which takes no room.
    pub(super) fn learn_full(&mut self, n: usize) -> bool {
        if self.known && self.n == n && self.is_full() {
            return false;
        }
        self.n = n;
        self.col_ptr.clear();
        self.col_ptr.extend((0..=n).map(|j| j * n));
        self.row_idx.clear();
        self.implied = true;
        self.known = true;
        true
    }

    /// Writes out the implied row indices, for [`row_idx`](Self::row_idx).
    pub(super) fn write_down(&mut self) {
        if std::mem::take(&mut self.implied) {
            let n = self.n;
            self.row_idx.extend((0..n).flat_map(|_| 0..n));
        }
    }

    fn len(&self) -> usize {
        self.col_ptr.last().copied().unwrap_or(0)
    }

    /// Checks that a matrix lies over the known pattern.
    pub(super) fn check(&self, a: &MatrixRef<'_>) -> Result<(), LinearError> {
        if !self.known || !self.is(a.pattern) {
            return Err(LinearError::NotAnalyzed);
        }
        check_length("the array of values", a.values.len(), self.len())?;
        Ok(())
    }

    fn is(&self, p: PatternRef<'_>) -> bool {
        p.nrows == self.n
            && p.ncols == self.n
            && p.row_idx.len() == self.len()
            && p.col_ptr == self.col_ptr
            // A full pattern of this size is unique.
            && (self.is_full() || p.row_idx == self.row_idx)
    }

    pub(super) fn n(&self) -> usize {
        self.n
    }

    pub(super) fn is_full(&self) -> bool {
        self.n.checked_mul(self.n) == Some(self.len())
    }

    pub(super) fn col_ptr(&self) -> &[usize] {
        &self.col_ptr
    }

    pub(super) fn row_idx(&self) -> &[usize] {
        &self.row_idx
    }

    /// Forgets the pattern, after an analysis that failed half-way.
    pub(super) fn forget(&mut self) {
        self.known = false;
    }
}

/// The fields of a `PatternRef` are public, so they may have any content.
fn validate(p: PatternRef<'_>) -> Result<(), LinearError> {
    let nnz = p.row_idx.len();
    let pointers = p.col_ptr.len().checked_sub(1) == Some(p.ncols)
        && p.col_ptr[0] == 0
        && p.col_ptr[p.ncols] == nnz
        && p.col_ptr.windows(2).all(|w| w[0] <= w[1]);
    let rows = pointers
        && p.col_ptr.windows(2).all(|w| {
            let rows = &p.row_idx[w[0]..w[1]];
            rows.windows(2).all(|r| r[0] < r[1]) && rows.last().is_none_or(|&r| r < p.nrows)
        });
    if rows {
        Ok(())
    } else {
        Err(LinearError::Solver {
            what: "the pattern is not in compressed-column form".to_owned(),
        })
    }
}

/// Number of right-hand sides in `b` for a system of order `n`.
pub(super) fn count_rhs(n: usize, b: &[f64]) -> Result<usize, LinearError> {
    let k = b.len().checked_div(n).unwrap_or(0);
    if k * n != b.len() {
        return Err(LinearError::Input(InputError::Length {
            what: "the block of right-hand sides",
            expected: n * (k + 1),
            found: b.len(),
        }));
    }
    Ok(k)
}

/// Rejects NaN and infinity in an operand.
pub(super) fn check_finite(values: &[f64], what: &'static str) -> Result<(), LinearError> {
    if values.iter().fold(true, |ok, v| ok & v.is_finite()) {
        Ok(())
    } else {
        Err(LinearError::NotFinite { what })
    }
}
