use std::sync::Arc;

use crate::InputError;

/// Where the entries of a matrix may be: compressed columns, zero-based, rows strictly increasing in each column.
///
/// Cloning is cheap (shared storage).
///
/// ```
/// use semismooth::sparse::Pattern;
/// let p = Pattern::from_entries(2, 3, [(1, 0), (0, 2), (1, 0)])?;
/// assert_eq!((p.nrows(), p.ncols(), p.nnz()), (2, 3, 2));
/// assert!(Pattern::full(2, 3).is_full());
/// # Ok::<(), semismooth::InputError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(try_from = "Inner"))]
pub struct Pattern {
    inner: Arc<Inner>,
}

#[derive(Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename = "Pattern")
)]
struct Inner {
    nrows: usize,
    ncols: usize,
    col_ptr: Vec<usize>,
    row_idx: Vec<usize>,
}

#[cfg(feature = "serde")]
impl serde::Serialize for Pattern {
    fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        self.inner.serialize(s)
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Inner> for Pattern {
    type Error = InputError;

    fn try_from(read: Inner) -> Result<Self, InputError> {
        Self::from_csc(read.nrows, read.ncols, read.col_ptr, read.row_idx)
    }
}

/// A borrowed pattern, as handed to a [linear solver](crate::linear::LinearSolver).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PatternRef<'a> {
    /// Number of rows.
    pub nrows: usize,
    /// Number of columns.
    pub ncols: usize,
    /// Column `j` owns the entries `col_ptr[j]..col_ptr[j + 1]`; length `ncols + 1`, first 0.
    pub col_ptr: &'a [usize],
    /// Row of each entry, strictly increasing inside a column.
    pub row_idx: &'a [usize],
}

impl<'a> PatternRef<'a> {
    /// The view of a square matrix.
    pub(crate) fn square(col_ptr: &'a [usize], row_idx: &'a [usize]) -> Self {
        let n = col_ptr.len().saturating_sub(1);
        Self {
            nrows: n,
            ncols: n,
            col_ptr,
            row_idx,
        }
    }

    /// Number of stored entries.
    #[must_use]
    pub fn nnz(&self) -> usize {
        self.row_idx.len()
    }

    /// Whether every entry is stored, so that values are a column-major dense array.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.nrows.checked_mul(self.ncols) == Some(self.nnz())
    }
}

impl Pattern {
    /// The pattern with every entry: 8 bytes each, 16 with the values of a matrix over it.
    ///
    /// # Panics
    /// Where `nrows` × `ncols` numbers do not fit into memory.
    #[must_use]
    pub fn full(nrows: usize, ncols: usize) -> Self {
        let mut row_idx = Vec::with_capacity(nrows.saturating_mul(ncols));
        (0..ncols).for_each(|_| row_idx.extend(0..nrows));
        let col_ptr = (0..=ncols).map(|j| j * nrows).collect();
        Self::new(nrows, ncols, col_ptr, row_idx)
    }

    /// The pattern holding the given `(row, column)` entries, in any order, repetitions merged.
    ///
    /// # Errors
    /// [`InputError::OutOfBounds`] names an entry outside the matrix; [`InputError::Malformed`] for more columns than memory holds.
    pub fn from_entries(
        nrows: usize,
        ncols: usize,
        entries: impl IntoIterator<Item = (usize, usize)>,
    ) -> Result<Self, InputError> {
        let mut list = Vec::new();
        for (row, col) in entries {
            if row >= nrows || col >= ncols {
                return Err(InputError::OutOfBounds {
                    row,
                    col,
                    nrows,
                    ncols,
                });
            }
            list.push((col, row));
        }
        list.sort_unstable();
        list.dedup();
        let mut col_ptr = Vec::new();
        let room = ncols.checked_add(1).map(|n| col_ptr.try_reserve_exact(n));
        if !matches!(room, Some(Ok(()))) {
            return Err(InputError::Malformed {
                what: format!("{ncols} columns do not fit into memory"),
            });
        }
        col_ptr.resize(ncols + 1, 0);
        for &(col, _) in &list {
            col_ptr[col + 1] += 1;
        }
        for j in 0..ncols {
            col_ptr[j + 1] += col_ptr[j];
        }
        let row_idx = list.into_iter().map(|(_, row)| row).collect();
        Ok(Self::new(nrows, ncols, col_ptr, row_idx))
    }

