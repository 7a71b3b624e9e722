use std::sync::{Arc, OnceLock};

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par};

use super::dense_lu::BLOCKED;
use super::{Cholesky, Hierarchical, LinearError, LinearSolver, dense_zeros};
use crate::InputError;
use crate::clock::Until;
use crate::input::check_length;
use crate::parallel;
use crate::sparse::{Matrix, Pattern, dot};

/// Columns that one thread takes at a time.
const COLUMNS: usize = 192;
/// Order of C above which products with it take more time than those with its hierarchical form.
const HIERARCHICAL: usize = 1000;

/// The condensation of A u + Bᵀ λ = f onto the few quantities v = B u: v = B A⁻¹ f − C λ with C = B A⁻¹ Bᵀ.
///
/// A is n × n, symmetric positive definite (its lower triangle is read); B is q × n and touches few of the n unknowns. Those
/// are eliminated last, so that C follows from the trailing block of the Cholesky factor: one factorisation, no right-hand
/// side for any row of B.
///
/// ```
/// use semismooth::linear::Condensation;
/// use semismooth::sparse::Matrix;
/// let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]])?;
/// let b = Matrix::from_rows(&[[1.0, 0.0]])?;
/// let condensation = Condensation::new(&a, &b)?;
/// assert!((condensation.compliance().get(0, 0) - 2.0 / 3.0).abs() < 1e-15);
/// let free = condensation.traces_of_solution(&[3.0, 0.0])?; // B A⁻¹ f
/// assert!((free[0] - 2.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Condensation {
    factor: Cholesky,
    /// Bᵀ, n × q.
    b_t: Matrix,
    compliance: Matrix,
    /// C once more, where it is large and has the structure.
    hierarchical: OnceLock<Option<Arc<Hierarchical>>>,
    /// The number k of unknowns that B touches, and Y = L⁻¹ Bᵀ at these, k × q, column-major.
    touched: usize,
    half: Vec<f64>,
}

impl Condensation {
    /// Factors A and forms C.
    ///
    /// # Complexity
    /// One sparse Cholesky factorisation of A, with nested dissection on a mesh about n^1.5 operations in the plane and n² in space, and
    /// q² k operations for C with k unknowns touched by B. C takes 16 q² bytes.
    ///
    /// # Errors
    /// Shapes that do not fit ([`InputError::Length`], [`LinearError::NotSquare`]), A not positive definite; more than 50 000 rows of
    /// B, or unknowns that it touches ([`LinearError::TooLarge`]).
    pub fn new(a: &Matrix, b: &Matrix) -> Result<Self, LinearError> {
        Self::within(a, b, Until::default())
    }

    /// [`new`](Self::new), or [`LinearError::TimeLimit`] after the time limit, which is checked between parts of the factorisation and of
    /// C.
    pub(crate) fn within(a: &Matrix, b: &Matrix, until: Until) -> Result<Self, LinearError> {
        let (q, touched) = (b.nrows(), touched(a, b)?);
        let mut factor = Cholesky::default();
        factor.analyze_with_last(a.pattern().as_ref(), &touched)?;
        if until.is_over() {
            return Err(LinearError::TimeLimit);
        }
        factor.factor_by_pivots(a.as_ref(), until)?;
        let l = factor.trailing_factor(&touched)?;
        let b_t = b.transpose();
        let rows = rows_at(&b_t, &touched);
        let (half, compliance) = if touched.len() < BLOCKED {
            small_compliance(&rows, touched.len(), &l)?
        } else {
            compliance(&rows, touched.len(), l, until)?
        };
        let compliance = symmetric(compliance, q)?;
        Ok(Self {
            factor,
            b_t,
            compliance,
            hierarchical: OnceLock::new(),
            touched: touched.len(),
            half,
        })
    }

