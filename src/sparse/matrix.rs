use super::{Pattern, PatternRef, max_abs};
use crate::InputError;

/// Values over a [`Pattern`].
///
/// A map fills its Jacobian by [`add`](Self::add); contributions to one entry sum up. An addition outside the pattern is remembered and
/// reported by the solver that asked for the Jacobian, it is never silently dropped.
///
/// ```
/// use semismooth::sparse::{Matrix, Pattern};
/// let mut a = Matrix::zeros(Pattern::full(2, 2));
/// a.add(0, 1, 3.0);
/// a.add(0, 1, 1.0);
/// assert_eq!(a.get(0, 1), 4.0);
/// let mut y = [0.0; 2];
/// a.mul_vec(&[1.0, 2.0], &mut y);
/// assert_eq!(y, [8.0, 0.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "file::Unchecked")
)]
pub struct Matrix {
    pattern: Pattern,
    #[cfg_attr(feature = "serde", serde(with = "crate::extended::list"))]
    values: Vec<f64>,
    #[cfg_attr(
        feature = "serde",
        serde(skip_serializing_if = "Option::is_none", serialize_with = "file::refuse")
    )]
    stray: Option<(usize, usize)>,
}

#[cfg(feature = "serde")]
mod file {
    use serde::ser::{Error, Serializer};

    use super::{InputError, Matrix, Pattern};

    #[derive(serde::Deserialize)]
    #[serde(rename = "Matrix")]
    pub(super) struct Unchecked {
        pattern: Pattern,
        #[serde(with = "crate::extended::list")]
        values: Vec<f64>,
    }

    impl TryFrom<Unchecked> for Matrix {
        type Error = InputError;

        fn try_from(read: Unchecked) -> Result<Self, InputError> {
            Self::from_values(read.pattern, read.values)
        }
    }

    /// A matrix that lacks an addition is not serialised.
    pub(super) fn refuse<S: Serializer>(stray: &Option<(usize, usize)>, _: S) -> Result<S::Ok, S::Error> {
        let (row, col) = stray.unwrap_or_default();
        let what = format!("entry ({row}, {col}) was added outside the pattern of the matrix");
        Err(S::Error::custom(what))
    }
}

/// A borrowed matrix in compressed columns, as handed to a [linear solver](crate::linear::LinearSolver).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatrixRef<'a> {
    /// Where the entries are.
    pub pattern: PatternRef<'a>,
    /// Their values, in the order of the pattern.
    pub values: &'a [f64],
}

