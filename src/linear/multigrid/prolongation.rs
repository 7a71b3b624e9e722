use std::sync::Arc;

use super::rows::{Rows, RowsRef};
use crate::input::check_length;
use crate::linear::LinearError;
use crate::sparse::Matrix;

/// Largest number of rows or entries: smoothers use short indices.
const MAX_ENTRIES: usize = u32::MAX as usize;

/// A map x = P y + b from the unknowns of a coarse problem to those of a finer one.
///
/// P interpolates; b carries what does not depend on the coarse unknowns (boundary values). Each coarse unknown is *represented* by
/// the fine one on which it has the largest weight: bounds of coarse problems are read there.
///
/// Cloning shares P.
#[derive(Debug, Clone)]
pub struct Prolongation {
    inner: Arc<Inner>,
    offset: Vec<f64>,
}

#[derive(Debug)]
struct Inner {
    /// P by rows, and Pᵀ by rows.
    rows: Rows,
    columns: Rows,
    representative: Vec<usize>,
}

impl Prolongation {
    /// From the matrix P: a row for each fine, a column for each coarse unknown; no offset.
    ///
    /// # Errors
    /// [`LinearError::NotFinite`]; [`LinearError::Solver`] for a matrix without columns, with an empty column, with as many columns
    /// as rows or more, or with more than 2³² entries.
    pub fn new(matrix: &Matrix) -> Result<Self, LinearError> {
        let refuse = |what: String| Err(LinearError::Solver { what });
        if matrix.ncols() == 0 || matrix.ncols() >= matrix.nrows() {
            return refuse(format!(
                "a prolongation has fewer columns than rows and at least one, not {} x {}",
                matrix.nrows(),
                matrix.ncols()
            ));
        }
        if matrix.values().len().max(matrix.nrows()) > MAX_ENTRIES {
            return refuse("a prolongation has more than 2^32 entries".to_owned());
        }
        if matrix.values().iter().any(|v| !v.is_finite()) {
            return Err(LinearError::NotFinite {
                what: "the prolongation",
            });
        }
        Self::from_columns(Rows::transposed(matrix.as_ref()))
    }

    pub(super) fn from_columns(columns: Rows) -> Result<Self, LinearError> {
        let mut representative = Vec::with_capacity(columns.nrows());
        for c in 0..columns.nrows() {
            let (rows, weights) = columns.view().row(c);
            let largest = (0..rows.len()).reduce(|a, b| if weights[b] > weights[a] { b } else { a });
            match largest {
                Some(k) => representative.push(rows[k] as usize),
                None => {
                    return Err(LinearError::Solver {
                        what: format!("column {c} of the prolongation is empty"),
                    });
                }
            }
        }
        let rows = columns.transpose();
        Ok(Self {
            inner: Arc::new(Inner {
                rows,
                columns,
                representative,
            }),
            offset: Vec::new(),
        })
    }

    pub(super) fn rows(&self) -> RowsRef<'_> {
        self.inner.rows.view()
    }

    pub(super) fn columns(&self) -> RowsRef<'_> {
        self.inner.columns.view()
    }

    /// Sets b, one entry a fine unknown.
    ///
    /// # Errors
    /// [`InputError::Length`](crate::InputError::Length) or [`LinearError::NotFinite`].
    pub fn with_offset(mut self, offset: Vec<f64>) -> Result<Self, LinearError> {
        check_length("the offset of the prolongation", offset.len(), self.num_fine())?;
        if offset.iter().any(|v| !v.is_finite()) {
            return Err(LinearError::NotFinite {
                what: "the offset of the prolongation",
            });
        }
        self.offset = offset;
        Ok(self)
    }

    /// Number of fine unknowns.
    #[must_use]
    pub fn num_fine(&self) -> usize {
        self.inner.rows.nrows()
    }

    /// Number of coarse unknowns.
    #[must_use]
    pub fn num_coarse(&self) -> usize {
        self.inner.columns.nrows()
    }

    /// b; empty when it is zero.
    #[must_use]
    pub fn offset(&self) -> &[f64] {
        &self.offset
    }

    /// For each coarse unknown the fine one that represents it.
    #[must_use]
    pub fn representatives(&self) -> &[usize] {
        &self.inner.representative
    }

    /// The coarse unknowns on which fine unknown `i` depends, with their weights.
    ///
    /// # Panics
    /// For `i` beyond the fine unknowns.
    pub fn parents(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (cols, weights) = self.rows().row(i);
        cols.iter().zip(weights).map(|(&j, &w)| (j as usize, w))
    }

    /// `fine = P coarse + b`.
    ///
    /// # Panics
    /// Unless the lengths are those of [`num_coarse`](Self::num_coarse) and [`num_fine`](Self::num_fine).
    pub fn prolong(&self, coarse: &[f64], fine: &mut [f64]) {
        let rows = self.rows();
        for (i, x) in fine.iter_mut().enumerate() {
            *x = rows.dot(i, coarse) + self.offset.get(i).copied().unwrap_or(0.0);
        }
    }

    /// The value of more than half of the parents of a fine unknown, by weight; `otherwise` where there is none: carries active sets from a
    /// coarse problem to a finer one.
    #[must_use]
    pub fn inherit<T: Copy + PartialEq>(&self, coarse: &[T], otherwise: T) -> Vec<T> {
        let most = |i: usize| {
            let parents = || {
                self.parents(i)
                    .filter_map(|(c, w)| Some((*coarse.get(c)?, w.abs())))
            };
            let half = 0.5 * parents().map(|p| p.1).sum::<f64>();
            let weight = |kind: T| parents().filter(|p| p.0 == kind).map(|p| p.1).sum::<f64>();
            let found = parents().map(|p| p.0).find(|&kind| weight(kind) > half);
            found.unwrap_or(otherwise)
        };
        (0..self.num_fine()).map(most).collect()
    }

    /// `coarse = Pᵀ fine`.
    ///
    /// # Panics
    /// Unless the lengths are those of [`num_fine`](Self::num_fine) and [`num_coarse`](Self::num_coarse).
    pub fn restrict(&self, fine: &[f64], coarse: &mut [f64]) {
        let columns = self.columns();
        for (c, y) in coarse.iter_mut().enumerate() {
            *y = columns.dot(c, fine);
        }
    }
}