    /// Bytes that [`new`](Self::new) takes at its peak, A and B not counted: the factor of A, of which only the pattern is computed, and
    /// dense matrices of the order of the rows of B. Nothing of that size is allocated.
    ///
    /// ```
    /// use semismooth::linear::Condensation;
    /// use semismooth::sparse::Matrix;
    /// let (a, b) = (Matrix::identity(1000), Matrix::from_triplets(1, 1000, &[(0, 7, 1.0)])?);
    /// let bytes = Condensation::memory(&a, &b)?;
    /// assert!(bytes >= 8 * 1000); // at least a diagonal factor
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Shapes that do not fit.
    pub fn memory(a: &Matrix, b: &Matrix) -> Result<u64, LinearError> {
        let touched = touched(a, b)?;
        let factor = Cholesky::memory_with_last(a.pattern().as_ref(), &touched)?;
        let (k, q) = (touched.len() as u64, b.nrows() as u64);
        let square = |a: u64, b: u64| 8u64.saturating_mul(a).saturating_mul(b);
        // Three at a time: L⁻¹, Y and S; S, Y and C; Y, C and the row indices of C.
        let dense = (2 * square(k, k))
            .max(square(k, k) + square(q, q))
            .max(2 * square(q, q));
        Ok(factor.saturating_add(square(k, q)).saturating_add(dense))
    }

    /// C = B A⁻¹ Bᵀ, q × q, full and exactly symmetric.
    #[must_use]
    pub fn compliance(&self) -> &Matrix {
        &self.compliance
    }

    /// Adds to the diagonal of C: the compliance of springs between the traces of the body and those of the law.
    pub(crate) fn add_to_diagonal(&mut self, springs: &[f64]) {
        let q = self.compliance.nrows();
        for (k, d) in springs.iter().enumerate().take(q) {
            self.compliance.values_mut()[k * q + k] += d;
        }
    }

    /// Sets the entries of C between the last traces to 0.
    pub(crate) fn clear_last(&mut self, count: usize) {
        let q = self.compliance.nrows();
        for column in self
            .compliance
            .values_mut()
            .chunks_exact_mut(q.max(1))
            .skip(q - count)
        {
            column[q - count..].fill(0.0);
        }
    }

    /// Brings C into hierarchical form where it is large, with the groups of traces that stay together.
    pub(crate) fn compress(&self, groups: impl FnOnce() -> Vec<Vec<usize>>) {
        if self.compliance.nrows() > HIERARCHICAL {
            self.hierarchical
                .get_or_init(|| Hierarchical::new(self.compliance.values(), &groups()).map(Arc::new));
        }
    }

    /// C in hierarchical form, if it has been found in [`compress`](Self::compress).
    pub(crate) fn hierarchical(&self) -> Option<&Arc<Hierarchical>> {
        self.hierarchical.get()?.as_ref()
    }

    /// ln det A.
    #[must_use]
    pub fn log_det(&self) -> f64 {
        self.factor.log_det().map_or(f64::NAN, |d| d.1)
    }

    /// B A⁻¹ f for one load or several: f holds n values for each, the result q for each.
    ///
    /// # Complexity
    /// A forward substitution for each load, which is linear in the entries of the factor (about n log n in the plane, n^1.33 in space),
    /// and q k operations with k unknowns touched by B.
    ///
    /// # Errors
    /// A right-hand side of the wrong length or not finite.
    pub fn traces_of_solution(&self, f: &[f64]) -> Result<Vec<f64>, LinearError> {
        let (n, q) = (self.b_t.nrows(), self.b_t.ncols());
        if n == 0 || f.is_empty() || !f.len().is_multiple_of(n) {
            self.check(f)?;
        }
        // B A⁻¹ f = (L⁻¹ Bᵀ)ᵀ (L⁻¹ f), and L⁻¹ Bᵀ vanishes except in the last rows.
        let solved = self.factor.forward(f)?;
        let mut v = Vec::with_capacity(q * f.len() / n.max(1));
        for y in solved.chunks_exact(n.max(1)) {
            let last = &y[n - self.touched..];
            v.extend((0..q).map(|i| dot(last, &self.half[i * self.touched..(i + 1) * self.touched])));
        }
        Ok(v)
    }