impl MatrixRef<'_> {
    /// Adds `scale * A x` to `y`. Lengths beyond the matrix are ignored.
    ///
    /// # Panics
    /// Where an entry lies in a row beyond the length of `y`.
    pub fn mul_add(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        let p = &self.pattern;
        for (j, &xj) in x.iter().enumerate().take(p.ncols) {
            let c = scale * xj;
            if c == 0.0 {
                continue;
            }
            let span = p.col_ptr[j]..p.col_ptr[j + 1];
            if span.len() == p.nrows {
                // A full column needs no row numbers.
                for (y, v) in y[..p.nrows].iter_mut().zip(&self.values[span]) {
                    *y += c * v;
                }
                continue;
            }
            for (&i, &v) in p.row_idx[span.clone()].iter().zip(&self.values[span]) {
                y[i] += c * v;
            }
        }
    }

    /// Adds |A| |x| to `y`: the sizes of the terms of A x.
    pub(crate) fn add_term_sizes(&self, x: &[f64], y: &mut [f64]) {
        let p = &self.pattern;
        for (j, w) in x.iter().map(|x| x.abs()).enumerate().take(p.ncols) {
            let span = p.col_ptr[j]..p.col_ptr[j + 1];
            if span.len() == p.nrows {
                for (y, v) in y[..p.nrows].iter_mut().zip(&self.values[span]) {
                    *y += v.abs() * w;
                }
                continue;
            }
            for (&i, &v) in p.row_idx[span.clone()].iter().zip(&self.values[span]) {
                y[i] += v.abs() * w;
            }
        }
    }

    /// Raises `y` to the largest modulus in each row.
    pub(crate) fn raise_to_largest(&self, y: &mut [f64]) {
        let p = &self.pattern;
        for span in p.col_ptr.windows(2).map(|w| w[0]..w[1]) {
            if span.len() == p.nrows {
                for (y, v) in y[..p.nrows].iter_mut().zip(&self.values[span]) {
                    *y = y.max(v.abs());
                }
                continue;
            }
            for (&i, &v) in p.row_idx[span.clone()].iter().zip(&self.values[span]) {
                y[i] = y[i].max(v.abs());
            }
        }
    }

    /// Adds `scale * Aᵀ x` to `y`. Lengths beyond the matrix are ignored.
    ///
    /// # Panics
    /// Where an entry lies in a row beyond the length of `x`.
    pub fn mul_transpose_add(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        let p = &self.pattern;
        for (j, yj) in y.iter_mut().enumerate().take(p.ncols) {
            let span = p.col_ptr[j]..p.col_ptr[j + 1];
            let dot: f64 = p.row_idx[span.clone()]
                .iter()
                .zip(&self.values[span])
                .map(|(&i, &v)| x[i] * v)
                .sum();
            *yj += scale * dot;
        }
    }

    /// The 1-norm: the largest column sum of absolute values.
    #[must_use]
    pub fn norm_1(&self) -> f64 {
        let p = &self.pattern;
        (0..p.ncols)
            .map(|j| {
                self.values[p.col_ptr[j]..p.col_ptr[j + 1]]
                    .iter()
                    .map(|v| v.abs())
                    .sum()
            })
            .fold(0.0, |a: f64, b: f64| if b > a || b.is_nan() { b } else { a })
    }
}

impl Matrix {
    /// The zero matrix over a pattern.
    #[must_use]
    pub fn zeros(pattern: Pattern) -> Self {
        let values = vec![0.0; pattern.nnz()];
        Self {
            pattern,
            values,
            stray: None,
        }
    }