    /// The pattern given by compressed columns.
    ///
    /// # Errors
    /// [`InputError::Malformed`] when pointers decrease or do not match, or rows are out of range or not strictly increasing.
    pub fn from_csc(
        nrows: usize,
        ncols: usize,
        col_ptr: Vec<usize>,
        row_idx: Vec<usize>,
    ) -> Result<Self, InputError> {
        let malformed = |what: String| Err(InputError::Malformed { what });
        if col_ptr.len().checked_sub(1) != Some(ncols) {
            return malformed(format!(
                "{} column pointers for {ncols} columns; one more than columns is needed",
                col_ptr.len()
            ));
        }
        if col_ptr[0] != 0 || col_ptr[ncols] != row_idx.len() {
            return malformed(format!(
                "column pointers run from {} to {}, but there are {} entries",
                col_ptr[0],
                col_ptr[ncols],
                row_idx.len()
            ));
        }
        for j in 0..ncols {
            if col_ptr[j] > col_ptr[j + 1] || col_ptr[j + 1] > row_idx.len() {
                return malformed(format!("column pointer {} is out of order", j + 1));
            }
            let rows = &row_idx[col_ptr[j]..col_ptr[j + 1]];
            if rows.windows(2).any(|w| w[0] >= w[1]) {
                return malformed(format!("rows of column {j} are not strictly increasing"));
            }
            if let Some(&row) = rows.last()
                && row >= nrows
            {
                return Err(InputError::OutOfBounds {
                    row,
                    col: j,
                    nrows,
                    ncols,
                });
            }
        }
        Ok(Self::new(nrows, ncols, col_ptr, row_idx))
    }

    fn new(nrows: usize, ncols: usize, col_ptr: Vec<usize>, row_idx: Vec<usize>) -> Self {
        Self {
            inner: Arc::new(Inner {
                nrows,
                ncols,
                col_ptr,
                row_idx,
            }),
        }
    }

    /// Number of rows.
    #[must_use]
    pub fn nrows(&self) -> usize {
        self.inner.nrows
    }

    /// Number of columns.
    #[must_use]
    pub fn ncols(&self) -> usize {
        self.inner.ncols
    }

    /// Number of stored entries.
    #[must_use]
    pub fn nnz(&self) -> usize {
        self.inner.row_idx.len()
    }

    /// Whether every entry is stored.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.as_ref().is_full()
    }

    /// Column pointers, length `ncols + 1`.
    #[must_use]
    pub fn col_ptr(&self) -> &[usize] {
        &self.inner.col_ptr
    }

    /// Row of each entry.
    #[must_use]
    pub fn row_idx(&self) -> &[usize] {
        &self.inner.row_idx
    }

    /// A borrowed view.
    #[must_use]
    pub fn as_ref(&self) -> PatternRef<'_> {
        self.leading_columns(self.inner.ncols)
    }

    /// A view of the first `ncols` columns (all of them if there are fewer).
    #[must_use]
    pub fn leading_columns(&self, ncols: usize) -> PatternRef<'_> {
        let ncols = ncols.min(self.inner.ncols);
        PatternRef {
            nrows: self.inner.nrows,
            ncols,
            col_ptr: &self.inner.col_ptr[..=ncols],
            row_idx: &self.inner.row_idx[..self.inner.col_ptr[ncols]],
        }
    }

    /// Position of entry `(row, col)` among the values, if it is stored.
    #[must_use]
    #[inline]
    pub fn slot(&self, row: usize, col: usize) -> Option<usize> {
        let p = &*self.inner;
        if row >= p.nrows || col >= p.ncols {
            return None;
        }
        let (start, end) = (p.col_ptr[col], p.col_ptr[col + 1]);
        if end - start == p.nrows {
            return Some(start + row);
        }
        p.row_idx[start..end].binary_search(&row).ok().map(|k| start + k)
    }
}