    /// Overwrites f by u = A⁻¹ (f − Bᵀ λ).
    ///
    /// # Complexity
    /// Two substitutions, linear in the entries of the factor (about n log n in the plane, n^1.33 in space).
    ///
    /// # Errors
    /// Wrong lengths, values that are not finite.
    pub fn expand(&self, lambda: &[f64], f: &mut [f64]) -> Result<(), LinearError> {
        self.check(f)?;
        check_length("the multiplier", lambda.len(), self.b_t.ncols())?;
        self.b_t.as_ref().mul_add(-1.0, lambda, f);
        self.factor.solve_shared(f)
    }

    /// v ← v − C λ, in the widest registers available.
    pub(crate) fn subtract_compliance(&self, lambda: &[f64], v: &mut [f64]) {
        let q = self.compliance.nrows();
        // By rows, which equal the columns of C: sums in several registers have smaller errors.
        let c = MatRef::from_row_major_slice(self.compliance.values(), q, q);
        matmul(
            MatMut::from_column_major_slice_mut(v, q, 1),
            Accum::Add,
            c,
            MatRef::from_column_major_slice(lambda, q, 1),
            -1.0,
            Par::Seq,
        );
    }

    fn check(&self, f: &[f64]) -> Result<(), LinearError> {
        if f.len() == self.b_t.nrows() {
            Ok(())
        } else {
            Err(LinearError::Input(InputError::Length {
                what: "the right-hand side",
                expected: self.b_t.nrows(),
                found: f.len(),
            }))
        }
    }
}

/// The unknowns that B touches.
fn touched(a: &Matrix, b: &Matrix) -> Result<Vec<usize>, LinearError> {
    let n = a.nrows();
    if a.ncols() != n {
        return Err(LinearError::NotSquare {
            nrows: n,
            ncols: a.ncols(),
        });
    }
    check_length("a row of B", b.ncols(), n)?;
    let columns = b.pattern().col_ptr();
    Ok((0..n).filter(|&j| columns[j] < columns[j + 1]).collect())
}

/// A row of B at the touched unknowns J: (place in J, value).
type Row = Vec<(usize, f64)>;

/// Y and the lower triangle of C.
type Compliance = (Vec<f64>, Vec<f64>);

fn rows_at(b_t: &Matrix, touched: &[usize]) -> Vec<Row> {
    let mut rows = vec![Row::new(); b_t.ncols()];
    for (j, row, v) in b_t.triplets() {
        // All unknowns that B touches are in J.
        if let Ok(place) = touched.binary_search(&j) {
            rows[row].push((place, v));
        }
    }
    rows
}

/// Y = L⁻¹ B_Jᵀ (k × q), where L Lᵀ is the Schur complement of A on J, and the lower triangle of C = Yᵀ Y (q × q), by columns.
fn small_compliance(rows: &[Row], k: usize, l: &[f64]) -> Result<Compliance, LinearError> {
    let q = rows.len();
    let mut y = dense_zeros(k, q)?;
    for (column, row) in y.chunks_exact_mut(k.max(1)).zip(rows) {
        row.iter().for_each(|&(place, v)| column[place] = v);
        for j in 0..k {
            column[j] /= l[j * k + j];
            let pivot = column[j];
            for (v, a) in column[j + 1..].iter_mut().zip(&l[j * k + j + 1..(j + 1) * k]) {
                *v -= pivot * a;
            }
        }
    }
    let mut c = dense_zeros(q, q)?;
    for i in 0..q {
        for j in 0..=i {
            c[j * q + i] = dot(&y[i * k..(i + 1) * k], &y[j * k..(j + 1) * k]);
        }
    }
    Ok((y, c))
}