    /// The identity of order `n`, stored on its diagonal.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        let pattern = Pattern::from_csc(n, n, (0..=n).collect(), (0..n).collect());
        match pattern {
            Ok(pattern) => Self {
                values: vec![1.0; n],
                pattern,
                stray: None,
            },
            Err(_) => unreachable!("the diagonal is a valid pattern"),
        }
    }

    /// A matrix over `pattern` with the given values.
    ///
    /// # Errors
    /// [`InputError::Length`] unless there is one value an entry.
    pub fn from_values(pattern: Pattern, values: Vec<f64>) -> Result<Self, InputError> {
        if values.len() != pattern.nnz() {
            return Err(InputError::Length {
                what: "the array of values",
                expected: pattern.nnz(),
                found: values.len(),
            });
        }
        Ok(Self {
            pattern,
            values,
            stray: None,
        })
    }

    /// A matrix from `(row, column, value)` triplets; repeated entries sum up.
    ///
    /// # Errors
    /// As [`Pattern::from_entries`].
    pub fn from_triplets(
        nrows: usize,
        ncols: usize,
        triplets: &[(usize, usize, f64)],
    ) -> Result<Self, InputError> {
        let pattern = Pattern::from_entries(nrows, ncols, triplets.iter().map(|t| (t.0, t.1)))?;
        let mut matrix = Self::zeros(pattern);
        for &(i, j, v) in triplets {
            matrix.add(i, j, v);
        }
        Ok(matrix)
    }

    /// A full matrix from its rows.
    ///
    /// # Errors
    /// [`InputError::Length`] unless all rows have one length.
    pub fn from_rows<R: AsRef<[f64]>>(rows: &[R]) -> Result<Self, InputError> {
        let nrows = rows.len();
        let ncols = rows.first().map_or(0, |r| r.as_ref().len());
        // All lengths first: the array may be as large as they say, and no larger.
        if let Some(row) = rows.iter().find(|row| row.as_ref().len() != ncols) {
            return Err(InputError::Length {
                what: "a row of the matrix",
                expected: ncols,
                found: row.as_ref().len(),
            });
        }
        let mut matrix = Self::zeros(Pattern::full(nrows, ncols));
        for (i, row) in rows.iter().enumerate() {
            let row = row.as_ref();
            for (j, &v) in row.iter().enumerate() {
                matrix.add(i, j, v);
            }
        }
        Ok(matrix)
    }

    /// Number of rows.
    #[must_use]
    pub fn nrows(&self) -> usize {
        self.pattern.nrows()
    }

    /// Number of columns.
    #[must_use]
    pub fn ncols(&self) -> usize {
        self.pattern.ncols()
    }

    /// The pattern.
    #[must_use]
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The values, in the order of the pattern.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The values, mutably.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// A borrowed view.
    #[must_use]
    pub fn as_ref(&self) -> MatrixRef<'_> {
        self.leading_columns(self.ncols())
    }

    /// A view of the first `ncols` columns.
    #[must_use]
    pub fn leading_columns(&self, ncols: usize) -> MatrixRef<'_> {
        let pattern = self.pattern.leading_columns(ncols);
        MatrixRef {
            pattern,
            values: &self.values[..pattern.nnz()],
        }
    }

    /// Sets all values to zero and discards stray additions.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
        self.stray = None;
    }

    /// R A C with diagonal R and C.
    pub(crate) fn scale(&mut self, rows: &[f64], columns: &[f64]) {
        for (j, column) in columns.iter().enumerate() {
            for e in self.pattern.col_ptr()[j]..self.pattern.col_ptr()[j + 1] {
                self.values[e] *= rows[self.pattern.row_idx()[e]] * column;
            }
        }
    }

    /// Multiplies column j by `factors[j]`.
    pub(crate) fn scale_columns(&mut self, factors: &[f64]) {
        for (j, factor) in factors.iter().enumerate() {
            let (begin, end) = (self.pattern.col_ptr()[j], self.pattern.col_ptr()[j + 1]);
            self.values[begin..end].iter_mut().for_each(|v| *v *= factor);
        }
    }

    /// Sets the given rows to zero.
    pub(crate) fn clear_rows(&mut self, rows: &[usize]) {
        self.for_rows(rows, |_, v| *v = 0.0);
    }

    /// Multiplies column j by `factors[j]` in the given rows, each named once.
    pub(crate) fn scale_columns_in_rows(&mut self, factors: &[f64], rows: &[usize]) {
        self.for_rows(rows, |j, v| *v *= factors[j]);
    }

    /// Calls `f` with the column and the value of each stored entry in the given rows.
    fn for_rows(&mut self, rows: &[usize], mut f: impl FnMut(usize, &mut f64)) {
        let full = self.pattern.is_full();
        for j in 0..self.pattern.ncols() {
            let span = self.pattern.col_ptr()[j]..self.pattern.col_ptr()[j + 1];
            let column = &mut self.values[span.clone()];
            if full {
                rows.iter().for_each(|&i| f(j, &mut column[i]));
            } else {
                let entries = column.iter_mut().zip(&self.pattern.row_idx()[span]);
                entries.filter(|e| rows.contains(e.1)).for_each(|e| f(j, e.0));
            }
        }
    }

    /// Adds `value` to entry `(row, col)`.
    ///
    /// Cost: constant in a full column, else logarithmic in its number of entries.
    #[inline]
    pub fn add(&mut self, row: usize, col: usize, value: f64) {
        match self.pattern.slot(row, col) {
            Some(k) => self.values[k] += value,
            None => self.stray = Some((row, col)),
        }
    }

    /// Adds `scale * block` with its entry (0, 0) at `(row, col)`; linear in the entries of the columns touched.
    pub fn add_block(&mut self, row: usize, col: usize, scale: f64, block: &Matrix) {
        for j in 0..block.ncols() {
            if col + j >= self.ncols() {
                self.stray = Some((row, col + j));
                return;
            }
            let (start, end) = (
                self.pattern.col_ptr()[col + j],
                self.pattern.col_ptr()[col + j + 1],
            );
            let rows = &self.pattern.row_idx()[start..end];
            let mut k = 0;
            for e in block.pattern.col_ptr()[j]..block.pattern.col_ptr()[j + 1] {
                let target = row + block.pattern.row_idx()[e];
                while k < rows.len() && rows[k] < target {
                    k += 1;
                }
                if k < rows.len() && rows[k] == target {
                    self.values[start + k] += scale * block.values[e];
                } else {
                    self.stray = Some((target, col + j));
                }
            }
        }
    }

    /// Records an entry that the formula has but its own pattern lacks, also where this matrix has it in its pattern.
    pub(crate) fn refuse(&mut self, row: usize, col: usize) {
        self.stray = Some((row, col));
    }

    /// The last addition that fell outside the pattern since [`clear`](Self::clear), if any.
    #[must_use]
    pub fn stray(&self) -> Option<(usize, usize)> {
        self.stray
    }

    /// The value at `(row, col)`; zero where nothing is stored.
    #[must_use]
    pub fn get(&self, row: usize, col: usize) -> f64 {
        self.pattern.slot(row, col).map_or(0.0, |k| self.values[k])
    }

    /// All stored entries as `(row, column, value)`, column by column.
    pub fn triplets(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let ends = &self.pattern.col_ptr()[1..];
        let entries = self.pattern.row_idx().iter().zip(&self.values);
        let mut j = 0;
        entries.enumerate().map(move |(k, (&i, &v))| {
            while ends[j] <= k {
                j += 1;
            }
            (i, j, v)
        })
    }

    /// `y = A x`.
    ///
    /// # Panics
    /// Where an entry lies in a row beyond the length of `y`.
    pub fn mul_vec(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        self.as_ref().mul_add(1.0, x, y);
    }

    /// `y = Aᵀ x`.
    ///
    /// # Panics
    /// Where an entry lies in a row beyond the length of `x`.
    pub fn mul_transpose_vec(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        self.as_ref().mul_transpose_add(1.0, x, y);
    }

    /// The transpose.
    #[must_use]
    pub fn transpose(&self) -> Matrix {
        let (m, n) = (self.nrows(), self.ncols());
        let mut col_ptr = vec![0; m + 1];
        for &i in self.pattern.row_idx() {
            col_ptr[i + 1] += 1;
        }
        for i in 0..m {
            col_ptr[i + 1] += col_ptr[i];
        }
        let mut next = col_ptr.clone();
        let mut row_idx = vec![0; self.values.len()];
        let mut values = vec![0.0; self.values.len()];
        for (j, span) in self.pattern.col_ptr().windows(2).enumerate() {
            for k in span[0]..span[1] {
                let place = &mut next[self.pattern.row_idx()[k]];
                row_idx[*place] = j;
                values[*place] = self.values[k];
                *place += 1;
            }
        }
        match Pattern::from_csc(n, m, col_ptr, row_idx) {
            Ok(pattern) => Self {
                pattern,
                values,
                stray: None,
            },
            Err(_) => unreachable!("the transpose of a valid pattern is valid"),
        }
    }

    /// The worst violation of symmetry of a square matrix, (i, j, |A_ij − A_ji|), where it exceeds `tolerance` times the largest
    /// entry.
    pub(crate) fn asymmetry(&self, tolerance: f64) -> Option<(usize, usize, f64)> {
        if self.is_mirrored() {
            return None;
        }
        let (col_ptr, row_idx) = (self.pattern.col_ptr(), self.pattern.row_idx());
        let mut worst = (0, 0, 0.0);
        let mut meet = |row: usize, col: usize, difference: f64| {
            if difference.abs() > worst.2 {
                worst = (row, col, difference.abs());
            }
        };
        // Entries below the diagonal are visited by increasing columns, and so are their mirror images in each column: one pass finds them
        // all. Entries that it skips above the diagonal have no mirror image.
        let mut next = col_ptr.to_vec();
        for col in 0..self.pattern.ncols() {
            let mut first = next[col];
            while first < col_ptr[col + 1] && row_idx[first] < col {
                meet(row_idx[first], col, self.values[first]);
                first += 1;
            }
            for k in first..col_ptr[col + 1] {
                let row = row_idx[k];
                if row == col {
                    continue;
                }
                let (mut mirror, end) = (next[row], col_ptr[row + 1]);
                while mirror < end && row_idx[mirror] < col {
                    meet(row_idx[mirror], row, self.values[mirror]);
                    mirror += 1;
                }
                if mirror < end && row_idx[mirror] == col {
                    meet(row, col, self.values[k] - self.values[mirror]);
                    mirror += 1;
                } else {
                    meet(row, col, self.values[k]);
                }
                next[row] = mirror;
            }
        }
        (worst.2 > 0.0 && worst.2 > tolerance * max_abs(&self.values)).then_some(worst)
    }

    /// Whether a square matrix is symmetric to the last bit, as assembled ones are.
    fn is_mirrored(&self) -> bool {
        let (col_ptr, row_idx) = (self.pattern.col_ptr(), self.pattern.row_idx());
        // Entries above the diagonal are visited in the order of those below it in each column.
        let mut next = vec![0; self.ncols()];
        for col in 0..self.ncols() {
            let mut k = col_ptr[col];
            while k < col_ptr[col + 1] && row_idx[k] < col {
                let row = row_idx[k];
                let mirror = next[row];
                if mirror == col_ptr[row + 1]
                    || row_idx[mirror] != col
                    || self.values[mirror] != self.values[k]
                {
                    return false;
                }
                next[row] = mirror + 1;
                k += 1;
            }
            next[col] = k + usize::from(k < col_ptr[col + 1] && row_idx[k] == col);
        }
        next.iter().zip(&col_ptr[1..]).all(|(next, end)| next == end)
    }

    /// Checks that every value is finite.
    ///
    /// # Errors
    /// [`InputError::Entry`] names the first entry that is not.
    pub fn check_finite(&self) -> Result<(), InputError> {
        match self.triplets().find(|t| !t.2.is_finite()) {
            Some((row, col, value)) => Err(InputError::Entry { row, col, value }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Matrix;

    /// All patterns and values 1 or 2 beside the diagonal of 3 × 3 matrices, against a comparison of all pairs.
    #[test]
    fn violations_of_symmetry_are_found() {
        for code in 0..2 * 3_usize.pow(6) {
            let mut rest = code / 2;
            let mut entries = Vec::new();
            for (i, j) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
                if rest % 3 > 0 {
                    entries.push((i, j, (rest % 3) as f64));
                }
                rest /= 3;
            }
            entries.extend((0..3).filter(|_| code % 2 == 1).map(|i| (i, i, 2.0)));
            let a = Matrix::from_triplets(3, 3, &entries).unwrap();
            let difference = |i: usize, j: usize| (a.get(i, j) - a.get(j, i)).abs();
            let worst = difference(0, 1).max(difference(0, 2)).max(difference(1, 2));
            let found = a.asymmetry(1e-10);
            assert_eq!(found.map_or(0.0, |f| f.2), worst, "{entries:?}");
            assert!(found.is_none_or(|(i, j, d)| difference(i, j) == d), "{entries:?}");
        }
    }
}