/// The same by L⁻¹ and S⁻¹ = L⁻ᵀ L⁻¹: a row of B has few entries, and triangles cost a third of full matrices.
fn compliance(rows: &[Row], k: usize, l: Vec<f64>, until: Until) -> Result<Compliance, LinearError> {
    let q = rows.len();
    let mut inverse = dense_zeros(k, k)?;
    let factor = MatRef::from_column_major_slice(&l, k, k);
    // Column by column, in parallel: what is above the diagonal stays zero.
    parallel::parts(&mut inverse, k * COLUMNS, &|first, part| {
        if until.is_over() {
            return;
        }
        let (first, count) = (first / k, part.len() / k);
        (0..count).for_each(|c| part[c * k + first + c] = 1.0);
        let columns = MatMut::from_column_major_slice_mut(part, k, count);
        let live = k - first;
        solve_lower_triangular_in_place(
            factor.submatrix(first, first, live, live),
            columns.submatrix_mut(first, 0, live, count),
            Par::Seq,
        );
    });
    drop(l);
    let mut y = dense_zeros(k, q)?;
    for (column, row) in y.chunks_exact_mut(k).zip(rows) {
        for &(place, v) in row {
            let from = &inverse[place * k..(place + 1) * k];
            column.iter_mut().zip(from).for_each(|(y, a)| *y += v * a);
        }
    }
    let mut s = dense_zeros(k, k)?;
    let lower = MatRef::from_column_major_slice(&inverse, k, k);
    parallel::parts(&mut s, k * COLUMNS, &|first, part| {
        if until.is_over() {
            return;
        }
        let (first, count) = (first / k, part.len() / k);
        let live = k - first;
        triangular::matmul(
            MatMut::from_column_major_slice_mut(part, k, count).submatrix_mut(first, 0, live, count),
            BlockStructure::Rectangular,
            Accum::Replace,
            lower.submatrix(first, first, live, live).transpose(),
            BlockStructure::TriangularUpper,
            lower.submatrix(first, first, live, count),
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
    });
    drop(inverse);
    if until.is_over() {
        return Err(LinearError::TimeLimit);
    }
    let entry = |i: usize, j: usize| s[i.min(j) * k + i.max(j)];
    let mut c = dense_zeros(q, q)?;
    for (j, (column, right)) in c.chunks_exact_mut(q).zip(rows).enumerate() {
        for (v, left) in column[j..].iter_mut().zip(&rows[j..]) {
            for &(a, x) in left {
                *v += right.iter().map(|&(b, y)| x * y * entry(a, b)).sum::<f64>();
            }
        }
    }
    Ok((y, c))
}

/// The matrix with the given lower triangle.
fn symmetric(mut values: Vec<f64>, q: usize) -> Result<Matrix, LinearError> {
    for i in 0..q {
        for j in 0..i {
            values[i * q + j] = values[j * q + i];
        }
    }
    let not_finite = |_| LinearError::NotFinite {
        what: "the compliance",
    };
    let c = Matrix::from_values(Pattern::full(q, q), values).map_err(not_finite)?;
    c.check_finite().map_err(not_finite)?;
    Ok(c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// C λ entry by entry, of orders with and without a rest beside full registers.
    #[test]
    fn compliance_is_subtracted() {
        for q in [1, 3, 64, 83] {
            let n = q + 5;
            let entries = (0..n).flat_map(|i| {
                let next = (i + 1 < n).then_some((i, i + 1, -1.0));
                [Some((i, i, 2.5)), next, next.map(|(i, j, v)| (j, i, v))]
            });
            let entries: Vec<_> = entries.flatten().collect();
            let a = Matrix::from_triplets(n, n, &entries).unwrap();
            let rows: Vec<_> = (0..q).map(|k| (k, k + 2, 1.0 + k as f64 / 7.0)).collect();
            let b = Matrix::from_triplets(q, n, &rows).unwrap();
            let condensation = Condensation::new(&a, &b).unwrap();
            let c = condensation.compliance();
            let lambda: Vec<f64> = (0..q).map(|k| (1.0 + k as f64).sqrt()).collect();
            let mut v = vec![0.5; q];
            condensation.subtract_compliance(&lambda, &mut v);
            for (k, v) in v.iter().enumerate() {
                let product: f64 = (0..q).map(|l| c.get(k, l) * lambda[l]).sum();
                assert!((v - (0.5 - product)).abs() < 1e-13 * product.abs(), "{q}, {k}");
            }
        }
    }
}
